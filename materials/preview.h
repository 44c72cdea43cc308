// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/image.h"
#include "materials/topology.h"

/// @file
/// A look at a material without a device: a lit ball, shaded on the host in double precision.
///
///     NACRE_CHECK(write_png("gold.png", preview_ball(flat, 128)));

namespace nacre::materials {

/// A ball of 0.1 m under a sky with a soft box, seen from far away; linear, RGB, tone mapped to [0, 1] by x / (1 + x /
/// 4). The same for the same tree on every machine. Uses all threads.
[[nodiscard]] Image preview_ball(const FlattenedTree& tree, std::uint32_t size);

/// Radiance of the preview's sky, W/sr/m2. `direction`: unit, y up, z towards the viewer.
[[nodiscard]] glm::dvec3 preview_sky(const glm::dvec3& direction);

}  // namespace nacre::materials
