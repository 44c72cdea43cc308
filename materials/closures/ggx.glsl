// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_GGX
#define NACRE_CLOSURES_GGX
#include "materials/closures/math.glsl"

// One GGX lobe with height-correlated Smith shadowing, single scattering, without Fresnel. alpha: along x and along y.
// Sources: Walter et al. 2007; Heitz 2014, "Understanding the masking-shadowing function"; Dupuy and Benyoub 2023,
// "Sampling visible GGX normals with spherical caps".

// Smoother lobes (and both axes of anisotropic ones) are mirrors: 32 bits cannot hold their peaks.
const float smallest_alpha = 1e-4;

// Source: Kulla and Conty 2017, "Revisiting physically based shading at Imageworks".
vec2 ggx_alpha(float roughness, float anisotropy) {
    float alpha = roughness * roughness;
    return vec2(clamp(alpha * (1.0 + anisotropy), smallest_alpha, 1.0),
                clamp(alpha * (1.0 - anisotropy), smallest_alpha, 1.0));
}

bool ggx_is_mirror(float roughness) { return roughness * roughness < smallest_alpha; }

// Length of a direction after the stretch that turns the lobe into a hemisphere; masking is 2 z / (z + length).
float ggx_stretched_length(vec3 direction, vec2 alpha) {
    return length(vec3(alpha.x * direction.x, alpha.y * direction.y, direction.z));
}

// Density of microfacet normals. No digits cancel here; 1 - cos^2 would lose all of them for smooth surfaces in 32
// bits.
float ggx_distribution(vec3 h, vec2 alpha) {
    float area = alpha.x * alpha.y;
    vec3 stretched = vec3(alpha.y * h.x, alpha.x * h.y, area * h.z);
    float ratio = area / dot(stretched, stretched);
    return area * ratio * ratio / pi;
}

// Value times the cosine of light: D G / (4 view.z). view_length: ggx_stretched_length of view; h: half_vector(view,
// light).
float ggx_value(vec3 view, float view_length, vec3 light, vec3 h, vec2 alpha) {
    if (light.z <= 0.0) return 0.0;
    float light_length = ggx_stretched_length(light, alpha);
    float shadowing = 0.5 * light.z / (light.z * view_length + view.z * light_length);
    return ggx_distribution(h, alpha) * shadowing;
}

// The same for a lobe that is not stretched and a light above the surface, with one division for all; area: alpha^2.
// Neither product leaves the range of 32 bits: the denominator is at least smallest_alpha^5 smallest_cosine.
float round_ggx_value(float view_cosine, float view_length, vec3 light, vec3 h, float area) {
    float light_length = sqrt(area * (light.x * light.x + light.y * light.y) + light.z * light.z);
    float stretched = h.x * h.x + h.y * h.y + area * (h.z * h.z);
    return (0.5 * inverse_pi) * area * light.z /
           (stretched * stretched * (light.z * view_length + view_cosine * light_length));
}

// Density of light directions that ggx_sample makes. Below 1 in total: the rest goes below the surface.
float ggx_pdf(vec3 view, float view_length, vec3 light, vec3 h, vec2 alpha) {
    if (light.z <= 0.0) return 0.0;
    return ggx_distribution(h, alpha) * 0.5 / (view.z + view_length);
}

// ggx_value over ggx_pdf, at most 1.
float ggx_weight(vec3 view, float view_length, vec3 light, vec2 alpha) {
    if (light.z <= 0.0) return 0.0;
    float light_length = ggx_stretched_length(light, alpha);
    return light.z * (view.z + view_length) / (light.z * view_length + view.z * light_length);
}

// A microfacet normal that view sees.
vec3 ggx_sample_normal(vec3 view, float view_length, vec2 alpha, float random_x, float random_y) {
    vec3 stretched = vec3(alpha.x * view.x, alpha.y * view.y, view.z) / view_length;
    float phi = 2.0 * pi * random_x;
    // A point of the spherical cap z > -stretched.z, by its distance from the pole.
    float below_pole = random_y * (1.0 + stretched.z);
    float radius = sqrt(max(below_pole * (2.0 - below_pole), 0.0));
    vec3 normal = vec3(alpha.x * (radius * cos(phi) + stretched.x), alpha.y * (radius * sin(phi) + stretched.y),
                       max((1.0 - random_y) * (1.0 + stretched.z), 1e-12));
    return normalize(normal);
}

vec3 ggx_sample(vec3 view, float view_length, vec2 alpha, float random_x, float random_y) {
    vec3 h = ggx_sample_normal(view, view_length, alpha, random_x, random_y);
    return normalize(2.0 * dot(view, h) * h - view);
}

// Coordinate of a cosine in the tables of directional albedo, [0, 1], and back.
float ggx_table_coordinate(float cos_theta, float alpha) {
    return sqrt(cos_theta * (1.0 + 3.0 * alpha) / (cos_theta + 3.0 * alpha));
}

float ggx_table_cosine(float coordinate, float alpha) {
    float ratio = coordinate * coordinate;
    return min(3.0 * alpha * ratio / (1.0 + 3.0 * alpha - ratio), 1.0);
}

// About the cosine between view and the microfacets that reflect most of its light.
float ggx_typical_cosine(float cos_theta, float alpha) {
    return min(sqrt(cos_theta * cos_theta + 10.0 * alpha * alpha), 1.0);
}

// Mean of c (1 - c)^6 over that light if all of it had one c, by the mean of (1 - c)^5.
float ggx_typical_dip(float schlick) {
    float m = pow(max(schlick, 1e-30), 0.2);
    return (1.0 - m) * schlick * m;
}

#endif
