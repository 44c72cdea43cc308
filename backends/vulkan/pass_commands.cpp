// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "backends/vulkan/buffer.h"
#include "backends/vulkan/commands.h"
#include "backends/vulkan/formats.h"
#include "backends/vulkan/render_pass.h"
#include "backends/vulkan/result.h"

namespace nacre::vulkan {
namespace {

VkClearValue clear_value(const rhi::ClearColor& color) {
    VkClearValue value{};
    std::ranges::copy(color.uint, value.color.uint32);
    return value;
}

VkClearValue clear_value(float depth, std::uint8_t stencil) {
    VkClearValue value{};
    value.depthStencil = {depth, stencil};
    return value;
}

}  // namespace

void Commands::begin_pass(const rhi::BeginRenderPassCommand& command, const rhi::CommandStream& stream) {
    unset_state();
    pass_has_label_ = context_.debug_names && !stream.strings[command.name].empty();
    if (pass_has_label_) begin_label(stream.strings[command.name].c_str());
    if (context_.dynamic_rendering)
        begin_dynamic_rendering(command);
    else
        begin_render_pass(command);
    in_pass_ = true;
    const VkViewport viewport{0, 0, static_cast<float>(command.width), static_cast<float>(command.height), 0, 1};
    const VkRect2D scissor{{0, 0}, {command.width, command.height}};
    constexpr float blend_constants[4]{};
    vk_.CmdSetViewport(commands_, 0, 1, &viewport);
    vk_.CmdSetScissor(commands_, 0, 1, &scissor);
    vk_.CmdSetStencilReference(commands_, VK_STENCIL_FACE_FRONT_AND_BACK, 0);
    vk_.CmdSetBlendConstants(commands_, blend_constants);
}

void Commands::begin_dynamic_rendering(const rhi::BeginRenderPassCommand& command) {
    std::array<VkRenderingAttachmentInfo, max_color_targets> colors;
    for (std::uint32_t i = 0; i < command.color_count; ++i) {
        const rhi::ColorAttachmentCommand& from = command.colors()[i];
        VkRenderingAttachmentInfo& color = colors[i];
        color = {VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO};
        if (!from.view.texture.object) continue;
        auto view = native(*from.view.texture.object).view(from.view, ViewPurpose::target);
        if (!view) return fail_with(std::unexpected(std::move(view).error()));
        color.imageView = *view;
        color.imageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
        color.loadOp = to_vulkan(from.load);
        color.storeOp = to_vulkan(from.store);
        color.clearValue = clear_value(from.clear);
        if (!from.resolve.texture.object) continue;
        auto resolve = native(*from.resolve.texture.object).view(from.resolve, ViewPurpose::target);
        if (!resolve) return fail_with(std::unexpected(std::move(resolve).error()));
        color.resolveImageView = *resolve;
        color.resolveImageLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
        color.resolveMode =
            rhi::info(from.view.format).is_integer() ? VK_RESOLVE_MODE_SAMPLE_ZERO_BIT : VK_RESOLVE_MODE_AVERAGE_BIT;
    }
    VkRenderingInfo info{VK_STRUCTURE_TYPE_RENDERING_INFO};
    info.renderArea = {{0, 0}, {command.width, command.height}};
    info.layerCount = 1;
    info.colorAttachmentCount = command.color_count;
    info.pColorAttachments = colors.data();
    VkRenderingAttachmentInfo depth{VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO};
    VkRenderingAttachmentInfo stencil = depth;
    if (command.has_depth_stencil) {
        Texture& texture = native(*command.depth_stencil.texture.object);
        auto view = texture.view(command.depth_stencil, ViewPurpose::target);
        if (!view) return fail_with(std::unexpected(std::move(view).error()));
        depth.imageView = stencil.imageView = *view;
        depth.imageLayout = stencil.imageLayout = command.read_only ? VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL
                                                                    : VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL;
        depth.clearValue = stencil.clearValue = clear_value(command.clear_depth, command.clear_stencil);
        // What is only read keeps its content, whatever was said about storing it.
        depth.loadOp = to_vulkan(command.depth_load);
        depth.storeOp = command.read_only ? context_.read_only_store : to_vulkan(command.depth_store);
        stencil.loadOp = to_vulkan(command.stencil_load);
        stencil.storeOp = command.read_only ? context_.read_only_store : to_vulkan(command.stencil_store);
        if (texture.aspects & VK_IMAGE_ASPECT_DEPTH_BIT) info.pDepthAttachment = &depth;
        if (texture.aspects & VK_IMAGE_ASPECT_STENCIL_BIT) info.pStencilAttachment = &stencil;
    }
    vk_.CmdBeginRendering(commands_, &info);
}

void Commands::begin_render_pass(const rhi::BeginRenderPassCommand& command) {
    RenderPassKey key;
    FramebufferKey framebuffer_key;
    std::array<VkClearValue, 2 * max_color_targets + 1> clears{};
    const auto attach = [&](const rhi::ViewReference& range, VkClearValue clear) {
        auto view = native(*range.texture.object).view(range, ViewPurpose::target);
        if (!view) return fail_with(std::unexpected(std::move(view).error()));
        clears[framebuffer_key.view_count] = clear;
        framebuffer_key.views[framebuffer_key.view_count++] = *view;
    };
    key.color_count = command.color_count;
    key.samples = static_cast<VkSampleCountFlagBits>(std::max(command.samples, 1u));
    for (std::uint32_t i = 0; i < command.color_count; ++i) {
        const rhi::ColorAttachmentCommand& from = command.colors()[i];
        if (!from.view.texture.object) continue;
        key.colors[i] = {to_vulkan(from.view.format), to_vulkan(from.load), to_vulkan(from.store),
                         from.resolve.texture.object != nullptr};
        attach(from.view, clear_value(from.clear));
        if (from.resolve.texture.object) attach(from.resolve, {});
    }
    if (command.has_depth_stencil) {
        key.depth_format = to_vulkan(command.depth_stencil.format);
        key.depth_load = to_vulkan(command.depth_load);
        key.stencil_load = to_vulkan(command.stencil_load);
        key.depth_store = command.read_only ? context_.read_only_store : to_vulkan(command.depth_store);
        key.stencil_store = command.read_only ? context_.read_only_store : to_vulkan(command.stencil_store);
        key.depth_read_only = command.read_only;
        attach(command.depth_stencil, clear_value(command.clear_depth, command.clear_stencil));
    }
    if (!status_) return;
    auto pass = context_.render_passes->render_pass(key);
    if (!pass) return fail_with(std::unexpected(std::move(pass).error()));
    framebuffer_key.render_pass = *pass;
    framebuffer_key.width = command.width;
    framebuffer_key.height = command.height;
    auto framebuffer = context_.render_passes->framebuffer(framebuffer_key);
    if (!framebuffer) return fail_with(std::unexpected(std::move(framebuffer).error()));
    VkRenderPassBeginInfo info{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO};
    info.renderPass = *pass;
    info.framebuffer = *framebuffer;
    info.renderArea = {{0, 0}, {command.width, command.height}};
    info.clearValueCount = framebuffer_key.view_count;
    info.pClearValues = clears.data();
    vk_.CmdBeginRenderPass(commands_, &info, VK_SUBPASS_CONTENTS_INLINE);
}

void Commands::end_pass() {
    if (context_.dynamic_rendering)
        vk_.CmdEndRendering(commands_);
    else
        vk_.CmdEndRenderPass(commands_);
    if (pass_has_label_) end_label();
    in_pass_ = false;
    unset_state();
}

void Commands::draw_indirect(const rhi::DrawIndirectCommand& command) {
    prepare_draw();
    const VkBuffer arguments = native(*command.arguments.object).handle;
    const std::uint32_t limit = context_.physical->properties.limits.maxDrawIndirectCount;
    const std::uint32_t at_once = context_.capabilities.multi_draw_indirect ? std::max(limit, 1u) : 1;
    for (std::uint32_t done = 0; done < command.count; done += at_once)
        vk_.CmdDrawIndirect(commands_, arguments, command.offset + std::uint64_t{done} * command.stride,
                            std::min(at_once, command.count - done), command.stride);
}

void Commands::draw_indexed_indirect(const rhi::DrawIndexedIndirectCommand& command) {
    prepare_draw();
    const VkBuffer arguments = native(*command.arguments.object).handle;
    const std::uint32_t limit = context_.physical->properties.limits.maxDrawIndirectCount;
    const std::uint32_t at_once = context_.capabilities.multi_draw_indirect ? std::max(limit, 1u) : 1;
    for (std::uint32_t done = 0; done < command.count; done += at_once)
        vk_.CmdDrawIndexedIndirect(commands_, arguments, command.offset + std::uint64_t{done} * command.stride,
                                   std::min(at_once, command.count - done), command.stride);
}

}  // namespace nacre::vulkan
