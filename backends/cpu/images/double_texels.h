// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rhi/format.h"

/// @file
/// Texels of devices in double precision: beside the bits that the format stores lie the doubles that they were made
/// from
/// (`ImageLevel::shadow`). Reads take these where they stand for the stored bits, so that texels which were written by
/// another way (by the host, as integers, by atomics) are never hidden by older doubles.

namespace nacre::cpu {

/// Channels as a shader sees them; those that the format lacks are 0, alpha 1.
using DoubleTexel = std::array<double, 4>;

/// Channels of formats whose texels are floats of 32 bits and nothing else, so that their doubles are those of the
/// words of a buffer; 0 of other formats.
std::uint32_t float_words(rhi::Format format);

/// Whether textures of the format have doubles: all but integers, compressed and shared-exponent formats.
bool has_shadow(rhi::Format format);

/// What the stored bits stand for, without any rounding: code / most of fixed-point channels, the sRGB curve in
/// doubles. Reads what `decode_texel` (texel_formats.h) reads. Interpolated colors of BC4, BC5 and BC6H are those of
/// `decode_texel`.
DoubleTexel decode_double(rhi::Format format, const std::byte* block, std::uint32_t x_in_block = 0,
                          std::uint32_t y_in_block = 0);

/// The texel's doubles, one for each channel of the format, where they stand for its bits, else what the bits stand
/// for. `shadow` may be null.
DoubleTexel load_double(rhi::Format format, const std::byte* texel, const double* shadow);

/// Stores the bits that `encode_texel` gives for the values rounded to float, and the values, in the range of the
/// format. `shadow` may be null.
void store_double(rhi::Format format, const DoubleTexel& values, std::byte* texel, double* shadow);

}  // namespace nacre::cpu
