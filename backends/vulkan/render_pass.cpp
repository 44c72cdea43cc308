// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/render_pass.h"

#include <algorithm>

#include "backends/vulkan/result.h"

namespace nacre::vulkan {

RenderPassCache::~RenderPassCache() {
    for (const auto& [key, framebuffer] : framebuffers_)
        context_.vk.DestroyFramebuffer(context_.device, framebuffer, nullptr);
    for (const auto& [key, pass] : render_passes_) context_.vk.DestroyRenderPass(context_.device, pass, nullptr);
}

Expected<VkRenderPass> RenderPassCache::render_pass(const RenderPassKey& key) {
    if (const auto found = render_passes_.find(key); found != render_passes_.end()) return found->second;

    std::vector<VkAttachmentDescription2> attachments;
    // Layouts change in barriers before the pass, never in the pass itself: first, within and last are the same.
    const auto attach = [&](VkFormat format, VkSampleCountFlagBits samples, VkImageLayout layout) {
        VkAttachmentDescription2 attachment{VK_STRUCTURE_TYPE_ATTACHMENT_DESCRIPTION_2};
        attachment.format = format;
        attachment.samples = samples;
        attachment.initialLayout = attachment.finalLayout = layout;
        attachment.loadOp = attachment.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
        attachment.storeOp = attachment.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
        attachments.push_back(attachment);
        VkAttachmentReference2 reference{VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_2};
        reference.attachment = static_cast<std::uint32_t>(attachments.size() - 1);
        reference.layout = layout;
        return reference;
    };
    VkAttachmentReference2 unused{VK_STRUCTURE_TYPE_ATTACHMENT_REFERENCE_2};
    unused.attachment = VK_ATTACHMENT_UNUSED;
    std::array<VkAttachmentReference2, max_color_targets> colors, resolves;
    colors.fill(unused);
    resolves.fill(unused);
    bool any_resolve = false;
    for (std::uint32_t i = 0; i < key.color_count; ++i) {
        const RenderPassKey::Color& color = key.colors[i];
        if (color.format == VK_FORMAT_UNDEFINED) continue;
        colors[i] = attach(color.format, key.samples, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL);
        colors[i].aspectMask = VK_IMAGE_ASPECT_COLOR_BIT;
        attachments.back().loadOp = color.load;
        attachments.back().storeOp = color.store;
        if (!color.is_resolved) continue;
        resolves[i] = attach(color.format, VK_SAMPLE_COUNT_1_BIT, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL);
        resolves[i].aspectMask = VK_IMAGE_ASPECT_COLOR_BIT;
        attachments.back().storeOp = VK_ATTACHMENT_STORE_OP_STORE;
        any_resolve = true;
    }
    VkAttachmentReference2 depth = unused;
    if (key.depth_format != VK_FORMAT_UNDEFINED) {
        depth = attach(key.depth_format, key.samples,
                       key.depth_read_only ? VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL
                                           : VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL);
        attachments.back().loadOp = key.depth_load;
        attachments.back().storeOp = key.depth_store;
        attachments.back().stencilLoadOp = key.stencil_load;
        attachments.back().stencilStoreOp = key.stencil_store;
    }
    VkSubpassDescription2 subpass{VK_STRUCTURE_TYPE_SUBPASS_DESCRIPTION_2};
    subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
    subpass.colorAttachmentCount = key.color_count;
    subpass.pColorAttachments = colors.data();
    subpass.pResolveAttachments = any_resolve ? resolves.data() : nullptr;
    subpass.pDepthStencilAttachment = key.depth_format != VK_FORMAT_UNDEFINED ? &depth : nullptr;
    VkRenderPassCreateInfo2 info{VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO_2};
    info.attachmentCount = static_cast<std::uint32_t>(attachments.size());
    info.pAttachments = attachments.data();
    info.subpassCount = 1;
    info.pSubpasses = &subpass;
    VkRenderPass pass = VK_NULL_HANDLE;
    if (VkResult result = context_.vk.CreateRenderPass2(context_.device, &info, nullptr, &pass); result != VK_SUCCESS)
        return fail(context_.check(result), "create", "render pass");
    render_passes_.emplace(key, pass);
    return pass;
}

Expected<VkFramebuffer> RenderPassCache::framebuffer(const FramebufferKey& key) {
    if (const auto found = framebuffers_.find(key); found != framebuffers_.end()) return found->second;
    VkFramebufferCreateInfo info{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO};
    info.renderPass = key.render_pass;
    info.attachmentCount = key.view_count;
    info.pAttachments = key.views.data();
    info.width = key.width;
    info.height = key.height;
    info.layers = 1;
    VkFramebuffer framebuffer = VK_NULL_HANDLE;
    if (VkResult result = context_.vk.CreateFramebuffer(context_.device, &info, nullptr, &framebuffer);
        result != VK_SUCCESS)
        return fail(context_.check(result), "create", "framebuffer");
    framebuffers_.emplace(key, framebuffer);
    return framebuffer;
}

void RenderPassCache::forget(VkImageView view) {
    std::erase_if(framebuffers_, [&](const auto& each) {
        if (std::ranges::find(each.first.views, view) == each.first.views.end()) return false;
        context_.vk.DestroyFramebuffer(context_.device, each.second, nullptr);
        return true;
    });
}

}  // namespace nacre::vulkan
