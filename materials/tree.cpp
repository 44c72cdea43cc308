// SPDX-License-Identifier: Apache-2.0
#include "materials/tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace nacre::materials {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

#define NACRE_NUMBER(field, feature, minimum, maximum)                                                    \
    SlabField {                                                                                           \
        #field, feature, 1, minimum, maximum, [](const Slab& slab, std::uint32_t) { return slab.field; }, \
            [](Slab& slab, std::uint32_t, float value) { slab.field = value; }                            \
    }
#define NACRE_COLOR(field, feature, minimum, maximum)                                                             \
    SlabField {                                                                                                   \
        #field, feature, 3, minimum, maximum,                                                                     \
            [](const Slab& slab, std::uint32_t channel) { return slab.field[static_cast<int>(channel)]; },        \
            [](Slab& slab, std::uint32_t channel, float value) { slab.field[static_cast<int>(channel)] = value; } \
    }

constexpr std::array fields{
    NACRE_NUMBER(coverage, 0, 0.0f, 1.0f),
    NACRE_COLOR(f0, 0, 0.0f, 1.0f),
    NACRE_NUMBER(roughness, 0, 0.0f, 1.0f),
    NACRE_COLOR(albedo, 0, 0.0f, 1.0f),
    NACRE_NUMBER(anisotropy, slab_anisotropy, -1.0f, 1.0f),
    NACRE_COLOR(f90, slab_f90, 0.0f, 1.0f),
    NACRE_NUMBER(specular_weight, slab_f90, 0.0f, 1.0f),
    NACRE_COLOR(f82, slab_f82, 0.0f, 1.0f),
    NACRE_NUMBER(second_roughness, slab_second_lobe, 0.0f, 1.0f),
    NACRE_NUMBER(second_weight, slab_second_lobe, 0.0f, 1.0f),
    NACRE_NUMBER(fuzz_amount, slab_fuzz, 0.0f, 1.0f),
    NACRE_NUMBER(fuzz_roughness, slab_fuzz, 0.0f, 1.0f),
    NACRE_COLOR(fuzz_color, slab_fuzz, 0.0f, 1.0f),
    NACRE_NUMBER(film_thickness, slab_thin_film, 0.0f, infinity),
    NACRE_NUMBER(film_ior, slab_thin_film, 1.0f, infinity),
    NACRE_NUMBER(glint_density, slab_glints, 0.0f, infinity),
    NACRE_COLOR(mean_free_path, slab_medium, 0.0f, infinity),
    NACRE_NUMBER(phase_anisotropy, slab_medium, -1.0f, 1.0f),
    NACRE_NUMBER(thickness, slab_medium, 0.0f, infinity),
    NACRE_COLOR(emission, slab_emission, 0.0f, infinity),
    NACRE_NUMBER(edge_coverage, slab_edge_coverage, 0.0f, 1.0f),
    NACRE_NUMBER(edge_exponent, slab_edge_coverage, 0.0f, infinity),
};
#undef NACRE_NUMBER
#undef NACRE_COLOR

std::unexpected<Error> refuse(const Tree& tree, std::string_view where, std::string reason, std::string remedy) {
    return fail(ErrorCode::invalid_argument, "check material", fmt::format("'{}'{}", tree.name, where),
                std::move(reason), std::move(remedy));
}

std::string place_of(const Tree& tree, NodeIndex index) {
    const Node& node = tree.nodes[index];
    return node.name.empty() ? fmt::format(": node {} ({})", index, name_of(node.kind))
                             : fmt::format(": node {} ({} '{}')", index, name_of(node.kind), node.name);
}

int child_count(const Node& node) {
    switch (node.kind) {
        case NodeKind::slab: return 0;
        case NodeKind::coverage: return 1;
        case NodeKind::mix:
        case NodeKind::layer: return 2;
    }
    return 0;
}

Expected<void> check_vertex_colors(const Tree& tree, NodeIndex index) {
    const Node& node = tree.nodes[index];
    for (const std::string& name : node.vertex_colored) {
        const SlabField* field = node.kind == NodeKind::slab ? find_slab_field(name) : nullptr;
        const bool is_color = field != nullptr && field->channels == 3 &&
                              (field->feature == 0 || (node.slab.features & field->feature) != 0);
        const bool is_amount = name == "amount" && (node.kind == NodeKind::mix || node.kind == NodeKind::coverage);
        if (!is_color && !is_amount) {
            return refuse(tree, place_of(tree, index), fmt::format("vertex colors are on '{}'", name),
                          "They multiply colors that the slab has, and amounts of mix and coverage.");
        }
    }
    return {};
}

// NaN is in no range.
bool in_range(float value, float minimum, float maximum) { return value >= minimum && value <= maximum; }

Expected<void> check_slab(const Tree& tree, NodeIndex index) {
    const Slab& slab = tree.nodes[index].slab;
    for (const SlabField& field : fields) {
        for (std::uint32_t channel = 0; channel < field.channels; ++channel) {
            const float value = field.get(slab, channel);
            if (!in_range(value, field.minimum, field.maximum)) {
                return refuse(tree, place_of(tree, index), fmt::format("{} is {}", field.name, value),
                              fmt::format("It must be in [{}, {}].", field.minimum, field.maximum));
            }
        }
    }
    if (tree.nodes[index].frame >= tree.frames.size()) {
        return refuse(
            tree, place_of(tree, index),
            fmt::format("frame is {}, but there are {} tangent frames", tree.nodes[index].frame, tree.frames.size()),
            "Add the frame with add_frame().");
    }
    std::uint32_t known = 0;
    for (const SlabFeature& feature : slab_features()) known |= feature.bit;
    if ((slab.features & ~known) != 0) {
        return refuse(tree, place_of(tree, index),
                      fmt::format("features has the unknown bits {:#x}", slab.features & ~known),
                      "Use the bits of slab_features().");
    }
    return {};
}

Expected<void> check_textures(const Tree& tree, NodeIndex index) {
    const Node& node = tree.nodes[index];
    for (std::size_t i = 0; i < node.textures.size(); ++i) {
        const TextureInput& input = node.textures[i];
        std::uint32_t channels = 1;
        if (node.kind == NodeKind::slab) {
            const SlabField* field = find_slab_field(input.field);
            if (field == nullptr) {
                return refuse(tree, place_of(tree, index),
                              fmt::format("a texture is on '{}', which no slab has", input.field),
                              "The names are those of slab_fields().");
            }
            if (field->feature != 0 && (node.slab.features & field->feature) == 0) {
                return refuse(tree, place_of(tree, index),
                              fmt::format("a texture is on '{}', whose feature the slab does not have", input.field),
                              "Set the feature's bit or remove the texture.");
            }
            channels = input.gray ? 1 : field->channels;
        } else if (input.field != "amount" || node.kind == NodeKind::layer) {
            return refuse(
                tree, place_of(tree, index),
                fmt::format("a texture is on '{}', which a {} does not have", input.field, name_of(node.kind)),
                "Mix and coverage have 'amount'; a layer has no textured input.");
        }
        if (input.channel + channels > 4) {
            return refuse(
                tree, place_of(tree, index),
                fmt::format("the texture of '{}' reads {} channels from {}", input.field, channels, input.channel),
                "A texture has the channels 0 to 3.");
        }
        if (!std::isfinite(input.scale) || !std::isfinite(input.bias)) {
            return refuse(tree, place_of(tree, index), fmt::format("scale or bias of '{}' is not finite", input.field),
                          "Use finite numbers.");
        }
        for (std::size_t other = 0; other < i; ++other) {
            if (node.textures[other].field == input.field) {
                return refuse(tree, place_of(tree, index), fmt::format("'{}' has two textures", input.field),
                              "Multiply them into one.");
            }
        }
    }
    return {};
}

// Whether nothing below the subtree can ever be seen.
bool hides_what_is_below(const Tree& tree, NodeIndex index) {
    const Node& node = tree.nodes[index];
    switch (node.kind) {
        case NodeKind::slab: {
            const bool covers = node.slab.coverage >= 1.0f && !node.varies("coverage") &&
                                (node.slab.features & slab_edge_coverage) == 0;
            return covers && (node.slab.features & slab_medium) == 0;
        }
        case NodeKind::mix: return hides_what_is_below(tree, node.first) && hides_what_is_below(tree, node.second);
        case NodeKind::layer: return hides_what_is_below(tree, node.first) || hides_what_is_below(tree, node.second);
        case NodeKind::coverage:
            return node.amount >= 1.0f && !node.varies("amount") && hides_what_is_below(tree, node.first);
    }
    return false;
}

// Which node stands for `index` once what is invisible is gone; `tree` is changed where a child moves up.
NodeIndex visible(Tree& tree, NodeIndex index) {
    Node& node = tree.nodes[index];
    const bool is_fixed = !node.varies("amount");
    switch (node.kind) {
        case NodeKind::slab: return index;
        case NodeKind::coverage:
            node.first = visible(tree, node.first);
            if (is_fixed && node.amount >= 1.0f) return node.first;
            return index;
        case NodeKind::mix:
            if (is_fixed && node.amount <= 0.0f) return visible(tree, node.first);
            if (is_fixed && node.amount >= 1.0f) return visible(tree, node.second);
            node.first = visible(tree, node.first);
            node.second = visible(tree, node.second);
            return index;
        case NodeKind::layer: {
            node.first = visible(tree, node.first);
            node.second = visible(tree, node.second);
            const auto is_absent = [&](NodeIndex child) {
                const Node& n = tree.nodes[child];
                if (n.kind == NodeKind::coverage) return n.amount <= 0.0f && !n.varies("amount");
                // The view-dependent coverage of a slab with coverage 0 may still be more at grazing angles.
                return n.kind == NodeKind::slab && n.slab.coverage <= 0.0f && !n.varies("coverage") &&
                       (n.slab.features & slab_edge_coverage) == 0;
            };
            if (is_absent(node.first)) return node.second;
            if (hides_what_is_below(tree, node.first)) return node.first;
            // A thickness of the layer's own would be lost with it.
            if (is_absent(node.second) && node.thickness < 0.0f) return node.first;
            return index;
        }
    }
    return index;
}

}  // namespace

bool Node::varies(std::string_view field) const {
    return std::ranges::find(textures, field, &TextureInput::field) != textures.end() ||
           std::ranges::find(vertex_colored, field) != vertex_colored.end();
}

std::string_view name_of(NodeKind kind) {
    switch (kind) {
        case NodeKind::slab: return "slab";
        case NodeKind::mix: return "mix";
        case NodeKind::layer: return "layer";
        case NodeKind::coverage: return "coverage";
    }
    return "unknown";
}

NodeIndex Tree::add(const Slab& slab, std::string node_name, std::uint32_t frame) {
    nodes.push_back({.kind = NodeKind::slab, .name = std::move(node_name), .slab = slab, .frame = frame});
    return root = static_cast<NodeIndex>(nodes.size() - 1);
}

NodeIndex Tree::mix(NodeIndex first, NodeIndex second, float amount) {
    nodes.push_back({.kind = NodeKind::mix, .first = first, .second = second, .amount = amount});
    return root = static_cast<NodeIndex>(nodes.size() - 1);
}

NodeIndex Tree::layer(NodeIndex top, NodeIndex base, float thickness) {
    nodes.push_back({.kind = NodeKind::layer, .first = top, .second = base, .thickness = thickness});
    return root = static_cast<NodeIndex>(nodes.size() - 1);
}

NodeIndex Tree::coverage(NodeIndex child, float amount) {
    nodes.push_back({.kind = NodeKind::coverage, .first = child, .amount = amount});
    return root = static_cast<NodeIndex>(nodes.size() - 1);
}

std::uint32_t Tree::add_frame(const TangentFrame& frame) {
    const auto found = std::ranges::find(frames, frame);
    if (found != frames.end()) return static_cast<std::uint32_t>(found - frames.begin());
    frames.push_back(frame);
    return static_cast<std::uint32_t>(frames.size() - 1);
}

std::span<const SlabField> slab_fields() { return fields; }

const SlabField* find_slab_field(std::string_view name) {
    const auto found = std::ranges::find(fields, name, &SlabField::name);
    return found == fields.end() ? nullptr : &*found;
}

Expected<void> validate(const Tree& tree) {
    if (tree.root >= tree.nodes.size()) {
        return refuse(tree, "",
                      fmt::format("the root is node {}, but there are {} nodes", tree.root, tree.nodes.size()),
                      "Add a slab; the node added last becomes the root.");
    }
    if (!in_range(tree.surface_thickness, 0.0f, infinity)) {
        return refuse(tree, "", fmt::format("surface_thickness is {}", tree.surface_thickness),
                      "It must be 0 m or more.");
    }
    struct Step {
        NodeIndex node;
        std::uint32_t depth;
    };
    std::vector<Step> open{{tree.root, 0}};
    std::vector<bool> seen(tree.nodes.size(), false);
    std::uint32_t slabs = 0;
    while (!open.empty()) {
        const Step step = open.back();
        open.pop_back();
        if (seen[step.node]) {
            return refuse(tree, place_of(tree, step.node), "the node is used twice",
                          "Add a node for each place in the tree; equal slabs cost nothing.");
        }
        seen[step.node] = true;
        const Node& node = tree.nodes[step.node];
        NACRE_CHECK(check_textures(tree, step.node));
        NACRE_CHECK(check_vertex_colors(tree, step.node));
        if (node.kind == NodeKind::slab) {
            NACRE_CHECK(check_slab(tree, step.node));
            if (++slabs > max_tree_slabs) {
                return refuse(tree, "", fmt::format("there are more than {} slabs", max_tree_slabs),
                              "Blend slabs that look alike into one.");
            }
            continue;
        }
        if (step.depth >= max_tree_depth) {
            return refuse(tree, place_of(tree, step.node),
                          fmt::format("more than {} operators lie above a slab", max_tree_depth),
                          "Arrange the operators in a flatter tree.");
        }
        if (node.kind != NodeKind::layer && !in_range(node.amount, 0.0f, 1.0f)) {
            return refuse(tree, place_of(tree, step.node), fmt::format("amount is {}", node.amount),
                          "It must be in [0, 1].");
        }
        // Negative means unset, but only the default does.
        if (node.kind == NodeKind::layer && node.thickness != -1.0f && !in_range(node.thickness, 0.0f, infinity)) {
            return refuse(tree, place_of(tree, step.node), fmt::format("thickness is {}", node.thickness),
                          "It must be 0 m or more, or -1 for that of the slabs themselves.");
        }
        const NodeIndex children[2] = {node.first, node.second};
        for (int i = 0; i < child_count(node); ++i) {
            if (children[i] >= tree.nodes.size()) {
                return refuse(
                    tree, place_of(tree, step.node),
                    fmt::format("its child is node {}, but there are {} nodes", children[i], tree.nodes.size()),
                    "Add the children before the operator.");
            }
            open.push_back({children[i], step.depth + 1});
        }
    }
    return {};
}

std::vector<NodeIndex> bottom_up(const Tree& tree) {
    // Reversed order of a walk that visits parents first.
    std::vector<NodeIndex> order, open{tree.root};
    while (!open.empty()) {
        const NodeIndex index = open.back();
        open.pop_back();
        order.push_back(index);
        const Node& node = tree.nodes[index];
        if (child_count(node) > 0) open.push_back(node.first);
        if (child_count(node) > 1) open.push_back(node.second);
    }
    std::ranges::reverse(order);
    return order;
}

Tree without_invisible_slabs(const Tree& tree) {
    Tree result = tree;
    result.root = visible(result, result.root);
    // Keeps the order of the nodes, so that names like "slab 3" change as little as they can.
    std::vector<NodeIndex> used = bottom_up(result);
    std::ranges::sort(used);
    std::vector<NodeIndex> moved(result.nodes.size(), 0);
    std::vector<Node> kept;
    for (const NodeIndex index : used) {
        moved[index] = static_cast<NodeIndex>(kept.size());
        kept.push_back(std::move(result.nodes[index]));
    }
    for (Node& node : kept) {
        if (child_count(node) > 0) node.first = moved[node.first];
        if (child_count(node) > 1) node.second = moved[node.second];
    }
    result.root = moved[result.root];
    result.nodes = std::move(kept);
    std::vector<TangentFrame> frames;
    for (Node& node : result.nodes) {
        if (node.kind != NodeKind::slab) continue;
        const auto found = std::ranges::find(frames, result.frames[node.frame]);
        const auto at = static_cast<std::uint32_t>(found - frames.begin());
        if (found == frames.end()) frames.push_back(result.frames[node.frame]);
        node.frame = at;
    }
    result.frames = std::move(frames);
    return result;
}

std::string topology_text(const Tree& tree) {
    std::vector<std::string> texts(tree.nodes.size());
    for (const NodeIndex index : bottom_up(tree)) {
        const Node& node = tree.nodes[index];
        switch (node.kind) {
            case NodeKind::slab: texts[index] = node.name.empty() ? fmt::format("slab {}", index) : node.name; break;
            case NodeKind::coverage: texts[index] = fmt::format("coverage({})", texts[node.first]); break;
            case NodeKind::mix: texts[index] = fmt::format("mix({}, {})", texts[node.first], texts[node.second]); break;
            case NodeKind::layer:
                texts[index] = fmt::format("layer({}, {})", texts[node.first], texts[node.second]);
                break;
        }
    }
    return texts[tree.root];
}

}  // namespace nacre::materials
