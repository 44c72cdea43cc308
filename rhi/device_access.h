// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rhi/device.h"
#include "rhi/device_state.h"

namespace nacre::rhi {

/// The device's private part under the name that the public header gives it.
struct Device::State : DeviceState {};

}  // namespace nacre::rhi
