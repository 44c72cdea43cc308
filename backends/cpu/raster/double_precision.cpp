// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/raster/double_precision.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "backends/cpu/images/double_texels.h"
#include "backends/cpu/raster/planes.h"

namespace nacre::cpu::raster {
namespace {

constexpr std::uint32_t padded(std::uint32_t inputs) { return (inputs + 3) / 4 * 4; }

/// A vertex on the screen.
struct Corner {
    const double* clip;
    const double* inputs;
    double x, y, z, inverse_w;
};

Corner corner_of(const DrawPlan& draw, const std::byte* vertex_memory, std::uint32_t offset) {
    const auto& vertex = *reinterpret_cast<const ScreenVertex*>(vertex_memory + std::size_t{offset} * 16);
    const double* const doubles = vertex_doubles(vertex, padded(draw.input_count));
    const double inverse_w = 1.0 / doubles[3];
    return {doubles,
            doubles + 4,
            doubles[0] * inverse_w * draw.scale[0] + draw.translation[0],
            doubles[1] * inverse_w * draw.scale[1] + draw.translation[1],
            doubles[2] * inverse_w * draw.scale[2] + draw.translation[2],
            inverse_w};
}

/// Planes by differences to the first vertex.
void planes_by_slopes(const DrawPlan& draw, const Corner (&corners)[3], const Corner& provoking,
                      const SlopeWeights& weights, DoublePrimitive& made) {
    const auto plane = [&](double f0, double f1, double f2) -> DoublePlane {
        return {f0, (f1 - f0) * weights.first_x + (f2 - f0) * weights.second_x,
                (f1 - f0) * weights.first_y + (f2 - f0) * weights.second_y};
    };
    made.planes[0] = plane(corners[0].z, corners[1].z, corners[2].z);
    made.planes[1] = plane(corners[0].inverse_w, corners[1].inverse_w, corners[2].inverse_w);
    for (std::uint32_t input = 0; input < draw.input_count; ++input) {
        const auto value = [&](const Corner& corner) {
            return corner.inputs[input] * (draw.linear_masks[input] != 0 ? 1.0 : corner.inverse_w);
        };
        made.varyings()[input] = draw.flat_masks[input] != 0
                                     ? DoublePlane{provoking.inputs[input], 0.0, 0.0}
                                     : plane(value(corners[0]), value(corners[1]), value(corners[2]));
    }
}

/// Planes of a triangle from its clip coordinates, wherever its vertices are.
void planes_by_weights(const DrawPlan& draw, const Corner (&corners)[3], const PrimitiveData& primitive,
                       DoublePrimitive& made) {
    // Relative to the reference, near which nothing cancels.
    ScreenPoint points[3];
    for (int i = 0; i < 3; ++i) {
        const double* const clip = corners[i].clip;
        points[i] = {clip[0] * draw.scale[0] + clip[3] * (draw.translation[0] - made.x0),
                     clip[1] * draw.scale[1] + clip[3] * (draw.translation[1] - made.y0), clip[3]};
    }
    const HomogeneousWeights weights = homogeneous_weights(points);
    const bool in_front = points[0].w > 0.0 && points[1].w > 0.0 && points[2].w > 0.0;
    const auto plane = [&](const double(&values)[3]) {
        DoublePlane sum{};
        for (int i = 0; i < 3; ++i)
            sum.c += values[i] * weights.c[i], sum.dx += values[i] * weights.x[i], sum.dy += values[i] * weights.y[i];
        return sum;
    };
    const auto widened = [](const Plane& plane_of) { return DoublePlane{plane_of.c, plane_of.dx, plane_of.dy}; };
    DoublePlane depth = plane({corners[0].clip[2], corners[1].clip[2], corners[2].clip[2]});
    depth = {depth.c * draw.scale[2] + draw.translation[2], depth.dx * draw.scale[2], depth.dy * draw.scale[2]};
    made.planes[0] = depth;
    made.planes[1] = plane({1.0, 1.0, 1.0});
    for (std::uint32_t input = 0; input < draw.input_count; ++input) {
        DoublePlane& varying = made.varyings()[input];
        const bool is_linear = draw.linear_masks[input] != 0;
        if (draw.flat_masks[input] != 0) {
            varying = {corners[0].inputs[input], 0.0, 0.0};
        } else if (is_linear && !in_front) {
            varying = widened(primitive.varyings()[input]);
        } else {
            double values[3];
            for (int i = 0; i < 3; ++i) values[i] = corners[i].inputs[input] * (is_linear ? points[i].w : 1.0);
            varying = plane(values);
        }
    }
}

using rhi::BlendFactor;
using rhi::BlendOperation;

struct BlendInputs {
    DoubleTexel source, source1, destination, constant;
};

double blend_factor(BlendFactor factor, const BlendInputs& inputs, std::size_t channel) {
    using enum BlendFactor;
    switch (factor) {
        case zero: return 0.0;
        case one: return 1.0;
        case source_color: return inputs.source[channel];
        case one_minus_source_color: return 1.0 - inputs.source[channel];
        case source_alpha: return inputs.source[3];
        case one_minus_source_alpha: return 1.0 - inputs.source[3];
        case destination_color: return inputs.destination[channel];
        case one_minus_destination_color: return 1.0 - inputs.destination[channel];
        case destination_alpha: return inputs.destination[3];
        case one_minus_destination_alpha: return 1.0 - inputs.destination[3];
        case constant_color: return inputs.constant[channel];
        case one_minus_constant_color: return 1.0 - inputs.constant[channel];
        case source_alpha_saturated:
            return channel == 3 ? 1.0 : std::min(inputs.source[3], 1.0 - inputs.destination[3]);
        case source1_color: return inputs.source1[channel];
        case one_minus_source1_color: return 1.0 - inputs.source1[channel];
        case source1_alpha: return inputs.source1[3];
        default: return 1.0 - inputs.source1[3];
    }
}

double blend_channel(BlendOperation operation, BlendFactor source_factor, BlendFactor destination_factor,
                     const BlendInputs& inputs, std::size_t channel) {
    const double source = inputs.source[channel], destination = inputs.destination[channel];
    if (operation == BlendOperation::minimum) return std::min(source, destination);
    if (operation == BlendOperation::maximum) return std::max(source, destination);
    // A factor of zero leaves nothing behind, even of an infinity.
    const double from_source =
        source_factor == BlendFactor::zero ? 0.0 : source * blend_factor(source_factor, inputs, channel);
    const double from_destination =
        destination_factor == BlendFactor::zero ? 0.0 : destination * blend_factor(destination_factor, inputs, channel);
    switch (operation) {
        case BlendOperation::subtract: return from_source - from_destination;
        case BlendOperation::reverse_subtract: return from_destination - from_source;
        default: return from_source + from_destination;
    }
}

double in_target_range(rhi::FormatKind kind, double value) {
    if (kind == rhi::FormatKind::unorm || kind == rhi::FormatKind::srgb)
        return value > 0.0 ? std::min(value, 1.0) : 0.0;
    if (kind == rhi::FormatKind::snorm) return value == value ? std::clamp(value, -1.0, 1.0) : 0.0;
    return value;
}

}  // namespace

void set_up_double_primitive(const DrawPlan& draw, DepthLayout layout, const Record& record,
                             const std::byte* vertex_memory, PrimitiveData& primitive) {
    DoublePrimitive& made = double_primitive(primitive, draw);
    made.x0 = record.x0, made.y0 = record.y0;
    made.point_x = made.point_y = made.inverse_point_size = 0.0;
    const PlaneSource source = record.source();
    const bool is_triangle =
        source == PlaneSource::window || source == PlaneSource::homogeneous || source == PlaneSource::snapped;
    Corner corners[3];
    corners[0] = corners[1] = corners[2] = corner_of(draw, vertex_memory, record.vertex[0]);
    if (source != PlaneSource::point) corners[1] = corners[2] = corner_of(draw, vertex_memory, record.vertex[1]);
    if (is_triangle) corners[2] = corner_of(draw, vertex_memory, record.vertex[2]);
    switch (source) {
        case PlaneSource::window:
        case PlaneSource::homogeneous: planes_by_weights(draw, corners, primitive, made); break;
        case PlaneSource::snapped: {
            const int second = record.bits & Record::swapped ? 2 : 1, third = 3 - second;
            constexpr double unit = 1.0 / subpixels;
            planes_by_slopes(
                draw, corners, corners[0],
                triangle_weights((record.x[second] - record.x[0]) * unit, (record.y[second] - record.y[0]) * unit,
                                 (record.x[third] - record.x[0]) * unit, (record.y[third] - record.y[0]) * unit),
                made);
            break;
        }
        case PlaneSource::line:
            made.x0 = corners[0].x, made.y0 = corners[0].y;
            planes_by_slopes(draw, corners, corner_of(draw, vertex_memory, record.vertex[2]),
                             line_weights(corners[1].x - corners[0].x, corners[1].y - corners[0].y), made);
            break;
        case PlaneSource::point: {
            made.x0 = corners[0].x, made.y0 = corners[0].y;
            planes_by_slopes(draw, corners, corners[0], SlopeWeights{}, made);
            float size;
            std::memcpy(&size, &record.vertex[1], sizeof(size));
            made.point_x = corners[0].x - 0.5 * size, made.point_y = corners[0].y - 0.5 * size;
            made.inverse_point_size = 1.0 / size;
            break;
        }
    }
    if (!is_triangle) return;
    double largest = 0.0;
    for (const Corner& corner : corners)
        if (corner.clip[3] > 0.0) largest = std::max(largest, std::abs(corner.z));
    if (source == PlaneSource::homogeneous && largest == 0.0) largest = 1.0;
    made.planes[0].c += depth_bias(layout, draw.depth_bias, draw.depth_bias_slope, draw.depth_bias_clamp,
                                   std::max(std::abs(made.planes[0].dx), std::abs(made.planes[0].dy)), largest);
}

double depth_at(const DoublePrimitive& primitive, double x, double y) {
    return primitive.planes[0].c + primitive.planes[0].dx * (x - primitive.x0) +
           primitive.planes[0].dy * (y - primitive.y0);
}

void store_depth(const TargetSet& targets, std::uint32_t sample, std::int32_t x, std::int32_t y, double depth) {
    if (!targets.depth_shadow) return;
    const std::uint32_t texel_bytes = targets.depth_layout == DepthLayout::unorm16 ? 2 : 4;
    const std::uint64_t texel = (sample * targets.depth_sample_stride +
                                 std::uint64_t{targets.depth_row_stride} * static_cast<std::uint32_t>(y)) /
                                    texel_bytes +
                                static_cast<std::uint32_t>(x);
    targets.depth_shadow[texel * 4] = depth;
}

void write_double_colors(const DrawPlan& draw, const ColorPlan& plan, const ColorTarget& target,
                         const FragmentBatch& batch, std::uint32_t sample, std::uint32_t mask) {
    const rhi::FormatKind kind = rhi::info(target.format).kind;
    for (std::uint32_t rest = mask; rest != 0; rest &= rest - 1) {
        const auto lane = static_cast<std::uint32_t>(__builtin_ctz(rest));
        const auto x = static_cast<std::uint32_t>(batch.x[lane / 4]) + (lane & 1),
                   y = static_cast<std::uint32_t>(batch.y[lane / 4]) + (lane >> 1 & 1);
        const std::uint64_t offset = sample * target.sample_stride + std::uint64_t{y} * target.row_stride +
                                     std::uint64_t{x} * target.texel_bytes;
        std::byte* const texel = target.data + offset;
        double* const shadow = target.shadow + offset / target.texel_bytes * 4;
        const auto color_of = [&](std::uint32_t output, std::uint32_t components) {
            DoubleTexel color{0.0, 0.0, 0.0, 1.0};
            for (std::uint32_t c = 0; c < components; ++c) color[c] = batch.doubles->colors[output][c][lane];
            return color;
        };
        const DoubleTexel destination = load_double(target.format, texel, shadow);
        DoubleTexel color = color_of(plan.output, plan.components);
        if (plan.blends) {
            BlendInputs inputs{color, draw.dual_source ? color_of(dual_source_output, 4) : color, destination, {}};
            for (std::size_t c = 0; c < 4; ++c) {
                inputs.source[c] = in_target_range(kind, inputs.source[c]);
                inputs.source1[c] = in_target_range(kind, inputs.source1[c]);
                inputs.constant[c] = in_target_range(kind, draw.blend_constants[c]);
            }
            const rhi::BlendState& blend = plan.blend;
            for (std::size_t c = 0; c < 3; ++c)
                color[c] = blend_channel(blend.color_operation, blend.source_color, blend.destination_color, inputs, c);
            color[3] = blend_channel(blend.alpha_operation, blend.source_alpha, blend.destination_alpha, inputs, 3);
        }
        for (std::size_t c = 0; c < 4; ++c)
            if ((plan.write_mask >> c & 1) == 0) color[c] = destination[c];
        store_double(target.format, color, texel, shadow);
    }
}

}  // namespace nacre::cpu::raster
