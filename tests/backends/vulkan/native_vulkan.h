// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "backends/vulkan/loader.h"

/// @file
/// Vulkan as one writes it by hand, without anything of the RHI but the function tables: what pictures and times of the
/// RHI are held against. Any failure ends the program with a message, as such programs do.

namespace nacre::vulkan::test {

struct NativeBuffer {
    VkBuffer handle = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    std::byte* mapped = nullptr;
};

struct NativeImage {
    VkImage handle = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkImageView view = VK_NULL_HANDLE;
};

struct NativePipeline {
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkPipeline handle = VK_NULL_HANDLE;
};

/// The first Vulkan device of the machine with dynamic rendering, and one queue.
class NativeVulkan {
  public:
    /// Null where there is no such device.
    static std::unique_ptr<NativeVulkan> create();
    ~NativeVulkan();

    NativeBuffer make_buffer(VkDeviceSize size, VkBufferUsageFlags usage);  ///< Host-visible and mapped.
    NativeImage make_target(VkFormat format, std::uint32_t width, std::uint32_t height);
    void destroy(const NativeBuffer& buffer);
    void destroy(const NativeImage& image);
    void destroy(const NativePipeline& pipeline);

    /// A set layout of one buffer.
    VkDescriptorSetLayout make_set_layout(VkDescriptorType type, VkShaderStageFlags stages);
    std::vector<VkDescriptorSet> make_sets(VkDescriptorSetLayout layout, VkDescriptorType type,
                                           std::span<const NativeBuffer> buffers);
    NativePipeline make_compute_pipeline(std::span<const std::uint32_t> spirv, VkDescriptorSetLayout layout,
                                         std::uint32_t push_bytes);
    /// Triangles without vertex buffers into one target of `format`; no depth, no blending, no culling.
    NativePipeline make_graphics_pipeline(std::span<const std::uint32_t> vertex,
                                          std::span<const std::uint32_t> fragment, VkFormat format,
                                          VkDescriptorSetLayout layout, std::uint32_t push_bytes);

    VkCommandBuffer begin_commands();  ///< Resets the pool; one buffer is in use at a time.
    /// Barrier from any work to rendering into the image, whose content is dropped.
    void begin_rendering(VkCommandBuffer commands, const NativeImage& target, std::uint32_t width,
                         std::uint32_t height);
    void submit(VkCommandBuffer commands);
    void wait();
    /// Bytes of an image that was just rendered into.
    std::vector<std::byte> read(const NativeImage& image, std::uint32_t width, std::uint32_t height,
                                std::uint32_t texel_bytes);

    InstanceFunctions instance_functions;
    DeviceFunctions vk;
    VkDevice device = VK_NULL_HANDLE;

  private:
    NativeVulkan() = default;
    VkDeviceMemory allocate(const VkMemoryRequirements& requirements, VkMemoryPropertyFlags properties);
    VkShaderModule make_module(std::span<const std::uint32_t> spirv);

    std::shared_ptr<const Library> library_;
    VkInstance instance_ = VK_NULL_HANDLE;
    VkPhysicalDeviceMemoryProperties memory_{};
    VkQueue queue_ = VK_NULL_HANDLE;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkSemaphore timeline_ = VK_NULL_HANDLE;
    std::uint64_t serial_ = 0;
    std::vector<VkDescriptorSetLayout> set_layouts_;
    std::vector<VkDescriptorPool> descriptor_pools_;
};

}  // namespace nacre::vulkan::test
