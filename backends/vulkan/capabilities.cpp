// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/capabilities.h"

#include <algorithm>

#include "backends/vulkan/formats.h"

namespace nacre::vulkan {
namespace {

template <typename First, typename Second>
void chain(First& first, Second& second) {
    second.pNext = std::exchange(first.pNext, &second);
}

rhi::FormatSupport support_of(const Instance& instance, const PhysicalDevice& device, rhi::Format format) {
    VkFormatProperties facts{};
    instance.vk.GetPhysicalDeviceFormatProperties(device.handle, to_vulkan(format), &facts);
    const VkFormatFeatureFlags has = facts.optimalTilingFeatures;
    using enum rhi::FormatSupport;
    rhi::FormatSupport support = none;
    if (has & VK_FORMAT_FEATURE_SAMPLED_IMAGE_BIT) support |= sampled;
    if (has & VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT) support |= filtered;
    if (has & VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT) support |= color_target;
    if (has & VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BLEND_BIT) support |= blended;
    if (has & VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT) support |= depth_target;
    if (has & VK_FORMAT_FEATURE_STORAGE_IMAGE_BIT) support |= storage_image;
    if (has & VK_FORMAT_FEATURE_STORAGE_IMAGE_ATOMIC_BIT) support |= storage_atomic;
    if (facts.bufferFeatures & VK_FORMAT_FEATURE_VERTEX_BUFFER_BIT) support |= vertex;
    if (facts.bufferFeatures & VK_FORMAT_FEATURE_UNIFORM_TEXEL_BUFFER_BIT) support |= uniform_texel_buffer;
    if (facts.bufferFeatures & VK_FORMAT_FEATURE_STORAGE_TEXEL_BUFFER_BIT) support |= storage_texel_buffer;
    if (facts.bufferFeatures & VK_FORMAT_FEATURE_STORAGE_TEXEL_BUFFER_ATOMIC_BIT)
        support |= storage_texel_buffer_atomic;
    const bool is_color_target = has & VK_FORMAT_FEATURE_COLOR_ATTACHMENT_BIT;
    const bool is_depth_target = has & VK_FORMAT_FEATURE_DEPTH_STENCIL_ATTACHMENT_BIT;
    if (is_color_target || is_depth_target) {
        VkImageFormatProperties image{};
        const VkImageUsageFlags usage =
            is_color_target ? VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT : VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT;
        if (instance.vk.GetPhysicalDeviceImageFormatProperties(device.handle, to_vulkan(format), VK_IMAGE_TYPE_2D,
                                                               VK_IMAGE_TILING_OPTIMAL, usage, 0,
                                                               &image) == VK_SUCCESS &&
            (image.sampleCounts & VK_SAMPLE_COUNT_4_BIT))
            support |= multisampled;
    }
    return support;
}

/// Textures that one unbounded array may hold beside what else a pipeline binds.
std::uint32_t bindless_limit(const PhysicalDevice& device, const VkPhysicalDeviceVulkan12Features& enabled) {
    const VkPhysicalDeviceLimits& limits = device.properties.limits;
    const VkPhysicalDeviceVulkan12Properties& later = device.vulkan12;
    // With update-after-bind the larger of the two sets of limits counts.
    const std::uint32_t limit =
        enabled.descriptorBindingSampledImageUpdateAfterBind
            ? std::min({later.maxPerStageDescriptorUpdateAfterBindSampledImages,
                        later.maxPerStageDescriptorUpdateAfterBindSamplers,
                        later.maxDescriptorSetUpdateAfterBindSampledImages,
                        later.maxDescriptorSetUpdateAfterBindSamplers, later.maxPerStageUpdateAfterBindResources,
                        later.maxUpdateAfterBindDescriptorsInAllPools})
            : std::min({limits.maxPerStageDescriptorSampledImages, limits.maxPerStageDescriptorSamplers,
                        limits.maxPerStageResources});
    constexpr std::uint32_t for_others = 256, more_than_any_table_needs = 1u << 20;
    return std::min(limit > 2 * for_others ? limit - for_others : limit / 2, more_than_any_table_needs);
}

}  // namespace

std::vector<const char*> choose_features(const PhysicalDevice& device, bool dynamic_rendering, bool synchronization2,
                                         FeatureChain& enabled) {
    const VkPhysicalDeviceFeatures& core = device.features.core.features;
    VkPhysicalDeviceFeatures& use = enabled.core.features;
#define NACRE_USE(name) use.name = core.name;
    NACRE_USE(robustBufferAccess)
    NACRE_USE(fullDrawIndexUint32)
    NACRE_USE(imageCubeArray)
    NACRE_USE(independentBlend)
    NACRE_USE(sampleRateShading)
    NACRE_USE(dualSrcBlend)
    NACRE_USE(multiDrawIndirect)
    NACRE_USE(drawIndirectFirstInstance)
    NACRE_USE(depthClamp)
    NACRE_USE(depthBiasClamp)
    NACRE_USE(fillModeNonSolid)
    NACRE_USE(largePoints)
    NACRE_USE(samplerAnisotropy)
    NACRE_USE(textureCompressionBC)
    NACRE_USE(occlusionQueryPrecise)
    NACRE_USE(vertexPipelineStoresAndAtomics)
    NACRE_USE(fragmentStoresAndAtomics)
    NACRE_USE(shaderImageGatherExtended)
    NACRE_USE(shaderStorageImageExtendedFormats)
    NACRE_USE(shaderStorageImageReadWithoutFormat)
    NACRE_USE(shaderStorageImageWriteWithoutFormat)
    NACRE_USE(shaderUniformBufferArrayDynamicIndexing)
    NACRE_USE(shaderSampledImageArrayDynamicIndexing)
    NACRE_USE(shaderStorageBufferArrayDynamicIndexing)
    NACRE_USE(shaderStorageImageArrayDynamicIndexing)
    NACRE_USE(shaderClipDistance)
    NACRE_USE(shaderCullDistance)
    NACRE_USE(shaderFloat64)
    NACRE_USE(shaderInt64)
    NACRE_USE(shaderInt16)
#undef NACRE_USE
    enabled.vulkan11.shaderDrawParameters = device.features.vulkan11.shaderDrawParameters;
    enabled.vulkan11.storageBuffer16BitAccess = device.features.vulkan11.storageBuffer16BitAccess;
    enabled.vulkan11.multiview = VK_FALSE;
#define NACRE_USE(name) enabled.vulkan12.name = device.features.vulkan12.name;
    NACRE_USE(timelineSemaphore)
    NACRE_USE(hostQueryReset)
    NACRE_USE(shaderInt8)
    NACRE_USE(shaderFloat16)
    NACRE_USE(storageBuffer8BitAccess)
    NACRE_USE(descriptorIndexing)
    NACRE_USE(runtimeDescriptorArray)
    NACRE_USE(descriptorBindingPartiallyBound)
    NACRE_USE(descriptorBindingVariableDescriptorCount)
    NACRE_USE(descriptorBindingSampledImageUpdateAfterBind)
    NACRE_USE(shaderSampledImageArrayNonUniformIndexing)
    NACRE_USE(uniformBufferStandardLayout)
    NACRE_USE(scalarBlockLayout)
#undef NACRE_USE
    chain(enabled.core, enabled.vulkan11);
    chain(enabled.core, enabled.vulkan12);

    std::vector<const char*> extensions;
    const bool core13 = device.version() >= VK_API_VERSION_1_3;
    if (dynamic_rendering) {
        enabled.dynamic_rendering.dynamicRendering = VK_TRUE;
        chain(enabled.core, enabled.dynamic_rendering);
        if (!core13) extensions.push_back(VK_KHR_DYNAMIC_RENDERING_EXTENSION_NAME);
    }
    if (synchronization2) {
        enabled.synchronization2.synchronization2 = VK_TRUE;
        chain(enabled.core, enabled.synchronization2);
        if (!core13) extensions.push_back(VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME);
    }
    if (core13 && device.features.demote.shaderDemoteToHelperInvocation) {
        enabled.demote.shaderDemoteToHelperInvocation = VK_TRUE;
        chain(enabled.core, enabled.demote);
    }
    if (device.has_robustness2) {
        // The second level of buffer robustness needs the first.
        enabled.robustness2.robustBufferAccess2 =
            device.features.robustness2.robustBufferAccess2 && use.robustBufferAccess;
        enabled.robustness2.robustImageAccess2 = device.features.robustness2.robustImageAccess2;
        enabled.robustness2.nullDescriptor = device.features.robustness2.nullDescriptor;
        chain(enabled.core, enabled.robustness2);
        extensions.push_back(VK_EXT_ROBUSTNESS_2_EXTENSION_NAME);
    }
    if (device.has_line_rasterization) {
        enabled.line_rasterization.bresenhamLines = VK_TRUE;
        chain(enabled.core, enabled.line_rasterization);
        extensions.push_back(VK_EXT_LINE_RASTERIZATION_EXTENSION_NAME);
    }
    if (device.has_ray_query) {
        enabled.vulkan12.bufferDeviceAddress = VK_TRUE;
        enabled.acceleration_structure.accelerationStructure = VK_TRUE;
        enabled.ray_query.rayQuery = VK_TRUE;
        chain(enabled.core, enabled.acceleration_structure);
        chain(enabled.core, enabled.ray_query);
        extensions.push_back(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME);
        extensions.push_back(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME);
        extensions.push_back(VK_KHR_RAY_QUERY_EXTENSION_NAME);
    }
    return extensions;
}

rhi::Capabilities capabilities_of(const Instance& instance, const PhysicalDevice& device, const FeatureChain& enabled) {
    const VkPhysicalDeviceFeatures& features = enabled.core.features;
    const VkPhysicalDeviceVulkan12Features& vulkan12 = enabled.vulkan12;
    const VkPhysicalDeviceLimits& limits = device.properties.limits;
    rhi::Capabilities result;
    result.storage_in_vertex = features.vertexPipelineStoresAndAtomics;
    result.storage_in_fragment = features.fragmentStoresAndAtomics;
    result.dual_source_blending = features.dualSrcBlend;
    result.independent_blend = features.independentBlend;
    result.descriptor_indexing = vulkan12.runtimeDescriptorArray && vulkan12.descriptorBindingPartiallyBound &&
                                 vulkan12.descriptorBindingVariableDescriptorCount &&
                                 vulkan12.shaderSampledImageArrayNonUniformIndexing;
    result.anisotropic_filtering = features.samplerAnisotropy;
    result.border_color = true;
    result.depth_clamp = features.depthClamp;
    result.depth_bias_clamp = features.depthBiasClamp;
    result.wireframe = features.fillModeNonSolid;
    result.cube_arrays = features.imageCubeArray;
    result.multi_draw_indirect = features.multiDrawIndirect;
    result.indirect_first_instance = features.drawIndirectFirstInstance;
    result.timestamps = device.timestamp_valid_bits > 0;
    result.precise_occlusion = features.occlusionQueryPrecise;
    constexpr VkSubgroupFeatureFlags subgroup_needed = VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_VOTE_BIT |
                                                       VK_SUBGROUP_FEATURE_ARITHMETIC_BIT |
                                                       VK_SUBGROUP_FEATURE_BALLOT_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_BIT;
    result.subgroup_operations = (device.vulkan11.subgroupSupportedStages & VK_SHADER_STAGE_COMPUTE_BIT) &&
                                 (device.vulkan11.subgroupSupportedOperations & subgroup_needed) == subgroup_needed;
    result.shader_float64 = features.shaderFloat64;
    result.shader_int64 = features.shaderInt64;
    result.shader_int16 = features.shaderInt16;
    result.shader_int8 = vulkan12.shaderInt8;
    result.sample_rate_shading = features.sampleRateShading;
    result.block_compression = features.textureCompressionBC;
    result.ray_query = enabled.ray_query.rayQuery;
    result.base_instance = true;
    result.texture_views = true;
    result.texture_view_formats = true;
    result.fill_storage_without_format = features.shaderStorageImageWriteWithoutFormat;
    result.sampler_mip_bias = true;
    result.texel_buffers = true;

    result.max_texture_1d = limits.maxImageDimension1D;
    result.max_texture_2d = limits.maxImageDimension2D;
    result.max_texture_3d = limits.maxImageDimension3D;
    result.max_texture_cube = limits.maxImageDimensionCube;
    result.max_texture_layers = limits.maxImageArrayLayers;
    result.max_color_targets = std::min({limits.maxColorAttachments, limits.maxFragmentOutputAttachments, 8u});
    result.max_dual_source_targets = features.dualSrcBlend ? limits.maxFragmentDualSrcAttachments : 0;
    const VkSampleCountFlags samples = limits.framebufferColorSampleCounts & limits.framebufferDepthSampleCounts;
    result.max_samples = samples & VK_SAMPLE_COUNT_4_BIT ? 4 : 1;
    result.max_integer_samples = device.vulkan12.framebufferIntegerColorSampleCounts & VK_SAMPLE_COUNT_4_BIT ? 4 : 1;
    result.max_bind_groups = std::min(limits.maxBoundDescriptorSets, 8u);
    result.max_push_constant_bytes = std::min(limits.maxPushConstantsSize, 256u);
    result.max_uniform_buffer_range = limits.maxUniformBufferRange;
    result.max_storage_buffer_range = limits.maxStorageBufferRange;
    for (std::uint32_t i = 0; i < device.memory.memoryHeapCount; ++i)
        result.device_memory_bytes = std::max(result.device_memory_bytes, device.memory.memoryHeaps[i].size);
    result.max_buffer_size = result.device_memory_bytes;
    if (device.maintenance4.maxBufferSize > 0)
        result.max_buffer_size = std::min(result.max_buffer_size, device.maintenance4.maxBufferSize);
    result.uniform_offset_alignment = static_cast<std::uint32_t>(limits.minUniformBufferOffsetAlignment);
    result.storage_offset_alignment = static_cast<std::uint32_t>(limits.minStorageBufferOffsetAlignment);
    result.texel_buffer_offset_alignment = static_cast<std::uint32_t>(limits.minTexelBufferOffsetAlignment);
    result.max_texel_buffer_elements = limits.maxTexelBufferElements;
    result.max_vertex_attributes = limits.maxVertexInputAttributes;
    result.max_vertex_buffers = std::min(limits.maxVertexInputBindings, 16u);
    result.max_vertex_stride = limits.maxVertexInputBindingStride;
    result.max_uniform_buffers.fill(limits.maxPerStageDescriptorUniformBuffers);
    result.max_storage_buffers.fill(limits.maxPerStageDescriptorStorageBuffers);
    result.max_sampled_textures.fill(limits.maxPerStageDescriptorSampledImages);
    result.max_samplers.fill(limits.maxPerStageDescriptorSamplers);
    result.max_storage_images.fill(limits.maxPerStageDescriptorStorageImages);
    const auto vertex = 0u, fragment = 1u;
    if (!result.storage_in_vertex) result.max_storage_buffers[vertex] = result.max_storage_images[vertex] = 0;
    if (!result.storage_in_fragment) result.max_storage_buffers[fragment] = result.max_storage_images[fragment] = 0;
    for (int axis = 0; axis < 3; ++axis) {
        result.max_workgroup_size[axis] = limits.maxComputeWorkGroupSize[axis];
        result.max_workgroup_count[axis] = limits.maxComputeWorkGroupCount[axis];
    }
    result.max_workgroup_invocations = limits.maxComputeWorkGroupInvocations;
    result.max_workgroup_memory_bytes = limits.maxComputeSharedMemorySize;
    result.subgroup_size = result.subgroup_operations ? device.vulkan11.subgroupSize : 0;
    if (result.descriptor_indexing) result.max_bindless_textures = bindless_limit(device, vulkan12);
    result.max_anisotropy = features.samplerAnisotropy ? limits.maxSamplerAnisotropy : 1.0f;
    result.max_line_width = 1.0f;
    result.max_point_size = features.largePoints ? limits.pointSizeRange[1] : 1.0f;
    result.timestamp_period_ns = limits.timestampPeriod;
    for (std::uint32_t i = 1; i < rhi::format_count; ++i)
        result.formats[i] = support_of(instance, device, static_cast<rhi::Format>(i));
    const auto rgba16_float = result.format_support(rhi::Format::rgba16_float);
    result.float_color_targets = has_all(rgba16_float, rhi::FormatSupport::color_target | rhi::FormatSupport::blended);
    return result;
}

}  // namespace nacre::vulkan
