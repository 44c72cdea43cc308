// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "materials/slab.h"  // first: its features.glsl is the one that counts

/// @file
/// The lobes of materials/closures/*.glsl as C++ in double precision, from the same text: the reference for what
/// devices compute. The functions are members so that the text needs no storage classes; an object has no state.
///
///     closures::Lobes lobes;
///     double peak = lobes.ggx_distribution({0.0, 0.0, 1.0}, {0.1, 0.1});

namespace nacre::materials::closures {

using glm::abs, glm::atan, glm::clamp, glm::cos, glm::cross, glm::dot, glm::exp, glm::exp2, glm::floor, glm::fract;
using glm::inversesqrt, glm::length, glm::log, glm::log2, glm::max, glm::min, glm::mix, glm::normalize, glm::pow;
using glm::sin, glm::smoothstep, glm::sqrt;

struct Lobes {
    using uint = std::uint32_t;
    using uvec2 = glm::uvec2;
    using vec2 = glm::dvec2;
    using vec3 = glm::dvec3;
    using vec4 = glm::dvec4;

// In these files every `const` is a constant outside of functions.
#define float double
#define const static constexpr
#include "materials/closures/classic.glsl"
#include "materials/closures/conversions.glsl"
#include "materials/closures/diffuse.glsl"
#include "materials/closures/fresnel.glsl"
#include "materials/closures/fuzz.glsl"
#include "materials/closures/ggx.glsl"
#include "materials/closures/glints.glsl"
#include "materials/closures/haze.glsl"
#include "materials/closures/math.glsl"
#include "materials/closures/medium_inputs.glsl"
#include "materials/closures/octahedral.glsl"
#include "materials/closures/stored_fields.glsl"
#include "materials/closures/thin_film.glsl"
#undef const
#undef float
};

}  // namespace nacre::materials::closures
