// SPDX-License-Identifier: Apache-2.0
#version 460
// Lights pixels of a packed G-buffer with many GGX lights that lie at uniform addresses. benchmarks/cpu/lighting_intrinsics.cpp
// is the same by hand: change both.
layout(local_size_x = 64) in;

struct Light {
    vec4 position;  // w: 1 / range^2
    vec4 color;
};
layout(set = 0, binding = 0, std140) uniform Lights {
    uvec4 size;  // width, height, number of lights
    vec4 plane;  // half extents of the picture at distance 1
    Light lights[32];
};
// x: diffuse color and occlusion, y: F0 and roughness (8 bits each), z: normal (octahedral, 2 x 16 bits), w: distance (float)
layout(set = 0, binding = 1, std430) readonly buffer Words { uvec4 words[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Lit { vec4 lit[]; };

const float pi = 3.14159265358979;

vec3 channels(uint word) { return vec3(word & 255u, (word >> 8) & 255u, (word >> 16) & 255u) * (1.0 / 255.0); }

vec3 decode_normal(uint word) {
    vec2 e = vec2(word & 0xffffu, word >> 16) * (2.0 / 65535.0) - 1.0;
    vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    float t = max(-n.z, 0.0);
    n.x += n.x >= 0.0 ? -t : t;
    n.y += n.y >= 0.0 ? -t : t;
    return n * inversesqrt(dot(n, n));
}

void main() {
    uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y;
    if (x >= size.x) return;
    uint index = y * size.x + x;
    uvec4 word = words[index];
    vec3 diffuse = channels(word.x) * (1.0 / pi);
    vec3 f0 = channels(word.y);
    float roughness = max(float(word.y >> 24) * (1.0 / 255.0), 0.2);
    vec3 normal = decode_normal(word.z);
    vec2 ndc = (vec2(x, y) + 0.5) / vec2(size.xy) * 2.0 - 1.0;
    vec3 ray = vec3(ndc * plane.xy, -1.0);
    vec3 position = ray * uintBitsToFloat(word.w);
    vec3 to_viewer = ray * -inversesqrt(dot(ray, ray));

    float alpha = roughness * roughness;
    float a2 = alpha * alpha;
    float cos_o = max(dot(normal, to_viewer), 1e-4);
    float masking_o = sqrt(cos_o * cos_o * (1.0 - a2) + a2);
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < size.z; ++i) {
        vec3 offset = lights[i].position.xyz - position;
        float distance_squared = max(dot(offset, offset), 1e-8);
        vec3 to_light = offset * inversesqrt(distance_squared);
        float cos_i = dot(normal, to_light);
        if (cos_i <= 0.0) continue;
        float in_range = distance_squared * lights[i].position.w;
        float window = clamp(1.0 - in_range * in_range, 0.0, 1.0);
        float attenuation = window / distance_squared * cos_i;
        vec3 half_vector = to_light + to_viewer;
        half_vector *= inversesqrt(max(dot(half_vector, half_vector), 1e-12));
        float cos_h = clamp(dot(normal, half_vector), 0.0, 1.0);
        float cos_d = clamp(dot(to_viewer, half_vector), 0.0, 1.0);
        float d = cos_h * cos_h * (a2 - 1.0) + 1.0;
        float visibility = 0.5 / (cos_i * masking_o + cos_o * sqrt(cos_i * cos_i * (1.0 - a2) + a2));
        float specular = a2 / (pi * d * d) * visibility;
        float fresnel = pow(1.0 - cos_d, 5.0);
        sum += lights[i].color.rgb * (diffuse + (f0 + (1.0 - f0) * fresnel) * specular) * attenuation;
    }
    lit[index] = vec4(sum * (float(word.x >> 24) * (1.0 / 255.0)), 1.0);
}
