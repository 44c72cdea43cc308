// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/raster/chunk.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "backends/cpu/raster/clip.h"
#include "backends/cpu/raster/planes.h"
#include "backends/cpu/raster/vertex_stage.h"

namespace nacre::cpu::raster {
namespace {

struct DepthPlane {
    double c = 0.0, dx = 0.0, dy = 0.0;
};

/// Tiles, inclusive.
struct TileBox {
    std::int32_t left, right, top, bottom;
};

/// What depth bias counts in depths of fixed point; 0 for floats, where it depends on the depth.
double fixed_unit(DepthLayout layout) {
    switch (layout) {
        case DepthLayout::unorm16: return 0x1p-16;
        case DepthLayout::unorm24: return 0x1p-24;
        default: return 0.0;
    }
}

/// Makes records of the primitives of one segment.
class Assembler {
  public:
    Assembler(Chunk& chunk, const QueuedDraw& draw, std::uint32_t draw_index, const TargetSet& targets,
              ChunkScratch& scratch)
        : chunk_(chunk),
          draw_(draw),
          pipeline_(*draw.pipeline),
          targets_(targets),
          scratch_(scratch),
          draw_bits_(draw_index << Record::draw_shift) {}

    /// All triangles of the segment.
    void triangles(const Segment& segment, const Kernels& kernels);
    void line(std::uint32_t local0, std::uint32_t local1, std::uint32_t provoking, std::uint32_t primitive_id,
              bool front, bool is_edge);
    void point(std::uint32_t local, std::uint32_t primitive_id);

  private:
    struct Corners {
        std::int32_t x[3], y[3];
    };
    struct Source {
        PlaneSource kind;
        std::uint32_t vertices[3];
        DepthPlane depth;
        float x0, y0;
        std::uint32_t primitive_id;
    };

    void triangle(std::uint32_t local0, std::uint32_t local1, std::uint32_t local2, std::uint32_t primitive_id);
    const ScreenVertex& vertex(std::uint32_t offset) const {
        return *reinterpret_cast<const ScreenVertex*>(chunk_.vertices.data() + static_cast<std::size_t>(offset) * 16);
    }
    bool culled(bool front) const { return pipeline_.cull == (front ? rhi::CullMode::front : rhi::CullMode::back); }
    bool faces_front(bool clockwise) const { return clockwise == (pipeline_.front_face == rhi::FrontFace::clockwise); }
    double bias(double slope, double largest_depth) const;
    Source window_source(const SetupVertex& v0, const SetupVertex& v1, const SetupVertex& v2, const Corners& snapped,
                         bool clockwise, std::uint32_t primitive_id) const;
    bool homogeneous_source(const SetupVertex (&vertices)[3], std::uint32_t primitive_id, Source& source) const;
    void clipped_triangle(const std::uint32_t (&locals)[3], std::uint32_t codes, std::uint32_t primitive_id);
    void outline(std::uint32_t local0, std::uint32_t local1, std::uint32_t local2, std::uint32_t primitive_id,
                 bool front);
    int gather_planes(const std::uint32_t* locals, int count, std::uint32_t codes, ClipPlane* planes) const;
    std::uint32_t vertex_between(const SetupVertex& a, const SetupVertex& b, double t);
    void add(const Corners& corners, const Source& source, std::uint32_t bits);
    [[nodiscard]] std::uint32_t tile_at(std::int32_t x, std::int32_t y) const {
        return static_cast<std::uint32_t>(y) * targets_.tiles_x + static_cast<std::uint32_t>(x);
    }
    /// @param box  of the tiles that it touches
    void bin(std::uint32_t record, const TileBox& box) {
        if (box.left == box.right && box.top == box.bottom)
            scratch_.entries.push_back({tile_at(box.left, box.top), record});
        else
            bin_in_several(record, box);
    }
    void bin_in_several(std::uint32_t record, const TileBox& box);
    void bin_where_inside(std::uint32_t record, const TileBox& box);

    Chunk& chunk_;
    const QueuedDraw& draw_;
    const RasterPipeline& pipeline_;
    const TargetSet& targets_;
    ChunkScratch& scratch_;
    const std::uint32_t draw_bits_;
};

double Assembler::bias(double slope, double largest_depth) const {
    const rhi::DepthStencilState& state = pipeline_.depth_stencil;
    return depth_bias(draw_.depth_layout, state.depth_bias, state.depth_bias_slope, state.depth_bias_clamp, slope,
                      largest_depth);
}

Assembler::Source Assembler::window_source(const SetupVertex& v0, const SetupVertex& v1, const SetupVertex& v2,
                                           const Corners& snapped, bool clockwise, std::uint32_t primitive_id) const {
    const ScreenVertex &a = vertex(v0.offset), &b = vertex(v1.offset), &c = vertex(v2.offset);
    Source source{PlaneSource::window, {v0.offset, v1.offset, v2.offset}, {}, a.x, a.y, primitive_id};
    double x1 = static_cast<double>(b.x) - a.x, y1 = static_cast<double>(b.y) - a.y;
    double x2 = static_cast<double>(c.x) - a.x, y2 = static_cast<double>(c.y) - a.y;
    const double area = x1 * y2 - x2 * y1;
    if (std::abs(area) < thin_area || (area > 0.0) != clockwise) {
        constexpr double unit = 1.0 / subpixels;
        source.kind = PlaneSource::snapped;
        source.x0 = static_cast<float>(snapped.x[0] * unit), source.y0 = static_cast<float>(snapped.y[0] * unit);
        x1 = (snapped.x[1] - snapped.x[0]) * unit, y1 = (snapped.y[1] - snapped.y[0]) * unit;
        x2 = (snapped.x[2] - snapped.x[0]) * unit, y2 = (snapped.y[2] - snapped.y[0]) * unit;
    }
    const SlopeWeights weights = triangle_weights(x1, y1, x2, y2);
    const double z1 = static_cast<double>(b.z) - a.z, z2 = static_cast<double>(c.z) - a.z;
    source.depth = {a.z, z1 * weights.first_x + z2 * weights.second_x, z1 * weights.first_y + z2 * weights.second_y};
    source.depth.c += bias(std::max(std::abs(source.depth.dx), std::abs(source.depth.dy)),
                           std::max({std::abs(a.z), std::abs(b.z), std::abs(c.z)}));
    return source;
}

bool Assembler::homogeneous_source(const SetupVertex (&vertices)[3], std::uint32_t primitive_id, Source& source) const {
    ScreenPoint points[3];
    // Values are exact near the reference: the vertex farthest away, where 1/w is small, or the middle of the viewport.
    source = {PlaneSource::homogeneous, {}, {}, draw_.translation[0], draw_.translation[1], primitive_id};
    float largest_w = 0.0f;
    double largest_depth = 0.0;
    for (int i = 0; i < 3; ++i) {
        const ScreenVertex& corner = vertex(vertices[i].offset);
        source.vertices[i] = vertices[i].offset;
        points[i] = screen_point(corner.clip, draw_.plan.scale, draw_.plan.translation);
        if ((vertices[i].codes & outside_guard) == 0 && corner.clip[3] > largest_w) {
            largest_w = corner.clip[3];
            source.x0 = corner.x, source.y0 = corner.y;
            largest_depth = std::max(largest_depth, static_cast<double>(std::abs(corner.z)));
        }
    }
    const HomogeneousWeights weights = homogeneous_weights(points);
    if (!weights.valid) return false;
    DepthPlane depth;
    for (int i = 0; i < 3; ++i) {
        const double z = vertex(vertices[i].offset).clip[2];
        depth.c += z * weights.at(i, source.x0, source.y0);
        depth.dx += z * weights.x[i], depth.dy += z * weights.y[i];
    }
    const double scale = draw_.plan.scale[2];
    source.depth = {depth.c * scale + draw_.plan.translation[2], depth.dx * scale, depth.dy * scale};
    source.depth.c +=
        bias(std::max(std::abs(source.depth.dx), std::abs(source.depth.dy)), largest_depth > 0.0 ? largest_depth : 1.0);
    return true;
}

void Assembler::bin_in_several(std::uint32_t record, const TileBox& box) {
    const auto tiles = static_cast<std::size_t>(box.right - box.left + 1) * (box.bottom - box.top + 1);
    const std::size_t room = most_binned_tiles * std::size_t{std::max(chunk_.primitive_count, least_bin_room)};
    if (tiles > most_binned_tiles && scratch_.entries.size() + tiles > room) {
        chunk_.large.push_back(record);
        return;
    }
    if (box.left != box.right && box.top != box.bottom && (chunk_.records[record].bits & Record::thin_line) == 0) {
        bin_where_inside(record, box);
        return;
    }
    for (std::int32_t y = box.top; y <= box.bottom; ++y)
        for (std::int32_t x = box.left; x <= box.right; ++x) scratch_.entries.push_back({tile_at(x, y), record});
}

/// Leaves out tiles that lie on the outer side of an edge of the triangle.
void Assembler::bin_where_inside(std::uint32_t record, const TileBox& box) {
    constexpr std::int64_t tile = std::int64_t{tile_size} * subpixels;
    const Record& triangle = chunk_.records[record];
    // Edge functions in the corner of the first tile where they are largest, and what they change by from tile to tile.
    std::int64_t at[3], along_x[3], along_y[3];
    for (int i = 0; i < 3; ++i) {
        const int next = i == 2 ? 0 : i + 1;
        const std::int64_t a = triangle.y[i] - triangle.y[next], b = triangle.x[next] - triangle.x[i];
        at[i] = a * (tile * (box.left + (a > 0 ? 1 : 0)) - triangle.x[i]) +
                b * (tile * (box.top + (b > 0 ? 1 : 0)) - triangle.y[i]);
        along_x[i] = a * tile, along_y[i] = b * tile;
    }
    for (std::int32_t y = box.top; y <= box.bottom; ++y) {
        std::int64_t in_row[3] = {at[0], at[1], at[2]};
        for (std::int32_t x = box.left; x <= box.right; ++x) {
            if ((in_row[0] | in_row[1] | in_row[2]) >= 0)
                scratch_.entries.push_back({tile_at(x, y), record});
            for (int i = 0; i < 3; ++i) in_row[i] += along_x[i];
        }
        for (int i = 0; i < 3; ++i) at[i] += along_y[i];
    }
}

/// @param corners  clockwise
void Assembler::add(const Corners& corners, const Source& source, std::uint32_t bits) {
    const bool is_line = (bits & Record::thin_line) != 0;
    const int count = is_line ? 2 : 3;
    std::int32_t low_x = corners.x[0], high_x = corners.x[0], low_y = corners.y[0], high_y = corners.y[0];
    for (int i = 1; i < count; ++i) {
        low_x = std::min(low_x, corners.x[i]), high_x = std::max(high_x, corners.x[i]);
        low_y = std::min(low_y, corners.y[i]), high_y = std::max(high_y, corners.y[i]);
    }
    // Pixels with a sample inside of the bounds.
    std::int32_t first = subpixels / 2, last = subpixels / 2;
    if (is_line || targets_.samples > 1) first = 0, last = subpixels - 1;
    const DrawPlan& plan = draw_.plan;
    low_x = std::max((low_x - last + subpixels - 1) >> subpixel_bits, plan.x_begin);
    high_x = std::min((high_x - first) >> subpixel_bits, plan.x_end - 1);
    low_y = std::max((low_y - last + subpixels - 1) >> subpixel_bits, plan.y_begin);
    high_y = std::min((high_y - first) >> subpixel_bits, plan.y_end - 1);
    if (low_x > high_x || low_y > high_y) return;

    const auto index = static_cast<std::uint32_t>(chunk_.records.size());
    Record& record = chunk_.records.emplace_back();
    for (int i = 0; i < 3; ++i) {
        record.x[i] = corners.x[i], record.y[i] = corners.y[i];
        record.vertex[i] = source.vertices[i];
    }
    record.primitive_id = source.primitive_id;
    record.bits = bits | draw_bits_ | static_cast<std::uint32_t>(source.kind) << Record::source_shift;
    const auto bounded = [](double slope) {
        return std::abs(slope) < steepest_slope ? static_cast<float>(slope) : 0.0f;
    };
    record.depth_c = bounded(source.depth.c), record.depth_dx = bounded(source.depth.dx);
    record.depth_dy = bounded(source.depth.dy);
    record.x0 = source.x0, record.y0 = source.y0;
    bin(index, {low_x / tile_size, high_x / tile_size, low_y / tile_size, high_y / tile_size});
}

void Assembler::triangles(const Segment& segment, const Kernels& kernels) {
    const bool is_strip = pipeline_.topology == rhi::Topology::triangle_strip;
    if (is_strip) {
        // As a list.
        scratch_.list.clear();
        for (std::uint32_t i = 0; i < segment.primitive_count; ++i) {
            const std::uint32_t odd = (segment.first_primitive + i) & 1;
            for (const std::uint32_t place : {i, i + 1 + odd, i + 2 - odd})
                scratch_.list.push_back(scratch_.locals[place]);
        }
    }
    const std::uint32_t* const corners = is_strip ? scratch_.list.data() : scratch_.locals.data();
    const auto draw_alone = [&](std::uint32_t number) {
        const std::uint32_t* const own = corners + 3 * std::size_t{number};
        triangle(own[0], own[1], own[2], segment.first_primitive + number);
    };
    if (targets_.samples > 1 || pipeline_.fill != rhi::FillMode::fill) {
        for (std::uint32_t i = 0; i < segment.primitive_count; ++i) draw_alone(i);
        return;
    }
    const DrawPlan& plan = draw_.plan;
    const rhi::DepthStencilState& state = pipeline_.depth_stencil;
    TriangleSetup work;
    work.vertices = scratch_.setup.data();
    work.cull = pipeline_.cull;
    work.front_is_clockwise = pipeline_.front_face == rhi::FrontFace::clockwise;
    work.x_begin = plan.x_begin, work.x_end = plan.x_end, work.y_begin = plan.y_begin, work.y_end = plan.y_end;
    work.bias = state.depth_bias, work.bias_slope = state.depth_bias_slope, work.bias_clamp = state.depth_bias_clamp;
    work.bias_unit = fixed_unit(draw_.depth_layout);
    work.draw_bits = draw_bits_;
    for (std::uint32_t first = 0; first < segment.primitive_count; first += 16) {
        work.count = std::min(segment.primitive_count - first, 16u);
        work.corners = corners + 3 * std::size_t{first};
        work.screen = chunk_.vertices.data();
        work.first_primitive = segment.first_primitive + first;
        kernels.set_up_triangles(work);
        for (std::uint32_t rest = work.drawn | work.special; rest != 0; rest &= rest - 1) {
            const auto i = static_cast<std::uint32_t>(std::countr_zero(rest));
            if (work.special >> i & 1) {
                draw_alone(first + i);
                continue;
            }
            const auto index = static_cast<std::uint32_t>(chunk_.records.size());
            chunk_.records.push_back(work.records[i]);
            bin(index, {work.left[i], work.right[i], work.top[i], work.bottom[i]});
        }
    }
}

void Assembler::triangle(std::uint32_t local0, std::uint32_t local1, std::uint32_t local2, std::uint32_t primitive_id) {
    const SetupVertex &v0 = scratch_.setup[local0], &v1 = scratch_.setup[local1], &v2 = scratch_.setup[local2];
    const std::uint32_t any = v0.codes | v1.codes | v2.codes;
    if (any != 0) {
        const std::uint32_t all = v0.codes & v1.codes & v2.codes;
        if ((any & not_finite) != 0 || (all & (outside_view | clip_distances_mask | cull_distances_mask)) != 0) return;
        if ((any & (outside_near | outside_far | outside_guard | clip_distances_mask)) != 0) {
            clipped_triangle({local0, local1, local2}, any, primitive_id);
            return;
        }
    }
    const std::int64_t area =
        static_cast<std::int64_t>(v1.x - v0.x) * (v2.y - v0.y) - static_cast<std::int64_t>(v2.x - v0.x) * (v1.y - v0.y);
    if (area == 0 && pipeline_.fill == rhi::FillMode::fill) return;
    const bool clockwise = area > 0, front = faces_front(clockwise);
    if (culled(front)) return;
    if (pipeline_.fill == rhi::FillMode::line) {
        outline(local0, local1, local2, primitive_id, front);
        return;
    }
    const Corners corners{{v0.x, v1.x, v2.x}, {v0.y, v1.y, v2.y}};
    if (targets_.samples == 1) {
        // Most small triangles that cover nothing end here, before anything is computed for them.
        const std::int32_t low_x = std::min({v0.x, v1.x, v2.x}), high_x = std::max({v0.x, v1.x, v2.x});
        const std::int32_t low_y = std::min({v0.y, v1.y, v2.y}), high_y = std::max({v0.y, v1.y, v2.y});
        constexpr std::int32_t half = subpixels / 2;
        if ((low_x + half - 1) >> subpixel_bits > (high_x - half) >> subpixel_bits ||
            (low_y + half - 1) >> subpixel_bits > (high_y - half) >> subpixel_bits)
            return;
    }
    const Source source = window_source(v0, v1, v2, corners, clockwise, primitive_id);
    const std::uint32_t bits = front ? Record::front_facing : 0;
    if (clockwise)
        add(corners, source, bits);
    else
        add({{v0.x, v2.x, v1.x}, {v0.y, v2.y, v1.y}}, source, bits | Record::swapped);
}

/// The planes that the codes ask for. Vertices without a code count as inside whatever rounding says: their neighbors,
/// which are not clipped, use them as they are.
int Assembler::gather_planes(const std::uint32_t* locals, int count, std::uint32_t codes, ClipPlane* planes) const {
    int plane_count = 0;
    const auto add_plane = [&](std::uint32_t code, auto&& value) {
        ClipPlane& plane = planes[plane_count++];
        for (int i = 0; i < count; ++i) {
            const SetupVertex& corner = scratch_.setup[locals[i]];
            plane.values[i] = value(vertex(corner.offset), locals[i]);
            if ((corner.codes & code) == 0 && !(plane.values[i] > 0.0)) plane.values[i] = 0.0;
        }
    };
    if (codes & outside_guard) {
        for (int axis = 0; axis < 2; ++axis)
            for (const double side : {1.0, -1.0})
                add_plane(outside_guard, [&](const ScreenVertex& corner, std::uint32_t) {
                    const double w = corner.clip[3];
                    return guard_band * w -
                           side * (corner.clip[axis] * draw_.plan.scale[axis] + w * draw_.plan.translation[axis]);
                });
    }
    if (codes & outside_near)
        add_plane(outside_near,
                  [](const ScreenVertex& corner, std::uint32_t) { return static_cast<double>(corner.clip[2]); });
    if (codes & outside_far)
        add_plane(outside_far, [](const ScreenVertex& corner, std::uint32_t) {
            return static_cast<double>(corner.clip[3]) - corner.clip[2];
        });
    for (std::uint32_t i = 0; i < pipeline_.vertex.clip_distances; ++i)
        if (codes & (first_clip_distance << i))
            add_plane(first_clip_distance << i, [&](const ScreenVertex&, std::uint32_t local) {
                const double distance = scratch_.clip_distances[static_cast<std::size_t>(local) * 8 + i];
                return std::isnan(distance) ? -1.0 : distance;
            });
    return plane_count;
}

void Assembler::clipped_triangle(const std::uint32_t (&locals)[3], std::uint32_t codes, std::uint32_t primitive_id) {
    if (pipeline_.fill == rhi::FillMode::line) {
        // Which way it faces is the sign of the homogeneous determinant, also behind the eye.
        ScreenPoint points[3];
        for (int i = 0; i < 3; ++i)
            points[i] =
                screen_point(vertex(scratch_.setup[locals[i]].offset).clip, draw_.plan.scale, draw_.plan.translation);
        const double determinant = points[0].x * (points[1].y * points[2].w - points[1].w * points[2].y) +
                                   points[0].y * (points[1].w * points[2].x - points[1].x * points[2].w) +
                                   points[0].w * (points[1].x * points[2].y - points[1].y * points[2].x);
        const bool front = faces_front(determinant > 0.0);
        if (!culled(front)) outline(locals[0], locals[1], locals[2], primitive_id, front);
        return;
    }
    ClipPlane planes[most_clip_planes];
    const int plane_count = gather_planes(locals, 3, codes, planes);
    const ClipPolygon polygon = clip_triangle(planes, plane_count);
    if (polygon.count < 3) return;

    const SetupVertex vertices[3] = {scratch_.setup[locals[0]], scratch_.setup[locals[1]], scratch_.setup[locals[2]]};
    std::int32_t x[most_corners], y[most_corners];
    for (int i = 0; i < polygon.count; ++i) {
        const ClipCorner& corner = polygon.corners[i];
        if (corner.original >= 0) {
            x[i] = vertices[corner.original].x, y[i] = vertices[corner.original].y;
            continue;
        }
        ScreenPoint point{0.0, 0.0, 0.0};
        for (int j = 0; j < 3; ++j) {
            if (corner.weights[j] == 0.0) continue;
            const ScreenPoint part =
                screen_point(vertex(vertices[j].offset).clip, draw_.plan.scale, draw_.plan.translation);
            point.x += corner.weights[j] * part.x, point.y += corner.weights[j] * part.y;
            point.w += corner.weights[j] * part.w;
        }
        if (!(point.w > 0.0)) return;
        const auto fixed = [](double coordinate) {
            constexpr double limit = guard_band;
            return static_cast<std::int32_t>(std::nearbyint(std::clamp(coordinate, -limit, limit) * subpixels));
        };
        const double window_x = point.x / point.w, window_y = point.y / point.w;
        if (!std::isfinite(window_x) || !std::isfinite(window_y)) return;
        x[i] = fixed(window_x), y[i] = fixed(window_y);
    }

    // All parts have the planes of the whole: no seam between them, and the same depths as without clipping.
    bool has_source = false;
    Source source{};
    for (int i = 1; i + 1 < polygon.count; ++i) {
        const std::int64_t area = static_cast<std::int64_t>(x[i] - x[0]) * (y[i + 1] - y[0]) -
                                  static_cast<std::int64_t>(x[i + 1] - x[0]) * (y[i] - y[0]);
        if (area == 0) continue;
        const bool clockwise = area > 0, front = faces_front(clockwise);
        if (culled(front)) continue;
        if (!has_source) {
            if (codes & outside_guard) {
                if (!homogeneous_source(vertices, primitive_id, source)) return;
            } else {
                source = window_source(
                    vertices[0], vertices[1], vertices[2],
                    {{vertices[0].x, vertices[1].x, vertices[2].x}, {vertices[0].y, vertices[1].y, vertices[2].y}},
                    clockwise, primitive_id);
                // Planes from rounded corners need those in the record, which has others here.
                if (source.kind == PlaneSource::snapped && !homogeneous_source(vertices, primitive_id, source)) return;
            }
            has_source = true;
        }
        const std::uint32_t bits = front ? Record::front_facing : 0;
        if (clockwise)
            add({{x[0], x[i], x[i + 1]}, {y[0], y[i], y[i + 1]}}, source, bits);
        else
            add({{x[0], x[i + 1], x[i]}, {y[0], y[i + 1], y[i]}}, source, bits | Record::swapped);
    }
}

void Assembler::outline(std::uint32_t local0, std::uint32_t local1, std::uint32_t local2, std::uint32_t primitive_id,
                        bool front) {
    line(local0, local1, local0, primitive_id, front, true);
    line(local1, local2, local0, primitive_id, front, true);
    line(local2, local0, local0, primitive_id, front, true);
}

/// A new vertex on the line from `a` to `b`.
/// @return its offset
std::uint32_t Assembler::vertex_between(const SetupVertex& a, const SetupVertex& b, double t) {
    const std::size_t offset = chunk_.vertex_bytes;
    chunk_.vertices.reserve(offset + draw_.vertex_bytes, offset);
    chunk_.vertex_bytes += draw_.vertex_bytes;
    const auto mixed = [&](float from, float to) { return static_cast<float>(from * (1.0 - t) + to * t); };
    const ScreenVertex &from = vertex(a.offset), &to = vertex(b.offset);
    auto& made = *new (chunk_.vertices.data() + offset) ScreenVertex;
    double clip[4];
    for (int i = 0; i < 4; ++i) {
        clip[i] = from.clip[i] * (1.0 - t) + to.clip[i] * t;
        made.clip[i] = static_cast<float>(clip[i]);
    }
    const auto window = [&](int axis) {
        return static_cast<float>(clip[axis] / clip[3] * draw_.plan.scale[axis] + draw_.plan.translation[axis]);
    };
    made.x = window(0), made.y = window(1), made.z = window(2);
    made.inverse_w = static_cast<float>(1.0 / clip[3]);
    auto* const inputs = const_cast<float*>(made.inputs());
    for (std::uint32_t i = 0; i < draw_.row_count; ++i) inputs[i] = mixed(from.inputs()[i], to.inputs()[i]);
    if (draw_.plan.in_double) {
        const double *from_doubles = vertex_doubles(from, draw_.row_count),
                     *to_doubles = vertex_doubles(to, draw_.row_count);
        double* const doubles = vertex_doubles(made, draw_.row_count);
        for (std::uint32_t i = 0; i < 4 + draw_.row_count; ++i)
            doubles[i] = from_doubles[i] * (1.0 - t) + to_doubles[i] * t;
    }
    return static_cast<std::uint32_t>(offset / 16);
}

void Assembler::line(std::uint32_t local0, std::uint32_t local1, std::uint32_t provoking, std::uint32_t primitive_id,
                     bool front, bool is_edge) {
    const SetupVertex ends[2] = {scratch_.setup[local0], scratch_.setup[local1]};
    const std::uint32_t any = ends[0].codes | ends[1].codes;
    if ((any & not_finite) != 0 ||
        (ends[0].codes & ends[1].codes & (outside_view | clip_distances_mask | cull_distances_mask)) != 0)
        return;
    Source source{PlaneSource::line, {ends[0].offset, ends[1].offset, scratch_.setup[provoking].offset}, {}, 0, 0,
                  primitive_id};
    Corners corners{{ends[0].x, ends[1].x, 0}, {ends[0].y, ends[1].y, 0}};
    if ((any & (outside_near | outside_far | outside_guard | clip_distances_mask)) != 0) {
        ClipPlane planes[most_clip_planes];
        const std::uint32_t locals[2] = {local0, local1};
        const ClipRange range = clip_line(planes, gather_planes(locals, 2, any, planes));
        if (range.empty()) return;
        for (int i = 0; i < 2; ++i) {
            const double t = i == 0 ? range.begin : range.end;
            if (t == i) continue;
            source.vertices[i] = vertex_between(ends[0], ends[1], t);
            const ScreenVertex& made = vertex(source.vertices[i]);
            if (!std::isfinite(made.x) || !std::isfinite(made.y) || !std::isfinite(made.z) || !(made.inverse_w > 0.0f))
                return;
            corners.x[i] =
                static_cast<std::int32_t>(std::nearbyint(std::clamp(made.x, -guard_band, guard_band) * subpixels));
            corners.y[i] =
                static_cast<std::int32_t>(std::nearbyint(std::clamp(made.y, -guard_band, guard_band) * subpixels));
        }
    }
    const ScreenVertex &a = vertex(source.vertices[0]), &b = vertex(source.vertices[1]);
    source.x0 = a.x, source.y0 = a.y;
    const SlopeWeights weights = line_weights(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
    const double rise = static_cast<double>(b.z) - a.z;
    source.depth = {a.z, rise * weights.first_x, rise * weights.first_y};
    if (is_edge)
        source.depth.c += bias(std::max(std::abs(source.depth.dx), std::abs(source.depth.dy)),
                               std::max(std::abs(a.z), std::abs(b.z)));
    const std::uint32_t bits = front ? Record::front_facing : 0;
    if (targets_.samples == 1) {
        add(corners, source, bits | Record::thin_line);
        return;
    }
    // With several samples: a parallelogram of one pixel along the smaller extent.
    const std::int32_t length_x = std::abs(corners.x[1] - corners.x[0]),
                       length_y = std::abs(corners.y[1] - corners.y[0]);
    if (length_x == 0 && length_y == 0) return;
    const std::int32_t half = subpixels / 2;
    const std::int32_t shift_x = length_x >= length_y ? 0 : half, shift_y = length_x >= length_y ? half : 0;
    const std::int32_t x[4] = {corners.x[0] - shift_x, corners.x[1] - shift_x, corners.x[1] + shift_x,
                               corners.x[0] + shift_x};
    const std::int32_t y[4] = {corners.y[0] - shift_y, corners.y[1] - shift_y, corners.y[1] + shift_y,
                               corners.y[0] + shift_y};
    for (int i = 1; i < 3; ++i) {
        const std::int64_t area = static_cast<std::int64_t>(x[i] - x[0]) * (y[i + 1] - y[0]) -
                                  static_cast<std::int64_t>(x[i + 1] - x[0]) * (y[i] - y[0]);
        if (area == 0) continue;
        if (area > 0)
            add({{x[0], x[i], x[i + 1]}, {y[0], y[i], y[i + 1]}}, source, bits);
        else
            add({{x[0], x[i + 1], x[i]}, {y[0], y[i + 1], y[i]}}, source, bits);
    }
}

void Assembler::point(std::uint32_t local, std::uint32_t primitive_id) {
    const SetupVertex& center = scratch_.setup[local];
    if (center.codes != 0) return;
    const float asked = scratch_.point_sizes[local];
    const float size = asked > 1.0f ? std::min(asked, largest_point_size) : 1.0f;
    const ScreenVertex& from = vertex(center.offset);
    std::uint32_t size_bits;
    std::memcpy(&size_bits, &size, sizeof(size_bits));
    const Source source{PlaneSource::point, {center.offset, size_bits, 0}, {from.z, 0.0, 0.0}, from.x, from.y,
                        primitive_id};
    const auto extent = static_cast<std::int32_t>(std::nearbyint(size * subpixels));
    const std::int32_t left = center.x - extent / 2, top = center.y - extent / 2;
    const std::int32_t right = left + extent, bottom = top + extent;
    add({{left, right, right}, {top, top, bottom}}, source, Record::front_facing);
    add({{left, right, left}, {top, bottom, bottom}}, source, Record::front_facing);
}

void sort_into_bins(Chunk& chunk, const ChunkScratch& scratch, std::uint32_t tile_count) {
    chunk.bin_offsets.clear();
    chunk.bins.resize(scratch.entries.size());
    if (scratch.entries.empty()) return;
    // Offsets are shifted by one while they count up, and come out right in the end.
    chunk.bin_offsets.assign(tile_count + 2, 0);
    for (const ChunkScratch::BinEntry& entry : scratch.entries) ++chunk.bin_offsets[entry.tile + 2];
    for (std::uint32_t tile = 2; tile < tile_count + 2; ++tile) chunk.bin_offsets[tile] += chunk.bin_offsets[tile - 1];
    for (const ChunkScratch::BinEntry& entry : scratch.entries)
        chunk.bins[chunk.bin_offsets[entry.tile + 1]++] = entry.record;
}

}  // namespace

double depth_bias(DepthLayout layout, float constant, float slope_factor, float clamp, double slope,
                  double largest_depth) {
    if (constant == 0.0f && slope_factor == 0.0f) return 0.0;
    double unit = fixed_unit(layout);
    if (unit == 0.0 && largest_depth > 0.0)
        unit = std::ldexp(1.0, std::max(std::ilogb(largest_depth), -126) - 23);
    double result = slope * slope_factor + unit * constant;
    if (clamp > 0.0f) result = std::min(result, static_cast<double>(clamp));
    if (clamp < 0.0f) result = std::max(result, static_cast<double>(clamp));
    return std::isfinite(result) ? result : 0.0;
}

std::uint32_t primitives_of(rhi::Topology topology, std::uint32_t count) {
    switch (topology) {
        case rhi::Topology::point_list: return count;
        case rhi::Topology::line_list: return count / 2;
        case rhi::Topology::line_strip: return count < 2 ? 0 : count - 1;
        case rhi::Topology::triangle_list: return count / 3;
        case rhi::Topology::triangle_strip: break;
    }
    return count < 3 ? 0 : count - 2;
}

void build_chunk(Chunk& chunk, const std::vector<std::unique_ptr<QueuedDraw>>& draws, const TargetSet& targets,
                 const Kernels& kernels, std::uint32_t lanes, ChunkScratch& scratch) {
    chunk.records.clear();
    chunk.large.clear();
    chunk.vertex_bytes = 0;
    scratch.entries.clear();
    for (const Segment& segment : chunk.segments) {
        const QueuedDraw& draw = *draws[segment.draw];
        if (draw.context.state && __atomic_load_n(&draw.context.state->expired, __ATOMIC_RELAXED) != 0) continue;
        run_vertices(segment, draw, kernels, lanes, chunk, scratch);
        Assembler assembler(chunk, draw, segment.draw, targets, scratch);
        const std::vector<std::uint32_t>& locals = scratch.locals;
        const rhi::Topology topology = draw.pipeline->topology;
        if (topology == rhi::Topology::triangle_list || topology == rhi::Topology::triangle_strip) {
            assembler.triangles(segment, kernels);
            continue;
        }
        for (std::uint32_t i = 0; i < segment.primitive_count; ++i) {
            const std::uint32_t id = segment.first_primitive + i;
            if (topology == rhi::Topology::point_list) {
                assembler.point(locals[i], id);
            } else {
                const std::uint32_t first = topology == rhi::Topology::line_list ? 2 * i : i;
                assembler.line(locals[first], locals[first + 1], locals[first], id, true, false);
            }
        }
    }
    sort_into_bins(chunk, scratch, targets.tiles_x * targets.tiles_y);
}

}  // namespace nacre::cpu::raster
