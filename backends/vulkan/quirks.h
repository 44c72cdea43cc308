// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

/// @file
/// What drivers do otherwise than they should, and what is done about it. The whole list is in quirks.cpp, each entry
/// with its reason; no other file of the backend asks which driver it runs on.

namespace nacre::vulkan {

/// A variable that a driver reads from the environment when it is loaded. Never set over the user's own value.
struct EnvironmentQuirk {
    const char* variable;
    const char* value;
    std::string_view reason;
};
std::span<const EnvironmentQuirk> environment_quirks();

/// Does what has to be done before any driver is loaded. Called once, before the Vulkan library is opened.
void prepare_for_drivers();

}  // namespace nacre::vulkan
