// SPDX-License-Identifier: Apache-2.0
#include "core/image.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <optional>
#include <set>

#include "core/file.h"
#include "core/image_formats.h"
#include "core/srgb.h"

namespace nacre {
namespace {

using image_formats::check_limits;

constexpr std::string_view attempt_read = "read picture";
constexpr std::string_view attempt_write = "write picture";

std::string subject_of(const std::filesystem::path& file) { return fmt::format("'{}'", file.string()); }

std::string subject_of(std::string_view name) { return fmt::format("'{}'", name); }

bool starts_with(std::span<const std::byte> data, std::string_view magic) {
    return data.size() >= magic.size() && std::memcmp(data.data(), magic.data(), magic.size()) == 0;
}

std::optional<ImageFormat> format_of(std::span<const std::byte> data) {
    if (starts_with(data, "\x89PNG\r\n\x1a\n")) return ImageFormat::png;
    if (starts_with(data, "\xff\xd8\xff")) return ImageFormat::jpeg;
    if (starts_with(data, "#?RADIANCE") || starts_with(data, "#?RGBE")) return ImageFormat::radiance;
    if (starts_with(data, "\x76\x2f\x31\x01")) return ImageFormat::openexr;
    return std::nullopt;
}

Expected<ImageInfo> info_of(std::span<const std::byte> data, const std::string& subject, const ImageLimits& limits) {
    const std::optional<ImageFormat> format = format_of(data);
    if (!format) {
        return fail(ErrorCode::parse, std::string(attempt_read), subject,
                    data.empty() ? "the file is empty"
                                 : "the first bytes are those of no picture format that Nacre reads",
                    "Use PNG, JPEG, Radiance HDR or OpenEXR.");
    }
    Expected<ImageInfo> info;
    switch (*format) {
        case ImageFormat::png: info = image_formats::png_info(data, subject); break;
        case ImageFormat::jpeg: info = image_formats::jpeg_info(data, subject); break;
        case ImageFormat::radiance: info = image_formats::radiance_info(data, subject); break;
        case ImageFormat::openexr: info = image_formats::exr_info(data, subject); break;
    }
    if (!info) return info;
    NACRE_CHECK(check_limits(*info, limits, subject));
    return info;
}

// Memory can run out under a picture that the limits allow; that is an error of the caller's machine, not a crash.
template <typename Function>
auto guard_memory(const std::string& subject, Function function) -> decltype(function()) {
    try {
        return function();
    } catch (const std::bad_alloc&) {
        return fail(ErrorCode::out_of_memory, std::string(attempt_read), subject,
                    "the memory for its pixels cannot be had", "Use a smaller picture.");
    }
}

// Luminance is copied to red, green and blue; color to luminance by the weights of Rec. 709.
template <typename T>
void convert_texel(const T* from, std::uint32_t from_channels, T* to, std::uint32_t to_channels, T opaque) {
    const bool from_color = from_channels >= 3;
    const T alpha = from_channels == 2 ? from[1] : from_channels == 4 ? from[3] : opaque;
    if (to_channels >= 3) {
        for (std::uint32_t c = 0; c < 3; ++c) to[c] = from_color ? from[c] : from[0];
        if (to_channels == 4) to[3] = alpha;
    } else {
        to[0] = from_color ? static_cast<T>(0.2126 * from[0] + 0.7152 * from[1] + 0.0722 * from[2] + 0.5) : from[0];
        if (to_channels == 2) to[1] = alpha;
    }
}

ImageBytes with_channels(ImageBytes image, std::uint32_t channels) {
    if (channels == 0 || channels == image.channels) return image;
    ImageBytes result{image.width, image.height, channels, image.bytes_per_channel, {}};
    const std::size_t count = image.texel_count();
    result.bytes.resize(count * channels * image.bytes_per_channel);
    if (image.bytes_per_channel == 1) {
        for (std::size_t i = 0; i < count; ++i) {
            convert_texel<std::uint8_t>(&image.bytes[i * image.channels], image.channels, &result.bytes[i * channels],
                                        channels, 255);
        }
    } else {
        std::uint16_t from[4] = {};
        std::uint16_t to[4] = {};
        for (std::size_t i = 0; i < count; ++i) {
            std::memcpy(from, &image.bytes[i * image.channels * 2], image.channels * 2);
            convert_texel<std::uint16_t>(from, image.channels, to, channels, 65535);
            std::memcpy(&result.bytes[i * channels * 2], to, channels * 2);
        }
    }
    return result;
}

Expected<ImageBytes> bytes_of(std::span<const std::byte> data, const std::string& subject,
                              const ImageBytesOptions& options, const ImageLimits& limits) {
    if (options.channels > 4) {
        return fail(ErrorCode::invalid_argument, std::string(attempt_read), subject,
                    fmt::format("{} channels were asked for", options.channels), "Ask for 0 to 4.");
    }
    return guard_memory(subject, [&]() -> Expected<ImageBytes> {
        NACRE_TRY(const ImageInfo info, info_of(data, subject, limits));
        if (info.format != ImageFormat::png && info.format != ImageFormat::jpeg) {
            return fail(ErrorCode::unsupported, std::string(attempt_read), subject,
                        fmt::format("it is {}, which holds floats, not bytes", name_of(info.format)),
                        "Use a PNG or JPEG file here.");
        }
        NACRE_TRY(ImageBytes image, info.format == ImageFormat::png
                                        ? image_formats::decode_png(data, subject, options.keep_16_bit, limits)
                                        : image_formats::decode_jpeg(data, subject));
        return with_channels(std::move(image), options.channels);
    });
}

// Picks the color channels of the unnamed layer, else of the first layer that has some.
Expected<Image> color_of(const LayeredImage& layered, const std::string& subject) {
    const auto find = [](const ImageLayer& layer, std::string_view name) -> const std::vector<float>* {
        for (const ImageChannel& channel : layer.channels) {
            if (channel.name == name) return std::get_if<std::vector<float>>(&channel.values);
        }
        return nullptr;
    };
    const auto is_color = [&](const ImageLayer& layer) {
        return find(layer, "R") || find(layer, "G") || find(layer, "B") || find(layer, "Y");
    };
    auto layer = std::ranges::find_if(layered.layers, [&](const auto& l) { return l.name.empty() && is_color(l); });
    if (layer == layered.layers.end()) layer = std::ranges::find_if(layered.layers, is_color);
    if (layer == layered.layers.end()) {
        return fail(ErrorCode::unsupported, std::string(attempt_read), subject,
                    "it has none of the float channels R, G, B or Y", "Write the picture with channels R, G and B.");
    }
    const bool luminance = !find(*layer, "R") && !find(*layer, "G") && !find(*layer, "B");
    std::vector<const std::vector<float>*> sources;
    if (luminance) sources = {find(*layer, "Y")};
    else sources = {find(*layer, "R"), find(*layer, "G"), find(*layer, "B")};
    if (find(*layer, "A")) sources.push_back(find(*layer, "A"));

    Image image{layered.width, layered.height, static_cast<std::uint32_t>(sources.size()), {}};
    image.pixels.resize(image.texel_count() * sources.size());
    for (std::size_t c = 0; c < sources.size(); ++c) {
        if (!sources[c]) continue;
        for (std::size_t i = 0; i < image.texel_count(); ++i) image.pixels[i * sources.size() + c] = (*sources[c])[i];
    }
    return image;
}

Expected<Image> linear_of(std::span<const std::byte> data, const std::string& subject, const ImageLimits& limits) {
    return guard_memory(subject, [&]() -> Expected<Image> {
        NACRE_TRY(const ImageInfo info, info_of(data, subject, limits));
        switch (info.format) {
            case ImageFormat::radiance: return image_formats::decode_radiance(data, subject);
            case ImageFormat::openexr: {
                NACRE_TRY(const LayeredImage layered, image_formats::decode_exr(data, subject));
                return color_of(layered, subject);
            }
            case ImageFormat::png:
            case ImageFormat::jpeg: break;
        }
        NACRE_TRY(const ImageBytes bytes, bytes_of(data, subject, {.channels = 0, .keep_16_bit = true}, limits));
        return linear_from_srgb_bytes(bytes);
    });
}

Expected<LayeredImage> layers_of(std::span<const std::byte> data, const std::string& subject,
                                 const ImageLimits& limits) {
    return guard_memory(subject, [&]() -> Expected<LayeredImage> {
        NACRE_TRY(const ImageInfo info, info_of(data, subject, limits));
        if (info.format != ImageFormat::openexr) {
            return fail(ErrorCode::unsupported, std::string(attempt_read), subject,
                        fmt::format("it is {}, which has no layers", name_of(info.format)), "Use an OpenEXR file.");
        }
        return image_formats::decode_exr(data, subject);
    });
}

Expected<void> check_layers(const LayeredImage& image, const std::string& subject) {
    const auto wrong = [&](std::string reason) {
        return fail(ErrorCode::invalid_argument, std::string(attempt_write), subject, std::move(reason));
    };
    if (image.width == 0 || image.height == 0)
        return wrong(fmt::format("its size is {} x {}", image.width, image.height));
    std::set<std::string> names;
    for (const ImageLayer& layer : image.layers) {
        for (const ImageChannel& channel : layer.channels) {
            const std::size_t count = std::visit([](const auto& values) { return values.size(); }, channel.values);
            const std::string name = layer.name.empty() ? channel.name : layer.name + "." + channel.name;
            if (channel.name.empty()) return wrong(fmt::format("a channel of layer '{}' has no name", layer.name));
            if (name.size() > 255) return wrong(fmt::format("channel name '{}' is longer than 255 bytes", name));
            if (!names.insert(name).second) return wrong(fmt::format("channel '{}' occurs twice", name));
            if (count != std::size_t{image.width} * image.height) {
                return wrong(fmt::format("channel '{}' holds {} values; {} x {} need {}", name, count, image.width,
                                         image.height, std::size_t{image.width} * image.height));
            }
        }
    }
    if (names.empty()) return wrong("it has no channel");
    return {};
}

}  // namespace

namespace image_formats {

Expected<void> check_limits(const ImageInfo& info, const ImageLimits& limits, const std::string& subject) {
    if (info.width == 0 || info.height == 0) {
        return damaged(info.format, subject, fmt::format("its size is {} x {}", info.width, info.height));
    }
    const std::uint64_t pixels = std::uint64_t{info.width} * info.height;
    if (info.width > limits.max_width || info.height > limits.max_height || pixels > limits.max_pixels) {
        return fail(ErrorCode::out_of_memory, std::string(attempt_read), subject,
                    fmt::format("its size is {} x {}; the limits are {} x {} and {} pixels", info.width, info.height,
                                limits.max_width, limits.max_height, limits.max_pixels),
                    "Use a smaller picture.");
    }
    return {};
}

std::unexpected<Error> damaged(ImageFormat format, const std::string& subject, std::string reason) {
    return fail(ErrorCode::parse, std::string(attempt_read), subject,
                fmt::format("damaged {} data: {}", name_of(format), reason), "Export or copy the file again.");
}

}  // namespace image_formats

std::string_view name_of(ImageFormat format) {
    switch (format) {
        case ImageFormat::png: return "PNG";
        case ImageFormat::jpeg: return "JPEG";
        case ImageFormat::radiance: return "Radiance HDR";
        case ImageFormat::openexr: return "OpenEXR";
    }
    return "unknown";
}

Expected<ImageInfo> read_image_info(const std::filesystem::path& file, const ImageLimits& limits) {
    return guard_memory(subject_of(file), [&]() -> Expected<ImageInfo> {
        NACRE_TRY(const auto data, read_binary_file(file, limits.max_file_bytes));
        return info_of(data, subject_of(file), limits);
    });
}

Expected<ImageInfo> read_image_info(std::span<const std::byte> data, std::string_view name, const ImageLimits& limits) {
    return info_of(data, subject_of(name), limits);
}

Expected<ImageBytes> read_image_bytes(const std::filesystem::path& file, const ImageBytesOptions& options,
                                      const ImageLimits& limits) {
    return guard_memory(subject_of(file), [&]() -> Expected<ImageBytes> {
        NACRE_TRY(const auto data, read_binary_file(file, limits.max_file_bytes));
        return bytes_of(data, subject_of(file), options, limits);
    });
}

Expected<ImageBytes> read_image_bytes(std::span<const std::byte> data, std::string_view name,
                                      const ImageBytesOptions& options, const ImageLimits& limits) {
    return bytes_of(data, subject_of(name), options, limits);
}

Expected<Image> read_image(const std::filesystem::path& file, const ImageLimits& limits) {
    return guard_memory(subject_of(file), [&]() -> Expected<Image> {
        NACRE_TRY(const auto data, read_binary_file(file, limits.max_file_bytes));
        return linear_of(data, subject_of(file), limits);
    });
}

Expected<Image> read_image(std::span<const std::byte> data, std::string_view name, const ImageLimits& limits) {
    return linear_of(data, subject_of(name), limits);
}

Expected<LayeredImage> read_exr_layers(const std::filesystem::path& file, const ImageLimits& limits) {
    return guard_memory(subject_of(file), [&]() -> Expected<LayeredImage> {
        NACRE_TRY(const auto data, read_binary_file(file, limits.max_file_bytes));
        return layers_of(data, subject_of(file), limits);
    });
}

Expected<LayeredImage> read_exr_layers(std::span<const std::byte> data, std::string_view name,
                                       const ImageLimits& limits) {
    return layers_of(data, subject_of(name), limits);
}

ImageLayer make_layer(std::string name, const Image& image) {
    static constexpr std::string_view names[5][4] = {{}, {"Y"}, {"Y", "A"}, {"R", "G", "B"}, {"R", "G", "B", "A"}};
    ImageLayer layer{std::move(name), {}};
    const std::uint32_t channels = std::min(image.channels, 4u);
    for (std::uint32_t c = 0; c < channels; ++c) {
        std::vector<float> values(image.texel_count());
        for (std::size_t i = 0; i < values.size(); ++i) values[i] = image.pixels[i * image.channels + c];
        layer.channels.push_back({std::string(names[channels][c]), std::move(values)});
    }
    return layer;
}

LayeredImage make_layered_image(const Image& image) { return {image.width, image.height, {make_layer("", image)}}; }

ImageBytes srgb_bytes_from_linear(const Image& image) {
    ImageBytes result{image.width, image.height, image.channels, 1, {}};
    result.bytes.resize(image.pixels.size());
    const std::uint32_t alpha = image.channels == 2 || image.channels == 4 ? image.channels - 1 : image.channels;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        result.bytes[i] = i % image.channels == alpha ? unorm_byte_from_float(image.pixels[i])
                                                      : srgb_byte_from_linear(image.pixels[i]);
    }
    return result;
}

Image linear_from_srgb_bytes(const ImageBytes& image) {
    Image result{image.width, image.height, image.channels, {}};
    result.pixels.resize(image.texel_count() * image.channels);
    const std::uint32_t alpha = image.channels == 2 || image.channels == 4 ? image.channels - 1 : image.channels;
    for (std::size_t i = 0; i < result.pixels.size(); ++i) {
        const bool is_alpha = i % image.channels == alpha;
        if (image.bytes_per_channel == 1) {
            result.pixels[i] = is_alpha ? image.bytes[i] / 255.0f : linear_from_srgb_byte(image.bytes[i]);
        } else {
            std::uint16_t value = 0;
            std::memcpy(&value, &image.bytes[i * 2], 2);
            result.pixels[i] = is_alpha ? value / 65535.0f : linear_from_srgb(value / 65535.0f);
        }
    }
    return result;
}

Expected<void> write_png(const std::filesystem::path& file, const ImageBytes& image) {
    Expected<std::vector<std::byte>> data = encode_png(image);
    if (!data) {
        data.error().subject = subject_of(file);
        return std::unexpected(data.error());
    }
    return write_file_atomically(file, *data);
}

Expected<void> write_png(const std::filesystem::path& file, const Image& image) {
    return write_png(file, srgb_bytes_from_linear(image));
}

Expected<void> write_exr(const std::filesystem::path& file, const LayeredImage& image) {
    NACRE_CHECK(check_layers(image, subject_of(file)));
    return guard_memory(subject_of(file), [&]() -> Expected<void> {
        NACRE_TRY(const auto data, image_formats::encode_exr(image, subject_of(file)));
        return write_file_atomically(file, data);
    });
}

}  // namespace nacre
