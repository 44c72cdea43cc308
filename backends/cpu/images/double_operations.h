// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/image_view.h"
#include "backends/cpu/shader_interface.h"

/// @file
/// What image_operations.h does, for devices in double precision: filtering by the same equations of the Vulkan
/// specification, one lane after another, on doubles. Integer images and atomics are left to the other function.
///
///     NacreCpuDoubleImageFunction run = double_image_function();
///     run(&view, &sampler, &arguments, flags_of(ImageOperation::sample) | image_lod_implicit, 0xffff);

namespace nacre::cpu {

/// Thread-safe, and so is what it returns. It serves all lane counts.
NacreCpuDoubleImageFunction double_image_function();

}  // namespace nacre::cpu
