// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_COVERED_CLOSURE
#define NACRE_CLOSURES_COVERED_CLOSURE
#include "materials/closures/prepared_closure.glsl"
// A closure that is seen through layers: how its lobes leave the medium above, what layers throw back to it, and what
// media above scatter. Only for shaders with NACRE_CLOSURE_COVERED; see closure.glsl.

// Of diffuse light inside a medium of index `ior`, what its surface lets out (d'Eon and Irving 2011, "A
// quantized-diffusion model for rendering translucent materials": a fit to Fresnel's equations).
float leaving_mean(float ior) {
    float inverse = 1.0 / ior;
    return (1.4399 * inverse - 0.7099) * inverse + 0.3319 - 0.0636 * ior;
}

// Of the light that a lobe mirrors inside a medium, what the medium's smooth surface lets out: by its first reflection,
// by the one after it was thrown back once, and by each of those that follow.
struct LeavingShares {
    float first;
    float second;
    float later;
    float partly;  // of what does not leave by the first, what was not reflected totally
};

// In the plane of tangential components a GGX lobe is about a distribution w^2 / (pi (w^2 + x^2)^2) around the mirrored
// view, and what leaves lies in a circle around 0. The distribution is an even one on a sphere, projected from the
// pole, so that the light in the circle has a closed form. The polynomial mends its logarithm of odds by what Fresnel's
// equations let through of sampled GGX lobes: within 0.01 at index 1.5 and alpha 0.1 to 0.4, within 0.03 for indices
// from 1.3 to 1.8. What was totally reflected comes back at such angles again: by random walks between a lobe and a
// smooth interface.
LeavingShares leaving_shares(float alpha, float view_cosine, float ior) {
    float f0 = ior_to_reflectance(ior);
    float sine2 = 1.0 - view_cosine * view_cosine;
    float width = 0.00176 +
                  square(2.0 * alpha * ior / (1.0 + 0.4408 * alpha)) * pow(max(1.0 - sine2 / (ior * ior), 0.0), 1.415);
    float around = width + sine2 - 0.9946;
    float side = around * inversesqrt(around * around + 3.9784 * width);
    float odds = log((1.0 - side) / (1.0 + side));
    float root = sqrt(alpha);
    float index = ior - 1.5;
    odds = -0.6978 + odds * (1.5657 - 0.1394 * odds + root * (-1.2699 + 0.0881 * odds) - 0.5125 * index) +
           root * (3.2543 - 2.6908 * root - 3.2969 * index) + index * (0.6742 + 0.4503 * index) -
           sine2 * (0.1998 + 0.2626 * odds + 0.1368 * root + 0.1544 * index + 0.0101 * sine2);
    // Where the medium is hardly denser all of it leaves.
    float dense = saturated(10.0 * (ior - 1.0));
    LeavingShares shares;
    shares.first = mix(1.0, max(1.0 / (1.0 + exp(-odds)), 0.02), dense);
    float wide = 0.88 * leaving_mean(ior);
    float returning = mix(1.0, mix(0.2, wide, 1.0 - exp(-square(4.0 * alpha))), dense);
    // What the surface reflects within the circle stays in the lobe.
    float cosine = max(view_cosine, 0.4);
    float partly = f0 + (1.0 - f0) * power5(1.0 - cosine);
    partly *= shares.first / (1.0 - partly);
    float back = max(1.0 - shares.first, 1e-6);
    shares.partly = min(partly / back, 1.0);
    shares.second = mix(returning, shares.first, shares.partly);
    shares.later = mix(1.0, mix(0.12, wide, 1.0 - exp(-pow(3.6 * alpha, 1.8))), dense);
    return shares;
}

// Mean of the diffuse model over the directions that leave a medium of index `ior`, against Lambert's.
float diffuse_below(Closure closure, float ior) {
#if NACRE_DIFFUSE_MODEL == 1
    return 1.0;
#else
    // Half of what leaves does so below, half above 45 degrees.
    float sine = 0.70710678 / ior;
    float cosine = sqrt(1.0 - sine * sine);
    vec3 along = vec3(sine, 0.0, cosine);
    vec3 across = vec3(0.0, sine, cosine);
    vec3 against = vec3(-sine, 0.0, cosine);
    float sum =
        diffuse_lobe(closure, along, half_vector_cosine(closure.view, along), half_vector(closure.view, along).z) +
        diffuse_lobe(closure, across, half_vector_cosine(closure.view, across), half_vector(closure.view, across).z) *
            2.0 +
        diffuse_lobe(closure, against, half_vector_cosine(closure.view, against), half_vector(closure.view, against).z);
    return pi * 0.25 * sum / cosine;
#endif
}

// The half of a lobe's light or of the diffuse light that leaves in a direction: what Fresnel's equations let through
// for unpolarized light, times the cosine outside over that inside and over ior^2. No term is negative.
float leaving_density(float cosine, float inner_cosine, float ior) {
    float across = cosine / (cosine + ior * inner_cosine);
    float along = cosine / (ior * cosine + inner_cosine);
    return 2.0 / ior * (across * across + along * along);
}

// Of a lobe that is seen from about the angle of total reflection or beyond it, by the squared sine that the view would
// have outside, from 0.81: the same closed form, mended for such views, within 0.01 at index 1.5 and alpha from 0.07.
float tilted_leaving_share(float alpha, float sine2, float ior) {
    float width = 0.00131 + square(2.0 * alpha * ior) * pow(max(1.0 - sine2 / (ior * ior), 0.0), 1.237);
    float around = width + sine2 - 0.9908;
    float side = around * inversesqrt(around * around + 3.9632 * width);
    float odds = log((1.0 - side) / (1.0 + side));
    float root = sqrt(alpha);
    float index = ior - 1.5;
    odds = 0.1141 + odds * (1.286 - 0.0295 * odds - 1.1831 * root - 0.2635 * sine2 - 0.3927 * index) +
           root * (2.8025 - 3.4367 * root + 0.7464 * sine2 - 3.5865 * index) + index * (0.87 - 0.3729 * sine2) -
           sine2 * (1.0435 + 0.0145 * sine2);
    return max(1.0 / (1.0 + exp(-odds)), 0.02);
}

// What was reflected totally comes from all around the directions that leave. If it lay there evenly, what a lobe sends
// into one of them were the part of the lobe that lies outside: (1 + s) / 2 by the closed form of leaving_shares. There is
// more of it where the lobe looks. Over Lambert's value; spread: squared width of the lobe; lean: of length 1 or less.
float ring_density(vec3 light, float spread, vec2 lean) {
    float around = spread - light.z * light.z;
    return (1.0 + around * inversesqrt(around * around + 4.0 * spread)) * max(1.0 - light.x * lean.x - light.y * lean.y, 0.0);
}

// One over the mean of ring_density over the diffuse light that leaves: in closed form without Fresnel's equations,
// which take more along the rim (a fit within 0.02).
float ring_scale(float width) {
    return (width + sqrt(width * width + 4.0)) * (1.0 + 0.018 / (width + 0.015)) / (4.0 * width);
}

// What lies above a closure, as the view sees it.
struct Cover {
    vec3 spread_up;     // share of what the lobes send that meets the closure as diffuse light
    vec3 spread_down;   // of the rest, the share that was scattered on its way down
    vec3 mean;          // what the closure's interface reflects of diffuse light
    vec3 rise;          // and how much more of it along the surface than along the normal
    vec3 kept;          // of light that goes up and down once more, what the medium above leaves
    float bend;         // 1 - 1 / index^2 of the medium that scatters
    float ior_excess;   // index - 1 of what lies directly above, against what the view and the lights outside are in
    float view_cosine;  // outside
};

// Optical depth by the share that is scattered. Of what is nearly all, 32 bits do not know the rest.
vec3 spread_depth(vec3 spread) {
    return vec3(minus_log_rest(min(spread.x, 0.9998)), minus_log_rest(min(spread.y, 0.9998)),
                minus_log_rest(min(spread.z, 0.9998)));
}

// What a scattering medium leaves of a lobe's light on its straight way down.
vec3 veil_transmittance(Closure closure, float cosine) {
    float way = inversesqrt(max(closure.veil_bend + cosine * cosine * (1.0 - closure.veil_bend), 1e-4));
    return exp(min(closure.veil_back - closure.veil * way, vec3(0.0)));
}

// About the cosine at which a lobe's light leaves. Lobes are wide outside, and none of their light comes from below.
float lobe_cosine(float width, float view_cosine) {
    float cosine2 = view_cosine * view_cosine;
    return sqrt(max(mix(cosine2, 0.45 - 1.1 * cosine2 * square(1.0 - cosine2), width), 1e-4));
}

// The same for all of a lobe.
vec3 lobe_veil(Closure closure, SpecularLobe lobe, float view_cosine) {
    float width = lobe.is_mirror ? 0.0 : min(2.7 * sqrt(lobe.area) * (1.0 + closure.ior_excess), 0.55);
    return veil_transmittance(closure, lobe_cosine(width, view_cosine));
}

// A closure that is seen through layers, prepared for the view inside. What is scattered on its way does not come along
// the lobes, but as diffuse light does, and meets the interface like it.
Closure cover_closure(Closure closure, Cover cover) {
    Closure covered = closure;
    float ior_excess = cover.ior_excess;
    vec3 up = cover.spread_up;
    vec3 straight = vec3(1.0) - up;
    float bend = cover.bend;
    float slant = sqrt(bend + cover.view_cosine * cover.view_cosine * (1.0 - bend));
    covered.veil = spread_depth(cover.spread_down) * max(slant, 0.01);
    covered.is_veiled = largest(covered.veil) > 0.0;
    covered.veil_bend = bend;
    // What is thrown back counts for both.
    vec3 both = covered.veil / mean_cosine;
    covered.veil_back = 0.5 * both / (vec3(1.0) + 1.3 * both);
    vec3 specular = closure.specular.albedo;
    covered.specular = scaled_lobe(closure.specular, straight);
#ifdef NACRE_SLAB_SECOND_LOBE
    if ((closure.features & slab_second_lobe) != 0u) {
        specular += closure.second.albedo;
        covered.second = scaled_lobe(closure.second, straight);
    }
#endif
    vec3 whole = specular + closure.entering;
    vec3 entering = mix(vec3(1.0), whole * (vec3(1.0) - cover.mean) / max(closure.entering, vec3(1e-30)), up);
    covered.diffuse = closure.diffuse * entering;
    covered.upward = up * whole * cover.mean;
    covered.upward_rise = vec3(0.0);
    // Below a denser medium no light leaves along the surface.
    if (ior_excess <= 0.0) covered.upward_rise = up * whole * cover.rise;
    covered.scattered_way = dot(covered.veil, vec3(1.0 / 3.0)) + 0.04;
    covered.scattered_scale = thin_scale(bend, covered.scattered_way);
#ifdef NACRE_SLAB_MEDIUM
    if ((closure.features & slab_medium) != 0u) {
        covered.thin *= entering;
        covered.subsurface *= entering;
        covered.transmission *= entering;
        covered.straight *= entering;
        covered.thin_scale = thin_scale(either(closure.bend, refraction_bend(ior_excess)), closure.thin_way);
    }
#endif
    covered.ior_excess = ior_excess;
    covered.view_cosine = max(cover.view_cosine, smallest_cosine);
    float again_cosine = covered.view_cosine;
    if (ior_excess > 0.0) {
        float ior = 1.0 + ior_excess;
        float alpha = sqrt(closure.specular.area);
        LeavingShares shares = leaving_shares(alpha, covered.view_cosine, ior);
        float once = shares.first;
        // Thrown back once, and again and again.
        vec3 reflected = min(specular, vec3(1.0)) * cover.kept;
        vec3 thrown = reflected * (1.0 - once);
        thrown *= vec3(shares.second) + reflected * ((1.0 - shares.second) * shares.later) /
                                            (vec3(1.0) - reflected * (1.0 - shares.later));
        vec3 sum = vec3(once) + thrown;
        vec3 share = thrown / sum;
        if (closure.specular.is_mirror) share = vec3(0.0);
        // What was reflected totally leaves by a lobe around what lies beyond that angle, and in a ring around the normal
        // that is brightest along its rim; the rest by a wider lobe around the mirrored view. Widths and shares by random
        // walks between a lobe and a smooth interface.
        float sine = ior * sqrt(closure.view.x * closure.view.x + closure.view.y * closure.view.y);
        float aside = saturated(4.5 * sine - 0.8) * saturated(2.0 - 3.3 * shares.partly);
        float tilt = mix(sine, 1.0 + min(1.4 * ior * alpha, 0.4 * ior_excess), aside);
        again_cosine = sqrt(max(1.0 - tilt * tilt, 0.0));
        float stretch = tilt / max(sine, 1e-6);
        float inside = tilt / ior;
        covered.again_view = vec3(closure.view.x * stretch, closure.view.y * stretch,
                                  sqrt(max(1.0 - inside * inside, 1e-6)));
        covered.again = covered.specular;
        covered.again.alpha = min(closure.specular.alpha * (0.95 + 1.1 * square(covered.view_cosine)), vec2(1.0));
        covered.again.area = covered.again.alpha.x * covered.again.alpha.y;
        covered.again.view_length = ggx_stretched_length(covered.again_view, covered.again.alpha);
        float area = alpha * alpha;
        float wide = sqrt(covered.again.area);
        float leaving = mix(leaving_shares(wide, again_cosine, ior).first,
                            tilted_leaving_share(wide, max(tilt * tilt, 0.81), ior), saturated(5.0 * tilt - 4.5));
        float ring = min(0.6 * area / (area + 0.017) +
                             0.6 * area / (area + 0.012) * square(square(square(covered.view_cosine))),
                         0.7);
        covered.again.albedo = covered.specular.albedo * share * (1.0 - ring);
        covered.ring_albedo = covered.specular.albedo * share * ring;
        covered.ring_spread = 1.7 * area * ior * ior;
        covered.ring_lean = vec2(closure.view.x, closure.view.y) * (ior * min(1.8, 1.0 / max(sine, 1e-6)));
        covered.ring = covered.ring_albedo * ring_scale(sqrt(covered.ring_spread));
        float single = 1.0 - ggx_albedo(covered.again_view.z, wide).missing;
        vec3 peak = covered.again.albedo / (single * leaving);
#ifdef NACRE_CLOSURE_CURVES
        covered.again.reflectance.normal = peak;
        covered.again.reflectance.grazing = peak;
        covered.again.reflectance.dip = vec3(0.0);
#else
        covered.again.reflectance = peak;
        covered.again.rise = vec3(0.0);
#endif
        vec3 first = vec3(1.0) / sum;
        vec3 own = covered.specular.albedo * (once * first);
        if (closure.specular.is_mirror) first = vec3(0.0);
        if (closure.specular.is_mirror) own = covered.specular.albedo;
        covered.specular = scaled_lobe(covered.specular, first);
        covered.specular.albedo = own;
#ifdef NACRE_SLAB_SECOND_LOBE
        if ((closure.features & slab_second_lobe) != 0u) {
            once = leaving_shares(sqrt(closure.second.area), covered.view_cosine, ior).first;
            own = covered.second.albedo;
            covered.second = scaled_lobe(covered.second, vec3(1.0 / once));
            covered.second.albedo = own;
        }
#endif
        covered.lambert_scale = 1.0 / leaving_mean(ior);
        covered.diffuse_scale =
            covered.lambert_scale / mix(1.0, diffuse_below(closure, ior), saturated(5.0 * ior_excess));
    }
    if (covered.is_veiled) {
        vec3 down = lobe_veil(covered, covered.specular, cover.view_cosine);
        covered.scattered = covered.specular.albedo * (vec3(1.0) - down);
        covered.specular.albedo *= down;
        down = lobe_veil(covered, covered.again, again_cosine);
        covered.scattered += covered.again.albedo * (vec3(1.0) - down);
        covered.again.albedo *= down;
        // Most of the ring lies along the rim.
        down = veil_transmittance(covered, 0.45);
        covered.scattered += covered.ring_albedo * (vec3(1.0) - down);
        covered.ring_albedo *= down;
#ifdef NACRE_SLAB_SECOND_LOBE
        if ((closure.features & slab_second_lobe) != 0u) {
            down = lobe_veil(covered, covered.second, cover.view_cosine);
            covered.scattered += covered.second.albedo * (vec3(1.0) - down);
            covered.second.albedo *= down;
        }
#endif
    }
    return with_probabilities(covered);
}

// What was thrown back, towards a light by its direction inside.
vec3 again_value(Closure closure, vec3 light) {
#ifdef NACRE_CLOSURE_CURVES
    vec3 peak = closure.again.reflectance.normal;
#else
    vec3 peak = closure.again.reflectance;
#endif
    return peak * ggx_value(closure.again_view, closure.again.view_length, light,
                            half_vector(closure.again_view, light), closure.again.alpha);
}

#endif
