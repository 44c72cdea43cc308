// SPDX-License-Identifier: Apache-2.0
#include "materials/conversions.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "materials/closures/library.h"
#include "materials/limited.h"

namespace nacre::materials {
namespace {

using closures::Library;

closures::Lobes lobes;  // stateless


}  // namespace

float ior_to_f0(float ior) {
    // From 1e4 on floats cannot tell the reflectance from 1.
    const float index = ior == 0.0f ? 0.0f : limited(ior, 1.0f, 1e9f);
    return static_cast<float>(lobes.ior_to_reflectance(index));
}

float f0_to_ior(float f0) { return static_cast<float>(lobes.reflectance_to_ior(limited(f0, 0.0f, 1.0f))); }

glm::vec3 transmittance_to_mean_free_path(const glm::vec3& transmittance, float distance) {
    const glm::vec3 through = unit(transmittance);
    glm::vec3 result;
    for (int channel = 0; channel < 3; ++channel) {
        const double length = lobes.transmittance_to_mean_free_path(through[channel], limited(distance, 0.0f, 1e12f));
        const bool is_clear = through[channel] >= 1.0f || std::isinf(distance) || length >= Library::longest_length;
        result[channel] = is_clear ? std::numeric_limits<float>::infinity() : static_cast<float>(length);
    }
    return result;
}

glm::vec3 mean_free_path_to_transmittance(const glm::vec3& mean_free_path, float distance) {
    glm::vec3 result;
    for (int channel = 0; channel < 3; ++channel) {
        const float length = mean_free_path[channel];
        result[channel] = std::isinf(length) ? 1.0f
                                             : static_cast<float>(lobes.medium_transmittance(
                                                   limited(length, 0.0f, 1e12f), limited(distance, 0.0f, 1e12f)));
    }
    return result;
}

glm::vec3 scattering_to_albedo(const glm::vec3& single, float phase_anisotropy, const glm::vec3& f0) {
    Library library;
    Library::Slab slab = Library::slab_of({});
    slab.f0 = unit(f0);
    const glm::dvec3 leaving = library.internal_transmittance(slab);
    glm::vec3 result;
    for (int channel = 0; channel < 3; ++channel) {
        const double own =
            library.albedo_of_scattering(unit(single)[channel], limited(phase_anisotropy, -0.999f, 0.999f));
        result[channel] = static_cast<float>(library.albedo_under_interface(own, leaving[channel]));
    }
    return unit(result);
}

AlbedoAndF0 metalness_to_albedo_f0(const glm::vec3& base_color, float metalness, const glm::vec3& dielectric_f0) {
    const auto both =
        lobes.metalness_to_albedo_f0(unit(base_color), limited(metalness, 0.0f, 1.0f), unit(dielectric_f0));
    return {both.albedo, both.f0};
}

void add_haze(Slab& slab, float haziness, float extent) {
    slab.features |= slab_second_lobe;
    const float brightest = std::max({slab.f0.x, slab.f0.y, slab.f0.z});
    const auto haze =
        lobes.make_haze(brightest, slab.roughness, limited(haziness, 0.0f, 1.0f), limited(extent, 0.0f, 1e9f));
    if (brightest > 0.0f) slab.f0 = unit(slab.f0 * static_cast<float>(haze.f0 / brightest));
    slab.second_roughness = static_cast<float>(haze.second_roughness);
    slab.second_weight = static_cast<float>(haze.second_weight);
}

StretchedRoughness alphas_to_roughness(float along, float across) {
    const float a = limited(along, 0.0f, 1.0f), b = limited(across, 0.0f, 1.0f);
    return {std::sqrt(0.5f * (a + b)), a + b > 0.0f ? (a - b) / (a + b) : 0.0f};
}

glm::vec3 rotation_to_tangent(float rotation) {
    return lobes.rotation_to_tangent(std::isfinite(rotation) ? rotation : 0.0f);
}

float tangent_to_rotation(const glm::vec3& tangent) { return static_cast<float>(lobes.tangent_to_rotation(tangent)); }

glm::vec3 flip_flop(const glm::vec3& facing, const glm::vec3& grazing, float exponent, float cosine) {
    return lobes.flip_flop(facing, grazing, limited(exponent, 1e-3f, 1e3f), limited(cosine, 0.0f, 1.0f));
}

float view_dependent_coverage(float facing, float grazing, float exponent, float cosine) {
    return static_cast<float>(lobes.view_dependent_coverage(limited(facing, 0.0f, 1.0f), limited(grazing, 0.0f, 1.0f),
                                                            limited(exponent, 1e-3f, 1e3f),
                                                            limited(cosine, 0.0f, 1.0f)));
}

FilmColors thin_film_colors(const glm::vec3& f0, float thickness, float film_ior, float cosine) {
    const auto bare = lobes.make_fresnel(unit(f0), glm::dvec3(1.0), glm::dvec3(1.0));
    const auto film = lobes.make_film_fresnel(bare, limited(thickness, 0.0f, 1e-3f), limited(film_ior, 1.0f, 10.0f),
                                              limited(cosine, 0.0f, 1.0f));
    return {film.normal, film.grazing};
}

}  // namespace nacre::materials
