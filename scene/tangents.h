// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "scene/scene.h"

/// @file
/// Normals and tangents for geometry that comes without them.
///
///     add_flat_normals(primitive);
///     add_tangents(primitive, primitive.uv0);
///     glm::vec3 bitangent = primitive.tangents[i].w * glm::cross(primitive.normals[i],
///     glm::vec3(primitive.tangents[i]));
///
/// All functions are thread-safe for different primitives.

namespace nacre::scene {

/// Gives every triangle its own three vertices with the normal of the triangle; all other attributes go along.
/// Triangles without area get the normal (0, 0, 1). Only for triangle lists.
void add_flat_normals(Primitive& primitive);

/// Tangents as MikkTSpace defines them (M. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008, section 2;
/// default angular threshold), for texture coordinates whose v grows downwards, as in glTF: corners with the same
/// position, normal and texture coordinates are one vertex; at each vertex the triangles that are connected by edges
/// and have the same handedness form a group; the group's tangent is the mean of its triangles' u directions in the
/// plane of the vertex normal, weighted by their angles there. A vertex in several groups is split, so the number of
/// vertices may grow. Independent of the order of triangles but for rounding.
///
/// Triangles without area in texture coordinates join a neighboring group; where there is none, or `uv` is empty,
/// the tangent is some unit vector perpendicular to the normal, w = 1.
/// Only for triangle lists with normals; `uv` is empty or as long as the positions (it may be the primitive's own).
void add_tangents(Primitive& primitive, std::span<const glm::vec2> uv);

/// A unit vector perpendicular to the unit vector `normal`.
[[nodiscard]] glm::vec3 any_perpendicular(const glm::vec3& normal);

/// Makes vertex i of `primitive` a copy of its former vertex sources[i], in all attributes.
void gather_vertices(Primitive& primitive, std::span<const std::uint32_t> sources);

}  // namespace nacre::scene
