// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "materials/closures/library.h"
#include "materials/tables/anisotropy_table.h"
#include "materials/tables/interface_table_generator.h"

/// @file
/// What fills materials/tables/anisotropy_table.h, in double precision.

namespace nacre::materials {

/// A lobe and a view of it.
struct StretchedLobe {
    glm::dvec2 alpha;
    glm::dvec3 view;
};

/// By the alphas of the slopes in the plane of view and normal and across it, and their correlation: slopes are spread as
/// an ellipse, whose axes are turned into those of the lobe. One alpha can be up to sqrt(2): corners of the table lie
/// beyond all lobes.
inline StretchedLobe stretched_lobe(double along, double across, double correlation, double cosine) {
    const double a = along * along, b = across * across, c = correlation * along * across;
    const double mean = 0.5 * (a + b), difference = std::hypot(0.5 * (a - b), c);
    const double larger = mean + difference, smaller = a * b * (1.0 - correlation * correlation) / larger;
    const double phi = 0.5 * std::atan2(2.0 * c, a - b), sine = std::sqrt(1.0 - cosine * cosine);
    return {.alpha = {std::sqrt(larger), std::sqrt(std::max(smaller, 1e-14))},
            .view = {sine * std::cos(phi), sine * std::sin(phi), cosine}};
}

/// Where a growing function of [0, 1] has a value.
template <typename Function>
double inverse_of(Function&& function, double value) {
    double low = 0.0, high = 1.0;
    // Halved by ratio as soon as it is small: cosines have many orders of magnitude.
    for (int i = 0; i < 200; ++i) {
        const double middle = low > 0.0 ? std::sqrt(low * high) : high > 1e-12 ? 0.5 * high : 0.0;
        (function(middle) < value ? low : high) = middle;
    }
    return high;
}

/// The entry of anisotropy_table(), two numbers in [0, 1]; `index` from the fastest axis on. The table was written with
/// 96 strata.
inline std::array<double, 2> anisotropy_table_entry(const std::array<std::uint32_t, 4>& index, int strata) {
    using closures::Library;
    Library library;
    std::array<double, 4> at;
    for (int axis = 0; axis < 4; ++axis) at[axis] = index[axis] / (anisotropy_table_size[axis] - 1.0);
    // At the ends the entries are limits: of slopes in one plane alone, and of a view along the surface.
    const double along = std::max(std::pow(at[1], 1.6), 3e-4);
    const double root = 1.0 + at[2] * (std::sqrt(5.0) - 1.0);
    const double across = std::max(0.5 * std::sqrt(root * root - 1.0), 1e-3);
    const double correlation =
        std::min(inverse_of([](double r) { return 0.5 * r * r * (1.0 + r); }, at[3]), 1.0 - 1e-9);
    const auto place = [&](double cosine) {
        return library.stretched_place({along, across, correlation}, cosine).x;
    };
    const double cosine = index[0] + 1 == anisotropy_table_size[0] ? 1.0 : std::max(inverse_of(place, at[0]), 1e-9);
    const StretchedLobe lobe = stretched_lobe(along, across, correlation, cosine);
    const GgxAlbedo albedo = ggx_albedo(lobe.view, lobe.alpha, strata);
    const auto round = library.ggx_albedo(cosine, along);
    const double ratio = (1.0 - std::pow(albedo.schlick / albedo.total, 0.2)) / (1.0 - std::pow(round.schlick, 0.2));
    return {(1.0 - albedo.total / (1.0 - round.missing) + 0.75) / 1.25,
            ratio / library.stretched_cosine_ratio({along, across, correlation}, cosine) / 1.5};
}

}  // namespace nacre::materials
