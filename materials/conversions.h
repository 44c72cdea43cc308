// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec3.hpp>

#include "materials/slab.h"

/// @file
/// What authors think in, turned into inputs of slabs, and back where that is possible. The same functions are there
/// for generated patterns in GLSL, from the same text: materials/closures/conversions.glsl names the files.
///
///     Slab water{.f0 = glm::vec3(ior_to_f0(1.33f)), .roughness = 0.0f, .albedo = glm::vec3(0.0f)};
///     water.features = slab_medium;
///     water.mean_free_path = transmittance_to_mean_free_path({0.7f, 0.9f, 0.95f}, 1.0f);  // through a meter
///
/// Pure functions, safe on any thread. Values out of range are clamped; what is not finite counts as the nearest value
/// that is, or as 0 where there is none.

namespace nacre::materials {

/// Reflectance at normal incidence of a dielectric in air, [0, 1], by its index of refraction: at least 1, or 0, which
/// stands for infinity as in glTF. Fresnel's equations.
[[nodiscard]] float ior_to_f0(float ior);

/// Back: an index of at least 1. Reflectances above 0.98 count as 0.98 (an index of 199).
[[nodiscard]] float f0_to_ior(float f0);

/// Mean free path in meters of a medium that lets `transmittance` (each channel in [0, 1]) through `distance` meters:
/// -distance / ln(transmittance), by Beer and Lambert. 0 where nothing gets through, infinity where everything does.
[[nodiscard]] glm::vec3 transmittance_to_mean_free_path(const glm::vec3& transmittance, float distance);

/// Back: what a medium lets straight through `distance` meters, [0, 1].
[[nodiscard]] glm::vec3 mean_free_path_to_transmittance(const glm::vec3& mean_free_path, float distance);

/// The albedo that a slab must have so that each scattering in its medium keeps `single` of the light (each channel in
/// [0, 1]) under an interface of reflectance `f0`, with the phase anisotropy that the slab has, (-1, 1). Source: van de
/// Hulst 1980; light that the interface throws back scatters again.
[[nodiscard]] glm::vec3 scattering_to_albedo(const glm::vec3& single, float phase_anisotropy,
                                             const glm::vec3& f0 = glm::vec3(0.04f));

/// Inputs of one slab that stands for matter of two kinds.
struct AlbedoAndF0 {
    glm::vec3 albedo;
    glm::vec3 f0;
};

/// A dielectric with albedo `base_color` beside a metal with F0 `base_color` on `metalness` of the surface, in one
/// slab: it reflects what both would, at every angle. Interpolating metalness in the usual way (albedo = base_color *
/// (1 - metalness)) loses up to half of the light in between, which shows as a dark halo where metal meets dielectric.
/// Where both sides differ in base color as well, convert each side first: albedo and F0 may be filtered and
/// interpolated.
[[nodiscard]] AlbedoAndF0 metalness_to_albedo_f0(const glm::vec3& base_color, float metalness,
                                                 const glm::vec3& dielectric_f0 = glm::vec3(0.04f));

/// Gives `slab` a second lobe (slab_second_lobe) that makes it hazy by `haziness`, [0, 1], while the peak of the core
/// stays as bright as it is. `extent`: how much wider the haze is than the core, >= 0 (the second lobe's alpha is that
/// of the core times 1 + extent). F0 rises by what the haze adds. Source: Barla et al. 2018; colors are followed by
/// their largest channel.
void add_haze(Slab& slab, float haziness, float extent);

/// Roughness and anisotropy (Kulla and Conty's) of a slab.
struct StretchedRoughness {
    float roughness;
    float anisotropy;
};

/// By the GGX alphas along the tangent and along the bitangent, each in [0, 1].
[[nodiscard]] StretchedRoughness alphas_to_roughness(float along, float across);

/// Unit tangent in the surface's frame (x: tangent, y: bitangent) that is turned by `rotation` radians,
/// counter-clockwise.
[[nodiscard]] glm::vec3 rotation_to_tangent(float rotation);

/// Back, in (-pi, pi]; 0 for the normal.
[[nodiscard]] float tangent_to_rotation(const glm::vec3& tangent);

/// Color by view angle: `facing` along the normal, `grazing` along the surface, between them by (1 - cosine)^exponent.
/// exponent > 0; 5 is that of Schlick's Fresnel.
[[nodiscard]] glm::vec3 flip_flop(const glm::vec3& facing, const glm::vec3& grazing, float exponent, float cosine);

/// Coverage by view angle, as slab_edge_coverage computes it: both coverages in [0, 1].
[[nodiscard]] float view_dependent_coverage(float facing, float grazing, float exponent, float cosine);

/// Reflectance of an interface under a thin film at normal and at grazing incidence.
struct FilmColors {
    glm::vec3 f0;
    glm::vec3 f90;
};

/// A film of `thickness` meters and index `film_ior` (>= 1) on an interface of reflectance `f0`, as Schlick's curve
/// through its reflectance at `cosine` to the (micro)normal. For slabs that have the colors of a film without
/// slab_thin_film, which computes this for each view. Source: Belcour and Barla 2017.
[[nodiscard]] FilmColors thin_film_colors(const glm::vec3& f0, float thickness, float film_ior, float cosine = 1.0f);

}  // namespace nacre::materials
