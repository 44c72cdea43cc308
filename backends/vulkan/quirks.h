// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

#include "backends/vulkan/loader.h"

/// @file
/// What drivers say they can do and cannot, or do so badly that they had better not. The whole list is in quirks.cpp,
/// each entry with its reason; no other file of the backend asks which driver it runs on.

namespace nacre::vulkan {

enum class Quirk : std::uint8_t {
    no_pipeline_cache,         ///< Do not keep the driver's pipeline cache on disk.
    single_memory_block_kind,  ///< Buffers and images never share a block of memory, whatever the granularity.
};

struct QuirkEntry {
    VkDriverId driver;
    std::uint32_t first_version, last_version;  ///< VkPhysicalDeviceProperties::driverVersion, both included.
    Quirk quirk;
    std::string_view reason;
};

std::span<const QuirkEntry> quirks();

/// Whether a driver has a quirk.
bool has_quirk(VkDriverId driver, std::uint32_t driver_version, Quirk quirk);

}  // namespace nacre::vulkan
