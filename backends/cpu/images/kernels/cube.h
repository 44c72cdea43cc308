// SPDX-License-Identifier: Apache-2.0
// Cube maps: faces of directions, and footprints that reach over the edges of faces. Source: Vulkan specification,
// "Cube Map Face Selection", "Cube Map Edge Handling".
#pragma once

#include "backends/cpu/images/kernels/addressing.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

/// A direction on its face: s and t in [0, 1], and what derivatives need.
template <int W>
struct CubeProjection {
    Ints<W> face;
    Floats<W> s, t;
    Floats<W> sc, tc, major;  ///< Before the division; major > 0.
};

/// Components (sc, tc, rc) of a vector for faces that are known, rc with the sign of the face.
template <int W>
NACRE_INLINE void face_components(Ints<W> face, const Floats<W>* r, Floats<W>& sc, Floats<W>& tc, Floats<W>& rc) {
    const Ints<W> is_x = face<2, is_z = face> 3, is_negative = (face & 1) != 0;
    const Floats<W> x = r[0], y = r[1], z = r[2];
    // +X: -z  -X: z  +-Y: x  +Z: x  -Z: -x
    const Floats<W> s_of_x = is_negative ? z : -z, s_of_z = is_negative ? -x : x;
    sc = is_x ? s_of_x : (is_z ? s_of_z : x);
    const Floats<W> t_of_y = is_negative ? -z : z;
    tc = is_x | is_z ? -y : t_of_y;
    const Floats<W> axis = is_x ? x : (is_z ? z : y);
    rc = is_negative ? -axis : axis;
}

template <int W>
NACRE_INLINE CubeProjection<W> project_to_cube(const Floats<W>* direction) {
    const Floats<W> ax = absolute<W>(direction[0]), ay = absolute<W>(direction[1]), az = absolute<W>(direction[2]);
    const Ints<W> is_z = (az >= ax) & (az >= ay), is_y = ~is_z & (ay >= ax);
    const Ints<W> axis = is_z ? splat<W>(4) : (is_y ? splat<W>(2) : splat<W>(0));
    const Floats<W> along = is_z ? direction[2] : (is_y ? direction[1] : direction[0]);
    CubeProjection<W> cube;
    cube.face = axis + ((along < 0.0f) & 1);
    const std::int32_t first = cube.face[0];
    if (mask_bits<W>(cube.face == first) == all_lanes<W>) {
        // Neighbors mostly see one face.
        const auto signed_by = [](Floats<W> x, std::int32_t sign) { return (Floats<W>)((Ints<W>)x ^ sign); };
        constexpr auto minus = static_cast<std::int32_t>(0x80000000u);
        const std::int32_t outward = (first & 1) != 0 ? minus : 0;
        cube.major = absolute<W>(along);
        cube.sc =
            first < 2 ? signed_by(direction[2], minus ^ outward) : signed_by(direction[0], first > 3 ? outward : 0);
        cube.tc = first < 2 || first > 3 ? signed_by(direction[1], minus) : signed_by(direction[2], outward);
    } else {
        face_components<W>(cube.face, direction, cube.sc, cube.tc, cube.major);
    }
    cube.s = 0.5f * (cube.sc / cube.major) + 0.5f;
    cube.t = 0.5f * (cube.tc / cube.major) + 0.5f;
    return cube;
}

/// Derivatives of (s, t) where the direction changes by `change`.
template <int W>
NACRE_INLINE void project_derivative(const CubeProjection<W>& cube, const Floats<W>* change, Floats<W>* result) {
    Floats<W> sc, tc, rc;
    face_components<W>(cube.face, change, sc, tc, rc);
    const Floats<W> inverse = 0.5f / (cube.major * cube.major);
    result[0] = (cube.major * sc - cube.sc * rc) * inverse;
    result[1] = (cube.major * tc - cube.tc * rc) * inverse;
}

/// What lies beyond an edge of a face: the face, and how to get texel coordinates there from the place along the edge.
struct CubeEdge {
    enum Rule : std::uint8_t { zero, last, along, reversed };
    std::uint8_t face;
    Rule x, y;
};
struct CubeEdges {
    CubeEdge edges[6][4];  // Left (x < 0), right, top (y < 0), bottom.
};

/// From the axes of the faces: the texel just over an edge lies on the face of the axis that is crossed, at its border
/// towards the old face.
constexpr CubeEdges make_cube_edges() {
    // s, t and outward axis of each face.
    constexpr int axes[6][3][3] = {
        {{0, 0, -1}, {0, -1, 0}, {1, 0, 0}}, {{0, 0, 1}, {0, -1, 0}, {-1, 0, 0}}, {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
        {{1, 0, 0}, {0, 0, -1}, {0, -1, 0}}, {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}},  {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
    };
    CubeEdges result{};
    for (int face = 0; face < 6; ++face) {
        for (int edge = 0; edge < 4; ++edge) {
            const int sign = (edge & 1) != 0 ? 1 : -1, crossed = edge / 2, kept = 1 - crossed;
            int to = 0;
            for (int other = 0; other < 6; ++other) {
                bool is_same = true;
                for (int c = 0; c < 3; ++c) is_same = is_same && axes[other][2][c] == sign * axes[face][crossed][c];
                if (is_same) to = other;
            }
            CubeEdge::Rule rules[2] = {};
            for (int axis = 0; axis < 2; ++axis) {
                int towards_old = 0, towards_kept = 0;
                for (int c = 0; c < 3; ++c) {
                    towards_old += axes[to][axis][c] * axes[face][2][c];
                    towards_kept += axes[to][axis][c] * axes[face][kept][c];
                }
                rules[axis] = towards_old > 0    ? CubeEdge::last
                              : towards_old < 0  ? CubeEdge::zero
                              : towards_kept > 0 ? CubeEdge::along
                                                 : CubeEdge::reversed;
            }
            result.edges[face][edge] = {static_cast<std::uint8_t>(to), rules[0], rules[1]};
        }
    }
    return result;
}
constexpr CubeEdges cube_edges = make_cube_edges();

/// The edges as words for gathers: face, and the rules for x and y in bits 8 and 16.
struct PackedCubeEdges {
    std::int32_t words[6 * 4];
};
constexpr PackedCubeEdges packed_cube_edges = [] {
    PackedCubeEdges packed{};
    for (int i = 0; i < 24; ++i) {
        const CubeEdge& edge = cube_edges.edges[i / 4][i % 4];
        packed.words[i] = edge.face | edge.x << 8 | edge.y << 16;
    }
    return packed;
}();

template <int W>
NACRE_INLINE Ints<W> apply_rule(Ints<W> rule, Ints<W> along, std::int32_t n) {
    const Ints<W> from = (rule & 2) != 0 ? along : splat<W>(0);
    return (rule & 1) != 0 ? n - 1 - from : from;
}

/// Moves texels that lie one step outside of their face to the neighboring face. `is_corner`: those outside in both
/// directions, which stay at their corner.
template <int W>
NACRE_INLINE void cross_edges(std::int32_t n, Ints<W>& x, Ints<W>& y, Ints<W>& face, Ints<W>& is_corner) {
    const Ints<W> outside_x = (x < 0) | (x >= n), outside_y = (y < 0) | (y >= n);
    is_corner = outside_x & outside_y;
    const Ints<W> edge_x = x < 0 ? splat<W>(0) : splat<W>(1), edge_y = y < 0 ? splat<W>(2) : splat<W>(3);
    const Ints<W> crosses = outside_x ^ outside_y;
    const Ints<W> over = gather_words<W>(reinterpret_cast<const std::byte*>(packed_cube_edges.words),
                                         (face * 4 + (outside_x ? edge_x : edge_y)) * 4);
    const Ints<W> along = outside_x ? y : x;
    const Ints<W> inside_x = clamp<W>(x, 0, n - 1), inside_y = clamp<W>(y, 0, n - 1);
    x = crosses ? apply_rule<W>((over >> 8) & 3, along, n) : inside_x;
    y = crosses ? apply_rule<W>(over >> 16, along, n) : inside_y;
    face = crosses ? over & 7 : face;
}

/// Where a linear footprint on a face begins, and the weights of its second column and row.
template <int W>
struct CubeCorner {
    Ints<W> x, y;
    Floats<W> fx, fy;
    bool crosses;  ///< In some lane it reaches over an edge.
};
template <int W>
NACRE_INLINE CubeCorner<W> cube_corner(std::int32_t n, const CubeProjection<W>& cube) {
    const auto texels = [&](Floats<W> s) {
        return clamp<W>(s * static_cast<float>(n), splat<W>(0.0f), splat<W>(static_cast<float>(n)));
    };
    const Floats<W> u = texels(cube.s) - 0.5f, v = texels(cube.t) - 0.5f;
    const Floats<W> whole_u = floor_small<W>(u), whole_v = floor_small<W>(v);
    CubeCorner<W> corner;
    corner.x = truncate<W>(whole_u), corner.y = truncate<W>(whole_v);
    corner.fx = u - whole_u, corner.fy = v - whole_v;
    corner.crosses = mask_bits<W>((corner.x < 0) | (corner.y < 0) | (corner.x + 1 >= n) | (corner.y + 1 >= n)) != 0;
    return corner;
}

/// Footprint on a cube. `first_slice` is the slice of face 0 of each lane's cube.
template <int W>
[[gnu::noinline]] void make_cube_taps(const Source& source, const CubeProjection<W>& cube, Ints<W> first_slice,
                                      bool is_linear, Taps<W>& taps) {
    const std::int32_t n = source.width;
    taps.has_border = false, taps.has_corner = false;
    const auto texels = [&](Floats<W> s) {
        return clamp<W>(s * static_cast<float>(n), splat<W>(0.0f), splat<W>(static_cast<float>(n)));
    };
    if (!is_linear) {
        taps.count = 1;
        taps.places[0] = place_texel<W>(source, clamp<W>(truncate<W>(texels(cube.s)), 0, n - 1),
                                        clamp<W>(truncate<W>(texels(cube.t)), 0, n - 1), first_slice + cube.face);
        return;
    }
    taps.count = 4;
    const CubeCorner<W> corner = cube_corner<W>(n, cube);
    const Floats<W> fx = corner.fx, fy = corner.fy;
    for (int tap = 0; tap < 4; ++tap) {
        Ints<W> i = corner.x + (tap & 1), j = corner.y + (tap >> 1), face = cube.face;
        if (corner.crosses) {
            cross_edges<W>(n, i, j, face, taps.is_corner[tap]);
            taps.has_corner = taps.has_corner || mask_bits<W>(taps.is_corner[tap]) != 0;
        }
        taps.places[tap] = place_texel<W>(source, i, j, first_slice + face);
        taps.weights[tap] = ((tap & 1) != 0 ? fx : 1.0f - fx) * ((tap & 2) != 0 ? fy : 1.0f - fy);
    }
    if (!taps.has_corner) return;
    // The texel that does not exist counts as the mean of the three others. A face of one texel has several corners in
    // one footprint: the others share their weight.
    Floats<W> lost = splat<W>(0.0f), remaining = splat<W>(0.0f);
    for (int tap = 0; tap < 4; ++tap) {
        lost = taps.is_corner[tap] ? lost + taps.weights[tap] : lost;
        remaining = taps.is_corner[tap] ? remaining : remaining + 1.0f;
    }
    const Floats<W> share = lost / maximum<W>(remaining, splat<W>(1.0f));
    for (int tap = 0; tap < 4; ++tap) {
        taps.weights[tap] = taps.is_corner[tap] ? splat<W>(0.0f) : taps.weights[tap] + share;
    }
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
