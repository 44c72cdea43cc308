// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/tile_data.h"

/// @file
/// How values at vertices become planes over the screen. Internal linkage, as in simd.h. In double precision where it
/// is done once for a primitive; every caller gets the same bits.

namespace nacre::cpu::raster {
namespace {

/// A value with f[0] to f[2] at the vertices has the slopes (f1 - f0) * first_x + (f2 - f0) * second_x along x, and so
/// on.
struct SlopeWeights {
    double first_x, second_x, first_y, second_y;
};

inline SlopeWeights triangle_weights(double x1, double y1, double x2, double y2) {
    const double area = x1 * y2 - x2 * y1;
    const double scale = area != 0.0 ? 1.0 / area : 0.0;
    return {y2 * scale, -y1 * scale, -x2 * scale, x1 * scale};
}
/// Along the line only.
inline SlopeWeights line_weights(double x, double y) {
    const double square = x * x + y * y;
    const double scale = square != 0.0 ? 1.0 / square : 0.0;
    return {x * scale, 0.0, y * scale, 0.0};
}

/// Homogeneous coordinates of a vertex on the screen: (x, y) are window coordinates times w.
struct ScreenPoint {
    double x, y, w;
};
inline ScreenPoint screen_point(const float* clip, const double* scale, const double* translation) {
    const double w = clip[3];
    return {clip[0] * scale[0] + w * translation[0], clip[1] * scale[1] + w * translation[1], w};
}

/// value / w = sum over vertices of value_i * (x[i] * X + y[i] * Y + c[i]) at window coordinates (X, Y): valid for
/// vertices behind the eye too. Source: Olano and Greer 1997, "Triangle scan conversion using 2D homogeneous
/// coordinates".
struct HomogeneousWeights {
    double x[3], y[3], c[3];
    bool valid;
    [[nodiscard]] double at(int vertex, double window_x, double window_y) const {
        return x[vertex] * window_x + y[vertex] * window_y + c[vertex];
    }
};
inline HomogeneousWeights homogeneous_weights(const ScreenPoint (&points)[3]) {
    HomogeneousWeights weights{};
    const auto cross = [&](int i, const ScreenPoint& a, const ScreenPoint& b) {
        weights.x[i] = a.y * b.w - a.w * b.y;
        weights.y[i] = a.w * b.x - a.x * b.w;
        weights.c[i] = a.x * b.y - a.y * b.x;
    };
    cross(0, points[1], points[2]), cross(1, points[2], points[0]), cross(2, points[0], points[1]);
    const double determinant = points[0].x * weights.x[0] + points[0].y * weights.y[0] + points[0].w * weights.c[0];
    const double scale = 1.0 / determinant;
    for (int i = 0; i < 3; ++i) weights.x[i] *= scale, weights.y[i] *= scale, weights.c[i] *= scale;
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) sum += weights.x[i] + weights.y[i] + weights.c[i];
    weights.valid = determinant != 0.0 && sum - sum == 0.0;
    return weights;
}

}  // namespace
}  // namespace nacre::cpu::raster
