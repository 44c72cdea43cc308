// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_SLAB
#define NACRE_CLOSURES_SLAB
#include "materials/closures/features.glsl"

// A piece of matter: an interface over a medium. Units, ranges and meaning of every field: materials/slab.h.
struct Slab {
    uint features;
    float coverage;
    vec3 f0;
    float roughness;
    vec3 albedo;
#ifdef NACRE_SLAB_ANISOTROPY
    float anisotropy;
#endif
#ifdef NACRE_SLAB_F90
    vec3 f90;
    float specular_weight;
#endif
#ifdef NACRE_SLAB_F82
    vec3 f82;
#endif
#ifdef NACRE_SLAB_SECOND_LOBE
    float second_roughness;
    float second_weight;
#endif
#ifdef NACRE_SLAB_FUZZ
    float fuzz_amount;
    float fuzz_roughness;
    vec3 fuzz_color;
#endif
#ifdef NACRE_SLAB_THIN_FILM
    float film_thickness;
    float film_ior;
#endif
#ifdef NACRE_SLAB_SPECULAR_LUT
    uint specular_lut;
#endif
#ifdef NACRE_SLAB_GLINTS
    float glint_density;
    vec2 glint_position;
    vec2 glint_dx;
    vec2 glint_dy;
#endif
#ifdef NACRE_SLAB_MEDIUM
    vec3 mean_free_path;
    float phase_anisotropy;
    float thickness;
#endif
#ifdef NACRE_SLAB_EMISSION
    vec3 emission;
#endif
#ifdef NACRE_SLAB_EDGE_COVERAGE
    float edge_coverage;
    float edge_exponent;
#endif
};

#endif
