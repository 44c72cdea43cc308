// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "passes/profiles.h"
#include "scene/scene.h"

/// @file
/// Punctual lights as shaders read them, and the views from which their shadow maps are drawn.
///
///     LightSetup setup = set_up_lights(scene.lights, bounds, profile);
///     device.write_buffer(buffer, std::span<const std::byte>(light_block(setup, 4, 8)));

namespace nacre::passes {

/// As Light in passes/shared/lighting.glsl.
struct PackedLight {
    glm::vec4 position;   ///< World; w: 1 / range^2, 0 for none.
    glm::vec4 color;      ///< Times intensity; w: 0 directional, 1 point, 2 spot.
    glm::vec4 direction;  ///< In which light travels; w: first shadow view or -1.
    glm::vec4 cone;       ///< Scale and offset of the cosine, width of a shadow texel (at distance 1), 1 for six views.
};

struct LightSetup {
    std::vector<PackedLight> lights;
    std::vector<glm::mat4> shadow_views;  ///< World to clip, depth reversed; a layer of the shadow map each.
    std::uint32_t shadow_map_size = 0;
    std::vector<std::string> warnings;
};

/// Chooses the lights that the profile has room for (the strongest as seen from the middle of the bounds) and shadow
/// views for as many of them as its shadow map has room for, in the order of the scene. A point light takes six views,
/// and so does a spot light wider than 120 degrees, whose cone would stretch a single map too far.
LightSetup set_up_lights(const std::vector<scene::Light>& lights, const scene::Bounds& bounds, const Profile& profile,
                         bool with_shadows);

/// The bytes of LightBlock for lists of the given capacities (at least as many as there are).
std::vector<std::byte> light_block(const LightSetup& setup, std::uint32_t light_capacity,
                                   std::uint32_t shadow_capacity);

/// Length of a list in a shader for a number of entries: the next power of two, so that few shaders differ. 0 stays 0.
std::uint32_t list_capacity(std::size_t entries);

}  // namespace nacre::passes
