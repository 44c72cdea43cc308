// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "materials/closures/lobes.h"
#include "materials/slab.h"  // has the features that the text below asks for

/// @file
/// The closures of materials/closures/closure.glsl as C++ in double precision, from the same text and with the same
/// tables: the reference for what devices compute, and what tools shade with.
///
///     closures::Library library;
///     auto closure = library.prepare_closure(closures::Library::slab_of(gold), view, 1e-3);
///     glm::dvec3 value = library.evaluate_closure(closure, light).specular;
///
/// An object has no state but its tints; different threads may use it at the same time.

namespace nacre::materials::closures {

struct Library : Lobes {
    /// What slab_specular_lut looks up: index of the tint, cosines of view and light. Unset: white.
    std::function<vec3(uint, vec2)> tints;
    [[nodiscard]] vec3 specular_lut(uint index, vec2 at) const { return tints ? tints(index, at) : vec3(1.0); }

    /// materials/tables/interface_table.h between its entries.
    [[nodiscard]] static vec4 interface_table(vec2 at);
    /// materials/tables/anisotropy_table.h between its entries.
    [[nodiscard]] static vec2 anisotropy_table(vec4 at);
    /// materials/tables/medium_table.h between its entries.
    [[nodiscard]] static vec2 medium_table(vec3 at);

#define NACRE_SLAB_ANISOTROPY 1
#define NACRE_SLAB_F90 1
#define NACRE_SLAB_F82 1
#define NACRE_SLAB_SECOND_LOBE 1
#define NACRE_SLAB_FUZZ 1
#define NACRE_SLAB_THIN_FILM 1
#define NACRE_SLAB_SPECULAR_LUT 1
#define NACRE_SLAB_GLINTS 1
#define NACRE_SLAB_MEDIUM 1
#define NACRE_SLAB_EMISSION 1
#define NACRE_SLAB_EDGE_COVERAGE 1
#define float double
#define const static constexpr
#include "materials/closures/operators.glsl"
#include "materials/closures/blending.glsl"
#include "materials/closures/stored_frame.glsl"
#undef const
#undef float
#undef NACRE_SLAB_ANISOTROPY
#undef NACRE_SLAB_F90
#undef NACRE_SLAB_F82
#undef NACRE_SLAB_SECOND_LOBE
#undef NACRE_SLAB_FUZZ
#undef NACRE_SLAB_THIN_FILM
#undef NACRE_SLAB_SPECULAR_LUT
#undef NACRE_SLAB_GLINTS
#undef NACRE_SLAB_MEDIUM
#undef NACRE_SLAB_EMISSION
#undef NACRE_SLAB_EDGE_COVERAGE
#undef NACRE_CLOSURE_COVERED
#undef NACRE_CLOSURE_CURVES

    /// The slab as the closures take it.
    [[nodiscard]] static Slab slab_of(const materials::Slab& slab);
};

}  // namespace nacre::materials::closures
