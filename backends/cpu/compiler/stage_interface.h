// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>

#include "backends/cpu/compiler/module.h"

/// @file
/// Where the scalars of inputs and outputs lie: locations and components, by the rules of the Vulkan specification
/// ("Location Assignment", "Component Assignment").

namespace nacre::cpu {

/// Behind all locations of shaders: the distances that the vertex stage hands on under a name.
inline constexpr std::uint32_t clip_distance_location = 1u << 20, cull_distance_location = clip_distance_location + 1;

/// Behind those: beside the output at a location whether it is undefined, a number other than zero where it is. Of
/// vertex and fragment shaders that are checked; linked and interpolated like any other.
inline constexpr std::uint32_t undefined_location = 1u << 24;

struct InterfaceScalar {
    std::uint32_t location = 0, component = 0;
    bool is_wide = false;                                   ///< 64 bits: two words,
    std::uint32_t upper_location = 0, upper_component = 0;  ///< the upper one here.
    bool flat = false, no_perspective = false, centroid = false, sample = false;
    Id type = 0;  ///< Scalar type.
};

/// One entry for each scalar of the variable, in order. Nothing where it has no locations.
std::optional<std::vector<InterfaceScalar>> interface_scalars(const Module& module, const Variable& variable);

/// Whether code names member `member` of a block of built-in variables; blocks that are used as a whole use every
/// member.
bool uses_member(const Module& module, Id variable, std::uint32_t member);

}  // namespace nacre::cpu
