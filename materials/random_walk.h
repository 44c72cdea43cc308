// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <random>

#include "materials/topology.h"

/// @file
/// What a stack of slabs does with light, by brute force: random paths through the very interfaces and media that a
/// tree describes, in double precision. The reference that closures (materials/evaluation.h) are measured against; it
/// shares their lowest slab and the meaning of their parameters, and nothing of their operators and tables.
///
///     NACRE_TRY(const FlattenedTree flat, flatten(tree));
///     const RandomWalk walk(flat);
///     const WalkAlbedo seen = walk.albedo({0.6, 0.0, 0.8}, 65536);     // seen.reflected +- seen.uncertainty
///
/// Only depth and direction of a path are followed, as the layers are much wider than they are thick (Guo, Hasan and
/// Zhao 2018, "Position-free Monte Carlo simulation for arbitrary layered BSDFs"). What stands for what:
///
/// - A slab with a medium that lets light through is a rough dielectric interface on a medium, without one at its far
///   side. Its `f0` is that against the matter above it, so that indices of refraction multiply downwards.
/// - Light walks over the microfacets of an interface until it leaves them (Heitz, Hanika, d'Eon and Dachsbacher 2016,
///   "Multiple-scattering microfacet BSDFs with the Smith model", heights evenly distributed): no light is lost to
///   single scattering and no compensation is needed.
/// - The medium's albedo of a single scattering is the one with which an infinitely thick medium under this very
///   interface reflects the authored albedo; directions follow Henyey and Greenstein.
/// - Every other slab, one without a medium or with one that lets nothing through, is the opaque ground: it scatters as
///   its own closure does. Nothing lies below it.
/// - Fuzz on a slab that lets light through is a sheet above its interface which does on both its sides what the fuzz
///   lobe says.
/// - Coverage and mixes choose one stack for each path; see RandomWalkDesc::narrow_patches.
///
/// Left out on slabs that let light through: glints (their mean, the lobe, stays), thin films, tints by view and light.
/// Textures count as 1.

namespace nacre::materials {

/// How a stack is meant where its slabs do not say it.
struct RandomWalkDesc {
    /// Whether patches of a mix or a coverage are as narrow as layers are thick, so that light that is thrown back hits
    /// any part of what lies below (as the operators of trees have it), or so wide that it hits the same part again.
    bool narrow_patches = true;
    /// Fresnel's equations for interfaces of a gray `f0` from 0.02 to 0.2 without F90 and F82; the others, and without
    /// this all of them, follow the slab's own curve.
    bool exact_fresnel = true;
    double footprint = 1e-3;  ///< Meters, as of shade().
    /// After so many events a path is given up and counts as absorbed.
    std::uint32_t longest_path = 100'000;
};

/// Where a path left.
struct WalkExit {
    glm::dvec3 direction{0.0};  ///< Unit, away from the surface: z > 0 reflected, z < 0 through all of the stack.
    /// Of radiance from there; 0 where the path was absorbed. The mean over paths is what the stack sends to the view.
    glm::dvec3 weight{0.0};
    /// How often the opaque ground sent the path on: 0 is light that the layers above it reflect, 1 what passed them
    /// twice, more what they threw back to it in between.
    std::uint32_t ground_reflections = 0;
    bool is_unfinished = false;  ///< RandomWalkDesc::longest_path was reached.
};

/// A mean over paths.
struct WalkAlbedo {
    glm::dvec3 reflected{0.0};
    glm::dvec3 transmitted{0.0};
    glm::dvec3 uncertainty{0.0};  ///< Of `reflected`: half the interval of 95 % confidence.
    double unfinished = 0.0;      ///< Share of paths that were given up.
};

/// See the top of this file. Immutable; any number of threads may walk at the same time, each with its own generator.
class RandomWalk {
  public:
    using Generator = std::mt19937_64;

    explicit RandomWalk(const FlattenedTree& tree, const RandomWalkDesc& desc = {});

    /// One path from a view (unit, z > 0).
    [[nodiscard]] WalkExit walk(const glm::dvec3& view, Generator& random) const;

    /// The directional albedo towards `view`; the same for the same `seed` on every machine with the same standard
    /// library of mathematics.
    [[nodiscard]] WalkAlbedo albedo(const glm::dvec3& view, std::uint32_t paths, std::uint64_t seed = 1) const;

    /// Value times the cosine of light, as by reflected() in materials/evaluation.h, in `reflected`: averaged over the
    /// directions at most `cone` radians off `light` (unit; all of the cone lies above the surface). What mirrors send
    /// into the cone is in it, over its solid angle.
    [[nodiscard]] WalkAlbedo value(const glm::dvec3& view, const glm::dvec3& light, double cone, std::uint32_t paths,
                                   std::uint64_t seed = 1) const;

    /// Whether the stack looks the same from every azimuth.
    [[nodiscard]] bool is_isotropic() const;

  private:
    struct Model;
    std::shared_ptr<const Model> model_;
};

}  // namespace nacre::materials
