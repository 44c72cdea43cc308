// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/simd.h"
#include "backends/cpu/raster/tile_data.h"

/// @file
/// Pixels of a tile, brought in from the targets and written back; the tests of depth and stencil. Internal linkage, as
/// in simd.h.

namespace nacre::cpu::raster {
namespace {

alignas(64) constexpr std::int32_t lane_x[16] = {0, 1, 0, 1, 2, 3, 2, 3, 0, 1, 0, 1, 2, 3, 2, 3};
alignas(64) constexpr std::int32_t lane_y[16] = {0, 0, 1, 1, 0, 0, 1, 1, 2, 2, 3, 3, 2, 2, 3, 3};

/// First lane of the block at (x, y), counted in blocks of the tile.
NACRE_LANES_INLINE std::uint32_t block_place(std::int32_t x, std::int32_t y) {
    return static_cast<std::uint32_t>(y * tile_blocks + x) * 16;
}

/// Four texels of a row, `bytes` each, as one vector for each 32-bit word of a texel (one for texels below 32 bits),
/// and back.
template <int bytes>
NACRE_LANES_INLINE void load_row(const std::byte* from, Int4* words) {
    if constexpr (bytes == 1) {
        using Bytes [[gnu::vector_size(4)]] = std::uint8_t;
        Bytes texels;
        std::memcpy(&texels, from, sizeof(texels));
        words[0] = __builtin_convertvector(texels, Int4);
    } else if constexpr (bytes == 2) {
        using Halves [[gnu::vector_size(8)]] = std::uint16_t;
        Halves texels;
        std::memcpy(&texels, from, sizeof(texels));
        words[0] = __builtin_convertvector(texels, Int4);
    } else if constexpr (bytes == 4) {
        words[0] = load4(from);
    } else if constexpr (bytes == 8) {
        const Int4 low = load4(from), high = load4(from + 16);
        words[0] = __builtin_shufflevector(low, high, 0, 2, 4, 6);
        words[1] = __builtin_shufflevector(low, high, 1, 3, 5, 7);
    } else {
        for (int i = 0; i < 4; ++i) words[i] = load4(from + 16 * i);
        transpose(words[0], words[1], words[2], words[3]);
    }
}
/// @param streams  past the caches; rows must be aligned to 16 bytes. For texels of at least 4 bytes.
template <int bytes, bool streams>
NACRE_LANES_INLINE void store_row(std::byte* to, const Int4* words) {
    const auto put = [](std::byte* at, Int4 value) {
        if constexpr (streams)
            stream4(at, value);
        else
            store4(at, value);
    };
    if constexpr (bytes == 1) {
        using Bytes [[gnu::vector_size(4)]] = std::uint8_t;
        const Bytes texels = __builtin_convertvector(words[0], Bytes);
        std::memcpy(to, &texels, sizeof(texels));
    } else if constexpr (bytes == 2) {
        using Halves [[gnu::vector_size(8)]] = std::uint16_t;
        const Halves texels = __builtin_convertvector(words[0], Halves);
        std::memcpy(to, &texels, sizeof(texels));
    } else if constexpr (bytes == 4) {
        put(to, words[0]);
    } else if constexpr (bytes == 8) {
        put(to, __builtin_shufflevector(words[0], words[1], 0, 4, 1, 5));
        put(to + 16, __builtin_shufflevector(words[0], words[1], 2, 6, 3, 7));
    } else {
        Int4 texels[4] = {words[0], words[1], words[2], words[3]};
        transpose(texels[0], texels[1], texels[2], texels[3]);
        for (int i = 0; i < 4; ++i) put(to + 16 * i, texels[i]);
    }
}

/// Pixels of a target in the memory of a tile: blocks of 16 lanes, one array for each word of a texel.
struct TileArea {
    std::int32_t* blocks;       ///< First word of the first block.
    std::uint32_t block_words;  ///< From a block to the next in its row, and from its row to the next of the tile.
    std::uint32_t row_words;
    std::int32_t width, height;  ///< Pixels; what of a block sticks out of them is not in the target.
};

#if defined(__AVX512F__)
/// Four blocks side by side to their four rows of sixteen texels of a word, and back.
NACRE_LANES_INLINE void blocks_to_rows(const IntRegister (&blocks)[4], IntRegister (&rows)[4]) {
    for (int pair = 0; pair < 2; ++pair) {
        IntRegister halves[2];  // The left and the right half of two rows.
        for (int half = 0; half < 2; ++half) {
            const IntRegister left = blocks[2 * half], right = blocks[2 * half + 1];
            halves[half] = pair == 0 ? __builtin_shufflevector(left, right, 0, 1, 4, 5, 16, 17, 20, 21, 2, 3, 6, 7, 18,
                                                               19, 22, 23)
                                     : __builtin_shufflevector(left, right, 8, 9, 12, 13, 24, 25, 28, 29, 10, 11, 14,
                                                               15, 26, 27, 30, 31);
        }
        rows[2 * pair] = __builtin_shufflevector(halves[0], halves[1], 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21,
                                                 22, 23);
        rows[2 * pair + 1] = __builtin_shufflevector(halves[0], halves[1], 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26,
                                                     27, 28, 29, 30, 31);
    }
}
NACRE_LANES_INLINE void rows_to_blocks(const IntRegister (&rows)[4], IntRegister (&blocks)[4]) {
    IntRegister halves[2][2];  // The upper and the lower half of blocks 0 and 1, and of 2 and 3.
    for (int pair = 0; pair < 2; ++pair) {
        const IntRegister top = rows[2 * pair], bottom = rows[2 * pair + 1];
        halves[pair][0] =
            __builtin_shufflevector(top, bottom, 0, 1, 16, 17, 2, 3, 18, 19, 4, 5, 20, 21, 6, 7, 22, 23);
        halves[pair][1] =
            __builtin_shufflevector(top, bottom, 8, 9, 24, 25, 10, 11, 26, 27, 12, 13, 28, 29, 14, 15, 30, 31);
    }
    for (int half = 0; half < 2; ++half) {
        blocks[2 * half] = __builtin_shufflevector(halves[0][half], halves[1][half], 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18,
                                                   19, 20, 21, 22, 23);
        blocks[2 * half + 1] = __builtin_shufflevector(halves[0][half], halves[1][half], 8, 9, 10, 11, 12, 13, 14, 15,
                                                       24, 25, 26, 27, 28, 29, 30, 31);
    }
}
#endif

/// Rows of texels of `bytes` bytes to blocks, and back.
template <int bytes>
inline void load_pixels(const std::byte* from, std::uint32_t row_stride, const TileArea& area) {
    constexpr int words = bytes < 4 ? 1 : bytes / 4;
    for (std::int32_t y = 0; y < area.height; y += 4) {
        const std::byte* const line = from + static_cast<std::size_t>(y) * row_stride;
        std::int32_t* block = area.blocks + static_cast<std::size_t>(y / 4) * area.row_words;
        std::int32_t x = 0;
#if defined(__AVX512F__)
        if constexpr (bytes == 4)
            for (; x + 16 <= area.width && y + 4 <= area.height; x += 16) {
                IntRegister rows[4], blocks[4];
                for (int row = 0; row < 4; ++row)
                    std::memcpy(&rows[row], line + static_cast<std::size_t>(row) * row_stride + x * bytes, 64);
                rows_to_blocks(rows, blocks);
                for (int i = 0; i < 4; ++i, block += area.block_words) std::memcpy(block, &blocks[i], 64);
            }
#endif
        for (; x < area.width; x += 4, block += area.block_words) {
            if (x + 4 <= area.width && y + 4 <= area.height) {
                Int4 rows[4][words];
                for (int row = 0; row < 4; ++row)
                    load_row<bytes>(line + static_cast<std::size_t>(row) * row_stride + x * bytes, rows[row]);
                for (int word = 0; word < words; ++word)
                    for (int pair = 0; pair < 2; ++pair) {
                        const Int4 top = rows[2 * pair][word], bottom = rows[2 * pair + 1][word];
                        store4(block + 16 * word + 8 * pair, __builtin_shufflevector(top, bottom, 0, 1, 4, 5));
                        store4(block + 16 * word + 8 * pair + 4, __builtin_shufflevector(top, bottom, 2, 3, 6, 7));
                    }
                continue;
            }
            for (int lane = 0; lane < 16; ++lane) {
                const bool inside = x + lane_x[lane] < area.width && y + lane_y[lane] < area.height;
                std::uint32_t texel[words] = {};
                if (inside)
                    std::memcpy(texel,
                                line + static_cast<std::size_t>(lane_y[lane]) * row_stride +
                                    static_cast<std::size_t>(x + lane_x[lane]) * bytes,
                                bytes);
                for (int word = 0; word < words; ++word) std::memcpy(block + 16 * word + lane, texel + word, 4);
            }
        }
    }
}

template <int bytes, bool streams>
inline void store_pixels(std::byte* to, std::uint32_t row_stride, const TileArea& area) {
    constexpr int words = bytes < 4 ? 1 : bytes / 4;
    for (std::int32_t y = 0; y < area.height; y += 4) {
        std::byte* const line = to + static_cast<std::size_t>(y) * row_stride;
        const std::int32_t* const blocks = area.blocks + static_cast<std::size_t>(y / 4) * area.row_words;
        const std::int32_t whole = area.height - y < 4 ? 0 : area.width / 4;
        std::int32_t first = 0;
#if defined(__AVX512F__)
        // Whole lines of the cache.
        if constexpr (bytes == 4)
            if (!streams || ((reinterpret_cast<std::uintptr_t>(line) | row_stride) & 63) == 0) {
                const std::int32_t* block = blocks;
                for (; first + 4 <= whole; first += 4) {
                    IntRegister four[4], rows[4];
                    for (int i = 0; i < 4; ++i, block += area.block_words) std::memcpy(&four[i], block, 64);
                    blocks_to_rows(four, rows);
                    for (int row = 0; row < 4; ++row) {
                        std::byte* const texels = line + static_cast<std::size_t>(row) * row_stride + first * 16;
                        if constexpr (streams)
                            _mm512_stream_si512(reinterpret_cast<__m512i*>(texels), (__m512i)rows[row]);
                        else
                            std::memcpy(texels, &rows[row], 64);
                    }
                }
            }
#endif
        // Row by row, two at once, so that lines of the cache are written as a whole.
        for (int pair = 0; pair < 2; ++pair) {
            std::byte* texels = line + static_cast<std::size_t>(2 * pair) * row_stride + first * (4 * bytes);
            const std::int32_t* block = blocks + 8 * pair + static_cast<std::size_t>(first) * area.block_words;
            for (std::int32_t x = first; x < whole; ++x, texels += 4 * bytes, block += area.block_words) {
                Int4 top[words], bottom[words];
                for (int word = 0; word < words; ++word) {
                    const Int4 left = load4(block + 16 * word), right = load4(block + 16 * word + 4);
                    top[word] = __builtin_shufflevector(left, right, 0, 1, 4, 5);
                    bottom[word] = __builtin_shufflevector(left, right, 2, 3, 6, 7);
                }
                store_row<bytes, streams>(texels, top);
                store_row<bytes, streams>(texels + row_stride, bottom);
            }
        }
        for (std::int32_t x = 4 * whole; x < area.width; x += 4)
            for (int lane = 0; lane < 16; ++lane) {
                if (x + lane_x[lane] >= area.width || y + lane_y[lane] >= area.height) continue;
                std::uint32_t texel[words];
                for (int word = 0; word < words; ++word)
                    std::memcpy(texel + word,
                                blocks + static_cast<std::size_t>(x / 4) * area.block_words + 16 * word + lane, 4);
                std::memcpy(line + static_cast<std::size_t>(lane_y[lane]) * row_stride +
                                static_cast<std::size_t>(x + lane_x[lane]) * bytes,
                            texel, bytes);
            }
    }
}

/// All pixels of the area, also those that are not in the target.
inline void fill_pixels(const std::uint32_t* texel, std::uint32_t words, const TileArea& area) {
    for (std::int32_t y = 0; y < area.height; y += 4) {
        std::int32_t* block = area.blocks + static_cast<std::size_t>(y / 4) * area.row_words;
        for (std::int32_t x = 0; x < area.width; x += 4, block += area.block_words)
            for (std::uint32_t word = 0; word < words; ++word)
                store(block + 16 * word, ints(static_cast<std::int32_t>(texel[word])));
    }
}
/// The same in a target.
/// @param streams  as for store_pixels
inline void fill_texels(const std::uint32_t* texel, std::uint32_t bytes, std::byte* to, std::uint32_t row_stride,
                        std::int32_t width, std::int32_t height, bool streams) {
    alignas(64) std::byte pattern[64];
    for (std::uint32_t at = 0; at < sizeof(pattern); at += bytes) __builtin_memcpy(pattern + at, texel, bytes);
    const std::size_t length = static_cast<std::size_t>(width) * bytes;
    const bool aligned = ((reinterpret_cast<std::uintptr_t>(to) | row_stride | length) & 63) == 0;
    if (streams && aligned) {
        const Int4 part = load4(pattern);
        for (std::int32_t y = 0; y < height; ++y, to += row_stride)
            for (std::size_t at = 0; at < length; at += 16) stream4(to + at, part);
        return;
    }
    for (std::int32_t y = 0; y < height; ++y, to += row_stride) {
        std::size_t at = 0;
        for (; at + sizeof(pattern) <= length; at += sizeof(pattern)) std::memcpy(to + at, pattern, sizeof(pattern));
        for (; at < length; at += bytes) __builtin_memcpy(to + at, texel, bytes);
    }
}

inline void load_pixels(std::uint32_t bytes, const std::byte* from, std::uint32_t row_stride, const TileArea& area) {
    switch (bytes) {
        case 1: load_pixels<1>(from, row_stride, area); break;
        case 2: load_pixels<2>(from, row_stride, area); break;
        case 4: load_pixels<4>(from, row_stride, area); break;
        case 8: load_pixels<8>(from, row_stride, area); break;
        default: load_pixels<16>(from, row_stride, area); break;
    }
}
/// @param streams  past the caches, where rows are aligned for that
inline void store_pixels(std::uint32_t bytes, std::byte* to, std::uint32_t row_stride, const TileArea& area,
                         bool streams) {
    const bool aligned = ((reinterpret_cast<std::uintptr_t>(to) | row_stride) & 15) == 0;
    switch (streams && aligned && bytes >= 4 ? bytes + 1 : bytes) {
        case 1: store_pixels<1, false>(to, row_stride, area); break;
        case 2: store_pixels<2, false>(to, row_stride, area); break;
        case 4: store_pixels<4, false>(to, row_stride, area); break;
        case 5: store_pixels<4, true>(to, row_stride, area); break;
        case 8: store_pixels<8, false>(to, row_stride, area); break;
        case 9: store_pixels<8, true>(to, row_stride, area); break;
        case 16: store_pixels<16, false>(to, row_stride, area); break;
        default: store_pixels<16, true>(to, row_stride, area); break;
    }
}

/// Depth as the integer that the target holds; integers compare like the depths. Floats that are not negative compare
/// like their bits. `low` and `high` are the range of depth clamp, or 0 and 1; `low` is not negative, nor negative
/// zero.
NACRE_LANES_INLINE Ints depth_key(DepthLayout layout, const Floats& depth, float low, float high) {
    const Floats bounded = clamp(depth, low, high);
    switch (layout) {
        case DepthLayout::unorm16: return round_to_ints(bounded * floats(65535.0f));
        case DepthLayout::unorm24: return round_to_ints(bounded * floats(16777215.0f));
        default: return bits_of(bounded);
    }
}
/// The same for one number, in the same arithmetic.
NACRE_LANES_INLINE std::int32_t depth_key(DepthLayout layout, float depth, float low, float high) {
    const float raised = low < depth ? depth : low;
    const float bounded = raised < high ? raised : high;
    switch (layout) {
        case DepthLayout::unorm16: return static_cast<std::int32_t>(__builtin_rintf(bounded * 65535.0f));
        case DepthLayout::unorm24: return static_cast<std::int32_t>(__builtin_rintf(bounded * 16777215.0f));
        default: return __builtin_bit_cast(std::int32_t, bounded);
    }
}

NACRE_LANES_INLINE Lanes compare(rhi::CompareOperation operation, const Ints& a, const Ints& b) {
    switch (operation) {
        case rhi::CompareOperation::never: return lanes_of(0);
        case rhi::CompareOperation::less: return less(a, b);
        case rhi::CompareOperation::equal: return equal(a, b);
        case rhi::CompareOperation::less_or_equal: return ~less(b, a);
        case rhi::CompareOperation::greater: return less(b, a);
        case rhi::CompareOperation::not_equal: return ~equal(a, b);
        case rhi::CompareOperation::greater_or_equal: return ~less(a, b);
        default: return lanes_of(0xffff);
    }
}

inline Ints apply_stencil_operation(rhi::StencilOperation operation, const Ints& value, std::uint8_t reference) {
    using enum rhi::StencilOperation;
    switch (operation) {
        case zero: return ints(0);
        case replace: return ints(reference);
        case increment_clamp: return minimum(value + ints(1), ints(255));
        case decrement_clamp: return maximum(value - ints(1), ints(0));
        case invert: return value ^ ints(255);
        case increment_wrap: return (value + ints(1)) & ints(255);
        case decrement_wrap: return (value - ints(1)) & ints(255);
        default: return value;
    }
}

/// Stencil and depth test of the lanes in `mask`, all facing the same way; changes `depth` and `stencil` of those lanes
/// as the draw says. A null pointer: there is no such target, the test passes.
/// @return lanes that passed
inline std::uint32_t test_lanes(const DepthStencilPlan& plan, bool front, const Ints& key, std::uint32_t mask,
                                std::int32_t* depth, std::int32_t* stencil) {
    const Lanes asked = lanes_of(mask);
    const rhi::StencilFace& face = front ? plan.front : plan.back;
    const bool tests_stencil = plan.stencil_test && stencil;
    Lanes passed_stencil = asked;
    Ints stencil_value = ints(0);
    if (tests_stencil) {
        stencil_value = load(stencil);
        passed_stencil =
            asked & compare(face.compare, ints(plan.reference & face.read_mask), stencil_value & ints(face.read_mask));
    }
    Lanes passed = passed_stencil;
    if (plan.depth_test && depth) {
        const Ints old = load(depth);
        passed = passed_stencil & compare(plan.compare, key, old);
        if (plan.depth_write) store(depth, select(passed, key, old));
    }
    if (tests_stencil && face.write_mask != 0) {
        Ints changed = apply_stencil_operation(face.fail, stencil_value, plan.reference);
        changed =
            select(passed_stencil, apply_stencil_operation(face.depth_fail, stencil_value, plan.reference), changed);
        changed = select(passed, apply_stencil_operation(face.pass, stencil_value, plan.reference), changed);
        changed = select(asked, changed, stencil_value);
        const Ints written = ints(face.write_mask);
        store(stencil, (changed & written) | (stencil_value & ~written));
    }
    return mask_of(passed);
}

}  // namespace
}  // namespace nacre::cpu::raster
