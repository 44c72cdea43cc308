// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

/// @file
/// What fills the table of passes/tables/ggx_albedo.h, in double precision. Used by the program that writes the table and
/// by the test that checks it.
///
///     auto [a, b] = directional_albedo_terms(0.5, 0.3);

namespace nacre::passes {

/// Directional albedo of a GGX interface with height-correlated Smith masking, single scattering, split by Schlick's Fresnel
/// so that the albedo is F0 * first + F90 * second.
///
/// @param cos_theta  cosine between normal and direction, (0, 1]
/// @param roughness  perceptual; alpha is its square, [0, 1]
/// @param strata     samples are strata^2; 64 gives four digits
/// Source of the sampling: Heitz 2018, "Sampling the GGX distribution of visible normals".
inline std::array<double, 2> directional_albedo_terms(double cos_theta, double roughness, int strata) {
    const double alpha = roughness * roughness;
    const double mu = std::clamp(cos_theta, 1e-4, 1.0);
    if (alpha < 1e-6) {
        const double grazing = std::pow(1.0 - mu, 5.0);
        return {1.0 - grazing, grazing};
    }
    const auto lambda = [alpha](double cosine) {
        const double c2 = cosine * cosine;
        return 0.5 * (std::sqrt(1.0 + alpha * alpha * (1.0 - c2) / c2) - 1.0);
    };
    const double sin_o = std::sqrt(std::max(1.0 - mu * mu, 0.0));
    // The view direction, stretched so that the distribution becomes a hemisphere.
    const double stretched_length = std::sqrt(alpha * alpha * sin_o * sin_o + mu * mu);
    const double vx = alpha * sin_o / stretched_length, vz = mu / stretched_length;
    double first = 0.0, second = 0.0;
    for (int i = 0; i < strata; ++i) {
        for (int j = 0; j < strata; ++j) {
            // Strata crowd towards the rim, where smooth surfaces have their few but strongly tilted microfacets.
            const double s_radial = (i + 0.5) / strata;
            const double density = 3.0 * (1.0 - s_radial) * (1.0 - s_radial);
            // A point of the projected hemisphere. Frame: the stretched view, the y axis, and their cross product.
            const double r = std::sqrt(1.0 - std::pow(1.0 - s_radial, 3.0));
            const double phi = 2.0 * std::numbers::pi * (j + 0.5) / strata;
            const double t1 = r * std::cos(phi);
            double t2 = r * std::sin(phi);
            const double s = 0.5 * (1.0 + vz);
            t2 = (1.0 - s) * std::sqrt(std::max(1.0 - t1 * t1, 0.0)) + s * t2;
            const double up = std::sqrt(std::max(1.0 - t1 * t1 - t2 * t2, 0.0));
            // Frame vectors: (0, 1, 0), then v x (0, 1, 0) = (-vz, 0, vx), then v = (vx, 0, vz).
            double hx = -t2 * vz + up * vx, hy = t1, hz = t2 * vx + up * vz;
            hx *= alpha;
            hy *= alpha;
            hz = std::max(hz, 1e-12);
            const double length = std::sqrt(hx * hx + hy * hy + hz * hz);
            hx /= length;
            hz /= length;
            const double cos_oh = hx * sin_o + hz * mu;
            const double cos_i = 2.0 * cos_oh * hz - mu;
            if (cos_i <= 0.0 || cos_oh <= 0.0) continue;
            const double weight = density * (1.0 + lambda(mu)) / (1.0 + lambda(mu) + lambda(cos_i));
            const double grazing = std::pow(1.0 - std::min(cos_oh, 1.0), 5.0);
            first += weight * (1.0 - grazing);
            second += weight * grazing;
        }
    }
    const double samples = static_cast<double>(strata) * strata;
    return {first / samples, second / samples};
}

}  // namespace nacre::passes
