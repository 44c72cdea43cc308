// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>

#include "core/embedded_file.h"

/// @file
/// A slab: the one kind of matter that materials are made of, an interface over a medium of some thickness. Plain data.
///
///     Slab gold{.f0 = {1.00f, 0.77f, 0.34f}, .roughness = 0.2f, .albedo = glm::vec3(0.0f)};
///     Slab jade{.f0 = glm::vec3(0.05f), .roughness = 0.1f, .albedo = {0.3f, 0.7f, 0.4f}};
///     jade.features = slab_medium;
///     jade.mean_free_path = {0.002f, 0.004f, 0.002f};
///
/// Features are opt-in: a field that belongs to a feature counts only where its bit is set in `features`, and costs
/// nothing where it is not. Colors are linear with sRGB primaries; lengths are meters. Shaded by
/// materials/closures/closure.glsl, where the same struct stands in GLSL. docs/materials.md has the formulae.

namespace nacre::materials {

using uint = std::uint32_t;
#include "materials/closures/features.glsl"

/// See the top of this file. The defaults are a white, fairly rough dielectric of index 1.5 that covers everything.
struct Slab {
    /// Sum of slab_anisotropy, slab_f90, ... (materials/closures/features.glsl).
    std::uint32_t features = 0;

    /// Share of the surface where this matter is, [0, 1]. Not its transparency: that is the medium's transmittance.
    float coverage = 1.0f;

    /// Reflectance of the interface at normal incidence, [0, 1]. Below 0.02 (no matter reflects less, unless its index
    /// is near that of its surroundings) the grazing reflectance fades too, so that 0 is no interface at all.
    glm::vec3 f0{0.04f};
    /// Perceptual, [0, 1]: GGX alpha is its square. Below 0.01 the lobe is a mirror. Also shapes the diffuse
    /// reflection.
    float roughness = 0.5f;
    /// Reflectance of the medium after all its scattering, at any angle, as if it were infinitely thick: [0, 1].
    glm::vec3 albedo{1.0f};

    /// slab_anisotropy. [-1, 1]; alpha is roughness^2 (1 + anisotropy) along the tangent and roughness^2 (1 -
    /// anisotropy) along the bitangent (Kulla and Conty 2017).
    float anisotropy = 0.0f;

    /// slab_f90. Color of the reflection at grazing incidence, [0, 1]. Only its color counts: it is scaled until its
    /// largest channel is 1, so that it never takes energy away. Black counts as white.
    glm::vec3 f90{1.0f};
    /// slab_f90. What the interface reflects at every angle is scaled by this, [0, 1]; the medium gets the rest.
    /// (KHR_materials_specular has it as the specular factor, which scales F0 and is F90.)
    float specular_weight = 1.0f;
    /// slab_f82. Reflectance at 82 degrees relative to what Schlick's formula gives there, [0, 1]; 1 changes nothing.
    /// Below 0.01, and where the reflectance would turn negative at some angle (on dark interfaces), it is limited.
    glm::vec3 f82{1.0f};

    /// slab_second_lobe. Perceptual roughness of a second GGX lobe with the same reflectance, [0, 1].
    float second_roughness = 0.7f;
    /// slab_second_lobe. Its share, [0, 1]; the first lobe has the rest. materials/closures/haze.glsl gives both from a
    /// perceptual haze.
    float second_weight = 0.0f;

    /// slab_fuzz. Coverage of the fibers that stand on the interface, [0, 1].
    float fuzz_amount = 0.0f;
    /// slab_fuzz. Perceptual, [0, 1]; 1 is dust-like, less is velvet.
    float fuzz_roughness = 0.5f;
    /// slab_fuzz. Reflectance of the fibers, [0, 1].
    glm::vec3 fuzz_color{1.0f};

    /// slab_thin_film. Meters, >= 0; visible colors between 1e-7 and 1e-6, none at 0.
    float film_thickness = 0.0f;
    /// slab_thin_film. Index of refraction of the film, >= 1.
    float film_ior = 1.4f;

    /// slab_specular_lut. Which of the tints by view and light angle that the renderer holds multiplies the specular
    /// lobes.
    std::uint32_t specular_lut = 0;

    /// slab_glints. Microfacets per unit square of `glint_position`, > 0; infinitely many are the smooth lobe.
    float glint_density = 1e6f;
    /// slab_glints. Where on the surface, in texture coordinates of the pattern's own.
    glm::vec2 glint_position{0.0f};
    glm::vec2 glint_dx{0.0f};  ///< slab_glints. Change of `glint_position` to the next pixel in x.
    glm::vec2 glint_dy{0.0f};  ///< slab_glints. Change of `glint_position` to the next pixel in y.

    /// slab_medium. Meters that light travels between two events (scattering or absorption), per channel; any value >=
    /// 0, 0 is opaque and infinity is empty. The scale input of an authored mean free path is multiplied in.
    glm::vec3 mean_free_path{0.0f};
    /// slab_medium. Mean cosine of the scattering angle, (-1, 1): 0 isotropic, > 0 forward.
    float phase_anisotropy = 0.0f;
    /// slab_medium. Meters along the normal, >= 0. Infinity: the slab has no far side (a solid seen from outside).
    float thickness = 1e-3f;

    /// slab_emission. Radiance that leaves the slab in all directions, cd/m2, >= 0.
    glm::vec3 emission{0.0f};

    /// slab_edge_coverage. Coverage at grazing view, [0, 1]; `coverage` is that at normal view.
    float edge_coverage = 1.0f;
    /// slab_edge_coverage. Exponent of 1 - cosine between the two, > 0; 5 is that of Schlick's Fresnel.
    float edge_exponent = 5.0f;

    /// Where two solids overlap, that with the higher priority is there. For whoever follows rays; closures do not use
    /// it.
    std::int32_t priority = 0;

    bool operator==(const Slab&) const = default;
};

/// A feature and the macro that its GLSL stands under.
struct SlabFeature {
    std::uint32_t bit;
    const char* name;   ///< "anisotropy"
    const char* macro;  ///< "NACRE_SLAB_ANISOTROPY"; a shader defines it where a slab in it may have the feature.
};

/// All features, by rising bit.
[[nodiscard]] std::span<const SlabFeature> slab_features();

/// The same slab with every field in its range; what is not finite becomes the default (infinite lengths stay).
/// Nothing shades differently for a slab that was in range.
[[nodiscard]] Slab clamped(const Slab& slab);

/// GLSL of the closures, for `ShaderCompilerDesc::embedded`: "materials/closures/closure.glsl" and what it includes.
[[nodiscard]] std::span<const EmbeddedFile> embedded_files();

}  // namespace nacre::materials
