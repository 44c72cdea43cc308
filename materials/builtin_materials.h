// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

#include "materials/tree.h"

/// @file
/// Materials that are always there: those that show what a row of storage holds, and motives of layered materials.
///
///     NACRE_TRY(const Tree opal, make_builtin_material("complex-opal"));

namespace nacre::materials {

/// A built-in material: its name and what it is, in one line.
struct BuiltinMaterial {
    std::string_view name;
    std::string_view meaning;
};

/// All of them; first the rows of storage from the smallest to the largest, each holding what those before it hold.
[[nodiscard]] std::span<const BuiltinMaterial> builtin_materials();

/// By name. Error: not_found, listing the names there are.
[[nodiscard]] Expected<Tree> make_builtin_material(std::string_view name);

}  // namespace nacre::materials
