// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_BLENDING
#define NACRE_CLOSURES_BLENDING
#include "materials/closures/conversions.glsl"
#include "materials/closures/operators.glsl"

// One slab in place of two, where a mix or a layer must do with one closure: their parameters blended by how much of
// each is seen. A field whose feature one of both lacks counts as the value that does nothing, so that a half of fuzz
// stays a half of fuzz.

// How much of each of two slabs is seen in one place.
struct BlendShares {
    float coverage;  // of both together
    float first;     // coverage of what is left of each, unnormalized: a second one under an opaque first has 0
    float second;
    vec3 first_light;   // the same, tinted: what of each slab's reflection is seen
    vec3 second_light;
};

float blend_share(float first, float second) {
    float sum = first + second;
    return sum > 0.0 ? second / sum : 0.0;
}

vec3 blend_color(vec3 first, vec3 second, vec3 first_light, vec3 second_light, float coverage) {
    return min((first * first_light + second * second_light) / max(coverage, 1e-30), vec3(1.0));
}

Slab blend_slabs(Slab a, Slab b, BlendShares shares) {
    Slab slab = a;
    slab.features = a.features | b.features;
    slab.coverage = shares.coverage;
    float t = blend_share(shares.first, shares.second);
    // What the interfaces reflect along the normal.
    vec3 f0_a = a.f0;
    vec3 f0_b = b.f0;
#ifdef NACRE_SLAB_F90
    float weight_a = (a.features & slab_f90) != 0u ? a.specular_weight : 1.0;
    float weight_b = (b.features & slab_f90) != 0u ? b.specular_weight : 1.0;
    f0_a *= weight_a;
    f0_b *= weight_b;
#endif
    vec3 f0 = blend_color(f0_a, f0_b, shares.first_light, shares.second_light, shares.coverage);
    slab.f0 = f0;
    vec3 entering_a = (vec3(1.0) - f0_a) * shares.first_light;
    vec3 entering_b = (vec3(1.0) - f0_b) * shares.second_light;
    vec3 reflecting = a.albedo * entering_a + b.albedo * entering_b;
    vec3 entering = (vec3(1.0) - f0) * shares.coverage;
    slab.albedo = vec3(blended_albedo(reflecting.x, entering.x), blended_albedo(reflecting.y, entering.y),
                       blended_albedo(reflecting.z, entering.z));
    // A bright lobe shows its shape more than a dim one.
    float gloss = blend_share(shares.first * largest(f0_a), shares.second * largest(f0_b));
    slab.roughness = mix(a.roughness, b.roughness, gloss);
#ifdef NACRE_SLAB_ANISOTROPY
    slab.anisotropy = mix((a.features & slab_anisotropy) != 0u ? a.anisotropy : 0.0,
                          (b.features & slab_anisotropy) != 0u ? b.anisotropy : 0.0, gloss);
#endif
#ifdef NACRE_SLAB_F90
    slab.f90 = mix((a.features & slab_f90) != 0u ? a.f90 : vec3(1.0),
                   (b.features & slab_f90) != 0u ? b.f90 : vec3(1.0), gloss);
    slab.specular_weight = mix(weight_a, weight_b, t);
    // Both together reflect what was blended.
    if (slab.specular_weight > 0.0) slab.f0 = min(f0 / slab.specular_weight, vec3(1.0));
#endif
#ifdef NACRE_SLAB_F82
    slab.f82 = mix((a.features & slab_f82) != 0u ? a.f82 : vec3(1.0),
                   (b.features & slab_f82) != 0u ? b.f82 : vec3(1.0), gloss);
#endif
#ifdef NACRE_SLAB_SECOND_LOBE
    float second_a = (a.features & slab_second_lobe) != 0u ? a.second_weight : 0.0;
    float second_b = (b.features & slab_second_lobe) != 0u ? b.second_weight : 0.0;
    slab.second_weight = mix(second_a, second_b, gloss);
    slab.second_roughness =
        mix(a.second_roughness, b.second_roughness, blend_share((1.0 - gloss) * second_a, gloss * second_b));
#endif
#ifdef NACRE_SLAB_FUZZ
    float fuzz_a = (a.features & slab_fuzz) != 0u ? a.fuzz_amount : 0.0;
    float fuzz_b = (b.features & slab_fuzz) != 0u ? b.fuzz_amount : 0.0;
    float fuzz_share = blend_share((1.0 - t) * fuzz_a, t * fuzz_b);
    slab.fuzz_amount = mix(fuzz_a, fuzz_b, t);
    slab.fuzz_roughness = mix(a.fuzz_roughness, b.fuzz_roughness, fuzz_share);
    slab.fuzz_color = mix(a.fuzz_color, b.fuzz_color, fuzz_share);
#endif
#ifdef NACRE_SLAB_THIN_FILM
    bool film_a = (a.features & slab_thin_film) != 0u;
    bool film_b = (b.features & slab_thin_film) != 0u;
    float film_share = blend_share(film_a ? 1.0 - gloss : 0.0, film_b ? gloss : 0.0);
    // A film does not become half of its thickness, which would be another color: the one that is seen more stays.
    if (film_share > 0.5) slab.film_thickness = b.film_thickness;
    slab.film_ior = mix(a.film_ior, b.film_ior, film_share);
#endif
#ifdef NACRE_SLAB_SPECULAR_LUT
    if ((a.features & slab_specular_lut) == 0u) slab.specular_lut = b.specular_lut;
#endif
#ifdef NACRE_SLAB_GLINTS
    if ((a.features & slab_glints) == 0u || ((b.features & slab_glints) != 0u && gloss > 0.5)) {
        slab.glint_density = b.glint_density;
        slab.glint_position = b.glint_position;
        slab.glint_dx = b.glint_dx;
        slab.glint_dy = b.glint_dy;
    }
#endif
#ifdef NACRE_SLAB_MEDIUM
    // Rates mix, lengths do not: the mean of both extinctions.
    vec3 mean_free_path_a = (a.features & slab_medium) != 0u ? a.mean_free_path : vec3(0.0);
    vec3 mean_free_path_b = (b.features & slab_medium) != 0u ? b.mean_free_path : vec3(0.0);
    slab.mean_free_path = vec3(1.0) / (mix(vec3(1.0) / max(mean_free_path_a, vec3(1e-12)),
                                           vec3(1.0) / max(mean_free_path_b, vec3(1e-12)), t));
    slab.phase_anisotropy = mix((a.features & slab_medium) != 0u ? a.phase_anisotropy : 0.0,
                                (b.features & slab_medium) != 0u ? b.phase_anisotropy : 0.0, t);
    if (t > 0.5) slab.thickness = b.thickness;
#endif
#ifdef NACRE_SLAB_EMISSION
    slab.emission = (((a.features & slab_emission) != 0u ? a.emission : vec3(0.0)) * shares.first_light +
                     ((b.features & slab_emission) != 0u ? b.emission : vec3(0.0)) * shares.second_light) /
                    max(shares.coverage, 1e-30);
#endif
#ifdef NACRE_SLAB_EDGE_COVERAGE
    slab.edge_coverage = mix((a.features & slab_edge_coverage) != 0u ? a.edge_coverage : a.coverage,
                             (b.features & slab_edge_coverage) != 0u ? b.edge_coverage : b.coverage, t);
    slab.edge_exponent = mix(a.edge_exponent, b.edge_exponent, t);
#endif
    return slab;
}

Slab mix_slabs(Slab a, Slab b, float amount) {
    BlendShares shares;
    shares.first = (1.0 - amount) * a.coverage;
    shares.second = amount * b.coverage;
    shares.coverage = shares.first + shares.second;
    shares.first_light = vec3(shares.first);
    shares.second_light = vec3(shares.second);
    return blend_slabs(a, b, shares);
}

// A layer; the matters are those of both slabs.
Slab layer_slabs(Slab top, Slab base, Matter top_matter, Matter base_matter) {
    // What crosses the top is tinted twice: towards the view, and from the light, which is taken to come along the
    // normal.
    vec3 through = top_matter.view_transmittance * top_matter.transmittance *
                   bounces_between(top_matter, base_matter).leaving;
    BlendShares shares;
    shares.coverage = top.coverage + (1.0 - top.coverage) * base.coverage;
    shares.first = top.coverage;
    shares.first_light = vec3(top.coverage);
    shares.second_light = base.coverage * (vec3(1.0 - top.coverage) + top.coverage * through);
    shares.second = largest(shares.second_light);
    // What a clear medium would scatter is not there to be seen.
    Slab seen = top;
    seen.albedo = top.albedo * (vec3(1.0) - top_matter.transmittance);
    Slab slab = blend_slabs(seen, base, shares);
    // Both interfaces are there and the base's medium is below both; only what is in the top's own medium counts by
    // share.
#ifdef NACRE_SLAB_MEDIUM
    if ((base.features & slab_medium) == 0u) {
        slab.mean_free_path = vec3(0.0);
    } else {
        slab.mean_free_path = base.mean_free_path;
        slab.phase_anisotropy = base.phase_anisotropy;
        slab.thickness = base.thickness;
    }
#endif
    return slab;
}

#endif
