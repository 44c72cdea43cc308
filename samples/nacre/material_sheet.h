// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "core/image.h"
#include "materials/simplification.h"

/// @file
/// The picture of `nacre material`.

namespace nacre::command {

/// A step as it is drawn.
struct MaterialSheetStep {
    std::vector<std::string> captions;
    Image ball;
};

/// The tree, a ball for each step, and for each closure of the material as authored its lobe in the plane of incidence
/// at 45 degrees, in logarithmic length.
Image material_sheet(const std::string& title, const materials::FlattenedTree& tree,
                     const std::vector<MaterialSheetStep>& steps);

}  // namespace nacre::command
