// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_GGX
#define NACRE_GGX
#include "materials/closures/math.glsl"

// GGX distribution of microfacet normals around n. sin^2 comes from the cross product (Lagrange's identity): 1 - cos^2
// loses all digits for smooth surfaces in 32 bits.
float ggx_distribution(vec3 n, vec3 h, float alpha) {
    vec3 n_cross_h = cross(n, h);
    float cos_alpha = dot(n, h) * alpha;
    float k = alpha / (dot(n_cross_h, n_cross_h) + cos_alpha * cos_alpha);
    return k * k / pi;
}

// Height-correlated Smith masking and shadowing, divided by 4 cos_o cos_i.
// Source: Heitz 2014, "Understanding the masking-shadowing function in microfacet-based BRDFs".
float ggx_visibility(float cos_o, float cos_i, float alpha) {
    float a2 = alpha * alpha;
    float masking = cos_i * sqrt(cos_o * cos_o * (1.0 - a2) + a2);
    float shadowing = cos_o * sqrt(cos_i * cos_i * (1.0 - a2) + a2);
    return 0.5 / max(masking + shadowing, 1e-7);
}

float schlick_weight(float cos_theta) {
    float m = clamp(1.0 - cos_theta, 0.0, 1.0);
    float m2 = m * m;
    return m2 * m2 * m;
}

// Reflectance of the interface as seen from one direction, from the table of directional albedo.
struct SpecularAlbedo {
    vec3 albedo;        // all reflected light, single and multiple scattering
    vec3 compensation;  // factor on single scattering that makes up for the multiple
};

// table: x and y of passes/tables/ggx_albedo.h. Single scattering reflects f0 x + f90 y; what is missing to
// 1 in x + y is scattered again. Source: Turquin 2019, "Practical multiple scattering compensation".
SpecularAlbedo specular_albedo(vec3 f0, float f90, vec2 table) {
    SpecularAlbedo result;
    float single_scattering = max(table.x + table.y, 1e-3);
    result.compensation = 1.0 + f0 * (1.0 / single_scattering - 1.0);
    result.albedo = min((f0 * table.x + f90 * table.y) * result.compensation, vec3(1.0));
    return result;
}

#endif
