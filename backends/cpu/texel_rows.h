// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rhi/format.h"

/// @file
/// Rows of texels as floats and back, for everything that averages: one decision about the format for each row. Integer
/// formats have no average and are not meant.

namespace nacre::cpu {

using LinearTexel = std::array<float, 4>;

/// Decodes `count` texels that lie one after another; sRGB becomes linear, missing channels 0 and alpha 1.
void decode_row(rhi::Format format, const std::byte* texels, std::uint32_t count, LinearTexel* out);
/// The other way, rounded to the nearest code.
void encode_row(rhi::Format format, const LinearTexel* texels, std::uint32_t count, std::byte* out);

/// Repeats one texel of `texel_bytes` (1 to 16) `count` times.
void fill_row(const std::byte* texel, std::uint32_t texel_bytes, std::uint64_t count, std::byte* out);

}  // namespace nacre::cpu
