// SPDX-License-Identifier: Apache-2.0
#include "materials/storage_shader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace nacre::materials {
namespace {

std::string number(double value) {
    std::string text = fmt::format("{}", static_cast<float>(value));
    if (text.find_first_of(".e") == std::string::npos) text += ".0";
    return text;
}

// The member of Slab that a field holds; empty for what is none.
const char* member_of(StorageValue value) {
    switch (value) {
        case StorageValue::f0: return "f0";
        case StorageValue::albedo: return "albedo";
        case StorageValue::roughness: return "roughness";
        case StorageValue::f90: return "f90";
        case StorageValue::f82: return "f82";
        case StorageValue::second_roughness: return "second_roughness";
        case StorageValue::second_weight: return "second_weight";
        case StorageValue::fuzz_amount: return "fuzz_amount";
        case StorageValue::fuzz_color: return "fuzz_color";
        case StorageValue::fuzz_roughness: return "fuzz_roughness";
        case StorageValue::anisotropy: return "anisotropy";
        case StorageValue::film_thickness: return "film_thickness";
        case StorageValue::film_ior: return "film_ior";
        case StorageValue::specular_lut: return "specular_lut";
        case StorageValue::glint_density: return "glint_density";
        case StorageValue::glint_x: return "glint_position.x";
        case StorageValue::glint_y: return "glint_position.y";
        case StorageValue::glint_dx_x: return "glint_dx.x";
        case StorageValue::glint_dx_y: return "glint_dx.y";
        case StorageValue::glint_dy_x: return "glint_dy.x";
        case StorageValue::glint_dy_y: return "glint_dy.y";
        default: return "";
    }
}

// Of a number, with its dither.
std::string encode(const StorageFormat& format, std::uint32_t bits, const std::string& value,
                   const std::string& dither) {
    switch (format.codec) {
        case StorageCodec::integer: return fmt::format("({} & {}u)", value, (1u << bits) - 1u);
        case StorageCodec::unit:
            if (format.low == 0.0 && format.high == 1.0)
                return fmt::format("pack_unit({}, {}u, {})", value, bits, dither);
            return fmt::format("pack_unit(({} - {}) / {}, {}u, {})", value, number(format.low),
                               number(format.high - format.low), bits, dither);
        case StorageCodec::signed_unit: return fmt::format("pack_signed({}, {}u, {})", value, bits, dither);
        case StorageCodec::logarithm:
            return fmt::format("pack_logarithm({}, {}u, {}, {}, {})", value, bits, number(format.low),
                               number(format.octaves()), dither);
        case StorageCodec::signed_logarithm:
            return fmt::format("pack_signed_logarithm({}, {}u, {}, {}, {})", value, bits, number(format.low),
                               number(format.octaves()), dither);
        case StorageCodec::fraction: return fmt::format("pack_fraction({}, {}u)", value, bits);
        case StorageCodec::color:
        case StorageCodec::direction:
        case StorageCodec::angle: break;
    }
    return {};
}

std::string decode(const StorageFormat& format, std::uint32_t bits, const std::string& code) {
    switch (format.codec) {
        case StorageCodec::integer: return code;
        case StorageCodec::unit:
            if (format.low == 0.0 && format.high == 1.0) return fmt::format("unpack_unit({}, {}u)", code, bits);
            return fmt::format("{} + {} * unpack_unit({}, {}u)", number(format.low), number(format.high - format.low),
                               code, bits);
        case StorageCodec::signed_unit: return fmt::format("unpack_signed({}, {}u)", code, bits);
        case StorageCodec::logarithm:
            return fmt::format("unpack_logarithm({}, {}u, {}, {})", code, bits, number(format.low),
                               number(format.octaves()));
        case StorageCodec::signed_logarithm:
            return fmt::format("unpack_signed_logarithm({}, {}u, {}, {})", code, bits, number(format.low),
                               number(format.octaves()));
        case StorageCodec::fraction: return fmt::format("unpack_fraction({}, {}u)", code, bits);
        case StorageCodec::color: return fmt::format("unpack_color({})", code);
        case StorageCodec::direction:
        case StorageCodec::angle: break;
    }
    return {};
}

class Writer {
  public:
    Writer(const FlattenedTree& tree, const StorageLayout& layout) : topology_(tree.topology), layout_(layout) {}

    std::string run() {
        print(
            "#include \"materials/closures/stored_fields.glsl\"\n#include "
            "\"materials/closures/stored_frame.glsl\"\n\n");
        print(
            "const uint stored_words = {}u;\nconst uint stored_top_closure = {}u;\nconst uint stored_top_frame = "
            "{}u;\n\n",
            layout_.material_words(), layout_.closures[0], layout_.frames[0]);
        print(
            "void pack_tree(TreeState state, vec3 normals[tree_frame_count], vec3 tangents[tree_frame_count], float "
            "occlusion, uvec2 pixel, out uint words[stored_words], out uint subsurface) {{\n"
            "    for (uint i = 0u; i < stored_words; ++i) words[i] = 0u;\n    uint code;\n    subsurface = 0u;\n");
        print_subsurface();
        for (const StorageField& field : layout_.fields) print_field(field);
        print("}}\n");
        return std::move(text_);
    }

  private:
    template <typename... Arguments>
    void print(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
        fmt::format_to(std::back_inserter(text_), format, std::forward<Arguments>(arguments)...);
    }

    // The closure that is seen most has the pixel's word of subsurface data.
    void print_subsurface() {
        if (!layout_.has_subsurface) return;
        print("    float seen_most = -1.0;\n");
        for (std::uint32_t i = 0; i < layout_.closures.size(); ++i) {
            if (layout_.media[i] != StoredMedium::subsurface) continue;
            print(
                "    {{\n        float seen = state.paths[{0}].weight.y * state.coverages[{0}];\n        if (seen > "
                "seen_most) "
                "{{\n            seen_most = seen;\n            Slab slab = state.slabs[{0}];\n            subsurface "
                "= "
                "pack_subsurface(slab.albedo, slab.mean_free_path, slab.phase_anisotropy, slab.thickness, pixel);\n    "
                "    "
                "}}\n    }}\n",
                layout_.closures[i]);
        }
    }

    bool has(StorageValue value, std::uint32_t closure) const {
        return std::ranges::any_of(layout_.fields, [&](const StorageField& field) {
            return field.value == value && field.closure == closure;
        });
    }

    std::string next_dither() { return fmt::format("ordered_dither(pixel.x, pixel.y, {}u)", which_++); }
    std::string color(const std::string& value) {
        const std::string x = next_dither(), y = next_dither(), z = next_dither();
        return fmt::format("pack_color({}, vec3({}, {}, {}))", value, x, y, z);
    }

    std::string code_of(const StorageField& field) {
        const StorageFormat& format = storage_format(field.value);
        const std::uint32_t closure = field.closure == StorageLayout::no_closure ? 0 : layout_.closures[field.closure];
        const auto constant = [](std::uint32_t value) { return fmt::format("{}u", value); };
        switch (field.value) {
            case StorageValue::pixel_class: return "3u";
            case StorageValue::closure_count: return constant(static_cast<std::uint32_t>(layout_.closures.size()) - 1);
            case StorageValue::frame_count: return constant(static_cast<std::uint32_t>(layout_.frames.size()) - 1);
            case StorageValue::tangent_flags: {
                std::uint32_t flags = 0;
                for (const StorageField& other : layout_.fields) {
                    if (other.value == StorageValue::tangent) flags |= 1u << other.frame;
                }
                return constant(flags);
            }
            case StorageValue::occlusion_flag:
                return has(StorageValue::occlusion, StorageLayout::no_closure) ? "1u" : "0u";
            case StorageValue::occlusion: return encode(format, field.bits, "occlusion", "0.5");
            case StorageValue::normal:
                return fmt::format("octahedral_encode(normals[{}], {})", layout_.frames[field.frame], field.bits / 2);
            case StorageValue::tangent: {
                const std::uint32_t frame = layout_.frames[field.frame];
                const std::string normal =
                    field.frame == 0 ? fmt::format("normals[{}]", frame)
                                     : fmt::format("octahedral_decode(octahedral_encode(normals[{0}], {1}), {1})",
                                                   frame, storage_format(StorageValue::normal).bits / 2);
                return fmt::format("pack_tangent({}, tangents[{}], {}u)", normal, frame, field.bits);
            }
            case StorageValue::features: return constant(layout_.features[field.closure]);
            case StorageValue::medium: return constant(static_cast<std::uint32_t>(layout_.media[field.closure]));
            case StorageValue::has_albedo: return has(StorageValue::albedo, field.closure) ? "1u" : "0u";
            case StorageValue::is_below: return has(StorageValue::weight, field.closure) ? "1u" : "0u";
            case StorageValue::frame: {
                const auto slot = static_cast<std::uint32_t>(
                    std::ranges::find(topology_.frames, topology_.closures[closure].frame) - topology_.frames.begin());
                return constant(
                    static_cast<std::uint32_t>(std::ranges::find(layout_.frames, slot) - layout_.frames.begin()));
            }
            case StorageValue::medium_transmittance:
                return color(fmt::format(
                    "vec3(medium_transmittance(state.slabs[{0}].mean_free_path.x, state.slabs[{0}].thickness), "
                    "medium_transmittance(state.slabs[{0}].mean_free_path.y, state.slabs[{0}].thickness), "
                    "medium_transmittance(state.slabs[{0}].mean_free_path.z, state.slabs[{0}].thickness))",
                    closure));
            case StorageValue::grey_weight:
                return encode(format, field.bits,
                              fmt::format("state.paths[{0}].weight.y * state.coverages[{0}]", closure), next_dither());
            case StorageValue::weight:
                return color(fmt::format("state.paths[{0}].weight * state.coverages[{0}]", closure));
            case StorageValue::path_transmittance: return color(fmt::format("state.paths[{}].transmittance", closure));
            case StorageValue::path_uncovered:
                return encode(format, field.bits,
                              fmt::format("dot(state.paths[{}].uncovered, vec3(1.0 / 3.0))", closure), next_dither());
            case StorageValue::path_spread_up:
                return encode(format, field.bits,
                              fmt::format("dot(state.paths[{}].spread_up, vec3(1.0 / 3.0))", closure), next_dither());
            case StorageValue::path_spread_down:
                return encode(format, field.bits,
                              fmt::format("dot(state.paths[{}].spread_down, vec3(1.0 / 3.0))", closure), next_dither());
            case StorageValue::path_ior_excess:
                return encode(format, field.bits, fmt::format("state.paths[{}].ior_excess", closure), next_dither());
            case StorageValue::path_bend:
                return encode(format, field.bits, fmt::format("state.paths[{}].bend", closure), next_dither());
            default: break;
        }
        std::string value = fmt::format("state.slabs[{}].{}", closure, member_of(field.value));
        // Its brightness is not its own.
        if (field.value == StorageValue::f90)
            value = fmt::format("grazing_tint({}) * state.slabs[{}].specular_weight", value, closure);
        if (format.codec == StorageCodec::color) return color(value);
        if (format.codec == StorageCodec::integer) return encode(format, field.bits, value, "0.5");
        return encode(format, field.bits, value, next_dither());
    }

    void print_field(const StorageField& field) {
        const std::uint32_t word = field.offset / 32, shift = field.offset % 32;
        print("    code = {};  // {}\n    words[{}] |= code << {}u;\n", code_of(field),
              storage_format(field.value).name, word, shift);
        if (shift + field.bits > 32) print("    words[{}] |= code >> {}u;\n", word + 1, 32 - shift);
    }

    const Topology& topology_;
    const StorageLayout& layout_;
    std::string text_;
    std::uint32_t which_ = 0;
};

const char* macro_of(std::uint32_t feature) {
    return std::ranges::find(slab_features(), feature, &SlabFeature::bit)->macro;
}

std::string reader_text() {
    std::string text =
        "// Generated from the tables of materials/storage.cpp.\n#ifndef NACRE_CLOSURES_STORED_CLOSURES\n"
        "#define NACRE_CLOSURES_STORED_CLOSURES\n#include \"materials/closures/operators.glsl\"\n"
        "#include \"materials/closures/stored_fields.glsl\"\n#include \"materials/closures/stored_frame.glsl\"\n";
    const auto print = [&]<typename... Arguments>(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
        fmt::format_to(std::back_inserter(text), format, std::forward<Arguments>(arguments)...);
    };
    const auto bits_of = [](StorageValue value) { return storage_format(value).bits; };
    const auto read = [&](StorageValue value) {
        return decode(storage_format(value), bits_of(value),
                      fmt::format("stored_bits(header.cursor, {}u)", bits_of(value)));
    };
    print(R"(
struct StoredHeader {{
    uint cursor;
    uint closure_count;
    uint frame_count;
    float occlusion;
    StoredFrame frames[NACRE_STORED_FRAMES];
}};

struct StoredClosure {{
    Slab slab;
    Path path;  // its weight includes the closure's coverage
    uint frame;
}};

uint stored_bits(inout uint cursor, uint bits) {{
    uint word = cursor >> 5u;
    uint shift = cursor & 31u;
    uint code = material_word(word) >> shift;
    if (shift + bits > 32u) code |= material_word(word + 1u) << (32u - shift);
    cursor += bits;
    return code & ((1u << bits) - 1u);
}}

StoredHeader read_stored_header(vec3 top_normal) {{
    StoredHeader header;
    header.cursor = {}u;
    header.closure_count = stored_bits(header.cursor, {}u) + 1u;
    header.frame_count = min(stored_bits(header.cursor, {}u) + 1u, uint(NACRE_STORED_FRAMES));
    uint tangents = stored_bits(header.cursor, header.frame_count);
    header.occlusion = 1.0;
    if (stored_bits(header.cursor, {}u) != 0u) header.occlusion = {};
    vec3 normal = top_normal;
    for (uint i = 0u; i < uint(NACRE_STORED_FRAMES); ++i) {{
        float angle = 0.0;
        if (i < header.frame_count) {{
            if (i > 0u) normal = octahedral_decode(stored_bits(header.cursor, {}u), {});
            if (((tangents >> i) & 1u) != 0u) angle = unpack_tangent(stored_bits(header.cursor, {}u), {}u);
        }}
        header.frames[i] = turned_frame(normal, angle);
    }}
    return header;
}}

StoredClosure read_stored_closure(inout StoredHeader header, uint index, float top_roughness, uint subsurface) {{
    StoredClosure closure;
    Slab slab;
    closure.path = open_path();
    uint features = stored_bits(header.cursor, {}u);
    uint medium = stored_bits(header.cursor, {}u);
    bool has_albedo = stored_bits(header.cursor, {}u) != 0u;
    bool is_below = stored_bits(header.cursor, {}u) != 0u;
    closure.frame = 0u;
#if NACRE_STORED_FRAMES > 1
    if (header.frame_count > 1u) closure.frame = min(stored_bits(header.cursor, {}u), uint(NACRE_STORED_FRAMES - 1));
#endif
    slab.features = features;
    slab.coverage = 1.0;
    slab.f0 = {};
    slab.albedo = vec3(0.0);
    if (has_albedo) slab.albedo = {};
    slab.roughness = top_roughness;
    if (index > 0u) slab.roughness = {};
)",
          bits_of(StorageValue::pixel_class), bits_of(StorageValue::closure_count), bits_of(StorageValue::frame_count),
          bits_of(StorageValue::occlusion_flag), read(StorageValue::occlusion), bits_of(StorageValue::normal),
          bits_of(StorageValue::normal) / 2, bits_of(StorageValue::tangent), bits_of(StorageValue::tangent),
          bits_of(StorageValue::features), bits_of(StorageValue::medium), bits_of(StorageValue::has_albedo),
          bits_of(StorageValue::is_below), bits_of(StorageValue::frame), read(StorageValue::f0),
          read(StorageValue::albedo), read(StorageValue::roughness));
    std::uint32_t open = 0;
    for (const StoredFeatureValue& row : stored_feature_values()) {
        if (row.feature != open) {
            if (open != 0) print("    }}\n#endif\n");
            print("#ifdef {}\n    if ((features & {}u) != 0u) {{\n", macro_of(row.feature), row.feature);
            open = row.feature;
        }
        print("        slab.{} = {};\n", member_of(row.value), read(row.value));
        if (row.value == StorageValue::f90) print("        slab.specular_weight = largest(slab.f90);\n");
    }
    print(R"(    }}
#endif
#ifdef NACRE_SLAB_MEDIUM
    if (medium == 2u) {{
        vec3 transmittance = {};
        slab.mean_free_path = vec3(transmittance_to_mean_free_path(transmittance.x, 1.0),
                                   transmittance_to_mean_free_path(transmittance.y, 1.0),
                                   transmittance_to_mean_free_path(transmittance.z, 1.0));
        slab.thickness = 1.0;
    }}
    if (medium == 1u) {{
        slab.mean_free_path = unpack_mean_free_path(subsurface);
        slab.thickness = unpack_thickness(subsurface);
    }}
    slab.phase_anisotropy = 0.0;
    if (medium != 0u) slab.features |= slab_medium;
#endif
    if (is_below) {{
#ifdef NACRE_STORED_LAYERS
        closure.path.weight = {};
        closure.path.transmittance = {};
        closure.path.uncovered = vec3({});
        closure.path.spread_up = vec3({});
        closure.path.spread_down = vec3({});
        closure.path.ior_excess = {};
        closure.path.bend = {};
#endif
    }} else if (header.closure_count > 1u) {{
        closure.path.weight = vec3({});
    }}
    closure.slab = slab;
    return closure;
}}

#endif
)",
          read(StorageValue::medium_transmittance), read(StorageValue::weight), read(StorageValue::path_transmittance),
          read(StorageValue::path_uncovered), read(StorageValue::path_spread_up), read(StorageValue::path_spread_down),
          read(StorageValue::path_ior_excess),
          read(StorageValue::path_bend), read(StorageValue::grey_weight));
    return text;
}

}  // namespace

std::string storage_writer(const FlattenedTree& tree, const StorageLayout& layout) {
    return Writer(tree, layout).run();
}

std::span<const EmbeddedFile> storage_reader_files() {
    static const std::string text = reader_text();
    static const EmbeddedFile file{"materials/closures/stored_closures.glsl", text};
    return {&file, 1};
}

}  // namespace nacre::materials
