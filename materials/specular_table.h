// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

/// @file
/// Tints of reflections by view and light: what `slab_specular_lut` looks up, Slab::specular_lut being the table's
/// place in a list. A scene brings its own list (scene::Scene::specular_tables) or has default_specular_tables().
///
///     scene.specular_tables = {flip_flop_table({0.9f, 0.5f, 0.1f}, {0.1f, 0.3f, 0.9f}, 3.0f)};
///
/// A tint never adds light: entries are in [0, 1]. Functions are safe on any thread.

namespace nacre::materials {

/// One table: entries at equal steps of the cosines of view (columns) and light (rows) to the normal, from 0 to 1, in
/// rows of the same light.
struct SpecularTable {
    static constexpr std::uint32_t size = 16;
    std::string name;
    std::array<glm::vec3, size * size> entries;

    /// The same everywhere: white.
    SpecularTable() { entries.fill(glm::vec3(1.0f)); }
};

/// Color by view angle (flip_flop() of materials/conversions.h), whatever the light's.
[[nodiscard]] SpecularTable flip_flop_table(const glm::vec3& facing, const glm::vec3& grazing, float exponent);

/// Tables that are always there: 0 "pearl", 1 "beetle", 2 "oil", 3 "white".
[[nodiscard]] std::span<const SpecularTable> default_specular_tables();

/// Between its entries; `at`: cosines of view and light, clamped to [0, 1].
[[nodiscard]] glm::dvec3 look_up(const SpecularTable& table, const glm::dvec2& at);

/// For closures::Library::tints: tables by place, the last one for places beyond. `tables` outlives the result.
[[nodiscard]] std::function<glm::dvec3(std::uint32_t, glm::dvec2)> tints_of(std::span<const SpecularTable> tables);

/// Words as materials/closures/specular_tables.glsl reads them: four of 16 bits for each entry, the fourth unused.
[[nodiscard]] std::vector<std::uint16_t> specular_table_words(std::span<const SpecularTable> tables);

}  // namespace nacre::materials
