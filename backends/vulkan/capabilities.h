// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/vulkan/physical_device.h"
#include "rhi/capabilities.h"

namespace nacre::vulkan {

/// Sets in `enabled` every feature that the backend uses and `device` has, and returns the names of the extensions that
/// this takes. `dynamic_rendering` and `synchronization2` are enabled only where asked for.
std::vector<const char*> choose_features(const PhysicalDevice& device, bool dynamic_rendering, bool synchronization2,
                                         FeatureChain& enabled);

/// What a device made with these features can do.
rhi::Capabilities capabilities_of(const Instance& instance, const PhysicalDevice& device, const FeatureChain& enabled);

}  // namespace nacre::vulkan
