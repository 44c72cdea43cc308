// SPDX-License-Identifier: Apache-2.0
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_NO_LINEAR
#define STBI_NO_HDR
#define STBI_MAX_DIMENSIONS 65536
#if __has_include(<stb/stb_image.h>)
#include <stb/stb_image.h>
#else
#include <stb_image.h>
#endif

#include <fmt/format.h>

#include <memory>

#include "core/image_formats.h"

namespace nacre::image_formats {
namespace {

Expected<int> stb_length(std::span<const std::byte> data, const std::string& subject) {
    if (data.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
        return damaged(ImageFormat::jpeg, subject, "it is larger than 2 GiB");
    }
    return static_cast<int>(data.size());
}

std::string stb_reason() {
    const char* reason = stbi_failure_reason();
    return reason ? reason : "unknown";
}

// stb_image fills what a truncated file lacks with gray. The end-of-image marker tells: it cannot occur inside
// entropy-coded data, where every 0xff is followed by 0x00 or a restart marker.
bool has_end_marker(std::span<const std::byte> data) {
    for (std::size_t i = data.size(); i-- > 1;) {
        if (data[i] == std::byte{0xd9} && data[i - 1] == std::byte{0xff}) return true;
    }
    return false;
}

}  // namespace

Expected<ImageInfo> jpeg_info(std::span<const std::byte> data, const std::string& subject) {
    NACRE_TRY(const int length, stb_length(data, subject));
    int width = 0, height = 0, channels = 0;
    if (!stbi_info_from_memory(reinterpret_cast<const stbi_uc*>(data.data()), length, &width, &height, &channels)) {
        return damaged(ImageFormat::jpeg, subject, stb_reason());
    }
    return ImageInfo{ImageFormat::jpeg, static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height),
                     static_cast<std::uint32_t>(channels), 8};
}

Expected<ImageBytes> decode_jpeg(std::span<const std::byte> data, const std::string& subject) {
    NACRE_TRY(const int length, stb_length(data, subject));
    if (!has_end_marker(data)) return damaged(ImageFormat::jpeg, subject, "the file ends too early");
    int width = 0, height = 0, channels = 0;
    const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
        stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(data.data()), length, &width, &height, &channels, 0),
        stbi_image_free);
    if (!pixels) return damaged(ImageFormat::jpeg, subject, stb_reason());
    ImageBytes image{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height),
                     static_cast<std::uint32_t>(channels), 1, {}};
    image.bytes.assign(pixels.get(), pixels.get() + image.texel_count() * image.channels);
    return image;
}

}  // namespace nacre::image_formats
