// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/planes.h"
#include "backends/cpu/raster/simd.h"
#include "backends/cpu/raster/tile_data.h"

/// @file
/// PrimitiveData of a record: done in the tiles, and only for primitives of which something is visible. Internal
/// linkage, as in simd.h.

namespace nacre::cpu::raster {
namespace {

NACRE_LANES_INLINE Float4 select4(Int4 mask, Float4 a, Float4 b) {
    return (Float4)(((Int4)a & mask) | ((Int4)b & ~mask));
}

NACRE_LANES_INLINE void store_planes(Plane* planes, Float4 c, Float4 dx, Float4 dy, Int4 flat, Float4 provoking) {
    c = select4(flat, provoking, c);
    dx = (Float4)((Int4)dx & ~flat);
    dy = (Float4)((Int4)dy & ~flat);
    Float4 rest{};
    transpose(c, dx, dy, rest);
    store4(&planes[0].c, c), store4(&planes[1].c, dx), store4(&planes[2].c, dy), store4(&planes[3].c, rest);
}

/// The slopes of values at three vertices, as factors of value 0 - value 1 and value 2 - value 0: in single precision
/// and in the order of operations of Mesa's software drivers, whose interpolated values come out bit for bit.
struct WindowSlopes {
    float dx01, dy01, dx20, dy20;  ///< Differences of window coordinates over twice the area.
    float x0, y0;                  ///< Of vertex 0, from the center of pixel (0, 0).
    bool precise;                  ///< False for slivers: their area has lost too many digits.

    WindowSlopes(const ScreenVertex& v0, const ScreenVertex& v1, const ScreenVertex& v2)
        : dx01(v0.x - v1.x), dy01(v0.y - v1.y), dx20(v2.x - v0.x), dy20(v2.y - v0.y), x0(v0.x - 0.5f), y0(v0.y - 0.5f) {
        const float area = dx01 * dy20 - dx20 * dy01;
        precise = std::abs(area) > 0.03125f * (std::abs(dx01 * dy20) + std::abs(dx20 * dy01));
        const float scale = 1.0f / area;
        dx01 *= scale, dy01 *= scale, dx20 *= scale, dy20 *= scale;
    }
    /// T is float or Float4.
    template <typename T>
    NACRE_LANES_INLINE void plane(T value0, T value1, T value2, T& c, T& dx, T& dy) const {
        const T difference01 = value0 - value1, difference20 = value2 - value0;
        dx = difference01 * dy20 - difference20 * dy01;
        dy = difference20 * dx01 - difference01 * dx20;
        c = value0 - (dx * x0 + dy * y0);
    }
};

inline void window_planes(const DrawPlan& draw, const WindowSlopes& slopes, const ScreenVertex* const (&vertices)[3],
                          PrimitiveData& primitive) {
    primitive.origin_x = primitive.origin_y = 0.5f;
    primitive.inverse_w.reserved = 0.0f;
    slopes.plane(vertices[0]->inverse_w, vertices[1]->inverse_w, vertices[2]->inverse_w, primitive.inverse_w.c,
                 primitive.inverse_w.dx, primitive.inverse_w.dy);
    const Float4 one = 1.0f - Float4{};
    Plane* planes = primitive.varyings();
    for (std::uint32_t input = 0; input < draw.input_count; input += 4, planes += 4) {
        Int4 linear, flat;
        std::memcpy(&linear, draw.linear_masks + input, sizeof(linear));
        std::memcpy(&flat, draw.flat_masks + input, sizeof(flat));
        const auto value = [&](int i) {
            return load4(vertices[i]->inputs() + input) * select4(linear, one, vertices[i]->inverse_w - Float4{});
        };
        Float4 c, dx, dy;
        slopes.plane(value(0), value(1), value(2), c, dx, dy);
        store_planes(planes, c, dx, dy, flat, load4(vertices[0]->inputs() + input));
    }
}

inline void homogeneous_planes(const DrawPlan& draw, const Record& record, const ScreenVertex* const (&vertices)[3],
                               PrimitiveData& primitive) {
    const ScreenPoint points[3] = {screen_point(vertices[0]->clip, draw.scale, draw.translation),
                                   screen_point(vertices[1]->clip, draw.scale, draw.translation),
                                   screen_point(vertices[2]->clip, draw.scale, draw.translation)};
    const HomogeneousWeights weights = homogeneous_weights(points);
    double base[3];
    for (int i = 0; i < 3; ++i) base[i] = weights.at(i, record.x0, record.y0);
    primitive.inverse_w = {static_cast<float>(base[0] + base[1] + base[2]),
                           static_cast<float>(weights.x[0] + weights.x[1] + weights.x[2]),
                           static_cast<float>(weights.y[0] + weights.y[1] + weights.y[2]), 0.0f};
    Plane* const planes = primitive.varyings();
    const bool in_front = points[0].w > 0.0 && points[1].w > 0.0 && points[2].w > 0.0;
    for (std::uint32_t input = 0; input < draw.input_count; ++input) {
        if (draw.flat_masks[input] != 0) {
            planes[input] = {vertices[0]->inputs()[input], 0.0f, 0.0f, 0.0f};
            continue;
        }
        double values[3];
        for (int i = 0; i < 3; ++i) values[i] = vertices[i]->inputs()[input];
        if (draw.linear_masks[input] != 0 && in_front)
            for (int i = 0; i < 3; ++i) values[i] *= points[i].w;
        double c = 0.0, dx = 0.0, dy = 0.0;
        for (int i = 0; i < 3; ++i)
            c += values[i] * base[i], dx += values[i] * weights.x[i], dy += values[i] * weights.y[i];
        if (draw.linear_masks[input] != 0 && !in_front) {
            // What is linear on the screen has no meaning behind the eye: it is made linear between the corners of what
            // is left after clipping.
            double corners[3], x[3], y[3];
            for (int j = 0; j < 3; ++j) {
                x[j] = record.x[j] * (1.0 / subpixels), y[j] = record.y[j] * (1.0 / subpixels);
                double numerator = 0.0, denominator = 0.0;
                for (int i = 0; i < 3; ++i)
                    numerator += values[i] * weights.at(i, x[j], y[j]), denominator += weights.at(i, x[j], y[j]);
                corners[j] = denominator != 0.0 ? numerator / denominator : 0.0;
            }
            const SlopeWeights slopes = triangle_weights(x[1] - x[0], y[1] - y[0], x[2] - x[0], y[2] - y[0]);
            dx = (corners[1] - corners[0]) * slopes.first_x + (corners[2] - corners[0]) * slopes.second_x;
            dy = (corners[1] - corners[0]) * slopes.first_y + (corners[2] - corners[0]) * slopes.second_y;
            c = corners[0] + dx * (record.x0 - x[0]) + dy * (record.y0 - y[0]);
        }
        planes[input] = {static_cast<float>(c), static_cast<float>(dx), static_cast<float>(dy), 0.0f};
    }
}

inline void set_up_primitive(const DrawPlan& draw, const Record& record, const std::byte* vertex_memory,
                             PrimitiveData& primitive) {
    const auto vertex = [&](int i) {
        return reinterpret_cast<const ScreenVertex*>(vertex_memory + static_cast<std::size_t>(record.vertex[i]) * 16);
    };
    primitive.x0 = record.x0, primitive.y0 = record.y0;
    primitive.primitive_id = record.primitive_id;
    primitive.front_facing = record.bits & Record::front_facing;
    primitive.origin_x = record.x0, primitive.origin_y = record.y0;
    primitive.inverse_point_size = 0.0f;
    primitive.layer = 0;
    primitive.depth = {record.depth_c, record.depth_dx, record.depth_dy, 0.0f};

    const ScreenVertex* vertices[3] = {vertex(0), vertex(0), vertex(0)};
    const ScreenVertex* provoking = vertices[0];
    SlopeWeights weights{};
    switch (record.source()) {
        case PlaneSource::homogeneous:
            vertices[1] = vertex(1), vertices[2] = vertex(2);
            homogeneous_planes(draw, record, vertices, primitive);
            return;
        case PlaneSource::window:
            vertices[1] = vertex(1), vertices[2] = vertex(2);
            if (const WindowSlopes slopes(*vertices[0], *vertices[1], *vertices[2]); slopes.precise)
                return window_planes(draw, slopes, vertices, primitive);
            weights = triangle_weights(static_cast<double>(vertices[1]->x) - vertices[0]->x,
                                       static_cast<double>(vertices[1]->y) - vertices[0]->y,
                                       static_cast<double>(vertices[2]->x) - vertices[0]->x,
                                       static_cast<double>(vertices[2]->y) - vertices[0]->y);
            break;
        case PlaneSource::snapped: {
            vertices[1] = vertex(1), vertices[2] = vertex(2);
            const int second = record.bits & Record::swapped ? 2 : 1, third = 3 - second;
            weights = triangle_weights((record.x[second] - record.x[0]) * (1.0 / subpixels),
                                       (record.y[second] - record.y[0]) * (1.0 / subpixels),
                                       (record.x[third] - record.x[0]) * (1.0 / subpixels),
                                       (record.y[third] - record.y[0]) * (1.0 / subpixels));
            break;
        }
        case PlaneSource::line:
            vertices[1] = vertices[2] = vertex(1);
            provoking = vertex(2);
            weights = line_weights(static_cast<double>(vertices[1]->x) - vertices[0]->x,
                                   static_cast<double>(vertices[1]->y) - vertices[0]->y);
            break;
        case PlaneSource::point: {
            float size;
            std::memcpy(&size, &record.vertex[1], sizeof(size));
            primitive.origin_x = vertices[0]->x - 0.5f * size;
            primitive.origin_y = vertices[0]->y - 0.5f * size;
            primitive.inverse_point_size = 1.0f / size;
            break;
        }
    }

    const double w0 = vertices[0]->inverse_w;
    const double dw1 = vertices[1]->inverse_w - w0, dw2 = vertices[2]->inverse_w - w0;
    primitive.inverse_w = {vertices[0]->inverse_w, static_cast<float>(dw1 * weights.first_x + dw2 * weights.second_x),
                           static_cast<float>(dw1 * weights.first_y + dw2 * weights.second_y), 0.0f};

    const Float4 first_x = static_cast<float>(weights.first_x) - Float4{};
    const Float4 second_x = static_cast<float>(weights.second_x) - Float4{};
    const Float4 first_y = static_cast<float>(weights.first_y) - Float4{};
    const Float4 second_y = static_cast<float>(weights.second_y) - Float4{};
    const Float4 one = 1.0f - Float4{};
    Plane* planes = primitive.varyings();
    for (std::uint32_t input = 0; input < draw.input_count; input += 4, planes += 4) {
        Int4 linear, flat;
        std::memcpy(&linear, draw.linear_masks + input, sizeof(linear));
        std::memcpy(&flat, draw.flat_masks + input, sizeof(flat));
        const Float4 value0 =
            load4(vertices[0]->inputs() + input) * select4(linear, one, vertices[0]->inverse_w - Float4{});
        const Float4 value1 =
            load4(vertices[1]->inputs() + input) * select4(linear, one, vertices[1]->inverse_w - Float4{});
        const Float4 value2 =
            load4(vertices[2]->inputs() + input) * select4(linear, one, vertices[2]->inverse_w - Float4{});
        const Float4 difference1 = value1 - value0, difference2 = value2 - value0;
        store_planes(planes, value0, difference1 * first_x + difference2 * second_x,
                     difference1 * first_y + difference2 * second_y, flat, load4(provoking->inputs() + input));
    }
}

}  // namespace
}  // namespace nacre::cpu::raster
