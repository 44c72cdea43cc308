// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/physical_device.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "backends/vulkan/result.h"
#include "core/log.h"

namespace nacre::vulkan {
namespace {

/// Position of a kind of device in the list: what a person with several of them means by "the" device comes first.
int rank(VkPhysicalDeviceType type) {
    switch (type) {
        case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU: return 0;
        case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU: return 1;
        case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU: return 2;
        case VK_PHYSICAL_DEVICE_TYPE_CPU: return 4;
        default: return 3;
    }
}

struct QueueChoice {
    std::uint32_t family = 0, timestamp_bits = 0;
};

std::optional<QueueChoice> choose_queue(const Instance& instance, VkPhysicalDevice device) {
    std::uint32_t count = 0;
    instance.vk.GetPhysicalDeviceQueueFamilyProperties(device, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    instance.vk.GetPhysicalDeviceQueueFamilyProperties(device, &count, families.data());
    std::optional<QueueChoice> best;
    constexpr VkQueueFlags needed = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    for (std::uint32_t i = 0; i < count; ++i) {
        if ((families[i].queueFlags & needed) != needed || families[i].queueCount == 0) continue;
        if (!best || families[i].timestampValidBits > best->timestamp_bits)
            best = QueueChoice{i, families[i].timestampValidBits};
    }
    return best;
}

template <typename First, typename Second>
void chain(First& first, Second& second) {
    second.pNext = std::exchange(first.pNext, &second);
}

}  // namespace

Expected<std::vector<std::unique_ptr<PhysicalDevice>>> PhysicalDevice::list(const Instance& instance) {
    NACRE_TRY(const std::vector<VkPhysicalDevice> handles, instance.physical_devices());
    std::vector<std::unique_ptr<PhysicalDevice>> devices;
    std::string refused;
    for (VkPhysicalDevice handle : handles) {
        auto device = std::make_unique<PhysicalDevice>();
        device->handle = handle;
        instance.vk.GetPhysicalDeviceProperties(handle, &device->properties);
        device->version_ = std::min(device->properties.apiVersion, instance.version());
        const auto refuse = [&](std::string_view reason) {
            refused += fmt::format("; '{}' {}", device->properties.deviceName, reason);
        };
        if (device->version_ < VK_API_VERSION_1_2) {
            refuse(fmt::format("offers Vulkan {}.{} only, and 1.2 is needed", VK_API_VERSION_MAJOR(device->version_),
                               VK_API_VERSION_MINOR(device->version_)));
            continue;
        }
        const std::optional<QueueChoice> queue = choose_queue(instance, handle);
        if (!queue) {
            refuse("has no queue for both graphics and compute");
            continue;
        }
        device->queue_family = queue->family;
        device->timestamp_valid_bits = queue->timestamp_bits;

        std::uint32_t count = 0;
        instance.vk.EnumerateDeviceExtensionProperties(handle, nullptr, &count, nullptr);
        device->extensions_.resize(count);
        instance.vk.EnumerateDeviceExtensionProperties(handle, nullptr, &count, device->extensions_.data());
        device->extensions_.resize(count);
        const bool core13 = device->version_ >= VK_API_VERSION_1_3;
        const bool may_render = core13 || device->has_extension(VK_KHR_DYNAMIC_RENDERING_EXTENSION_NAME);
        const bool may_synchronize = core13 || device->has_extension(VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME);
        const bool may_be_robust = device->has_extension(VK_EXT_ROBUSTNESS_2_EXTENSION_NAME);
        const bool may_choose_lines = device->has_extension(VK_EXT_LINE_RASTERIZATION_EXTENSION_NAME);
        const bool may_trace = device->has_extension(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME) &&
                               device->has_extension(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME) &&
                               device->has_extension(VK_KHR_RAY_QUERY_EXTENSION_NAME);

        FeatureChain& features = device->features;
        chain(features.core, features.vulkan11);
        chain(features.core, features.vulkan12);
        if (may_render) chain(features.core, features.dynamic_rendering);
        if (may_synchronize) chain(features.core, features.synchronization2);
        if (core13) chain(features.core, features.demote);
        if (may_be_robust) chain(features.core, features.robustness2);
        if (may_choose_lines) chain(features.core, features.line_rasterization);
        if (may_trace) chain(features.core, features.acceleration_structure);
        if (may_trace) chain(features.core, features.ray_query);
        instance.vk.GetPhysicalDeviceFeatures2(handle, &features.core);
        device->has_dynamic_rendering = features.dynamic_rendering.dynamicRendering;
        device->has_synchronization2 = features.synchronization2.synchronization2;
        device->has_robustness2 = may_be_robust;
        device->has_line_rasterization = features.line_rasterization.bresenhamLines;
        device->has_ray_query = features.acceleration_structure.accelerationStructure && features.ray_query.rayQuery &&
                                features.vulkan12.bufferDeviceAddress;
        if (!features.vulkan12.timelineSemaphore || !features.vulkan12.hostQueryReset) {
            refuse("lacks timeline semaphores or host query reset");
            continue;
        }

        VkPhysicalDeviceProperties2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2};
        chain(all, device->vulkan11);
        chain(all, device->vulkan12);
        if (core13) chain(all, device->maintenance4);
        if (may_trace) chain(all, device->acceleration_structure);
        instance.vk.GetPhysicalDeviceProperties2(handle, &all);
        instance.vk.GetPhysicalDeviceMemoryProperties(handle, &device->memory);
        devices.push_back(std::move(device));
    }
    if (devices.empty())
        return nacre::fail(ErrorCode::not_found, "find a Vulkan device", fmt::format("among {}", handles.size()),
                           handles.empty() ? "the Vulkan library knows no device" : "none can be used" + refused,
                           "Install the package mesa-vulkan-drivers or your graphics card's driver.");
    if (!refused.empty()) log_message(LogLevel::debug, "Vulkan devices left out" + refused);
    std::ranges::stable_sort(devices, {}, [](const auto& each) { return rank(each->properties.deviceType); });
    return devices;
}

rhi::AdapterInfo PhysicalDevice::describe(std::uint32_t index) const {
    return {.backend = "vulkan",
            .index = index,
            .name = properties.deviceName,
            .driver = fmt::format("{} {}", vulkan12.driverName, vulkan12.driverInfo),
            .api_version =
                fmt::format("Vulkan {}.{}.{}", VK_API_VERSION_MAJOR(properties.apiVersion),
                            VK_API_VERSION_MINOR(properties.apiVersion), VK_API_VERSION_PATCH(properties.apiVersion)),
            .is_software = properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU};
}

bool PhysicalDevice::has_extension(std::string_view name) const {
    return std::ranges::any_of(extensions_, [&](const auto& each) { return name == each.extensionName; });
}

}  // namespace nacre::vulkan
