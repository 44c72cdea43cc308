// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_MEDIUM_INPUTS
#define NACRE_CLOSURES_MEDIUM_INPUTS
#include "materials/closures/math.glsl"
// What a medium is described by, from one form to another: lengths and transmittance, albedo before and after
// scattering. Needs no table; materials/closures/medium.glsl shades with it.

// Lengths that are divided stay between these: meters.
const float shortest_length = 1e-12;
const float longest_length = 1e12;

// The similarity parameter sqrt((1 - w) / (1 - w g)), w being the albedo of a single scattering and g the phase
// anisotropy, of a medium that reflects `albedo` if it is infinitely thick, and back. 0: nothing is absorbed, 1:
// nothing is scattered. Source: van de Hulst 1980, in the form of Kulla and Conty 2017; round trip within 2e-5.
// darkness: 1 - albedo, which has more digits than the albedo where both follow from something else.
float medium_similarity(float albedo, float darkness) {
    float root = sqrt(9.59217 + albedo * (41.6808 + albedo * 17.7126));
    // 4.09712 + 4.20863 albedo - root, multiplied out so that the ends are exact and no digits cancel.
    return clamp(7.19424 * darkness / (4.09712 + 4.20863 * albedo + root), 0.0, 1.0);
}

// 1 - medium_similarity, with all digits where that is near 1: the same fit multiplied out from the other end.
float medium_dissimilarity(float albedo) {
    float root = sqrt(9.59217 + albedo * (41.6808 + albedo * 17.7126));
    float rise = (41.6808 + 17.7126 * albedo) / (root + 3.0971232);
    return clamp(albedo * (rise + 11.40287) / (4.09712 + 4.20863 * albedo + root), 0.0, 1.0);
}

float medium_albedo(float similarity) {
    return (1.0 - similarity) * (1.0 - 0.139 * similarity) / (1.0 + 1.17 * similarity);
}

// Albedo of a single scattering, by 1 - similarity: so a small one has its digits.
float scattering_albedo(float dissimilarity, float phase_anisotropy) {
    float single = dissimilarity * (2.0 - dissimilarity);
    return single / (1.0 - phase_anisotropy * (1.0 - single));
}

// What an infinitely thick medium reflects by the albedo of a single scattering, [0, 1]: scattering_albedo backwards.
float albedo_of_scattering(float single, float phase_anisotropy) {
    float rest = 1.0 - single;
    return medium_albedo(sqrt(rest / max(rest + single * (1.0 - phase_anisotropy), 1e-30)));
}

// Under an interface that lets `leaving` of diffuse light out and throws the rest back, a medium that reflects `own`
// by itself looks like this: what slabs take as their albedo.
float albedo_under_interface(float own, float leaving) {
    return own * leaving / max((1.0 - own) + own * leaving, 1e-30);
}

// Mean free path in a medium that lets `transmittance` through `distance`, both in any range; and back. Black is
// opaque: a mean free path of 0.
float transmittance_to_mean_free_path(float transmittance, float distance) {
    if (transmittance <= 0.0) return 0.0;
    float depth = -log(clamp(transmittance, 1e-30, 1.0));
    return clamp(distance / max(depth, 1e-24), 0.0, longest_length);
}

float optical_depth(float mean_free_path, float distance) {
    return clamp(distance, 0.0, longest_length) / clamp(mean_free_path, shortest_length, longest_length);
}

float medium_transmittance(float mean_free_path, float distance) {
    return exp(-optical_depth(mean_free_path, distance));
}

#endif
