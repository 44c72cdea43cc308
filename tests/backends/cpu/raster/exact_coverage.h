// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <utility>

/// @file
/// Coverage by edge functions in 64-bit integers, for tests.

namespace nacre::test {

struct Point {
    std::int64_t x, y;  ///< 1/256 of a pixel.
};

/// The rule of the specification, word by word: a sample inside, or on an edge that is a left or a top one.
inline bool covers(Point a, Point b, Point c, Point sample) {
    std::int64_t area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    if (area == 0) return false;
    if (area < 0) std::swap(b, c);
    const Point corners[3] = {a, b, c};
    for (int i = 0; i < 3; ++i) {
        const Point from = corners[i], to = corners[(i + 1) % 3];
        const std::int64_t side = (to.x - from.x) * (sample.y - from.y) - (to.y - from.y) * (sample.x - from.x);
        const bool is_left = to.y < from.y, is_top = to.y == from.y && to.x > from.x;
        if (side < 0 || (side == 0 && !is_left && !is_top)) return false;
    }
    return true;
}

/// Where samples lie in a pixel (Vulkan specification, "Standard sample locations").
inline constexpr std::int64_t sample_x[4] = {96, 224, 32, 160}, sample_y[4] = {32, 96, 160, 224};

}  // namespace nacre::test
