// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// @file
/// The sRGB transfer function, exact in both directions (IEC 61966-2-1: 0.04045 / 12.92 / 1.055 / 2.4).
///
///     float linear = linear_from_srgb_byte(188);        // 0.5028865
///     std::uint8_t byte = srgb_byte_from_linear(0.5f);  // 188
///
/// All functions are pure and may be called from any thread.

namespace nacre {

/// Encoded value in [0, 1] of a linear value; input is clamped to [0, 1], NaN counts as 0.
float srgb_from_linear(float linear);

/// Linear value in [0, 1] of an encoded value; input is clamped to [0, 1], NaN counts as 0.
float linear_from_srgb(float encoded);

/// The byte whose encoded value is nearest to that of `linear` (clamped to [0, 1], NaN counts as 0).
std::uint8_t srgb_byte_from_linear(float linear);

/// Linear value of an encoded byte. `srgb_byte_from_linear(linear_from_srgb_byte(b)) == b` for every b.
float linear_from_srgb_byte(std::uint8_t encoded);

/// round(value * 255) for value clamped to [0, 1]; NaN counts as 0. For data that is not color (alpha, normals).
std::uint8_t unorm_byte_from_float(float value);

}  // namespace nacre
