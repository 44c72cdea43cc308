// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/simd.h"
#include "backends/cpu/raster/tile_data.h"

/// @file
/// Depth and stencil of a tile: brought in from the targets, tested, written back. Internal linkage, as in simd.h.

namespace nacre::cpu::raster {
namespace {

alignas(64) constexpr std::int32_t lane_x[16] = {0, 1, 0, 1, 2, 3, 2, 3, 0, 1, 0, 1, 2, 3, 2, 3};
alignas(64) constexpr std::int32_t lane_y[16] = {0, 0, 1, 1, 0, 0, 1, 1, 2, 2, 3, 3, 2, 2, 3, 3};

/// First lane of the block at (x, y), counted in blocks of the tile.
NACRE_LANES_INLINE std::uint32_t block_place(std::int32_t x, std::int32_t y) {
    return static_cast<std::uint32_t>(y * tile_blocks + x) * 16;
}

/// Rows of `width` x `height` pixels of `Element` to blocks of integers, and back.
template <typename Element>
inline void load_pixels(const std::byte* from, std::uint32_t row_stride, std::int32_t width, std::int32_t height,
                        std::int32_t* to) {
    for (std::int32_t y = 0; y < height; y += 4)
        for (std::int32_t x = 0; x < width; x += 4) {
            std::int32_t* const block = to + block_place(x / 4, y / 4);
            if (x + 4 <= width && y + 4 <= height) {
                for (std::int32_t row = 0; row < 4; ++row) {
                    Element texels[4];
                    std::memcpy(texels, from + static_cast<std::size_t>(y + row) * row_stride + x * sizeof(Element),
                                sizeof(texels));
                    std::int32_t* const line = block + 8 * (row / 2) + 2 * (row & 1);
                    line[0] = static_cast<std::int32_t>(texels[0]), line[1] = static_cast<std::int32_t>(texels[1]);
                    line[4] = static_cast<std::int32_t>(texels[2]), line[5] = static_cast<std::int32_t>(texels[3]);
                }
                continue;
            }
            for (int lane = 0; lane < 16; ++lane) {
                block[lane] = 0;
                if (x + lane_x[lane] >= width || y + lane_y[lane] >= height) continue;
                Element texel;
                std::memcpy(&texel,
                            from + static_cast<std::size_t>(y + lane_y[lane]) * row_stride +
                                static_cast<std::size_t>(x + lane_x[lane]) * sizeof(Element),
                            sizeof(texel));
                block[lane] = static_cast<std::int32_t>(texel);
            }
        }
}

template <typename Element>
inline void store_pixels(std::byte* to, std::uint32_t row_stride, std::int32_t width, std::int32_t height,
                         const std::int32_t* from) {
    for (std::int32_t y = 0; y < height; y += 4)
        for (std::int32_t x = 0; x < width; x += 4) {
            const std::int32_t* const block = from + block_place(x / 4, y / 4);
            if (x + 4 <= width && y + 4 <= height) {
                for (std::int32_t row = 0; row < 4; ++row) {
                    const std::int32_t* const line = block + 8 * (row / 2) + 2 * (row & 1);
                    const Element texels[4] = {static_cast<Element>(line[0]), static_cast<Element>(line[1]),
                                               static_cast<Element>(line[4]), static_cast<Element>(line[5])};
                    std::memcpy(to + static_cast<std::size_t>(y + row) * row_stride + x * sizeof(Element), texels,
                                sizeof(texels));
                }
                continue;
            }
            for (int lane = 0; lane < 16; ++lane) {
                if (x + lane_x[lane] >= width || y + lane_y[lane] >= height) continue;
                const Element texel = static_cast<Element>(block[lane]);
                std::memcpy(to + static_cast<std::size_t>(y + lane_y[lane]) * row_stride +
                                static_cast<std::size_t>(x + lane_x[lane]) * sizeof(Element),
                            &texel, sizeof(texel));
            }
        }
}

/// Depth as the integer that the target holds; integers compare like the depths. Floats that are not negative compare
/// like their bits. `low` and `high` are the range of depth clamp, or 0 and 1.
NACRE_LANES_INLINE Ints depth_key(DepthLayout layout, const Floats& depth, float low, float high) {
    const Floats bounded = clamp(depth, low, high);
    switch (layout) {
        case DepthLayout::unorm16: return round_to_ints(bounded * floats(65535.0f));
        case DepthLayout::unorm24: return round_to_ints(bounded * floats(16777215.0f));
        default: return bits_of(bounded) & ints(0x7fffffff);
    }
}
/// The same for one number, in the same arithmetic.
NACRE_LANES_INLINE std::int32_t depth_key(DepthLayout layout, float depth, float low, float high) {
    const float raised = low < depth ? depth : low;
    const float bounded = raised < high ? raised : high;
    switch (layout) {
        case DepthLayout::unorm16: return static_cast<std::int32_t>(__builtin_rintf(bounded * 65535.0f));
        case DepthLayout::unorm24: return static_cast<std::int32_t>(__builtin_rintf(bounded * 16777215.0f));
        default: return __builtin_bit_cast(std::int32_t, bounded) & 0x7fffffff;
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
