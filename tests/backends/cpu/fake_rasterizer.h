// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "backends/cpu/raster/rasterizer.h"

/// @file
/// A rasterizer that draws nothing by itself: it keeps what it was told, as late as a rasterizer may that collects
/// draws, and paints as the test says.

namespace nacre::cpu {

struct FakeDraw {
    DrawState state;
    DrawCall call;
    std::vector<std::byte> push_constants;  ///< Read when the draws are carried out, not when they are recorded.
};

struct FakeRaster {
    /// Called for each draw when it is carried out.
    static std::function<void(const RenderTargets&, const FakeDraw&)> paint;
    static std::vector<FakeDraw> draws;        ///< Carried out so far.
    static std::vector<RenderTargets> passes;  ///< Begun so far.
    static void forget();
};

}  // namespace nacre::cpu
