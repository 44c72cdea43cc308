// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/texture.h"

#include <fmt/format.h>

#include "backends/vulkan/formats.h"
#include "backends/vulkan/render_pass.h"
#include "backends/vulkan/result.h"

namespace nacre::vulkan {
namespace {

VkImageType image_type(rhi::TextureDimension dimension) {
    switch (dimension) {
        case rhi::TextureDimension::d1: return VK_IMAGE_TYPE_1D;
        case rhi::TextureDimension::d2:
        case rhi::TextureDimension::cube: return VK_IMAGE_TYPE_2D;
        case rhi::TextureDimension::d3: return VK_IMAGE_TYPE_3D;
    }
    return VK_IMAGE_TYPE_2D;
}

}  // namespace

Expected<std::unique_ptr<rhi::BackendTexture>> Texture::create(Context& context, const rhi::TextureDesc& desc) {
    std::unique_ptr<Texture> texture(new Texture(context));
    texture->desc = desc;
    texture->aspects = aspects_of(desc.format);
    const bool is_depth = rhi::info(desc.format).is_depth_stencil();
    const bool is_3d = desc.dimension == rhi::TextureDimension::d3;

    VkImageCreateInfo info{VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO};
    info.imageType = image_type(desc.dimension);
    info.format = to_vulkan(desc.format);
    info.extent = {desc.width, desc.height, is_3d ? desc.depth : 1};
    info.mipLevels = desc.mips;
    info.arrayLayers = is_3d ? 1 : desc.layers;
    info.samples = static_cast<VkSampleCountFlagBits>(desc.samples);
    info.tiling = VK_IMAGE_TILING_OPTIMAL;
    info.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
    if (has_any(desc.usage, rhi::TextureUsage::sampled)) info.usage |= VK_IMAGE_USAGE_SAMPLED_BIT;
    if (has_any(desc.usage, rhi::TextureUsage::storage)) info.usage |= VK_IMAGE_USAGE_STORAGE_BIT;
    if (has_any(desc.usage, rhi::TextureUsage::color_target)) info.usage |= VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
    if (has_any(desc.usage, rhi::TextureUsage::depth_target)) info.usage |= VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT;
    // Clears, mip generation and the front end's uploads and read-backs are copies, whatever the user asked for.
    VkFormatProperties facts{};
    context.instance->vk.GetPhysicalDeviceFormatProperties(context.physical->handle, info.format, &facts);
    if (facts.optimalTilingFeatures & VK_FORMAT_FEATURE_TRANSFER_SRC_BIT) info.usage |= VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
    if (facts.optimalTilingFeatures & VK_FORMAT_FEATURE_TRANSFER_DST_BIT) info.usage |= VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    if (desc.dimension == rhi::TextureDimension::cube) info.flags |= VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT;
    if (is_3d && has_any(desc.usage, rhi::TextureUsage::color_target))
        info.flags |= VK_IMAGE_CREATE_2D_ARRAY_COMPATIBLE_BIT;
    if (!is_depth && !rhi::info(desc.format).is_compressed()) info.flags |= VK_IMAGE_CREATE_MUTABLE_FORMAT_BIT;
    texture->usage = info.usage;

    const std::string subject = "texture " + in_quotes(desc.name);
    VkImageFormatProperties limits{};
    if (VkResult result = context.instance->vk.GetPhysicalDeviceImageFormatProperties(
            context.physical->handle, info.format, info.imageType, info.tiling, info.usage, info.flags, &limits);
        result != VK_SUCCESS)
        return nacre::fail(ErrorCode::unsupported, "create", subject,
                           fmt::format("this device cannot use format {} in this way ({})", rhi::info(desc.format).name,
                                       name_of(result)),
                           "Ask Capabilities::format_support first.");
    if (info.extent.width > limits.maxExtent.width || info.extent.height > limits.maxExtent.height ||
        info.extent.depth > limits.maxExtent.depth || info.mipLevels > limits.maxMipLevels ||
        info.arrayLayers > limits.maxArrayLayers || !(limits.sampleCounts & info.samples))
        return nacre::fail(
            ErrorCode::unsupported, "create", subject,
            fmt::format("{}x{}x{}, {} layers, {} mips, {} samples exceed what this device allows for "
                        "format {} and this usage: {}x{}x{}, {} layers, {} mips, sample counts {:#x}",
                        info.extent.width, info.extent.height, info.extent.depth, info.arrayLayers, info.mipLevels,
                        desc.samples, rhi::info(desc.format).name, limits.maxExtent.width, limits.maxExtent.height,
                        limits.maxExtent.depth, limits.maxArrayLayers, limits.maxMipLevels, limits.sampleCounts),
            "Use a smaller texture or another format.");
    if (VkResult result = context.vk.CreateImage(context.device, &info, nullptr, &texture->handle);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", subject);

    VkMemoryDedicatedRequirements dedicated{VK_STRUCTURE_TYPE_MEMORY_DEDICATED_REQUIREMENTS};
    VkMemoryRequirements2 requirements{VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2, &dedicated};
    VkImageMemoryRequirementsInfo2 which{VK_STRUCTURE_TYPE_IMAGE_MEMORY_REQUIREMENTS_INFO_2};
    which.image = texture->handle;
    context.vk.GetImageMemoryRequirements2(context.device, &which, &requirements);
    NACRE_TRY(texture->memory_,
              context.memory->allocate({.requirements = requirements.memoryRequirements,
                                        .kind = rhi::MemoryKind::device,
                                        .is_image = true,
                                        .prefers_dedicated = dedicated.prefersDedicatedAllocation != VK_FALSE ||
                                                             dedicated.requiresDedicatedAllocation != VK_FALSE,
                                        .dedicated_image = texture->handle,
                                        .subject = subject}));
    if (VkResult result = context.vk.BindImageMemory(context.device, texture->handle, texture->memory_.handle(),
                                                     texture->memory_.offset());
        result != VK_SUCCESS)
        return fail(context.check(result), "bind memory of", subject);
    texture->memory_bytes = texture->memory_.size();
    context.set_name(texture->handle, VK_OBJECT_TYPE_IMAGE, desc.name);
    return texture;
}

Texture::~Texture() {
    for (const CachedView& each : views_) {
        if (each.purpose == ViewPurpose::target) context_.render_passes->forget(each.handle);
        context_.vk.DestroyImageView(context_.device, each.handle, nullptr);
    }
    if (handle) context_.vk.DestroyImage(context_.device, handle, nullptr);
}

Expected<VkImageView> Texture::view(const rhi::ViewReference& range, ViewPurpose purpose) {
    for (const CachedView& each : views_)
        if (each.dimension == range.dimension && each.format == range.format && each.purpose == purpose &&
            each.base_mip == range.base_mip && each.mip_count == range.mip_count &&
            each.base_layer == range.base_layer && each.layer_count == range.layer_count)
            return each.handle;

    VkImageViewUsageCreateInfo view_usage{VK_STRUCTURE_TYPE_IMAGE_VIEW_USAGE_CREATE_INFO};
    switch (purpose) {
        // The format of the view may allow less than that of the texture.
        case ViewPurpose::sampled: view_usage.usage = VK_IMAGE_USAGE_SAMPLED_BIT; break;
        case ViewPurpose::storage: view_usage.usage = VK_IMAGE_USAGE_STORAGE_BIT; break;
        case ViewPurpose::target:
            view_usage.usage =
                usage & (VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT);
            break;
    }
    VkImageViewCreateInfo info{VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO, &view_usage};
    info.image = handle;
    // A render pass draws into one slice of a 3D texture, which is seen as a layer.
    info.viewType = purpose == ViewPurpose::target && range.dimension == rhi::ViewDimension::d3
                        ? VK_IMAGE_VIEW_TYPE_2D
                        : to_vulkan(range.dimension);
    info.format = to_vulkan(range.format);
    info.subresourceRange.aspectMask = purpose == ViewPurpose::target ? aspects : main_aspect_of(desc.format);
    info.subresourceRange.baseMipLevel = range.base_mip;
    info.subresourceRange.levelCount = range.mip_count;
    info.subresourceRange.baseArrayLayer = range.base_layer;
    info.subresourceRange.layerCount = range.layer_count;
    VkImageView view = VK_NULL_HANDLE;
    if (VkResult result = context_.vk.CreateImageView(context_.device, &info, nullptr, &view); result != VK_SUCCESS)
        return fail(context_.check(result), "create view of", "texture " + in_quotes(desc.name));
    context_.set_name(view, VK_OBJECT_TYPE_IMAGE_VIEW, desc.name);
    views_.push_back({range.dimension, range.format, purpose, range.base_mip, range.mip_count, range.base_layer,
                      range.layer_count, view});
    return view;
}

}  // namespace nacre::vulkan
