// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "rhi/format.h"

/// @file
/// Texels of every format, one at a time: what their bits mean, and which bits stand for a value.

namespace nacre::cpu {

/// Four channels as a shader sees them: `u` or `i` for integer formats, else `f`.
struct Texel {
    union {
        float f[4];
        std::uint32_t u[4];
        std::int32_t i[4];
    };
};

/// The texel at (x_in_block, y_in_block) of `block` (both 0 for formats that are not compressed). Channels that the
/// format lacks are 0, alpha 1; sRGB formats give linear values, depth formats the depth in f[0]. `undefined` gives
/// zeros.
///
/// Reads `rhi::info(format).block_bytes` bytes, for formats with stencil the four bytes of the depth plane (see
/// image_view.h). Sources: Vulkan specification ("Conversion From Normalized Fixed-Point", "16-Bit Floating-Point
/// Numbers" and its kin) and Khronos Data Format Specification (compressed formats). Colors of BC1 to BC3 are widened
/// to 8 bits before they are mixed, and the mix is rounded to 8 bits, as is usual; all other formats are decoded
/// exactly (one rounding to float).
Texel decode_texel(rhi::Format format, const std::byte* block, std::uint32_t x_in_block = 0,
                   std::uint32_t y_in_block = 0);

/// Writes the bits that stand for `texel`, as many as `decode_texel` reads. Fixed-point channels are clamped and
/// rounded to nearest even, NaN gives 0; small floating-point channels are rounded to nearest even, overflow gives
/// infinity for 16 bits and the largest finite value for 11 and 10 bits, negative values give 0 in formats without a
/// sign. Integers keep their low bits. Compressed formats and `undefined`: writes nothing.
void encode_texel(rhi::Format format, const Texel& texel, std::byte* out);

/// Linear value of an 8-bit sRGB code: 256 floats. Source: IEC 61966-2-1.
const float* srgb_to_linear_table();
/// The same by bytes, lowest first: byte k of the float of a code at 256 * k + code. Aligned to 64.
const std::byte* srgb_to_linear_bytes();

/// Nearest 8-bit sRGB code of a linear value; NaN gives 0.
std::uint8_t linear_to_srgb(float linear);

/// A 16-bit float as float, exactly; NaN stays NaN (quiet).
float half_to_float(std::uint16_t half);
/// Rounds to nearest even; NaN stays NaN (quiet).
std::uint16_t float_to_half(float value);

}  // namespace nacre::cpu
