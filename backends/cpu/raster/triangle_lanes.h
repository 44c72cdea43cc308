// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/simd.h"
#include "backends/cpu/raster/tile_data.h"

/// @file
/// Set-up of sixteen triangles at once. Internal linkage, as in simd.h.
///
/// What is computed for one triangle is what Assembler (chunk.cpp) computes for it, bit for bit: the same steps in the
/// same precision.

namespace nacre::cpu::raster {
namespace {

using Doubles [[gnu::vector_size(64)]] = double;
using Longs [[gnu::vector_size(64)]] = std::int64_t;
using HalfFloats [[gnu::vector_size(32)]] = float;
using HalfInts [[gnu::vector_size(32)]] = std::int32_t;

/// Half 0 or 1 of sixteen lanes.
template <int half, typename Half, typename Whole>
NACRE_LANES_INLINE Half half_of(const Whole& all) {
    Half values;
#if defined(__AVX512F__)
    values = half == 0 ? __builtin_shufflevector(all.part[0], all.part[0], 0, 1, 2, 3, 4, 5, 6, 7)
                       : __builtin_shufflevector(all.part[0], all.part[0], 8, 9, 10, 11, 12, 13, 14, 15);
#else
    std::memcpy(&values, reinterpret_cast<const std::byte*>(&all) + half * sizeof(values), sizeof(values));
#endif
    return values;
}
template <int half>
NACRE_LANES_INLINE Doubles doubles_of(const Floats& from) {
    return __builtin_convertvector((half_of<half, HalfFloats>(from)), Doubles);
}
template <int half>
NACRE_LANES_INLINE Doubles doubles_of(const Ints& from) {
    return __builtin_convertvector((half_of<half, HalfInts>(from)), Doubles);
}
NACRE_LANES_INLINE Doubles doubles(double value) { return value - Doubles{}; }
NACRE_LANES_INLINE Doubles magnitude(Doubles a) { return (Doubles)((Longs)a & 0x7fffffffffffffff); }
NACRE_LANES_INLINE Doubles larger(Doubles a, Doubles b) { return a < b ? b : a; }
NACRE_LANES_INLINE std::uint32_t mask_of_eight(Longs truth) {
    const HalfInts narrow = __builtin_convertvector(truth, HalfInts);
    Ints all{};
    std::memcpy(&all, &narrow, sizeof(narrow));
    return mask_of(~not_negative(all)) & 0xff;
}

/// Sixteen vertices, value by value.
struct CornerLanes {
    Ints x, y, codes, offset;
    Floats window_x, window_y, window_z;

    /// Where they are; those behind the last triangle repeat the first.
    void gather_fixed(const TriangleSetup& work, std::uint32_t corner) {
        Ints words[4];
        load_rows(
            [&](int lane) {
                const std::uint32_t triangle = static_cast<std::uint32_t>(lane) < work.count ? lane : 0;
                return &work.vertices[work.corners[3 * triangle + corner]];
            },
            words);
        x = words[0], y = words[1], codes = words[2], offset = words[3];
    }
    /// What only those need that are drawn.
    void gather_window(const TriangleSetup& work) {
        alignas(64) std::uint32_t offsets[16];
        store(offsets, offset);
        Ints words[4];
        load_rows([&](int lane) { return work.screen + static_cast<std::size_t>(offsets[lane]) * 16; }, words);
        window_x = floats_of_bits(words[0]), window_y = floats_of_bits(words[1]), window_z = floats_of_bits(words[2]);
    }
};

/// Vulkan specification, "Depth Bias Computation".
/// @param largest  depth of the vertices, by magnitude
NACRE_LANES_INLINE Doubles depth_bias(const TriangleSetup& work, Doubles slope, Doubles largest) {
    Doubles unit = doubles(work.bias_unit);
    if (work.bias_unit == 0.0) {
        // That of single precision: the value of the last bit of the largest depth, which is never a denormal double.
        const Longs exponent = ((Longs)largest >> 52) - 1023;
        const Longs bounded = exponent < -126 ? Longs{} - 126 : exponent;
        unit = (Doubles)((bounded - 23 + 1023) << 52);
        unit = largest > 0.0 ? unit : Doubles{};
    }
    Doubles result = slope * static_cast<double>(work.bias_slope) + unit * static_cast<double>(work.bias);
    const auto limit = static_cast<double>(work.bias_clamp);
    if (limit > 0.0) result = doubles(limit) < result ? doubles(limit) : result;
    if (limit < 0.0) result = result < doubles(limit) ? doubles(limit) : result;
    return result - result == 0.0 ? result : Doubles{};
}

/// Pixels with a center inside of the bounds of a triangle, inclusive.
struct PixelBounds {
    Ints low_x, high_x, low_y, high_y;
    Lanes few;  ///< At most two columns and two rows, of all pixels that there could be.
};
NACRE_LANES_INLINE PixelBounds pixel_bounds(const TriangleSetup& work, const CornerLanes (&corners)[3]) {
    const auto range = [](const Ints& first, const Ints& second, const Ints& last, std::int32_t begin, std::int32_t end,
                          Ints& low, Ints& high) {
        low = shift_right_signed<subpixel_bits>(minimum(minimum(first, second), last) + ints(subpixels / 2 - 1));
        high = shift_right_signed<subpixel_bits>(maximum(maximum(first, second), last) - ints(subpixels / 2));
        const Lanes few = less(high - low, ints(2));
        low = maximum(low, ints(begin)), high = minimum(high, ints(end - 1));
        return few;
    };
    PixelBounds bounds;
    const CornerLanes &a = corners[0], &b = corners[1], &c = corners[2];
    const Lanes few_columns = range(a.x, b.x, c.x, work.x_begin, work.x_end, bounds.low_x, bounds.high_x);
    const Lanes few_rows = range(a.y, b.y, c.y, work.y_begin, work.y_end, bounds.low_y, bounds.high_y);
    bounds.few = few_columns & few_rows;
    return bounds;
}

/// Of triangles with few pixels inside of their bounds: those that cover none of them, by the edge functions of
/// tile_coverage.h, which need no more than 32 bits here.
/// @param x  of the corners, clockwise
NACRE_LANES_INLINE std::uint32_t covers_nothing(const PixelBounds& bounds, const Ints (&x)[3], const Ints (&y)[3]) {
    const Lanes two_columns = less(bounds.low_x, bounds.high_x), two_rows = less(bounds.low_y, bounds.high_y);
    // From the center of the first pixel.
    const Ints first_x = shift_left<subpixel_bits>(bounds.low_x) + ints(subpixels / 2);
    const Ints first_y = shift_left<subpixel_bits>(bounds.low_y) + ints(subpixels / 2);
    Ints outside[4];
    for (int i = 0; i < 3; ++i) {
        const int next = i == 2 ? 0 : i + 1;
        const Ints edge_a = y[i] - y[next], edge_b = x[next] - x[i];
        const Lanes owns_border = less(ints(0), edge_a) | (equal(edge_a, ints(0)) & less(ints(0), edge_b));
        const Ints value =
            select(owns_border, ints(0), ints(-1)) + edge_a * (first_x - x[i]) + edge_b * (first_y - y[i]);
        const Ints along_x = select(two_columns, shift_left<subpixel_bits>(edge_a), ints(0));
        const Ints along_y = select(two_rows, shift_left<subpixel_bits>(edge_b), ints(0));
        const Ints at[4] = {value, value + along_x, value + along_y, value + along_x + along_y};
        for (int pixel = 0; pixel < 4; ++pixel) outside[pixel] = i == 0 ? at[pixel] : outside[pixel] | at[pixel];
    }
    return mask_of(bounds.few & ~not_negative(outside[0] & outside[1] & outside[2] & outside[3]));
}

inline void set_up_triangles(TriangleSetup& work) {
    CornerLanes corners[3];
    for (std::uint32_t i = 0; i < 3; ++i) corners[i].gather_fixed(work, i);
    const CornerLanes &a = corners[0], &b = corners[1], &c = corners[2];

    const auto has = [](const Ints& codes, std::uint32_t bits) {
        return ~equal(codes & ints(static_cast<std::int32_t>(bits)), ints(0));
    };
    const Ints any = a.codes | b.codes | c.codes, all = a.codes & b.codes & c.codes;
    const Lanes outside = has(any, not_finite) | has(all, outside_view | clip_distances_mask | cull_distances_mask);
    const Lanes clipped = has(any, outside_near | outside_far | outside_guard | clip_distances_mask);

    const PixelBounds bounds = pixel_bounds(work, corners);
    const std::uint32_t nowhere =
        mask_of(less(bounds.high_x, bounds.low_x) | less(bounds.high_y, bounds.low_y));

    std::uint32_t clockwise = 0, flat = 0;
    unrolled<2>([&](auto half) {
        // Differences of coordinates have 24 bits, so that doubles hold the products.
        const Doubles fixed_x = doubles_of<half.at>(a.x), fixed_y = doubles_of<half.at>(a.y);
        const Doubles fixed_area = (doubles_of<half.at>(b.x) - fixed_x) * (doubles_of<half.at>(c.y) - fixed_y) -
                                   (doubles_of<half.at>(c.x) - fixed_x) * (doubles_of<half.at>(b.y) - fixed_y);
        clockwise |= mask_of_eight(fixed_area > 0.0) << 8 * half.at;
        flat |= mask_of_eight(fixed_area == 0.0) << 8 * half.at;
    });
    const std::uint32_t asked = (work.count == 16 ? 0xffffu : (1u << work.count) - 1) & ~mask_of(outside);
    const std::uint32_t front = work.front_is_clockwise ? clockwise : ~clockwise;
    const std::uint32_t culled = flat | (work.cull == rhi::CullMode::front  ? front
                                         : work.cull == rhi::CullMode::back ? ~front
                                                                            : 0);
    work.special = asked & mask_of(clipped);
    std::uint32_t drawn = asked & ~work.special & ~culled & ~nowhere;
    work.drawn = 0;
    if (drawn == 0) return;
    const Lanes keeps = lanes_of(clockwise);
    const Ints turned_x[3] = {a.x, select(keeps, b.x, c.x), select(keeps, c.x, b.x)};
    const Ints turned_y[3] = {a.y, select(keeps, b.y, c.y), select(keeps, c.y, b.y)};
    drawn &= ~covers_nothing(bounds, turned_x, turned_y);
    if (drawn == 0) return;

    for (CornerLanes& corner : corners) corner.gather_window(work);
    alignas(64) float slope_x[16], slope_y[16], depth[16];
    std::uint32_t thin = 0;
    unrolled<2>([&](auto half) {
        const Doubles x0 = doubles_of<half.at>(a.window_x), y0 = doubles_of<half.at>(a.window_y);
        const Doubles z0 = doubles_of<half.at>(a.window_z);
        const Doubles x1 = doubles_of<half.at>(b.window_x) - x0, y1 = doubles_of<half.at>(b.window_y) - y0;
        const Doubles x2 = doubles_of<half.at>(c.window_x) - x0, y2 = doubles_of<half.at>(c.window_y) - y0;
        const Doubles z1 = doubles_of<half.at>(b.window_z) - z0, z2 = doubles_of<half.at>(c.window_z) - z0;
        const Doubles area = x1 * y2 - x2 * y1;
        thin |= (mask_of_eight(magnitude(area) < thin_area) |
                 (mask_of_eight(area > 0.0) ^ (clockwise >> 8 * half.at & 0xff)))
                << 8 * half.at;
        const Doubles scale = 1.0 / area;
        const Doubles dx = z1 * (y2 * scale) + z2 * (-y1 * scale), dy = z1 * (-x2 * scale) + z2 * (x1 * scale);
        Doubles base = z0;
        if (work.bias != 0.0f || work.bias_slope != 0.0f) {
            const Doubles largest = larger(larger(magnitude(z0), magnitude(doubles_of<half.at>(b.window_z))),
                                           magnitude(doubles_of<half.at>(c.window_z)));
            base = base + depth_bias(work, larger(magnitude(dx), magnitude(dy)), largest);
        }
        const auto put = [&](float* to, Doubles value) {
            const Doubles bounded = magnitude(value) < steepest_slope ? value : Doubles{};
            const HalfFloats rounded = __builtin_convertvector(bounded, HalfFloats);
            std::memcpy(to + 8 * half.at, &rounded, sizeof(rounded));
        };
        put(slope_x, dx), put(slope_y, dy), put(depth, base);
    });
    work.special |= drawn & thin;
    work.drawn = drawn & ~thin;
    if (work.drawn == 0) return;

    store(work.left, shift_right_signed<tile_bits>(bounds.low_x));
    store(work.right, shift_right_signed<tile_bits>(bounds.high_x));
    store(work.top, shift_right_signed<tile_bits>(bounds.low_y));
    store(work.bottom, shift_right_signed<tile_bits>(bounds.high_y));
    const Ints bits = select(lanes_of(front), ints(Record::front_facing), ints(0)) |
                      select(keeps, ints(0), ints(Record::swapped)) | ints(static_cast<std::int32_t>(work.draw_bits));
    const Ints numbers = ints(static_cast<std::int32_t>(work.first_primitive)) + load(lane_numbers);
    // Rows of four words of a Record, in its order.
    const auto put_row = [&](int row, const Ints(&words)[4]) {
        store_rows(words, 16, [&](int lane) { return reinterpret_cast<std::byte*>(work.records + lane) + 16 * row; });
    };
    const auto word = [](const float* from) { return bits_of(load(from)); };
    put_row(0, {a.x, turned_x[1], turned_x[2], a.y});
    put_row(1, {turned_y[1], turned_y[2], a.offset, b.offset});
    put_row(2, {c.offset, numbers, bits, word(depth)});
    put_row(3, {word(slope_x), word(slope_y), bits_of(a.window_x), bits_of(a.window_y)});
    static_assert(offsetof(Record, y) == 12 && offsetof(Record, vertex) == 24 && offsetof(Record, primitive_id) == 36 &&
                  offsetof(Record, bits) == 40 && offsetof(Record, depth_c) == 44 && offsetof(Record, x0) == 56);
}

}  // namespace
}  // namespace nacre::cpu::raster
