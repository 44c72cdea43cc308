// SPDX-License-Identifier: Apache-2.0
#include "materials/tree_shader.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace nacre::materials {
namespace {

class Printer {
  public:
    explicit Printer(const FlattenedTree& tree) : tree_(tree), topology_(tree.topology) {}

    TreeShader run() {
        print("// {}\n", shape(tree_.visible_tree.root));
        for (const SlabFeature& feature : slab_features()) {
            if ((topology_.features & feature.bit) != 0)
                result_.defines += fmt::format("#define {} 1\n", feature.macro);
        }
        print(
            "#include \"materials/closures/blending.glsl\"\n\n#ifndef NACRE_TREE_VERTEX_COLOR\n"
            "#define NACRE_TREE_VERTEX_COLOR vec4(1.0)\n#endif\n");
        print("const uint tree_closure_count = {}u;\nconst uint tree_frame_count = {}u;\n\n", topology_.closures.size(),
              topology_.frames.size());
        print(
            "struct TreeState {{\n    Slab slabs[{0}];\n    Path paths[{0}];\n    float coverages[{0}];\n    Matter "
            "whole;\n    Matter top;\n}};\n",
            topology_.closures.size());
        for (std::uint32_t leaf = 0; leaf < topology_.slabs.size(); ++leaf) print_slab(leaf);
        for (std::uint32_t i = 0; i < topology_.amounts.size(); ++i) print_amount(i);
        print_shade();
        print_reflected();
        return std::move(result_);
    }

  private:
    template <typename... Arguments>
    void print(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
        fmt::format_to(std::back_inserter(result_.glsl), format, std::forward<Arguments>(arguments)...);
    }

    // The topology without names, which do not change the shader.
    std::string shape(NodeIndex index) const {
        const Node& node = tree_.visible_tree.nodes[index];
        switch (node.kind) {
            case NodeKind::slab: return "slab";
            case NodeKind::coverage: return fmt::format("coverage({})", shape(node.first));
            case NodeKind::mix:
            case NodeKind::layer:
                return fmt::format("{}({}, {})", name_of(node.kind), shape(node.first), shape(node.second));
        }
        return {};
    }

    const TextureInput* texture_of(NodeIndex node, std::string_view field) const {
        const auto& textures = tree_.visible_tree.nodes[node].textures;
        const auto found = std::ranges::find(textures, field, &TextureInput::field);
        return found == textures.end() ? nullptr : &*found;
    }

    std::string parameter(float value) {
        result_.parameters.push_back(value);
        return fmt::format("tree_parameter({}u)", result_.parameters.size() - 1);
    }

    // " * (bias + scale * texel)" and what the vertex adds to it, or nothing.
    std::string texture_factor(NodeIndex node, std::string_view field, std::uint32_t channels) {
        const auto& colored = tree_.visible_tree.nodes[node].vertex_colored;
        const std::string by_vertex = std::ranges::find(colored, field) == colored.end() ? ""
                                      : channels == 3 ? " * NACRE_TREE_VERTEX_COLOR.xyz"
                                                      : " * NACRE_TREE_VERTEX_COLOR.w";
        const TextureInput* input = texture_of(node, field);
        if (input == nullptr) return by_vertex;
        result_.textures.push_back({.node = node, .input = *input});
        constexpr const char* swizzles[] = {"x", "y", "z", "w"};
        channels = input->gray ? 1 : channels;
        const std::string texel =
            fmt::format("tree_texture({}u).{}", result_.textures.size() - 1,
                        channels == 3 ? (input->channel == 0 ? "xyz" : "yzw") : swizzles[input->channel]);
        const std::string bias = parameter(input->bias), scale = parameter(input->scale);
        return fmt::format(" * ({} + {} * {}){}", bias, scale, texel, by_vertex);
    }

    void print_slab(std::uint32_t leaf) {
        const NodeIndex index = topology_.slabs[leaf];
        Slab slab = tree_.visible_tree.nodes[index].slab;
        const std::uint32_t features = slab.features & topology_.features;
        const Slab plain;
        if (topology_.thickness[leaf] >= 0.0f) slab.thickness = topology_.thickness[leaf];
        print("\nSlab tree_slab_{}() {{\n    Slab slab;\n    slab.features = {}u;\n", leaf, features);
        for (const SlabField& field : slab_fields()) {
            if (field.feature != 0 && (topology_.features & field.feature) == 0) continue;
            // What this slab does not have, but another, still needs a value.
            const bool is_used = field.feature == 0 || (features & field.feature) != 0;
            std::string value;
            if (field.channels == 1) {
                value = is_used ? parameter(field.get(slab, 0)) : literal(field.get(plain, 0));
            } else {
                std::string channels[3];
                for (std::uint32_t channel = 0; channel < 3; ++channel)
                    channels[channel] =
                        is_used ? parameter(field.get(slab, channel)) : literal(field.get(plain, channel));
                value = fmt::format("vec3({}, {}, {})", channels[0], channels[1], channels[2]);
            }
            if (is_used) value += texture_factor(index, field.name, field.channels);
            print("    slab.{} = {};\n", field.name, value);
        }
        if ((topology_.features & slab_specular_lut) != 0) print("    slab.specular_lut = {}u;\n", slab.specular_lut);
        if ((topology_.features & slab_glints) != 0) {
            print(
                "#ifdef NACRE_TREE_GLINT_POSITION\n    slab.glint_position = NACRE_TREE_GLINT_POSITION;\n"
                "    slab.glint_dx = NACRE_TREE_GLINT_DX;\n    slab.glint_dy = NACRE_TREE_GLINT_DY;\n#else\n"
                "    slab.glint_position = vec2(0.0);\n    slab.glint_dx = vec2(0.0);\n    slab.glint_dy = "
                "vec2(0.0);\n#endif\n");
        }
        print("    return slab;\n}}\n");
    }

    static std::string literal(float value) {
        std::string text = fmt::format("{}", value);
        if (text.find_first_of(".e") == std::string::npos) text += ".0";
        return text;
    }

    void print_amount(std::uint32_t i) {
        const NodeIndex node = topology_.amounts[i];
        std::string value = parameter(tree_.visible_tree.nodes[node].amount);
        const std::string factor = texture_factor(node, "amount", 1);
        if (!factor.empty()) value = fmt::format("clamp({}{}, 0.0, 1.0)", value, factor);
        print("\nfloat tree_amount_{}() {{ return {}; }}\n", i, value);
    }

    // The views and lights of a frame: its place in Topology::frames.
    std::size_t frame_slot(std::uint32_t frame) const {
        return static_cast<std::size_t>(std::ranges::find(topology_.frames, frame) - topology_.frames.begin());
    }

    // Frame of a slab register that a matter is made of; blended slabs have their first slab's.
    std::vector<std::size_t> frames_of_slabs() const {
        std::vector<std::size_t> slots(topology_.slab_registers, 0);
        for (const Step& step : topology_.steps) {
            if (step.kind == StepKind::read_slab) {
                const std::uint32_t frame = tree_.visible_tree.nodes[topology_.slabs[step.a]].frame;
                const std::size_t slot = frame_slot(frame);
                slots[step.result] = slot < topology_.frames.size() ? slot : 0;
            } else if (step.kind == StepKind::cover_slab || step.kind == StepKind::mix_slabs ||
                       step.kind == StepKind::layer_slabs || step.kind == StepKind::track_slab) {
                slots[step.result] = slots[step.a];
            }
        }
        return slots;
    }

    void print_shade() {
        const std::vector<std::size_t> slots = frames_of_slabs();
        print("\nTreeState shade_tree(vec3 views[{}], float footprint) {{\n", topology_.frames.size());
        for (std::size_t i = 0; i < topology_.amounts.size(); ++i)
            print("    float amount_{0} = tree_amount_{0}();\n", i);
        print("    Path path_0 = open_path();\n    Widening widening_0 = no_widening();\n");
        for (const Step& step : topology_.steps) {
            const std::string amount = step.amount == Step::none ? std::string()
                                       : step.complement         ? fmt::format("1.0 - amount_{}", step.amount)
                                                                 : fmt::format("amount_{}", step.amount);
            switch (step.kind) {
                case StepKind::read_slab: print("    Slab slab_{} = tree_slab_{}();\n", step.result, step.a); break;
                case StepKind::cover_slab:
                    print("    Slab slab_{0} = slab_{1};\n    slab_{0}.coverage *= {2};\n", step.result, step.a,
                          amount);
                    break;
                case StepKind::mix_slabs:
                    print("    Slab slab_{} = mix_slabs(slab_{}, slab_{}, {});\n", step.result, step.a, step.b, amount);
                    break;
                case StepKind::layer_slabs:
                    print("    Slab slab_{} = layer_slabs(slab_{}, slab_{}, matter_{}, matter_{});\n", step.result,
                          step.a, step.b, step.c, step.d);
                    break;
                case StepKind::slab_spread:
                    print("    Spread spread_{} = slab_spread(slab_{}, views[{}].z);\n", step.result, step.a,
                          slots[step.a]);
                    break;
                case StepKind::cover_spread:
                    print("    Spread spread_{} = cover_spread(spread_{}, {});\n", step.result, step.a, amount);
                    break;
                case StepKind::mix_spread:
                    print("    Spread spread_{} = mix_spread(spread_{}, spread_{}, {});\n", step.result, step.a, step.b,
                          amount);
                    break;
                case StepKind::layer_spread:
                    print("    Spread spread_{} = layer_spread(spread_{}, spread_{});\n", step.result, step.a, step.b);
                    break;
                case StepKind::widening_below:
                    print("    Widening widening_{} = widening_below(widening_{}, spread_{});\n", step.result, step.a,
                          step.b);
                    break;
                case StepKind::track_slab:
                    print("    Slab slab_{} = track_slab(slab_{}, widening_{});\n", step.result, step.a, step.b);
                    break;
                case StepKind::slab_matter:
                    print(
                        "    Matter matter_{0} = slab_matter(slab_{1}, prepare_closure(slab_{1}, "
                        "view_below(views[{2}], "
                        "widening_{3}), footprint));\n",
                        step.result, step.a, slots[step.a], step.b);
                    break;
                case StepKind::base_matter:
                    print("    Matter matter_{} = base_matter(slab_{}, view_below(views[{}], widening_{}).z);\n",
                          step.result, step.a, slots[step.a], step.b);
                    break;
                case StepKind::cover_matter:
                    print("    Matter matter_{} = cover_matter(matter_{}, {});\n", step.result, step.a, amount);
                    break;
                case StepKind::mix_matter:
                    print("    Matter matter_{} = mix_matter(matter_{}, matter_{}, {});\n", step.result, step.a, step.b,
                          amount);
                    break;
                case StepKind::layer_matter:
                    print("    Matter matter_{} = layer_matter(matter_{}, matter_{});\n", step.result, step.a, step.b);
                    break;
                case StepKind::path_through_mix:
                    print("    Path path_{} = path_through_mix(path_{}, {});\n", step.result, step.a, amount);
                    break;
                case StepKind::path_through_layer:
                    print("    Path path_{} = path_through_layer(path_{}, matter_{}, matter_{}, widening_{});\n",
                          step.result, step.a, step.b, step.c, step.d);
                    break;
            }
        }
        print("    TreeState state;\n    state.whole = matter_{};\n    state.top = matter_{};\n", topology_.whole,
              topology_.top);
        for (std::size_t i = 0; i < topology_.closures.size(); ++i) {
            const TopologyClosure& closure = topology_.closures[i];
            print(
                "    state.slabs[{0}] = slab_{1};\n    state.slabs[{0}].features = {4}u;\n    state.paths[{0}] = "
                "path_{2};\n"
                "    state.coverages[{0}] = slab_coverage(slab_{1}, refracted_direction(views[{3}], "
                "path_{2}.ior_excess).z);\n",
                i, closure.slab, closure.path, frame_slot(closure.frame), closure.features);
        }
        print("    return state;\n}}\n");
    }

    void print_reflected() {
        print(
            "\nvec3 tree_reflected(TreeState state, vec3 views[{0}], vec3 lights[{0}], float footprint) {{\n    vec3 "
            "sum = vec3(0.0);\n",
            topology_.frames.size());
        for (std::size_t i = 0; i < topology_.closures.size(); ++i) {
            const TopologyClosure& closure = topology_.closures[i];
            const std::size_t slot = frame_slot(closure.frame);
            // Layers change nothing of what lies open.
            const std::string prepared =
                closure.path == 0 ? fmt::format("prepare_closure(slab, views[{}], footprint)", slot)
                                  : fmt::format("closure_below(slab, state.paths[{}], views[{}], footprint)", i, slot);
            print(
                "    vec3 weight_{0} = state.paths[{0}].weight * state.coverages[{0}];\n"
                "    if (largest(weight_{0}) > 0.0) {{\n"
                "        Slab slab = state.slabs[{0}];\n        slab.features = {1}u;\n"
                "        ClosureValue value = evaluate_closure({3}, lights[{2}]);\n"
                "        sum += (value.specular + value.diffuse + value.subsurface) * weight_{0} * "
                "top_transmittance(state.paths[{0}], lights[{2}].z);\n    }}\n",
                i, closure.features, slot, prepared);
        }
        print("    return sum;\n}}\n");
    }

    const FlattenedTree& tree_;
    const Topology& topology_;
    TreeShader result_;
};

}  // namespace

TreeShader tree_shader(const FlattenedTree& tree) { return Printer(tree).run(); }

}  // namespace nacre::materials
