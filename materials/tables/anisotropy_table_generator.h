// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
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

/// By the alphas of the slopes in the plane of view and normal and across it, and their correlation: slopes are spread
/// as an ellipse, whose axes are turned into those of the lobe. One alpha can be up to sqrt(2): corners of the table
/// lie beyond all lobes.
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

using AnisotropyIndex = std::array<std::uint32_t, 4>;  ///< Of an entry; from the fastest axis on.

/// The two numbers of an entry by the lobe that it stands for, before they are moved. The table was written with 96
/// strata.
inline std::array<double, 2> anisotropy_table_sample(const AnisotropyIndex& index, int strata) {
    using closures::Library;
    Library library;
    std::array<double, 4> at;
    for (int axis = 0; axis < 4; ++axis) at[axis] = index[axis] / (anisotropy_table_size[axis] - 1.0);
    // At the ends the entries are limits: of slopes in one plane alone, and of a view along the surface.
    const auto along_at = [&](double along) { return library.stretched_place({along, along, 0.0}, 1.0).y; };
    const double along = index[1] == 0 ? 1e-4 : inverse_of(along_at, at[1]);
    const auto across_at = [&](double across) { return library.stretched_place({along, across, 0.0}, 1.0).z; };
    const double across = std::max(inverse_of(across_at, at[2]), 1e-4);
    const auto correlation_at = [&](double r) { return library.stretched_place({along, across, r}, 1.0).w; };
    const double correlation = std::min(inverse_of(correlation_at, at[3]), 1.0 - 1e-9);
    const auto cosine_at = [&](double cosine) { return library.stretched_place({along, across, 0.0}, cosine).x; };
    const double cosine =
        index[0] + 1 == anisotropy_table_size[0] ? 1.0 : std::max(inverse_of(cosine_at, at[0]), 1e-9);
    const StretchedLobe lobe = stretched_lobe(along, across, correlation, cosine);
    const GgxAlbedo albedo = ggx_albedo(lobe.view, lobe.alpha, strata);
    // What is reflected is held against what the shader reads of the round lobe, whose errors are then those of entries
    // alone. The mean of (1 - c)^5 is held against the exact one: where it is small, a small error would make a ratio
    // that is of no use to the neighbors.
    const double round = 1.0 - library.ggx_albedo(cosine, along).missing;
    const GgxAlbedo exact = ggx_albedo({std::sqrt(1.0 - cosine * cosine), 0.0, cosine}, glm::dvec2(along), strata);
    const double x = library.ggx_table_coordinate(cosine, along);
    const closures::Library::StretchedView view{along, across, correlation};
    const auto typical = [](const GgxAlbedo& a) { return 1.0 - std::pow(a.schlick / a.total, 0.2); };
    return {2.0 * (1.2 - albedo.total / (round * library.stretched_ratio(view, x))),
            0.8 * typical(albedo) / library.stretched_cosine(view, x, typical(exact))};
}

/// The entry of anisotropy_table(), two numbers in [0, 1], by samples of its neighborhood. Between two entries a line
/// is off by an eighth of the second difference, to one side; half of that is taken from the entries.
template <typename Sample>
std::array<double, 2> anisotropy_table_entry(const AnisotropyIndex& index, Sample&& sample) {
    std::array<double, 2> entry = sample(index);
    // A little more is reflected than allowed for, rather than less: the compensation would make light.
    entry[0] -= 2.0 * 0.0006;
    for (int axis = 0; axis < 3; ++axis) {
        const std::uint32_t last = anisotropy_table_size[axis] - 1;
        AnisotropyIndex middle = index;
        middle[axis] = std::clamp(index[axis], 1u, last - 1);
        AnisotropyIndex lower = middle, upper = middle;
        --lower[axis];
        ++upper[axis];
        // At the ends the second difference is that of the neighbor, which tells less.
        const double share = middle == index ? 1.0 / 16.0 : 0.3 / 16.0;
        const std::array<double, 2> a = sample(lower), b = sample(middle), c = sample(upper);
        for (int word = 0; word < 2; ++word) entry[word] -= share * (a[word] - 2.0 * b[word] + c[word]);
    }
    return entry;
}

}  // namespace nacre::materials
