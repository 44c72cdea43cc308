// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>

#include "core/embedded_file.h"
#include "materials/evaluation.h"
#include "materials/tree_shader.h"
#include "measure/random_tree.h"
#include "measure/stability_subject.h"

namespace nacre::measure {

// Generated from the files named in measure/CMakeLists.txt.
std::span<const EmbeddedFile> embedded_files();

namespace {

using namespace materials;

/// What the shader reads, in this order.
struct TreePoint {
    glm::vec3 view, light;
    float footprint, unused;
};

constexpr std::uint32_t tree_features = slab_anisotropy | slab_f90 | slab_f82 | slab_second_lobe | slab_fuzz |
                                        slab_thin_film | slab_medium | slab_edge_coverage;

// Where a parameter of a tree's shader comes from.
struct ParameterSource {
    NodeIndex node = 0;
    const SlabField* field = nullptr;  ///< Null: the amount of the node.
    std::uint32_t channel = 0;
    float value = 0.0f;  ///< In the tree itself.
};

// The shader's parameters by their places in the tree: it is printed once more with a number for each input.
std::vector<ParameterSource> parameter_sources(const FlattenedTree& flat, const TreeShader& shader) {
    constexpr std::uint32_t inputs = 128;
    FlattenedTree marked = flat;
    const auto fields = slab_fields();
    for (NodeIndex n = 0; n < marked.visible_tree.nodes.size(); ++n) {
        Node& node = marked.visible_tree.nodes[n];
        node.amount = static_cast<float>(n * inputs);
        for (std::uint32_t f = 0; f < fields.size(); ++f)
            for (std::uint32_t channel = 0; channel < fields[f].channels; ++channel)
                fields[f].set(node.slab, channel, static_cast<float>(n * inputs + 1 + 3 * f + channel));
    }
    for (std::size_t leaf = 0; leaf < marked.topology.slabs.size(); ++leaf) marked.topology.thickness[leaf] = -1.0f;
    const std::vector<float> marks = tree_shader(marked).parameters;
    std::vector<ParameterSource> sources;
    for (std::size_t i = 0; i < marks.size(); ++i) {
        const auto mark = static_cast<std::uint32_t>(marks[i]);
        ParameterSource source{.node = mark / inputs, .value = shader.parameters[i]};
        if (const std::uint32_t input = mark % inputs; input != 0) {
            source.field = &fields[(input - 1) / 3];
            source.channel = (input - 1) % 3;
        }
        sources.push_back(source);
    }
    return sources;
}

float edgy(Random& random) {
    const double kind = random();
    return kind < 0.15 ? 0.0f : kind < 0.3 ? 1.0f : kind < 0.32 ? 1e-40f : static_cast<float>(random());
}

Slab lively_slab(std::mt19937& random, bool is_base) {
    Tree tree = random_tree(random, {.slabs = 1, .features = tree_features});
    Slab slab = tree.nodes[tree.root].slab;
    if (!is_base) slab.features |= slab_medium;
    slab.coverage = 0.9f;
    return slab;
}

// A chain of `layers` layers, each of whose tops is one slab or a mix of two, over one slab or a mix of two.
Tree deep_tree(std::mt19937& random, std::uint32_t layers, bool is_wide) {
    Tree tree{.name = is_wide ? "deep and wide" : "deep"};
    const auto part = [&](bool is_base) {
        const NodeIndex first = tree.add(lively_slab(random, is_base));
        if (!is_wide) return first;
        const NodeIndex second = tree.add(lively_slab(random, is_base));
        return tree.mix(first, second, 0.5f);
    };
    NodeIndex below = part(true);
    for (std::uint32_t i = 0; i < layers; ++i) below = tree.layer(part(false), below, 1e-4f);
    tree.root = below;
    return tree;
}

// All slabs side by side.
Tree wide_tree(std::mt19937& random, std::uint32_t slabs) {
    Tree tree{.name = "wide"};
    std::vector<NodeIndex> nodes;
    for (std::uint32_t i = 0; i < slabs; ++i) nodes.push_back(tree.add(lively_slab(random, true)));
    while (nodes.size() > 1) {
        std::vector<NodeIndex> above;
        for (std::size_t i = 0; i + 1 < nodes.size(); i += 2) above.push_back(tree.mix(nodes[i], nodes[i + 1], 0.5f));
        nodes = above;
    }
    tree.root = nodes.front();
    return tree;
}

Expected<StabilitySubject> tree_subject(std::string name, std::string what, const Tree& tree, bool keeps_values) {
    NACRE_TRY(const FlattenedTree flat, flatten(tree));
    const TreeShader shader = tree_shader(flat);
    StabilitySubject subject{.name = std::move(name), .what = std::move(what)};
    using enum ResultKind;
    subject.results = {lobe, lobe, lobe, share, share, share, share, share, light_scale};
    std::string main;
    for (const EmbeddedFile& file : embedded_files())
        if (file.path == "measure/stability_tree.glsl") main = file.text;
    const auto is_deferred = [](const Step& step) {
        return step.kind == StepKind::slab_matter || step.kind == StepKind::layer_matter ||
               step.kind == StepKind::path_through_layer;
    };
    subject.deferred_calls = static_cast<std::uint32_t>(std::ranges::count_if(flat.topology.steps, is_deferred));
    subject.shader = {
        .name = "tree",
        .text = fmt::format("vec3 specular_lut(uint index, vec2 at) {{ return vec3(1.0); }}\n"
                            "float tree_parameter(uint index) {{ return parameters[gl_WorkGroupID.x * {}u + "
                            "index]; }}\nvec4 tree_texture(uint index) {{ return vec4(1.0); }}\n"
                            "#ifdef DEFERRED_CALLS\n#include \"measure/stability_deferred.glsl\"\n#endif\n{}\n{}",
                            shader.parameters.size(), shader.glsl, main),
        .point_words = sizeof(TreePoint) / 4,
        .result_words = static_cast<std::uint32_t>(subject.results.size()),
        .parameter_words = static_cast<std::uint32_t>(shader.parameters.size()),
        .features = flat.topology.features,
        .has_tables = true};
    subject.make_point = [](Random& random, std::uint32_t* words) {
        TreePoint point{};
        const glm::dvec3 view = random_direction(random);
        point.view = view;
        point.light = random_light(random, view);
        point.footprint = static_cast<float>(std::pow(10.0, random(-6.0, 2.0)));
        put_point(point, words);
    };
    subject.lower_cosine = [](const std::uint32_t* words) {
        const auto p = point_of<TreePoint>(words);
        return static_cast<double>(std::min(p.view.z, p.light.z));
    };
    const std::string topology = topology_text(flat.visible_tree);
    subject.describe = [topology](const std::uint32_t* words) {
        const auto p = point_of<TreePoint>(words);
        return fmt::format("{}; view {:.9g} {:.9g} {:.9g}, light {:.9g} {:.9g} {:.9g}, footprint {:.9g} m", topology,
                           p.view.x, p.view.y, p.view.z, p.light.x, p.light.y, p.light.z, p.footprint);
    };
    const auto sources = std::make_shared<std::vector<ParameterSource>>(parameter_sources(flat, shader));
    const std::size_t nodes = flat.visible_tree.nodes.size();
    subject.make_parameters = [=](Random& random, std::uint32_t sets, std::vector<float>& parameters) {
        parameters.clear();
        for (std::uint32_t set = 0; set < sets; ++set) {
            // Some as they are, some with a few inputs at their ends, some with all.
            const double changed = keeps_values ? 0.0 : std::array{0.05, 0.3, 1.0}[random.below(3)];
            std::vector<Slab> slabs(nodes);
            for (Slab& slab : slabs) slab = random_slab(random, 0);
            for (const ParameterSource& source : *sources) {
                float value = source.value;
                if (random() < changed)
                    value =
                        source.field == nullptr ? edgy(random) : source.field->get(slabs[source.node], source.channel);
                parameters.push_back(value);
            }
        }
    };
    subject.is_complete_on_host = true;
    const std::size_t width = subject.results.size();
    subject.on_host = [=](const std::uint32_t* words, std::uint32_t count, const float* parameters, double* values) {
        FlattenedTree changed = flat;
        std::ranges::fill(changed.topology.thickness, -1.0f);
        for (std::size_t i = 0; i < sources->size(); ++i) {
            const ParameterSource& source = (*sources)[i];
            Node& node = changed.visible_tree.nodes[source.node];
            if (source.field == nullptr) node.amount = parameters[i];
            else source.field->set(node.slab, source.channel, parameters[i]);
        }
        Library library;
        for (std::uint32_t i = 0; i < count; ++i, words += sizeof(TreePoint) / 4, values += width) {
            const auto p = point_of<TreePoint>(words);
            const ShadedTree shaded = shade(changed, p.view, p.footprint);
            const glm::dvec3 value = reflected(shaded, p.light);
            const glm::dvec3 through = library.matter_throughput(shaded.whole);
            for (int channel = 0; channel < 3; ++channel)
                values[channel] = value[channel], values[3 + channel] = through[channel];
            values[6] = shaded.whole.coverage;
            values[7] = shaded.top.coverage;
            values[8] = 1.0;
            for (const ShadedClosure& c : shaded.closures) {
                const double weight = std::max({c.path.weight.x, c.path.weight.y, c.path.weight.z}) * c.coverage;
                // What the lobes would send if they reflected everything: as lobe_scale() of stability_functions.glsl.
                // Below a layer the lobes are in refracted directions.
                const glm::dvec3 light = library.refracted_direction(p.light, c.closure.ior_excess);
                const glm::dvec3 h = library.half_vector(c.closure.view, light);
                double scale = library.specular_lobe_pdf(c.closure.specular, c.closure.view, light, h);
                if ((c.slab.features & slab_second_lobe) != 0)
                    scale += library.specular_lobe_pdf(c.closure.second, c.closure.view, light, h);
                if (c.closure.ior_excess > 0.0) {
                    scale += library.specular_lobe_pdf(c.closure.again, c.closure.again_view, light,
                                                       library.half_vector(c.closure.again_view, light));
                    scale *= std::max(double{p.light.z}, 0.0) / (std::pow(1.0 + c.closure.ior_excess, 2.0) * light.z);
                }
                if ((c.slab.features & slab_fuzz) != 0) scale += library.sheen_density(c.closure.fuzz_map, p.light);
                values[8] += weight * scale;
            }
        }
    };
    return subject;
}

// Smallest and largest energy of random trees at some views.
Expected<std::pair<double, double>> tree_furnace(bool is_lossless, std::uint32_t count) {
    std::mt19937 random(is_lossless ? 6 : 5);
    double smallest = 1e9, largest = 0.0;
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t lobes = slab_second_lobe | slab_fuzz | slab_f90 | slab_f82;
        const Tree tree = random_tree(
            random, {.slabs = 1 + i % 6, .features = is_lossless ? lobes : lobes | slab_medium | slab_edge_coverage,
                     .is_lossless = is_lossless});
        NACRE_TRY(const FlattenedTree flat, flatten(tree));
        for (const double cosine : {1.0, 0.8, 0.5, 0.2, 0.05, 0.005}) {
            const glm::dvec3 albedo = directional_albedo(shade(flat, direction(cosine, 0.0)));
            smallest = std::min({smallest, albedo.x, albedo.y, albedo.z});
            largest = std::max({largest, albedo.x, albedo.y, albedo.z});
        }
    }
    return std::pair{smallest, largest};
}

}  // namespace

Expected<std::vector<StabilitySubject>> tree_subjects(std::uint32_t count) {
    std::vector<StabilitySubject> subjects;
    std::mt19937 random(21);
    for (std::uint32_t i = 0; i < count; ++i) {
        std::string name = "trees", what = "Random trees of 1 to 8 slabs.";
        Tree tree;
        bool is_lossless = false;
        if (i == 0) {
            name = "tree-deep", what = "16 layers over a slab.";
            tree = deep_tree(random, 16, false);
        } else if (i == 1) {
            name = "tree-wide", what = "32 slabs side by side.";
            tree = wide_tree(random, 32);
        } else if (i == 2) {
            name = "tree-deep-wide", what = "15 layers, all of mixes of two: 32 slabs below 16 operators.";
            tree = deep_tree(random, 15, true);
        } else {
            is_lossless = i % 5 == 4;
            if (is_lossless) name = "trees-lossless", what = "Random stacks that absorb nothing.";
            tree = random_tree(random, {.slabs = 1 + i % 8, .features = tree_features, .is_lossless = is_lossless});
        }
        NACRE_TRY(StabilitySubject subject, tree_subject(name, what, tree, is_lossless));
        if (std::ranges::find(subjects, name, &StabilitySubject::name) == subjects.end() && i > 2)
            subject.furnace = [is_lossless](bool is_short) { return tree_furnace(is_lossless, is_short ? 25 : 500); };
        subject.is_furnace_lossless = is_lossless;
        subject.limits.lossless = 0.98;
        subject.share = 0.2;
        subjects.push_back(std::move(subject));
    }
    return subjects;
}

}  // namespace nacre::measure
