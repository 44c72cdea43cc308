// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_STORED_FRAME
#define NACRE_CLOSURES_STORED_FRAME
#include "materials/closures/octahedral.glsl"
#include "materials/closures/stored_fields.glsl"
#ifdef NACRE_SLAB_MEDIUM
#include "materials/closures/medium_inputs.glsl"
#endif
// Tangent frames and subsurface data of stored materials. A tangent is stored as the angle to one that follows from the
// normal; lobes look the same turned by half a turn, so that half a turn is enough.

struct StoredFrame {
    vec3 tangent;
    vec3 bitangent;
    vec3 normal;
};

// Source: Duff et al. 2017, "Building an orthonormal basis, revisited".
StoredFrame frame_of_normal(vec3 normal) {
    float side = normal.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (side + normal.z);
    float b = normal.x * normal.y * a;
    StoredFrame frame;
    frame.tangent = vec3(1.0 + side * normal.x * normal.x * a, side * b, -side * normal.x);
    frame.bitangent = vec3(b, side + normal.y * normal.y * a, -normal.y);
    frame.normal = normal;
    return frame;
}

StoredFrame turned_frame(vec3 normal, float angle) {
    StoredFrame frame = frame_of_normal(normal);
    if (angle != 0.0) {
        float c = cos(angle);
        float s = sin(angle);
        vec3 tangent = c * frame.tangent + s * frame.bitangent;
        frame.bitangent = c * frame.bitangent - s * frame.tangent;
        frame.tangent = tangent;
    }
    return frame;
}

vec3 to_frame(StoredFrame frame, vec3 v) {
    return vec3(dot(v, frame.tangent), dot(v, frame.bitangent), dot(v, frame.normal));
}

// Views from behind a shading normal are moved onto the surface.
vec3 view_in_frame(StoredFrame frame, vec3 to_viewer) {
    vec3 view = to_frame(frame, to_viewer);
    return normalize(vec3(view.x, view.y, max(view.z, 1e-4)));
}

// normal: as the reader will have it.
uint pack_tangent(vec3 normal, vec3 tangent, uint bits) {
    StoredFrame frame = frame_of_normal(normal);
    float angle = atan(dot(tangent, frame.bitangent), dot(tangent, frame.tangent));
    float turns = angle / 3.14159265358979 + 1.0;
    return uint(turns * float(1u << bits) + 0.5) & ((1u << bits) - 1u);
}

float unpack_tangent(uint code, uint bits) { return float(code) * 3.14159265358979 / float(1u << bits); }

#ifdef NACRE_SLAB_MEDIUM
// Micrometers to 10 m, and 0; thickness to 1 km, and infinity.
const float shortest_stored_length = 1e-6;
const float stored_path_octaves = 23.253497;
const float stored_thickness_octaves = 29.897353;

// The medium with isotropic scattering that has the same similarity (materials/closures/medium.glsl).
float isotropic_mean_free_path(float albedo, float mean_free_path, float phase_anisotropy) {
    float similarity = medium_similarity(albedo, 1.0 - albedo);
    return mean_free_path * (1.0 - phase_anisotropy * similarity * similarity) / (1.0 - phase_anisotropy);
}

uint pack_subsurface(vec3 albedo, vec3 mean_free_path, float phase_anisotropy, float thickness, uvec2 pixel) {
    uint word = 0u;
    for (int channel = 0; channel < 3; ++channel) {
        float isotropic = isotropic_mean_free_path(albedo[channel], mean_free_path[channel], phase_anisotropy);
        word |= pack_logarithm(isotropic, 8u, shortest_stored_length, stored_path_octaves,
                               ordered_dither(pixel.x, pixel.y, uint(channel)))
                << uint(8 * channel);
    }
    return word | (pack_logarithm(thickness, 8u, shortest_stored_length, stored_thickness_octaves, 0.5) << 24u);
}

vec3 unpack_mean_free_path(uint word) {
    return vec3(unpack_logarithm(word & 255u, 8u, shortest_stored_length, stored_path_octaves),
                unpack_logarithm((word >> 8u) & 255u, 8u, shortest_stored_length, stored_path_octaves),
                unpack_logarithm((word >> 16u) & 255u, 8u, shortest_stored_length, stored_path_octaves));
}

float unpack_thickness(uint word) {
    uint code = word >> 24u;
    return code == 255u ? longest_length : unpack_logarithm(code, 8u, shortest_stored_length, stored_thickness_octaves);
}
#endif

#endif
