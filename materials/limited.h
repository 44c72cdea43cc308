// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include <glm/vec3.hpp>

/// @file
/// What comes from outside, brought into the range that its meaning allows.

namespace nacre::materials {

/// @return `value` within [low, high]; `low` for NaN
[[nodiscard]] inline float limited(float value, float low, float high) {
    return std::isnan(value) ? low : std::clamp(value, low, high);
}

/// The same in [0, 1].
[[nodiscard]] inline float unit(float value) { return limited(value, 0.0f, 1.0f); }
[[nodiscard]] inline glm::vec3 unit(const glm::vec3& v) { return {unit(v.x), unit(v.y), unit(v.z)}; }

}  // namespace nacre::materials
