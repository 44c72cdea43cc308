// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_THIN_FILM
#define NACRE_CLOSURES_THIN_FILM
#include "materials/closures/fresnel.glsl"

// A film of some hundred nanometers on an interface: its two reflections interfere, differently for each wavelength.
// Integrated over the spectrum in closed form by Gaussian fits of the color matching functions in the frequency domain.
// Source: Belcour and Barla 2017, "A practical extension to microfacet theory for the modeling of varying iridescence".

// The film's color of the m-th order: share of cos(2 pi path / wavelength) that is left over the spectrum, as linear
// sRGB. White light stays white without a path.
vec3 film_interference(float path) {
    float phase = 2.0 * pi * path;
    float square_phase = phase * phase;
    // Amplitudes over their sums, so that all are 1 without a path.
    float x = 0.846202 * cos(1.6810e6 * phase) * exp(-4.3278e9 * square_phase) +
              0.153798 * cos(2.2399e6 * phase) * exp(-4.5282e9 * square_phase);
    float y = cos(1.7953e6 * phase) * exp(-9.3046e9 * square_phase);
    float z = cos(2.2084e6 * phase) * exp(-6.6121e9 * square_phase);
    // XYZ to linear sRGB, rows scaled to a sum of 1: what is white without the film is white with it.
    return vec3(2.6897 * x - 1.2759 * y - 0.4138 * z, -1.0221 * x + 1.9783 * y + 0.0438 * z,
                0.0612 * x - 0.2245 * y + 1.1633 * z);
}

// Below this the film fades: two orders of interference do not add up to the interface without it.
const float thinnest_film = 3e-8;

// What interference leaves at least of what it takes from: colors are wide bands, in which no path extinguishes all. Two
// orders can come out at 0 or below, and what is left there would have but the digits that turns of a phase leave of it.
const float least_left = 1.0 / 256.0;

// Reflectance and 1 - reflectance, each with its digits where it is small.
struct FilmShares {
    vec3 reflected;
    vec3 passed;
};

// 1 - reflectance, all orders of the incoherent sum and two of the interference: the series of Airy with both summed
// up. Nothing cancels where the lower side reflects everything. `through` is 1 - outer.
float film_passed(float outer, float through, float inner, float inner_rest, float first_order, float second_order) {
    float amplitude = sqrt(outer * inner);
    float passed = through * inner_rest / max(1.0 - outer * inner, 1e-6);
    return passed * max(1.0 + 2.0 * amplitude * (first_order + amplitude * second_order), least_left);
}

// The same for the reflectance: what cancels are numbers of its own size, where neither side reflects much. (Where
// both reflect nearly everything its digits are lost.)
float film_reflected(float outer, float through, float inner, float inner_rest, float first_order,
                     float second_order) {
    float amplitude = sqrt(outer * inner);
    float interfering = 2.0 * through * inner_rest * amplitude * (first_order + amplitude * second_order);
    float both = outer * inner_rest + inner * through;
    return max(both - interfering, least_left * both) / max(1.0 - outer * inner, 1e-6);
}

// What the medium below lets in as seen from the film, by its reflectance in air, and the rest of that. It reflects all
// where the bare one does: from 0.98 on, where an index tells no more, both fade towards that. 1 - f0 is exact there;
// the difference of two numbers of 50 would leave metals few digits of what they let in.
float passed_below_film(float f0, float film_ior) {
    float ior = reflectance_to_ior(f0);
    return 4.0 * ior * film_ior / square(ior + film_ior) * saturated(50.0 * (1.0 - f0));
}
float reflected_below_film(float f0, float film_ior) {
    return mix(1.0, reflectance_under(f0, film_ior), saturated(50.0 * (1.0 - f0)));
}

// Of the interface under a film, by the cosine to its normal. thickness: meters.
FilmShares film_shares(vec3 f0, float thickness, float film_ior, float cos_theta) {
    float c = saturated(cos_theta);
    float ior = max(film_ior, 1.0);
    float outer_f0 = ior_to_reflectance(ior);
    float inside = refracted_cosine(c, outer_f0);
    float through = (1.0 - outer_f0) * schlick_rest(c, 1.0 - c);
    float outer = outer_f0 * schlick_rest(c, 1.0 - c) + power5(1.0 - c);
    float path = 2.0 * ior * thickness * inside;
    vec3 order_1 = film_interference(path);
    vec3 order_2 = film_interference(2.0 * path);
    float inside_rest = schlick_rest(inside, 1.0 - inside);
    vec3 below_rest = vec3(passed_below_film(f0.x, ior), passed_below_film(f0.y, ior), passed_below_film(f0.z, ior));
    vec3 below = vec3(reflected_below_film(f0.x, ior), reflected_below_film(f0.y, ior), reflected_below_film(f0.z, ior));
    vec3 rest = below_rest * inside_rest;
    vec3 inner = below * inside_rest + vec3(power5(1.0 - inside));
    // A reflection off a denser medium turns the phase by half a wave, off the film's upper side and, where what is
    // below is denser than the film, off its lower side: then both orders add up without a path.
    vec3 first = vec3(f0.x < outer_f0 ? order_1.x : -order_1.x, f0.y < outer_f0 ? order_1.y : -order_1.y,
                      f0.z < outer_f0 ? order_1.z : -order_1.z);
    vec3 passed = vec3(film_passed(outer, through, inner.x, rest.x, first.x, order_2.x),
                       film_passed(outer, through, inner.y, rest.y, first.y, order_2.y),
                       film_passed(outer, through, inner.z, rest.z, first.z, order_2.z));
    vec3 reflected = vec3(film_reflected(outer, through, inner.x, rest.x, first.x, order_2.x),
                          film_reflected(outer, through, inner.y, rest.y, first.y, order_2.y),
                          film_reflected(outer, through, inner.z, rest.z, first.z, order_2.z));
    FilmShares shares;
    shares.passed = clamp(passed, vec3(0.0), vec3(1.0));
    shares.reflected = clamp(reflected, vec3(0.0), vec3(1.0));
    return shares;
}

// The interface with its film as a Schlick curve that passes through the film's reflectance at one cosine: so the
// tables of directional albedo hold for it.
Fresnel make_film_fresnel(Fresnel bare, float thickness, float film_ior, float cos_theta) {
    // Along the surface all curves meet, and the fit would divide by nothing.
    float c = clamp(cos_theta, 0.1, 1.0);
    float m5 = power5(1.0 - c);
    FilmShares film = film_shares(bare.normal, thickness, film_ior, c);
    Fresnel fresnel = bare;
    fresnel.grazing = max(bare.grazing, vec3(saturated(ior_to_reflectance(max(film_ior, 1.0)) / smallest_reflectance)));
    float rest = schlick_rest(c, 1.0 - c);
    vec3 let_in = clamp((film.passed - (vec3(1.0) - fresnel.grazing) * m5) / rest, vec3(0.0), vec3(1.0));
    // The curve's other end is subtracted: of what that leaves, least_left again.
    vec3 dark = min(max((film.reflected - fresnel.grazing * m5) / rest, least_left * film.reflected), vec3(1.0));
    vec3 normal = vec3(let_in.x < 0.5 ? 1.0 - let_in.x : dark.x, let_in.y < 0.5 ? 1.0 - let_in.y : dark.y,
                       let_in.z < 0.5 ? 1.0 - let_in.z : dark.z);
    float share = smoothstep(0.0, thinnest_film, thickness);
    fresnel.normal = mix(bare.normal, normal, share);
    fresnel.grazing = mix(bare.grazing, fresnel.grazing, share);
    fresnel.dip = bare.dip * (1.0 - share);
    return fresnel;
}

#endif
