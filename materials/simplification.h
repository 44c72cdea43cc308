// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "materials/topology.h"

/// @file
/// Makes a material cheaper until it fits a budget: first operators become one slab by blending parameters, the deepest
/// first and of equally deep ones mixes before layers; then features are switched off in the order of
/// simplification_rules().
///
///     NACRE_TRY(const Simplification simple, simplify(tree, {.closures = 1, .bytes = 12}));
///     for (const SimplificationStep& step : simple.steps) ...   // the first is the material as it was

namespace nacre::materials {

/// What a pixel of a material may take.
struct MaterialBudget {
    std::uint32_t closures = ~0u;
    std::uint32_t bytes = ~0u;  ///< StorageLayout::total_bytes().
};

/// One of the things that simplification can do, as data. Rules are tried from the first; one that applies is used as
/// often as it does before the next is tried.
struct SimplificationRule {
    enum class Kind : std::uint8_t {
        blend,         ///< Before: an operator over two slabs. After: one slab with both's features.
        drop_feature,  ///< Before: a closure has the feature. After: none has.
    };
    Kind kind;
    std::uint32_t feature;  ///< For drop_feature.
    const char* name;       ///< "drop glints"
    const char* what_is_lost;
};

/// All rules, in the order in which they are tried.
[[nodiscard]] std::span<const SimplificationRule> simplification_rules();

/// A stage of the material on its way into the budget.
struct SimplificationStep {
    std::string what;  ///< "as authored", "blend mix(fiber, metal)", "drop glints"
    Tree tree;
    FlattenDesc flatten;
    std::uint32_t closures = 0;
    std::uint32_t bytes = 0;
    /// Mean absolute difference from the material as it was in directional albedo, over views from 0 to 87 degrees and
    /// channels.
    double albedo_error = 0.0;
    /// Distance of the lobes: integral of the absolute difference over light directions relative to the integral of the
    /// material as it was, 0 to 2, mean over the same views.
    double lobe_error = 0.0;
};

/// The steps; the last is the simplest that was needed.
struct Simplification {
    std::vector<SimplificationStep> steps;
    bool fits = false;  ///< False where even one slab without features is over the budget.
};

/// Simplifies `tree` until `budget` holds. Errors: as validate(); invalid_argument for a budget of no closure.
[[nodiscard]] Expected<Simplification> simplify(const Tree& tree, const MaterialBudget& budget);

/// Down to one closure, as rays carry it; features stay.
[[nodiscard]] Expected<Simplification> simplify_fully(const Tree& tree);

}  // namespace nacre::materials
