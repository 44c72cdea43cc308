// SPDX-License-Identifier: Apache-2.0
#version 460
// Exposure, tone curve and sRGB encoding. FILMIC: the curve of passes/tonemap/filmic.glsl; otherwise values are clamped.
#include "passes/tonemap/filmic.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform sampler2D lit;
layout(set = 0, binding = 1, std140) uniform ExposureBlock { vec4 exposure; };
layout(set = 0, binding = 2, rgba8) uniform writeonly image2D final_color;

vec3 srgb_encoded(vec3 linear) {
    return mix(1.055 * pow(max(linear, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, textureSize(lit, 0)))) return;
    vec3 color = texelFetch(lit, pixel, 0).rgb * exposure.x;
#ifdef FILMIC
    color = filmic(color);
#endif
    imageStore(final_color, pixel, vec4(srgb_encoded(clamp(color, 0.0, 1.0)), 1.0));
}
