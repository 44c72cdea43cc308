// SPDX-License-Identifier: Apache-2.0
#include "materials/slab.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace nacre::materials {
namespace {

constexpr std::array<SlabFeature, 11> features = {{
    {slab_anisotropy, "anisotropy", "NACRE_SLAB_ANISOTROPY"},
    {slab_f90, "f90", "NACRE_SLAB_F90"},
    {slab_f82, "f82", "NACRE_SLAB_F82"},
    {slab_second_lobe, "second_lobe", "NACRE_SLAB_SECOND_LOBE"},
    {slab_fuzz, "fuzz", "NACRE_SLAB_FUZZ"},
    {slab_thin_film, "thin_film", "NACRE_SLAB_THIN_FILM"},
    {slab_specular_lut, "specular_lut", "NACRE_SLAB_SPECULAR_LUT"},
    {slab_glints, "glints", "NACRE_SLAB_GLINTS"},
    {slab_medium, "medium", "NACRE_SLAB_MEDIUM"},
    {slab_emission, "emission", "NACRE_SLAB_EMISSION"},
    {slab_edge_coverage, "edge_coverage", "NACRE_SLAB_EDGE_COVERAGE"},
}};

constexpr float largest_length = 1e12f;  // meters; stands for infinity where two lengths are divided
constexpr float largest_radiance = 1e30f;

float in_range(float value, float low, float high, float fallback) {
    return std::isfinite(value) ? std::clamp(value, low, high) : fallback;
}

glm::vec3 in_range(const glm::vec3& value, float low, float high, const glm::vec3& fallback) {
    return {in_range(value.x, low, high, fallback.x), in_range(value.y, low, high, fallback.y),
            in_range(value.z, low, high, fallback.z)};
}

float length_in_range(float value, float fallback) {
    return std::isnan(value) ? fallback : std::clamp(value, 0.0f, largest_length);
}

}  // namespace

std::span<const SlabFeature> slab_features() { return features; }

Slab clamped(const Slab& slab) {
    const Slab fallback;
    Slab result = slab;
    const auto unit = [&](auto Slab::*field) { result.*field = in_range(slab.*field, 0.0f, 1.0f, fallback.*field); };
    unit(&Slab::coverage);
    unit(&Slab::f0);
    unit(&Slab::roughness);
    unit(&Slab::albedo);
    unit(&Slab::f90);
    unit(&Slab::specular_weight);
    unit(&Slab::f82);
    unit(&Slab::second_roughness);
    unit(&Slab::second_weight);
    unit(&Slab::fuzz_amount);
    unit(&Slab::fuzz_roughness);
    unit(&Slab::fuzz_color);
    unit(&Slab::edge_coverage);
    result.anisotropy = in_range(slab.anisotropy, -1.0f, 1.0f, fallback.anisotropy);
    result.film_thickness = in_range(slab.film_thickness, 0.0f, 1e-3f, fallback.film_thickness);
    result.film_ior = in_range(slab.film_ior, 1.0f, 10.0f, fallback.film_ior);
    result.glint_density = in_range(slab.glint_density, 1e-6f, 1e18f, fallback.glint_density);
    for (int axis = 0; axis < 2; ++axis) {
        const auto finite = [&](glm::vec2 Slab::*field) {
            (result.*field)[axis] = in_range((slab.*field)[axis], -1e6f, 1e6f, 0.0f);
        };
        finite(&Slab::glint_position);
        finite(&Slab::glint_dx);
        finite(&Slab::glint_dy);
    }
    for (int channel = 0; channel < 3; ++channel)
        result.mean_free_path[channel] =
            length_in_range(slab.mean_free_path[channel], fallback.mean_free_path[channel]);
    result.phase_anisotropy = in_range(slab.phase_anisotropy, -0.999f, 0.999f, fallback.phase_anisotropy);
    result.thickness = length_in_range(slab.thickness, fallback.thickness);
    result.emission = in_range(slab.emission, 0.0f, largest_radiance, fallback.emission);
    result.edge_exponent = in_range(slab.edge_exponent, 1e-3f, 1e3f, fallback.edge_exponent);
    return result;
}

}  // namespace nacre::materials
