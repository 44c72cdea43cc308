// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rhi/resources.h"

/// @file
/// Shape of the coordinates of a view of an image.

namespace nacre::cpu {

struct Axes {
    int spatial = 2;  ///< Coordinates besides the layer; cubes: 3.
    bool is_cube = false;
    bool has_layers = false;  ///< A layer follows.
};

// Always inlined: files that are compiled for other processors than the rest use it, too.
[[gnu::always_inline]] constexpr Axes axes_of(rhi::ViewDimension dimension) {
    using enum rhi::ViewDimension;
    switch (dimension) {
        case d1: return {1, false, false};
        case d1_array: return {1, false, true};
        case d2_array: return {2, false, true};
        case d3: return {3, false, false};
        case cube: return {3, true, false};
        case cube_array: return {3, true, true};
        default: return {2, false, false};
    }
}

}  // namespace nacre::cpu
