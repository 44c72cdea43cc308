// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/scene.h"

/// @file
/// The seven ways in which glTF strings indices together, and the three lists that they become.
/// Internal to scene/gltf/; functions may throw `Rejected`.

namespace nacre::scene::gltf {

/// As numbered by glTF.
enum class PrimitiveMode : std::uint8_t {
    points,
    lines,
    line_loop,
    line_strip,
    triangles,
    triangle_strip,
    triangle_fan
};

/// What a mode becomes.
Topology topology_of(PrimitiveMode mode);

/// Indices of one point, line or triangle: 1, 2 or 3.
std::size_t corners_of(Topology topology);

/// Indices of the list with the same elements and the same facing. Triangles of strips and fans that use a vertex
/// twice are dropped: they only steer the strip. Rejected: a number of indices that does not fit the mode.
std::vector<std::uint32_t> to_list(PrimitiveMode mode, std::vector<std::uint32_t> indices, const std::string& element);

}  // namespace nacre::scene::gltf
