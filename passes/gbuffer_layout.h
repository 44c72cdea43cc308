// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

/// @file
/// What the words of the G-buffer hold, stated once: the GLSL that packs and unpacks is generated from this table, and
/// comparisons decode by it.
///
///     for (const Field& field : fields_of("top_layer"))
///         if (field_differs(field, word_a, word_b)) ++differing;
///
/// A pixel of a plain slab is three 32-bit words, 12 bytes: `material.0` and `material.1` (the slab) and `top_layer`
/// (what effects in screen space want to know without reading the slab). Reflectances are stored as square roots, so
/// that steps are even to the eye and decoding is one exact multiplication.

namespace nacre::passes {

enum class FieldKind : std::uint8_t {
    identifier,   ///< An enumeration: any difference counts.
    unorm,        ///< value / (2^bits - 1)
    squared,      ///< (value / (2^bits - 1))^2
    octahedral,   ///< Unit vector as two coordinates of bits / 2 each, the first in the lower half.
};

/// One quantity in one word.
struct Field {
    std::string_view name;   ///< As in the generated GLSL: "roughness".
    std::string_view word;   ///< Name of the texture: "top_layer".
    std::uint8_t shift = 0;  ///< Lowest bit.
    std::uint8_t bits = 0;
    FieldKind kind = FieldKind::unorm;
    std::string_view meaning;
};

/// What a pixel holds (field `pixel_class`).
enum class PixelClass : std::uint32_t {
    background = 0,  ///< No surface: the sky is seen.
    slab = 1,        ///< A lit slab.
    unlit = 2,       ///< A color that is shown as it is; only `diffuse` counts.
    closures = 3,    ///< Several lobes: words are a stream of fields (materials/storage.h) with the class in its place.
};

/// All fields, by word and shift.
std::span<const Field> gbuffer_fields();
/// Fields of one G-buffer texture, empty for other names.
std::span<const Field> fields_of(std::string_view texture);

/// The raw integer of a field.
[[nodiscard]] constexpr std::uint32_t field_bits(const Field& field, std::uint32_t word) {
    return (word >> field.shift) & (field.bits == 32 ? ~0u : (1u << field.bits) - 1u);
}
/// The decoded value: one number, or the three coordinates of a vector (the others are 0).
[[nodiscard]] std::array<float, 3> decode_field(const Field& field, std::uint32_t word);

/// True when the field's values in two words are further apart than one quantisation step (for identifiers: not equal;
/// for vectors: a larger angle than between neighboring codes, so that the seams of the octahedron do not count).
[[nodiscard]] bool field_differs(const Field& field, std::uint32_t a, std::uint32_t b);

/// GLSL text with a `pack_NAME` and `unpack_NAME` for every field; what "passes/shared/gbuffer_fields.glsl" holds.
std::string gbuffer_glsl();

}  // namespace nacre::passes
