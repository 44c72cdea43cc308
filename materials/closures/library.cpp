// SPDX-License-Identifier: Apache-2.0
#include "materials/closures/library.h"

#include <algorithm>

#include "materials/tables/anisotropy_table.h"
#include "materials/tables/interface_table.h"
#include "materials/tables/medium_table.h"

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

Lobes::vec2 Library::anisotropy_table(vec4 at) {
    const auto words = materials::anisotropy_table();
    std::size_t lowest = 0, stride = 1;
    std::size_t strides[3];
    double part[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double place = std::clamp(at[axis], 0.0, 1.0) * (anisotropy_table_size[axis] - 1);
        const int entry = std::min(static_cast<int>(place), static_cast<int>(anisotropy_table_size[axis]) - 2);
        part[axis] = place - entry;
        lowest += stride * static_cast<std::size_t>(entry);
        strides[axis] = stride;
        stride *= anisotropy_table_size[axis];
    }
    const double w = 3.0 * std::clamp(at.w, 0.0, 1.0);
    const double curve[4] = {(1.0 - w) * (2.0 - w) * (3.0 - w) / 6.0, 0.5 * w * (2.0 - w) * (3.0 - w),
                             0.5 * w * (w - 1.0) * (3.0 - w), w * (w - 1.0) * (w - 2.0) / 6.0};
    vec2 sum(0.0);
    for (int corner = 0; corner < 8; ++corner) {
        double weight = 1.0;
        std::size_t entry = lowest;
        for (int axis = 0; axis < 3; ++axis) {
            const bool is_upper = (corner >> axis & 1) != 0;
            weight *= is_upper ? part[axis] : 1.0 - part[axis];
            if (is_upper) entry += strides[axis];
        }
        for (const double along : curve) {
            sum += weight * along * vec2(words[2 * entry], words[2 * entry + 1]) / 65535.0;
            entry += stride;
        }
    }
    return sum;
}

Lobes::vec2 Library::medium_table(vec3 at) {
    constexpr int columns = medium_table_columns, rows = medium_table_rows, slices = medium_table_slices;
    const auto words = materials::medium_table();
    const glm::dvec3 last(columns - 1, rows - 1, slices - 1);
    const glm::dvec3 place = glm::clamp(at, 0.0, 1.0) * last;
    const glm::dvec3 entry = glm::min(glm::floor(place), last - 1.0), part = place - entry;
    vec2 sum(0.0);
    for (int corner = 0; corner < 8; ++corner) {
        const glm::ivec3 offset(corner & 1, corner >> 1 & 1, corner >> 2), index = glm::ivec3(entry) + offset;
        const double weight = (offset.x ? part.x : 1.0 - part.x) * (offset.y ? part.y : 1.0 - part.y) *
                              (offset.z ? part.z : 1.0 - part.z);
        const std::uint16_t* word =
            &words[2 * static_cast<std::size_t>((index.z * rows + index.y) * columns + index.x)];
        sum += weight * vec2(word[0], word[1]) / 65535.0;
    }
    return sum;
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
        .specular_weight = slab.specular_weight,
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
