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
// which interpolate linearly along all axes but the last of anisotropy_table, along which a cubic goes through its
// four entries; 0 is the first entry of an axis and 1 the last, so that a texture is
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

// Its place in the table: where what changes fast takes up room. Slopes across matter by their ratio to those along and
// by themselves. The first coordinate has the scale of the lobe as well as that of the whole hemisphere.
vec4 stretched_place(StretchedView lobe, float cos_theta) {
    float x = ggx_table_coordinate(cos_theta, lobe.along);
    float r = lobe.correlation;
    float ratio = log(1.0 + 0.7 * lobe.across / lobe.along) / log(1.0 + 0.7 / lobe.along);
    float square_across = (sqrt(1.0 + 4.0 * square(lobe.across)) - 1.0) * 0.80901699;
    return vec4(0.8 * sqrt(x * sqrt(sqrt(x))) + 0.2 * cos_theta, (pow(lobe.along, 0.45) - 0.01584893) / 0.98415107,
                0.5 * (ratio + square_across), r * r * (1.0 + 0.85 * r) / 1.85);
}

// About what slopes in one plane lose of the light that comes along the normal, by the square of their alpha.
float stretched_loss(float area) { return 0.71 * area / (1.0 + 0.6 * area); }

// About the ratio of what this lobe reflects to what the round one does: the slopes across lose light as those along do,
// but the less the nearer the view is to the surface. x: ggx_table_coordinate. A fit; the table has what is left.
float stretched_ratio(StretchedView lobe, float x) {
    float along = square(lobe.along);
    float across = square(lobe.across);
    float visible = x * (2.0 - x);
    // Straight down the lobe's own axes count.
    float mean = 0.5 * (along + across);
    float difference = sqrt(square(0.5 * (along - across)) + along * across * square(lobe.correlation));
    float turned = (1.0 - stretched_loss(mean + difference)) * (1.0 - stretched_loss(max(mean - difference, 0.0))) /
                   ((1.0 - stretched_loss(along)) * (1.0 - stretched_loss(across)));
    return (1.0 + (turned - 1.0) * visible) * (1.0 - stretched_loss(across) * visible) /
           (1.0 - stretched_loss(along) * visible);
}

// About the cosine between view and reflecting facets, from that of the round lobe. Facets that are tilted most raise
// that one by a logarithm: slopes have no variance, and what ends it are the slopes along or a multiple of those across,
// whichever are larger. A fit; the table has what is left.
float stretched_cosine(StretchedView lobe, float x, float round_cosine) {
    float share = 0.14 + 0.1 * square(lobe.correlation);
    float end = log((lobe.along + share * lobe.across) / ((1.0 + share) * lobe.along));
    return max(round_cosine - 0.85 * (1.0 - x) * lobe.along * end, 0.2 * round_cosine);
}

// The same for a stretched lobe.
GgxAlbedo stretched_ggx_albedo(vec3 view, vec2 alpha) {
    float cosine = min(view.z, 1.0);
    StretchedView lobe = stretched_view(view, alpha);
    float x = ggx_table_coordinate(cosine, lobe.along);
    GgxAlbedo albedo = ggx_albedo(cosine, lobe.along);
    vec2 entry = anisotropy_table(stretched_place(lobe, cosine));
    albedo.missing = max(1.0 - (1.0 - albedo.missing) * stretched_ratio(lobe, x) * (1.2 - 0.5 * entry.x), 0.0);
    float round_cosine = 1.0 - pow(max(albedo.schlick, 1e-30), 0.2);
    albedo.schlick = power5(saturated(1.0 - stretched_cosine(lobe, x, round_cosine) * 1.25 * entry.y));
    return albedo;
}
#endif

// Of Chan's diffuse model; never 0.
float chan_albedo_by_table(float cos_theta, float gloss) {
    float coordinate = chan_sharpness_coordinate(chan_sharpness(gloss));
    return chan_albedo(cos_theta, gloss, interface_table(vec2(sqrt(cos_theta), coordinate)).w / 32.0);
}

#endif
