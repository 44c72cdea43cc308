// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_MEDIUM
#define NACRE_CLOSURES_MEDIUM
#include "materials/closures/medium_inputs.glsl"
// A layer of a scattering and absorbing medium between two planes, from opaque to empty. Who includes this has defined
//
//     vec2 medium_table(vec3 at)    materials/tables/medium_table.h, interpolated as those of tables.glsl

// What becomes of light that enters the layer.
struct Scattering {
    float reflected;
    float through;   // scattered, out of the far side
    float straight;  // out of the far side without an event
    float absorbed;  // the rest, but not found as what the others leave of 1
    float opaque;    // how much of `reflected` is that of an infinitely thick medium, [0, 1]
};

// Rows of the table: optical depths 2^-8 to 2^12.
float medium_table_row(float depth) { return saturated((log2(clamp(depth, 1e-6, 1e6)) + 8.0) / 20.0); }

// darkness: 1 - albedo. cosine: inside the medium. Directions of scattering are not told apart: a phase function g
// counts as the isotropic one whose depth is scaled by 1 - w g (van de Hulst's similarity). Nothing is lost where
// nothing is absorbed.
Scattering medium_scattering(float albedo, float darkness, float depth, float phase_anisotropy, float cosine) {
    Scattering result;
    float similarity = medium_similarity(albedo, darkness);
    float dissimilarity = medium_dissimilarity(albedo);
    // The constants of both fits are rounded: the smaller one counts, so that what is scattered and absorbed makes 1.
    bool is_bright = similarity < 0.5;
    float single = is_bright ? 1.0 - similarity * similarity : dissimilarity * (2.0 - dissimilarity);
    float absorption = is_bright ? similarity * similarity : 1.0 - single;
    float inverse = 1.0 / (1.0 - phase_anisotropy * absorption);
    float reduced = depth * (1.0 - phase_anisotropy) * inverse;
    float column = sqrt(clamp(cosine, 0.0, 1.0));
    float row = medium_table_row(reduced);
    float slice = sqrt(similarity);
    vec2 entry = medium_table(vec3(column, row, slice));
    vec2 infinite = medium_table(vec3(column, 1.0, slice));
    float inside = max(cosine, smallest_cosine);
    float hit = exponential_rest(reduced / inside);
    // Deeper than the table, what comes through falls with the depth.
    float forth = entry.x * min(4096.0 / max(reduced, 1e-6), 1.0);
    float back = 1.0 - forth;
    float escaping = hit * single * (1.0 - entry.y);
    float reflected = escaping * back;
    float absorbed = hit * (absorption + single * entry.y);
    result.opaque = hit * hit * saturated(2.0 * back - 1.0);
    // An infinitely thick medium reflects its albedo towards every angle, as an opaque one does. The difference is that
    // of the smaller numbers, of what is reflected or of what is not.
    float infinite_albedo = single * (1.0 - infinite.y);
    float missing = albedo < 0.5 ? albedo - infinite_albedo : absorption + single * infinite.y - darkness;
    // What is added must be there to be had.
    float added = min(reflected * result.opaque * missing / max(infinite_albedo, 1e-30), absorbed);
    result.reflected = reflected + added;
    result.absorbed = absorbed - added;
    // Of the light that the isotropic medium lets through straight, this one scatters some forward; a backward phase
    // function takes some of it.
    float forward = depth * phase_anisotropy * single * inverse / inside;
    result.straight = exp(-depth / inside);
    float through = escaping * forth + (forward > 0.0 ? exp(-reduced / inside) * exponential_rest(forward)
                                                      : -result.straight * exponential_rest(-forward));
    result.through = max(through, 0.0);
    result.straight = max(result.straight + min(through, 0.0), 0.0);
    return result;
}

// Share of the light that a medium scatters back which leaves farther from where it entered than half a footprint.
// Source: Christensen and Burley 2015, "Approximate reflectance profiles for efficient subsurface scattering", diffuse
// light.
float subsurface_share(float albedo, float mean_free_path, float footprint) {
    float scale = 1.9 - albedo + 3.5 * (albedo - 0.8) * (albedo - 0.8);
    float radius =
        0.5 * scale * clamp(footprint, 0.0, longest_length) / clamp(mean_free_path, shortest_length, longest_length);
    return 0.25 * exp(-radius) + 0.75 * exp(-radius / 3.0);
}

#endif
