// SPDX-License-Identifier: Apache-2.0
#include "materials/storage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace nacre::materials {
namespace {

using closures::Library;

Library library;

constexpr std::uint32_t color_bits = 20;
constexpr double shortest_glint_step = 1e-9, longest_glint_step = 1e3;

// In the order of StorageValue.
constexpr StorageFormat formats[] = {
    {StorageValue::pixel_class, "class", 2, StorageCodec::integer},
    {StorageValue::closure_count, "closures", 3, StorageCodec::integer},
    {StorageValue::frame_count, "frames", 2, StorageCodec::integer},
    {StorageValue::tangent_flags, "tangents", 1, StorageCodec::integer},
    {StorageValue::occlusion_flag, "has occlusion", 1, StorageCodec::integer},
    {StorageValue::occlusion, "occlusion", 6, StorageCodec::unit},
    {StorageValue::normal, "normal", 22, StorageCodec::direction},
    {StorageValue::tangent, "tangent", 10, StorageCodec::angle},
    {StorageValue::features, "features", 8, StorageCodec::integer},
    {StorageValue::medium, "medium", 2, StorageCodec::integer},
    {StorageValue::has_albedo, "has albedo", 1, StorageCodec::integer},
    {StorageValue::is_below, "is below", 1, StorageCodec::integer},
    {StorageValue::frame, "frame", 2, StorageCodec::integer},
    {StorageValue::f0, "f0", color_bits, StorageCodec::color},
    {StorageValue::albedo, "albedo", color_bits, StorageCodec::color},
    {StorageValue::roughness, "roughness", 8, StorageCodec::unit},
    {StorageValue::f90, "f90", color_bits, StorageCodec::color},
    {StorageValue::f82, "f82", color_bits, StorageCodec::color},
    {StorageValue::second_roughness, "second roughness", 8, StorageCodec::unit},
    {StorageValue::second_weight, "second weight", 6, StorageCodec::unit},
    {StorageValue::fuzz_amount, "fuzz amount", 6, StorageCodec::unit},
    {StorageValue::fuzz_color, "fuzz color", color_bits, StorageCodec::color},
    {StorageValue::fuzz_roughness, "fuzz roughness", 6, StorageCodec::unit},
    {StorageValue::anisotropy, "anisotropy", 8, StorageCodec::signed_unit},
    {StorageValue::film_thickness, "film thickness", 10, StorageCodec::logarithm, 1e-8, 1e-5},
    {StorageValue::film_ior, "film ior", 6, StorageCodec::unit, 1.0, 3.0},
    {StorageValue::specular_lut, "specular table", 8, StorageCodec::integer},
    {StorageValue::glint_density, "glint density", 16, StorageCodec::logarithm, 1.0, 1e12},
    {StorageValue::glint_x, "glint position x", 16, StorageCodec::fraction},
    {StorageValue::glint_y, "glint position y", 16, StorageCodec::fraction},
    {StorageValue::glint_dx_x, "glint derivative x of x", 16, StorageCodec::signed_logarithm, shortest_glint_step,
     longest_glint_step},
    {StorageValue::glint_dx_y, "glint derivative x of y", 16, StorageCodec::signed_logarithm, shortest_glint_step,
     longest_glint_step},
    {StorageValue::glint_dy_x, "glint derivative y of x", 16, StorageCodec::signed_logarithm, shortest_glint_step,
     longest_glint_step},
    {StorageValue::glint_dy_y, "glint derivative y of y", 16, StorageCodec::signed_logarithm, shortest_glint_step,
     longest_glint_step},
    {StorageValue::medium_transmittance, "medium transmittance", color_bits, StorageCodec::color},
    {StorageValue::grey_weight, "weight", 8, StorageCodec::unit},
    {StorageValue::weight, "weight", color_bits, StorageCodec::color},
    {StorageValue::path_transmittance, "path transmittance", color_bits, StorageCodec::color},
    {StorageValue::path_uncovered, "path uncovered", 6, StorageCodec::unit},
    {StorageValue::path_spread_up, "path spread up", 4, StorageCodec::unit},
    {StorageValue::path_spread_down, "path spread down", 3, StorageCodec::unit},
    {StorageValue::path_ior_excess, "path ior excess", 6, StorageCodec::unit, 0.0, 1.6},
    {StorageValue::path_bend, "path bend", 4, StorageCodec::unit},
};

// Fields of features, in the order of the stream.
constexpr StoredFeatureValue feature_values[] = {
    {slab_f90, StorageValue::f90},
    {slab_f82, StorageValue::f82},
    {slab_second_lobe, StorageValue::second_roughness},
    {slab_second_lobe, StorageValue::second_weight},
    {slab_fuzz, StorageValue::fuzz_amount},
    {slab_fuzz, StorageValue::fuzz_color},
    {slab_fuzz, StorageValue::fuzz_roughness},
    {slab_anisotropy, StorageValue::anisotropy},
    {slab_thin_film, StorageValue::film_thickness},
    {slab_thin_film, StorageValue::film_ior},
    {slab_specular_lut, StorageValue::specular_lut},
    {slab_glints, StorageValue::glint_density},
    {slab_glints, StorageValue::glint_x},
    {slab_glints, StorageValue::glint_y},
    {slab_glints, StorageValue::glint_dx_x},
    {slab_glints, StorageValue::glint_dx_y},
    {slab_glints, StorageValue::glint_dy_x},
    {slab_glints, StorageValue::glint_dy_y},
};

// Emission is added to the lit color at once and the view-dependent coverage is that of the pixel: neither is stored.
// The features' bits lie below that of the medium and are stored as they are.
constexpr std::uint32_t feature_bits = slab_medium - 1u;

/// What each field is conditional on is asked twice, by the layout and by the reader: this is the one order.
template <typename Field>
void for_each_closure_field(std::uint32_t index, std::uint32_t closure_count, std::uint32_t features,
                            StoredMedium medium, bool has_albedo, bool is_below, Field&& field) {
    field(StorageValue::f0);
    if (has_albedo) field(StorageValue::albedo);
    if (index > 0) field(StorageValue::roughness);
    for (const StoredFeatureValue& row : feature_values) {
        if ((features & row.feature) != 0) field(row.value);
    }
    if (medium == StoredMedium::transmittance) field(StorageValue::medium_transmittance);
    // Coverage and mixing weigh all channels alike; only what lies under a layer is tinted. A lone closure's coverage
    // is the pixel's.
    if (is_below) {
        field(StorageValue::weight);
        field(StorageValue::path_transmittance);
        field(StorageValue::path_uncovered);
        field(StorageValue::path_spread_up);
        field(StorageValue::path_spread_down);
        field(StorageValue::path_ior_excess);
        field(StorageValue::path_bend);
    } else if (closure_count > 1) {
        field(StorageValue::grey_weight);
    }
}

class Layout {
  public:
    Layout(const FlattenedTree& tree, const StorageOptions& options)
        : tree_(tree), topology_(tree.topology), options_(options) {}

    StorageLayout run() {
        order();
        for (std::uint32_t i = 0; i < result_.closures.size(); ++i) {
            const TopologyClosure& closure = topology_.closures[result_.closures[i]];
            result_.features.push_back(closure.features & feature_bits);
            StoredMedium medium = StoredMedium::opaque;
            if ((closure.features & slab_medium) != 0) {
                if (closure.is_bottom) {
                    medium = StoredMedium::subsurface;
                } else if (!is_without_diffuse(closure.node)) {
                    medium = StoredMedium::transmittance;
                }
            }
            result_.media.push_back(medium);
            result_.has_subsurface |= medium == StoredMedium::subsurface;
        }
        result_.storage_class = storage_class();
        if (result_.storage_class == StorageClass::simple) return simple();
        const auto frames = static_cast<std::uint32_t>(result_.frames.size());
        add(StorageValue::pixel_class);
        add(StorageValue::closure_count);
        add(StorageValue::frame_count);
        add(StorageValue::tangent_flags, frames);
        add(StorageValue::occlusion_flag);
        if (options_.has_occlusion) add(StorageValue::occlusion);
        // The top layer's word has the first normal; a tangent is an angle around it.
        for (frame_ = 0; frame_ < frames; ++frame_) {
            if (frame_ > 0) add(StorageValue::normal);
            if (needs_tangent(frame_)) add(StorageValue::tangent);
        }
        frame_ = 0;
        const auto closures = static_cast<std::uint32_t>(result_.closures.size());
        for (closure_ = 0; closure_ < closures; ++closure_) {
            const TopologyClosure& closure = topology_.closures[result_.closures[closure_]];
            add(StorageValue::features);
            add(StorageValue::medium);
            add(StorageValue::has_albedo);
            add(StorageValue::is_below);
            if (frames > 1) add(StorageValue::frame);
            for_each_closure_field(closure_, closures, result_.features[closure_], result_.media[closure_],
                                   !is_without_diffuse(closure.node), !closure.is_top,
                                   [this](StorageValue value) { add(value); });
        }
        return std::move(result_);
    }

  private:
    void order() {
        for (std::uint32_t i = 0; i < topology_.closures.size(); ++i) result_.closures.push_back(i);
        std::ranges::stable_partition(result_.closures, [&](std::uint32_t i) { return topology_.closures[i].is_top; });
        for (const std::uint32_t i : result_.closures) {
            const std::uint32_t frame = slot(topology_.closures[i].frame);
            if (std::ranges::find(result_.frames, frame) == result_.frames.end()) result_.frames.push_back(frame);
        }
    }

    std::uint32_t slot(std::uint32_t frame) const {
        return static_cast<std::uint32_t>(std::ranges::find(topology_.frames, frame) - topology_.frames.begin());
    }

    // Words of one slab without features, as the passes of the renderer have always written them; materials know their
    // number only.
    StorageLayout simple() { return std::move(result_); }

    StorageClass storage_class() const {
        std::uint32_t features = 0;
        for (const std::uint32_t one : result_.features) features |= one;
        if ((features & (slab_glints | slab_specular_lut)) != 0) return StorageClass::special;
        if (topology_.closures.size() > 1 || (features & slab_anisotropy) != 0) return StorageClass::complex;
        // A plain slab has a place for the specular weight.
        if (features == slab_f90 && is_white_at_grazing_angles(topology_.closures[0].node)) features = 0;
        return features != 0 || result_.media[0] != StoredMedium::opaque ? StorageClass::single : StorageClass::simple;
    }

    // Whether no slab of the subtree has a color in its F90.
    bool is_white_at_grazing_angles(NodeIndex index) const {
        const Node& node = tree_.visible_tree.nodes[index];
        if (node.kind == NodeKind::slab) {
            const glm::vec3& f90 = node.slab.f90;
            return (node.slab.features & slab_f90) == 0 ||
                   (f90.r == f90.g && f90.g == f90.b &&
                    std::ranges::find(node.textures, "f90", &TextureInput::field) == node.textures.end());
        }
        return is_white_at_grazing_angles(node.first) &&
               (node.kind == NodeKind::coverage || is_white_at_grazing_angles(node.second));
    }

    bool needs_tangent(std::uint32_t frame) const {
        for (std::size_t i = 0; i < result_.closures.size(); ++i) {
            if (slot(topology_.closures[result_.closures[i]].frame) == result_.frames[frame] &&
                (result_.features[i] & slab_anisotropy) != 0)
                return true;
        }
        return false;
    }

    // Whether no pixel of the subtree reflects light from its medium.
    bool is_without_diffuse(NodeIndex index) const {
        const Node& node = tree_.visible_tree.nodes[index];
        switch (node.kind) {
            case NodeKind::slab: return node.slab.albedo == glm::vec3(0.0f);
            case NodeKind::coverage: return is_without_diffuse(node.first);
            case NodeKind::mix:
            case NodeKind::layer: return is_without_diffuse(node.first) && is_without_diffuse(node.second);
        }
        return false;
    }

    void add(StorageValue value, std::uint32_t bits = 0) {
        if (bits == 0) bits = storage_format(value).bits;
        result_.fields.push_back(
            {.value = value, .closure = closure_, .frame = frame_, .offset = result_.bits(), .bits = bits});
    }

    const FlattenedTree& tree_;
    const Topology& topology_;
    const StorageOptions options_;
    StorageLayout result_;
    std::uint32_t closure_ = StorageLayout::no_closure;
    std::uint32_t frame_ = 0;
};

/// A field of a slab as up to three numbers; nothing for what is not the slab's.
glm::dvec3* color_of(Library::Slab& slab, StorageValue value) {
    switch (value) {
        case StorageValue::f0: return &slab.f0;
        case StorageValue::albedo: return &slab.albedo;
        case StorageValue::f90: return &slab.f90;
        case StorageValue::f82: return &slab.f82;
        case StorageValue::fuzz_color: return &slab.fuzz_color;
        default: return nullptr;
    }
}

double* number_of(Library::Slab& slab, StorageValue value) {
    switch (value) {
        case StorageValue::roughness: return &slab.roughness;
        case StorageValue::second_roughness: return &slab.second_roughness;
        case StorageValue::second_weight: return &slab.second_weight;
        case StorageValue::fuzz_amount: return &slab.fuzz_amount;
        case StorageValue::fuzz_roughness: return &slab.fuzz_roughness;
        case StorageValue::anisotropy: return &slab.anisotropy;
        case StorageValue::film_thickness: return &slab.film_thickness;
        case StorageValue::film_ior: return &slab.film_ior;
        case StorageValue::glint_density: return &slab.glint_density;
        case StorageValue::glint_x: return &slab.glint_position.x;
        case StorageValue::glint_y: return &slab.glint_position.y;
        case StorageValue::glint_dx_x: return &slab.glint_dx.x;
        case StorageValue::glint_dx_y: return &slab.glint_dx.y;
        case StorageValue::glint_dy_x: return &slab.glint_dy.x;
        case StorageValue::glint_dy_y: return &slab.glint_dy.y;
        default: return nullptr;
    }
}

glm::dvec3 dither_of_color(glm::uvec2 position, std::uint32_t which) {
    return {library.ordered_dither(position.x, position.y, which),
            library.ordered_dither(position.x, position.y, which + 1),
            library.ordered_dither(position.x, position.y, which + 2)};
}

}  // namespace

std::uint32_t encode_number(const StorageFormat& format, std::uint32_t bits, double value, double dither) {
    switch (format.codec) {
        case StorageCodec::unit:
            return library.pack_unit((value - format.low) / (format.high - format.low), bits, dither);
        case StorageCodec::signed_unit: return library.pack_signed(value, bits, dither);
        case StorageCodec::logarithm: return library.pack_logarithm(value, bits, format.low, format.octaves(), dither);
        case StorageCodec::signed_logarithm:
            return library.pack_signed_logarithm(value, bits, format.low, format.octaves(), dither);
        case StorageCodec::fraction: return library.pack_fraction(value, bits);
        case StorageCodec::angle:
            return static_cast<std::uint32_t>(value / std::numbers::pi * (1u << bits) + 0.5) & ((1u << bits) - 1u);
        default: return 0;
    }
}

double decode_number(const StorageFormat& format, std::uint32_t bits, std::uint32_t code) {
    switch (format.codec) {
        case StorageCodec::unit: return format.low + (format.high - format.low) * library.unpack_unit(code, bits);
        case StorageCodec::signed_unit: return library.unpack_signed(code, bits);
        case StorageCodec::logarithm: return library.unpack_logarithm(code, bits, format.low, format.octaves());
        case StorageCodec::signed_logarithm:
            return library.unpack_signed_logarithm(code, bits, format.low, format.octaves());
        case StorageCodec::fraction: return library.unpack_fraction(code, bits);
        case StorageCodec::angle: return code * std::numbers::pi / (1u << bits);
        default: return code;
    }
}

std::string_view name_of(StorageClass storage_class) {
    switch (storage_class) {
        case StorageClass::simple: return "simple";
        case StorageClass::single: return "single";
        case StorageClass::complex: return "complex";
        case StorageClass::special: return "special";
    }
    return "unknown";
}

std::span<const StorageFormat> storage_formats() { return formats; }
std::span<const StoredFeatureValue> stored_feature_values() { return feature_values; }
const StorageFormat& storage_format(StorageValue value) { return formats[static_cast<std::size_t>(value)]; }
std::uint32_t stored_features() { return feature_bits | slab_medium; }

// Two render targets of material words are always there.
std::uint32_t StorageLayout::material_words() const { return std::max((bits() + 31) / 32, 2u); }

StorageLayout storage_layout(const FlattenedTree& tree, const StorageOptions& options) {
    return Layout(tree, options).run();
}

std::uint32_t pack_subsurface(const Library::Slab& slab, glm::uvec2 position) {
    return library.pack_subsurface(slab.albedo, slab.mean_free_path, slab.phase_anisotropy, slab.thickness, position);
}

StoredPixel pack_pixel(const StorageLayout& layout, const ShadedTree& shaded, const PixelInputs& inputs) {
    StoredPixel pixel;
    pixel.words.assign(layout.material_words(), 0);
    const auto closure_of = [&](std::uint32_t i) -> const ShadedClosure& {
        return shaded.closures[layout.closures[i]];
    };
    pixel.roughness = closure_of(0).slab.roughness;
    double seen_most = -1.0;
    for (std::uint32_t i = 0; i < layout.closures.size(); ++i) {
        if (layout.media[i] != StoredMedium::subsurface) continue;
        const ShadedClosure& closure = closure_of(i);
        const double seen = closure.path.weight.g * closure.coverage;
        if (seen > seen_most) pixel.subsurface = pack_subsurface(closure.slab, inputs.position), seen_most = seen;
    }
    std::uint32_t which = 0;
    for (const StorageField& field : layout.fields) {
        const StorageFormat& format = storage_format(field.value);
        std::uint32_t code = 0;
        const ShadedClosure* closure =
            field.closure == StorageLayout::no_closure ? nullptr : &closure_of(field.closure);
        const std::uint32_t at = field.closure;
        const auto next_dither = [&] { return library.ordered_dither(inputs.position.x, inputs.position.y, which++); };
        const auto color = [&](const glm::dvec3& value) {
            code = library.pack_color(value, dither_of_color(inputs.position, which));
            which += 3;
        };
        switch (field.value) {
            case StorageValue::pixel_class: code = 3; break;
            case StorageValue::closure_count: code = static_cast<std::uint32_t>(layout.closures.size()) - 1; break;
            case StorageValue::frame_count: code = static_cast<std::uint32_t>(layout.frames.size()) - 1; break;
            case StorageValue::tangent_flags:
                for (const StorageField& other : layout.fields) {
                    if (other.value == StorageValue::tangent) code |= 1u << other.frame;
                }
                break;
            case StorageValue::occlusion_flag:
                code = std::ranges::find(layout.fields, StorageValue::occlusion, &StorageField::value) !=
                       layout.fields.end();
                break;
            case StorageValue::occlusion: code = encode_number(format, field.bits, inputs.occlusion, 0.5); break;
            case StorageValue::normal:
                code = library.octahedral_encode(
                    field.frame < inputs.normals.size() ? inputs.normals[field.frame] : glm::dvec3(0, 0, 1),
                    static_cast<int>(field.bits / 2));
                break;
            case StorageValue::tangent:
                code = encode_number(
                    format, field.bits,
                    field.frame < inputs.tangent_angles.size() ? inputs.tangent_angles[field.frame] : 0.0, 0.5);
                break;
            case StorageValue::features: code = layout.features[at]; break;
            case StorageValue::medium: code = static_cast<std::uint32_t>(layout.media[at]); break;
            case StorageValue::has_albedo:
                code = std::ranges::any_of(layout.fields, [&](const StorageField& other) {
                    return other.value == StorageValue::albedo && other.closure == at;
                });
                break;
            case StorageValue::is_below:
                code = std::ranges::any_of(layout.fields, [&](const StorageField& other) {
                    return other.value == StorageValue::weight && other.closure == at;
                });
                break;
            case StorageValue::frame:
                code = closure->frame_slot < layout.frames.size()
                           ? static_cast<std::uint32_t>(std::ranges::find(layout.frames, closure->frame_slot) -
                                                        layout.frames.begin())
                           : 0;
                break;
            case StorageValue::specular_lut: code = closure->slab.specular_lut & 0xffu; break;
            case StorageValue::medium_transmittance:
                color(
                    glm::dvec3(library.medium_transmittance(closure->slab.mean_free_path.x, closure->slab.thickness),
                               library.medium_transmittance(closure->slab.mean_free_path.y, closure->slab.thickness),
                               library.medium_transmittance(closure->slab.mean_free_path.z, closure->slab.thickness)));
                break;
            case StorageValue::grey_weight:
                code = encode_number(format, field.bits, closure->path.weight.g * closure->coverage, next_dither());
                break;
            case StorageValue::weight: color(closure->path.weight * closure->coverage); break;
            case StorageValue::path_transmittance: color(closure->path.transmittance); break;
            case StorageValue::path_uncovered:
                code = encode_number(
                    format, field.bits,
                    (closure->path.uncovered.r + closure->path.uncovered.g + closure->path.uncovered.b) / 3.0,
                    next_dither());
                break;
            case StorageValue::path_spread_up:
                code = encode_number(
                    format, field.bits,
                    (closure->path.spread_up.r + closure->path.spread_up.g + closure->path.spread_up.b) / 3.0,
                    next_dither());
                break;
            case StorageValue::path_spread_down:
                code = encode_number(
                    format, field.bits,
                    (closure->path.spread_down.r + closure->path.spread_down.g + closure->path.spread_down.b) / 3.0,
                    next_dither());
                break;
            case StorageValue::path_ior_excess:
                code = encode_number(format, field.bits, closure->path.ior_excess, next_dither());
                break;
            case StorageValue::path_bend:
                code = encode_number(format, field.bits, closure->path.bend, next_dither());
                break;
            default: {
                Library::Slab slab = closure->slab;
                slab.f90 = library.grazing_tint(slab.f90) * slab.specular_weight;
                if (const glm::dvec3* value = color_of(slab, field.value)) {
                    color(*value);
                } else if (const double* number = number_of(slab, field.value)) {
                    code = encode_number(format, field.bits, *number, next_dither());
                }
            }
        }
        const std::uint32_t word = field.offset / 32, shift = field.offset % 32;
        pixel.words[word] |= code << shift;
        if (shift + field.bits > 32) pixel.words[word + 1] |= code >> (32 - shift);
    }
    return pixel;
}

Expected<UnpackedMaterial> unpack_pixel(const StoredPixel& pixel) {
    UnpackedMaterial material;
    std::uint32_t cursor = 0, closure = StorageLayout::no_closure, frame = 0;
    bool is_complete = true;
    const auto read = [&](StorageValue value, std::uint32_t bits = 0) -> std::uint32_t {
        if (bits == 0) bits = storage_format(value).bits;
        const std::uint32_t word = cursor / 32, shift = cursor % 32;
        if (cursor + bits > 32 * pixel.words.size()) {
            is_complete = false;
            return 0;
        }
        std::uint32_t code = pixel.words[word] >> shift;
        if (shift + bits > 32) code |= pixel.words[word + 1] << (32 - shift);
        code &= bits == 32 ? ~0u : (1u << bits) - 1u;
        material.fields.push_back({.value = value, .closure = closure, .frame = frame, .offset = cursor, .bits = bits});
        material.codes.push_back(code);
        cursor += bits;
        return code;
    };
    read(StorageValue::pixel_class);
    const std::uint32_t closures = read(StorageValue::closure_count) + 1, frames = read(StorageValue::frame_count) + 1;
    const std::uint32_t tangents = read(StorageValue::tangent_flags, frames);
    if (read(StorageValue::occlusion_flag) != 0) {
        material.occlusion =
            library.unpack_unit(read(StorageValue::occlusion), storage_format(StorageValue::occlusion).bits);
    }
    for (frame = 0; frame < frames; ++frame) {
        if (frame > 0) {
            const auto bits = static_cast<int>(storage_format(StorageValue::normal).bits / 2);
            material.normals.push_back(library.octahedral_decode(read(StorageValue::normal), bits));
        }
        const StorageFormat& format = storage_format(StorageValue::tangent);
        material.tangent_angles.push_back((tangents >> frame & 1u) != 0
                                              ? decode_number(format, format.bits, read(StorageValue::tangent))
                                              : 0.0);
    }
    frame = 0;
    for (closure = 0; closure < closures && is_complete; ++closure) {
        UnpackedClosure result;
        result.slab = Library::slab_of(Slab{});
        result.path = library.open_path();
        const std::uint32_t features = read(StorageValue::features);
        const auto medium = static_cast<StoredMedium>(read(StorageValue::medium));
        const bool has_albedo = read(StorageValue::has_albedo) != 0, is_below = read(StorageValue::is_below) != 0;
        if (frames > 1) result.frame = read(StorageValue::frame);
        result.medium = medium;
        result.slab.features = features;
        result.slab.roughness = pixel.roughness;
        result.slab.albedo = glm::dvec3(0.0);
        for_each_closure_field(closure, closures, features, medium, has_albedo, is_below, [&](StorageValue value) {
            const StorageFormat& format = storage_format(value);
            const std::uint32_t code = read(value);
            if (glm::dvec3* color = color_of(result.slab, value)) {
                *color = library.unpack_color(code);
                if (value == StorageValue::f90) result.slab.specular_weight = library.largest(*color);
            } else if (double* number = number_of(result.slab, value)) {
                *number = decode_number(format, format.bits, code);
            } else if (value == StorageValue::specular_lut) {
                result.slab.specular_lut = code;
            } else if (value == StorageValue::grey_weight) {
                result.path.weight = glm::dvec3(decode_number(format, format.bits, code));
            } else if (value == StorageValue::weight) {
                result.path.weight = library.unpack_color(code);
            } else if (value == StorageValue::path_transmittance) {
                result.path.transmittance = library.unpack_color(code);
            } else if (value == StorageValue::path_uncovered) {
                result.path.uncovered = glm::dvec3(decode_number(format, format.bits, code));
            } else if (value == StorageValue::path_spread_up) {
                result.path.spread_up = glm::dvec3(decode_number(format, format.bits, code));
            } else if (value == StorageValue::path_spread_down) {
                result.path.spread_down = glm::dvec3(decode_number(format, format.bits, code));
            } else if (value == StorageValue::path_ior_excess) {
                result.path.ior_excess = decode_number(format, format.bits, code);
            } else if (value == StorageValue::path_bend) {
                result.path.bend = decode_number(format, format.bits, code);
            } else if (value == StorageValue::medium_transmittance) {
                const glm::dvec3 transmittance = library.unpack_color(code);
                for (int channel = 0; channel < 3; ++channel) {
                    result.slab.mean_free_path[channel] =
                        library.transmittance_to_mean_free_path(transmittance[channel], 1.0);
                }
            }
        });
        if (medium != StoredMedium::opaque) {
            result.slab.features |= slab_medium;
            result.slab.phase_anisotropy = 0.0;
            result.slab.thickness = 1.0;
        }
        if (medium == StoredMedium::subsurface) {
            result.slab.mean_free_path = library.unpack_mean_free_path(pixel.subsurface);
            result.slab.thickness = library.unpack_thickness(pixel.subsurface);
        }
        material.closures.push_back(result);
    }
    if (!is_complete) {
        return fail(ErrorCode::invalid_argument, "read stored material", fmt::format("{} words", pixel.words.size()),
                    "its header asks for more", "Give all words of the pixel, from material.0 on.");
    }
    return material;
}

}  // namespace nacre::materials
