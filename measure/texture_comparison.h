// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/image.h"
#include "rhi/format.h"

/// @file
/// Compares the texels of a texture that two devices made.
///
///     TextureData a{.name = "depth", .format = rhi::Format::d32_float, .width = 640, .height = 360, .bytes = ...};
///     NACRE_TRY(TextureDifference d, compare_textures(a, b));
///     fmt::print("{} of {} texels differ, by up to {}\n", d.differing, d.texels, d.max_abs);
///
/// Packed words are compared by what they mean: a `BitField` says where a value lies in a texel and how it is coded.
/// Two values differ when they are more than one quantization step apart. All functions are thread-safe.

namespace nacre::measure {

/// How the bits of a field stand for a value.
enum class FieldKind : std::uint8_t {
    uint,        ///< A number or flags: any difference counts.
    unorm,       ///< code / (2^bits - 1); a step is one code.
    squared,     ///< (code / (2^bits - 1))^2; a step is one code.
    snorm,       ///< Two's complement, code / (2^(bits-1) - 1); a step is one code.
    ufloat,      ///< Unsigned float of any layout, or any code that grows with its value; a step is one code.
    circular,    ///< code / 2^bits of a turn; a step is one code, the last code neighbors the first.
    octahedral,  ///< A direction: x in the lower half of the bits, y in the upper (`bits` even); with h bits each,
                 ///< codes 0 to 2^h - 2 are [-1, 1], so that -1, 0 and 1 are exact (Meyer et al. 2010).
};

/// "uint", "unorm", ... as in JSON.
std::string_view name_of(FieldKind kind);

/// One value inside a texel of a format with integer channels of 32 bits.
struct BitField {
    std::string name;            ///< "roughness"; for reports.
    std::uint32_t channel = 0;   ///< Channel of the format, 0 to 3.
    std::uint32_t shift = 0;     ///< Lowest bit.
    std::uint32_t bits = 1;      ///< 1 to 32; shift + bits <= 32.
    FieldKind kind = FieldKind::uint;
};

/// A texture as read back: tightly packed rows, top row first, array layers (or depth slices) one after the other.
struct TextureData {
    std::string name;
    rhi::Format format = rhi::Format::undefined;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t layers = 1;
    std::vector<std::byte> bytes;
    std::vector<BitField> fields;  ///< Empty for textures that are not packed.

    [[nodiscard]] std::uint64_t texels() const { return std::uint64_t{width} * height * layers; }
};

/// The differences of one field over all texels.
struct FieldDifference {
    std::string name;
    std::uint64_t differing = 0;  ///< Texels with more than one quantization step between the values.
    double max_abs = 0.0;  ///< Largest difference of decoded values (radians for octahedral, turns for circular).
};

struct TextureDifference {
    std::string name;
    std::uint64_t texels = 0;
    std::uint64_t differing = 0;         ///< Texels that are not bit-equal.
    std::uint64_t fields_differing = 0;  ///< Texels of which a field is off by more than one step; 0 without fields.
    double max_abs = 0.0;                ///< Largest difference of decoded values: of fields where there are some, else
                                         ///< of channels; infinite where only one side is finite.
    double max_rel = 0.0;                ///< Largest |a - b| / max(|a|, |b|), [0, 2].
    std::vector<FieldDifference> fields;
};

/// Errors: invalid_argument (format, size or fields differ between the two, too few bytes, a field outside its texel),
/// unsupported (block-compressed formats).
Expected<TextureDifference> compare_textures(const TextureData& reference, const TextureData& test);

/// The channels of texel `index` (row-major over all layers) as numbers, missing ones 0. The format must not be
/// block-compressed and `bytes` must hold the texel.
void decode_texel(const TextureData& texture, std::uint64_t index, double (&channels)[4]);

/// The decoded value of a field of a 32-bit word; for octahedral ones 0 (see `decode_octahedral`).
double decode_field(const BitField& field, std::uint32_t word);

/// The unit direction of an octahedral field.
void decode_octahedral(const BitField& field, std::uint32_t word, double (&direction)[3]);

/// A picture of the texture's first layer for people: colors as they are, packed words as their first three fields,
/// other values scaled to [0, 1] between the smallest and largest finite one. Linear light, 3 channels.
Expected<Image> picture_of(const TextureData& texture);

/// White where a texel's fields (or, without fields, bits) differ, else black. 1 channel, first layer.
Expected<Image> difference_mask(const TextureData& reference, const TextureData& test);

/// The first layer as channels of an OpenEXR layer: integers of 32 bits as they are, everything else as floats.
Expected<ImageLayer> exr_layer_of(const TextureData& texture);

}  // namespace nacre::measure
