// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include <glm/vec3.hpp>

/// @file
/// Tangent frames that stand at an angle to the surface's own.

namespace nacre::materials {

/// A direction of the surface's frame in a frame that is turned by `angle` (radians) around the normal; by -angle the
/// way back.
[[nodiscard]] inline glm::dvec3 turned(const glm::dvec3& direction, double angle) {
    if (angle == 0.0) return direction;
    const double c = std::cos(angle), s = std::sin(angle);
    return {c * direction.x + s * direction.y, c * direction.y - s * direction.x, direction.z};
}

}  // namespace nacre::materials
