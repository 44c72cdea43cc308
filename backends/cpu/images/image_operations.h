// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "backends/cpu/image_view.h"
#include "backends/cpu/shader_interface.h"

/// @file
/// Everything that shaders do with textures and images. One function serves all operations (see ImageOperation and
/// ImageFlags in shader_interface.h); filtering follows the equations of the Vulkan specification in 32-bit floats, and
/// all instruction sets and lane counts give the same bits.
///
/// Levels of `ImageOperation::fetch` are 32-bit integers whose bits lie in `ImageArguments::lod`. Reads outside of an
/// image give zeros in all channels, writes there vanish, and no coordinate (NaN, infinity, any integer) does harm.
/// Anisotropic filtering applies to 2D images and arrays of them, with up to 16 samples along the footprint's longer
/// axis.
///
///     NacreCpuImageFunction run = image_function(8);
///     run(&view, &sampler, &arguments, flags_of(ImageOperation::sample) | image_lod_implicit, 0xff);

namespace nacre::cpu {

/// avx512: with VBMI, as in Ice Lake and Zen 4 and what came after; older processors take avx2.
enum class InstructionSet : std::uint8_t { baseline, avx2, avx512 };

/// The fastest that this machine has.
InstructionSet best_instruction_set();
bool is_supported(InstructionSet set);

/// The image function for 4, 8 or 16 lanes; null for other counts. Thread-safe, and so is what it returns.
NacreCpuImageFunction image_function(std::uint32_t lanes);
/// The same for one instruction set; null where the machine lacks it.
NacreCpuImageFunction image_function(std::uint32_t lanes, InstructionSet set);

/// For one texel. Thread-safe.
NacreCpuTexelFunction texel_function();

constexpr std::uint32_t flags_of(ImageOperation operation) { return static_cast<std::uint32_t>(operation); }

}  // namespace nacre::cpu
