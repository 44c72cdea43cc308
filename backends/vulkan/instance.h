// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "backends/vulkan/loader.h"
#include "rhi/validation.h"

namespace nacre::vulkan {

struct InstanceOptions {
    bool validation = false;  ///< Khronos validation layer: core and synchronization validation.
    std::function<void(const rhi::Message&)> report{};  ///< For the layer's messages; any thread.
    /// Newest version to use, so that a new driver stands in for an old one.
    std::uint32_t highest_version = VK_API_VERSION_1_3;
};

/// Owns a VkInstance and the messenger of its validation layer. Layers are chosen for a whole instance, so devices
/// with validation have instances of their own and those without share one.
class Instance {
  public:
    /// Errors: not_found where validation is wanted and its layer is not installed; those of the driver.
    static Expected<std::shared_ptr<const Instance>> create(std::shared_ptr<const Library> library,
                                                            InstanceOptions options);
    ~Instance();
    Instance(const Instance&) = delete;
    Instance& operator=(const Instance&) = delete;

    [[nodiscard]] VkInstance handle() const { return handle_; }
    /// The version asked for: that of the library, at most the highest of the options.
    [[nodiscard]] std::uint32_t version() const { return version_; }
    [[nodiscard]] bool has_debug_utils() const { return has_debug_utils_; }
    [[nodiscard]] Expected<std::vector<VkPhysicalDevice>> physical_devices() const;

    InstanceFunctions vk;

  private:
    Instance() = default;

    std::shared_ptr<const Library> library_;
    InstanceOptions options_;
    VkInstance handle_ = VK_NULL_HANDLE;
    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
    std::uint32_t version_ = 0;
    bool has_debug_utils_ = false;
};

}  // namespace nacre::vulkan
