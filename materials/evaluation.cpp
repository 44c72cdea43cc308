// SPDX-License-Identifier: Apache-2.0
#include "materials/evaluation.h"
#include "materials/turned.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

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

bool is_white(const glm::dvec3& color) { return glm::all(glm::greaterThan(color, glm::dvec3(1.0 - 1e-9))); }

}  // namespace

ShadedTree shade(const FlattenedTree& tree, const glm::dvec3& view, double footprint) {
    return shade(tree, view, footprint, library);
}

ShadedTree shade(const FlattenedTree& tree, const glm::dvec3& view, double footprint, Library& library) {
    const Topology& topology = tree.topology;
    std::vector<Library::Slab> slabs(topology.slab_registers);
    std::vector<Library::Matter> matters(topology.matter_registers);
    std::vector<Library::Path> paths(topology.path_registers);
    std::vector<Library::Spread> spreads(topology.spread_registers);
    std::vector<Library::Widening> widenings(topology.widening_registers, library.no_widening());
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
            case StepKind::mix_slabs:
                slabs[step.result] = library.mix_slabs(slabs[step.a], slabs[step.b], amount);
                break;
            case StepKind::layer_slabs:
                slabs[step.result] =
                    library.layer_slabs(slabs[step.a], slabs[step.b], matters[step.c], matters[step.d]);
                break;
            case StepKind::slab_spread: spreads[step.result] = library.slab_spread(slabs[step.a], view.z); break;
            case StepKind::cover_spread: spreads[step.result] = library.cover_spread(spreads[step.a], amount); break;
            case StepKind::mix_spread:
                spreads[step.result] = library.mix_spread(spreads[step.a], spreads[step.b], amount);
                break;
            case StepKind::layer_spread:
                spreads[step.result] = library.layer_spread(spreads[step.a], spreads[step.b]);
                break;
            case StepKind::widening_below:
                widenings[step.result] = library.widening_below(widenings[step.a], spreads[step.b]);
                break;
            case StepKind::track_slab: slabs[step.result] = library.track_slab(slabs[step.a], widenings[step.b]); break;
            case StepKind::slab_matter:
                matters[step.result] = library.slab_matter(
                    slabs[step.a],
                    library.prepare_closure(slabs[step.a], library.view_below(view, widenings[step.b]), footprint));
                break;
            case StepKind::base_matter: matters[step.result] = 
                    library.base_matter(slabs[step.a], library.view_below(view, widenings[step.b]).z);
                break;
            case StepKind::cover_matter: matters[step.result] = library.cover_matter(matters[step.a], amount); break;
            case StepKind::mix_matter:
                matters[step.result] = library.mix_matter(matters[step.a], matters[step.b], amount);
                break;
            case StepKind::layer_matter:
                matters[step.result] = library.layer_matter(matters[step.a], matters[step.b]);
                break;
            case StepKind::path_through_mix:
                paths[step.result] = library.path_through_mix(paths[step.a], amount);
                break;
            case StepKind::path_through_layer:
                paths[step.result] = library.path_through_layer(paths[step.a], matters[step.b], matters[step.c],
                                                              widenings[step.d]);
                break;
        }
    }
    ShadedTree shaded{.whole = matters[topology.whole], .top = matters[topology.top]};
    for (const TopologyClosure& closure : topology.closures) {
        ShadedClosure result{.node = closure.node, .slab = slabs[closure.slab], .path = paths[closure.path]};
        result.slab.features &= closure.features;
        result.rotation = tree.visible_tree.frames[closure.frame].rotation;
        result.frame_slot = static_cast<std::uint32_t>(std::ranges::find(topology.frames, closure.frame) -
                                                       topology.frames.begin());
        result.closure = library.closure_below(result.slab, result.path, turned(view, result.rotation), footprint);
        result.coverage =
            library.slab_coverage(result.slab, library.refracted_direction(view, result.path.ior_excess).z);
        shaded.closures.push_back(result);
    }
    return shaded;
}

glm::dvec3 reflected(const ShadedTree& shaded, const glm::dvec3& light) {
    glm::dvec3 sum(0.0);
    for (const ShadedClosure& c : shaded.closures) {
        const Library::ClosureValue value = library.evaluate_closure(c.closure, turned(light, c.rotation));
        sum += (value.specular + value.diffuse + value.subsurface) * c.path.weight * c.coverage *
               library.top_transmittance(c.path, light.z);
    }
    return sum;
}

glm::dvec3 directional_albedo(const ShadedTree& shaded, int strata) {
    glm::dvec3 sum(0.0);
    for (const ShadedClosure& c : shaded.closures) {
        const glm::dvec3 weight = c.path.weight * c.coverage;
        const Library::ClosureAlbedo lobes = library.closure_albedo(c.closure);
        const glm::dvec3 albedo = lobes.specular + lobes.fuzz + lobes.diffuse;
        if (is_white(c.path.transmittance) || is_white(c.path.uncovered)) {
            sum += weight * albedo;
            continue;
        }
        glm::dvec3 tinted(0.0), untinted(0.0);
        // Stratified in the direction within a lobe, and evenly spread over the choice of the lobe.
        for (int i = 0; i < strata * strata; ++i) {
            const glm::dvec3 random(std::fmod((i + 0.5) * 0.6180339887498949, 1.0), (i % strata + 0.5) / strata,
                                    (i / strata + 0.5) / strata);
            const Library::ClosureSample sample = library.sample_closure(c.closure, random);
            if (sample.pdf <= 0.0 || sample.direction.z <= 0.0) continue;
            tinted += sample.weight * library.top_transmittance(c.path, sample.direction.z);
            untinted += sample.weight;
        }
        // The albedo is known; only the mean transmittance over its light is sampled.
        sum += weight * albedo * tinted / glm::max(untinted, glm::dvec3(1e-30));
    }
    return sum;
}

}  // namespace nacre::materials
