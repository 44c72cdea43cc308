// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/error.h"
#include "core/image.h"

/// @file
/// FLIP: how different two pictures look to a person who flips between them.
///
///     NACRE_TRY(FlipResult flip, compute_flip(reference, test));
///     fmt::print("mean difference {}\n", flip.mean);    // 0: same, 1: black against white
///
/// Source: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild 2020, "FLIP: A Difference Evaluator for
/// Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2); the variant for pictures of low dynamic range.
/// Thread-safe.

namespace nacre::measure {

/// Pixels per degree of vision: a 0.7 m wide monitor of 3840 pixels seen from 0.7 m, as in the paper.
inline constexpr float default_pixels_per_degree = 67.0f;

struct FlipResult {
    Image map;          ///< One channel: the difference at each pixel, [0, 1].
    double mean = 0.0;  ///< Over all pixels.
};

/// @param reference, test     pictures of one size with 3 or 4 channels, linear sRGB in [0, 1]; values outside are
///                            clamped, NaN counts as 0, alpha is ignored
/// @param pixels_per_degree   above 0; decides how far the eye blurs
/// Errors: invalid_argument (sizes differ, too few channels, bad pixels_per_degree).
Expected<FlipResult> compute_flip(const Image& reference, const Image& test,
                                  float pixels_per_degree = default_pixels_per_degree);

/// Colors a map of [0, 1] from black over violet and orange to light yellow (equal steps look equal).
Image colored_flip_map(const Image& map);

}  // namespace nacre::measure
