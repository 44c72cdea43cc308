// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "materials/topology.h"

/// @file
/// What a material takes in the G-buffer, in the worst case over all pixels: the fields of its header and closures,
/// known from its topology and features alone.
///
///     const StorageLayout layout = storage_layout(flat);
///     layout.total_bytes();   // 12 for one slab without features

namespace nacre::materials {

/// How a pixel is read, from the cheapest to the most general; lighting sorts tiles by it.
enum class StorageClass : std::uint8_t {
    simple,   ///< One closure without features.
    single,   ///< One closure with features, without anisotropy.
    complex,  ///< Any closures.
    special,  ///< Closures with glints or a specular look-up table.
};

/// Stable lower-case name: "simple", ...
[[nodiscard]] std::string_view name_of(StorageClass storage_class);

/// A field of the material words.
struct StorageField {
    std::string name;       ///< "f0", "path transmittance", ...
    std::uint32_t closure;  ///< Which closure it belongs to; StorageLayout::no_closure: the pixel.
    std::uint32_t bits;
};

/// Material words hold `fields` one after another; the top layer's word (normal and roughness) and the word of
/// subsurface scattering lie apart, since other passes read them alone.
struct StorageLayout {
    static constexpr std::uint32_t no_closure = ~0u;

    StorageClass storage_class = StorageClass::simple;
    std::vector<StorageField> fields;
    bool has_subsurface = false;

    /// 32-bit words that `fields` take.
    [[nodiscard]] std::uint32_t material_words() const;
    /// Material words, top layer and subsurface data.
    [[nodiscard]] std::uint32_t total_bytes() const { return 4 * (material_words() + 1 + (has_subsurface ? 1u : 0u)); }
};

[[nodiscard]] StorageLayout storage_layout(const FlattenedTree& tree);

}  // namespace nacre::materials
