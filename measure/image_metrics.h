// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/error.h"
#include "core/image.h"

/// @file
/// How far two pictures are apart, in figures and as a picture.
///
///     NACRE_TRY(PictureDifference d, compare_pictures(reference, test));
///     if (d.psnr_db < 50 || d.share_above_1 > 0.001) ...
///
/// All functions are thread-safe.

namespace nacre::measure {

/// The largest PSNR that is ever reported, in dB; equal pictures have it.
inline constexpr double largest_psnr_db = 200.0;

/// What `compare_pictures` finds. The first five are taken after sRGB encoding, as a person sees the pictures.
struct PictureDifference {
    double psnr_db = largest_psnr_db;    ///< Peak signal-to-noise ratio over R, G and B, peak 1, at most 200 dB.
    double flip_mean = 0.0;              ///< See measure/flip.h, [0, 1].
    std::uint32_t max_abs_8bit = 0;      ///< Largest difference of a byte of the 8-bit pictures, 0 to 255.
    double share_above_1 = 0.0;          ///< Share of pixels of which a byte differs by more than 1, [0, 1].
    double share_differing = 0.0;        ///< Share of pixels of which any byte differs, [0, 1].
    double max_abs_linear = 0.0;         ///< Largest difference of linear values; infinite where only one is finite.
    double max_rel_linear = 0.0;         ///< Largest |a - b| / max(|a|, |b|), [0, 2].
    Image flip_map;                      ///< One channel, [0, 1].
};

/// Compares two pictures of one size with 1 to 4 channels, linear light; alpha is ignored, one channel counts as gray.
/// Values are clamped to [0, 1] for all figures but the linear ones; NaN counts as black there.
/// Errors: invalid_argument (sizes differ).
Expected<PictureDifference> compare_pictures(const Image& reference, const Image& test);

/// A picture that shows where two pictures of one size differ: |a - b| of the encoded values, times `gain` (above 0).
/// Errors: invalid_argument.
Expected<Image> difference_image(const Image& reference, const Image& test, float gain = 16.0f);

/// Values that no picture should hold.
struct ValueScan {
    std::uint64_t nan = 0;
    std::uint64_t infinite = 0;
    std::uint64_t negative = 0;  ///< Below zero, -0 not counted.
    [[nodiscard]] bool clean() const { return nan == 0 && infinite == 0 && negative == 0; }
};

ValueScan scan_values(const Image& image);

/// Median over all pixels of the luminance (weights of Rec. 709; a channel alone is luminance). NaN pixels are left
/// out; 0 for a picture without pixels. In the unit of the picture.
double median_luminance(const Image& image);

}  // namespace nacre::measure
