// SPDX-License-Identifier: Apache-2.0
// One closure at many points (measure/stability.h). Defined before: the features' macros, POINT_WORDS, RESULT_WORDS, and
// one of CANDIDATE (what is measured), REFERENCE (in double precision, at the directions that the candidate sampled) and
// SAMPLES (one slab and view for all invocations, sampled over and over).
//
// A point is a Slab as materials/slab.h orders its fields, view, light, three random numbers and the footprint; of
// SAMPLES, the first of the random numbers is the bits of the number of the first sample; samples of different numbers
// have different random numbers.

vec3 specular_lut(uint index, vec2 at) { return vec3(at.x, 1.0 - 0.5 * at.y, 0.5 + 0.5 * at.x * at.y); }

#include "measure/stability_functions.glsl"

Slab next_slab() {
    Slab slab;
    slab.features = points[place++];
    slab.coverage = next();
    slab.f0 = next3();
    slab.roughness = next();
    slab.albedo = next3();
    float anisotropy = next();
    vec3 f90 = next3();
    float specular_weight = next();
    vec3 f82 = next3();
    float second_roughness = next();
    float second_weight = next();
    float fuzz_amount = next();
    float fuzz_roughness = next();
    vec3 fuzz_color = next3();
    float film_thickness = next();
    float film_ior = next();
    uint lut = points[place++];
    float glint_density = next();
    vec2 glint_position = next2();
    vec2 glint_dx = next2();
    vec2 glint_dy = next2();
    vec3 mean_free_path = next3();
    float phase_anisotropy = next();
    float thickness = next();
    vec3 emission = next3();
    float edge_coverage = next();
    float edge_exponent = next();
    place++;  // priority
#ifdef NACRE_SLAB_ANISOTROPY
    slab.anisotropy = anisotropy;
#endif
#ifdef NACRE_SLAB_F90
    slab.f90 = f90;
    slab.specular_weight = specular_weight;
#endif
#ifdef NACRE_SLAB_F82
    slab.f82 = f82;
#endif
#ifdef NACRE_SLAB_SECOND_LOBE
    slab.second_roughness = second_roughness;
    slab.second_weight = second_weight;
#endif
#ifdef NACRE_SLAB_FUZZ
    slab.fuzz_amount = fuzz_amount;
    slab.fuzz_roughness = fuzz_roughness;
    slab.fuzz_color = fuzz_color;
#endif
#ifdef NACRE_SLAB_THIN_FILM
    slab.film_thickness = film_thickness;
    slab.film_ior = film_ior;
#endif
#ifdef NACRE_SLAB_SPECULAR_LUT
    slab.specular_lut = lut;
#endif
#ifdef NACRE_SLAB_GLINTS
    slab.glint_density = glint_density;
    slab.glint_position = glint_position;
    slab.glint_dx = glint_dx;
    slab.glint_dy = glint_dy;
#endif
#ifdef NACRE_SLAB_MEDIUM
    slab.mean_free_path = mean_free_path;
    slab.phase_anisotropy = phase_anisotropy;
    slab.thickness = thickness;
#endif
#ifdef NACRE_SLAB_EMISSION
    slab.emission = emission;
#endif
#ifdef NACRE_SLAB_EDGE_COVERAGE
    slab.edge_coverage = edge_coverage;
    slab.edge_exponent = edge_exponent;
#endif
    return slab;
}

#ifdef SAMPLES

uint hashed(uint x) {
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

void main() {
    place = 0u;
    Slab slab = next_slab();
    vec3 view = next3();
    next3();
    uint first = points[place];
    place += 3u;
    Closure closure = prepare_closure(slab, view, next());
    uint x = hashed(first + gl_GlobalInvocationID.x);
    uint y = hashed(x + 0x9e3779b9u);
    uint z = hashed(y + 0x7f4a7c15u);
    vec3 random = vec3(float(x >> 8u), float(y >> 8u), float(z >> 8u)) / 16777216.0;
    ClosureSample picked = sample_closure(closure, random);
    uint at = gl_GlobalInvocationID.x * RESULT_WORDS;
    put3(at, picked.direction);
    put3(at + 3u, picked.weight);
    put(at + 6u, picked.pdf);
    put(at + 7u, picked.is_mirror ? 1.0 : 0.0);
}

#else

// `value` and `pdf`: those of `light`.
void put_closure(uint at, Slab slab, Closure closure, vec3 view, vec3 light, ClosureValue value, float pdf) {
    ClosureAlbedo albedo = closure_albedo(closure);
    put3(at, value.specular);
    put3(at + 3u, value.diffuse + value.subsurface);
    put3(at + 6u, albedo.specular + albedo.fuzz);
    put3(at + 9u, albedo.diffuse + albedo.transmission);
    put3(at + 12u, closure_throughput(closure));
    put3(at + 15u, closure_transmittance(closure, max(light.z, 0.0)));
#ifdef NACRE_SLAB_EDGE_COVERAGE
    put(at + 18u, slab_coverage(slab, view.z));
#else
    put(at + 18u, slab.coverage);
#endif
    put(at + 19u, pdf * whole_albedo(closure));
}

void main() {
    place = gl_GlobalInvocationID.x * POINT_WORDS;
    Slab slab = next_slab();
    vec3 view = next3();
    vec3 light = next3();
    vec3 random = next3();
    float footprint = next();
    uint at = gl_GlobalInvocationID.x * RESULT_WORDS;
#ifdef CANDIDATE
    put(at + 28u, 0.0);
    put(at + 29u, 0.0);
    ClosureSample picked;
    picked.direction = light;
    vec3 seen = view;
    vec3 there = vec3(0.0);
    float there_scale = 0.0;
    // To the light, to the sample, and back from the light: by a loop, since drivers put every function in the place of
    // its calls. The last two cost as much again: one group in four.
    uint turns = (gl_WorkGroupID.x & 3u) == 0u ? 3u : 1u;
    for (uint turn = 0u; turn < turns; ++turn) {
        Closure closure = prepare_closure(slab, turn == 2u ? light : view, footprint);
        vec3 to = turn == 0u ? light : turn == 1u ? picked.direction : seen;
        ClosureValue value = evaluate_closure(closure, to);
        vec3 whole = value.specular + value.diffuse + value.subsurface;
        float pdf = closure_pdf(closure, to);
        float scale = lobe_scale(closure, to);
        if (turn == 0u) {
            put_closure(at, slab, closure, view, light, value, pdf);
            picked = sample_closure(closure, random);
            put3(at + 20u, picked.direction);
            put3(at + 23u, picked.weight);
            put(at + 26u, picked.pdf * whole_albedo(closure));
            put(at + 27u, picked.is_mirror || picked.pdf <= 0.0 ? 1.0 : 0.0);
            seen = closure.view;
            there = whole / light.z;
            there_scale = scale / light.z;
        }
        if (turn == 1u && !picked.is_mirror && picked.pdf > 0.0)
            put(at + 29u, defect(picked.weight * pdf, whole, scale));
        if (turn == 2u && light.z > 0.0) put(at + 28u, defect(there, whole / seen.z, there_scale));
    }
#else
    Closure closure = prepare_closure(slab, view, footprint);
    put_closure(at, slab, closure, view, light, evaluate_closure(closure, light), closure_pdf(closure, light));
    vec3 direction = vec3(candidates[at + 20u], candidates[at + 21u], candidates[at + 22u]);
    float pdf = closure_pdf(closure, direction);
    put3(at + 23u, pdf > 0.0 ? whole_value(closure, direction) / pdf : vec3(0.0));
    put(at + 26u, pdf * whole_albedo(closure));
    put(at + 30u, lobe_scale(closure, light));
    put(at + 31u, lobe_scale(closure, direction));
#endif
}

#endif
