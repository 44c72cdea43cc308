// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "materials/tree.h"

/// @file
/// Stacks of slabs that layering is measured on (docs/materials.md): those that authors use most, and random ones.
///
///     for (const Tree& stack : reference_stacks()) measure(stack);

namespace nacre::materials {

/// "coat over metal", "coat over diffuse", "dust over coat over metal", "tinted coat", "two-slab mix".
[[nodiscard]] std::vector<Tree> reference_stacks();

/// Number `index` of an endless series: one to three layers (clear or tinted coats, milky films, dust without an
/// interface, now and then covering a part) over a metal, a matte ground, a plastic, or a mix of two of them. Named
/// after what is in it; the same on every machine.
[[nodiscard]] Tree random_stack(std::uint32_t index);

}  // namespace nacre::materials
