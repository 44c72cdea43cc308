// SPDX-License-Identifier: Apache-2.0
#version 460
// One mip of the environment as rough surfaces mirror it: the GGX lobe around a direction, seen along it.
// Samples are few because each reads the mip whose texels cover what the sample stands for.
// Sources: Karis 2013, "Real shading in Unreal Engine 4"; Krivanek and Colbert 2008 for the mips.
#include "materials/closures/math.glsl"
#include "passes/shared/cube.glsl"
#include "passes/shared/half.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform samplerCube environment;
layout(set = 0, binding = 1, rgba16f) uniform writeonly imageCube mip;
layout(set = 0, binding = 2, std140) uniform PrefilterBlock { vec4 parameters; };  // roughness

float radical_inverse(uint bits) {
    bits = (bits << 16) | (bits >> 16);
    bits = ((bits & 0x55555555u) << 1) | ((bits & 0xaaaaaaaau) >> 1);
    bits = ((bits & 0x33333333u) << 2) | ((bits & 0xccccccccu) >> 2);
    bits = ((bits & 0x0f0f0f0fu) << 4) | ((bits & 0xf0f0f0f0u) >> 4);
    bits = ((bits & 0x00ff00ffu) << 8) | ((bits & 0xff00ff00u) >> 8);
    return float(bits >> 8) / 16777216.0;
}

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID);
    int size = imageSize(mip).x;
    if (texel.x >= size || texel.y >= size) return;
    vec3 n = normalize(cube_direction(texel.z, (vec2(texel.xy) + 0.5) / float(size)));
    vec3 tangent = normalize(abs(n.y) < 0.9 ? cross(vec3(0.0, 1.0, 0.0), n) : cross(vec3(1.0, 0.0, 0.0), n));
    vec3 bitangent = cross(n, tangent);
    float alpha = parameters.x * parameters.x;
    float source_size = float(textureSize(environment, 0).x);
    float texel_solid_angle = 4.0 * pi / (6.0 * source_size * source_size);

    vec3 sum = vec3(0.0);
    float weight = 0.0;
    for (uint i = 0u; i < uint(SAMPLES); ++i) {
        // A microfacet normal distributed as D cos.
        float u = (float(i) + 0.5) / float(SAMPLES);
        float phi = 2.0 * pi * radical_inverse(i);
        float cos_squared = (1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u);
        float cos_h = sqrt(cos_squared), sin_h = sqrt(max(1.0 - cos_squared, 0.0));
        vec3 h = tangent * (sin_h * cos(phi)) + bitangent * (sin_h * sin(phi)) + n * cos_h;
        vec3 l = 2.0 * cos_h * h - n;
        float cos_l = dot(n, l);
        if (cos_l <= 0.0) continue;
        // Density of l is D / 4, since the viewer is the normal.
        float k = alpha / (sin_h * sin_h + cos_squared * alpha * alpha);
        float density = k * k / (4.0 * pi);
        float sample_solid_angle = 1.0 / (float(SAMPLES) * max(density, 1e-6));
        float lod = clamp(0.5 * log2(sample_solid_angle / texel_solid_angle) + 1.0, 0.0, float(SOURCE_MIPS - 1));
        sum += textureLod(environment, l, lod).rgb * cos_l;
        weight += cos_l;
    }
    imageStore(mip, texel, vec4(round_to_half(min(sum / max(weight, 1e-6), vec3(65504.0))), 1.0));
}
