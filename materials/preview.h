// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/image.h"
#include "materials/random_walk.h"
#include "materials/topology.h"

/// @file
/// A look at a material without a device: a lit ball, shaded on the host in double precision, by closures or by walks.
///
///     NACRE_CHECK(write_png("gold.png", preview_ball(flat, 128)));

namespace nacre::materials {

/// A ball of 0.1 m under a sky with a soft box, seen from far away; linear, RGB, tone mapped to [0, 1] by x / (1 + x /
/// 4). The same for the same tree on every machine. Uses all threads. `strata`^2 samples for each closure and pixel: 6
/// are enough for the eye, 16 for comparing with walked_ball().
[[nodiscard]] Image preview_ball(const FlattenedTree& tree, std::uint32_t size, int strata = 6);

/// The same ball by random walks instead of closures, without emission. `paths` for each view: 4096 leave noise that
/// FLIP counts as about 0.01, 16384 half of that. Stacks that look the same from every azimuth take a few seconds,
/// since all pixels seen at one angle share their paths; others walk for each pixel, with a sixteenth of the paths.
[[nodiscard]] Image walked_ball(const RandomWalk& walk, std::uint32_t size, std::uint32_t paths);

/// Radiance of the preview's sky, W/sr/m2. `direction`: unit, y up, z towards the viewer.
[[nodiscard]] glm::dvec3 preview_sky(const glm::dvec3& direction);

}  // namespace nacre::materials
