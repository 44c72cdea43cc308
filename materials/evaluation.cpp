// SPDX-License-Identifier: Apache-2.0
#include "materials/evaluation.h"

#include <cmath>

namespace nacre::materials {
namespace {

using closures::Library;

// Its functions are members, but it has no state (materials/closures/lobes.h).
Library library;

// The leaf's inputs with the topology's choices.
Library::Slab read_slab(const FlattenedTree& tree, std::uint32_t leaf) {
    Library::Slab slab = Library::slab_of(tree.visible_tree.nodes[tree.topology.slabs[leaf]].slab);
    if (tree.topology.thickness[leaf] >= 0.0f) slab.thickness = tree.topology.thickness[leaf];
    return slab;
}

bool is_white(const glm::dvec3& color) { return color == glm::dvec3(1.0); }

}  // namespace

ShadedTree shade(const FlattenedTree& tree, const glm::dvec3& view, double footprint) {
    const Topology& topology = tree.topology;
    std::vector<Library::Slab> slabs(topology.slab_registers);
    std::vector<Library::Matter> matters(topology.matter_registers);
    std::vector<Library::Path> paths(topology.path_registers);
    paths[0] = library.open_path();
    for (const Step& step : topology.steps) {
        double amount = step.amount == Step::none ? 0.0 : tree.visible_tree.nodes[topology.amounts[step.amount]].amount;
        if (step.complement) amount = 1.0 - amount;
        switch (step.kind) {
            case StepKind::read_slab:
                slabs[step.result] = read_slab(tree, step.a);
                // What was dropped is no feature of any closure.
                slabs[step.result].features &= topology.features;
                break;
            case StepKind::cover_slab:
                slabs[step.result] = slabs[step.a];
                slabs[step.result].coverage *= amount;
                break;
            case StepKind::mix_slabs: slabs[step.result] = library.mix_slabs(slabs[step.a], slabs[step.b], amount); break;
            case StepKind::layer_slabs:
                slabs[step.result] = library.layer_slabs(slabs[step.a], slabs[step.b], matters[step.c], matters[step.d]);
                break;
            case StepKind::slab_matter:
                matters[step.result] = library.slab_matter(slabs[step.a], library.prepare_closure(slabs[step.a], view, footprint));
                break;
            case StepKind::base_matter: matters[step.result] = library.base_matter(slabs[step.a], view.z); break;
            case StepKind::cover_matter: matters[step.result] = library.cover_matter(matters[step.a], amount); break;
            case StepKind::mix_matter: matters[step.result] = library.mix_matter(matters[step.a], matters[step.b], amount); break;
            case StepKind::layer_matter: matters[step.result] = library.layer_matter(matters[step.a], matters[step.b]); break;
            case StepKind::path_through_mix: paths[step.result] = library.path_through_mix(paths[step.a], amount); break;
            case StepKind::path_through_layer:
                paths[step.result] = library.path_through_layer(paths[step.a], matters[step.b], matters[step.c].albedo);
                break;
        }
    }
    ShadedTree shaded{.whole = matters[topology.whole], .top = matters[topology.top]};
    for (const TopologyClosure& closure : topology.closures) {
        ShadedClosure result{.node = closure.node, .slab = slabs[closure.slab], .path = paths[closure.path]};
        result.slab.features &= closure.features;
        result.slab.roughness = library.tracked_roughness(result.slab.roughness, result.path.variance);
        result.closure = library.prepare_closure(result.slab, view, footprint);
        result.coverage = library.slab_coverage(result.slab, view.z);
        shaded.closures.push_back(result);
    }
    return shaded;
}

glm::dvec3 reflected(const ShadedTree& shaded, const glm::dvec3& light) {
    glm::dvec3 sum(0.0);
    for (const ShadedClosure& c : shaded.closures) {
        const Library::ClosureValue value = library.evaluate_closure(c.closure, light);
        sum += (value.specular + value.diffuse + value.subsurface) * c.path.weight * c.coverage *
               library.top_transmittance(c.path, light.z);
    }
    return sum;
}

glm::dvec3 directional_albedo(const ShadedTree& shaded, int strata) {
    glm::dvec3 sum(0.0);
    for (const ShadedClosure& c : shaded.closures) {
        const glm::dvec3 weight = c.path.weight * c.coverage;
        const bool is_clear = is_white(c.path.transmittance) || is_white(c.path.uncovered);
        if (is_clear) {
            const Library::ClosureAlbedo albedo = library.closure_albedo(c.closure);
            sum += weight * (albedo.specular + albedo.fuzz + albedo.diffuse);
            continue;
        }
        glm::dvec3 mean(0.0);
        // Stratified in the direction within a lobe, and evenly spread over the choice of the lobe.
        for (int i = 0; i < strata * strata; ++i) {
            const glm::dvec3 random(std::fmod((i + 0.5) * 0.6180339887498949, 1.0), (i % strata + 0.5) / strata,
                                    (i / strata + 0.5) / strata);
            const Library::ClosureSample sample = library.sample_closure(c.closure, random);
            if (sample.pdf <= 0.0 || sample.direction.z <= 0.0) continue;
            mean += sample.weight * library.top_transmittance(c.path, sample.direction.z);
        }
        sum += weight * mean / static_cast<double>(strata * strata);
    }
    return sum;
}

}  // namespace nacre::materials
