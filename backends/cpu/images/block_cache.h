// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "rhi/format.h"

/// @file
/// Decoded blocks of compressed textures, a few for each thread. Neighboring samples read the same blocks, and decoding
/// one costs many times more than finding it again. Blocks are found by their bits, not by their address, so nothing is
/// ever out of date.

namespace nacre::cpu {

struct DecodedBlock {
    std::uint64_t key[2] = {};
    rhi::Format format = rhi::Format::undefined;
    union {
        std::uint32_t rgba8[16];      ///< BC1, BC2, BC3, BC7.
        float channels[2][16];        ///< BC4, BC5.
        std::uint16_t halves[16][3];  ///< BC6H.
    };
    DecodedBlock() : rgba8{} {}
};

class BlockCache {
  public:
    /// The calling thread's own.
    static BlockCache& of_this_thread();
    /// Valid until the next call. `bytes`: 8 or 16, of a block of `format`. Inlined always: a copy of it for one
    /// instruction set must not be linked into code for another.
    [[gnu::always_inline]] const DecodedBlock& find(rhi::Format format, const std::byte* block, std::uint32_t bytes) {
        std::uint64_t low, high = 0;
        __builtin_memcpy(&low, block, 8);
        if (bytes == 16) __builtin_memcpy(&high, block + 8, 8);
        const std::uint64_t mixed = (low ^ (high * 0x9e3779b97f4a7c15ull)) * 0xd6e8feb86659fd93ull;
        DecodedBlock& entry = blocks_[mixed >> (64 - index_bits)];
        if (entry.format != format || entry.key[0] != low || entry.key[1] != high)
            decode(format, block, low, high, entry);
        return entry;
    }

  private:
    static constexpr std::uint32_t index_bits = 8;
    static void decode(rhi::Format format, const std::byte* block, std::uint64_t low, std::uint64_t high,
                       DecodedBlock& entry);
    DecodedBlock blocks_[1u << index_bits];
};

}  // namespace nacre::cpu
