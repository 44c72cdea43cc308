// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "materials/closures/lobes.h"
#include "materials/tables/interface_table.h"

/// @file
/// Directional albedos in double precision, by quadrature: what fills materials/tables/interface_table.h. Used by the
/// program that writes the table and by the tests that compare with it.
///
///     GgxAlbedo rough = ggx_albedo({std::sqrt(1 - mu * mu), 0.0, mu}, {0.3, 0.3}, 128);

namespace nacre::materials {

/// Of one GGX lobe with single scattering; see ggx_albedo().
struct GgxAlbedo {
    double total = 0.0;    ///< With F = 1.
    double schlick = 0.0;  ///< With F = (1 - c)^5.
    double dip = 0.0;      ///< With F = c (1 - c)^6.
};

/// @param view    unit, z >= 0 the normal
/// @param alpha   along x and y
/// @param strata  samples are strata^2; 256 gives five digits
inline GgxAlbedo ggx_albedo(glm::dvec3 view, glm::dvec2 alpha, int strata) {
    closures::Lobes lobes;
    const double view_length = lobes.ggx_stretched_length(view, alpha);
    GgxAlbedo albedo;
    for (int i = 0; i < strata; ++i) {
        // Strata crowd at both ends: the rim of the cap holds the few strongly tilted microfacets.
        const double s = (i + 0.5) / strata;
        const double radial = s * s * s * (s * (6.0 * s - 15.0) + 10.0);
        const double density = 30.0 * s * s * (s - 1.0) * (s - 1.0);
        for (int j = 0; j < strata; ++j) {
            const glm::dvec3 h = lobes.ggx_sample_normal(view, view_length, alpha, (j + 0.5) / strata, radial);
            const double cosine = glm::dot(view, h);
            const double weight = density * lobes.ggx_weight(view, view_length, 2.0 * cosine * h - view, alpha);
            const double m = 1.0 - std::min(cosine, 1.0);
            albedo.total += weight;
            albedo.schlick += weight * lobes.power5(m);
            albedo.dip += weight * cosine * lobes.power6(m);
        }
    }
    const double samples = static_cast<double>(strata) * strata;
    return {albedo.total / samples, albedo.schlick / samples, albedo.dip / samples};
}

/// Share of white light from everywhere that a lobe sends towards one direction: integral of `value(light)`, which
/// includes the cosine to the light, over the hemisphere. For smooth lobes only; 128 strata give five digits of Chan's.
template <typename Value>
double hemisphere_integral(int strata, Value&& value) {
    double sum = 0.0;
    for (int i = 0; i < strata; ++i) {
        // The cosine is s^2: lobes change fastest at grazing angles.
        const double s = (i + 0.5) / strata;
        const double cosine = s * s, sine = std::sqrt(1.0 - cosine * cosine);
        for (int j = 0; j < 2 * strata; ++j) {
            const double phi = std::numbers::pi * (j + 0.5) / strata;
            sum += 2.0 * s * value(glm::dvec3(sine * std::cos(phi), sine * std::sin(phi), cosine));
        }
    }
    return sum * std::numbers::pi / (static_cast<double>(strata) * strata);
}

/// The retro-reflective term of Chan's diffuse model, before its amplitude.
inline double chan_retro_albedo(double cosine, double sharpness, int strata) {
    closures::Lobes lobes;
    const glm::dvec3 view(std::sqrt(1.0 - cosine * cosine), 0.0, cosine);
    return hemisphere_integral(strata, [&](glm::dvec3 light) {
        return lobes.chan_retro(lobes.half_vector_cosine(view, light), lobes.half_vector(view, light).z, sharpness) *
               light.z / std::numbers::pi;
    });
}

/// The entry of interface_table(), four numbers in [0, 1]. The table was written with 256 strata.
inline std::array<double, 4> interface_table_entry(std::uint32_t row, std::uint32_t column, int strata) {
    closures::Lobes lobes;
    const double at_column = column / (interface_table_columns - 1.0), at_row = row / (interface_table_rows - 1.0);
    // At the ends the entries are limits: of a mirror, and of a view along the surface.
    const double roughness = std::max(at_row, 2e-3), alpha = roughness * roughness;
    const double cosine = std::max(lobes.ggx_table_cosine(at_column, alpha), 1e-9);
    const GgxAlbedo albedo =
        ggx_albedo(glm::dvec3(std::sqrt(1.0 - cosine * cosine), 0.0, cosine), glm::dvec2(alpha), strata);
    const double typical = lobes.ggx_typical_cosine(cosine, alpha);
    const double column_cosine = std::max(at_column * at_column, 1e-9);
    return {1.0 - albedo.total, (albedo.schlick / albedo.total - lobes.power5(1.0 - typical)) * 2.0 + 0.25,
            (albedo.dip / albedo.total - lobes.ggx_typical_dip(albedo.schlick / albedo.total)) * 32.0 + 0.75,
            chan_retro_albedo(column_cosine, lobes.chan_sharpness_at(at_row), std::min(strata, 128)) * 32.0};
}

}  // namespace nacre::materials
