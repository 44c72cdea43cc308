// SPDX-License-Identifier: Apache-2.0
#version 460
// Exposure that shows the median luminance as middle gray (0.18). A picture whose median is below all bins (black) is left
// as it is.
#include "passes/exposure/exposure.glsl"

layout(local_size_x = 1) in;
layout(set = 0, binding = 0, std430) readonly buffer Histogram { uint histogram[256]; };
layout(set = 0, binding = 1, std430) writeonly buffer Exposure { vec4 exposure; };

void main() {
    uint total = 0u;
    for (uint i = 0u; i < bin_count; ++i) total += histogram[i];
    float wanted = 0.5 * float(total);
    float below = 0.0;
    float median_bin = 0.0;
    for (uint i = 0u; i < bin_count; ++i) {
        float count = float(histogram[i]);
        if (below + count >= wanted) {
            median_bin = i == 0u ? 0.0 : float(i) + (wanted - below) / max(count, 1.0);
            break;
        }
        below += count;
    }
    float median = exp2(median_bin / bins_per_stop + first_stop);
    float scale = median_bin == 0.0 ? 1.0 : 0.18 / median;
    exposure = vec4(scale, median, 0.0, 0.0);
}
