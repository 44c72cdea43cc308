// SPDX-License-Identifier: Apache-2.0
#include "passes/gbuffer_layout.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>

namespace nacre::passes {
namespace {

constexpr Field all_fields[] = {
    {"pixel_class", "material.0", 0, 2, FieldKind::identifier, "what the pixel holds (PixelClass)"},
    {"occlusion", "material.0", 2, 6, FieldKind::unorm, "ambient light that arrives, [0, 1]"},
    {"diffuse_r", "material.0", 8, 8, FieldKind::squared, "diffuse albedo, red"},
    {"diffuse_g", "material.0", 16, 8, FieldKind::squared, "diffuse albedo, green"},
    {"diffuse_b", "material.0", 24, 8, FieldKind::squared, "diffuse albedo, blue"},
    {"f0_r", "material.1", 0, 8, FieldKind::squared, "reflectance at normal incidence, red"},
    {"f0_g", "material.1", 8, 8, FieldKind::squared, "reflectance at normal incidence, green"},
    {"f0_b", "material.1", 16, 8, FieldKind::squared, "reflectance at normal incidence, blue"},
    {"f90", "material.1", 24, 8, FieldKind::unorm, "reflectance at grazing incidence"},
    {"normal", "top_layer", 0, 24, FieldKind::octahedral, "shading normal in the world"},
    {"roughness", "top_layer", 24, 8, FieldKind::unorm, "perceptual roughness of the interface"},
};

/// Largest code of one octahedral coordinate's magnitude; codes are offset by it, so that 0, 1 and -1 are exact.
int octahedral_half_range(const Field& field) { return (1 << (field.bits / 2 - 1)) - 1; }

std::array<int, 2> octahedral_codes(const Field& field, std::uint32_t word) {
    const std::uint32_t bits = field_bits(field, word), half = field.bits / 2u;
    return {static_cast<int>(bits & ((1u << half) - 1u)), static_cast<int>(bits >> half)};
}

}  // namespace

std::span<const Field> gbuffer_fields() { return all_fields; }

std::span<const Field> fields_of(std::string_view texture) {
    const auto first = std::ranges::find(all_fields, texture, &Field::word);
    const auto last =
        std::find_if(first, std::end(all_fields), [&](const Field& field) { return field.word != texture; });
    return {first, last};
}

std::array<float, 3> decode_field(const Field& field, std::uint32_t word) {
    const std::uint32_t bits = field_bits(field, word);
    const float unit = static_cast<float>(bits) / static_cast<float>((1ull << field.bits) - 1u);
    switch (field.kind) {
        case FieldKind::identifier: return {static_cast<float>(bits), 0, 0};
        case FieldKind::unorm: return {unit, 0, 0};
        case FieldKind::squared: return {unit * unit, 0, 0};
        case FieldKind::octahedral: break;
    }
    const int half_range = octahedral_half_range(field);
    const auto codes = octahedral_codes(field, word);
    float x = static_cast<float>(codes[0] - half_range) / static_cast<float>(half_range);
    float y = static_cast<float>(codes[1] - half_range) / static_cast<float>(half_range);
    const float z = 1.0f - std::abs(x) - std::abs(y);
    const float fold = std::max(-z, 0.0f);
    x += x >= 0.0f ? -fold : fold;
    y += y >= 0.0f ? -fold : fold;
    const float length = std::sqrt(x * x + y * y + z * z);
    return {x / length, y / length, z / length};
}

bool field_differs(const Field& field, std::uint32_t a, std::uint32_t b) {
    if (field_bits(field, a) == field_bits(field, b)) return false;
    if (field.kind == FieldKind::identifier) return true;
    if (field.kind != FieldKind::octahedral) {
        const auto difference = static_cast<std::int64_t>(field_bits(field, a)) - field_bits(field, b);
        return std::abs(difference) > 1;
    }
    const auto codes_a = octahedral_codes(field, a), codes_b = octahedral_codes(field, b);
    if (std::abs(codes_a[0] - codes_b[0]) <= 1 && std::abs(codes_a[1] - codes_b[1]) <= 1) return false;
    // Neighbors are furthest apart in the middle of a face of the octahedron: sqrt(6) steps of an edge at a distance of
    // 1 / sqrt(3) from its center. Only codes across a seam come here with a smaller angle.
    const auto vector_a = decode_field(field, a), vector_b = decode_field(field, b);
    float chord_squared = 0.0f;
    for (int i = 0; i < 3; ++i) chord_squared += (vector_a[i] - vector_b[i]) * (vector_a[i] - vector_b[i]);
    const float step = std::sqrt(18.0f) / static_cast<float>(octahedral_half_range(field));
    return chord_squared > step * step;
}

std::string gbuffer_glsl() {
    std::string text =
        "// Generated from passes/gbuffer_layout.cpp. pack_NAME gives a field's bits in their place, to be or-ed.\n"
        "#ifndef NACRE_GBUFFER_FIELDS\n#define NACRE_GBUFFER_FIELDS\n#include \"materials/closures/octahedral.glsl\"\n";
    for (const Field& field : all_fields) {
        const std::uint32_t mask = field.bits == 32 ? ~0u : (1u << field.bits) - 1u;
        const std::string shifted = fmt::format("(word >> {}u) & 0x{:x}u", field.shift, mask);
        switch (field.kind) {
            case FieldKind::identifier:
                text += fmt::format("uint pack_{0}(uint value) {{ return (value & 0x{1:x}u) << {2}u; }}\n"
                                    "uint unpack_{0}(uint word) {{ return {3}; }}\n",
                                    field.name, mask, field.shift, shifted);
                break;
            case FieldKind::unorm:
            case FieldKind::squared: {
                const bool squared = field.kind == FieldKind::squared;
                text += fmt::format("uint pack_{0}(float value) {{ return uint({1} * {2}.0 + 0.5) << {3}u; }}\n",
                                    field.name, squared ? "sqrt(clamp(value, 0.0, 1.0))" : "clamp(value, 0.0, 1.0)",
                                    mask, field.shift);
                text += fmt::format("float unpack_{0}(uint word) {{ float unit = float({1}) / {2}.0; return {3}; }}\n",
                                    field.name, shifted, mask, squared ? "unit * unit" : "unit");
                break;
            }
            case FieldKind::octahedral:
                text += fmt::format("uint pack_{0}(vec3 value) {{ return octahedral_encode(value, {1}) << {2}u; }}\n"
                                    "vec3 unpack_{0}(uint word) {{ return octahedral_decode({3}, {1}); }}\n",
                                    field.name, field.bits / 2, field.shift, shifted);
                break;
        }
    }
    return text + "#endif\n";
}

}  // namespace nacre::passes
