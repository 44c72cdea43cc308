// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "backends/vulkan/physical_device.h"
#include "rhi/backend.h"

namespace nacre::vulkan {

class MemoryAllocator;
class RenderPassCache;
class PipelineCache;

/// What every object of a device needs: the functions, the handle, and the services that objects share. Lives as
/// long as the device, longer than all of its objects.
struct Context {
    Context();
    ~Context();
    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;

    std::shared_ptr<const Instance> instance;
    std::unique_ptr<PhysicalDevice> physical;
    DeviceFunctions vk;
    VkDevice device = VK_NULL_HANDLE;
    VkQueue queue = VK_NULL_HANDLE;
    VkSemaphore timeline = VK_NULL_HANDLE;  ///< Its value is the newest complete serial.
    rhi::Capabilities capabilities;
    rhi::FaultInjection faults;
    std::function<void(const rhi::Message&)> report;

    bool dynamic_rendering = false;  ///< In use, not merely present.
    bool synchronization2 = false;
    bool bresenham_lines = false;
    bool debug_names = false;
    bool update_after_bind = false;
    /// Store operation of a depth target that is only read. Storing counts as a write, which would collide with the
    /// shaders that sample the same texture; drivers without the operation that does nothing have to take it.
    VkAttachmentStoreOp read_only_store = VK_ATTACHMENT_STORE_OP_STORE;
    std::atomic<bool> is_lost = false;

    /// One range for all pipelines and all stages: push constants and bind groups then survive a change of pipeline.
    VkPushConstantRange push_constants{};
    VkPipelineLayout push_layout = VK_NULL_HANDLE;  ///< Compatible with every pipeline for push constants.

    std::unique_ptr<MemoryAllocator> memory;
    std::unique_ptr<RenderPassCache> render_passes;
    std::unique_ptr<PipelineCache> pipelines;

    /// Shows `name` in debuggers and in messages of the validation layer.
    template <typename Handle>
    void set_name(Handle object, VkObjectType type, const std::string& name) const {
        if (debug_names && !name.empty()) set_name_of(reinterpret_cast<std::uint64_t>(object), type, name);
    }
    /// Remembers a lost device; returns `result` for use in conditions.
    VkResult check(VkResult result) {
        if (result == VK_ERROR_DEVICE_LOST) is_lost = true;
        return result;
    }

  private:
    void set_name_of(std::uint64_t object, VkObjectType type, const std::string& name) const;
};

}  // namespace nacre::vulkan
