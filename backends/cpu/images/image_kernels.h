// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "backends/cpu/shader_interface.h"

/// @file
/// The same image operations for several instruction sets. `lanes` is 4, 8 or 16; what is returned must not run on a
/// machine without the instruction set.

namespace nacre::cpu {

namespace baseline {
NacreCpuImageFunction image_function(std::uint32_t lanes);
}
namespace avx2 {
NacreCpuImageFunction image_function(std::uint32_t lanes);
}
namespace avx512 {
NacreCpuImageFunction image_function(std::uint32_t lanes);
}

}  // namespace nacre::cpu
