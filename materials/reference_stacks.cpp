// SPDX-License-Identifier: Apache-2.0
#include "materials/reference_stacks.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <random>
#include <string_view>

namespace nacre::materials {
namespace {

const glm::vec3 black(0.0f);
constexpr glm::vec3 gold(1.00f, 0.77f, 0.34f);

Slab opaque(const glm::vec3& f0, float roughness, const glm::vec3& albedo) {
    return {.f0 = f0, .roughness = roughness, .albedo = albedo};
}

// Lets light through; albedo black: it only absorbs. Depth is what light meets on its way straight through.
Slab film(float f0, float roughness, const glm::vec3& albedo, const glm::vec3& depth) {
    Slab slab = opaque(glm::vec3(f0), roughness, albedo);
    slab.features = slab_medium;
    slab.thickness = 1e-3f;
    for (int channel = 0; channel < 3; ++channel)
        slab.mean_free_path[channel] =
            depth[channel] > 0.0f ? slab.thickness / depth[channel] : std::numeric_limits<float>::infinity();
    return slab;
}

Tree stacked(const char* name, const std::vector<Slab>& from_top) {
    Tree tree{.name = name};
    NodeIndex below = tree.add(from_top.back());
    for (std::size_t i = from_top.size() - 1; i-- > 0;) {
        const NodeIndex top = tree.add(from_top[i]);
        below = tree.layer(top, below);
    }
    return tree;
}

}  // namespace

std::vector<Tree> reference_stacks() {
    const Slab clear = film(0.04f, 0.1f, black, black);
    const Slab metal = opaque(gold, 0.35f, black);
    Tree mix{.name = "two-slab mix"};
    const NodeIndex shiny = mix.add(metal), matte = mix.add(opaque(glm::vec3(0.04f), 0.6f, {0.1f, 0.25f, 0.5f}));
    mix.mix(shiny, matte, 0.5f);
    return {
        stacked("coat over metal", {clear, metal}),
        stacked("coat over diffuse", {clear, opaque(black, 0.8f, {0.7f, 0.3f, 0.1f})}),
        stacked("dust over coat over metal", {film(0.0f, 1.0f, {0.5f, 0.42f, 0.3f}, glm::vec3(0.3f)), clear, metal}),
        stacked("tinted coat", {film(0.04f, 0.1f, black, {0.05f, 0.5f, 1.0f}), opaque(glm::vec3(0.9f), 0.4f, black)}),
        mix,
    };
}

Tree random_stack(std::uint32_t index) {
    std::mt19937 random(1000 + index);
    // Distributions of the standard library differ from one library to the next; this does not.
    const auto uniform = [&] { return static_cast<float>(random() >> 8) * 0x1p-24f; };
    const auto between = [&](float low, float high) { return low + (high - low) * uniform(); };
    const auto color = [&] {
        const float r = uniform(), g = uniform(), b = uniform();
        return glm::vec3(r, g, b);
    };
    Tree tree;
    std::string names;
    const auto add = [&](const Slab& slab, std::string_view name) { return tree.add(slab, std::string(name)); };
    const auto ground = [&] {
        const float kind = uniform();
        const float roughness = between(0.05f, 0.9f);
        if (kind < 0.4f) return add(opaque(glm::vec3(0.4f) + 0.6f * color(), roughness, black), "metal");
        if (kind < 0.7f) return add(opaque(black, roughness, color()), "matte");
        return add(opaque(glm::vec3(between(0.02f, 0.08f)), roughness, color()), "plastic");
    };
    NodeIndex below = ground();
    names = tree.nodes[below].name;
    if (uniform() < 0.2f) {
        const NodeIndex other = ground();
        names = fmt::format("mix({}, {})", names, tree.nodes[other].name);
        below = tree.mix(below, other, between(0.2f, 0.8f));
    }
    const int layers = 1 + static_cast<int>(2.999f * uniform() * uniform());
    for (int i = 0; i < layers; ++i) {
        const float kind = uniform(), f0 = between(0.02f, 0.08f);
        const float roughness = uniform() < 0.5f ? between(0.0f, 0.2f) : between(0.2f, 0.8f);
        const glm::vec3 tint = color();
        const float depth = std::pow(10.0f, between(-1.5f, 1.0f));
        const char* name = kind < 0.35f ? "clear" : kind < 0.6f ? "tinted" : kind < 0.85f ? "milky" : "dust";
        Slab slab = film(f0, roughness, black, black);
        if (kind >= 0.35f) slab = film(f0, roughness, black, 2.0f * tint);
        if (kind >= 0.6f) slab = film(f0, roughness, color(), depth * (0.5f + tint));
        if (kind >= 0.6f) slab.phase_anisotropy = between(-0.2f, 0.8f);
        if (kind >= 0.85f) slab.f0 = black;
        NodeIndex top = add(slab, name);
        std::string covered = name;
        if (uniform() < 0.15f) {
            const float amount = between(0.2f, 0.8f);
            covered = fmt::format("{:.0f} % {}", 100.0f * amount, name);
            top = tree.coverage(top, amount);
        }
        below = tree.layer(top, below);
        names = covered + " / " + names;
    }
    tree.name = fmt::format("{}: {}", index, names);
    return tree;
}

}  // namespace nacre::materials
