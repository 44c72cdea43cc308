// SPDX-License-Identifier: Apache-2.0
#version 460
// Exposure that shows the median luminance as middle gray (0.18), unless that would burn out more than a twentieth of the
// picture: then the 95th percentile is shown as white (1), but the median not below 0.1. A picture whose median is below all
// bins (black) is left as it is.
#include "passes/exposure/exposure.glsl"

layout(local_size_x = 1) in;
layout(set = 0, binding = 0, std430) readonly buffer Histogram { uint histogram[256]; };
layout(set = 0, binding = 1, std430) writeonly buffer Exposure { vec4 exposure; };

// Luminance below which a share of the pixels lies; 0 where that is in the bin of darkness.
float percentile(float share, float total) {
    float below = 0.0;
    for (uint i = 0u; i < bin_count; ++i) {
        float count = float(histogram[i]);
        if (below + count >= share * total && count > 0.0) {
            if (i == 0u) return 0.0;
            float bin = float(i) + (share * total - below) / count;
            return exp2(bin / bins_per_stop + first_stop);
        }
        below += count;
    }
    return 0.0;
}

void main() {
    uint total = 0u;
    for (uint i = 0u; i < bin_count; ++i) total += histogram[i];
    float median = percentile(0.5, float(total));
    float bright = percentile(0.95, float(total));
    float scale = 1.0;
    if (median > 0.0) scale = max(min(0.18 / median, 1.0 / bright), 0.1 / median);
    exposure = vec4(scale, median, bright, 0.0);
}
