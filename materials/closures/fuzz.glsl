// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_FUZZ
#define NACRE_CLOSURES_FUZZ
#include "materials/closures/math.glsl"

// Fibers that stand on the interface: a cosine lobe under a linear map, times its directional albedo. Multiple
// scattering between the fibers is in it; it samples without noise; it is not reciprocal (the map depends on the view).
// Source: Zeltner, Burley and Chiang 2022, "Practical multiple-scattering sheen using linearly transformed cosines";
// the closed forms of its tables are those of the OpenPBR and MaterialX specifications (Apache-2.0), fitted to its
// volumetric data.

// Directional albedo, at most 0.744.
float sheen_albedo(float cos_theta, float roughness) {
    float y = clamp(roughness, 0.01, 1.0);
    float width = y * (0.0206607 + 1.58491 * y) / (0.0379424 + y * (1.32227 + y));
    float middle = y * (-0.193854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046391 + y);
    float offset = y * (0.000654023 + (-0.0207818 + 0.119681 * y) * y) / (1.26264 + y * (-1.92021 + y));
    float x = (cos_theta - middle) / width;
    return clamp(exp(-0.5 * x * x) / (width * sqrt(2.0 * pi)) + offset, 0.0, 1.0);
}

// The map that takes the lobe to a cosine lobe, in the frame whose x points to the view: rows (scale, 0, shear),
// (0, scale, 0), (0, 0, 1).
struct SheenMap {
    vec2 axis;  // of x, in the tangent plane
    float scale;
    float shear;
};

SheenMap sheen_map(vec3 view, float roughness) {
    float x = min(view.z, 1.0);
    float y = clamp(roughness, 0.01, 1.0);
    float tangent_length = sqrt(view.x * view.x + view.y * view.y);
    SheenMap map;
    map.axis = tangent_length > 1e-12 ? vec2(view.x, view.y) / tangent_length : vec2(1.0, 0.0);
    map.scale = max((2.58126 * x + 0.813703 * y) * y / (1.0 + 0.310327 * x * x + 2.60994 * x * y), 1e-6);
    map.shear =
        sqrt(1.0 - x) * (y - 1.0) * y * y * y / (0.0000254053 + 1.71228 * x - 1.71506 * x * y + 1.34174 * y * y);
    return map;
}

// Density of light directions; integrates to 1. Times sheen_albedo it is the lobe's value times the cosine of light.
float sheen_density(SheenMap map, vec3 light) {
    if (light.z <= 0.0) return 0.0;
    float x = map.axis.x * light.x + map.axis.y * light.y;
    float y = map.axis.x * light.y - map.axis.y * light.x;
    float original_x = map.scale * x + map.shear * light.z;
    float original_y = map.scale * y;
    float ratio = map.scale / (original_x * original_x + original_y * original_y + light.z * light.z);
    return light.z * ratio * ratio / pi;
}

vec3 sheen_sample(SheenMap map, float random_x, float random_y) {
    vec3 original = cosine_direction(random_x, random_y);
    float x = (original.x - original.z * map.shear) / map.scale;
    float y = original.y / map.scale;
    return normalize(vec3(map.axis.x * x - map.axis.y * y, map.axis.y * x + map.axis.x * y, original.z));
}

#endif
