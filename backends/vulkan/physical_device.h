// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "backends/vulkan/instance.h"
#include "rhi/device.h"

namespace nacre::vulkan {

/// Feature structures in one chain, as they are queried and as they are enabled. Not copyable: the chain holds
/// addresses.
struct FeatureChain {
    VkPhysicalDeviceFeatures2 core{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2};
    VkPhysicalDeviceVulkan11Features vulkan11{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES};
    VkPhysicalDeviceVulkan12Features vulkan12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
    VkPhysicalDeviceDynamicRenderingFeatures dynamic_rendering{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DYNAMIC_RENDERING_FEATURES};
    VkPhysicalDeviceSynchronization2Features synchronization2{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SYNCHRONIZATION_2_FEATURES};
    VkPhysicalDeviceShaderDemoteToHelperInvocationFeatures demote{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_DEMOTE_TO_HELPER_INVOCATION_FEATURES};
    VkPhysicalDeviceRobustness2FeaturesEXT robustness2{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ROBUSTNESS_2_FEATURES_EXT};
    VkPhysicalDeviceLineRasterizationFeaturesEXT line_rasterization{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_LINE_RASTERIZATION_FEATURES_EXT};

    VkPhysicalDeviceAccelerationStructureFeaturesKHR acceleration_structure{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR};
    VkPhysicalDeviceRayQueryFeaturesKHR ray_query{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR};

    FeatureChain() = default;
    FeatureChain(const FeatureChain&) = delete;
    FeatureChain& operator=(const FeatureChain&) = delete;
};

/// One device of an instance: what it says about itself, before anything is enabled.
class PhysicalDevice {
  public:
    /// Nothing known yet; tests fill in what they need.
    PhysicalDevice() = default;

    /// All devices of Vulkan 1.2 or later with a queue for graphics and compute, the fastest kind first (discrete,
    /// integrated, virtual, software). Errors: not_found where there is none.
    static Expected<std::vector<std::unique_ptr<PhysicalDevice>>> list(const Instance& instance);

    [[nodiscard]] rhi::AdapterInfo describe(std::uint32_t index) const;
    [[nodiscard]] bool has_extension(std::string_view name) const;
    /// Version that both the device and the instance allow.
    [[nodiscard]] std::uint32_t version() const { return version_; }

    VkPhysicalDevice handle = VK_NULL_HANDLE;
    VkPhysicalDeviceProperties properties{};
    VkPhysicalDeviceVulkan11Properties vulkan11{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES};
    VkPhysicalDeviceVulkan12Properties vulkan12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES};
    VkPhysicalDeviceMaintenance4Properties maintenance4{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_4_PROPERTIES};
    VkPhysicalDeviceAccelerationStructurePropertiesKHR acceleration_structure{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR};
    VkPhysicalDeviceMemoryProperties memory{};
    FeatureChain features;
    std::uint32_t queue_family = 0;          ///< Graphics and compute.
    std::uint32_t timestamp_valid_bits = 0;  ///< Of that family; 0: no timestamps.
    bool has_dynamic_rendering = false;      ///< In core or as extension.
    bool has_synchronization2 = false;
    bool has_robustness2 = false;
    bool has_line_rasterization = false;
    bool has_ray_query = false;  ///< With all that acceleration structures need.

  private:
    std::vector<VkExtensionProperties> extensions_;
    std::uint32_t version_ = 0;
};

}  // namespace nacre::vulkan
