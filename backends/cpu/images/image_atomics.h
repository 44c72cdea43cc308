// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "backends/cpu/image_view.h"
#include "backends/cpu/shader_interface.h"

namespace nacre::cpu {

/// ImageOperation::atomic for the first `lanes` lanes, one lane after the other, atomic towards all other threads
/// (relaxed). For r32_uint and r32_sint; r32_float has exchange, add_float, minimum_float and maximum_float. Outside of
/// the image, and for other formats, nothing happens and the result is zero.
void image_atomic(const ImageView* image, ImageArguments* arguments, std::uint32_t flags, std::uint32_t live,
                  std::uint32_t lanes);

}  // namespace nacre::cpu
