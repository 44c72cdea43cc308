// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/simd.h"
#include "backends/cpu/raster/tile_data.h"

/// @file
/// From what the vertex function wrote to vertices on the screen. Internal linkage, as in simd.h.

namespace nacre::cpu::raster {
namespace {

/// Puts `bit` into the codes of the lanes.
NACRE_LANES_INLINE Ints code(const Lanes& lanes, std::uint32_t bit) {
    return select(lanes, ints(static_cast<std::int32_t>(bit)), ints(0));
}

inline void finish_vertices(const VertexFinish& finish) {
    const float* const position = finish.outputs + slot_position * max_lanes;
    const Floats x = load(position), y = load(position + max_lanes), z = load(position + 2 * max_lanes),
                 w = load(position + 3 * max_lanes);
    const Floats inverse_w = floats(1.0f) / w;
    const Floats window_x = fused(x * inverse_w, floats(finish.scale[0]), floats(finish.translation[0]));
    const Floats window_y = fused(y * inverse_w, floats(finish.scale[1]), floats(finish.translation[1]));
    const Floats window_z = fused(z * inverse_w, floats(finish.scale[2]), floats(finish.translation[2]));

    const Floats zero = floats(0.0f);
    Ints codes = code(less(x, zero - w), outside_left) | code(less(w, x), outside_right) |
                 code(less(y, zero - w), outside_top) | code(less(w, y), outside_bottom);
    if (!finish.depth_clamp) codes = codes | code(less(z, zero), outside_near) | code(less(w, z), outside_far);
    const Lanes inside_guard =
        less(zero, w) & less(absolute(window_x), guard_band) & less(absolute(window_y), guard_band);
    codes = codes | code(~inside_guard, outside_guard);
    const Floats limit = floats(__builtin_inff());
    const Lanes finite =
        less(absolute(x), limit) & less(absolute(y), limit) & less(absolute(z), limit) & less(absolute(w), limit);
    codes = codes | code(~finite, not_finite);
    for (std::uint32_t i = 0; i < finish.clip_distances; ++i) {
        const Floats distance = load(finish.outputs + (slot_clip_distance + i) * max_lanes);
        codes = codes | code(~less_or_equal(zero, distance), first_clip_distance << i);
    }
    for (std::uint32_t i = 0; i < finish.cull_distances; ++i) {
        const Floats distance = load(finish.outputs + (slot_clip_distance + finish.clip_distances + i) * max_lanes);
        codes = codes | code(~less_or_equal(zero, distance), first_cull_distance << i);
    }

    const Floats scale = floats(static_cast<float>(subpixels));
    alignas(64) std::int32_t fixed_x[16], fixed_y[16], code_of[16];
    store(fixed_x, round_to_ints(select(inside_guard, window_x, zero) * scale));
    store(fixed_y, round_to_ints(select(inside_guard, window_y, zero) * scale));
    store(code_of, codes);

    alignas(64) float window[4][16];
    store(window[0], window_x), store(window[1], window_y), store(window[2], window_z), store(window[3], inverse_w);
    const auto write_rows = [&](const float* a, const float* b, const float* c, const float* d, std::size_t offset) {
        for (std::uint32_t lane = 0; lane < finish.count; lane += 4) {
            Float4 rows[4] = {load4(a + lane), load4(b + lane), load4(c + lane), load4(d + lane)};
            transpose(rows[0], rows[1], rows[2], rows[3]);
            std::byte* const to = finish.vertices + static_cast<std::size_t>(lane) * finish.vertex_bytes + offset;
            const std::uint32_t left = finish.count - lane;
            for (std::uint32_t i = 0; i < 4 && i < left; ++i)
                std::memcpy(to + static_cast<std::size_t>(i) * finish.vertex_bytes, &rows[i], sizeof(Float4));
        }
    };
    write_rows(window[0], window[1], window[2], window[3], 0);
    write_rows(position, position + max_lanes, position + 2 * max_lanes, position + 3 * max_lanes, 16);
    for (std::uint32_t row = 0; row < finish.row_count; row += 4)
        write_rows(finish.rows[row], finish.rows[row + 1], finish.rows[row + 2], finish.rows[row + 3], 32 + row * 4);

    for (std::uint32_t lane = 0; lane < finish.count; ++lane)
        finish.setup[lane] = {fixed_x[lane], fixed_y[lane], static_cast<std::uint32_t>(code_of[lane]),
                              finish.first_offset + lane * (finish.vertex_bytes / 16)};
}

}  // namespace
}  // namespace nacre::cpu::raster
