// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/formats.h"

#include <array>

namespace nacre::vulkan {
namespace {

// In the order of rhi::Format.
// clang-format off
constexpr std::array<VkFormat, rhi::format_count> formats{
    VK_FORMAT_UNDEFINED,
    VK_FORMAT_R8_UNORM, VK_FORMAT_R8_SNORM, VK_FORMAT_R8_UINT, VK_FORMAT_R8_SINT,
    VK_FORMAT_R8G8_UNORM, VK_FORMAT_R8G8_SNORM, VK_FORMAT_R8G8_UINT, VK_FORMAT_R8G8_SINT,
    VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R8G8B8A8_SRGB, VK_FORMAT_R8G8B8A8_SNORM, VK_FORMAT_R8G8B8A8_UINT,
    VK_FORMAT_R8G8B8A8_SINT, VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_B8G8R8A8_SRGB,
    VK_FORMAT_R16_UNORM, VK_FORMAT_R16_SNORM, VK_FORMAT_R16_UINT, VK_FORMAT_R16_SINT, VK_FORMAT_R16_SFLOAT,
    VK_FORMAT_R16G16_UNORM, VK_FORMAT_R16G16_SNORM, VK_FORMAT_R16G16_UINT, VK_FORMAT_R16G16_SINT,
    VK_FORMAT_R16G16_SFLOAT,
    VK_FORMAT_R16G16B16A16_UNORM, VK_FORMAT_R16G16B16A16_SNORM, VK_FORMAT_R16G16B16A16_UINT,
    VK_FORMAT_R16G16B16A16_SINT, VK_FORMAT_R16G16B16A16_SFLOAT,
    VK_FORMAT_R32_UINT, VK_FORMAT_R32_SINT, VK_FORMAT_R32_SFLOAT,
    VK_FORMAT_R32G32_UINT, VK_FORMAT_R32G32_SINT, VK_FORMAT_R32G32_SFLOAT,
    VK_FORMAT_R32G32B32_UINT, VK_FORMAT_R32G32B32_SINT, VK_FORMAT_R32G32B32_SFLOAT,
    VK_FORMAT_R32G32B32A32_UINT, VK_FORMAT_R32G32B32A32_SINT, VK_FORMAT_R32G32B32A32_SFLOAT,
    VK_FORMAT_A2B10G10R10_UNORM_PACK32, VK_FORMAT_A2B10G10R10_UINT_PACK32, VK_FORMAT_B10G11R11_UFLOAT_PACK32,
    VK_FORMAT_E5B9G9R9_UFLOAT_PACK32,
    VK_FORMAT_D16_UNORM, VK_FORMAT_D32_SFLOAT, VK_FORMAT_D24_UNORM_S8_UINT, VK_FORMAT_D32_SFLOAT_S8_UINT,
    VK_FORMAT_BC1_RGBA_UNORM_BLOCK, VK_FORMAT_BC1_RGBA_SRGB_BLOCK, VK_FORMAT_BC2_UNORM_BLOCK,
    VK_FORMAT_BC2_SRGB_BLOCK, VK_FORMAT_BC3_UNORM_BLOCK, VK_FORMAT_BC3_SRGB_BLOCK,
    VK_FORMAT_BC4_UNORM_BLOCK, VK_FORMAT_BC4_SNORM_BLOCK, VK_FORMAT_BC5_UNORM_BLOCK, VK_FORMAT_BC5_SNORM_BLOCK,
    VK_FORMAT_BC6H_UFLOAT_BLOCK, VK_FORMAT_BC6H_SFLOAT_BLOCK, VK_FORMAT_BC7_UNORM_BLOCK, VK_FORMAT_BC7_SRGB_BLOCK,
};
// clang-format on

}  // namespace

VkFormat to_vulkan(rhi::Format format) { return formats[static_cast<std::uint32_t>(format)]; }

VkCompareOp to_vulkan(rhi::CompareOperation operation) {
    using enum rhi::CompareOperation;
    switch (operation) {
        case never: return VK_COMPARE_OP_NEVER;
        case less: return VK_COMPARE_OP_LESS;
        case equal: return VK_COMPARE_OP_EQUAL;
        case less_or_equal: return VK_COMPARE_OP_LESS_OR_EQUAL;
        case greater: return VK_COMPARE_OP_GREATER;
        case not_equal: return VK_COMPARE_OP_NOT_EQUAL;
        case greater_or_equal: return VK_COMPARE_OP_GREATER_OR_EQUAL;
        case always: return VK_COMPARE_OP_ALWAYS;
    }
    return VK_COMPARE_OP_ALWAYS;
}

VkStencilOp to_vulkan(rhi::StencilOperation operation) {
    using enum rhi::StencilOperation;
    switch (operation) {
        case keep: return VK_STENCIL_OP_KEEP;
        case zero: return VK_STENCIL_OP_ZERO;
        case replace: return VK_STENCIL_OP_REPLACE;
        case increment_clamp: return VK_STENCIL_OP_INCREMENT_AND_CLAMP;
        case decrement_clamp: return VK_STENCIL_OP_DECREMENT_AND_CLAMP;
        case invert: return VK_STENCIL_OP_INVERT;
        case increment_wrap: return VK_STENCIL_OP_INCREMENT_AND_WRAP;
        case decrement_wrap: return VK_STENCIL_OP_DECREMENT_AND_WRAP;
    }
    return VK_STENCIL_OP_KEEP;
}

VkBlendFactor to_vulkan(rhi::BlendFactor factor) {
    using enum rhi::BlendFactor;
    switch (factor) {
        case zero: return VK_BLEND_FACTOR_ZERO;
        case one: return VK_BLEND_FACTOR_ONE;
        case source_color: return VK_BLEND_FACTOR_SRC_COLOR;
        case one_minus_source_color: return VK_BLEND_FACTOR_ONE_MINUS_SRC_COLOR;
        case source_alpha: return VK_BLEND_FACTOR_SRC_ALPHA;
        case one_minus_source_alpha: return VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
        case destination_color: return VK_BLEND_FACTOR_DST_COLOR;
        case one_minus_destination_color: return VK_BLEND_FACTOR_ONE_MINUS_DST_COLOR;
        case destination_alpha: return VK_BLEND_FACTOR_DST_ALPHA;
        case one_minus_destination_alpha: return VK_BLEND_FACTOR_ONE_MINUS_DST_ALPHA;
        case constant_color: return VK_BLEND_FACTOR_CONSTANT_COLOR;
        case one_minus_constant_color: return VK_BLEND_FACTOR_ONE_MINUS_CONSTANT_COLOR;
        case source_alpha_saturated: return VK_BLEND_FACTOR_SRC_ALPHA_SATURATE;
        case source1_color: return VK_BLEND_FACTOR_SRC1_COLOR;
        case one_minus_source1_color: return VK_BLEND_FACTOR_ONE_MINUS_SRC1_COLOR;
        case source1_alpha: return VK_BLEND_FACTOR_SRC1_ALPHA;
        case one_minus_source1_alpha: return VK_BLEND_FACTOR_ONE_MINUS_SRC1_ALPHA;
    }
    return VK_BLEND_FACTOR_ONE;
}

VkBlendOp to_vulkan(rhi::BlendOperation operation) {
    using enum rhi::BlendOperation;
    switch (operation) {
        case add: return VK_BLEND_OP_ADD;
        case subtract: return VK_BLEND_OP_SUBTRACT;
        case reverse_subtract: return VK_BLEND_OP_REVERSE_SUBTRACT;
        case minimum: return VK_BLEND_OP_MIN;
        case maximum: return VK_BLEND_OP_MAX;
    }
    return VK_BLEND_OP_ADD;
}

VkPrimitiveTopology to_vulkan(rhi::Topology topology) {
    using enum rhi::Topology;
    switch (topology) {
        case point_list: return VK_PRIMITIVE_TOPOLOGY_POINT_LIST;
        case line_list: return VK_PRIMITIVE_TOPOLOGY_LINE_LIST;
        case line_strip: return VK_PRIMITIVE_TOPOLOGY_LINE_STRIP;
        case triangle_list: return VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
        case triangle_strip: return VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP;
    }
    return VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
}

VkImageViewType to_vulkan(rhi::ViewDimension dimension) {
    using enum rhi::ViewDimension;
    switch (dimension) {
        case d1: return VK_IMAGE_VIEW_TYPE_1D;
        case d1_array: return VK_IMAGE_VIEW_TYPE_1D_ARRAY;
        case automatic:
        case d2: return VK_IMAGE_VIEW_TYPE_2D;
        case d2_array: return VK_IMAGE_VIEW_TYPE_2D_ARRAY;
        case d3: return VK_IMAGE_VIEW_TYPE_3D;
        case cube: return VK_IMAGE_VIEW_TYPE_CUBE;
        case cube_array: return VK_IMAGE_VIEW_TYPE_CUBE_ARRAY;
    }
    return VK_IMAGE_VIEW_TYPE_2D;
}

VkAttachmentLoadOp to_vulkan(rhi::LoadOperation load) {
    switch (load) {
        case rhi::LoadOperation::load: return VK_ATTACHMENT_LOAD_OP_LOAD;
        case rhi::LoadOperation::clear: return VK_ATTACHMENT_LOAD_OP_CLEAR;
        case rhi::LoadOperation::discard: return VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    }
    return VK_ATTACHMENT_LOAD_OP_LOAD;
}

VkAttachmentStoreOp to_vulkan(rhi::StoreOperation store) {
    return store == rhi::StoreOperation::store ? VK_ATTACHMENT_STORE_OP_STORE : VK_ATTACHMENT_STORE_OP_DONT_CARE;
}

VkShaderStageFlags to_vulkan(rhi::ShaderStage stages) {
    VkShaderStageFlags flags = 0;
    if (has_any(stages, rhi::ShaderStage::vertex)) flags |= VK_SHADER_STAGE_VERTEX_BIT;
    if (has_any(stages, rhi::ShaderStage::fragment)) flags |= VK_SHADER_STAGE_FRAGMENT_BIT;
    if (has_any(stages, rhi::ShaderStage::compute)) flags |= VK_SHADER_STAGE_COMPUTE_BIT;
    return flags;
}

VkDescriptorType to_vulkan(rhi::BindingType type) {
    using enum rhi::BindingType;
    switch (type) {
        case uniform_buffer: return VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
        case storage_buffer:
        case readonly_storage_buffer: return VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
        case sampled_texture: return VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE;
        case sampler: return VK_DESCRIPTOR_TYPE_SAMPLER;
        case combined_texture_sampler: return VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
        case storage_image:
        case readonly_storage_image:
        case writeonly_storage_image: return VK_DESCRIPTOR_TYPE_STORAGE_IMAGE;
        case uniform_texel_buffer: return VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER;
        case storage_texel_buffer:
        case readonly_storage_texel_buffer:
        case writeonly_storage_texel_buffer: return VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER;
        case acceleration_structure: return VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR;
    }
    return VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
}

VkImageAspectFlags aspects_of(rhi::Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    VkImageAspectFlags aspects = 0;
    if (facts.has_depth) aspects |= VK_IMAGE_ASPECT_DEPTH_BIT;
    if (facts.has_stencil) aspects |= VK_IMAGE_ASPECT_STENCIL_BIT;
    return aspects ? aspects : VkImageAspectFlags{VK_IMAGE_ASPECT_COLOR_BIT};
}

VkImageAspectFlags main_aspect_of(rhi::Format format) {
    return rhi::info(format).has_depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT;
}

std::uint32_t copy_bytes_of(rhi::Format format) {
    // The depth aspect alone is packed into 4 bytes for both formats that have stencil too.
    return rhi::info(format).has_stencil ? 4 : rhi::info(format).block_bytes;
}

}  // namespace nacre::vulkan
