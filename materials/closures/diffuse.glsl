// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_DIFFUSE
#define NACRE_CLOSURES_DIFFUSE
#include "materials/closures/math.glsl"

// Light that a medium of albedo 1 scatters back where it entered: value times the cosine of light.

float lambert_diffuse(vec3 light) { return max(light.z, 0.0) * inverse_pi; }

// Retro-reflective diffuse under a rough interface. Source: Chan 2018, "Material advances in Call of Duty: WWII".
// `gloss` is that game's, 2^(18 gloss) = 2 / alpha^2 - 1: the logarithm in the published .18455 log(...) is that of
// base 10. As published the model is a fit that does not keep energy (its albedo towards grazing views is 0.54 on
// smooth and above 1 on rough surfaces): who uses it divides by its directional albedo. Where the fit's
// retro-reflection turns negative (gloss above 0.71) it is 0 here.
float chan_gloss(float roughness) {
    float alpha = roughness * roughness;
    return saturated(log2(2.0 / max(alpha * alpha, 1e-7) - 1.0) * (1.0 / 18.0));
}

float chan_glossiness(float gloss) { return saturated(2.2 * gloss - 0.5); }
float chan_retro_amplitude(float gloss) { return max((34.5 * gloss - 59.0) * gloss + 24.5, 0.0); }

// Exponent of the retro-reflection: 8.9 for all rough surfaces, 30.8 where it ends.
float chan_sharpness(float gloss) { return max(73.2 * gloss - 21.2, 8.9); }
// In the table, which ends at 1.
float chan_sharpness_coordinate(float sharpness) { return (sharpness - 8.9) * (1.0 / 21.9); }
float chan_sharpness_at(float coordinate) { return 8.9 + 21.9 * coordinate; }

// half_cosine and normal_half: the cosines of the half vector of two directions above the surface to these and to the
// normal.
float chan_retro(float half_cosine, float normal_half, float sharpness) {
    return half_cosine * exp2(-sharpness * sqrt(normal_half));
}

// The model seen from one direction: what is the same for all lights.
struct ChanView {
    float rough;  // factors of its three parts
    float glossy;
    float retro;
    float sharpness;
};

// What the model reflects is multiplied by `scale`.
ChanView chan_view(float view_cosine, float gloss, float scale) {
    float glossiness = chan_glossiness(gloss);
    ChanView chan;
    chan.rough = (1.0 - glossiness) * (scale * inverse_pi);
    chan.glossy = glossiness * (1.0 - 0.75 * power5(1.0 - min(view_cosine, 1.0))) * (scale * inverse_pi);
    chan.retro = chan_retro_amplitude(gloss) * (scale * inverse_pi);
    chan.sharpness = chan_sharpness(gloss);
    return chan;
}

// For a light above the surface; half_cosine and normal_half as in chan_retro. A light_cosine that rounding made larger
// than 1 does no harm.
float chan_diffuse_of(ChanView chan, float light_cosine, float half_cosine, float normal_half) {
    float rough = half_cosine + power5(1.0 - half_cosine);
    float glossy = 1.0 - 0.75 * power5(1.0 - light_cosine);
    float retro = chan_retro(half_cosine, normal_half, chan.sharpness);
    return (chan.rough * rough + chan.glossy * glossy + chan.retro * retro) * light_cosine;
}

float chan_diffuse(vec3 view, vec3 light, float gloss) {
    if (light.z <= 0.0) return 0.0;
    return chan_diffuse_of(chan_view(view.z, gloss, 1.0), light.z, half_vector_cosine(view, light),
                           half_vector(view, light).z);
}

// What chan_diffuse reflects in all: retro_albedo is that of chan_retro. The glossy part is a closed form, the rough
// part a fit of its integral that is off by less than 1e-4.
float chan_albedo(float view_cosine, float gloss, float retro_albedo) {
    float rough = 0.70712 + view_cosine * (0.18899 + view_cosine * (0.03262 + view_cosine * -0.01830));
    float glossy = (27.0 / 28.0) * (1.0 - 0.75 * power5(1.0 - view_cosine));
    return mix(rough, glossy, chan_glossiness(gloss)) + chan_retro_amplitude(gloss) * retro_albedo;
}

#endif
