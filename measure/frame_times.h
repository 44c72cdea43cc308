// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/error.h"
#include "passes/renderer.h"

/// @file
/// How long frames take.
///
///     NACRE_TRY(FrameTimes times, time_frames(*renderer, 10));
///     fmt::print("{} ms\n", times.median_ms);

namespace nacre::measure {

struct FrameTimes {
    double median_ms = 0.0;  ///< By the host's clock, from recording to the end of the device's work.
    double min_ms = 0.0;
    double max_ms = 0.0;
    std::vector<passes::PassTime> passes;  ///< Median for each pass on the device, in order of execution.
    std::uint64_t memory_bytes = 0;        ///< Largest over the frames.
    double exposure_ev = 0.0;              ///< Of the last frame.
};

/// Renders and times frames. With `frames` above 1 one more is rendered first and not counted, because it pays for what
/// is made at first use; with 1 the first is all there is. Errors: those of `render_frame`; invalid_argument for 0.
Expected<FrameTimes> time_frames(passes::Renderer& renderer, std::uint32_t frames);

/// The middle value, or the mean of the two middle ones; 0 for none.
double median(std::vector<double> values);

}  // namespace nacre::measure
