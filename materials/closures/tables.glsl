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
// which interpolate linearly along all axes but the last of anisotropy_table, along which a parabola goes through its
// three entries; 0 is the first entry of an axis and 1 the last, so that a texture is
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
// A stretched lobe from one direction. In the plane of view and normal its slopes are those of a round lobe of alpha
// `along`; what it reflects differs from that one by the slopes across the plane, and by how much both go together.
struct StretchedView {
    float along;
    float across;
    float correlation;  // [0, 1]
};

StretchedView stretched_view(vec3 view, vec2 alpha) {
    float tangent_length = sqrt(view.x * view.x + view.y * view.y);
    // Straight down every azimuth is the same.
    float x = tangent_length > 1e-12 ? view.x / tangent_length : 1.0;
    float y = tangent_length > 1e-12 ? view.y / tangent_length : 0.0;
    StretchedView stretched;
    stretched.along = sqrt(square(alpha.x * x) + square(alpha.y * y));
    stretched.across = sqrt(square(alpha.x * y) + square(alpha.y * x));
    stretched.correlation =
        min(abs((alpha.x - alpha.y) * (alpha.x + alpha.y) * x * y) / (stretched.along * stretched.across), 1.0);
    return stretched;
}

// Its place in the table: where what changes fast takes up room. The first coordinate has the scale of the lobe as well
// as that of the whole hemisphere.
vec4 stretched_place(StretchedView lobe, float cos_theta) {
    float x = ggx_table_coordinate(cos_theta, lobe.along);
    float r = lobe.correlation;
    return vec4(0.85 * sqrt(x * sqrt(x)) + 0.15 * cos_theta, sqrt(lobe.along * sqrt(sqrt(lobe.along))),
                (sqrt(1.0 + 4.0 * square(lobe.across)) - 1.0) * 0.80901699, 0.5 * r * r * (1.0 + r));
}

// About the ratio of the cosines between view and reflecting facets of this lobe and of the round one: slopes across
// turn facets away. A fit; the table has what is left of it.
float stretched_cosine_ratio(StretchedView lobe, float cos_theta) {
    float x = ggx_table_coordinate(cos_theta, lobe.along);
    float r = lobe.correlation;
    float slope = 0.16 * inversesqrt(max(lobe.along, 0.01)) * (1.0 - x) * (1.0 - 0.4 * x) *
                  (1.0 + 0.7 * r * r * (1.0 + r) * square(lobe.across / (lobe.along + lobe.across)));
    return (1.0 + slope * 1.41421356 * lobe.along) /
           (1.0 + slope * sqrt(square(lobe.along) + square(lobe.across)));
}

// The same for a stretched lobe.
GgxAlbedo stretched_ggx_albedo(vec3 view, vec2 alpha) {
    float cosine = min(view.z, 1.0);
    StretchedView lobe = stretched_view(view, alpha);
    GgxAlbedo albedo = ggx_albedo(cosine, lobe.along);
    vec2 entry = anisotropy_table(stretched_place(lobe, cosine));
    albedo.missing = max(albedo.missing + (1.0 - albedo.missing) * (1.25 * entry.x - 0.75), 0.0);
    float typical = (1.0 - pow(max(albedo.schlick, 1e-30), 0.2)) * stretched_cosine_ratio(lobe, cosine) * 1.5 * entry.y;
    albedo.schlick = power5(saturated(1.0 - typical));
    return albedo;
}
#endif

// Of Chan's diffuse model; never 0.
float chan_albedo_by_table(float cos_theta, float gloss) {
    float coordinate = chan_sharpness_coordinate(chan_sharpness(gloss));
    return chan_albedo(cos_theta, gloss, interface_table(vec2(sqrt(cos_theta), coordinate)).w / 32.0);
}

#endif
