// SPDX-License-Identifier: Apache-2.0
#include "passes/lights.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <numeric>

namespace nacre::passes {
namespace {

using scene::Light;
using scene::LightKind;

/// Rigid transform into a space that looks along -Z; any roll will do.
glm::mat4 look_along(const glm::vec3& eye, const glm::vec3& direction) {
    const glm::vec3 up = std::abs(direction.y) > 0.99f ? glm::vec3(0, 0, 1) : glm::vec3(0, 1, 0);
    return glm::lookAt(eye, eye + direction, up);
}

/// Perspective with reversed depth, from the tangent of the half angle.
glm::mat4 perspective(float tangent, float near_distance, float far_distance) {
    glm::mat4 m(0.0f);
    m[0][0] = 1.0f / tangent;
    m[1][1] = -1.0f / tangent;
    m[2][2] = near_distance / (far_distance - near_distance);
    m[3][2] = near_distance * far_distance / (far_distance - near_distance);
    m[2][3] = -1.0f;
    return m;
}

/// Brightest the light gets in the middle of the scene, to rank lights.
float strength(const Light& light, const glm::vec3& center) {
    const float power = light.intensity * std::max({light.color.r, light.color.g, light.color.b});
    if (light.kind == LightKind::directional) return power;
    const glm::vec3 offset = light.position - center;
    return power / std::max(glm::dot(offset, offset), 1e-4f);
}

float farthest_corner(const scene::Bounds& bounds, const glm::vec3& from) {
    const glm::vec3 away = glm::max(glm::abs(bounds.minimum - from), glm::abs(bounds.maximum - from));
    return glm::length(away);
}

/// Filter taps reach this many texels over the edge of a view.
float margin(const Profile& profile) { return 0.5f * static_cast<float>(profile.shadow_filter_width) + 2.0f; }

glm::mat4 directional_view(const Light& light, const scene::Bounds& bounds, const Profile& profile,
                           float& texel_width) {
    const glm::vec3 center = bounds.center();
    const glm::mat4 view = look_along(center, light.direction);
    const scene::Bounds seen = bounds.transformed(view);
    const float size = static_cast<float>(profile.shadow_map_size);
    const glm::vec3 half = glm::max(0.5f * (seen.maximum - seen.minimum), glm::vec3(1e-4f));
    const glm::vec3 middle = seen.center();
    const float grown = size / std::max(size - 2.0f * margin(profile), 1.0f);
    const float half_x = half.x * grown, half_y = half.y * grown;
    texel_width = 2.0f * std::max(half_x, half_y) / size;
    // Depth: 1 at the caster nearest to the light, 0 at the farthest receiver, with room for offsets at both ends.
    const float room = 0.01f * half.z + 4.0f * texel_width;
    const float near_z = seen.maximum.z + room, far_z = seen.minimum.z - room;
    glm::mat4 m(0.0f);
    m[0][0] = 1.0f / half_x;
    m[3][0] = -middle.x / half_x;
    m[1][1] = -1.0f / half_y;
    m[3][1] = middle.y / half_y;
    m[2][2] = 1.0f / (near_z - far_z);
    m[3][2] = -far_z / (near_z - far_z);
    m[3][3] = 1.0f;
    return m * view;
}

}  // namespace

std::uint32_t list_capacity(std::size_t entries) {
    return entries == 0 ? 0 : static_cast<std::uint32_t>(std::bit_ceil(entries));
}

LightSetup set_up_lights(const std::vector<Light>& lights, const scene::Bounds& bounds, const Profile& profile,
                         bool with_shadows) {
    LightSetup setup;
    setup.shadow_map_size = profile.shadow_map_size;
    const glm::vec3 center = bounds.empty() ? glm::vec3(0.0f) : bounds.center();
    std::vector<std::size_t> chosen(lights.size());
    std::iota(chosen.begin(), chosen.end(), std::size_t{0});
    std::erase_if(chosen, [&](std::size_t i) { return !(strength(lights[i], center) > 0.0f); });
    if (chosen.size() > profile.lights) {
        setup.warnings.push_back(
            fmt::format("the scene has {} lights, profile '{}' has room for {}: the weakest are left out",
                        chosen.size(), profile.name, profile.lights));
        std::ranges::stable_sort(chosen, std::greater<>{}, [&](std::size_t i) { return strength(lights[i], center); });
        chosen.resize(profile.lights);
        std::ranges::sort(chosen);
    }

    std::size_t without_shadow = 0;
    for (const std::size_t index : chosen) {
        const Light& light = lights[index];
        PackedLight packed{};
        const bool has_range = std::isfinite(light.range) && light.range > 0.0f;
        packed.position = glm::vec4(light.position, has_range ? 1.0f / (light.range * light.range) : 0.0f);
        const float kind = light.kind == LightKind::directional ? 0.0f : (light.kind == LightKind::point ? 1.0f : 2.0f);
        packed.color = glm::vec4(light.color * light.intensity, kind);
        packed.direction = glm::vec4(light.direction, -1.0f);
        if (light.kind == LightKind::spot) {
            const float cos_outer = std::cos(light.outer_cone_angle);
            packed.cone.x = 1.0f / std::max(std::cos(light.inner_cone_angle) - cos_outer, 1e-3f);
            packed.cone.y = -cos_outer * packed.cone.x;
        }

        if (with_shadows && light.casts_shadows && !bounds.empty()) {
            const bool six = light.kind == LightKind::point ||
                             (light.kind == LightKind::spot && light.outer_cone_angle > glm::radians(60.0f));
            const std::size_t needed = six ? 6 : 1;
            if (setup.shadow_views.size() + needed > profile.shadow_views) {
                ++without_shadow;
                setup.lights.push_back(packed);
                continue;
            }
            packed.direction.w = static_cast<float>(setup.shadow_views.size());
            const float size = static_cast<float>(profile.shadow_map_size);
            if (light.kind == LightKind::directional) {
                setup.shadow_views.push_back(directional_view(light, bounds, profile, packed.cone.z));
            } else {
                float far_distance = std::max(farthest_corner(bounds, light.position) * 1.01f, 1e-3f);
                if (has_range) far_distance = std::min(far_distance, light.range);
                const float near_distance = far_distance * 2e-3f;
                const float tangent = six ? 1.0f : std::tan(light.outer_cone_angle);
                const float grown = tangent * size / std::max(size - 2.0f * margin(profile), 1.0f);
                packed.cone.z = 2.0f * grown / size;
                const glm::mat4 projection = perspective(grown, near_distance, far_distance);
                if (six) {
                    packed.cone.w = 1.0f;
                    constexpr glm::vec3 axes[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
                    for (const glm::vec3& axis : axes) {
                        setup.shadow_views.push_back(projection * look_along(light.position, axis));
                    }
                } else {
                    setup.shadow_views.push_back(projection * look_along(light.position, light.direction));
                }
            }
        }
        setup.lights.push_back(packed);
    }
    if (without_shadow > 0) {
        setup.warnings.push_back(fmt::format("{} lights cast no shadow: profile '{}' has room for {} shadow views",
                                             without_shadow, profile.name, profile.shadow_views));
    }
    return setup;
}

std::vector<std::byte> light_block(const LightSetup& setup, std::uint32_t light_capacity,
                                   std::uint32_t shadow_capacity) {
    std::vector<std::byte> bytes(16 + light_capacity * sizeof(PackedLight) + shadow_capacity * sizeof(glm::mat4));
    const std::uint32_t counts[4] = {static_cast<std::uint32_t>(setup.lights.size()),
                                     static_cast<std::uint32_t>(setup.shadow_views.size()), 0, 0};
    std::memcpy(bytes.data(), counts, sizeof(counts));
    if (!setup.lights.empty()) {
        std::memcpy(bytes.data() + 16, setup.lights.data(), setup.lights.size() * sizeof(PackedLight));
    }
    if (!setup.shadow_views.empty()) {
        std::memcpy(bytes.data() + 16 + light_capacity * sizeof(PackedLight), setup.shadow_views.data(),
                    setup.shadow_views.size() * sizeof(glm::mat4));
    }
    return bytes;
}

}  // namespace nacre::passes
