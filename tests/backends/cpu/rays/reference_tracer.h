// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "rhi/acceleration_structure.h"

/// @file
/// Rays against every triangle of every instance, in double precision: slow, without a tree, and with the distance to
/// all that could tip the balance, so that a test knows which rays it may judge.
///
///     const ReferenceScene scene = random_scene(1);
///     const ReferenceHit hit = closest_hit(scene, ray, [](const ReferenceHit& candidate) { return true; });

namespace nacre::cpu {

struct ReferenceGeometry {
    std::vector<std::array<float, 3>> vertices;
    std::vector<std::array<std::uint32_t, 3>> triangles;
    bool opaque = true;
};
struct ReferenceInstance {
    std::size_t mesh = 0;
    std::array<float, 12> transform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    std::uint32_t custom_index = 0, table_offset = 0;
    std::uint8_t mask = 0xff;
    rhi::InstanceFlags flags = rhi::InstanceFlags::none;
};
struct ReferenceScene {
    std::vector<std::vector<ReferenceGeometry>> meshes;
    std::vector<ReferenceInstance> instances;
};

/// As shaders of the tests read it.
struct ReferenceRay {
    std::array<float, 3> origin{};
    float t_min = 0;
    std::array<float, 3> direction{};
    float t_max = 1e9f;
    std::uint32_t flags = 0, mask = 0xff, reserved[2] = {};
};

struct ReferenceHit {
    double t = std::numeric_limits<double>::infinity();
    double u = 0, v = 0;
    std::uint32_t instance = 0, geometry = 0, primitive = 0;
    bool is_front = false;
    [[nodiscard]] bool exists() const { return t < std::numeric_limits<double>::infinity(); }
};

struct ReferenceAnswer {
    ReferenceHit closest;
    std::vector<ReferenceHit> hits;  ///< All that would count, the closest included, in no order.
    /// How near the ray came to an edge, to an end of its interval, to a triangle seen from the side, or its closest
    /// hit to another. Below about 1e-4 single precision may see it otherwise.
    double margin = std::numeric_limits<double>::infinity();
};

/// @param accepts  what the shader says to a hit that does not count at once
ReferenceAnswer trace(const ReferenceScene& scene, const ReferenceRay& ray,
                      const std::function<bool(const ReferenceHit&)>& accepts);

/// A few meshes of one to three geometries, opaque and not, in instances with all kinds of flags, masks and transforms.
ReferenceScene random_scene(std::uint32_t seed, std::uint32_t instances);
/// From about a scene towards it. Flags are those that a ray may have, at random where `with_flags`.
std::vector<ReferenceRay> random_rays(std::size_t count, std::uint32_t seed, bool with_flags);

}  // namespace nacre::cpu
