// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_CLASSIC
#define NACRE_CLOSURES_CLASSIC
#include "materials/closures/math.glsl"

// Lobes that real-time renderers are used to, as published, beside those that the slab is made of: cheaper, with errors
// that are measured (docs/materials.md). Roughness is perceptual; alpha is its square. Diffuse lobes include the cosine
// of light.

float disney_scatter(float f90, float cos_theta) {
    float m = 1.0 - cos_theta;
    return schlick_rest(cos_theta, m) + f90 * power5(m);
}

// Source: Burley 2012 and Lagarde and de Rousiers 2014, "Moving Frostbite to physically based rendering".
float disney_diffuse(vec3 view, vec3 light, float roughness) {
    if (light.z <= 0.0) return 0.0;
    float half_cosine = half_vector_cosine(view, light);
    // As published 1 + (f90 - 1) (1 - c)^5, which cancels along smooth surfaces.
    float f90 = 0.5 * roughness + 2.0 * half_cosine * half_cosine * roughness;
    float light_scatter = disney_scatter(f90, min(light.z, 1.0));
    float view_scatter = disney_scatter(f90, min(view.z, 1.0));
    return light_scatter * view_scatter * mix(1.0, 1.0 / 1.51, roughness) * light.z / pi;
}

// Diffuse of woven fabric: darker the rougher, and wrapped around the terminator by w (0.5 as published). The wrapped
// cosine is normalized: what the lobe of roughness 0 reflects of white light stays 1.
float fabric_diffuse(vec3 light, float roughness, float wrap) {
    float wrapped = saturated((light.z + wrap) / square(1.0 + wrap));
    return mix(1.0, 0.5, roughness) * wrapped / pi;
}

// Visibilities: masking and shadowing over 4 view.z light.z.

// Source: Kelemen and Szirmay-Kalos 2001; for coats, whatever their roughness.
float kelemen_visibility(float half_cosine) { return 0.25 / max(half_cosine * half_cosine, 1e-5); }

// Source: Neubelt and Pettineo 2013, "Crafting a next-gen material pipeline for The Order: 1886".
float neubelt_visibility(float view_cosine, float light_cosine) {
    return 1.0 / max(4.0 * (light_cosine + view_cosine - light_cosine * view_cosine), 1e-7);
}

// Distributions of fibers that stand on a surface, by the half vector; 1 / pi included. Its tangential part has the
// digits that 1 - cos^2 loses.

// Source: Ashikhmin and Premoze 2007, "Distribution-based BRDFs".
float ashikhmin_distribution(vec3 h, float alpha) {
    float a2 = max(alpha * alpha, 1e-8);
    float cos2 = h.z * h.z;
    float sin2 = max(h.x * h.x + h.y * h.y, 1e-6);
    float sin4 = sin2 * sin2;
    return (4.0 * exp(-cos2 / (sin2 * a2)) + sin4) / (pi * (1.0 + 4.0 * a2) * sin4);
}

// Source: Estevez and Kulla 2017, "Production friendly microfacet sheen BRDF". Below a roughness of 0.1 it reflects
// more than it gets with most visibilities.
float charlie_distribution(vec3 h, float roughness) {
    float exponent = 1.0 / clamp(roughness, 0.01, 1.0);
    float sin2 = clamp(h.x * h.x + h.y * h.y, 1e-9, 1.0);
    return (2.0 + exponent) * pow(sin2, 0.5 * exponent) / (2.0 * pi);
}

float charlie_log_lambda(float cos_theta, float roughness) {
    float r = square(1.0 - saturated(roughness));
    float a = mix(21.5473, 25.3245, r);
    float b = mix(3.82987, 3.32435, r);
    float c = mix(0.19823, 0.16801, r);
    float d = mix(-1.97760, -1.27393, r);
    float e = mix(-4.32054, -4.85967, r);
    return a / (1.0 + b * pow(max(cos_theta, 1e-9), c)) + d * cos_theta + e;
}

float charlie_lambda(float cos_theta, float roughness) {
    if (cos_theta < 0.5) return exp(charlie_log_lambda(cos_theta, roughness));
    return exp(2.0 * charlie_log_lambda(0.5, roughness) - charlie_log_lambda(1.0 - cos_theta, roughness));
}

// Softens the terminator, which is no physics but wanted by authors.
float charlie_softened(float lambda, float cos_theta) {
    float m = 1.0 - saturated(cos_theta);
    float m8 = square(square(m * m));
    return pow(lambda, 1.0 + 2.0 * m8);
}

float charlie_visibility(float view_cosine, float light_cosine, float roughness, bool is_softened) {
    float view_lambda = charlie_lambda(view_cosine, roughness);
    float light_lambda = charlie_lambda(light_cosine, roughness);
    if (is_softened) {
        view_lambda = charlie_softened(view_lambda, view_cosine);
        light_lambda = charlie_softened(light_lambda, light_cosine);
    }
    return 1.0 / max((1.0 + view_lambda + light_lambda) * 4.0 * view_cosine * light_cosine, 1e-9);
}

// What Charlie's fibers reflect of white light with Neubelt's visibility, for roughness from 0.1 on: a fit of the
// quadrature, off by so little that a sheen over it keeps its energy within 0.0007.
float charlie_albedo(float cos_theta, float roughness) {
    float x = sqrt(saturated(cos_theta));
    float y = 0.1 / clamp(roughness, 0.1, 1.0);
    float c0 = 0.5028805 + y * (1.4734265 + y * (-1.4543716 + y * (1.6233663 + y * (-1.1155654 + y * 0.32539542))));
    float c1 = -0.076725443 + y * (-0.33751558 + y * (0.24264197 + y * (-0.20233167 + y * (0.067974897 + y * -0.065709709))));
    float c2 = -1.4393868 + y * (-9.326904 + y * (-1.7729892 + y * (-0.52072734 + y * (3.4307996 + y * -0.81865718))));
    float c3 = 3.8562246 + y * (22.783004 + y * (12.257499 + y * (4.193818 + y * (-21.760096 + y * 5.9588272))));
    float c4 = -5.158856 + y * (-31.195 + y * (-28.441983 + y * (8.4576412 + y * (28.518183 + y * -6.8614092))));
    float c5 = 3.5472371 + y * (21.095494 + y * (35.835675 + y * (-34.028911 + y * (-1.4425976 + y * -1.8539448))));
    float c6 = -0.99060585 + y * (-5.7568745 + y * (-13.599933 + y * (16.46029 + y * (-4.9851093 + y * 2.5779891))));
    return c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * (c5 + x * c6)))));
}

// Charlie's lobe seen from one direction, over its own albedo: as published it reflects more than it gets where it is
// smooth. Smoother ones than 0.1 are not fitted.
struct CharlieLobe {
    float view_cosine;
    float half_exponent;
    float scale;
};

CharlieLobe make_charlie_lobe(float view_cosine, float roughness) {
    float exponent = 1.0 / clamp(roughness, 0.1, 1.0);
    CharlieLobe lobe;
    lobe.view_cosine = view_cosine;
    lobe.half_exponent = 0.5 * exponent;
    lobe.scale = (2.0 + exponent) * (0.125 * inverse_pi) / charlie_albedo(view_cosine, roughness);
    return lobe;
}

// Value times the cosine of a light above the surface; integrates to 1. h: half vector of view and light.
float charlie_value(CharlieLobe lobe, float light_cosine, vec3 h) {
    float sin2 = clamp(h.x * h.x + h.y * h.y, 1e-9, 1.0);
    float both = light_cosine + lobe.view_cosine - light_cosine * lobe.view_cosine;
    return lobe.scale * pow(sin2, lobe.half_exponent) * light_cosine / max(both, 1e-7);
}

// Reflectance of what lies under a coat of index 1.5, a cubic fit of reflectance_under.
float reflectance_under_coat_fit(float f0) {
    return saturated(f0 * (f0 * (0.941892 - 0.263008 * f0) + 0.346479) - 0.0285998);
}

#endif
