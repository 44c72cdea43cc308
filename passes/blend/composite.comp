// SPDX-License-Identifier: Apache-2.0
#version 460
// Lays one group of blended surfaces over the picture, for devices that cannot blend into float targets.
#include "passes/shared/half.glsl"
#include "passes/shared/shared_exponent.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform sampler2D below;
layout(set = 0, binding = 1) uniform usampler2D group_color;
layout(set = 0, binding = 2) uniform usampler2D group_coverage;
layout(set = 0, binding = 3, LIT_FORMAT) uniform writeonly image2D lit;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, textureSize(below, 0)))) return;
    vec3 color = unpack_shared_exponent(texelFetch(group_color, pixel, 0).r);
    float coverage = float(texelFetch(group_coverage, pixel, 0).r) / 65535.0;
    imageStore(lit, pixel, vec4(round_to_half(min(color + (1.0 - coverage) * texelFetch(below, pixel, 0).rgb, vec3(65504.0))), 1.0));
}
