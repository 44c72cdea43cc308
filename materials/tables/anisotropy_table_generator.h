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

/// The entry of anisotropy_table(), two numbers in [0, 1]; `index` from the fastest axis on. The table was written with
/// 96 strata.
inline std::array<double, 2> anisotropy_table_entry(const std::array<std::uint32_t, 4>& index, int strata) {
    closures::Library library;
    std::array<double, 4> at;
    for (int axis = 0; axis < 4; ++axis) at[axis] = index[axis] / (anisotropy_table_size[axis] - 1.0);
    const double larger = std::max(at[3] * at[3], 1e-3);
    const double ratio = std::pow(std::lerp(std::cbrt(library.smallest_alpha / larger), 1.0, at[2]), 3.0);
    const double azimuth = 0.5 * std::numbers::pi * at[1];
    const double phi = std::atan2(std::sin(azimuth), std::pow(ratio, 0.25) * std::cos(azimuth));
    const glm::dvec2 alpha(larger, larger * ratio);
    const double seen = std::hypot(alpha.x * std::cos(phi), alpha.y * std::sin(phi));
    const double cosine = std::max(library.ggx_table_cosine(at[0], seen), 1e-9),
                 sine = std::sqrt(1.0 - cosine * cosine);
    const GgxAlbedo albedo = ggx_albedo({sine * std::cos(phi), sine * std::sin(phi), cosine}, alpha, strata);
    return {1.0 - albedo.total,
            (albedo.schlick / albedo.total - library.ggx_albedo(cosine, seen).schlick) * 2.0 + 0.25};
}

}  // namespace nacre::materials
