// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/block_cache.h"

#include <cstring>

#include "backends/cpu/images/block_formats.h"

namespace nacre::cpu {

using rhi::Format;

BlockCache& BlockCache::of_this_thread() {
    thread_local BlockCache cache;
    return cache;
}

const DecodedBlock& BlockCache::find(Format format, const std::byte* block) {
    const std::uint32_t bytes = rhi::info(format).block_bytes;
    std::uint64_t key[2] = {};
    std::memcpy(key, block, bytes);
    const std::uint64_t mixed = (key[0] ^ (key[1] * 0x9e3779b97f4a7c15ull)) * 0xd6e8feb86659fd93ull;
    DecodedBlock& entry = blocks_[mixed >> 57];
    static_assert(capacity == 1u << (64 - 57));
    if (entry.format == format && entry.key[0] == key[0] && entry.key[1] == key[1]) return entry;
    entry.format = format;
    entry.key[0] = key[0], entry.key[1] = key[1];
    switch (format) {
        case Format::bc4_r_unorm: case Format::bc4_r_snorm:
            decode_channel_block(block, format == Format::bc4_r_snorm, entry.channels[0]);
            break;
        case Format::bc5_rg_unorm: case Format::bc5_rg_snorm:
            for (int c = 0; c < 2; ++c) decode_channel_block(block + 8 * c, format == Format::bc5_rg_snorm, entry.channels[c]);
            break;
        case Format::bc6h_rgb_ufloat: case Format::bc6h_rgb_sfloat:
            decode_bc6h_block(block, format == Format::bc6h_rgb_sfloat, entry.halves);
            break;
        default: decode_rgba8_block(format, block, entry.rgba8); break;
    }
    return entry;
}

}  // namespace nacre::cpu
