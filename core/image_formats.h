// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/image.h"

/// @file
/// The file formats behind core/image.h, one .cpp each. Internal to core/. `subject` is how errors name the picture.
/// Decoders are called only after `check_limits` has passed the result of the matching info function.

namespace nacre::image_formats {

/// Fails with `out_of_memory` and the figures where a picture is larger than `limits`, `parse` where it is empty.
Expected<void> check_limits(const ImageInfo& info, const ImageLimits& limits, const std::string& subject);

/// A failure to decode: names the picture, its format and what is wrong.
std::unexpected<Error> damaged(ImageFormat format, const std::string& subject, std::string reason);

Expected<ImageInfo> png_info(std::span<const std::byte> data, const std::string& subject);
Expected<ImageBytes> decode_png(std::span<const std::byte> data, const std::string& subject, bool keep_16_bit,
                                const ImageLimits& limits);

Expected<ImageInfo> jpeg_info(std::span<const std::byte> data, const std::string& subject);
Expected<ImageBytes> decode_jpeg(std::span<const std::byte> data, const std::string& subject);

Expected<ImageInfo> radiance_info(std::span<const std::byte> data, const std::string& subject);
Expected<Image> decode_radiance(std::span<const std::byte> data, const std::string& subject);

Expected<ImageInfo> exr_info(std::span<const std::byte> data, const std::string& subject);
Expected<LayeredImage> decode_exr(std::span<const std::byte> data, const std::string& subject);
Expected<std::vector<std::byte>> encode_exr(const LayeredImage& image, const std::string& subject);

}  // namespace nacre::image_formats
