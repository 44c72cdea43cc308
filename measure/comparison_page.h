// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "measure/cross_backend.h"
#include "measure/report_page.h"

namespace nacre::measure {

/// What two of the compared pictures are apart; `a` and `b` are indices into `SceneComparison::backends`.
struct PairDifference {
    std::size_t a = 0, b = 0;
    PictureDifference difference;
};

/// Every backend's picture against every other's, a < b.
Expected<std::vector<PairDifference>> compare_pairs(const SceneComparison& comparison);

/// The page about a comparison: figures, pictures side by side, differences, passes and textures.
/// @param facts       short labels: "1280 x 720", "profile high"
/// @param violations  of `violations_of`; decides the verdict
Expected<ReportPage> comparison_page(const SceneComparison& comparison, const std::vector<PairDifference>& pairs,
                                     std::vector<std::string> facts, const std::vector<std::string>& violations);

}  // namespace nacre::measure
