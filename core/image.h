// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/error.h"

/// @file
/// Pictures in memory and in files: PNG, JPEG, Radiance (.hdr) and OpenEXR are read; PNG and OpenEXR are written.
///
///     NACRE_TRY(ImageBytes base_color, read_image_bytes("wood.png"));        // RGBA8, as stored
///     NACRE_TRY(Image sky, read_image("venice_sunset_1k.hdr"));              // linear floats
///     NACRE_CHECK(write_png("out/picture.png", sky));                        // linear -> 8-bit sRGB
///     NACRE_CHECK(write_exr("out/picture.exr", make_layered_image(sky)));    // 32-bit float
///
/// The format is found from the first bytes, never from the file's name. Sizes are checked against `ImageLimits`
/// before anything of that size is allocated. A damaged or truncated file is an `Error` that names the file and
/// what is wrong with it. All functions may be called from any thread.

namespace nacre {

/// A picture of 32-bit floats, linear light unless said otherwise. Row-major, top row first, channels interleaved.
struct Image {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t channels = 0;  ///< 1 (luminance), 2 (luminance, alpha), 3 (RGB) or 4 (RGBA, alpha not premultiplied).
    std::vector<float> pixels;   ///< width * height * channels values.

    [[nodiscard]] std::size_t texel_count() const { return std::size_t{width} * height; }
    [[nodiscard]] const float* texel(std::uint32_t x, std::uint32_t y) const {
        return pixels.data() + (std::size_t{y} * width + x) * channels;
    }
    [[nodiscard]] float* texel(std::uint32_t x, std::uint32_t y) {
        return pixels.data() + (std::size_t{y} * width + x) * channels;
    }
    bool operator==(const Image&) const = default;
};

/// A picture of 8- or 16-bit integers, values as stored in the file (no color conversion). Layout as `Image`.
struct ImageBytes {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t channels = 0;           ///< 1 to 4, meaning as in `Image`.
    std::uint32_t bytes_per_channel = 1;  ///< 1, or 2 (16-bit values in the byte order of the machine).
    std::vector<std::uint8_t> bytes;      ///< width * height * channels * bytes_per_channel bytes.

    [[nodiscard]] std::size_t texel_count() const { return std::size_t{width} * height; }
    bool operator==(const ImageBytes&) const = default;
};

enum class ImageFormat { png, jpeg, radiance, openexr };

/// "PNG", "JPEG", "Radiance HDR", "OpenEXR".
std::string_view name_of(ImageFormat format);

/// What a file says about itself, read without decoding a pixel.
struct ImageInfo {
    ImageFormat format = ImageFormat::png;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t channels = 0;          ///< As decoded: a palette counts as RGB, or RGBA with transparency.
    std::uint32_t bits_per_channel = 0;  ///< 8, 16 or 32.
};

/// Refuses pictures that are larger than a caller can want, before memory is taken for them.
struct ImageLimits {
    std::uint32_t max_width = 65536;
    std::uint32_t max_height = 65536;
    std::uint64_t max_pixels = std::uint64_t{1} << 28;        ///< 16,384 x 16,384.
    std::uint64_t max_file_bytes = std::uint64_t{1} << 32;    ///< 4 GiB.
};

/// How `read_image_bytes` delivers its texels.
struct ImageBytesOptions {
    std::uint32_t channels = 4;  ///< 1 to 4, or 0 for those of the file. Missing alpha is filled with the maximum.
    bool keep_16_bit = false;    ///< true: 16-bit PNGs give 2 bytes per channel; false: they are rounded to 8 bits.
};

/// @name Reading
/// Memory variants take the name to use in error messages ("scene 'car.gltf': image 3").
/// Errors: not_found, input_output (cannot be read), parse (damaged, truncated, not one of the four formats),
/// unsupported (valid, but of a kind that is not read: deep OpenEXR, XYZE Radiance), out_of_memory (over the limits).
/// @{
Expected<ImageInfo> read_image_info(const std::filesystem::path& file, const ImageLimits& limits = {});
Expected<ImageInfo> read_image_info(std::span<const std::byte> data, std::string_view name,
                                    const ImageLimits& limits = {});

/// Texels as stored. PNG and JPEG only; Radiance and OpenEXR are `unsupported` here (use `read_image`). Color profiles
/// and gamma chunks are ignored, as glTF asks.
Expected<ImageBytes> read_image_bytes(const std::filesystem::path& file, const ImageBytesOptions& options = {},
                                      const ImageLimits& limits = {});
Expected<ImageBytes> read_image_bytes(std::span<const std::byte> data, std::string_view name,
                                      const ImageBytesOptions& options = {}, const ImageLimits& limits = {});

/// Linear floats from any of the formats: PNG and JPEG are decoded from sRGB (alpha is not), Radiance and OpenEXR are
/// taken as they are. Of an OpenEXR file the channels R, G, B, A (or Y, A) of the unnamed layer, else those of the
/// first layer that has them; missing ones of R, G, B are 0.
Expected<Image> read_image(const std::filesystem::path& file, const ImageLimits& limits = {});
Expected<Image> read_image(std::span<const std::byte> data, std::string_view name, const ImageLimits& limits = {});
/// @}

/// One channel of an OpenEXR file: 32-bit floats, or 32-bit unsigned integers for packed words.
struct ImageChannel {
    std::string name;  ///< "R", "depth", ...
    std::variant<std::vector<float>, std::vector<std::uint32_t>> values;  ///< width * height, top row first.
    bool operator==(const ImageChannel&) const = default;
};

/// Channels that belong together, in the file named "layer.channel"; the unnamed layer is the picture itself.
struct ImageLayer {
    std::string name;
    std::vector<ImageChannel> channels;
    bool operator==(const ImageLayer&) const = default;
};

/// A picture with all its layers, all of one size.
struct LayeredImage {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<ImageLayer> layers;
    bool operator==(const LayeredImage&) const = default;
};

/// A layer with the channels of `image`, named Y / Y,A / R,G,B / R,G,B,A.
ImageLayer make_layer(std::string name, const Image& image);

/// `image` as the unnamed layer of a file.
LayeredImage make_layered_image(const Image& image);

/// All layers of an OpenEXR file. Halves arrive as floats. Errors as for `read_image`.
Expected<LayeredImage> read_exr_layers(const std::filesystem::path& file, const ImageLimits& limits = {});
Expected<LayeredImage> read_exr_layers(std::span<const std::byte> data, std::string_view name,
                                       const ImageLimits& limits = {});

/// @name Conversions
/// @{
/// 8-bit sRGB from linear floats, exactly rounded; values outside [0, 1] are clamped, NaN becomes 0; alpha stays
/// linear.
ImageBytes srgb_bytes_from_linear(const Image& image);
/// Linear floats from 8- or 16-bit sRGB; alpha stays as it is.
Image linear_from_srgb_bytes(const ImageBytes& image);
/// @}

/// @name Writing
/// Folders on the way are made. A file appears under its name only when it is complete (written beside, then renamed).
/// Errors: invalid_argument (empty picture, wrong number of values, duplicate channel), input_output.
/// @{
/// The bytes of a PNG file, 8 or 16 bits as in `image`.
Expected<std::vector<std::byte>> encode_png(const ImageBytes& image);
Expected<void> write_png(const std::filesystem::path& file, const ImageBytes& image);
/// Encodes linear light to 8-bit sRGB first.
Expected<void> write_png(const std::filesystem::path& file, const Image& image);
/// 32-bit channels, ZIP-compressed without loss; floats keep every bit, NaN payloads included.
Expected<void> write_exr(const std::filesystem::path& file, const LayeredImage& image);
/// @}

}  // namespace nacre
