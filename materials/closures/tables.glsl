// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_TABLES
#define NACRE_CLOSURES_TABLES
#include "materials/closures/diffuse.glsl"
#include "materials/closures/ggx.glsl"
// Directional albedos by table. Who includes this has defined
//
//     vec4 interface_table(vec2 at)     materials/tables/interface_table.h
//     vec2 anisotropy_table(vec4 at)    with slab_anisotropy: materials/tables/anisotropy_table.h
//
// which interpolate linearly along all axes; 0 is the first entry of an axis and 1 the last, so that a texture is
// read at (at * (size - 1) + 0.5) / size. materials/closures/table_buffers.glsl has them for buffers.

// What a GGX lobe with single scattering reflects towards a direction.
struct GgxAlbedo {
    float missing;  // 1 - all of it, with F = 1
    float schlick;  // mean of (1 - c)^5 over that light
    float dip;      // mean of c (1 - c)^6 over that light; only where a slab has an F82
};

GgxAlbedo ggx_albedo(float cos_theta, float alpha) {
    vec4 entry = interface_table(vec2(ggx_table_coordinate(cos_theta, alpha), sqrt(alpha)));
    GgxAlbedo albedo;
    albedo.missing = entry.x;
    albedo.schlick = clamp(power5(1.0 - ggx_typical_cosine(cos_theta, alpha)) + (entry.y - 0.25) * 0.5, 0.0, 1.0);
#ifdef NACRE_SLAB_F82
    albedo.dip = max(ggx_typical_dip(albedo.schlick) + (entry.z - 0.75) / 32.0, 0.0);
#else
    albedo.dip = 0.0;
#endif
    return albedo;
}

#ifdef NACRE_SLAB_ANISOTROPY
// The same for a stretched lobe.
GgxAlbedo stretched_ggx_albedo(vec3 view, vec2 alpha) {
    float larger = max(alpha.x, alpha.y);
    float smaller = min(alpha.x, alpha.y);
    float along = alpha.x >= alpha.y ? abs(view.x) : abs(view.y);
    float across = alpha.x >= alpha.y ? abs(view.y) : abs(view.x);
    float tangent_length = max(sqrt(along * along + across * across), 1e-20);
    along /= tangent_length;
    across /= tangent_length;
    float seen = sqrt(square(larger * along) + square(smaller * across));
    float cosine = min(view.z, 1.0);
    float ratio = smaller / larger;
    // No ratio is below that of the smallest alpha: the axis begins there.
    float least = pow(smallest_alpha / larger, 1.0 / 3.0);
    float ratio_at = saturated((pow(ratio, 1.0 / 3.0) - least) / max(1.0 - least, 1e-6));
    // Straight down every azimuth is the same.
    vec2 entry = anisotropy_table(vec4(ggx_table_coordinate(cosine, seen),
                                       atan(sqrt(sqrt(ratio)) * across, along) * (2.0 / pi), ratio_at, sqrt(larger)));
    GgxAlbedo albedo = ggx_albedo(cosine, seen);
    albedo.missing = entry.x;
    albedo.schlick = clamp(albedo.schlick + (entry.y - 0.25) * 0.5, 0.0, 1.0);
    return albedo;
}
#endif

// Of Chan's diffuse model; never 0.
float chan_albedo_by_table(float cos_theta, float gloss) {
    float coordinate = chan_sharpness_coordinate(chan_sharpness(gloss));
    return chan_albedo(cos_theta, gloss, interface_table(vec2(sqrt(cos_theta), coordinate)).w / 32.0);
}

#endif
