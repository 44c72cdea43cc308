// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "rhi/format.h"

/// @file
/// Decoded blocks of compressed textures, a few for each thread. Neighboring samples read the same blocks, and decoding one costs
/// many times more than finding it again. Blocks are found by their bits, not by their address, so nothing is ever out of date.

namespace nacre::cpu {

struct DecodedBlock {
    std::uint64_t key[2] = {};
    rhi::Format format = rhi::Format::undefined;
    union {
        std::uint32_t rgba8[16];       ///< BC1, BC2, BC3, BC7.
        float channels[2][16];         ///< BC4, BC5.
        std::uint16_t halves[16][3];   ///< BC6H.
    };
    DecodedBlock() : rgba8{} {}
};

class BlockCache {
  public:
    /// The calling thread's own.
    static BlockCache& of_this_thread();
    /// Valid until the next call.
    const DecodedBlock& find(rhi::Format format, const std::byte* block);

  private:
    static constexpr std::uint32_t capacity = 128;
    DecodedBlock blocks_[capacity];
};

}  // namespace nacre::cpu
