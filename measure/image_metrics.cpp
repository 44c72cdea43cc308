// SPDX-License-Identifier: Apache-2.0
#include "measure/image_metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/srgb.h"
#include "measure/flip.h"

namespace nacre::measure {
namespace {

// Red, green and blue without alpha; gray is spread.
Image color_of(const Image& image) {
    if (image.channels == 3) return image;
    Image result{image.width, image.height, 3, {}};
    result.pixels.resize(image.texel_count() * 3);
    for (std::size_t p = 0; p < image.texel_count(); ++p) {
        const float* texel = &image.pixels[p * image.channels];
        for (std::size_t c = 0; c < 3; ++c) result.pixels[p * 3 + c] = image.channels >= 3 ? texel[c] : texel[0];
    }
    return result;
}

Expected<void> check_sizes(const Image& a, const Image& b, std::string attempted) {
    if (a.width == b.width && a.height == b.height && a.texel_count() > 0) return {};
    return fail(ErrorCode::invalid_argument, std::move(attempted), "",
                fmt::format("the pictures have {} x {} and {} x {} pixels", a.width, a.height, b.width, b.height),
                "Pass two pictures of one size.");
}

}  // namespace

Expected<PictureDifference> compare_pictures(const Image& reference, const Image& test) {
    NACRE_CHECK(check_sizes(reference, test, "compare pictures"));
    const Image a = color_of(reference);
    const Image b = color_of(test);
    PictureDifference result;
    double squares = 0;
    std::uint64_t above_1 = 0, differing = 0;
    for (std::size_t p = 0; p < a.texel_count(); ++p) {
        int largest = 0;
        for (std::size_t c = 0; c < 3; ++c) {
            const float va = a.pixels[p * 3 + c], vb = b.pixels[p * 3 + c];
            if (va == vb || (std::isnan(va) && std::isnan(vb))) continue;
            const double step = double(srgb_from_linear(va)) - double(srgb_from_linear(vb));
            squares += step * step;
            largest = std::max(largest, std::abs(srgb_byte_from_linear(va) - srgb_byte_from_linear(vb)));
            if (!std::isfinite(va) || !std::isfinite(vb)) {
                result.max_abs_linear = result.max_rel_linear = std::numeric_limits<double>::infinity();
                continue;
            }
            const double distance = std::abs(double(va) - double(vb));
            result.max_abs_linear = std::max(result.max_abs_linear, distance);
            result.max_rel_linear =
                std::max(result.max_rel_linear, distance / std::max(std::abs(double(va)), std::abs(double(vb))));
        }
        result.max_abs_8bit = std::max(result.max_abs_8bit, static_cast<std::uint32_t>(largest));
        above_1 += largest > 1;
        differing += largest > 0;
    }
    const auto pixels = static_cast<double>(a.texel_count());
    if (squares > 0) result.psnr_db = std::min(largest_psnr_db, -10.0 * std::log10(squares / (3.0 * pixels)));
    result.share_above_1 = static_cast<double>(above_1) / pixels;
    result.share_differing = static_cast<double>(differing) / pixels;
    NACRE_TRY(FlipResult flip, compute_flip(a, b));
    result.flip_mean = flip.mean;
    result.flip_map = std::move(flip.map);
    return result;
}

Expected<Image> difference_image(const Image& reference, const Image& test, float gain) {
    NACRE_CHECK(check_sizes(reference, test, "make difference picture"));
    if (!(gain > 0.0f) || std::isinf(gain)) {
        return fail(ErrorCode::invalid_argument, "make difference picture", "", fmt::format("the gain is {}", gain),
                    "Pass a finite gain above 0.");
    }
    const Image a = color_of(reference);
    Image result = color_of(test);
    for (std::size_t i = 0; i < result.pixels.size(); ++i) {
        result.pixels[i] =
            linear_from_srgb(gain * std::abs(srgb_from_linear(a.pixels[i]) - srgb_from_linear(result.pixels[i])));
    }
    return result;
}

ValueScan scan_values(const Image& image) {
    ValueScan scan;
    for (const float value : image.pixels) {
        if (std::isnan(value)) ++scan.nan;
        else if (std::isinf(value)) ++scan.infinite;
        else if (value < 0.0f) ++scan.negative;
    }
    return scan;
}

double median_luminance(const Image& image) {
    std::vector<float> values;
    values.reserve(image.texel_count());
    for (std::size_t p = 0; p < image.texel_count(); ++p) {
        const float* texel = &image.pixels[p * image.channels];
        const float luminance =
            image.channels >= 3 ? 0.2126f * texel[0] + 0.7152f * texel[1] + 0.0722f * texel[2] : texel[0];
        if (!std::isnan(luminance)) values.push_back(luminance);
    }
    if (values.empty()) return 0.0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    if (values.size() % 2 == 1) return static_cast<double>(*middle);
    return (static_cast<double>(*middle) + static_cast<double>(*std::max_element(values.begin(), middle))) / 2.0;
}

}  // namespace nacre::measure
