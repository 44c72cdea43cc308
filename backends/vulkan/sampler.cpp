// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/sampler.h"

#include <algorithm>

#include "backends/vulkan/formats.h"
#include "backends/vulkan/result.h"

namespace nacre::vulkan {
namespace {

VkFilter to_vulkan(rhi::Filter filter) { return filter == rhi::Filter::linear ? VK_FILTER_LINEAR : VK_FILTER_NEAREST; }

VkSamplerAddressMode to_vulkan(rhi::AddressMode mode) {
    switch (mode) {
        case rhi::AddressMode::repeat: return VK_SAMPLER_ADDRESS_MODE_REPEAT;
        case rhi::AddressMode::mirrored_repeat: return VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT;
        case rhi::AddressMode::clamp_to_edge: return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
        case rhi::AddressMode::clamp_to_border: return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER;
    }
    return VK_SAMPLER_ADDRESS_MODE_REPEAT;
}

VkBorderColor to_vulkan(rhi::BorderColor color) {
    switch (color) {
        case rhi::BorderColor::transparent_black: return VK_BORDER_COLOR_FLOAT_TRANSPARENT_BLACK;
        case rhi::BorderColor::opaque_black: return VK_BORDER_COLOR_FLOAT_OPAQUE_BLACK;
        case rhi::BorderColor::opaque_white: return VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE;
    }
    return VK_BORDER_COLOR_FLOAT_OPAQUE_BLACK;
}

}  // namespace

Expected<std::unique_ptr<rhi::BackendSampler>> Sampler::create(Context& context, const rhi::SamplerDesc& desc) {
    std::unique_ptr<Sampler> sampler(new Sampler(context));
    sampler->desc = desc;
    const VkPhysicalDeviceLimits& limits = context.physical->properties.limits;
    VkSamplerCreateInfo info{VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO};
    info.magFilter = to_vulkan(desc.magnify);
    info.minFilter = to_vulkan(desc.minify);
    info.mipmapMode = desc.mip == rhi::Filter::linear ? VK_SAMPLER_MIPMAP_MODE_LINEAR : VK_SAMPLER_MIPMAP_MODE_NEAREST;
    info.addressModeU = to_vulkan(desc.address_u);
    info.addressModeV = to_vulkan(desc.address_v);
    info.addressModeW = to_vulkan(desc.address_w);
    info.mipLodBias = std::clamp(desc.mip_bias, -limits.maxSamplerLodBias, limits.maxSamplerLodBias);
    info.anisotropyEnable = desc.max_anisotropy > 1.0f && context.capabilities.anisotropic_filtering;
    info.maxAnisotropy = info.anisotropyEnable ? std::min(desc.max_anisotropy, limits.maxSamplerAnisotropy) : 1.0f;
    info.compareEnable = desc.comparison;
    info.compareOp = vulkan::to_vulkan(desc.compare);
    info.minLod = desc.min_lod;
    info.maxLod = desc.max_lod;
    info.borderColor = to_vulkan(desc.border);
    if (VkResult result = context.vk.CreateSampler(context.device, &info, nullptr, &sampler->handle);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", "sampler " + in_quotes(desc.name));
    context.set_name(sampler->handle, VK_OBJECT_TYPE_SAMPLER, desc.name);
    return sampler;
}

Sampler::~Sampler() {
    if (handle) context_.vk.DestroySampler(context_.device, handle, nullptr);
}

}  // namespace nacre::vulkan
