// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_HAZE
#define NACRE_CLOSURES_HAZE
#include "materials/closures/math.glsl"

// Two lobes from a perceptual haze: a helper for authors, evaluated where slabs are made.
// Source: Barla, Pacanowski and Vangorp 2018, "A composite BRDF model for hazy gloss".

struct Haze {
    float f0;                // of both lobes
    float second_roughness;  // perceptual
    float second_weight;
};

// f0: of the lobe without haze; roughness: of its core, perceptual; haziness: [0, 1]; extent: how much wider the haze
// is than the core, >= 0 (the second lobe's alpha is that of the core times 1 + extent). The peak of the core does not
// move with haziness: the reflectance rises by what the haze adds around it.
Haze make_haze(float f0, float roughness, float haziness, float extent) {
    float widening = 1.0 + max(extent, 0.0);
    float narrow = roughness * roughness;
    bool is_limited = narrow * widening > 1.0;
    float alpha = min(narrow * widening, 1.0);
    // Ratio of both widths and 1 less that: of the peaks it is the square.
    float ratio = is_limited ? narrow : 1.0 / widening;
    float ratio_rest = is_limited ? 1.0 - narrow : max(extent, 0.0) / widening;
    float peak = square(ratio);
    float peak_rest = ratio_rest * (1.0 + ratio);
    // As much as keeps the reflectance of the whole, or the share of the second lobe, below 1.
    float added = saturated(haziness) * (f0 > peak ? (1.0 - f0) / peak_rest : f0 / peak);
    Haze haze;
    haze.f0 = min(f0 + peak_rest * added, 1.0);
    haze.second_roughness = sqrt(alpha);
    haze.second_weight = haze.f0 > 0.0 ? saturated(added / haze.f0) : 0.0;
    return haze;
}

#endif
