// SPDX-License-Identifier: Apache-2.0
// Any bytes are a picture or an error, never a crash: decoders of all four formats.
#include "core/image.h"

#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto bytes = std::as_bytes(std::span(data, size));
    const nacre::ImageLimits limits{.max_pixels = 1 << 20};
    const auto image = nacre::read_image(bytes, "input", limits);
    if (image && image->pixels.size() != image->texel_count() * image->channels) std::abort();
    if (!image && image.error().message().empty()) std::abort();
    return 0;
}
