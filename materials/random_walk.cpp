// SPDX-License-Identifier: Apache-2.0
#include "materials/random_walk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <vector>

#include "materials/closures/library.h"
#include "materials/turned.h"

namespace nacre::materials {
namespace {

using closures::Library;
using Generator = RandomWalk::Generator;

// Its functions are members, but it has no state (materials/closures/lobes.h).
Library library;

// Deeper media let nothing through that counts.
constexpr double opaque_depth = 4096.0;
constexpr double no_interface = 1e-6;  // the reflectance below which there is none

double uniform(Generator& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

double mean(const glm::dvec3& v) { return (v.x + v.y + v.z) / 3.0; }
double largest(const glm::dvec3& v) { return std::max({v.x, v.y, v.z}); }

// A unit vector at `cosine` from `axis`, `phi` around it.
glm::dvec3 around(const glm::dvec3& axis, double cosine, double phi) {
    const glm::dvec3 other = std::abs(axis.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
    const glm::dvec3 x = glm::normalize(glm::cross(other, axis)), y = glm::cross(axis, x);
    const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 0.0));
    return glm::normalize(sine * (std::cos(phi) * x + std::sin(phi) * y) + cosine * axis);
}

// Source: Henyey and Greenstein 1941.
glm::dvec3 scattered(const glm::dvec3& direction, double g, Generator& random) {
    const double u = uniform(random);
    double cosine = 1.0 - 2.0 * u;
    if (std::abs(g) > 1e-4) {
        const double ratio = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
        cosine = std::clamp((1.0 + g * g - ratio * ratio) / (2.0 * g), -1.0, 1.0);
    }
    return around(direction, cosine, 2.0 * std::numbers::pi * uniform(random));
}

// Of unpolarized light from outside, at a cosine to the (micro)normal.
double dielectric_reflectance(double cosine, double ior) {
    const double inner = std::sqrt(std::max(1.0 - (1.0 - cosine * cosine) / (ior * ior), 0.0));
    const double across = (cosine - ior * inner) / (cosine + ior * inner);
    const double along = (ior * cosine - inner) / (ior * cosine + inner);
    return 0.5 * (across * across + along * along);
}

// What diffuse light meets at the interface from inside, by quadrature of the reflectance from outside.
template <typename Reflectance>
double inner_mean(double ior, const Reflectance& reflectance) {
    constexpr int steps = 2000;
    double through = 0.0;
    for (int i = 0; i < steps; ++i) {
        const double cosine = (i + 0.5) / steps;
        through += 2.0 * cosine * (1.0 - reflectance(cosine)) / steps;
    }
    return 1.0 - through / (ior * ior);
}

}  // namespace

struct RandomWalk::Model {
    // A slab as light meets it.
    struct Leaf {
        Library::Slab slab;
        double rotation = 0.0;
        bool is_ground = true;  // opaque: scatters as its closure does
        bool has_interface = false, is_exact = false, scatters = false;
        double ior = 1.0;
        Library::Fresnel fresnel;
        glm::dvec3 depth{0.0};   // optical, along the normal
        glm::dvec3 single{0.0};  // albedo of a single scattering
        struct Lobe {
            bool is_mirror = true;
            glm::dvec2 alpha{0.0};
        };
        std::array<Lobe, 2> lobes;
        double second_weight = 0.0;
        double fuzz_amount = 0.0;

        [[nodiscard]] glm::dvec3 reflectance(double outer_cosine) const {
            if (is_exact) return glm::dvec3(dielectric_reflectance(outer_cosine, ior));
            return library.fresnel_reflectance(fresnel, outer_cosine);
        }
        // By the cosine on the side the light comes from.
        [[nodiscard]] glm::dvec3 reflectance(double cosine, bool outside) const {
            if (outside) return reflectance(cosine);
            const double outer2 = 1.0 - ior * ior * (1.0 - cosine * cosine);
            return outer2 <= 0.0 ? glm::dvec3(1.0) : reflectance(std::sqrt(outer2));
        }
    };

    // What a path carries. Channels have different mean free paths: distances are drawn for one of them, and the
    // weight is value / mean density over all three as the one to draw for (the balance heuristic of Veach 1997).
    struct Carried {
        glm::dvec3 value{1.0};
        glm::dvec3 density{1.0};
        int channel = 0;
        [[nodiscard]] glm::dvec3 weight() const { return value / mean(density); }
    };

    struct Stack {
        std::array<NodeIndex, max_tree_slabs> slabs;
        std::size_t size = 0;
    };

    RandomWalkDesc desc;
    Tree tree;
    std::vector<Leaf> leaves;        // by node
    std::vector<NodeIndex> parents;  // by node; the root is its own
    bool has_choices = false;

    Model(const FlattenedTree& flat, const RandomWalkDesc& settings)
        : desc(settings),
          tree(flat.visible_tree),
          leaves(tree.nodes.size()),
          parents(tree.nodes.size(), flat.visible_tree.root) {
        for (NodeIndex index = 0; index < tree.nodes.size(); ++index) {
            const Node& node = tree.nodes[index];
            if (node.kind == NodeKind::slab) continue;
            has_choices = has_choices || node.kind != NodeKind::layer;
            parents[node.first] = index;
            if (node.kind != NodeKind::coverage) parents[node.second] = index;
        }
        for (std::size_t i = 0; i < flat.topology.slabs.size(); ++i) {
            const NodeIndex index = flat.topology.slabs[i];
            Library::Slab slab = Library::slab_of(tree.nodes[index].slab);
            if (flat.topology.thickness[i] >= 0.0f) slab.thickness = flat.topology.thickness[i];
            slab.features &= flat.topology.features;
            leaves[index] = make_leaf(slab);
            leaves[index].rotation = tree.frames[tree.nodes[index].frame].rotation;
            has_choices = has_choices || slab.coverage < 1.0 || (slab.features & slab_edge_coverage) != 0;
        }
    }

    [[nodiscard]] Leaf make_leaf(const Library::Slab& slab) const {
        Leaf leaf{.slab = slab};
        if ((slab.features & slab_medium) == 0) return leaf;
        for (int channel = 0; channel < 3; ++channel)
            leaf.depth[channel] = library.optical_depth(slab.mean_free_path[channel], slab.thickness);
        if (std::min({leaf.depth.x, leaf.depth.y, leaf.depth.z}) > opaque_depth) return leaf;
        leaf.is_ground = false;
        leaf.has_interface = largest(slab.f0) > no_interface;
        leaf.fresnel = library.slab_fresnel(slab);
        leaf.is_exact = desc.exact_fresnel && slab.f0.x == slab.f0.y && slab.f0.y == slab.f0.z && slab.f0.x >= 0.02 &&
                        slab.f0.x <= 0.2 && (slab.features & (slab_f90 | slab_f82)) == 0;
        if (leaf.has_interface) leaf.ior = library.medium_ior(mean(slab.f0));
        const double stretch = (slab.features & slab_anisotropy) != 0 ? slab.anisotropy : 0.0;
        const auto lobe = [&](double roughness) {
            return Leaf::Lobe{.is_mirror = library.ggx_is_mirror(roughness),
                              .alpha = library.ggx_alpha(roughness, stretch)};
        };
        leaf.lobes[0] = lobe(slab.roughness);
        if ((slab.features & slab_second_lobe) != 0) {
            leaf.lobes[1] = lobe(slab.second_roughness);
            leaf.second_weight = slab.second_weight;
        }
        if ((slab.features & slab_fuzz) != 0) leaf.fuzz_amount = slab.fuzz_amount;
        for (int channel = 0; channel < 3; ++channel) {
            const double inner =
                leaf.has_interface
                    ? inner_mean(leaf.ior, [&](double cosine) { return leaf.reflectance(cosine)[channel]; })
                    : 0.0;
            // The authored albedo has the interface's part in it; this is that of the medium alone.
            const double albedo = slab.albedo[channel];
            const double alone = albedo / std::max(1.0 - inner + inner * albedo, 1e-12);
            leaf.single[channel] =
                library.scattering_albedo(library.medium_dissimilarity(alone), slab.phase_anisotropy);
        }
        leaf.scatters = largest(leaf.single) > 0.0;
        return leaf;
    }

    // Chooses anew in all of a subtree.
    void choose(NodeIndex index, std::vector<char>& choices, double view_cosine, Generator& random) const {
        const Node& node = tree.nodes[index];
        switch (node.kind) {
            case NodeKind::slab:
                choices[index] = uniform(random) < library.slab_coverage(leaves[index].slab, view_cosine);
                return;
            case NodeKind::mix:
            case NodeKind::coverage: choices[index] = uniform(random) < node.amount; break;
            case NodeKind::layer: break;
        }
        choose(node.first, choices, view_cosine, random);
        if (node.kind != NodeKind::coverage) choose(node.second, choices, view_cosine, random);
    }

    // Chooses anew in all that lies below a slab.
    void choose_below(NodeIndex index, std::vector<char>& choices, double view_cosine, Generator& random) const {
        while (index != tree.root) {
            const NodeIndex parent = parents[index];
            const Node& node = tree.nodes[parent];
            if (node.kind == NodeKind::layer && node.first == index) choose(node.second, choices, view_cosine, random);
            index = parent;
        }
    }

    // Slabs from the top down as they were chosen.
    void gather(NodeIndex index, const std::vector<char>& choices, Stack& stack) const {
        const Node& node = tree.nodes[index];
        switch (node.kind) {
            case NodeKind::slab:
                if (choices[index] != 0) stack.slabs[stack.size++] = index;
                return;
            case NodeKind::mix: gather(choices[index] != 0 ? node.second : node.first, choices, stack); return;
            case NodeKind::coverage:
                if (choices[index] != 0) gather(node.first, choices, stack);
                return;
            case NodeKind::layer:
                gather(node.first, choices, stack);
                gather(node.second, choices, stack);
                return;
        }
    }

    // Reflects or refracts at a (micro)normal on the side that `direction` comes from; returns whether it went through.
    static bool reflect_or_refract(const Leaf& leaf, bool outside, const glm::dvec3& normal, glm::dvec3& direction,
                                   Carried& light, Generator& random) {
        const double cosine = std::clamp(-glm::dot(direction, normal), 0.0, 1.0);
        const glm::dvec3 reflectance = leaf.reflectance(cosine, outside);
        const double probability = mean(reflectance);
        if (uniform(random) < probability) {
            light.value *= reflectance / probability;
            direction = glm::normalize(direction + 2.0 * cosine * normal);
            return false;
        }
        light.value *= (1.0 - reflectance) / (1.0 - probability);
        const double ratio = outside ? 1.0 / leaf.ior : leaf.ior;
        const double other = std::sqrt(std::max(1.0 - ratio * ratio * (1.0 - cosine * cosine), 0.0));
        direction = glm::normalize(ratio * direction + (ratio * cosine - other) * normal);
        return true;
    }

    // Light that comes to an interface leaves it on the one or the other side.
    static void meet_interface(const Leaf& leaf, bool& outside, glm::dvec3& direction, Carried& light,
                               Generator& random) {
        const Leaf::Lobe& lobe = leaf.lobes[leaf.second_weight > 0.0 && uniform(random) < leaf.second_weight ? 1 : 0];
        if (lobe.is_mirror) {
            if (reflect_or_refract(leaf, outside, {0.0, 0.0, outside ? 1.0 : -1.0}, direction, light, random))
                outside = !outside;
            return;
        }
        direction = turned(direction, leaf.rotation);
        // Share of the surface that lies deeper than the path, seen from the side that the path is on: 1 is free.
        double height = 1.0;
        for (int bounce = 0; bounce < longest_bounce; ++bounce) {
            const double side = outside ? 1.0 : -1.0;
            const glm::dvec3 seen = side * direction;
            // One over Smith's lambda, by the slope of the direction where the lobe is stretched to a sphere.
            const double slope =
                seen.z / std::max(std::hypot(lobe.alpha.x * seen.x, lobe.alpha.y * seen.y), smallest_stretch);
            const double root = std::sqrt(1.0 + slope * slope);
            const double inverse_lambda = slope >= 0.0 ? 2.0 * slope * (root + slope) : 2.0 * slope / (root - slope);
            height *= std::pow(1.0 - uniform(random), -inverse_lambda);
            if (seen.z > 0.0 && height >= 1.0) break;
            height = std::min(height, 1.0);
            const glm::dvec3 from = -seen;
            const double u = uniform(random), v = uniform(random);
            const glm::dvec3 normal =
                library.ggx_sample_normal(from, library.ggx_stretched_length(from, lobe.alpha), lobe.alpha, u, v);
            if (reflect_or_refract(leaf, outside, side * normal, direction, light, random)) {
                outside = !outside;
                height = 1.0 - height;
            }
        }
        direction = turned(direction, -leaf.rotation);
    }

    // Through a medium from `place` (0 its upper, 1 its lower end) to the next event. Returns whether it left.
    static bool cross_medium(const Leaf& leaf, double& place, glm::dvec3& direction, Carried& light,
                             Generator& random) {
        const double distance = (direction.z < 0.0 ? 1.0 - place : place) / std::max(std::abs(direction.z), 1e-12);
        if (!leaf.scatters) {
            light.value *= glm::exp(-leaf.depth * distance);
            return true;
        }
        const double extinction = leaf.depth[light.channel];
        const double reached =
            extinction > 0.0 ? -std::log(1.0 - uniform(random)) / extinction : std::numeric_limits<double>::infinity();
        const bool left = reached >= distance;
        // Divided by those of the channel that was drawn for, so that nothing underflows.
        const glm::dvec3 kept = glm::exp((extinction - leaf.depth) * (left ? distance : reached));
        light.value *= kept;
        light.density *= kept;
        if (left) return true;
        const glm::dvec3 denser = leaf.depth / extinction;
        light.value *= denser * leaf.single;
        light.density *= denser;
        place = std::clamp(place - reached * direction.z, 0.0, 1.0);
        direction = scattered(direction, leaf.slab.phase_anisotropy, random);
        return false;
    }

    WalkExit walk(const glm::dvec3& view, Generator& random) const {
        thread_local std::vector<char> choices;
        choices.assign(tree.nodes.size(), 1);
        Stack stack;
        if (has_choices) choose(tree.root, choices, view.z, random);
        gather(tree.root, choices, stack);

        Carried light;
        light.channel = std::min(static_cast<int>(3.0 * uniform(random)), 2);
        glm::dvec3 direction = -view;
        std::size_t at = 0;       // the slab that the path is in, or comes to where it is outside
        std::size_t deepest = 0;  // slabs from here on have not been met
        std::uint32_t ground_reflections = 0;
        const auto left = [&] {
            return WalkExit{
                .direction = direction, .weight = light.weight(), .ground_reflections = ground_reflections};
        };
        bool outside = true;
        double place = 0.0;
        for (std::uint32_t event = 0; event < desc.longest_path; ++event) {
            if (!survives(light, random)) return {};
            if (outside && direction.z > 0.0) {
                // Up from the interface of `at`.
                if (at == 0) return left();
                --at;
                outside = false;
                place = 1.0;
            } else if (outside) {
                if (desc.narrow_patches && has_choices && at > 0 && at < deepest) {
                    choose_below(stack.slabs[at - 1], choices, view.z, random);
                    stack.size = 0;
                    gather(tree.root, choices, stack);
                }
                deepest = std::max(deepest, at + 1);
                if (at == stack.size) return left();
                const Leaf& leaf = leaves[stack.slabs[at]];
                if (leaf.is_ground) {
                    if (!meet_ground(leaf, direction, light, random)) return {};
                    ++ground_reflections;
                    if (direction.z < 0.0) return left();
                } else {
                    if (meets_fuzz(leaf, -direction, random)) {
                        direction = fuzz_direction(leaf, -direction, light, random);
                        continue;
                    }
                    meet_leaf(leaf, outside, direction, light, random);
                    place = 0.0;
                }
            } else {
                const Leaf& leaf = leaves[stack.slabs[at]];
                if (!cross_medium(leaf, place, direction, light, random)) continue;
                if (direction.z < 0.0) {
                    ++at;
                    outside = true;
                } else {
                    meet_leaf(leaf, outside, direction, light, random);
                    place = 0.0;
                }
            }
        }
        return {.is_unfinished = true};
    }

    // Paths that leave upwards count by `share` of them.
    template <typename Share>
    [[nodiscard]] WalkAlbedo mean_of(const glm::dvec3& view, std::uint32_t paths, std::uint64_t seed,
                                     const Share& share) const {
        Generator random(seed);
        WalkAlbedo result;
        glm::dvec3 squares(0.0);
        for (std::uint32_t i = 0; i < paths; ++i) {
            const WalkExit path = walk(view, random);
            result.unfinished += path.is_unfinished ? 1.0 : 0.0;
            if (path.direction.z < 0.0) {
                result.transmitted += path.weight;
            } else if (path.direction.z > 0.0) {
                const glm::dvec3 counted = path.weight * share(path);
                result.reflected += counted;
                squares += counted * counted;
            }
        }
        const double count = std::max(paths, 2u);
        result.reflected /= count;
        result.transmitted /= count;
        result.unfinished /= count;
        const glm::dvec3 variance = glm::max(squares / count - result.reflected * result.reflected, glm::dvec3(0.0));
        result.uncertainty = 1.96 * glm::sqrt(variance / (count - 1.0));
        return result;
    }

  private:
    static constexpr int longest_bounce = 1000;
    static constexpr double smallest_stretch = 1e-12;

    // Russian roulette: light that carries little ends by chance, the rest carries its part.
    static bool survives(Carried& light, Generator& random) {
        const double carried = largest(light.weight());
        if (carried >= 0.1) return true;
        if (!(uniform(random) * 0.1 < carried)) return false;
        light.value *= 0.1 / carried;
        return true;
    }

    // The slab's own closure; false where the light ends.
    bool meet_ground(const Leaf& leaf, glm::dvec3& direction, Carried& light, Generator& random) const {
        const Library::Closure closure =
            library.prepare_closure(leaf.slab, turned(-direction, leaf.rotation), desc.footprint);
        const double x = uniform(random), y = uniform(random), z = uniform(random);
        const Library::ClosureSample sample = library.sample_closure(closure, {x, y, z});
        if (sample.pdf <= 0.0 || sample.direction.z == 0.0) return false;
        light.value *= sample.weight;
        direction = turned(sample.direction, -leaf.rotation);
        return true;
    }

    // By a direction away from the sheet, on either side of it.
    static bool meets_fuzz(const Leaf& leaf, const glm::dvec3& direction, Generator& random) {
        if (leaf.fuzz_amount <= 0.0) return false;
        const double cosine = std::min(std::abs(direction.z), 1.0);
        return uniform(random) < leaf.fuzz_amount * library.sheen_albedo(cosine, leaf.slab.fuzz_roughness);
    }

    // What the fuzz sends back to the side that `direction` is on.
    static glm::dvec3 fuzz_direction(const Leaf& leaf, const glm::dvec3& direction, Carried& light, Generator& random) {
        const double side = direction.z < 0.0 ? -1.0 : 1.0;
        const Library::SheenMap map =
            library.sheen_map({direction.x, direction.y, std::abs(direction.z)}, leaf.slab.fuzz_roughness);
        const double x = uniform(random), y = uniform(random);
        light.value *= leaf.slab.fuzz_color;
        glm::dvec3 sent = library.sheen_sample(map, x, y);
        sent.z *= side;
        return sent;
    }

    // The interface of a slab, from either side, with its fuzz seen from below.
    static void meet_leaf(const Leaf& leaf, bool& outside, glm::dvec3& direction, Carried& light, Generator& random) {
        for (int bounce = 0; bounce < longest_bounce; ++bounce) {
            if (leaf.has_interface)
                meet_interface(leaf, outside, direction, light, random);
            else
                outside = !outside;
            if (!outside || !meets_fuzz(leaf, -direction, random)) return;
            direction = fuzz_direction(leaf, -direction, light, random);
        }
    }
};

RandomWalk::RandomWalk(const FlattenedTree& tree, const RandomWalkDesc& desc)
    : model_(std::make_shared<const Model>(tree, desc)) {}

WalkExit RandomWalk::walk(const glm::dvec3& view, Generator& random) const { return model_->walk(view, random); }

WalkAlbedo RandomWalk::albedo(const glm::dvec3& view, std::uint32_t paths, std::uint64_t seed) const {
    return model_->mean_of(view, paths, seed, [](const WalkExit&) { return 1.0; });
}

WalkAlbedo RandomWalk::value(const glm::dvec3& view, const glm::dvec3& light, double cone, std::uint32_t paths,
                             std::uint64_t seed) const {
    const double edge = std::cos(cone);
    const double solid_angle = 2.0 * std::numbers::pi * (1.0 - edge);
    return model_->mean_of(view, paths, seed, [&](const WalkExit& path) {
        return glm::dot(path.direction, light) >= edge ? 1.0 / solid_angle : 0.0;
    });
}

bool RandomWalk::is_isotropic() const {
    return std::ranges::none_of(model_->leaves, [](const Model::Leaf& leaf) {
        return (leaf.slab.features & slab_anisotropy) != 0 && leaf.slab.anisotropy != 0.0;
    });
}

}  // namespace nacre::materials
