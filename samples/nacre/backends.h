// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhi/device.h"

/// @file
/// What the command asks of the list of backends (samples/backends.h).

namespace nacre::command {

/// All of them; nothing of a driver is opened before a device is asked for.
std::unique_ptr<rhi::Instance> make_instance();

/// Their names, in the order of preference: "vulkan", "gl", "gles".
std::vector<std::string> backend_names();

/// The names of `backend_names()` of which a device exists here.
std::vector<std::string> working_backends(const rhi::Instance& instance);

}  // namespace nacre::command
