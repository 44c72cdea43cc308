// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/device.h"

#include <fmt/format.h>

#include <algorithm>

#include "backends/vulkan/acceleration_structure.h"
#include "backends/vulkan/buffer.h"
#include "backends/vulkan/capabilities.h"
#include "backends/vulkan/memory.h"
#include "backends/vulkan/pipeline_cache.h"
#include "backends/vulkan/render_pass.h"
#include "backends/vulkan/result.h"
#include "backends/vulkan/sampler.h"
#include "backends/vulkan/shader.h"
#include "core/log.h"

namespace nacre::vulkan {

Expected<std::unique_ptr<rhi::BackendDevice>> Device::create(std::shared_ptr<const Instance> instance, Mode mode,
                                                             const rhi::BackendDeviceDesc& desc) {
    std::unique_ptr<Device> device(new Device);
    Context& context = device->context_;
    context.instance = std::move(instance);
    context.faults = desc.desc->faults;
    context.report = desc.report;
    NACRE_TRY(auto adapters, PhysicalDevice::list(*context.instance));
    if (desc.desc->adapter >= adapters.size())
        return nacre::fail(ErrorCode::not_found, "create device", fmt::format("Vulkan device {}", desc.desc->adapter),
                           fmt::format("this machine has {}, numbered from 0", adapters.size()),
                           "Run `nacre devices` to see them all.");
    context.physical = std::move(adapters[desc.desc->adapter]);
    device->adapter_ = context.physical->describe(desc.desc->adapter);
    context.dynamic_rendering = mode == Mode::automatic && context.physical->has_dynamic_rendering;
    context.synchronization2 = mode != Mode::legacy && context.physical->has_synchronization2;
    NACRE_CHECK(device->create_native(*desc.desc));
    return device;
}

Expected<void> Device::create_native(const rhi::DeviceDesc& desc) {
    const std::string subject = in_quotes(adapter_.name);
    FeatureChain enabled;
    const std::vector<const char*> extensions =
        choose_features(*context_.physical, context_.dynamic_rendering, context_.synchronization2, enabled);
    constexpr float priority = 1.0f;
    VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
    queue.queueFamilyIndex = context_.physical->queue_family;
    queue.queueCount = 1;
    queue.pQueuePriorities = &priority;
    VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &enabled.core};
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    if (VkResult result =
            context_.instance->vk.CreateDevice(context_.physical->handle, &info, nullptr, &context_.device);
        result != VK_SUCCESS) {
        context_.device = VK_NULL_HANDLE;
        return fail(result, "create Vulkan device", subject);
    }
    // Without this function the device could not be destroyed, whatever else is missing.
    context_.vk.DestroyDevice = reinterpret_cast<PFN_vkDestroyDevice>(
        context_.instance->vk.GetDeviceProcAddr(context_.device, "vkDestroyDevice"));
    NACRE_TRY(context_.vk, DeviceFunctions::load(context_.instance->vk, context_.device));
    context_.vk.GetDeviceQueue(context_.device, context_.physical->queue_family, 0, &context_.queue);
    context_.debug_names = desc.debug_names && context_.instance->has_debug_utils() &&
                           context_.vk.SetDebugUtilsObjectNameEXT && context_.vk.CmdBeginDebugUtilsLabelEXT &&
                           context_.vk.CmdEndDebugUtilsLabelEXT;
    if (context_.physical->version() >= VK_API_VERSION_1_3 || context_.dynamic_rendering)
        context_.read_only_store = VK_ATTACHMENT_STORE_OP_NONE;
    context_.bresenham_lines = enabled.line_rasterization.bresenhamLines;
    context_.update_after_bind = enabled.vulkan12.descriptorBindingSampledImageUpdateAfterBind;
    context_.capabilities = capabilities_of(*context_.instance, *context_.physical, enabled);
    context_.push_constants = {VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT | VK_SHADER_STAGE_COMPUTE_BIT,
                               0, context_.capabilities.max_push_constant_bytes};

    VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
    type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    VkSemaphoreCreateInfo semaphore{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type};
    if (VkResult result = context_.vk.CreateSemaphore(context_.device, &semaphore, nullptr, &context_.timeline);
        result != VK_SUCCESS)
        return fail(result, "create timeline semaphore of", subject);
    VkPipelineLayoutCreateInfo layout{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    layout.pushConstantRangeCount = 1;
    layout.pPushConstantRanges = &context_.push_constants;
    if (VkResult result = context_.vk.CreatePipelineLayout(context_.device, &layout, nullptr, &context_.push_layout);
        result != VK_SUCCESS)
        return fail(result, "create pipeline layout of", subject);
    context_.memory = std::make_unique<MemoryAllocator>(context_);
    context_.render_passes = std::make_unique<RenderPassCache>(context_);
    context_.pipelines = std::make_unique<PipelineCache>(context_, desc.pipeline_cache);
    context_.set_name(context_.device, VK_OBJECT_TYPE_DEVICE, desc.name);
    context_.set_name(context_.timeline, VK_OBJECT_TYPE_SEMAPHORE, "submissions of " + desc.name);
    if (log_is_on(LogLevel::debug))
        log_message(LogLevel::debug,
                    fmt::format("Vulkan device {}: {}, {}, {}", subject, adapter_.api_version,
                                context_.dynamic_rendering ? "dynamic rendering" : "render passes",
                                context_.synchronization2 ? "synchronization2" : "barriers of Vulkan 1.0"));
    return {};
}

Device::~Device() {
    if (!context_.device || !context_.vk.DeviceWaitIdle) return;
    // A lost device refuses to wait and may be destroyed all the same.
    context_.check(context_.vk.DeviceWaitIdle(context_.device));
    if (context_.pipelines)
        if (auto saved = context_.pipelines->save(); !saved) log_message(LogLevel::warning, saved.error().message());
    commands_.clear();
}

Expected<std::unique_ptr<rhi::BackendBuffer>> Device::create_buffer(const rhi::BufferDesc& desc) {
    return Buffer::create(context_, desc);
}

Expected<std::unique_ptr<rhi::BackendTexture>> Device::create_texture(const rhi::TextureDesc& desc) {
    return Texture::create(context_, desc);
}

Expected<std::unique_ptr<rhi::BackendSampler>> Device::create_sampler(const rhi::SamplerDesc& desc) {
    return Sampler::create(context_, desc);
}

Expected<std::unique_ptr<rhi::BackendShader>> Device::create_shader(const rhi::ShaderDesc& desc,
                                                                    const rhi::ShaderReflection& reflection) {
    return Shader::create(context_, desc, reflection);
}

Expected<std::unique_ptr<rhi::BackendBindGroupLayout>> Device::create_bind_group_layout(
    const rhi::BindGroupLayoutDesc& desc) {
    return BindGroupLayout::create(context_, desc);
}

Expected<std::unique_ptr<rhi::BackendBindGroup>> Device::create_bind_group(
    rhi::BackendBindGroupLayout& layout, std::span<const rhi::BackendBinding> bindings, const std::string& name) {
    return BindGroup::create(context_, layout, bindings, name);
}

Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> Device::create_graphics_pipeline(
    const rhi::BackendGraphicsPipelineDesc& desc) {
    return GraphicsPipeline::create(context_, desc);
}

Expected<std::unique_ptr<rhi::BackendComputePipeline>> Device::create_compute_pipeline(
    const rhi::BackendComputePipelineDesc& desc) {
    return ComputePipeline::create(context_, desc);
}

Expected<std::unique_ptr<rhi::BackendQueryPool>> Device::create_query_pool(const rhi::QueryPoolDesc& desc) {
    return QueryPool::create(context_, desc);
}

Expected<std::unique_ptr<rhi::BackendAccelerationStructure>> Device::create_acceleration_structure(
    const rhi::AccelerationStructureDesc& desc) {
    return AccelerationStructure::create(context_, desc);
}

Expected<void> Device::flush_mapped(rhi::BackendBuffer& buffer) { return native(buffer).memory.flush(); }

Expected<void> Device::invalidate_mapped(rhi::BackendBuffer& buffer) { return native(buffer).memory.invalidate(); }

Expected<std::unique_ptr<Commands>> Device::take_commands() {
    if (!commands_.empty() && commands_.front()->serial <= completed_serial()) {
        std::unique_ptr<Commands> commands = std::move(commands_.front());
        commands_.erase(commands_.begin());
        return commands;
    }
    return Commands::create(context_);
}

Expected<void> Device::execute(const rhi::ExecutionPlan& plan) {
    if (context_.is_lost) return fail(VK_ERROR_DEVICE_LOST, "submit to", in_quotes(adapter_.name));
    if (++submissions_ == context_.faults.lose_device) {
        // What runs already must end before objects can be destroyed; a real loss ends it too.
        context_.vk.DeviceWaitIdle(context_.device);
        context_.is_lost = true;
        return fail(VK_ERROR_DEVICE_LOST, "submit to", in_quotes(adapter_.name));
    }
    NACRE_TRY(std::unique_ptr<Commands> commands, take_commands());
    const auto keep_unused = [&] {
        commands->serial = 0;
        commands_.insert(commands_.begin(), std::move(commands));
    };
    if (auto recorded = commands->record(plan); !recorded) {
        keep_unused();
        return recorded;
    }
    VkTimelineSemaphoreSubmitInfo timeline{VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO};
    timeline.signalSemaphoreValueCount = 1;
    timeline.pSignalSemaphoreValues = &plan.serial;
    VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO, &timeline};
    info.commandBufferCount = static_cast<std::uint32_t>(commands->buffers().size());
    info.pCommandBuffers = commands->buffers().data();
    info.signalSemaphoreCount = 1;
    info.pSignalSemaphores = &context_.timeline;
    if (VkResult result = context_.check(context_.vk.QueueSubmit(context_.queue, 1, &info, VK_NULL_HANDLE));
        result != VK_SUCCESS) {
        keep_unused();
        return fail(result, "submit to", in_quotes(adapter_.name));
    }
    last_serial_ = plan.serial;
    commands->serial = plan.serial;
    commands_.push_back(std::move(commands));
    return {};
}

std::uint64_t Device::completed_serial() {
    std::uint64_t value = 0;
    if (!context_.is_lost &&
        context_.check(context_.vk.GetSemaphoreCounterValue(context_.device, context_.timeline, &value)) == VK_SUCCESS)
        return value;
    // Nothing runs on a lost device any more, so all of its objects may be destroyed.
    return last_serial_;
}

Expected<void> Device::wait(std::uint64_t serial, std::chrono::nanoseconds timeout) {
    const auto subject = [&] { return fmt::format("submission {} of {}", serial, in_quotes(adapter_.name)); };
    if (context_.is_lost) return fail(VK_ERROR_DEVICE_LOST, "wait for", subject());
    VkSemaphoreWaitInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO};
    info.semaphoreCount = 1;
    info.pSemaphores = &context_.timeline;
    info.pValues = &serial;
    const std::uint64_t limit = timeout == std::chrono::nanoseconds::max()
                                    ? ~std::uint64_t{0}
                                    : static_cast<std::uint64_t>(std::max<std::int64_t>(timeout.count(), 0));
    if (VkResult result = context_.check(context_.vk.WaitSemaphores(context_.device, &info, limit));
        result != VK_SUCCESS)
        return fail(result, "wait for", subject());
    return {};
}

Expected<std::vector<std::uint64_t>> Device::read_queries(rhi::BackendQueryPool& pool, std::uint32_t first,
                                                          std::uint32_t count) {
    return native(pool).read(first, count);
}

rhi::MemoryStatistics Device::memory_statistics() const {
    rhi::MemoryStatistics statistics;
    statistics.reserved_bytes = context_.memory->reserved_bytes();
    statistics.driver_allocations = context_.memory->driver_allocations();
    return statistics;
}

Expected<void> Device::save_pipeline_cache() { return context_.pipelines->save(); }

}  // namespace nacre::vulkan
