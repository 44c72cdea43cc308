// SPDX-License-Identifier: Apache-2.0
#include "measure/random_tree.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>

namespace nacre::measure {
namespace {

using namespace materials;

// Distributions of the standard library differ from one library to the next; this does not.
float uniform(std::mt19937& random) { return static_cast<float>(random() >> 8) * 0x1p-24f; }

glm::vec3 color(std::mt19937& random) {
    const float r = uniform(random), g = uniform(random), b = uniform(random);
    return {r, g, b};
}

// At the ends more often than chance would have it.
float edgy(std::mt19937& random) {
    const float u = uniform(random);
    return u < 0.1f ? 0.0f : u < 0.2f ? 1.0f : uniform(random);
}

Slab random_slab(std::mt19937& random, const RandomTreeDesc& desc) {
    Slab slab;
    slab.features = static_cast<std::uint32_t>(random()) & static_cast<std::uint32_t>(random()) & desc.features;
    slab.f0 = uniform(random) < 0.5f ? glm::vec3(0.02f + 0.08f * uniform(random)) : color(random);
    slab.roughness = edgy(random);
    slab.albedo = desc.is_lossless ? glm::vec3(1.0f) : color(random);
    slab.coverage = desc.is_lossless ? 1.0f : uniform(random) < 0.3f ? edgy(random) : 1.0f;
    slab.anisotropy = 2.0f * edgy(random) - 1.0f;
    slab.f90 = desc.is_lossless ? glm::vec3(1.0f) : color(random);
    slab.specular_weight = edgy(random);
    slab.f82 = desc.is_lossless ? glm::vec3(1.0f) : color(random);
    slab.second_roughness = edgy(random);
    slab.second_weight = edgy(random);
    slab.fuzz_amount = edgy(random);
    slab.fuzz_roughness = edgy(random);
    slab.fuzz_color = desc.is_lossless ? glm::vec3(1.0f) : color(random);
    slab.film_thickness = 1e-6f * edgy(random);
    slab.film_ior = 1.0f + uniform(random);
    slab.mean_free_path = glm::vec3(std::pow(10.0f, 6.0f * uniform(random) - 6.0f)) * (0.1f + color(random));
    slab.phase_anisotropy = 1.8f * uniform(random) - 0.9f;
    slab.thickness = std::pow(10.0f, 4.0f * uniform(random) - 5.0f);
    slab.emission = color(random);
    slab.edge_coverage = edgy(random);
    slab.edge_exponent = 1.0f + 5.0f * uniform(random);
    return slab;
}

// A top that lets light through without taking any.
Slab clear(Slab slab) {
    slab.features |= slab_medium;
    slab.mean_free_path = glm::vec3(std::numeric_limits<float>::infinity());
    slab.f0 = glm::min(slab.f0, glm::vec3(0.1f));
    return slab;
}

NodeIndex grow(std::mt19937& random, const RandomTreeDesc& desc, Tree& tree, std::uint32_t slabs, bool is_base) {
    if (slabs == 1) {
        Slab slab = random_slab(random, desc);
        if (!is_base && desc.is_lossless) slab = clear(slab);
        if (!is_base && (desc.features & slab_medium) != 0) slab.features |= slab_medium;
        if (is_base && desc.is_lossless) slab.features &= ~slab_medium;
        return tree.add(slab);
    }
    const std::uint32_t left = 1 + static_cast<std::uint32_t>(random()) % (slabs - 1);
    const float kind = uniform(random);
    if (kind < 0.5f) {
        const NodeIndex top = grow(random, desc, tree, left, false);
        const NodeIndex base = grow(random, desc, tree, slabs - left, is_base);
        return tree.layer(top, base, desc.is_lossless || uniform(random) < 0.5f ? 1e-3f * uniform(random) : -1.0f);
    }
    const NodeIndex first = grow(random, desc, tree, left, is_base);
    const NodeIndex second = grow(random, desc, tree, slabs - left, is_base);
    const NodeIndex mix = tree.mix(first, second, edgy(random));
    return kind < 0.65f && !desc.is_lossless ? tree.coverage(mix, edgy(random)) : mix;
}

}  // namespace

Tree random_tree(std::mt19937& random, const RandomTreeDesc& desc) {
    Tree tree{.name = "random"};
    tree.root = grow(random, desc, tree, std::max(desc.slabs, 1u), true);
    return tree;
}

}  // namespace nacre::measure
