// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_CONVERSIONS
#define NACRE_CLOSURES_CONVERSIONS
#include "materials/closures/math.glsl"
// What authors think in, turned into inputs of slabs. For generated patterns; materials/conversions.h has the same for
// the host. Others of their kind: fresnel.glsl (index and reflectance), medium_inputs.glsl (transmittance and mean free
// path), haze.glsl (haze and second lobe), thin_film.glsl (a film's reflectance by its thickness).

// Albedo of the one slab whose diffuse reflection is that of several side by side. An interface lets 1 - F into its
// medium, which is (1 - F0) times the same number for every F0 under Schlick's formula: so the blend is exact at every
// angle, where a mean of the albedos loses up to half of the light. entering: mean of (1 - F0), reflecting: mean of
// albedo (1 - F0), both by area.
float blended_albedo(float reflecting, float entering) { return entering > 0.0 ? min(reflecting / entering, 1.0) : 0.0; }

struct AlbedoAndF0 {
    vec3 albedo;
    vec3 f0;
};

// A dielectric of albedo base_color on 1 - metalness of the surface beside a metal of F0 base_color on the rest.
// Where metal and dielectric meet, interpolating metalness in the usual way (albedo base_color (1 - metalness)) leaves
// a dark halo; this does not. Colors and metalness in [0, 1]. Where both sides differ in base color as well, convert
// each side before interpolating: albedo and F0 may be filtered, base color and metalness not.
AlbedoAndF0 metalness_to_albedo_f0(vec3 base_color, float metalness, vec3 dielectric_f0) {
    AlbedoAndF0 result;
    result.f0 = mix(dielectric_f0, base_color, metalness);
    vec3 dielectric = (1.0 - metalness) * (vec3(1.0) - dielectric_f0);
    vec3 entering = dielectric + metalness * (vec3(1.0) - base_color);
    vec3 reflecting = base_color * dielectric;
    result.albedo = vec3(blended_albedo(reflecting.x, entering.x), blended_albedo(reflecting.y, entering.y),
                         blended_albedo(reflecting.z, entering.z));
    return result;
}

// Tangent in the local frame that is turned around the normal by `rotation` (radians, counter-clockwise), and back.
vec3 rotation_to_tangent(float rotation) { return vec3(cos(rotation), sin(rotation), 0.0); }
float tangent_to_rotation(vec3 tangent) {
    return tangent.x != 0.0 || tangent.y != 0.0 ? atan(tangent.y, tangent.x) : 0.0;
}

// (1 - c)^exponent and what is left of 1, both with all their digits: shares of what is seen at grazing angles and of
// what is seen along the normal. exponent > 0; 5 is that of Schlick's Fresnel.
float facing_share(float cos_theta, float exponent) {
    return exponential_rest(exponent * minus_log_rest(saturated(cos_theta)));
}
float grazing_share(float cos_theta, float exponent) {
    float steps = exponent * minus_log_rest(saturated(cos_theta));
    return steps < 0.01 ? 1.0 - exponential_rest(steps) : exp(-steps);
}

// Color by view angle (flip-flop).
vec3 flip_flop(vec3 facing, vec3 grazing, float exponent, float cos_theta) {
    return facing * facing_share(cos_theta, exponent) + grazing * grazing_share(cos_theta, exponent);
}

// Coverage by view angle. Both shares make 1: a coverage above 1 would leave less than nothing beside it.
float view_dependent_coverage(float facing, float grazing, float exponent, float cos_theta) {
    return min(facing * facing_share(cos_theta, exponent) + grazing * grazing_share(cos_theta, exponent), 1.0);
}

#endif
