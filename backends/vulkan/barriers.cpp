// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/barriers.h"

namespace nacre::vulkan {
namespace {

constexpr VkAccessFlags writing_accesses = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT |
                                           VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT |
                                           VK_ACCESS_HOST_WRITE_BIT | VK_ACCESS_MEMORY_WRITE_BIT |
                                           VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR;

VkPipelineStageFlags shader_stages(rhi::ShaderStage stages) {
    VkPipelineStageFlags flags = 0;
    if (has_any(stages, rhi::ShaderStage::vertex)) flags |= VK_PIPELINE_STAGE_VERTEX_SHADER_BIT;
    if (has_any(stages, rhi::ShaderStage::fragment)) flags |= VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT;
    if (has_any(stages, rhi::ShaderStage::compute)) flags |= VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
    return flags;
}

VkImageSubresourceRange range_of(const Texture& texture, std::uint32_t base_mip, std::uint32_t mip_count,
                                 std::uint32_t base_layer, std::uint32_t layer_count) {
    return {texture.aspects, base_mip, mip_count, base_layer, layer_count};
}

}  // namespace

Access access_of(const rhi::ResourceState& state) {
    using enum rhi::ResourceUse;
    Access result;
    const auto add = [&](rhi::ResourceUse use, VkPipelineStageFlags stages, VkAccessFlags access) {
        if (!has_any(state.use, use)) return;
        result.stages |= stages;
        result.access |= access;
    };
    constexpr VkPipelineStageFlags depth_stages =
        VK_PIPELINE_STAGE_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_LATE_FRAGMENT_TESTS_BIT;
    const VkPipelineStageFlags shaders = shader_stages(state.stages);
    add(vertex_buffer, VK_PIPELINE_STAGE_VERTEX_INPUT_BIT, VK_ACCESS_VERTEX_ATTRIBUTE_READ_BIT);
    add(index_buffer, VK_PIPELINE_STAGE_VERTEX_INPUT_BIT, VK_ACCESS_INDEX_READ_BIT);
    add(indirect_argument, VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT, VK_ACCESS_INDIRECT_COMMAND_READ_BIT);
    add(uniform_buffer, shaders, VK_ACCESS_UNIFORM_READ_BIT);
    add(sampled | storage_read, shaders, VK_ACCESS_SHADER_READ_BIT);
    add(storage_write, shaders, VK_ACCESS_SHADER_WRITE_BIT);
    // Resolves happen in the stage of color output, those of depth included.
    add(color_target | resolve_source | resolve_destination, VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT,
        VK_ACCESS_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT);
    add(depth_stencil_write, depth_stages,
        VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT);
    add(depth_stencil_read, depth_stages, VK_ACCESS_DEPTH_STENCIL_ATTACHMENT_READ_BIT);
    add(copy_source, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_READ_BIT);
    add(copy_destination, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT);
    add(host_read, VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT);
    constexpr VkPipelineStageFlags builds = VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
    add(build_input, builds, VK_ACCESS_SHADER_READ_BIT);
    // Builds of top levels read bottom levels, whatever shaders do.
    add(acceleration_structure_read, shaders | builds, VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR);
    add(acceleration_structure_write, builds,
        VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR | VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR);
    return result;
}

VkImageLayout layout_of(const Texture& texture, const rhi::ResourceState& state) {
    using enum rhi::ResourceUse;
    if (state.use == none) return VK_IMAGE_LAYOUT_UNDEFINED;
    if (has_any(state.use, storage_read | storage_write)) return VK_IMAGE_LAYOUT_GENERAL;
    if (has_any(state.use, depth_stencil_write)) return VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL;
    if (has_any(state.use, depth_stencil_read)) return VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL;
    if (has_any(state.use, color_target | resolve_source | resolve_destination))
        return VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    if (has_any(state.use, sampled)) return texture.sampled_layout();
    if (state.use == copy_source) return VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    if (state.use == copy_destination) return VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
    return VK_IMAGE_LAYOUT_GENERAL;
}

void BarrierRecorder::record(VkCommandBuffer commands, std::span<const rhi::Barrier> batch) {
    for (const rhi::Barrier& barrier : batch) add(barrier);
    flush(commands);
}

void BarrierRecorder::add(const rhi::Barrier& barrier) {
    Access before = access_of(barrier.before);
    const Access after = access_of(barrier.after);
    // Only writes need to be made available; reads before a write need to have been executed, no more.
    before.access &= writing_accesses;
    if (barrier.buffer || barrier.acceleration_structure) {
        has_memory_ = true;
        memory_before_.stages |= before.stages;
        memory_before_.access |= before.access;
        memory_after_.stages |= after.stages;
        memory_after_.access |= after.access;
        return;
    }
    const Texture& texture = static_cast<const Texture&>(*barrier.texture);
    ImageStep step{before, after, {VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER}};
    step.barrier.oldLayout = barrier.discard ? VK_IMAGE_LAYOUT_UNDEFINED : layout_of(texture, barrier.before);
    step.barrier.newLayout = layout_of(texture, barrier.after);
    step.barrier.srcQueueFamilyIndex = step.barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    step.barrier.image = texture.handle;
    step.barrier.subresourceRange =
        range_of(texture, barrier.base_mip, barrier.mip_count, barrier.base_layer, barrier.layer_count);
    images_.push_back(step);
}

void BarrierRecorder::record_copy_transition(VkCommandBuffer commands, const Texture& texture, std::uint32_t base_mip,
                                             std::uint32_t mip_count, VkImageLayout before, VkImageLayout after) {
    const auto access = [](VkImageLayout layout) -> Access {
        return {VK_PIPELINE_STAGE_TRANSFER_BIT, layout == VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL
                                                    ? VkAccessFlags{VK_ACCESS_TRANSFER_WRITE_BIT}
                                                    : VkAccessFlags{VK_ACCESS_TRANSFER_READ_BIT}};
    };
    ImageStep step{access(before), access(after), {VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER}};
    step.before.access &= writing_accesses;
    step.barrier.oldLayout = before;
    step.barrier.newLayout = after;
    step.barrier.srcQueueFamilyIndex = step.barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    step.barrier.image = texture.handle;
    step.barrier.subresourceRange = range_of(texture, base_mip, mip_count, 0, VK_REMAINING_ARRAY_LAYERS);
    images_.push_back(step);
    flush(commands);
}

void BarrierRecorder::flush(VkCommandBuffer commands) {
    if (!has_memory_ && images_.empty()) return;
    if (context_.synchronization2) {
        VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
        memory.srcStageMask = memory_before_.stages;
        memory.srcAccessMask = memory_before_.access;
        memory.dstStageMask = memory_after_.stages;
        memory.dstAccessMask = memory_after_.access;
        modern_.clear();
        for (const ImageStep& step : images_) {
            VkImageMemoryBarrier2& barrier = modern_.emplace_back();
            barrier = {VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
            barrier.srcStageMask = step.before.stages;
            barrier.srcAccessMask = step.before.access;
            barrier.dstStageMask = step.after.stages;
            barrier.dstAccessMask = step.after.access;
            barrier.oldLayout = step.barrier.oldLayout;
            barrier.newLayout = step.barrier.newLayout;
            barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
            barrier.image = step.barrier.image;
            barrier.subresourceRange = step.barrier.subresourceRange;
        }
        VkDependencyInfo dependency{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
        dependency.memoryBarrierCount = has_memory_ ? 1 : 0;
        dependency.pMemoryBarriers = &memory;
        dependency.imageMemoryBarrierCount = static_cast<std::uint32_t>(modern_.size());
        dependency.pImageMemoryBarriers = modern_.data();
        context_.vk.CmdPipelineBarrier2(commands, &dependency);
    } else {
        // One command has one pair of stage masks for all its barriers.
        VkPipelineStageFlags before = memory_before_.stages, after = memory_after_.stages;
        VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER};
        memory.srcAccessMask = memory_before_.access;
        memory.dstAccessMask = memory_after_.access;
        legacy_.clear();
        for (const ImageStep& step : images_) {
            before |= step.before.stages;
            after |= step.after.stages;
            VkImageMemoryBarrier& barrier = legacy_.emplace_back(step.barrier);
            barrier.srcAccessMask = step.before.access;
            barrier.dstAccessMask = step.after.access;
        }
        if (before == 0) before = VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT;
        if (after == 0) after = VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT;
        context_.vk.CmdPipelineBarrier(commands, before, after, 0, has_memory_ ? 1 : 0, &memory, 0, nullptr,
                                       static_cast<std::uint32_t>(legacy_.size()), legacy_.data());
    }
    memory_before_ = memory_after_ = {};
    has_memory_ = false;
    images_.clear();
}

}  // namespace nacre::vulkan
