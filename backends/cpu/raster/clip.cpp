// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/raster/clip.h"

#include <algorithm>

namespace nacre::cpu::raster {

ClipPolygon clip_triangle(const ClipPlane* planes, int plane_count) {
    ClipPolygon polygon;
    polygon.count = 3;
    for (int i = 0; i < 3; ++i) {
        polygon.corners[i] = {{0.0, 0.0, 0.0}, i};
        polygon.corners[i].weights[i] = 1.0;
    }
    // Sutherland and Hodgman, one plane after another; a convex polygon gains at most one corner from each.
    for (int plane = 0; plane < plane_count; ++plane) {
        const auto value = [&](const ClipCorner& corner) {
            const std::array<double, 3>& values = planes[plane].values;
            if (corner.original >= 0) return values[corner.original];
            double sum = 0.0;
            for (int i = 0; i < 3; ++i)
                if (corner.weights[i] != 0.0) sum += corner.weights[i] * values[i];
            return sum;
        };
        ClipPolygon kept;
        for (int i = 0; i < polygon.count; ++i) {
            const ClipCorner& from = polygon.corners[i];
            const ClipCorner& to = polygon.corners[(i + 1) % polygon.count];
            const double from_value = value(from), to_value = value(to);
            const bool from_inside = from_value >= 0.0, to_inside = to_value >= 0.0;
            if (from_inside && kept.count < most_corners) kept.corners[kept.count++] = from;
            if (from_inside == to_inside || kept.count >= most_corners) continue;
            // Always from the inside outwards: both neighbors of the edge compute the same.
            const ClipCorner& inside = from_inside ? from : to;
            const ClipCorner& outside = from_inside ? to : from;
            const double inside_value = from_inside ? from_value : to_value;
            const double outside_value = from_inside ? to_value : from_value;
            const double t = inside_value / (inside_value - outside_value);
            ClipCorner cut{{}, -1};
            for (int j = 0; j < 3; ++j) cut.weights[j] = inside.weights[j] * (1.0 - t) + outside.weights[j] * t;
            kept.corners[kept.count++] = cut;
        }
        polygon = kept;
        if (polygon.count < 3) return {};
    }
    return polygon;
}

ClipRange clip_line(const ClipPlane* planes, int plane_count) {
    ClipRange range;
    for (int plane = 0; plane < plane_count; ++plane) {
        const double a = planes[plane].values[0], b = planes[plane].values[1];
        if (a < 0.0 && b < 0.0) return {1.0, 0.0};
        if (a < 0.0) range.begin = std::max(range.begin, a / (a - b));
        if (b < 0.0) range.end = std::min(range.end, a / (a - b));
    }
    return range;
}

}  // namespace nacre::cpu::raster
