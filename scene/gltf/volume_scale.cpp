// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/volume_scale.h"

#include <algorithm>
#include <cmath>
#include <glm/mat3x3.hpp>
#include <map>
#include <set>
#include <utility>

namespace nacre::scene::gltf {
namespace {

float scale_of(const Instance& instance) {
    if (instance.transforms.empty()) return 1.0f;
    const double volume = std::abs(glm::determinant(glm::dmat3(instance.transforms.front())));
    const auto scale = static_cast<float>(std::cbrt(volume));
    // What is flat or not a number stays as it is, and so does what is scaled by rounding alone.
    return std::isfinite(scale) && scale > 0.0f && std::abs(scale - 1.0f) > 1e-4f ? scale : 1.0f;
}

}  // namespace

void scale_volumes(Scene& scene) {
    const auto has_volume = [&](std::uint32_t material) {
        const auto& volume = scene.materials[material].volume;
        return volume && volume->thickness > 0.0f;
    };
    std::map<std::uint32_t, std::set<float>> scales;
    for (const Instance& instance : scene.instances) scales[instance.mesh].insert(scale_of(instance));

    std::map<std::pair<std::uint32_t, float>, std::uint32_t> meshes, materials;
    const auto scaled_material = [&](std::uint32_t material, float scale) {
        const auto next = static_cast<std::uint32_t>(scene.materials.size());
        const auto [known, is_new] = materials.try_emplace({material, scale}, next);
        if (is_new) {
            nacre::materials::MaterialDescription scaled = scene.materials[material];
            scaled.volume->thickness *= scale;
            scene.materials.push_back(std::move(scaled));
        }
        return known->second;
    };
    for (Instance& instance : scene.instances) {
        const float scale = scale_of(instance);
        if (scale == 1.0f) continue;
        const std::uint32_t original = instance.mesh;
        if (const auto known = meshes.find({original, scale}); known != meshes.end()) {
            instance.mesh = known->second;
            continue;
        }
        if (std::ranges::none_of(scene.meshes[original].primitives, has_volume, &Primitive::material)) continue;
        if (scales[original].size() > 1) {
            instance.mesh = static_cast<std::uint32_t>(scene.meshes.size());
            Mesh copy = scene.meshes[original];
            scene.meshes.push_back(std::move(copy));
        }
        meshes[{original, scale}] = instance.mesh;
        for (Primitive& primitive : scene.meshes[instance.mesh].primitives) {
            if (has_volume(primitive.material)) primitive.material = scaled_material(primitive.material, scale);
        }
    }
}

}  // namespace nacre::scene::gltf
