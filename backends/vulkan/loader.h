// SPDX-License-Identifier: Apache-2.0
#pragma once

#define VK_NO_PROTOTYPES
#include <vulkan/vulkan_core.h>

#include <memory>

#include "core/dynamic_library.h"
#include "core/error.h"

/// @file
/// The Vulkan library, opened at run time, and its functions in tables: one of the library, one for each VkInstance,
/// one for each VkDevice (which skips the loader's dispatch).
///
///     NACRE_TRY(std::shared_ptr<const Library> library, Library::open());
///     library->vk.CreateInstance(...);
///
/// The members of the tables carry Vulkan's own names without the prefix.

namespace nacre::vulkan {

#define NACRE_VULKAN_GLOBAL_FUNCTIONS(X)    \
    X(EnumerateInstanceVersion)             \
    X(EnumerateInstanceExtensionProperties) \
    X(EnumerateInstanceLayerProperties)     \
    X(CreateInstance)

#define NACRE_VULKAN_INSTANCE_FUNCTIONS(X)    \
    X(DestroyInstance)                        \
    X(EnumeratePhysicalDevices)               \
    X(EnumerateDeviceExtensionProperties)     \
    X(GetPhysicalDeviceProperties)            \
    X(GetPhysicalDeviceProperties2)           \
    X(GetPhysicalDeviceFeatures2)             \
    X(GetPhysicalDeviceFormatProperties)      \
    X(GetPhysicalDeviceImageFormatProperties) \
    X(GetPhysicalDeviceMemoryProperties)      \
    X(GetPhysicalDeviceQueueFamilyProperties) \
    X(CreateDevice)                           \
    X(GetDeviceProcAddr)

/// Missing without VK_EXT_debug_utils.
#define NACRE_VULKAN_OPTIONAL_INSTANCE_FUNCTIONS(X) \
    X(CreateDebugUtilsMessengerEXT)                 \
    X(DestroyDebugUtilsMessengerEXT)

#define NACRE_VULKAN_DEVICE_FUNCTIONS(X) \
    X(DestroyDevice)                     \
    X(DeviceWaitIdle)                    \
    X(GetDeviceQueue)                    \
    X(QueueSubmit)                       \
    X(AllocateMemory)                    \
    X(FreeMemory)                        \
    X(MapMemory)                         \
    X(FlushMappedMemoryRanges)           \
    X(InvalidateMappedMemoryRanges)      \
    X(CreateBuffer)                      \
    X(DestroyBuffer)                     \
    X(GetBufferMemoryRequirements2)      \
    X(GetBufferDeviceAddress)            \
    X(BindBufferMemory)                  \
    X(CreateImage)                       \
    X(DestroyImage)                      \
    X(GetImageMemoryRequirements2)       \
    X(BindImageMemory)                   \
    X(CreateBufferView)                  \
    X(DestroyBufferView)                 \
    X(CreateImageView)                   \
    X(DestroyImageView)                  \
    X(CreateSampler)                     \
    X(DestroySampler)                    \
    X(CreateShaderModule)                \
    X(DestroyShaderModule)               \
    X(CreateDescriptorSetLayout)         \
    X(DestroyDescriptorSetLayout)        \
    X(CreateDescriptorPool)              \
    X(DestroyDescriptorPool)             \
    X(AllocateDescriptorSets)            \
    X(UpdateDescriptorSets)              \
    X(CreatePipelineLayout)              \
    X(DestroyPipelineLayout)             \
    X(CreatePipelineCache)               \
    X(DestroyPipelineCache)              \
    X(GetPipelineCacheData)              \
    X(MergePipelineCaches)               \
    X(CreateGraphicsPipelines)           \
    X(CreateComputePipelines)            \
    X(DestroyPipeline)                   \
    X(CreateRenderPass2)                 \
    X(DestroyRenderPass)                 \
    X(CreateFramebuffer)                 \
    X(DestroyFramebuffer)                \
    X(CreateQueryPool)                   \
    X(DestroyQueryPool)                  \
    X(ResetQueryPool)                    \
    X(GetQueryPoolResults)               \
    X(CreateSemaphore)                   \
    X(DestroySemaphore)                  \
    X(WaitSemaphores)                    \
    X(GetSemaphoreCounterValue)          \
    X(CreateCommandPool)                 \
    X(DestroyCommandPool)                \
    X(ResetCommandPool)                  \
    X(AllocateCommandBuffers)            \
    X(BeginCommandBuffer)                \
    X(EndCommandBuffer)                  \
    X(CmdBeginRenderPass)                \
    X(CmdEndRenderPass)                  \
    X(CmdBindPipeline)                   \
    X(CmdBindDescriptorSets)             \
    X(CmdPushConstants)                  \
    X(CmdBindVertexBuffers)              \
    X(CmdBindIndexBuffer)                \
    X(CmdSetViewport)                    \
    X(CmdSetScissor)                     \
    X(CmdSetStencilReference)            \
    X(CmdSetBlendConstants)              \
    X(CmdDraw)                           \
    X(CmdDrawIndexed)                    \
    X(CmdDrawIndirect)                   \
    X(CmdDrawIndexedIndirect)            \
    X(CmdDispatch)                       \
    X(CmdDispatchIndirect)               \
    X(CmdCopyBuffer)                     \
    X(CmdCopyBufferToImage)              \
    X(CmdCopyImageToBuffer)              \
    X(CmdCopyImage)                      \
    X(CmdBlitImage)                      \
    X(CmdFillBuffer)                     \
    X(CmdClearColorImage)                \
    X(CmdClearDepthStencilImage)         \
    X(CmdPipelineBarrier)                \
    X(CmdWriteTimestamp)                 \
    X(CmdResetQueryPool)                 \
    X(CmdBeginQuery)                     \
    X(CmdEndQuery)

/// Core in Vulkan 1.3, an extension of the same meaning before: looked up by the plain name, then with `KHR`.
#define NACRE_VULKAN_PROMOTED_DEVICE_FUNCTIONS(X) \
    X(CmdBeginRendering)                          \
    X(CmdEndRendering)                            \
    X(CmdPipelineBarrier2)

/// Missing without VK_EXT_debug_utils.
#define NACRE_VULKAN_OPTIONAL_DEVICE_FUNCTIONS(X) \
    X(SetDebugUtilsObjectNameEXT)                 \
    X(CmdBeginDebugUtilsLabelEXT)                 \
    X(CmdEndDebugUtilsLabelEXT)

/// Missing without VK_KHR_acceleration_structure.
#define NACRE_VULKAN_RAY_DEVICE_FUNCTIONS(X)    \
    X(CreateAccelerationStructureKHR)           \
    X(DestroyAccelerationStructureKHR)          \
    X(GetAccelerationStructureBuildSizesKHR)    \
    X(GetAccelerationStructureDeviceAddressKHR) \
    X(CmdBuildAccelerationStructuresKHR)

#define NACRE_VULKAN_MEMBER(name) PFN_vk##name name = nullptr;

struct GlobalFunctions {
    PFN_vkGetInstanceProcAddr GetInstanceProcAddr = nullptr;
    NACRE_VULKAN_GLOBAL_FUNCTIONS(NACRE_VULKAN_MEMBER)
};

struct InstanceFunctions {
    NACRE_VULKAN_INSTANCE_FUNCTIONS(NACRE_VULKAN_MEMBER)
    NACRE_VULKAN_OPTIONAL_INSTANCE_FUNCTIONS(NACRE_VULKAN_MEMBER)

    /// Looks every function up; an error names the first required one that is missing.
    static Expected<InstanceFunctions> load(const GlobalFunctions& global, VkInstance instance);
};

struct DeviceFunctions {
    NACRE_VULKAN_DEVICE_FUNCTIONS(NACRE_VULKAN_MEMBER)
    NACRE_VULKAN_PROMOTED_DEVICE_FUNCTIONS(NACRE_VULKAN_MEMBER)
    NACRE_VULKAN_OPTIONAL_DEVICE_FUNCTIONS(NACRE_VULKAN_MEMBER)
    NACRE_VULKAN_RAY_DEVICE_FUNCTIONS(NACRE_VULKAN_MEMBER)

    static Expected<DeviceFunctions> load(const InstanceFunctions& functions, VkDevice device);
};

#undef NACRE_VULKAN_MEMBER

/// The opened library.
struct Library {
    DynamicLibrary file;
    GlobalFunctions vk;
    std::uint32_t version = 0;  ///< Highest instance version, as VK_MAKE_API_VERSION makes it.

    /// Errors: not_found where there is no Vulkan library; unsupported where it is older than 1.2.
    static Expected<std::shared_ptr<const Library>> open();
};

}  // namespace nacre::vulkan
