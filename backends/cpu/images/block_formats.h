// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "rhi/format.h"

/// @file
/// Blocks of 4x4 texels of the compressed formats. Texel (x, y) of a block is element 4 * y + x.
/// Source: Khronos Data Format Specification 1.3, chapters on S3TC, RGTC and BPTC.

namespace nacre::cpu {

/// BC1, BC2, BC3 and BC7: 8-bit RGBA codes, red in the low byte; sRGB codes are left as they are.
void decode_rgba8_block(rhi::Format format, const std::byte* block, std::uint32_t (&texels)[16]);
/// BC7 alone; 16 bytes. A block of the reserved mode is all zero.
void decode_bc7_block(const std::byte* block, std::uint32_t (&texels)[16]);
/// One channel of BC4 and BC5 (8 bytes): values in [0, 1] or [-1, 1].
void decode_channel_block(const std::byte* block, bool is_signed, float (&texels)[16]);
/// BC6H: 16-bit floats of red, green and blue. A block of a reserved mode is all zero.
void decode_bc6h_block(const std::byte* block, bool is_signed, std::uint16_t (&texels)[16][3]);

/// For two subsets, bit i is the subset of texel i (shared by BC6H and BC7); and the texel of the second subset whose
/// index has one bit less.
extern const std::uint16_t two_subset_partitions[64];
extern const std::uint8_t two_subset_anchors[64];

}  // namespace nacre::cpu
