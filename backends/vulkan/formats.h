// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/vulkan/loader.h"
#include "rhi/command_list.h"
#include "rhi/pipeline.h"

/// @file
/// Nacre's enumerations in Vulkan's.

namespace nacre::vulkan {

VkFormat to_vulkan(rhi::Format format);
VkCompareOp to_vulkan(rhi::CompareOperation operation);
VkStencilOp to_vulkan(rhi::StencilOperation operation);
VkBlendFactor to_vulkan(rhi::BlendFactor factor);
VkBlendOp to_vulkan(rhi::BlendOperation operation);
VkPrimitiveTopology to_vulkan(rhi::Topology topology);
VkImageViewType to_vulkan(rhi::ViewDimension dimension);
VkAttachmentLoadOp to_vulkan(rhi::LoadOperation load);
VkAttachmentStoreOp to_vulkan(rhi::StoreOperation store);
VkShaderStageFlags to_vulkan(rhi::ShaderStage stages);
VkDescriptorType to_vulkan(rhi::BindingType type);

/// All aspects of a format: color, or depth with stencil where the format has it.
VkImageAspectFlags aspects_of(rhi::Format format);
/// The aspect that shaders and copies see: color or depth.
VkImageAspectFlags main_aspect_of(rhi::Format format);
/// Bytes of a texel (or block) in a copy of the main aspect.
std::uint32_t copy_bytes_of(rhi::Format format);

}  // namespace nacre::vulkan
