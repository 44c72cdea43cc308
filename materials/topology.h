// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "materials/tree.h"

/// @file
/// A tree flattened to straight code: which slabs are read, what is gathered from the leaves up and handed from the
/// root down, and which closures come out. The same steps are run on the host (materials/evaluation.h) and printed as
/// GLSL (materials/tree_shader.h), so that neither can drift from the other.
///
///     NACRE_TRY(const Topology topology, flatten(tree));
///     topology.closures.size();  // what a pixel of this material costs at most

namespace nacre::materials {

/// What a step does; results and operands are registers, counted from 0 for each kind of value. The functions are those
/// of materials/closures/operators.glsl and blending.glsl.
enum class StepKind : std::uint8_t {
    read_slab,           ///< slab: the inputs of leaf number `a`
    cover_slab,          ///< slab: slab a with its coverage times the amount
    mix_slabs,           ///< slab: a and b blended by the amount
    layer_slabs,         ///< slab: a over b blended to one; matters c (of a) and d (of b) say what is seen
    slab_spread,         ///< spread: of slab a
    cover_spread,        ///< spread: a with less coverage
    mix_spread,          ///< spread: a and b side by side
    layer_spread,        ///< spread: a over b
    widening_below,      ///< widening: below spread b, where a is that above it
    track_slab,          ///< slab: a, as rough as it is seen through widening b
    slab_matter,         ///< matter: of slab a below widening b, everything
    base_matter,         ///< matter: of slab a below widening b, only what a layer above needs: coverage and albedo
    cover_matter,        ///< matter: a with less coverage
    mix_matter,          ///< matter: a and b side by side
    layer_matter,        ///< matter: a over b
    path_through_mix,    ///< path: a, of which the amount (or the rest, where `complement`) is left
    path_through_layer,  ///< path: a under matter b, in a base whose matter is c, as it is seen through widening d
};

/// One step; see StepKind for which of the operands it has.
struct Step {
    static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

    StepKind kind;
    std::uint32_t result;  ///< Register of the kind that the step makes.
    std::uint32_t a = none, b = none, c = none, d = none;
    std::uint32_t amount = none;  ///< Index into Topology::amounts.
    bool complement = false;      ///< 1 - amount counts.
};

/// One closure: a slab, the path that light and view take to it (path 0 is the open one), and its tangent frame.
struct TopologyClosure {
    NodeIndex node;          ///< The leaf, or the operator whose subtree was blended to one slab.
    std::uint32_t slab;      ///< Register.
    std::uint32_t path;      ///< Register.
    std::uint32_t frame;     ///< Index into Tree::frames.
    std::uint32_t features;  ///< Those that it may have.
    bool is_top;             ///< Nothing lies above it.
    bool is_bottom;          ///< Nothing lies below it.
};

/// See the top of this file.
struct Topology {
    std::vector<Step> steps;
    std::vector<TopologyClosure> closures;
    std::vector<NodeIndex> slabs;    ///< Leaves, in the order in which they are read.
    std::vector<NodeIndex> amounts;  ///< Operators that have an amount.
    std::vector<float>
        thickness;  ///< For each of `slabs`: meters that an operator or the surface gives it, or negative.
    std::vector<std::uint32_t> frames;  ///< Tangent frames that the closures use, each once: indices into Tree::frames.
    std::uint32_t slab_registers = 0, matter_registers = 0;
    std::uint32_t path_registers = 1;      ///< Register 0 is the open path.
    std::uint32_t widening_registers = 1;  ///< Register 0 is none.
    std::uint32_t spread_registers = 0;
    std::uint32_t whole = 0;     ///< Matter of the whole tree: its coverage and transmittance decide how it is blended.
    std::uint32_t top = 0;       ///< Matter of the topmost layer alone.
    std::uint32_t features = 0;  ///< Of all slabs that are read: those that the shader's text must know.
};

/// What is left out when a tree is flattened.
struct FlattenDesc {
    std::uint32_t dropped_features = 0;  ///< Features that no closure may have.
};

/// Flattens `tree` after removing what cannot be seen (without_invisible_slabs); node indices are those of
/// `visible_tree`. Operators with `parameter_blend` become one slab with all below them. Error: as validate().
struct FlattenedTree {
    Tree visible_tree;
    Topology topology;
};
[[nodiscard]] Expected<FlattenedTree> flatten(const Tree& tree, const FlattenDesc& desc = {});

}  // namespace nacre::materials
