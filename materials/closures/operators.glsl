// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_OPERATORS
#define NACRE_CLOSURES_OPERATORS
#ifndef NACRE_CLOSURE_COVERED
#define NACRE_CLOSURE_COVERED
#endif
#include "materials/closures/closure.glsl"

// Variance of slopes against roughness (Belcour 2018, "Efficient Rendering of Layered Materials using an Atomic
// Decomposition with Statistical Operators", supplemental: a fit to the variance of GGX lobes).
float roughness_to_variance(float roughness) {
    float a = pow(min(roughness * roughness, 0.9999), 1.1);
    return a / (1.0 - a);
}

float variance_to_roughness(float variance) { return sqrt(pow(variance / (1.0 + variance), 1.0 / 1.1)); }

// Variance that a rough interface adds to what is seen through it: refraction of the view on its way in and of the
// light on its way out, each as wide inside as a lobe whose alpha is scaled by half of |1 - 1 / n| (Belcour 2018), at
// normal incidence. A base of any roughness counts alike.
float refraction_variance(float roughness, float ior) {
    float a = pow(min(0.5 * (1.0 - 1.0 / ior) * roughness * roughness, 0.9999), 1.1);
    return 2.0 * a / (1.0 - a);
}

// A lobe that enters a denser medium is narrower inside by its index; its variance is a power of alpha.
float refraction_squeeze(float ior) { return pow(ior, -1.1); }

// How what lies below is seen: in the directions that are refracted into a medium of some index against what is above
// all matter, and its lobes there with `variance` in addition.
struct Widening {
    float ior_excess;  // index - 1: small ones keep their digits, which grazing directions need
    float variance;
};

Widening no_widening() {
    Widening widening;
    widening.ior_excess = 0.0;
    widening.variance = 0.0;
    return widening;
}

// Perceptual roughness of a slab as it is seen through what widens it.
float tracked_roughness(float roughness, Widening widening) {
    if (widening.variance <= 0.0) return roughness;
    return variance_to_roughness(roughness_to_variance(roughness) + widening.variance);
}

// The view as a slab meets it.
vec3 view_below(vec3 view, Widening widening) { return refracted_direction(view, widening.ior_excess); }

// What the operators of a tree do to the matter they arrange: what is tracked follows Hillaire and de Rousiers,
// "Authoring Materials that matter", SIGGRAPH 2023; the formulae are ours. Any subtree counts as one piece of matter
// whose parts lie independently of each other, so that a slab yields one closure whatever is above it.

// How much what is seen through a subtree spreads. Known before any closure is, since closures depend on it.
struct Spread {
    float coverage;
    float ior_excess;  // index - 1 of the covered share, against what lies above it
    float variance;    // that the covered share adds to what lies below, inside
};

// What a layer does with light from below: what it throws back, what leaves it, and the rest, which has its own
// formulae: light that is thrown back and forth many times shows how much is taken each time, and 1 - back - leaving
// would not have its digits. What the medium takes of light that leaves is not in it, but in Matter::transmittance.
struct Underside {
    vec3 back;
    vec3 leaving;
    vec3 absorbed;
};

// A slab, or what stands for a subtree, as what lies below and above it sees it. All but coverage and bare are those of
// the covered share; where nothing is covered they mean nothing.
struct Matter {
    float coverage;
    float bare;               // 1 - coverage: what lies below may be seen through nothing else
    vec3 transmittance;       // of light along the normal that is not scattered back: what the medium leaves of it
    vec3 view_transmittance;  // of what is seen through it in the view direction: interface, fuzz and medium
    Underside diffuse;        // for diffuse light from below
    Underside mirrored;       // for light that comes about along the mirrored view
    Underside trapped;        // for light that comes at the angles at which it was totally reflected before
    vec3 albedo;              // reflectance for diffuse light from above
    vec3 passed;              // of diffuse light from above, what reaches the other side
    vec3 absorbed;            // of diffuse light from above, the rest
    vec3 gloss;               // share of what is reflected towards the view that a lobe mirrors
    float alpha2;             // squared GGX alpha of that lobe, as it is seen from directly above
    float ior;                // against what lies above
    float bend;               // 1 - 1 / ior^2 of what `transmittance` lies in: how directions turn towards the normal
    // What the medium scatters, and not only forwards: of light from below that is seen in the view direction the share
    // of what leaves, of light that comes down to be mirrored there the share of what arrives, and of diffuse light from
    // below the share that is thrown back.
    vec3 scattered_up;
    vec3 scattered_down;
    vec3 scattered_back;
    float cos_view;           // of the view as it comes from above
};

// How a slab is seen through all that lies above it.
struct Path {
    vec3 weight;            // of the slab's radiance, without its own coverage
    vec3 uncovered;         // share of `weight` that passes by all matter above, [0, 1]
    vec3 transmittance;     // of the rest for light, along the normal; top_transmittance turns it to the light
    // Of the light that a lobe mirrors, the share that meets the slab as diffuse light, since it was scattered on its way
    // up or thrown back; and of the rest the share that was scattered on its way down.
    vec3 spread_up;
    vec3 spread_down;
    float ior_excess;       // index - 1 of what lies directly above the slab, against what is above all matter
    float bend;             // 1 - 1 / ior^2 of what `transmittance` lies in
};

#ifndef NACRE_SLAB_EDGE_COVERAGE
float slab_coverage(Slab slab, float cos_theta) { return slab.coverage; }
float slab_bare(Slab slab, float cos_theta) { return max(1.0 - slab.coverage, 0.0); }
#endif

Spread slab_spread(Slab slab, float cos_view) {
    Spread spread;
    spread.coverage = slab_coverage(slab, cos_view);
    spread.ior_excess = 0.0;
    spread.variance = 0.0;
#ifdef NACRE_SLAB_MEDIUM
    // Nothing is seen through the others.
    if ((slab.features & slab_medium) != 0u) {
        spread.ior_excess = medium_ior_excess(dot(slab.f0, vec3(1.0 / 3.0)));
        spread.variance = refraction_variance(slab.roughness, 1.0 + spread.ior_excess);
    }
#endif
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
    float share = amount * b.coverage / max(spread.coverage, 1e-30);
    spread.ior_excess = mix(a.ior_excess, b.ior_excess, share);
    spread.variance = mix(a.variance, b.variance, share);
    return spread;
}

// Directions are refracted by no more; stored materials count on it.
const float largest_ior = 2.6;

// What lies below a layer, by what is above both.
Widening widening_below(Widening above, Spread top) {
    Widening widening;
    float excess = top.ior_excess * top.coverage;
    widening.ior_excess = min(above.ior_excess + excess + above.ior_excess * excess, largest_ior - 1.0);
    widening.variance = above.variance * refraction_squeeze(1.0 + excess) + top.coverage * top.variance;
    return widening;
}

Spread layer_spread(Spread top, Spread base) {
    Widening above = no_widening();
    Widening both = widening_below(widening_below(above, top), base);
    Spread spread;
    spread.coverage = top.coverage + (1.0 - top.coverage) * base.coverage;
    float covered = max(spread.coverage, 1e-30);
    spread.ior_excess = both.ior_excess / covered;
    spread.variance = both.variance / covered;
    return spread;
}

Slab track_slab(Slab slab, Widening widening) {
    Slab tracked = slab;
    tracked.roughness = tracked_roughness(slab.roughness, widening);
    return tracked;
}

Matter no_matter() {
    Matter m;
    m.coverage = 0.0;
    m.bare = 1.0;
    m.transmittance = vec3(1.0);
    m.view_transmittance = vec3(1.0);
    m.diffuse.back = vec3(0.0);
    m.diffuse.leaving = vec3(1.0);
    m.diffuse.absorbed = vec3(0.0);
    m.mirrored = m.diffuse;
    m.trapped = m.diffuse;
    m.albedo = vec3(0.0);
    m.passed = vec3(1.0);
    m.absorbed = vec3(0.0);
    m.gloss = vec3(0.0);
    m.alpha2 = 0.0;
    m.ior = 1.0;
    m.bend = 0.0;
    m.scattered_up = vec3(0.0);
    m.scattered_down = vec3(0.0);
    m.scattered_back = vec3(0.0);
    m.cos_view = 1.0;
    return m;
}

Underside mix_underside(Underside a, Underside b, vec3 share) {
    Underside u;
    u.back = mix(a.back, b.back, share);
    u.leaving = mix(a.leaving, b.leaving, share);
    u.absorbed = mix(a.absorbed, b.absorbed, share);
    return u;
}

Path open_path() {
    Path path;
    path.weight = vec3(1.0);
    path.uncovered = vec3(1.0);
    path.transmittance = vec3(1.0);
    path.spread_up = vec3(0.0);
    path.spread_down = vec3(0.0);
    path.ior_excess = 0.0;
    path.bend = 0.0;
    return path;
}

// A medium that lets `through` pass of diffuse light, takes `absorbed` and reflects the rest, `reflected`, under an
// interface that lets `leaving` out and throws the rest, `inwards`, back.
Underside underside_of(vec3 leaving, vec3 inwards, vec3 reflected, vec3 through, vec3 absorbed) {
    vec3 kept = through + absorbed;
    vec3 between = vec3(1.0) / max(kept + leaving * reflected, vec3(1e-30));
    vec3 down = inwards * between;
    Underside u;
    u.back = min(reflected + through * through * down, vec3(1.0));
    u.leaving = kept * leaving * between;
    u.absorbed = absorbed * (kept + through) * down;
    return u;
}

// Of light that the interface keeps as well as it can, the share that leaves: that of diffuse light to this power.
const float shut_exponent = 4.0;

// What a layer above a slab needs to know of it: the albedo is that under diffuse light.
Matter base_matter(Slab slab, float cos_view) {
    Matter m = no_matter();
    m.coverage = slab_coverage(slab, cos_view);
    m.bare = slab_bare(slab, cos_view);
    m.cos_view = cos_view;
    m.alpha2 = square(square(slab.roughness));
    float excess = medium_ior_excess(dot(slab.f0, vec3(1.0 / 3.0)));
    m.ior = 1.0 + excess;
    m.bend = refraction_bend(excess);
    vec3 leaving = internal_transmittance(slab);
    vec3 inwards = internal_reflectance(slab);
    // Of the medium, and of the medium under its interface.
    vec3 reflected = slab.albedo;
    vec3 through = vec3(0.0);
    vec3 absorbed = vec3(1.0) - slab.albedo;
    vec3 albedo = reflected;
    vec3 passed = through;
    vec3 lost = absorbed;
    vec3 scattered = vec3(1.0);
    m.transmittance = vec3(0.0);
    m.scattered_up = scattered;
    m.scattered_down = scattered;
#ifdef NACRE_SLAB_MEDIUM
    if ((slab.features & slab_medium) != 0u) {
        MediumScattering medium = slab_scattering(slab, mean_cosine);
        reflected = medium.reflected;
        through = medium.through + medium.straight;
        absorbed = medium.absorbed;
        // What lets nothing through scatters.
        scattered = (medium.through + vec3(1e-30)) / (through + vec3(1e-30));
        vec3 between = vec3(1.0) / max(medium.kept + leaving * reflected, vec3(1e-30));
        albedo = min(reflected * leaving * between, vec3(1.0));
        passed = through * between;
        lost = absorbed * between;
        m.scattered_up = scattered;
        m.scattered_down = either(scattered, medium.reflected);
        m.scattered_back = medium.reflected;
        m.transmittance =
            exp(log(clamp((through + vec3(1e-30)) / (medium.kept + vec3(1e-30)), vec3(1e-30), vec3(1.0))) * mean_cosine);
    }
#endif
    Fresnel fresnel = slab_fresnel(slab);
    vec3 mean = fresnel_mean(fresnel);
    vec3 entering = fresnel_mean_transmittance(fresnel);
    m.albedo = mean + entering * albedo;
    m.passed = entering * passed;
    m.absorbed = entering * lost;
    m.gloss = mean / max(m.albedo, vec3(1e-30));
    m.diffuse = underside_of(leaving, inwards, reflected, through, absorbed);
    // Light that was scattered on its way in is diffuse when it comes back.
    m.mirrored =
        mix_underside(underside_of(vec3(1.0) - slab.f0, slab.f0, reflected, through, absorbed), m.diffuse, scattered);
    vec3 steps = shut_exponent * vec3(minus_log_rest(inwards.x), minus_log_rest(inwards.y), minus_log_rest(inwards.z));
    m.trapped = mix_underside(
        underside_of(exp(-steps), vec3(exponential_rest(steps.x), exponential_rest(steps.y), exponential_rest(steps.z)),
                     reflected, through, absorbed),
        m.diffuse, scattered);
#ifdef NACRE_SLAB_FUZZ
    if ((slab.features & slab_fuzz) != 0u) {
        float fuzz = slab.fuzz_amount * sheen_albedo(mean_cosine, slab.fuzz_roughness);
        m.albedo = mix(m.albedo, slab.fuzz_color, fuzz);
        m.passed *= 1.0 - fuzz;
        m.absorbed = mix(m.absorbed, vec3(1.0) - slab.fuzz_color, fuzz);
    }
#endif
    return m;
}

// A slab as what lies below and around it sees it.
Matter slab_matter(Slab slab, Closure closure) {
    Matter m = base_matter(slab, closure.view.z);
    vec3 straight = closure_throughput(closure);
    vec3 through = closure_albedo(closure).transmission;
    m.view_transmittance = straight + through;
#ifdef NACRE_SLAB_MEDIUM
    if ((slab.features & slab_medium) != 0u) {
        // Up by the view's own share. Down it comes at the same angle: what goes straight falls with the way's length.
        vec3 up = (through + vec3(1e-30)) / (m.view_transmittance + vec3(1e-30));
        float way = mean_cosine / max(refracted_cosine(closure.view.z, closure.reflectance), 0.01);
        vec3 down = vec3(exponential_rest(minus_log_rest(m.scattered_down.x) * way),
                         exponential_rest(minus_log_rest(m.scattered_down.y) * way),
                         exponential_rest(minus_log_rest(m.scattered_down.z) * way));
        float sideways = 1.0 - max(slab.phase_anisotropy, 0.0);
        m.scattered_up = up * sideways;
        m.scattered_down = down * sideways;
    }
#endif
    return m;
}

// What a layer throws back to the base below it, again and again. Diffuse light: (1 - K) / (1 - E K) (OpenPBR, "Coat
// darkening"). What a lobe mirrors follows leaving_shares: reflection by reflection, since what was totally reflected
// comes back at such angles again. The layer's own facets turn light half as far as those of the base.
struct Bounces {
    vec3 leaving;   // of what the base reflects, by its first reflection
    vec3 arriving;  // at the base, by what arrives there first
    vec3 absorbed;  // of what arrives at the base first, by base, underside and Matter::transmittance of what leaves
};

// The underside of a layer as light meets it that a lobe mirrors, by what share a clear interface of the layer's index
// lets out of it, and the rest, diffuse light.
Underside underside_by_share(Matter top, float leaving, vec3 gloss) {
    float open = 1.0 - ior_to_reflectance(top.ior);
    float shut = square(square(leaving_mean(top.ior)));
    float share = saturated((open - leaving) / max(open - shut, 1e-6));
    return mix_underside(top.diffuse, mix_underside(top.mirrored, top.trapped, vec3(share)), gloss);
}

Bounces bounces_between(Matter top, Matter base) {
    float alpha = min(sqrt(base.alpha2 + 0.25 * top.alpha2), 1.0);
    LeavingShares shares = leaving_shares(alpha, top.cos_view, top.ior);
    Underside first = underside_by_share(top, shares.first, base.gloss);
    Underside second = underside_by_share(top, shares.second, base.gloss);
    Underside later = underside_by_share(top, shares.later, base.gloss);
    // 1 - back * albedo by positive terms: nothing is lost where both are 1.
    vec3 left = later.leaving + later.absorbed + later.back * (base.passed + base.absorbed) + vec3(1e-9);
    vec3 again = first.back * base.albedo;
    vec3 thrice = again * second.back * base.albedo / left;
    Bounces bounces;
    bounces.leaving = first.leaving + again * second.leaving + thrice * (later.leaving + vec3(1e-9));
    bounces.arriving = vec3(1.0) + again + thrice;
    // 1 - albedo * leaving * transmittance - passed * arriving, multiplied out.
    vec3 taken = vec3(1.0) - top.transmittance;
    bounces.absorbed =
        base.absorbed * bounces.arriving +
        base.albedo * (first.leaving * taken + first.absorbed + again * (second.leaving * taken + second.absorbed) +
                       thrice * (later.leaving * taken + later.absorbed));
    return bounces;
}

// Of the light that a base mirrors to the view and a layer lets out, the share that the layer's medium scattered back to
// the base at least once: by the angle at which it comes up first, and as diffuse light from then on.
vec3 thrown_back(Matter top, Matter base) {
    vec3 back = top.scattered_back;
    float cosine = lobe_cosine(min(2.7 * sqrt(base.alpha2), 0.55), top.cos_view);
    float way = mean_cosine / mix(mean_cosine, cosine, dot(base.gloss, vec3(1.0 / 3.0)));
    vec3 first = vec3(exponential_rest(minus_log_rest(back.x) * way), exponential_rest(minus_log_rest(back.y) * way),
                      exponential_rest(minus_log_rest(back.z) * way));
    vec3 later = first * base.albedo * (vec3(1.0) - back);
    return later / max(later + (vec3(1.0) - first) * (vec3(1.0) - back * base.albedo), vec3(1e-30));
}

// Of what lies below, seen through matter that covers only a part.
vec3 matter_throughput(Matter m) { return vec3(m.bare) + m.coverage * m.view_transmittance; }

// Coverage with an amount: less of the same matter.
Matter cover_matter(Matter m, float amount) {
    Matter covered = m;
    covered.coverage = m.coverage * amount;
    covered.bare = (1.0 - amount) + m.bare * amount;
    return covered;
}

// Of two kinds of matter, by what each reflects.
vec3 gloss_of_both(Matter a, vec3 reflected_a, Matter b, vec3 reflected_b) {
    return (reflected_a * a.gloss + reflected_b * b.gloss) / max(reflected_a + reflected_b, vec3(1e-30));
}
float alpha2_of_both(float alpha2_a, vec3 mirrored_a, float alpha2_b, vec3 mirrored_b) {
    float a = largest(mirrored_a);
    float b = largest(mirrored_b);
    return (a * alpha2_a + b * alpha2_b) / max(a + b, 1e-30);
}

// How much it tells of a medium in which directions light crosses it.
float medium_weight(vec3 transmittance, vec3 scattered) {
    return -log(clamp(dot(transmittance, vec3(1.0 / 3.0)), 1e-3, 1.0)) + dot(scattered, vec3(1.0 / 3.0));
}

vec3 scattered_by(Matter m) { return either(m.scattered_up, m.scattered_down); }

// Of two media, by that and by how much each covers.
float bend_of_both(float bend_a, float weight_a, float bend_b, float weight_b) {
    // What hardly absorbs or scatters bends nothing that tells, and of what takes all but a thousandth no digits are
    // left.
    return (weight_a * bend_a + weight_b * bend_b) / (weight_a + weight_b + 1e-5);
}

// Side by side: a on 1 - amount of the surface, b on the rest.
Matter mix_matter(Matter a, Matter b, float amount) {
    float covered_a = (1.0 - amount) * a.coverage;
    float covered_b = amount * b.coverage;
    Matter m = no_matter();
    m.coverage = covered_a + covered_b;
    m.bare = (1.0 - amount) * a.bare + amount * b.bare;
    if (m.coverage <= 0.0) return m;
    float share = covered_b / m.coverage;
    m.transmittance = mix(a.transmittance, b.transmittance, share);
    m.view_transmittance = mix(a.view_transmittance, b.view_transmittance, share);
    m.diffuse = mix_underside(a.diffuse, b.diffuse, vec3(share));
    m.mirrored = mix_underside(a.mirrored, b.mirrored, vec3(share));
    m.trapped = mix_underside(a.trapped, b.trapped, vec3(share));
    m.albedo = mix(a.albedo, b.albedo, share);
    m.passed = mix(a.passed, b.passed, share);
    m.absorbed = mix(a.absorbed, b.absorbed, share);
    m.gloss = gloss_of_both(a, covered_a * a.albedo, b, covered_b * b.albedo);
    m.alpha2 = alpha2_of_both(a.alpha2, covered_a * a.albedo * a.gloss, b.alpha2, covered_b * b.albedo * b.gloss);
    m.ior = mix(a.ior, b.ior, share);
    m.bend = bend_of_both(a.bend, covered_a * medium_weight(a.transmittance, scattered_by(a)), b.bend,
                          covered_b * medium_weight(b.transmittance, scattered_by(b)));
    m.scattered_up = mix(a.scattered_up, b.scattered_up, share);
    m.scattered_down = mix(a.scattered_down, b.scattered_down, share);
    m.scattered_back = mix(a.scattered_back, b.scattered_back, share);
    m.cos_view = a.cos_view;
    return m;
}

// The undersides of two layers, by the shares of the surface where the top, the base and both are.
Underside layer_underside(Underside top, Underside base, Matter base_matter, float t, float b, float tb) {
    // 1 - albedo * back by positive terms.
    vec3 between = vec3(1.0) / max(top.leaving + top.absorbed + top.back * (base_matter.passed + base_matter.absorbed),
                                   vec3(1e-30));
    vec3 back = base.back + base.leaving * base_matter.transmittance * top.back * base_matter.passed * between;
    vec3 taken = base_matter.absorbed + base_matter.passed * (vec3(1.0) - base_matter.transmittance);
    vec3 absorbed = base.absorbed + base.leaving * between * (top.absorbed + top.back * taken);
    Underside u;
    u.back = t * top.back + b * base.back + tb * min(back, vec3(1.0));
    u.leaving = t * top.leaving + b * base.leaving + tb * min(base.leaving * top.leaving * between, vec3(1.0));
    u.absorbed = t * top.absorbed + b * base.absorbed + tb * min(absorbed, vec3(1.0));
    return u;
}

// One above the other, lying independently: both on C_t C_b of the surface, either alone on the rest.
Matter layer_matter(Matter top, Matter base) {
    float both = top.coverage * base.coverage;
    float only_top = top.coverage * base.bare;
    float only_base = top.bare * base.coverage;
    Matter m = no_matter();
    m.coverage = both + only_top + only_base;
    m.bare = top.bare * base.bare;
    if (m.coverage <= 0.0) return m;
    float t = only_top / m.coverage;
    float b = only_base / m.coverage;
    float tb = both / m.coverage;
    m.transmittance = t * top.transmittance + b * base.transmittance + tb * top.transmittance * base.transmittance;
    m.view_transmittance = t * top.view_transmittance + b * base.view_transmittance +
                           tb * top.view_transmittance * base.view_transmittance;
    Bounces bounces = bounces_between(top, base);
    vec3 below = top.passed * base.albedo * bounces.leaving * top.transmittance;
    vec3 passed = top.passed * base.passed * bounces.arriving;
    m.diffuse = layer_underside(top.diffuse, base.diffuse, base, t, b, tb);
    m.mirrored = layer_underside(top.mirrored, base.mirrored, base, t, b, tb);
    m.trapped = layer_underside(top.trapped, base.trapped, base, t, b, tb);
    m.albedo = t * top.albedo + b * base.albedo + tb * min(top.albedo + below, vec3(1.0));
    m.passed = t * top.passed + b * base.passed + tb * min(passed, vec3(1.0));
    m.absorbed = t * top.absorbed + b * base.absorbed + tb * (top.absorbed + top.passed * bounces.absorbed);
    vec3 of_top = (t + tb) * top.albedo;
    vec3 of_base = b * base.albedo + tb * below;
    m.gloss = gloss_of_both(top, of_top, base, of_base);
    m.alpha2 = alpha2_of_both(top.alpha2, of_top * top.gloss,
                              base.alpha2 * square(mix(1.0, top.ior, tb / max(b + tb, 1e-30))), of_base * base.gloss);
    m.bend = bend_of_both(top.bend, (t + tb) * medium_weight(top.transmittance, scattered_by(top)),
                          either(top.bend, base.bend), (b + tb) * medium_weight(base.transmittance, scattered_by(base)));
    m.scattered_up = either(top.scattered_up * (t + tb), base.scattered_up * (b + tb));
    m.scattered_down = either(top.scattered_down * (t + tb), base.scattered_down * (b + tb));
    m.scattered_back = either(top.scattered_back * (t + tb), base.scattered_back * (b + tb));
    m.ior = mix(1.0, top.ior, t + tb) * mix(1.0, base.ior, b + tb);
    m.cos_view = top.cos_view;
    return m;
}

// A path that comes up through a mix or a coverage: only `amount` of the surface is the slab's.
Path path_through_mix(Path path, float amount) {
    Path above = path;
    above.weight = path.weight * amount;
    return above;
}

// A path that comes up from the base of a layer under `top`; `base` is all that lies below the top, to the bottom of
// the material: light that is thrown back may hit any part of it.
Path path_through_layer(Path path, Matter top, Matter base, Widening widening) {
    vec3 beside = vec3(top.bare);
    // What was scattered above on its way up is diffuse light here.
    vec3 scattered = path.spread_up;
    Matter seen = top;
    seen.cos_view = mix(top.cos_view, mean_cosine, dot(scattered, vec3(1.0 / 3.0)));
    Bounces bounces = bounces_between(seen, base);
    vec3 through = top.coverage * mix(top.view_transmittance, top.passed, scattered) * bounces.leaving;
    vec3 sum = beside + through;
    // Where nothing comes through the rest does not matter.
    vec3 by = beside / max(sum, vec3(1e-30));
    Path above;
    above.weight = path.weight * sum;
    vec3 covered_share = through / max(sum, vec3(1e-30));
    vec3 up_by_top = either(top.scattered_up, thrown_back(top, base)) * covered_share;
    vec3 down_by_top = top.scattered_down * covered_share;
    // Diffuse light passes an interface more easily than what comes along it.
    vec3 up_above = scattered * (beside + top.coverage * top.passed * bounces.leaving) / max(sum, vec3(1e-30));
    above.spread_up = either(min(up_above, vec3(1.0)), up_by_top);
    above.spread_down = either(path.spread_down, down_by_top);
    above.ior_excess = widening.ior_excess;
    above.uncovered = path.uncovered * by;
    // What light keeps at normal incidence is the product of both layers', exactly; at other angles the one layer
    // that stands for both is between.
    vec3 kept_above = mix(path.transmittance, vec3(1.0), path.uncovered);
    vec3 kept_by_top = mix(top.transmittance, vec3(1.0), by);
    vec3 kept = kept_above * kept_by_top;
    above.bend = bend_of_both(path.bend, medium_weight(kept_above, either(path.spread_up, path.spread_down)),
                              either(refraction_bend(path.ior_excess), top.bend),
                              medium_weight(kept_by_top, either(up_by_top, down_by_top)));
    vec3 covered = max(vec3(1.0) - above.uncovered, vec3(1e-30));
    above.transmittance = min(max(kept - above.uncovered, vec3(0.0)) / covered, vec3(1.0));
    return above;
}

// A closure of a slab that was prepared for the view refracted by path.ior_excess, under all that lies above it.
// view_cosine: outside.
Closure closure_below_path(Closure closure, Slab slab, Path path, float view_cosine) {
    Cover cover;
    cover.spread_up = path.spread_up;
    cover.spread_down = path.spread_down;
    Fresnel fresnel = slab_fresnel(slab);
    cover.mean = fresnel_mean(fresnel);
    cover.rise = fresnel.grazing - fresnel.normal;
    // Light that is thrown back goes through the medium that is as dense as what lies directly above, not through what
    // lies above that.
    float dense = saturated(path.bend / max(refraction_bend(path.ior_excess), 1e-6));
    vec3 twice = exp(log(max(path.transmittance, vec3(1e-30))) * (2.0 / max(closure.view.z, 0.1)));
    cover.kept = mix(vec3(1.0), mix(twice, vec3(1.0), path.uncovered), dense);
    cover.bend = path.bend;
    cover.ior_excess = path.ior_excess;
    cover.view_cosine = view_cosine;
    return cover_closure(closure, cover);
}

// The closure of a slab as it is seen through all that lies above it, by the view outside.
Closure closure_below(Slab slab, Path path, vec3 view, float footprint) {
    Closure closure = prepare_closure(slab, refracted_direction(view, path.ior_excess), footprint);
    return closure_below_path(closure, slab, path, view.z);
}

// Light's way down to a slab, from the cosine outside: the layers' transmittance along the refracted direction, and 1
// on the uncovered share. Where nothing refracts, no light from below a hundredth comes through what tells.
vec3 top_transmittance(Path path, float cos_light) {
    float inverse_cosine = inversesqrt(max(path.bend + cos_light * cos_light * (1.0 - path.bend), 1e-4));
    vec3 along = exp(log(max(path.transmittance, vec3(1e-30))) * inverse_cosine);
    return mix(along, vec3(1.0), path.uncovered);
}

#endif
