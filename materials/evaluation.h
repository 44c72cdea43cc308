// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "materials/closures/library.h"
#include "materials/topology.h"

/// @file
/// A tree shaded on the host, in double precision: for tools, tests and measurements. Textures count as 1.
///
///     NACRE_TRY(const FlattenedTree flat, flatten(tree));
///     const ShadedTree shaded = shade(flat, glm::normalize(glm::dvec3(1, 0, 1)));
///     glm::dvec3 radiance = reflected(shaded, light);   // cosine included

namespace nacre::materials {

/// A closure of the tree for one view.
struct ShadedClosure {
    NodeIndex node = 0;            ///< Of FlattenedTree::visible_tree.
    closures::Library::Slab slab;  ///< As it is shaded: roughness tracked, thickness as the operators say.
    closures::Library::Closure closure;
    closures::Library::Path path;
    double coverage = 0.0;  ///< The slab's own, for this view.
    double rotation = 0.0;  ///< Radians that its tangent is turned from the surface's (TangentFrame).
    std::uint32_t frame_slot = 0;  ///< Place of its frame in Topology::frames.
};

/// The tree for one view in the surface's local frame: z is the normal. Normal maps are not applied.
struct ShadedTree {
    std::vector<ShadedClosure> closures;
    closures::Library::Matter whole;
    closures::Library::Matter top;
};

/// Prepares all closures. `view`: unit, z > 0. `footprint`: meters that a pixel covers, as prepare_closure() takes it.
/// Tints by specular tables count as white, or are those of `library`.
[[nodiscard]] ShadedTree shade(const FlattenedTree& tree, const glm::dvec3& view, double footprint = 1e-3);
[[nodiscard]] ShadedTree shade(const FlattenedTree& tree, const glm::dvec3& view, double footprint,
                               closures::Library& library);

/// Radiance towards the view under light of radiance 1 per steradian from `light` (unit, z > 0), cosine included;
/// mirrors do not show.
[[nodiscard]] glm::dvec3 reflected(const ShadedTree& shaded, const glm::dvec3& light);

/// Radiance towards the view under white light of radiance 1 from everywhere above: the directional albedo, mirrors
/// included. Integrated by `strata`^2 stratified directions where layers above are tinted, without integration
/// elsewhere.
[[nodiscard]] glm::dvec3 directional_albedo(const ShadedTree& shaded, int strata = 24);

}  // namespace nacre::materials
