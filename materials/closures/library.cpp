// SPDX-License-Identifier: Apache-2.0
#include "materials/closures/library.h"

#include <algorithm>

#include "materials/tables/interface_table.h"

namespace nacre::materials::closures {

Lobes::vec4 Library::interface_table(vec2 at) {
    constexpr int columns = interface_table_columns, rows = interface_table_rows;
    const auto words = materials::interface_table();
    const auto entry = [&](int column, int row) {
        const std::uint16_t* word = &words[4 * static_cast<std::size_t>(row * columns + column)];
        return vec4(word[0], word[1], word[2], word[3]) / 65535.0;
    };
    const double x = std::clamp(at.x, 0.0, 1.0) * (columns - 1), y = std::clamp(at.y, 0.0, 1.0) * (rows - 1);
    const int column = std::min(static_cast<int>(x), columns - 2), row = std::min(static_cast<int>(y), rows - 2);
    return glm::mix(glm::mix(entry(column, row), entry(column + 1, row), x - column),
                    glm::mix(entry(column, row + 1), entry(column + 1, row + 1), x - column), y - row);
}

Library::Slab Library::slab_of(const materials::Slab& slab) {
    return {
        .features = slab.features,
        .coverage = slab.coverage,
        .f0 = slab.f0,
        .roughness = slab.roughness,
        .albedo = slab.albedo,
        .anisotropy = slab.anisotropy,
        .f90 = slab.f90,
        .f82 = slab.f82,
        .second_roughness = slab.second_roughness,
        .second_weight = slab.second_weight,
        .fuzz_amount = slab.fuzz_amount,
        .fuzz_roughness = slab.fuzz_roughness,
        .fuzz_color = slab.fuzz_color,
        .film_thickness = slab.film_thickness,
        .film_ior = slab.film_ior,
        .specular_lut = slab.specular_lut,
        .glint_density = slab.glint_density,
        .glint_position = slab.glint_position,
        .glint_dx = slab.glint_dx,
        .glint_dy = slab.glint_dy,
        .mean_free_path = slab.mean_free_path,
        .phase_anisotropy = slab.phase_anisotropy,
        .thickness = slab.thickness,
        .emission = slab.emission,
        .edge_coverage = slab.edge_coverage,
        .edge_exponent = slab.edge_exponent,
    };
}

}  // namespace nacre::materials::closures
