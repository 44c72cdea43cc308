// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/error.h"
#include "scene/scene.h"

/// @file
/// Environments: reading one from a picture, and the light that a scene has when its file brings none.
///
///     Expected<Environment> sky = load_environment("studio_small_03_1k.hdr");
///     if (sky) scene.environment = *std::move(sky);
///     glm::vec3 up = environment_direction({0.5f, 0.0f});   // (0, 1, 0)
///
/// All functions are thread-safe.

namespace nacre::scene {

/// Reads an equirectangular .hdr or .exr. Negative and not-a-number texels become 0, infinite ones the largest half
/// float (65,504). Errors: file missing or damaged, a picture larger than 16,384 x 8,192.
[[nodiscard]] Expected<Environment> load_environment(const std::string& path);

/// The light of scenes that have none: a photo studio made by code, 512 x 256 texels. A gray room with a
/// darker floor, one large soft box overhead in front, a key light to the upper left, a weaker and slightly bluish fill
/// to the right and two narrow rim lights behind; none of them where a camera that looks along -Z sees it. Its mean
/// luminance over the sphere is 0.5 cd/m2, so that a white diffuse surface shows about half of full white at exposure
/// 0. The same texels on every machine and call.
[[nodiscard]] Environment studio_environment();

/// World direction (unit) of a point of the picture, before `Environment::rotation`. `uv` is (0, 0) in the upper left
/// corner; the center looks along -Z, u grows towards +X, v = 0 is +Y.
[[nodiscard]] glm::vec3 environment_direction(const glm::vec2& uv);

/// Inverse of environment_direction; `direction` need not be unit.
[[nodiscard]] glm::vec2 environment_uv(const glm::vec3& direction);

}  // namespace nacre::scene
