// SPDX-License-Identifier: Apache-2.0
#version 460
// Counts the luminances of every second pixel of every second row. Counting whole pixels gives the same result in any order.
#include "passes/exposure/exposure.glsl"

layout(local_size_x = 16, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform sampler2D lit;
layout(set = 0, binding = 1, std430) buffer Histogram { uint histogram[256]; };

shared uint bins[256];

void main() {
    for (uint i = gl_LocalInvocationIndex; i < bin_count; i += 128u) bins[i] = 0u;
    barrier();
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) * 2;
    if (all(lessThan(pixel, textureSize(lit, 0)))) {
        float stops = log2(max(luminance(texelFetch(lit, pixel, 0).rgb), 1e-30)) - first_stop;
        atomicAdd(bins[uint(clamp(stops * bins_per_stop, 0.0, 255.0))], 1u);
    }
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < bin_count; i += 128u) {
        if (bins[i] != 0u) atomicAdd(histogram[i], bins[i]);
    }
}
