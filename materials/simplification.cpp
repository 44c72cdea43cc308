// SPDX-License-Identifier: Apache-2.0
#include "materials/simplification.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "materials/evaluation.h"
#include "materials/storage.h"

namespace nacre::materials {
namespace {

using Kind = SimplificationRule::Kind;

constexpr SimplificationRule rules[] = {
    {Kind::blend, 0, "blend", "the interplay of two slabs; their parameters are blended by how much of each is seen"},
    {Kind::drop_feature, slab_glints, "drop glints", "single sparkles; the smooth lobe stays"},
    {Kind::drop_feature, slab_specular_lut, "drop specular table", "the tint by angles"},
    {Kind::drop_feature, slab_thin_film, "drop thin film", "interference colors"},
    {Kind::drop_feature, slab_f82, "drop f82", "the dip before grazing angles"},
    {Kind::drop_feature, slab_anisotropy, "drop anisotropy", "stretched highlights; the roughness stays"},
    {Kind::drop_feature, slab_second_lobe, "drop second lobe", "haze"},
    {Kind::drop_feature, slab_fuzz, "drop fuzz", "the sheen of fibers"},
    {Kind::drop_feature, slab_f90, "drop f90", "the color at grazing angles"},
    {Kind::drop_feature, slab_medium, "drop medium", "what light does inside: it becomes opaque"},
};

constexpr int views = 16;

glm::dvec3 view_of(int i) {
    const double theta = (87.0 / 180.0) * std::numbers::pi * i / (views - 1);
    return {std::sin(theta), 0.0, std::cos(theta)};
}

struct Appearance {
    std::vector<glm::dvec3> albedo;              // for each view
    std::vector<std::vector<glm::dvec3>> lobes;  // for each view and light
};

Appearance appearance_of(const FlattenedTree& flat) {
    constexpr int rings = 24, sectors = 32;
    Appearance result;
    for (int i = 0; i < views; ++i) {
        const ShadedTree shaded = shade(flat, view_of(i));
        result.albedo.push_back(directional_albedo(shaded));
        std::vector<glm::dvec3>& lobes = result.lobes.emplace_back();
        for (int ring = 0; ring < rings; ++ring) {
            const double z = (ring + 0.5) / rings, radius = std::sqrt(1.0 - z * z);
            for (int sector = 0; sector < sectors; ++sector) {
                const double phi = 2.0 * std::numbers::pi * (sector + 0.5) / sectors;
                lobes.push_back(reflected(shaded, {radius * std::cos(phi), radius * std::sin(phi), z}));
            }
        }
    }
    return result;
}

void measure(SimplificationStep& step, const Appearance& original, const FlattenedTree& flat) {
    const Appearance now = appearance_of(flat);
    for (int i = 0; i < views; ++i) {
        for (int channel = 0; channel < 3; ++channel)
            step.albedo_error += std::abs(now.albedo[i][channel] - original.albedo[i][channel]) / (3.0 * views);
        double difference = 0.0, whole = 0.0;
        for (std::size_t light = 0; light < now.lobes[i].size(); ++light) {
            for (int channel = 0; channel < 3; ++channel) {
                difference += std::abs(now.lobes[i][light][channel] - original.lobes[i][light][channel]);
                whole += original.lobes[i][light][channel] + now.lobes[i][light][channel];
            }
        }
        // Over the mean of both, so that a black material is no division by zero.
        if (whole > 0.0) step.lobe_error += 2.0 * difference / (whole * views);
    }
}

// The operator that is blended next: the deepest of those that still stand, mixes first.
std::optional<NodeIndex> next_operator(const Tree& tree) {
    struct Candidate {
        NodeIndex node;
        std::uint32_t depth;
        bool is_mix;
    };
    std::vector<Candidate> candidates;
    struct Open {
        NodeIndex node;
        std::uint32_t depth;
    };
    std::vector<Open> open{{tree.root, 0}};
    while (!open.empty()) {
        const Open at = open.back();
        open.pop_back();
        const Node& node = tree.nodes[at.node];
        if (node.kind == NodeKind::slab || node.parameter_blend) continue;
        if (node.kind != NodeKind::coverage) candidates.push_back({at.node, at.depth, node.kind == NodeKind::mix});
        open.push_back({node.first, at.depth + 1});
        if (node.kind != NodeKind::coverage) open.push_back({node.second, at.depth + 1});
    }
    if (candidates.empty()) return std::nullopt;
    return std::ranges::max_element(candidates,
                                    [](const Candidate& a, const Candidate& b) {
                                        return a.depth != b.depth ? a.depth < b.depth : a.is_mix < b.is_mix;
                                    })
        ->node;
}

Expected<Simplification> run(const Tree& tree, const MaterialBudget& budget) {
    Simplification result;
    SimplificationStep step{.what = "as authored", .tree = without_invisible_slabs(tree)};
    std::optional<Appearance> original;
    const auto finish = [&]() -> Expected<bool> {
        NACRE_TRY(const FlattenedTree flat, flatten(step.tree, step.flatten));
        step.closures = static_cast<std::uint32_t>(flat.topology.closures.size());
        step.bytes = storage_layout(flat).total_bytes();
        step.albedo_error = step.lobe_error = 0.0;
        if (original)
            measure(step, *original, flat);
        else
            original = appearance_of(flat);
        result.steps.push_back(step);
        return step.closures <= budget.closures && step.bytes <= budget.bytes;
    };
    NACRE_TRY(result.fits, finish());
    for (const SimplificationRule& rule : rules) {
        while (!result.fits) {
            if (rule.kind == Kind::blend) {
                const std::optional<NodeIndex> node = next_operator(step.tree);
                if (!node) break;
                step.tree.nodes[*node].parameter_blend = true;
                Tree part = step.tree;
                part.root = *node;
                step.what = "blend " + topology_text(part);
            } else {
                NACRE_TRY(const FlattenedTree flat, flatten(step.tree, step.flatten));
                const bool is_used = std::ranges::any_of(flat.topology.closures, [&](const TopologyClosure& closure) {
                    return (closure.features & rule.feature) != 0;
                });
                if (!is_used) break;
                step.flatten.dropped_features |= rule.feature;
                step.what = rule.name;
            }
            NACRE_TRY(result.fits, finish());
        }
    }
    return result;
}

}  // namespace

std::span<const SimplificationRule> simplification_rules() { return rules; }

Expected<Simplification> simplify(const Tree& tree, const MaterialBudget& budget) {
    NACRE_CHECK(validate(tree));
    if (budget.closures == 0) {
        return fail(ErrorCode::invalid_argument, "simplify material", fmt::format("'{}'", tree.name),
                    "a budget of 0 closures leaves nothing", "Allow one closure at least.");
    }
    return run(tree, budget);
}

Expected<Simplification> simplify_fully(const Tree& tree) { return simplify(tree, {.closures = 1}); }

}  // namespace nacre::materials
