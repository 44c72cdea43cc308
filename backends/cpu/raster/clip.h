// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

/// @file
/// Clipping of triangles and lines, in double precision. Corners are kept as weights of the original vertices, so that
/// two triangles with a common edge cut it at the same place.

namespace nacre::cpu::raster {

inline constexpr int most_clip_planes = 14;  ///< 4 of the guard band, near, far, 8 of the user.
inline constexpr int most_corners = 3 + most_clip_planes;

/// Values at the three vertices; inside is where they are not negative.
struct ClipPlane {
    std::array<double, 3> values;
};

struct ClipCorner {
    std::array<double, 3> weights;
    int original;  ///< Vertex that it is, or -1.
};
struct ClipPolygon {
    std::array<ClipCorner, most_corners> corners;
    int count = 0;
};

/// What of the triangle lies inside of all planes; `count` is 0 or at least 3.
ClipPolygon clip_triangle(const ClipPlane* planes, int plane_count);

/// What of the line from vertex 0 to vertex 1 lies inside, as parts of its length.
struct ClipRange {
    double begin = 0.0, end = 1.0;
    [[nodiscard]] bool empty() const { return !(begin < end); }
};
ClipRange clip_line(const ClipPlane* planes, int plane_count);

}  // namespace nacre::cpu::raster
