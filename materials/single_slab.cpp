// SPDX-License-Identifier: Apache-2.0
#include "materials/single_slab.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

#include "materials/conversions.h"

namespace nacre::materials {
namespace {

float clamp_finite(float value, float low, float high, float fallback) {
    return std::isfinite(value) ? std::clamp(value, low, high) : fallback;
}

glm::vec3 clamp_finite(const glm::vec3& value, float low, float high, float fallback) {
    return {clamp_finite(value.x, low, high, fallback), clamp_finite(value.y, low, high, fallback),
            clamp_finite(value.z, low, high, fallback)};
}

}  // namespace

SingleSlab single_slab(const MaterialDescription& material) {
    SingleSlab slab;
    slab.base_color = clamp_finite(glm::vec3(material.base_color), 0.0f, 1.0f, 1.0f);
    slab.alpha = clamp_finite(material.base_color.a, 0.0f, 1.0f, 1.0f);
    slab.base_color_texture = material.base_color_texture;
    slab.metallic = clamp_finite(material.metallic, 0.0f, 1.0f, 1.0f);
    slab.roughness = clamp_finite(material.roughness, 0.0f, 1.0f, 1.0f);
    slab.metallic_roughness_texture = material.metallic_roughness_texture;

    slab.f0 = glm::vec3(ior_to_f0(std::isfinite(material.ior) ? material.ior : 1.5f));
    if (const auto& specular = material.specular) {
        const float factor = clamp_finite(specular->factor, 0.0f, 1.0f, 1.0f);
        const glm::vec3 tint = clamp_finite(specular->color, 0.0f, 1e4f, 1.0f);
        slab.f0 = glm::min(slab.f0 * tint, glm::vec3(1.0f)) * factor;
        slab.f90 = factor;
        slab.specular_texture = specular->texture;
        slab.specular_color_texture = specular->color_texture;
    }
    if (const auto& glossy = material.specular_glossiness) {
        slab.base_color = clamp_finite(glm::vec3(glossy->diffuse), 0.0f, 1.0f, 1.0f);
        slab.alpha = clamp_finite(glossy->diffuse.a, 0.0f, 1.0f, 1.0f);
        slab.base_color_texture = glossy->diffuse_texture;
        slab.metallic = 0.0f;
        slab.roughness = 1.0f - clamp_finite(glossy->glossiness, 0.0f, 1.0f, 1.0f);
        slab.metallic_roughness_texture = {};
        slab.f0 = clamp_finite(glossy->specular, 0.0f, 1.0f, 1.0f);
        slab.f90 = 1.0f;
        slab.specular_texture = {};
        slab.specular_color_texture = {};
    }

    // The product can overflow although both factors are finite, so it is clamped again.
    const float strength = clamp_finite(material.emissive_strength, 0.0f, 1e30f, 1.0f);
    slab.emission = glm::min(clamp_finite(material.emissive, 0.0f, 1e30f, 0.0f) * strength, glm::vec3(1e30f));
    slab.emission_texture = material.emissive_texture;

    slab.occlusion_texture = material.occlusion_texture;
    slab.occlusion_strength = clamp_finite(material.occlusion_texture.scale, 0.0f, 1.0f, 1.0f);
    slab.normal_texture = material.normal_texture;
    slab.normal_scale = clamp_finite(material.normal_texture.scale, -1e4f, 1e4f, 1.0f);

    slab.alpha_mode = material.alpha_mode;
    slab.alpha_cutoff = clamp_finite(material.alpha_cutoff, 0.0f, 1e4f, 0.5f);
    slab.unlit = material.unlit;
    slab.double_sided = material.double_sided;
    return slab;
}

}  // namespace nacre::materials
