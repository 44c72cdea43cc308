// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_OPERATORS
#define NACRE_CLOSURES_OPERATORS
#include "materials/closures/closure.glsl"

// Variance of slopes against roughness (Belcour 2018, "Efficient Rendering of Layered Materials using an Atomic
// Decomposition with Statistical Operators", supplemental: a fit to the variance of GGX lobes).
float roughness_to_variance(float roughness) {
    float a = pow(min(roughness * roughness, 0.9999), 1.1);
    return a / (1.0 - a);
}

float variance_to_roughness(float variance) {
    return sqrt(pow(variance / (1.0 + variance), 1.0 / 1.1));
}

// Variance that a rough interface adds to what is seen through it: refraction of the light on its way in and of the
// view on its way out, each that of a lobe whose alpha is scaled by half of |n - 1| / n and |n - 1| (Belcour 2018),
// for index 1.5 and at normal incidence. A base of any roughness counts alike.
float refraction_variance(float roughness) {
    float alpha = roughness * roughness;
    float into = pow(min(alpha * (1.0 / 6.0), 0.9999), 1.1);
    float out_of = pow(min(alpha * 0.25, 0.9999), 1.1);
    return into / (1.0 - into) + out_of / (1.0 - out_of);
}

// Perceptual roughness of a slab as it is seen through what adds a variance.
float tracked_roughness(float roughness, float variance) {
    return variance > 0.0 ? variance_to_roughness(roughness_to_variance(roughness) + variance) : roughness;
}

// What the operators of a tree do to the matter they arrange: what is tracked follows Hillaire and de Rousiers,
// "Authoring Materials that matter", SIGGRAPH 2023; the formulae are ours. Any subtree counts as one piece of matter
// whose parts lie independently of each other, so that a slab yields one closure whatever is above it.

// How much what is seen through a subtree spreads. Known before any closure is, since closures depend on it.
struct Spread {
    float coverage;
    float variance;  // that the covered share adds to the slopes of what lies below
};

// A slab, or what stands for a subtree, as what lies below it sees it. The last five are those of the covered share;
// where nothing is covered they mean nothing.
struct Matter {
    float coverage;
    vec3 transmittance;       // straight through the medium along the normal
    vec3 view_transmittance;  // of what is seen through it in the view direction: interface, fuzz and medium
    vec3 internal;            // reflectance for diffuse light from below
    vec3 albedo;              // reflectance for diffuse light from above
    vec3 passed;              // of diffuse light from above, what reaches the other side
};

// How a slab is seen through all that lies above it.
struct Path {
    vec3 weight;         // of the slab's radiance, without its own coverage
    vec3 uncovered;      // share of `weight` that passes by all matter above, [0, 1]
    vec3 transmittance;  // of the rest for light, along the normal; top_transmittance turns it to the light
};

#ifndef NACRE_SLAB_EDGE_COVERAGE
float slab_coverage(Slab slab, float cos_theta) { return slab.coverage; }
#endif

Spread slab_spread(Slab slab, float cos_view) {
    Spread spread;
    spread.coverage = slab_coverage(slab, cos_view);
    spread.variance = refraction_variance(slab.roughness);
    return spread;
}

Spread cover_spread(Spread spread, float amount) {
    Spread covered = spread;
    covered.coverage = spread.coverage * amount;
    return covered;
}

Spread mix_spread(Spread a, Spread b, float amount) {
    Spread spread;
    spread.coverage = (1.0 - amount) * a.coverage + amount * b.coverage;
    float sum = (1.0 - amount) * a.coverage * a.variance + amount * b.coverage * b.variance;
    spread.variance = sum / max(spread.coverage, 1e-30);
    return spread;
}

Spread layer_spread(Spread top, Spread base) {
    Spread spread;
    spread.coverage = top.coverage + (1.0 - top.coverage) * base.coverage;
    spread.variance = (top.coverage * top.variance + base.coverage * base.variance) / max(spread.coverage, 1e-30);
    return spread;
}

// Variance of what lies below a layer, by that above both.
float variance_below(float above, Spread top) { return above + top.coverage * top.variance; }

Slab track_slab(Slab slab, float variance) {
    Slab tracked = slab;
    tracked.roughness = tracked_roughness(slab.roughness, variance);
    return tracked;
}

// Of diffuse light, about half way between its mean cosine and its most frequent one.
const float mean_cosine = 0.6;

Matter no_matter() {
    Matter m;
    m.coverage = 0.0;
    m.transmittance = vec3(1.0);
    m.view_transmittance = vec3(1.0);
    m.internal = vec3(0.0);
    m.albedo = vec3(0.0);
    m.passed = vec3(1.0);
    return m;
}

Path open_path() {
    Path path;
    path.weight = vec3(1.0);
    path.uncovered = vec3(1.0);
    path.transmittance = vec3(1.0);
    return path;
}

// What a layer above a slab needs to know of it: the albedo is that under diffuse light.
Matter base_matter(Slab slab, float cos_view) {
    Matter m = no_matter();
    m.coverage = slab_coverage(slab, cos_view);
    vec3 reflected = slab.albedo;
    vec3 through = vec3(0.0);
#ifdef NACRE_SLAB_MEDIUM
    if ((slab.features & slab_medium) != 0u) {
        float inside = refracted_cosine(mean_cosine, dot(slab.f0, vec3(1.0 / 3.0)));
        Scattering x = medium_scattering(slab.albedo.x, optical_depth(slab.mean_free_path.x, slab.thickness),
                                         slab.phase_anisotropy, inside);
        Scattering y = medium_scattering(slab.albedo.y, optical_depth(slab.mean_free_path.y, slab.thickness),
                                         slab.phase_anisotropy, inside);
        Scattering z = medium_scattering(slab.albedo.z, optical_depth(slab.mean_free_path.z, slab.thickness),
                                         slab.phase_anisotropy, inside);
        reflected = vec3(x.reflected, y.reflected, z.reflected);
        through = vec3(x.through + x.straight, y.through + y.straight, z.through + z.straight);
    }
#endif
    vec3 mean = fresnel_mean(slab_fresnel(slab));
    m.albedo = mean + (vec3(1.0) - mean) * reflected;
    m.passed = (vec3(1.0) - mean) * through;
#ifdef NACRE_SLAB_FUZZ
    if ((slab.features & slab_fuzz) != 0u) {
        float fuzz = slab.fuzz_amount * sheen_albedo(mean_cosine, slab.fuzz_roughness);
        m.albedo = mix(m.albedo, slab.fuzz_color, fuzz);
        m.passed *= 1.0 - fuzz;
    }
#endif
    return m;
}

// A slab as what lies below and around it sees it.
Matter slab_matter(Slab slab, Closure closure) {
    Matter m = base_matter(slab, closure.view.z);
    m.transmittance = closure_transmittance(closure, 1.0);
    m.view_transmittance = closure_throughput(closure) + closure_albedo(closure).transmission;
    m.internal = internal_reflectance(slab);
    return m;
}

// Of what lies below, seen through matter that covers only a part.
vec3 matter_throughput(Matter m) { return vec3(1.0 - m.coverage) + m.coverage * m.view_transmittance; }

// Coverage with an amount: less of the same matter.
Matter cover_matter(Matter m, float amount) {
    Matter covered = m;
    covered.coverage = m.coverage * amount;
    return covered;
}

// Side by side: a on 1 - amount of the surface, b on the rest.
Matter mix_matter(Matter a, Matter b, float amount) {
    float covered_a = (1.0 - amount) * a.coverage;
    float covered_b = amount * b.coverage;
    Matter m = no_matter();
    m.coverage = covered_a + covered_b;
    if (m.coverage <= 0.0) return m;
    float share = covered_b / m.coverage;
    m.transmittance = mix(a.transmittance, b.transmittance, share);
    m.view_transmittance = mix(a.view_transmittance, b.view_transmittance, share);
    m.internal = mix(a.internal, b.internal, share);
    m.albedo = mix(a.albedo, b.albedo, share);
    m.passed = mix(a.passed, b.passed, share);
    return m;
}

// One above the other, lying independently: both on C_t C_b of the surface, either alone on the rest.
Matter layer_matter(Matter top, Matter base) {
    float both = top.coverage * base.coverage;
    float only_top = top.coverage * (1.0 - base.coverage);
    float only_base = (1.0 - top.coverage) * base.coverage;
    Matter m = no_matter();
    m.coverage = both + only_top + only_base;
    if (m.coverage <= 0.0) return m;
    float t = only_top / m.coverage;
    float b = only_base / m.coverage;
    float tb = both / m.coverage;
    m.transmittance = t * top.transmittance + b * base.transmittance + tb * top.transmittance * base.transmittance;
    m.view_transmittance =
        t * top.view_transmittance + b * base.view_transmittance +
        tb * top.view_transmittance * base.view_transmittance;
    // Light goes on between the top, from below, and the base, from above.
    vec3 between = vec3(1.0) / max(vec3(1.0) - base.albedo * top.internal, vec3(1e-6));
    vec3 internal =
        base.internal + (vec3(1.0) - base.internal) * base.transmittance * top.internal * base.passed * between;
    vec3 albedo = top.albedo + top.passed * base.albedo * bounce_factor(top.internal, base.albedo) * top.transmittance;
    vec3 passed = top.passed * base.passed * between;
    m.internal = t * top.internal + b * base.internal + tb * min(internal, vec3(1.0));
    m.albedo = t * top.albedo + b * base.albedo + tb * min(albedo, vec3(1.0));
    m.passed = t * top.passed + b * base.passed + tb * min(passed, vec3(1.0));
    return m;
}

// A path that comes up through a mix or a coverage: only `amount` of the surface is the slab's.
Path path_through_mix(Path path, float amount) {
    Path above = path;
    above.weight = path.weight * amount;
    return above;
}

// A path that comes up from the base of a layer under `top`; `base_albedo` is that of all that lies below the top, to
// the bottom of the material (Matter::albedo): light that is thrown back may hit any part of it.
Path path_through_layer(Path path, Matter top, vec3 base_albedo) {
    vec3 beside = vec3(1.0 - top.coverage);
    vec3 through = top.coverage * top.view_transmittance * bounce_factor(top.internal, base_albedo);
    vec3 sum = beside + through;
    // Where nothing comes through the rest does not matter.
    vec3 by = beside / max(sum, vec3(1e-30));
    Path above;
    above.weight = path.weight * sum;
    above.uncovered = path.uncovered * by;
    // What light keeps at normal incidence is the product of both layers', exactly; at other angles the one layer
    // that stands for both is between.
    vec3 kept = mix(path.transmittance, vec3(1.0), path.uncovered) * mix(top.transmittance, vec3(1.0), by);
    vec3 covered = max(vec3(1.0) - above.uncovered, vec3(1e-30));
    above.transmittance = min(max(kept - above.uncovered, vec3(0.0)) / covered, vec3(1.0));
    return above;
}

// Light's way down to a slab, from the cosine outside: the layers' transmittance along the refracted direction (index
// 1.5, that of nearly all coats), and 1 on the uncovered share.
vec3 top_transmittance(Path path, float cos_light) {
    float sin2 = (1.0 - cos_light * cos_light) * (1.0 / 2.25);
    float inverse_cosine = inversesqrt(1.0 - sin2);
    vec3 along = exp(log(max(path.transmittance, vec3(1e-30))) * inverse_cosine);
    return mix(along, vec3(1.0), path.uncovered);
}

#endif
