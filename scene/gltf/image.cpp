// SPDX-License-Identifier: Apache-2.0
#include "core/image.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <thread>

#include "scene/gltf/image.h"
#include "scene/gltf/uri.h"

namespace nacre::scene::gltf {
namespace {

/// A picture between the file and its texels.
struct Encoded {
    std::size_t file_image = 0;
    std::string element;
    std::string name;
    std::string origin;
    std::string mime_type;
    std::vector<std::byte> owned;
    std::span<const std::byte> bytes;
    ImageInfo info;

    std::optional<Error> error;
    std::shared_ptr<const std::vector<std::uint8_t>> pixels;
    bool has_alpha = false;
};

Encoded read_encoded(Document& document, std::size_t index) {
    const JsonView& json = document.list("images")[index];
    Encoded encoded{.file_image = index, .element = label("image", index, json), .name = json.text("name", "")};
    if (const auto uri_member = json.find("uri")) {
        const std::string_view uri = uri_member->as_text_view();
        if (const auto data = parse_data_uri(uri, encoded.element)) {
            auto decoded = decode_base64(data->payload);
            if (!decoded) reject(encoded.element + ": its data URI is not valid base64");
            encoded.owned = *std::move(decoded);
            encoded.origin = "data URI";
        } else {
            encoded.owned = document.read_file(uri, encoded.element);
            encoded.origin = printable(uri);
            if (encoded.name.empty()) encoded.name = encoded.origin;
        }
        encoded.bytes = encoded.owned;
    } else {
        const std::size_t view = json.index("bufferView", document.list("bufferViews").size(), "bufferView");
        encoded.bytes = document.view(view).bytes;
        encoded.origin = fmt::format("bufferView {}", view);
    }
    return encoded;
}

[[noreturn]] void reject_picture(const Encoded& encoded, const Error& error) {
    reject(fmt::format("{}: {}", encoded.element, error.reason),
           error.remedy.empty() ? "Save the picture again as PNG or JPEG." : error.remedy, error.code);
}

/// Checks the size of a picture against the limits, before a texel is decoded.
void inspect(Document& document, Encoded& encoded) {
    const LoadLimits& limits = document.options().limits;
    const ImageLimits image_limits{.max_width = limits.image_side,
                                   .max_height = limits.image_side,
                                   .max_pixels = limits.image_bytes / 4,
                                   .max_file_bytes = limits.file_bytes};
    auto info = read_image_info(encoded.bytes, encoded.element, image_limits);
    if (!info) reject_picture(encoded, info.error());
    if (info->format != ImageFormat::png && info->format != ImageFormat::jpeg) {
        reject(fmt::format("{}: it is {}, but glTF pictures are PNG or JPEG", encoded.element, name_of(info->format)),
               "Convert it to PNG.", ErrorCode::unsupported);
    }
    encoded.info = *info;
    encoded.mime_type = info->format == ImageFormat::png ? "image/png" : "image/jpeg";
    // 16-bit pictures pass through twice the memory.
    const std::uint64_t decoded_bytes = std::uint64_t{info->width} * info->height * 4;
    document.charge_image(decoded_bytes, encoded.element);
    if (info->bits_per_channel > 8) {
        document.warnings().add(encoded.element + ": its 16-bit channels were rounded to 8 bits");
    }
}

void decode(Encoded& encoded, const ImageLimits& limits) {
    auto picture = read_image_bytes(encoded.bytes, encoded.element, {.channels = 4}, limits);
    if (!picture) {
        encoded.error = picture.error();
        return;
    }
    const std::vector<std::uint8_t>& bytes = picture->bytes;
    if (encoded.info.channels == 2 || encoded.info.channels == 4) {
        for (std::size_t i = 3; i < bytes.size() && !encoded.has_alpha; i += 4) encoded.has_alpha = bytes[i] != 255;
    }
    encoded.info.width = picture->width;
    encoded.info.height = picture->height;
    encoded.pixels = std::make_shared<const std::vector<std::uint8_t>>(std::move(picture->bytes));
    encoded.owned = {};
}

/// Decodes all, each on whichever thread is free.
void decode_all(std::vector<Encoded>& pictures, const ImageLimits& limits) {
    std::atomic<std::size_t> next = 0;
    const auto work = [&] {
        for (std::size_t i = next++; i < pictures.size(); i = next++) {
            try {
                decode(pictures[i], limits);
            } catch (const std::exception& exception) {
                pictures[i].error =
                    Error{ErrorCode::out_of_memory, "decode", pictures[i].element, exception.what(), ""};
            }
        }
    };
    const std::size_t thread_count = std::min<std::size_t>(std::max(1u, std::thread::hardware_concurrency()),
                                                           std::min<std::size_t>(pictures.size(), 8));
    std::vector<std::jthread> threads;
    for (std::size_t i = 1; i < thread_count; ++i) {
        try {
            threads.emplace_back(work);
        } catch (const std::system_error&) {
            break;  // No more threads to be had: this one does the rest.
        }
    }
    work();
}

}  // namespace

int ImageTable::use(std::size_t file_image, ColorSpace color_space) {
    const auto [entry, is_new] = index_of_.try_emplace({file_image, color_space}, static_cast<int>(used_.size()));
    if (is_new) used_.emplace_back(file_image, color_space);
    return entry->second;
}

std::vector<Image> ImageTable::load(Document& document) const {
    std::vector<Encoded> pictures;
    std::map<std::size_t, std::size_t> picture_of;
    for (const auto& [file_image, color_space] : used_) {
        if (!picture_of.try_emplace(file_image, pictures.size()).second) continue;
        pictures.push_back(read_encoded(document, file_image));
        // Moving a vector keeps its buffer, so that `bytes` stays valid when `pictures` grows.
        if (document.options().load_images) inspect(document, pictures.back());
    }
    if (document.options().load_images) {
        const LoadLimits& limits = document.options().limits;
        decode_all(pictures, {.max_width = limits.image_side,
                              .max_height = limits.image_side,
                              .max_pixels = limits.image_bytes / 4,
                              .max_file_bytes = limits.file_bytes});
    }

    static const auto white = std::make_shared<const std::vector<std::uint8_t>>(4, std::uint8_t{255});
    std::vector<Image> images;
    for (const auto& [file_image, color_space] : used_) {
        const Encoded& picture = pictures[picture_of.at(file_image)];
        if (picture.error) reject_picture(picture, *picture.error);
        Image image{.name = picture.name,
                    .origin = picture.origin,
                    .mime_type = picture.mime_type,
                    .color_space = color_space,
                    .width = 1,
                    .height = 1,
                    .pixels = white};
        if (picture.pixels) {
            image.width = picture.info.width;
            image.height = picture.info.height;
            image.has_alpha = picture.has_alpha;
            image.pixels = picture.pixels;
        }
        images.push_back(std::move(image));
    }
    return images;
}

}  // namespace nacre::scene::gltf
