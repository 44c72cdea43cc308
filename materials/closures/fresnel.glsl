// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_FRESNEL
#define NACRE_CLOSURES_FRESNEL
#include "materials/closures/math.glsl"

// Reflectance of an interface by angle: at + (grazing - at) (1 - c)^5 - dip c (1 - c)^6, c the cosine to the
// (micro)normal. Sources: Schlick 1994; the dip at 82 degrees: Hoffman 2019, "Fresnel equations considered harmful".
struct Fresnel {
    vec3 normal;   // reflectance at normal incidence
    vec3 grazing;  // largest channel 1, or less where `normal` is below that of any matter
    vec3 dip;
};

// Below this reflectance (that of ice) the grazing reflectance fades: an interface between equal indices reflects
// nothing at any angle, which Schlick's formula misses.
const float smallest_reflectance = 0.02;

// The color of a grazing reflection alone: its largest channel is 1. Black has none.
vec3 grazing_tint(vec3 f90) {
    float brightest = largest(f90);
    return brightest > 0.0 ? f90 / brightest : vec3(1.0);
}

Fresnel make_fresnel(vec3 f0, vec3 f90, vec3 f82) {
    Fresnel fresnel;
    fresnel.normal = f0;
    fresnel.grazing = grazing_tint(f90) * saturated(largest(f0) * (1.0 / smallest_reflectance));
    vec3 rise = fresnel.grazing - f0;
    // (6/7)^5 and 1 / ((1/7) (6/7)^6): the two terms where the dip is largest, at c = 1/7. The bound keeps the sum from
    // falling below 0 anywhere: 1 / (c (1 - c)^6) is at least 17.65, 1 / (c (1 - c)) at least 4. A hundredth is always
    // left: 32 bits cannot tell what is less.
    fresnel.dip = min((f0 + rise * 0.462664366) * min(vec3(1.0) - f82, vec3(0.99)),
                      0.99 * (min(f0, fresnel.grazing) + abs(rise) * 0.226611)) *
                  17.6513846;
    return fresnel;
}

// That of white F90 and without a dip.
Fresnel make_plain_fresnel(vec3 f0) {
    Fresnel fresnel;
    fresnel.normal = f0;
    fresnel.grazing = vec3(saturated(largest(f0) * (1.0 / smallest_reflectance)));
    fresnel.dip = vec3(0.0);
    return fresnel;
}

Fresnel scaled_fresnel(Fresnel fresnel, vec3 factor) {
    Fresnel scaled;
    scaled.normal = fresnel.normal * factor;
    scaled.grazing = fresnel.grazing * factor;
    scaled.dip = fresnel.dip * factor;
    return scaled;
}

vec3 fresnel_reflectance(Fresnel fresnel, float cos_theta) {
    float c = saturated(cos_theta);
    float m = 1.0 - c;
    float m5 = power5(m);
    return fresnel.normal * schlick_rest(c, m) + fresnel.grazing * m5 - fresnel.dip * (c * m5 * m);
}

// 1 - fresnel_reflectance, with all digits where that is near 1.
vec3 fresnel_transmittance(Fresnel fresnel, float cos_theta) {
    float c = saturated(cos_theta);
    float m = 1.0 - c;
    float m5 = power5(m);
    return (vec3(1.0) - fresnel.normal) * schlick_rest(c, m) + (vec3(1.0) - fresnel.grazing) * m5 +
           fresnel.dip * (c * m5 * m);
}

// Mean over a hemisphere under diffuse light: integral of 2 c F(c).
vec3 fresnel_mean(Fresnel fresnel) {
    return max(fresnel.normal + (fresnel.grazing - fresnel.normal) * (1.0 / 21.0) - fresnel.dip * (1.0 / 126.0),
               vec3(0.0));
}

// 1 - fresnel_mean.
vec3 fresnel_mean_transmittance(Fresnel fresnel) {
    return (vec3(1.0) - fresnel.normal) * (20.0 / 21.0) + (vec3(1.0) - fresnel.grazing) * (1.0 / 21.0) +
           fresnel.dip * (1.0 / 126.0);
}

// Index of refraction of a dielectric by its reflectance at normal incidence, and back. An index above 199 (reflectance
// 0.98) stands for all that is opaque.
float reflectance_to_ior(float f0) {
    float root = sqrt(clamp(f0, 0.0, 0.98));
    return (1.0 + root) / (1.0 - root);
}

float ior_to_reflectance(float ior) { return square((ior - 1.0) / (ior + 1.0)); }

// Cosine of the direction inside a denser medium, by its reflectance at normal incidence. Every term is positive: sin^2
// / ior^2 subtracted from 1 would lose the digits of grazing directions where the medium is hardly denser.
float refracted_cosine(float cos_theta, float f0) {
    float root = sqrt(clamp(f0, 0.0, 0.98));
    return sqrt(4.0 * root + square(cos_theta * (1.0 - root))) / (1.0 + root);
}

// What Fresnel's equations let through of unpolarized light, by the cosines outside and inside a medium of index `ior`.
// No term is negative.
float dielectric_transmittance(float cosine, float inner_cosine, float ior) {
    float across = cosine / (cosine + ior * inner_cosine);
    float along = cosine / (ior * cosine + inner_cosine);
    return 2.0 * ior * inner_cosine / cosine * (across * across + along * along);
}

// A direction as it goes on below, in a medium whose index is 1 + `ior_excess`. Every term is positive, as above.
vec3 refracted_direction(vec3 direction, float ior_excess) {
    float inverse = 1.0 / (1.0 + ior_excess);
    float inside = sqrt(ior_excess * (ior_excess + 2.0) + direction.z * direction.z) * inverse;
    return vec3(direction.x * inverse, direction.y * inverse, ior_excess > 0.0 ? inside : direction.z);
}

// 1 - 1 / ior^2.
float refraction_bend(float ior_excess) { return ior_excess * (ior_excess + 2.0) / square(1.0 + ior_excess); }

// Reflectance at normal incidence of what lies under a medium of index coat_ior, from its reflectance in air. Exact for
// dielectrics: the index comes back from the reflectance.
float reflectance_under(float f0, float coat_ior) {
    float ior = reflectance_to_ior(f0);
    return square((ior - coat_ior) / (ior + coat_ior));
}

#endif
