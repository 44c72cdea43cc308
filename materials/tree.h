// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "materials/description.h"
#include "materials/slab.h"

/// @file
/// A material as a tree: slabs of matter as leaves, operators that arrange them as inner nodes. The way it is written
/// by authors, importers and files (materials/tree_json.h); materials/topology.h flattens it to closures.
///
///     Tree tree{.name = "lacquered gold"};
///     const NodeIndex gold = tree.add(Slab{.f0 = {1.00f, 0.77f, 0.34f}, .roughness = 0.3f, .albedo =
///     glm::vec3(0.0f)}); const NodeIndex lacquer = tree.add(Slab{.roughness = 0.05f, .albedo = glm::vec3(0.0f)});
///     tree.root = tree.layer(lacquer, gold, 1e-4f);
///     NACRE_CHECK(validate(tree));

namespace nacre::materials {

/// Which node of a tree: its place in `Tree::nodes`.
using NodeIndex = std::uint32_t;

/// A texture that multiplies an input, one channel for a number and three for a color:
/// input * (bias + scale * texel). With `scale` 1 and `bias` 0 the texel itself multiplies.
struct TextureInput {
    std::string field;  ///< Name of the input as in slab_fields(), or "amount" for the factor of an operator.
    TextureReference texture;
    std::uint32_t channel = 0;  ///< First channel that is read, 0 (r) to 3 (a); colors read three from 0.
    float scale = 1.0f;
    float bias = 0.0f;
    bool gray = false;  ///< Colors: `channel` alone counts, for all three.

    bool operator==(const TextureInput&) const = default;
};

/// A tangent frame for slabs that need one of their own; slabs with equal frames share one.
struct TangentFrame {
    TextureReference normal_texture;    ///< Tangent space normals; `scale` of the reference is that of x and y.
    float rotation = 0.0f;              ///< Of the tangent around the normal, radians, counter-clockwise.
    TextureReference rotation_texture;  ///< rg: direction in [-1, 1] mapped to [0, 1], turned by `rotation` as well.

    bool operator==(const TangentFrame&) const = default;
};

enum class NodeKind : std::uint8_t {
    slab,      ///< A leaf.
    mix,       ///< Both children side by side: the first on 1 - amount of the surface, the second on `amount`.
    layer,     ///< The first child on top of the second.
    coverage,  ///< The first child on `amount` of the surface and nothing on the rest.
};

/// Stable lower-case name: "slab", "mix", "layer", "coverage".
[[nodiscard]] std::string_view name_of(NodeKind kind);

/// One node. Operators do not touch fields that do not belong to their kind.
struct Node {
    NodeKind kind = NodeKind::slab;
    std::string name;  ///< For reports; may be empty.

    Slab slab;                ///< Leaves.
    std::uint32_t frame = 0;  ///< Leaves: index into Tree::frames.
    NodeIndex first = 0;      ///< Operators.
    NodeIndex second = 0;     ///< Mix and layer.
    float amount = 0.0f;      ///< Mix and coverage, [0, 1].
    /// Layer: meters of the top child; every slab in it counts as that thick. Negative: slabs keep their own thickness.
    float thickness = -1.0f;
    bool parameter_blend = false;  ///< Mix and layer: always simplified to one slab, whatever the budget.

    std::vector<TextureInput> textures;  ///< At most one for each input.
    /// Inputs that the color of the vertex multiplies: colors of a slab by its rgb, "amount" by its alpha. White where
    /// a mesh has none.
    std::vector<std::string> vertex_colored;

    /// Whether an input is more than its number: a texture or the vertex's color multiplies it.
    [[nodiscard]] bool varies(std::string_view field) const;
};

/// See the top of this file. Plain data; distinct trees may be used by distinct threads.
struct Tree {
    std::string name;
    std::vector<Node> nodes;
    NodeIndex root = 0;
    std::vector<TangentFrame> frames{TangentFrame{}};
    /// A thin surface (leaf, paper, cloth): there is no inside, and the bottom slab is `surface_thickness` thick.
    bool thin = false;
    float surface_thickness = 1e-3f;  ///< Meters, of the bottom slabs of a thin surface.

    /// Adds a leaf.
    NodeIndex add(const Slab& slab, std::string node_name = {}, std::uint32_t frame = 0);
    /// Adds an operator over nodes that were added before.
    NodeIndex mix(NodeIndex first, NodeIndex second, float amount);
    NodeIndex layer(NodeIndex top, NodeIndex base, float thickness = -1.0f);
    NodeIndex coverage(NodeIndex child, float amount);
    /// Index of `frame` in `frames`, added where no equal one is there.
    std::uint32_t add_frame(const TangentFrame& frame);
};

/// Limits of a tree that is compiled. Shaders are flattened: beyond these they would not compile in useful time.
inline constexpr std::uint32_t max_tree_depth = 16;  ///< Operators between the root and a slab.
inline constexpr std::uint32_t max_tree_slabs = 32;

/// Checks that `tree` is one: it has a root, every node is used once (no cycles, no sharing), indices exist, depth and
/// number of slabs are within the limits, every number is finite and in the range that materials/slab.h states,
/// textures name inputs that exist. Error: invalid_argument, naming tree and node.
[[nodiscard]] Expected<void> validate(const Tree& tree);

/// One input of a slab, as files, textures and reports name it.
struct SlabField {
    const char* name;        ///< "mean_free_path"
    std::uint32_t feature;   ///< The bit it belongs to; 0: always there.
    std::uint32_t channels;  ///< 1 or 3.
    float minimum, maximum;  ///< Of each channel; infinities where there is no bound.
    float (*get)(const Slab&, std::uint32_t channel);
    void (*set)(Slab&, std::uint32_t channel, float value);
};

/// All inputs, in the order of the struct. `glint_position` and its derivatives come from texture coordinates and are
/// not inputs; `specular_lut` is an index and not one either.
[[nodiscard]] std::span<const SlabField> slab_fields();

/// By name; null where there is none.
[[nodiscard]] const SlabField* find_slab_field(std::string_view name);

/// Removes what can never be seen, without changing what is: children of a mix with amount 0 or 1 and no texture, of a
/// coverage of 0 (replaced by a slab of coverage 0 where it is the root) or 1, everything below a layer that is opaque
/// and covers all. Nodes that are not used any more go. The result is valid where `tree` is.
[[nodiscard]] Tree without_invisible_slabs(const Tree& tree);

/// Nodes from the leaves up (each after its children), only those below the root.
[[nodiscard]] std::vector<NodeIndex> bottom_up(const Tree& tree);

/// "layer(lacquer, gold)": the topology as text, slabs by name or as "slab 3".
[[nodiscard]] std::string topology_text(const Tree& tree);

}  // namespace nacre::materials
