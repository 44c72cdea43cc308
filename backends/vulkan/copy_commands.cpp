// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "backends/vulkan/buffer.h"
#include "backends/vulkan/commands.h"
#include "backends/vulkan/formats.h"
#include "backends/vulkan/result.h"

namespace nacre::vulkan {
namespace {

VkOffset3D to_vulkan(const rhi::Offset3D& offset) {
    return {static_cast<std::int32_t>(offset.x), static_cast<std::int32_t>(offset.y),
            static_cast<std::int32_t>(offset.z)};
}

VkExtent3D to_vulkan(const rhi::Extent3D& extent) { return {extent.width, extent.height, extent.depth}; }

VkBufferImageCopy region_of(const rhi::BufferTextureCopy& from, rhi::Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    VkBufferImageCopy region{};
    region.bufferOffset = from.buffer_offset;
    region.bufferRowLength = from.bytes_per_row / copy_bytes_of(format) * facts.block_width;
    region.bufferImageHeight = from.rows_per_slice * facts.block_width;
    region.imageSubresource = {main_aspect_of(format), from.mip, from.layer, 1};
    region.imageOffset = to_vulkan(from.offset);
    region.imageExtent = to_vulkan(from.extent);
    return region;
}

VkImageSubresourceRange range_of(const rhi::ViewReference& view, VkImageAspectFlags aspects) {
    return {aspects, view.base_mip, view.mip_count, view.base_layer, view.layer_count};
}

}  // namespace

void Commands::copy(const rhi::CopyBufferToTextureCommand& command) {
    const Texture& texture = native(*command.destination.object);
    const VkBufferImageCopy region = region_of(command.region, texture.desc.format);
    vk_.CmdCopyBufferToImage(commands_, native(*command.source.object).handle, texture.handle,
                             VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
}

void Commands::copy(const rhi::CopyTextureToBufferCommand& command) {
    const Texture& texture = native(*command.source.object);
    const VkBufferImageCopy region = region_of(command.region, texture.desc.format);
    vk_.CmdCopyImageToBuffer(commands_, texture.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                             native(*command.destination.object).handle, 1, &region);
}

void Commands::copy(const rhi::CopyTextureCommand& command) {
    const Texture& source = native(*command.source.object);
    const Texture& destination = native(*command.destination.object);
    const rhi::TextureCopy& from = command.region;
    VkImageCopy region{};
    region.srcSubresource = {source.aspects, from.source_mip, from.source_layer, from.layer_count};
    region.srcOffset = to_vulkan(from.source_offset);
    region.dstSubresource = {destination.aspects, from.destination_mip, from.destination_layer, from.layer_count};
    region.dstOffset = to_vulkan(from.destination_offset);
    region.extent = to_vulkan(from.extent);
    vk_.CmdCopyImage(commands_, source.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, destination.handle,
                     VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
}

void Commands::clear(const rhi::ClearTextureCommand& command) {
    VkClearColorValue value;
    std::ranges::copy(command.color.uint, value.uint32);
    const VkImageSubresourceRange range = range_of(command.view, VK_IMAGE_ASPECT_COLOR_BIT);
    vk_.CmdClearColorImage(commands_, native(*command.view.texture.object).handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                           &value, 1, &range);
}

void Commands::clear(const rhi::ClearDepthStencilCommand& command) {
    const Texture& texture = native(*command.view.texture.object);
    const VkClearDepthStencilValue value{command.depth, command.stencil};
    const VkImageSubresourceRange range = range_of(command.view, texture.aspects);
    vk_.CmdClearDepthStencilImage(commands_, texture.handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, &value, 1, &range);
}

void Commands::generate_mips(Texture& texture) {
    const rhi::TextureDesc& desc = texture.desc;
    if (desc.mips < 2) return;
    VkFormatProperties facts{};
    context_.instance->vk.GetPhysicalDeviceFormatProperties(context_.physical->handle, vulkan::to_vulkan(desc.format),
                                                            &facts);
    constexpr VkFormatFeatureFlags needed = VK_FORMAT_FEATURE_BLIT_SRC_BIT | VK_FORMAT_FEATURE_BLIT_DST_BIT;
    if ((facts.optimalTilingFeatures & needed) != needed)
        return fail_with(nacre::fail(ErrorCode::unsupported, "generate mips of", "texture " + in_quotes(desc.name),
                                     fmt::format("this device cannot scale format {}", rhi::info(desc.format).name),
                                     "Fill the mips with Device::write_texture, or use another format."));
    const bool is_linear = (facts.optimalTilingFeatures & VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT) &&
                           !rhi::info(desc.format).is_integer() && !rhi::info(desc.format).is_depth_stencil();
    const std::uint32_t layers = desc.dimension == rhi::TextureDimension::d3 ? 1 : desc.layers;
    const auto corner = [&](std::uint32_t mip) {
        const rhi::Extent3D extent = rhi::mip_extent(desc, mip);
        return VkOffset3D{static_cast<std::int32_t>(extent.width), static_cast<std::int32_t>(extent.height),
                          static_cast<std::int32_t>(extent.depth)};
    };
    // The whole texture is in the layout of a copy's destination, and is left in it.
    for (std::uint32_t mip = 1; mip < desc.mips; ++mip) {
        barriers_.record_copy_transition(commands_, texture, mip - 1, 1, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                                         VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
        VkImageBlit region{};
        region.srcSubresource = {texture.aspects, mip - 1, 0, layers};
        region.srcOffsets[1] = corner(mip - 1);
        region.dstSubresource = {texture.aspects, mip, 0, layers};
        region.dstOffsets[1] = corner(mip);
        vk_.CmdBlitImage(commands_, texture.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texture.handle,
                         VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region,
                         is_linear ? VK_FILTER_LINEAR : VK_FILTER_NEAREST);
    }
    barriers_.record_copy_transition(commands_, texture, 0, desc.mips - 1, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                                     VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
}

}  // namespace nacre::vulkan
