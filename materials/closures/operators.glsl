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

// A slab, or what stands for a subtree, as what lies below and above it sees it. All but coverage are those of the
// covered share; where nothing is covered they mean nothing.
struct Matter {
    float coverage;
    vec3 transmittance;       // of light along the normal that is not scattered back: what the medium leaves of it
    vec3 view_transmittance;  // of what is seen through it in the view direction: interface, fuzz and medium
    vec3 internal;            // reflectance for diffuse light from below
    vec3 leaving;             // of diffuse light from below, what leaves; 1 - internal where nothing is absorbed
    vec3 sharp_internal;      // the same two for light that comes from below about along the mirrored view
    vec3 sharp_leaving;
    vec3 albedo;   // reflectance for diffuse light from above
    vec3 passed;   // of diffuse light from above, what reaches the other side
    vec3 diffuse;  // share of what is reflected towards the view that comes as diffuse light does, not mirrored
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
    m.leaving = vec3(1.0);
    m.sharp_internal = vec3(0.0);
    m.sharp_leaving = vec3(1.0);
    m.albedo = vec3(0.0);
    m.passed = vec3(1.0);
    m.diffuse = vec3(1.0);
    return m;
}

Path open_path() {
    Path path;
    path.weight = vec3(1.0);
    path.uncovered = vec3(1.0);
    path.transmittance = vec3(1.0);
    return path;
}

// How much of a mirroring lobe that reflects the view inside a medium of index 1.5 meets the medium's surface as diffuse
// light does: 0 a mirror's, 1 diffuse light. A fit of what GGX lobes of that alpha lose to total reflection there, off by
// 0.1 (and by less where that is seen: towards grazing views both ends are alike).
float lobe_diffuseness(float alpha, float cos_view) { return 1.0 - exp(-7.0 * pow(alpha, 0.3 + 1.5 * cos_view)); }

// Light from below between the medium and the interface above it: what comes back down, and what leaves.
vec3 thrown_back(vec3 interface_reflectance, vec3 reflected, vec3 through) {
    return min(reflected + through * through * interface_reflectance /
                               max(vec3(1.0) - interface_reflectance * reflected, vec3(1e-6)),
               vec3(1.0));
}
vec3 leaving(vec3 interface_reflectance, vec3 reflected) {
    return (vec3(1.0) - reflected) * (vec3(1.0) - interface_reflectance) /
           max(vec3(1.0) - interface_reflectance * reflected, vec3(1e-6));
}

// What a layer above a slab needs to know of it: the albedo is that under diffuse light.
Matter base_matter(Slab slab, float cos_view) {
    Matter m = no_matter();
    m.coverage = slab_coverage(slab, cos_view);
    vec3 reflected = slab.albedo;
    vec3 through = vec3(0.0);
    vec3 scattered = vec3(1.0);
    m.transmittance = vec3(0.0);
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
        scattered = vec3(x.through, y.through, z.through);
        through = scattered + vec3(x.straight, y.straight, z.straight);
        scattered = scattered / max(through, vec3(1e-30));
        m.transmittance = exp(log(clamp(through / max(vec3(1.0) - reflected, vec3(1e-6)), vec3(1e-30), vec3(1.0))) * inside);
    }
#endif
    Fresnel fresnel = slab_fresnel(slab);
    vec3 mean = fresnel_mean(fresnel);
    m.albedo = mean + (vec3(1.0) - mean) * reflected;
    m.passed = (vec3(1.0) - mean) * through;
    vec3 mirrored = mean * (1.0 - lobe_diffuseness(slab.roughness * slab.roughness, cos_view));
    m.diffuse = vec3(1.0) - mirrored / max(m.albedo, vec3(1e-30));
    vec3 from_below = internal_reflectance(slab);
    // Light that was scattered on its way in is diffuse when it comes back.
    vec3 sharp = mix(fresnel_reflectance(fresnel, cos_view), from_below, scattered);
    m.internal = thrown_back(from_below, reflected, through);
    m.leaving = leaving(from_below, reflected);
    m.sharp_internal = thrown_back(sharp, reflected, through);
    m.sharp_leaving = leaving(sharp, reflected);
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
    m.view_transmittance = closure_throughput(closure) + closure_albedo(closure).transmission;
    return m;
}

// What a base under a layer sends out, relative to its first reflection: the layer throws light back to the base, again
// and again. What the base mirrors the first time is less spread than what it reflects later. Source for diffuse light:
// OpenPBR, "Coat darkening".
vec3 bounce_factor(Matter top, Matter base) {
    vec3 first = base.diffuse;
    vec3 later = vec3(1.0) - (vec3(1.0) - first) * (vec3(1.0) - first);
    vec3 internal = mix(top.sharp_internal, top.internal, later);
    vec3 leaving = mix(top.sharp_leaving, top.leaving, later);
    // 1 - internal * albedo by positive terms: nothing is lost where both are 1.
    vec3 left = leaving + max(vec3(1.0) - internal - leaving, vec3(0.0)) + internal * (vec3(1.0) - base.albedo);
    vec3 again = (leaving + vec3(1e-9)) / (left + vec3(1e-9));
    return mix(top.sharp_leaving, top.leaving, first) +
           mix(top.sharp_internal, top.internal, first) * base.albedo * again;
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
    m.leaving = mix(a.leaving, b.leaving, share);
    m.sharp_internal = mix(a.sharp_internal, b.sharp_internal, share);
    m.sharp_leaving = mix(a.sharp_leaving, b.sharp_leaving, share);
    m.albedo = mix(a.albedo, b.albedo, share);
    m.passed = mix(a.passed, b.passed, share);
    m.diffuse = (covered_a * a.albedo * a.diffuse + covered_b * b.albedo * b.diffuse + vec3(1e-30)) /
                (covered_a * a.albedo + covered_b * b.albedo + vec3(1e-30));
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
    vec3 sharply = vec3(1.0) / max(vec3(1.0) - base.albedo * top.sharp_internal, vec3(1e-6));
    vec3 internal = base.internal + base.leaving * base.transmittance * top.internal * base.passed * between;
    vec3 sharp_internal =
        base.sharp_internal + base.sharp_leaving * base.transmittance * top.sharp_internal * base.passed * sharply;
    vec3 below = top.passed * base.albedo * bounce_factor(top, base) * top.transmittance;
    vec3 passed = top.passed * base.passed * between;
    m.internal = t * top.internal + b * base.internal + tb * min(internal, vec3(1.0));
    m.leaving = t * top.leaving + b * base.leaving + tb * min(base.leaving * top.leaving * between, vec3(1.0));
    m.sharp_internal = t * top.sharp_internal + b * base.sharp_internal + tb * min(sharp_internal, vec3(1.0));
    m.sharp_leaving = t * top.sharp_leaving + b * base.sharp_leaving +
                      tb * min(base.sharp_leaving * top.sharp_leaving * sharply, vec3(1.0));
    m.albedo = t * top.albedo + b * base.albedo + tb * min(top.albedo + below, vec3(1.0));
    m.passed = t * top.passed + b * base.passed + tb * min(passed, vec3(1.0));
    m.diffuse = ((t + tb) * top.albedo * top.diffuse + (b * base.albedo + tb * below) * base.diffuse + vec3(1e-30)) /
                ((t + tb) * top.albedo + b * base.albedo + tb * below + vec3(1e-30));
    return m;
}

// A path that comes up through a mix or a coverage: only `amount` of the surface is the slab's.
Path path_through_mix(Path path, float amount) {
    Path above = path;
    above.weight = path.weight * amount;
    return above;
}

// A path that comes up from the base of a layer under `top`; `base` is all that lies below the top, to the bottom of the
// material: light that is thrown back may hit any part of it.
Path path_through_layer(Path path, Matter top, Matter base) {
    vec3 beside = vec3(1.0 - top.coverage);
    vec3 through = top.coverage * top.view_transmittance * bounce_factor(top, base);
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
