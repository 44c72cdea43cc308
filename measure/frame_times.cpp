// SPDX-License-Identifier: Apache-2.0
#include "measure/frame_times.h"

#include <algorithm>
#include <map>
#include <string>

namespace nacre::measure {

double median(std::vector<double> values) {
    if (values.empty()) return 0.0;
    std::ranges::sort(values);
    const std::size_t middle = values.size() / 2;
    return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2.0;
}

Expected<FrameTimes> time_frames(passes::Renderer& renderer, std::uint32_t frames) {
    if (frames == 0) return fail(ErrorCode::invalid_argument, "time frames", "", "0 frames were asked for");
    if (frames > 1) NACRE_CHECK(renderer.render_frame());
    FrameTimes times;
    std::vector<double> totals;
    std::map<std::string, std::vector<double>> passes;
    passes::FrameStatistics last;
    for (std::uint32_t frame = 0; frame < frames; ++frame) {
        NACRE_TRY(last, renderer.render_frame());
        totals.push_back(last.frame_ms);
        for (const passes::PassTime& pass : last.passes) passes[pass.name].push_back(pass.ms);
        times.memory_bytes = std::max(times.memory_bytes, last.memory_bytes);
    }
    for (const passes::PassTime& pass : last.passes) times.passes.push_back({pass.name, median(passes[pass.name])});
    times.min_ms = *std::ranges::min_element(totals);
    times.max_ms = *std::ranges::max_element(totals);
    times.median_ms = median(std::move(totals));
    times.exposure_ev = last.exposure_ev;
    return times;
}

}  // namespace nacre::measure
