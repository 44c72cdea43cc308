// SPDX-License-Identifier: Apache-2.0
#include "materials/topology.h"

#include <algorithm>
#include <utility>

namespace nacre::materials {
namespace {

class Flattener {
  public:
    Flattener(const Tree& tree, const FlattenDesc& desc) : tree_(tree), desc_(desc), nodes_(tree.nodes.size()) {}

    Topology run() {
        place(tree_.root, false, -1.0f, true);
        gather(tree_.root);
        track(tree_.root, 0, true);
        topology_.whole = matter(tree_.root, Need::all);
        topology_.top = top_matter(tree_.root);
        hand_down(tree_.root, 0, Step::none, true, true);
        for (const TopologyClosure& closure : topology_.closures) {
            if (std::ranges::find(topology_.frames, closure.frame) == topology_.frames.end())
                topology_.frames.push_back(closure.frame);
        }
        return std::move(topology_);
    }

  private:
    enum class Need { base, all };

    struct NodeState {
        bool is_one_slab = false;         // a leaf, or blended to one
        std::uint32_t slab = Step::none;  // register, where it is one
        std::uint32_t base_matter = Step::none, matter = Step::none, spread = Step::none;
        std::uint32_t widening = 0;         // of what lies above; the first is none
        std::uint32_t amount = Step::none;  // index into Topology::amounts
        std::uint32_t features = 0;
        std::uint32_t frame = 0;
        float thickness = -1.0f;
    };

    // From the root: which slabs are blended with others, and how thick each is.
    void place(NodeIndex index, bool blended, float thickness, bool at_bottom) {
        const Node& node = tree_.nodes[index];
        NodeState& state = nodes_[index];
        blended = blended || node.parameter_blend;
        state.is_one_slab = blended || node.kind == NodeKind::slab;
        state.thickness = thickness >= 0.0f ? thickness : tree_.thin && at_bottom ? tree_.surface_thickness : -1.0f;
        switch (node.kind) {
            case NodeKind::slab: break;
            case NodeKind::coverage: place(node.first, blended, thickness, at_bottom); break;
            case NodeKind::mix:
                place(node.first, blended, thickness, at_bottom);
                place(node.second, blended, thickness, at_bottom);
                break;
            case NodeKind::layer:
                place(node.first, blended, node.thickness >= 0.0f ? node.thickness : thickness, false);
                place(node.second, blended, thickness, at_bottom);
                break;
        }
    }

    // From the leaves: slabs, blended ones included.
    void gather(NodeIndex index) {
        const Node& node = tree_.nodes[index];
        NodeState& state = nodes_[index];
        if (node.kind == NodeKind::slab) {
            topology_.slabs.push_back(index);
            topology_.thickness.push_back(state.thickness);
            // What lies below a medium is seen through it even where the closure that stands for both has none.
            state.features = node.slab.features & ~(desc_.dropped_features & ~slab_medium);
            topology_.features |= state.features;
            state.frame = node.frame;
            state.slab =
                step({.kind = StepKind::read_slab, .a = static_cast<std::uint32_t>(topology_.slabs.size() - 1)},
                     topology_.slab_registers);
            return;
        }
        gather(node.first);
        if (node.kind != NodeKind::coverage) gather(node.second);
        if (node.kind != NodeKind::layer) {
            state.amount = static_cast<std::uint32_t>(topology_.amounts.size());
            topology_.amounts.push_back(index);
        }
        if (!state.is_one_slab) return;
        const NodeState& first = nodes_[node.first];
        state.features = first.features;
        state.frame = first.frame;
        switch (node.kind) {
            case NodeKind::coverage:
                state.slab = step({.kind = StepKind::cover_slab, .a = first.slab, .amount = state.amount},
                                  topology_.slab_registers);
                break;
            case NodeKind::mix:
                state.features |= nodes_[node.second].features;
                state.slab = step({.kind = StepKind::mix_slabs,
                                   .a = first.slab,
                                   .b = nodes_[node.second].slab,
                                   .amount = state.amount},
                                  topology_.slab_registers);
                break;
            case NodeKind::layer: {
                state.features |= nodes_[node.second].features;
                const std::uint32_t top = matter(node.first, Need::all), base = matter(node.second, Need::base);
                state.slab = step({.kind = StepKind::layer_slabs,
                                   .a = first.slab,
                                   .b = nodes_[node.second].slab,
                                   .c = top,
                                   .d = base},
                                  topology_.slab_registers);
                break;
            }
            case NodeKind::slab: break;
        }
    }

    std::uint32_t spread(NodeIndex index) {
        const Node& node = tree_.nodes[index];
        NodeState& state = nodes_[index];
        if (state.spread != Step::none) return state.spread;
        Step made{};
        if (state.is_one_slab)
            made = {.kind = StepKind::slab_spread, .a = state.slab};
        else if (node.kind == NodeKind::coverage)
            made = {.kind = StepKind::cover_spread, .a = spread(node.first), .amount = state.amount};
        else if (node.kind == NodeKind::mix)
            made = {.kind = StepKind::mix_spread,
                    .a = spread(node.first),
                    .b = spread(node.second),
                    .amount = state.amount};
        else
            made = {.kind = StepKind::layer_spread, .a = spread(node.first), .b = spread(node.second)};
        return state.spread = step(made, topology_.spread_registers);
    }

    // From the root: slabs below a layer are rougher. Closures are made of what this leaves, so that what they reflect
    // and what they let through are of one kind.
    void track(NodeIndex index, std::uint32_t widening, bool is_bottom) {
        const Node& node = tree_.nodes[index];
        NodeState& state = nodes_[index];
        state.widening = widening;
        if (state.is_one_slab) {
            if (widening == 0) return;
            // Its own spread is that of its interface as it is.
            if (!is_bottom) spread(index);
            state.slab = step({.kind = StepKind::track_slab, .a = state.slab, .b = widening}, topology_.slab_registers);
            return;
        }
        track(node.first, widening, is_bottom && node.kind != NodeKind::layer);
        if (node.kind == NodeKind::coverage) return;
        if (node.kind == NodeKind::layer)
            widening = step({.kind = StepKind::widening_below, .a = widening, .b = spread(node.first)},
                            topology_.widening_registers);
        track(node.second, widening, is_bottom);
    }

    // The matter of a subtree, made when it is first asked for.
    std::uint32_t matter(NodeIndex index, Need need) {
        const Node& node = tree_.nodes[index];
        NodeState& state = nodes_[index];
        if (state.matter != Step::none) return state.matter;
        if (need == Need::base && state.base_matter != Step::none) return state.base_matter;
        Step made{};
        if (state.is_one_slab) {
            made = {.kind = need == Need::all ? StepKind::slab_matter : StepKind::base_matter,
                    .a = state.slab,
                    .b = state.widening};
        } else if (node.kind == NodeKind::coverage) {
            made = {.kind = StepKind::cover_matter, .a = matter(node.first, need), .amount = state.amount};
        } else if (node.kind == NodeKind::mix) {
            made = {.kind = StepKind::mix_matter,
                    .a = matter(node.first, need),
                    .b = matter(node.second, need),
                    .amount = state.amount};
        } else {
            made = {.kind = StepKind::layer_matter, .a = matter(node.first, Need::all), .b = matter(node.second, need)};
        }
        return (need == Need::all ? state.matter : state.base_matter) = step(made, topology_.matter_registers);
    }

    // Of what is seen first: layers without what lies below them.
    std::uint32_t top_matter(NodeIndex index) {
        const Node& node = tree_.nodes[index];
        const NodeState& state = nodes_[index];
        if (state.is_one_slab) return matter(index, Need::all);
        switch (node.kind) {
            case NodeKind::layer: return top_matter(node.first);
            case NodeKind::coverage:
                return step({.kind = StepKind::cover_matter, .a = top_matter(node.first), .amount = state.amount},
                            topology_.matter_registers);
            case NodeKind::mix:
                return step({.kind = StepKind::mix_matter,
                             .a = top_matter(node.first),
                             .b = top_matter(node.second),
                             .amount = state.amount},
                            topology_.matter_registers);
            case NodeKind::slab: break;
        }
        return matter(index, Need::all);
    }

    // `below`: matter of all that lies below the subtree.
    void hand_down(NodeIndex index, std::uint32_t path, std::uint32_t below, bool is_top, bool is_bottom) {
        const Node& node = tree_.nodes[index];
        const NodeState& state = nodes_[index];
        if (state.is_one_slab) {
            topology_.closures.push_back({.node = index,
                                          .slab = state.slab,
                                          .path = path,
                                          .frame = state.frame,
                                          .features = state.features & ~desc_.dropped_features,
                                          .is_top = is_top,
                                          .is_bottom = is_bottom});
            return;
        }
        switch (node.kind) {
            case NodeKind::slab: break;
            case NodeKind::coverage:
                hand_down(node.first,
                          step({.kind = StepKind::path_through_mix, .a = path, .amount = state.amount},
                               topology_.path_registers),
                          below, is_top, is_bottom);
                break;
            case NodeKind::mix: {
                const std::uint32_t first =
                    step({.kind = StepKind::path_through_mix, .a = path, .amount = state.amount, .complement = true},
                         topology_.path_registers);
                hand_down(node.first, first, below, is_top, is_bottom);
                const std::uint32_t second = step(
                    {.kind = StepKind::path_through_mix, .a = path, .amount = state.amount}, topology_.path_registers);
                hand_down(node.second, second, below, is_top, is_bottom);
                break;
            }
            case NodeKind::layer: {
                std::uint32_t ground = matter(node.second, below == Step::none ? Need::base : Need::all);
                if (below != Step::none)
                    ground =
                        step({.kind = StepKind::layer_matter, .a = ground, .b = below}, topology_.matter_registers);
                hand_down(node.first, path, ground, is_top, false);
                const std::uint32_t under = step({.kind = StepKind::path_through_layer,
                                                  .a = path,
                                                  .b = matter(node.first, Need::all),
                                                  .c = ground,
                                                  .d = nodes_[node.second].widening},
                                                 topology_.path_registers);
                hand_down(node.second, under, below, false, is_bottom);
                break;
            }
        }
    }

    std::uint32_t step(Step made, std::uint32_t& registers) {
        made.result = registers++;
        topology_.steps.push_back(made);
        return made.result;
    }

    const Tree& tree_;
    const FlattenDesc& desc_;
    std::vector<NodeState> nodes_;
    Topology topology_;
};

}  // namespace

Expected<FlattenedTree> flatten(const Tree& tree, const FlattenDesc& desc) {
    NACRE_CHECK(validate(tree));
    FlattenedTree result{.visible_tree = without_invisible_slabs(tree)};
    if ((desc.dropped_features & slab_f90) != 0) {
        // What the interface reflects along the normal stays.
        for (Node& node : result.visible_tree.nodes)
            if ((node.slab.features & slab_f90) != 0) node.slab.f0 *= node.slab.specular_weight;
    }
    result.topology = Flattener(result.visible_tree, desc).run();
    return result;
}

}  // namespace nacre::materials
