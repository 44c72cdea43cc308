// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "materials/evaluation.h"
#include "materials/topology.h"

/// @file
/// A material in the G-buffer: which fields a pixel holds, in how many bits, and the way in and out of them on the
/// host. materials/storage_shader.h prints the same for devices.
///
///     const StorageLayout layout = storage_layout(flat);
///     layout.total_bytes();   // 12 for one slab without features
///     const StoredPixel pixel = pack_pixel(layout, state, {.occlusion = 1.0});
///     const UnpackedMaterial material = *unpack_pixel(pixel);
///
/// Material words are one stream of bits from the lowest of the first word on: a header, the tangent frames, then
/// closure after closure, each with the fields of its own features only. The reader finds its way by the bits that it
/// reads; the writer knows every place beforehand, since the layout is that of the topology.

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

/// What a field of the stream holds.
enum class StorageValue : std::uint8_t {
    // of the pixel
    pixel_class, closure_count, frame_count, tangent_flags, occlusion_flag, occlusion,
    // of a frame
    normal, tangent,
    // of a closure: how to read the rest
    features, medium, has_albedo, is_below, frame,
    // of a closure
    f0, albedo, roughness, f90, f82, second_roughness, second_weight, fuzz_amount, fuzz_color, fuzz_roughness,
    anisotropy, film_thickness, film_ior, specular_lut, glint_density, glint_x, glint_y, glint_dx_x, glint_dx_y,
    glint_dy_x, glint_dy_y, medium_transmittance, grey_weight, weight, path_transmittance, path_uncovered, path_spread_up,
    path_spread_down, path_ior_excess, path_bend,
};

/// How a number becomes bits (materials/closures/stored_fields.glsl).
enum class StorageCodec : std::uint8_t {
    integer,
    unit,              ///< [0, 1], even steps.
    signed_unit,       ///< [-1, 1], even steps, 0 and both ends exact.
    color,             ///< Square roots of three channels, 7, 7 and 6 bits.
    logarithm,         ///< 0 and `low` to `high`.
    signed_logarithm,
    fraction,          ///< What is behind the point.
    direction,         ///< Octahedral.
    angle,             ///< Of a tangent, over half a turn.
};

/// Everything about a kind of field but its place.
struct StorageFormat {
    StorageValue value;
    const char* name;  ///< "second roughness"
    std::uint32_t bits;
    StorageCodec codec;
    double low = 0.0, high = 1.0;  ///< Of `unit` and `logarithm`: range of the values.

    [[nodiscard]] double octaves() const { return std::log2(high / low); }
};

/// Of any value.
[[nodiscard]] const StorageFormat& storage_format(StorageValue value);
[[nodiscard]] std::span<const StorageFormat> storage_formats();

/// A number as pack_pixel() stores it, in `bits` instead of the format's own; for codecs of one number: neither
/// `integer` nor `color` nor `direction`.
/// @param dither  in (0, 1); one half rounds. `fraction` and `angle` do without
[[nodiscard]] std::uint32_t encode_number(const StorageFormat& format, std::uint32_t bits, double value, double dither);

/// Back. Of `integer` the code itself.
[[nodiscard]] double decode_number(const StorageFormat& format, std::uint32_t bits, std::uint32_t code);

/// A field at its place.
struct StorageField {
    StorageValue value;
    std::uint32_t closure;  ///< Which closure it belongs to, as the stream counts; StorageLayout::no_closure: none.
    std::uint32_t frame;    ///< Of frames: which, as the stream counts.
    std::uint32_t offset;   ///< Bits from the start of the stream.
    std::uint32_t bits;
};

/// What the medium of a stored closure is (StorageValue::medium).
enum class StoredMedium : std::uint8_t {
    opaque,         ///< None: opaque, or clear and without light of its own.
    subsurface,     ///< By the word of subsurface data.
    transmittance,  ///< By its own transmittance along the normal.
};

/// The brightness of a stored F90, which closures do without, is the specular weight.
///
/// Material words hold `fields` one after another; the top layer's word (normal and roughness) and the word of
/// subsurface scattering lie apart, since other passes read them alone.
struct StorageLayout {
    static constexpr std::uint32_t no_closure = ~0u;
    static constexpr std::uint32_t max_closures = 8;
    static constexpr std::uint32_t max_frames = 4;

    StorageClass storage_class = StorageClass::simple;
    std::vector<StorageField> fields;
    bool has_subsurface = false;
    /// Topology::closures in the order of the stream: the first lies on top, its normal and roughness are those of the
    /// top layer's word.
    std::vector<std::uint32_t> closures;
    /// Positions in Topology::frames in the order of the stream.
    std::vector<std::uint32_t> frames;
    /// For each closure of the stream: stored features (those below slab_medium), and its medium.
    std::vector<std::uint32_t> features;
    std::vector<StoredMedium> media;

    [[nodiscard]] std::uint32_t bits() const { return fields.empty() ? 0 : fields.back().offset + fields.back().bits; }
    /// 32-bit words that `fields` take; at least 2.
    [[nodiscard]] std::uint32_t material_words() const;
    /// Material words, top layer and subsurface data.
    [[nodiscard]] std::uint32_t total_bytes() const { return 4 * (material_words() + 1 + (has_subsurface ? 1u : 0u)); }
};

/// What the layout depends on beside the tree.
struct StorageOptions {
    bool has_occlusion = false;  ///< Ambient occlusion differs from 1 somewhere.
};

/// The layout of a topology; `max_closures` and `max_frames` hold for whatever simplify() was given these limits.
[[nodiscard]] StorageLayout storage_layout(const FlattenedTree& tree, const StorageOptions& options = {});

/// Fields that a feature brings, in the order of the stream.
struct StoredFeatureValue {
    std::uint32_t feature;
    StorageValue value;
};
[[nodiscard]] std::span<const StoredFeatureValue> stored_feature_values();

/// Features that a stored closure can have; the others are the pixel's or leave no trace.
[[nodiscard]] std::uint32_t stored_features();

/// A pixel as it lies in memory.
struct StoredPixel {
    std::vector<std::uint32_t> words;
    std::uint32_t subsurface = 0;  ///< pack_subsurface(), where a closure has StoredMedium::subsurface.
    double roughness = 1.0;        ///< Of the first closure: goes into the top layer's word, not here.
};

/// What a pixel has beside its closures.
struct PixelInputs {
    double occlusion = 1.0;
    glm::uvec2 position{0};               ///< Of the pixel: chooses the dither.
    std::vector<glm::dvec3> normals{};    ///< For each frame of the stream; missing ones are +z.
    std::vector<double> tangent_angles{}; ///< Radians around the normal.
};

/// @param shaded  of the tree that the layout is of
[[nodiscard]] StoredPixel pack_pixel(const StorageLayout& layout, const ShadedTree& shaded, const PixelInputs& inputs);

/// One closure as it is read back. What lies in other words (roughness of the first, subsurface data) is filled in.
struct UnpackedClosure {
    closures::Library::Slab slab;
    closures::Library::Path path;  ///< Its weight includes the closure's own coverage.
    std::uint32_t frame = 0;
    StoredMedium medium = StoredMedium::opaque;
};

struct UnpackedMaterial {
    double occlusion = 1.0;
    std::vector<glm::dvec3> normals;  ///< From the second frame on; the first lies in the top layer's word.
    std::vector<double> tangent_angles;
    std::vector<UnpackedClosure> closures;
    /// The fields as they were read, for comparisons: place and codes.
    std::vector<StorageField> fields;
    std::vector<std::uint32_t> codes;
};

/// Reads what pack_pixel() or a device has written. Error invalid_argument: the bits are those of no material (they ask
/// for more words than there are).
[[nodiscard]] Expected<UnpackedMaterial> unpack_pixel(const StoredPixel& pixel);

/// Mean free path and thickness in one word: three times 8 bits and 8 bits. Phase functions are folded in: the medium
/// is the one with isotropic scattering that has the same similarity.
[[nodiscard]] std::uint32_t pack_subsurface(const closures::Library::Slab& slab, glm::uvec2 position);

}  // namespace nacre::materials
