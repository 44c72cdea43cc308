// SPDX-License-Identifier: Apache-2.0
#version 460
// Nine spherical-harmonic coefficients of the irradiance from a small mip of the environment cube, by one workgroup.
#include "materials/closures/math.glsl"
#include "passes/shared/cube.glsl"
#include "passes/shared/spherical_harmonics.glsl"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) uniform samplerCube environment;
layout(set = 0, binding = 1, std430) writeonly buffer Irradiance { vec4 coefficients[9]; };

shared vec4 partial[64];

void main() {
    int size = textureSize(environment, 0).x >> SOURCE_MIP;
    vec4 sums[9];
    for (int i = 0; i < 9; ++i) sums[i] = vec4(0.0);
    float total = 0.0;
    for (int index = int(gl_LocalInvocationIndex); index < 6 * size * size; index += 64) {
        int face = index / (size * size), rest = index - face * size * size;
        vec2 uv = (vec2(float(rest % size), float(rest / size)) + 0.5) / float(size);
        vec3 direction = cube_direction(face, uv);
        // Solid angle of a texel, up to a constant: 1 / |direction|^3.
        float inverse_length = inversesqrt(dot(direction, direction));
        float solid_angle = inverse_length * inverse_length * inverse_length;
        direction *= inverse_length;
        vec3 light = textureLod(environment, direction, float(SOURCE_MIP)).rgb * solid_angle;
        for (int i = 0; i < 9; ++i) sums[i].rgb += light * harmonic(i, direction);
        total += solid_angle;
    }
    for (int i = 0; i < 9; ++i) {
        barrier();
        partial[gl_LocalInvocationIndex] = vec4(sums[i].rgb, total);
        barrier();
        for (uint stride = 32u; stride > 0u; stride /= 2u) {
            if (gl_LocalInvocationIndex < stride) {
                partial[gl_LocalInvocationIndex] += partial[gl_LocalInvocationIndex + stride];
            }
            barrier();
        }
        if (gl_LocalInvocationIndex == 0u) {
            // Weights of the cosine by band: pi, 2 pi / 3, pi / 4.
            float band = i == 0 ? pi : (i < 4 ? 2.0 * pi / 3.0 : pi / 4.0);
            coefficients[i] = vec4(partial[0].rgb * (4.0 * pi / partial[0].w) * band, 0.0);
        }
    }
}
