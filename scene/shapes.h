// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "scene/scene.h"

/// @file
/// Simple solids as primitives with normals, texture coordinates, indices and bounds; material 0.
///
///     Primitive ball = sphere(0.5f, 64, 32);
///     ball.material = 2;
///     scene.meshes.push_back({"ball", {ball}});

namespace nacre::scene {

/// Sphere around the origin: `segments` around +Y (>= 3), `rings` from pole to pole (>= 2). u runs around, v from +Y
/// down.
[[nodiscard]] Primitive sphere(float radius, std::uint32_t segments, std::uint32_t rings);

/// Box around the origin with flat faces; every face shows the whole texture.
[[nodiscard]] Primitive box(const glm::vec3& half_size);

/// Flat parallelogram: corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v. The normal is
/// cross(edge_u, edge_v); the texture's lower left corner (uv 0, 1) is at `corner`.
[[nodiscard]] Primitive parallelogram(const glm::vec3& corner, const glm::vec3& edge_u, const glm::vec3& edge_v);

/// Sets bounds from the indexed positions.
void update_bounds(Primitive& primitive);

}  // namespace nacre::scene
