// SPDX-License-Identifier: Apache-2.0
#ifndef NACRE_CLOSURES_FEATURES
#define NACRE_CLOSURES_FEATURES
// What a slab may have beyond one GGX lobe with F0 over an opaque diffuse medium: bits of Slab::features. A shader in
// which a feature occurs defines its macro as well (materials/slab.h lists them); without the macro its code and its
// fields do not exist. Where a slab's features are written as a constant, the code of those it lacks folds away.
const uint slab_anisotropy = 1u;        // NACRE_SLAB_ANISOTROPY
const uint slab_f90 = 2u;               // NACRE_SLAB_F90
const uint slab_f82 = 4u;               // NACRE_SLAB_F82
const uint slab_second_lobe = 8u;       // NACRE_SLAB_SECOND_LOBE
const uint slab_fuzz = 16u;             // NACRE_SLAB_FUZZ
const uint slab_thin_film = 32u;        // NACRE_SLAB_THIN_FILM
const uint slab_specular_lut = 64u;     // NACRE_SLAB_SPECULAR_LUT
const uint slab_glints = 128u;          // NACRE_SLAB_GLINTS
const uint slab_medium = 256u;          // NACRE_SLAB_MEDIUM: mean free path, phase and thickness count
const uint slab_emission = 512u;        // NACRE_SLAB_EMISSION
const uint slab_edge_coverage = 1024u;  // NACRE_SLAB_EDGE_COVERAGE

#endif
