// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "materials/description.h"

/// @file
/// What is shaded of a material when one slab is all there is: a base of diffuse or metal under one GGX interface,
/// plus emission. This function is the only place where a `MaterialDescription` turns into shading inputs.
///
///     SingleSlab slab = single_slab(scene.materials[primitive.material]);
///     if (slab.alpha_mode == AlphaMode::blend) draw_in_blend_pass();
///     float alpha_ggx = slab.roughness * slab.roughness;
///
/// Thread-safe: a pure function.

namespace nacre::materials {

/// One slab. A texture multiplies the factor that it belongs to; an absent one counts as 1.
struct SingleSlab {
    glm::vec3 base_color{1.0f};           ///< Linear, [0, 1]: albedo of the diffuse base, F0 of the metal.
    float alpha = 1.0f;                   ///< Coverage or mask value, [0, 1].
    TextureReference base_color_texture;  ///< rgb: base_color, a: alpha.

    float metallic = 0.0f;                        ///< [0, 1].
    float roughness = 1.0f;                       ///< Perceptual, [0, 1]; GGX alpha is its square.
    TextureReference metallic_roughness_texture;  ///< g: roughness, b: metallic.

    glm::vec3 f0{
        0.04f};        ///< Reflectance of the dielectric interface at normal incidence, [0, 1], times the tints below.
    float f90 = 1.0f;  ///< Reflectance of the dielectric interface at grazing incidence; metal has 1.
    TextureReference specular_texture;        ///< a: scales f0 and f90.
    TextureReference specular_color_texture;  ///< rgb: scales f0.

    glm::vec3 emission{0.0f};           ///< cd/m2, finite, >= 0; emissive_strength is multiplied in.
    TextureReference emission_texture;  ///< rgb.

    float occlusion_strength = 1.0f;     ///< [0, 1]: occlusion = 1 + strength * (texel.r - 1).
    TextureReference occlusion_texture;  ///< r.
    float normal_scale = 1.0f;           ///< Scale of x and y of the normal map before normalizing.
    TextureReference normal_texture;     ///< rgb.

    AlphaMode alpha_mode = AlphaMode::opaque;
    float alpha_cutoff = 0.5f;  ///< For AlphaMode::mask.
    bool unlit = false;         ///< Show base_color (times texture and vertex color) as it is.
    bool double_sided = false;  ///< Both faces are drawn; the normal is flipped on back faces.
};

/// Maps a description to the slab that is shaded. Values out of range are clamped: colors, metallic, roughness and
/// alpha to [0, 1], emission to [0, 1e30]; anything not finite becomes its default.
///
/// F0 of the dielectric: ((ior - 1) / (ior + 1))^2 (1 when ior is 0) times specular color (clamped to 1) times specular
/// factor; F90: specular factor (KHR_materials_ior, KHR_materials_specular). Specular-glossiness becomes a dielectric
/// with F0 = specular and roughness = 1 - glossiness; its specular texture is not used. Coat, sheen, film, anisotropy,
/// transmission and volume do not exist on a single slab and leave no trace.
[[nodiscard]] SingleSlab single_slab(const MaterialDescription& material);

}  // namespace nacre::materials
