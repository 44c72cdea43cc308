// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "backends/vulkan/loader.h"
#include "core/error.h"

/// @file
/// VkResult as an `Error`.
///
///     if (VkResult result = vk.CreateBuffer(...); result != VK_SUCCESS)
///         return fail(result, "create buffer", in_quotes(desc.name));

namespace nacre::vulkan {

/// "VK_ERROR_DEVICE_LOST".
std::string_view name_of(VkResult result);

/// The error for a failed call: out_of_memory, device_lost, timeout, unsupported or internal by the result.
[[nodiscard]] std::unexpected<Error> fail(VkResult result, std::string attempted, std::string subject);

/// "'name'", or "(unnamed)".
std::string in_quotes(std::string_view name);

}  // namespace nacre::vulkan
