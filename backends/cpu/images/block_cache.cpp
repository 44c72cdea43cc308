// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/block_cache.h"

#include "backends/cpu/images/block_formats.h"

namespace nacre::cpu {

using rhi::Format;

BlockCache& BlockCache::of_this_thread() {
    thread_local BlockCache cache;
    return cache;
}

void BlockCache::decode(Format format, const std::byte* block, std::uint64_t low, std::uint64_t high,
                        DecodedBlock& entry) {
    entry.format = format;
    entry.key[0] = low, entry.key[1] = high;
    switch (format) {
        case Format::bc4_r_unorm:
        case Format::bc4_r_snorm: decode_channel_block(block, format == Format::bc4_r_snorm, entry.channels[0]); break;
        case Format::bc5_rg_unorm:
        case Format::bc5_rg_snorm:
            for (int c = 0; c < 2; ++c)
                decode_channel_block(block + 8 * c, format == Format::bc5_rg_snorm, entry.channels[c]);
            break;
        case Format::bc6h_rgb_ufloat:
        case Format::bc6h_rgb_sfloat: decode_bc6h_block(block, format == Format::bc6h_rgb_sfloat, entry.halves); break;
        default: decode_rgba8_block(format, block, entry.rgba8); break;
    }
}

}  // namespace nacre::cpu
