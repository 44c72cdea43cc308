// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>

#include "materials/random_walk.h"
#include "materials/topology.h"

/// @file
/// How far a tree's closures are off what a random walk through it says.
///
///     NACRE_TRY(const FlattenedTree flat, flatten(tree));
///     const LayeringError error = layering_error(flat, RandomWalk(flat), 65536);

namespace nacre::materials {

struct LayeringError {
    /// Cosines of the views that are compared.
    static constexpr std::array<double, 6> cosines{1.0, 0.8, 0.6, 0.4, 0.2, 0.1};

    std::array<glm::dvec3, cosines.size()> closures{};  ///< Directional albedo by directional_albedo().
    std::array<WalkAlbedo, cosines.size()> walk{};
    double mean = 0.0;         ///< Of the differences, over views and channels.
    double largest = 0.0;      ///< Of them.
    double largest_at = 0.0;   ///< Cosine of that view.
    double uncertainty = 0.0;  ///< Largest of the walk's intervals of confidence.
};

/// Compares directional albedos, in the plane of the tangent and the normal, by `paths` for each view; the same for the
/// same arguments.
[[nodiscard]] LayeringError layering_error(const FlattenedTree& tree, const RandomWalk& walk, std::uint32_t paths);

}  // namespace nacre::materials
