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
    const Ints fixed_x = round_to_ints(select(inside_guard, window_x, zero) * scale);
    const Ints fixed_y = round_to_ints(select(inside_guard, window_y, zero) * scale);

    const auto write_row = [&](const Floats& one, const Floats& other, const Floats& third, const Floats& last,
                               std::size_t offset) {
        store_rows({bits_of(one), bits_of(other), bits_of(third), bits_of(last)}, finish.count, [&](int lane) {
            return finish.vertices + static_cast<std::size_t>(lane) * finish.vertex_bytes + offset;
        });
    };
    write_row(window_x, window_y, window_z, inverse_w, 0);
    write_row(x, y, z, w, 16);
    for (std::uint32_t row = 0; row < finish.row_count; row += 4)
        write_row(load(finish.rows[row]), load(finish.rows[row + 1]), load(finish.rows[row + 2]),
                  load(finish.rows[row + 3]), 32 + row * 4);

    const Ints offsets = ints(static_cast<std::int32_t>(finish.first_offset)) +
                         load(lane_numbers) * ints(static_cast<std::int32_t>(finish.vertex_bytes / 16));
    store_rows({fixed_x, fixed_y, codes, offsets}, finish.count, [&](int lane) { return finish.setup + lane; });
}

}  // namespace
}  // namespace nacre::cpu::raster
