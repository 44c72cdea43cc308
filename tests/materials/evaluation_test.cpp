// SPDX-License-Identifier: Apache-2.0
#include "materials/evaluation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "materials/closures/lobes.h"
#include "materials/random_walk.h"
#include "tests/materials/random_tree.h"

namespace nacre::materials {
namespace {

constexpr double cosines[] = {1.0, 0.8, 0.5, 0.2, 0.05, 0.005};
constexpr std::uint32_t lobes = slab_anisotropy | slab_second_lobe | slab_fuzz | slab_f90 | slab_f82;

glm::dvec3 view_at(double cosine) { return {std::sqrt(1.0 - cosine * cosine), 0.0, cosine}; }

// White furnace: no tree sends out more than comes in.
TEST(TreeEnergy, NothingIsCreated) {
    std::mt19937 random(5);
    for (std::uint32_t i = 0; i < 500; ++i) {
        const Tree tree =
            random_tree(random, {.slabs = 1 + i % 6, .features = lobes | slab_medium | slab_edge_coverage});
        const auto flat = flatten(tree);
        ASSERT_TRUE(flat) << flat.error().message();
        for (const double cosine : cosines) {
            const glm::dvec3 albedo = directional_albedo(shade(*flat, view_at(cosine)));
            for (int channel = 0; channel < 3; ++channel) {
                ASSERT_GE(albedo[channel], 0.0);
                EXPECT_LE(albedo[channel], 1.001) << i << ": " << topology_text(flat->visible_tree) << " at " << cosine;
            }
        }
    }
}

// Where nothing absorbs, all light leaves again, however the slabs are stacked.
TEST(TreeEnergy, NothingIsLostWhereNothingAbsorbs) {
    std::mt19937 random(6);
    for (std::uint32_t i = 0; i < 500; ++i) {
        const Tree tree = random_tree(random, {.slabs = 1 + i % 6, .features = lobes, .is_lossless = true});
        const auto flat = flatten(tree);
        ASSERT_TRUE(flat) << flat.error().message();
        for (const double cosine : cosines) {
            const glm::dvec3 albedo = directional_albedo(shade(*flat, view_at(cosine)));
            for (int channel = 0; channel < 3; ++channel) {
                EXPECT_GE(albedo[channel], 0.98) << i << ": " << topology_text(flat->visible_tree) << " at " << cosine;
                EXPECT_LE(albedo[channel], 1.001) << i << ": " << topology_text(flat->visible_tree) << " at " << cosine;
            }
        }
    }
}

// The albedo is the integral of what is reflected, mirrors aside: over a grid of directions, for trees with tinted
// layers.
TEST(TreeEnergy, AlbedoIsTheIntegralOfTheLobes) {
    std::mt19937 random(7);
    constexpr int rings = 400, sectors = 200;
    for (std::uint32_t i = 0; i < 6; ++i) {
        Tree tree = random_tree(random, {.slabs = 1 + i % 3, .features = slab_medium | slab_fuzz});
        for (Node& node : tree.nodes) node.slab.roughness = std::max(node.slab.roughness, 0.4f);
        const auto flat = flatten(tree);
        ASSERT_TRUE(flat);
        for (const double cosine : {1.0, 0.5}) {
            const ShadedTree shaded = shade(*flat, view_at(cosine));
            glm::dvec3 integral(0.0);
            for (int ring = 0; ring < rings; ++ring) {
                const double z = (ring + 0.5) / rings, radius = std::sqrt(1.0 - z * z);
                for (int sector = 0; sector < sectors; ++sector) {
                    const double phi = 2.0 * 3.14159265358979 * (sector + 0.5) / sectors;
                    integral += reflected(shaded, {radius * std::cos(phi), radius * std::sin(phi), z});
                }
            }
            integral *= 2.0 * 3.14159265358979 / (rings * sectors);
            const glm::dvec3 albedo = directional_albedo(shaded, 48);
            for (int channel = 0; channel < 3; ++channel)
                EXPECT_NEAR(albedo[channel], integral[channel], 0.01 * integral[channel] + 2e-4)
                    << topology_text(flat->visible_tree);
        }
    }
}

// A coat that absorbs takes Beer-Lambert's share on the way in and on the way out, along refracted directions
// (index 1.5). The base is so dark that nothing comes twice.
TEST(TreeLayer, ATintedCoatTakesWhatItsMediumTakes) {
    constexpr double mean_free_path = 2e-3, thickness = 1e-3;
    for (const double cos_view : {1.0, 0.5}) {
        for (const double cos_light : {1.0, 0.3}) {
            const auto seen = [&](float path) {
                Tree tree{.name = "coat"};
                const NodeIndex base = tree.add(Slab{.f0 = glm::vec3(0.0f), .albedo = glm::vec3(1e-4f)});
                Slab coat{.f0 = glm::vec3(0.04f), .roughness = 0.3f, .albedo = glm::vec3(0.0f)};
                coat.features = slab_medium;
                coat.mean_free_path = glm::vec3(path);
                tree.layer(tree.add(coat), base, thickness);
                const auto flat = flatten(tree);
                const ShadedTree shaded = shade(*flat, view_at(cos_view));
                // Only what comes from the base.
                const ShadedClosure& below = shaded.closures[1];
                closures::Library library;
                const glm::dvec3 light = {0.0, std::sqrt(1.0 - cos_light * cos_light), cos_light};
                return library.evaluate_closure(below.closure, light).diffuse.x * below.path.weight.x *
                       library.top_transmittance(below.path, cos_light).x;
            };
            const auto refracted = [](double cosine) { return std::sqrt(1.0 - (1.0 - cosine * cosine) / 2.25); };
            const double expected =
                std::exp(-thickness / mean_free_path * (1.0 / refracted(cos_view) + 1.0 / refracted(cos_light)));
            const double clear = seen(std::numeric_limits<float>::infinity());
            EXPECT_NEAR(seen(static_cast<float>(mean_free_path)) / clear, expected, 2e-3 * expected)
                << cos_view << " " << cos_light;
        }
    }
}

// A half covering top leaves the base on the other half untouched: light and view pass at the same place.
TEST(TreeLayer, UncoveredPartsAreNotTinted) {
    Tree tree{.name = "half"};
    const NodeIndex base = tree.add(Slab{.f0 = glm::vec3(0.0f), .albedo = glm::vec3(0.5f)});
    const NodeIndex paint = tree.add(Slab{.f0 = glm::vec3(0.04f), .albedo = glm::vec3(0.0f)});
    tree.layer(tree.coverage(paint, 0.5f), base);
    const glm::dvec3 light(0.0, 0.6, 0.8);
    const ShadedTree shaded = shade(*flatten(tree), view_at(0.7));
    closures::Library library;
    const ShadedClosure& below = shaded.closures[1];
    EXPECT_NEAR(below.path.weight.x * library.top_transmittance(below.path, light.z).x, 0.5, 1e-6);
    EXPECT_NEAR(shaded.whole.coverage, 1.0, 1e-12);
    EXPECT_NEAR(shaded.top.coverage, 0.5, 1e-12);
}

// Without what is thrown back between both, a clear coat over a gray base would be far too bright: (1 - K) / (1 - E K).
TEST(TreeLayer, ACoatDarkensWhatIsBelow) {
    Tree tree{.name = "coat"};
    const NodeIndex base = tree.add(Slab{.f0 = glm::vec3(0.0f), .albedo = glm::vec3(0.5f)});
    Slab coat{.f0 = glm::vec3(0.04f), .roughness = 0.1f, .albedo = glm::vec3(0.0f)};
    coat.features = slab_medium;
    coat.mean_free_path = glm::vec3(std::numeric_limits<float>::infinity());
    tree.layer(tree.add(coat), base);
    const ShadedTree shaded = shade(*flatten(tree), view_at(1.0));
    // Schlick's mean reflectance from above, and the share of the diffuse light inside that leaves through an index
    // of 1.5.
    const double mean = 0.04 + 0.96 / 21.0, internal = 1.0 - (1.0 - mean) / 2.25;
    const double expected = (1.0 - 0.04) * 0.5 * (1.0 - internal) / (1.0 - 0.5 * internal);
    const ShadedClosure& below = shaded.closures[1];
    EXPECT_NEAR(below.path.weight.x * 0.5, expected, 2e-3);
}

// Mixing with 0 or 1 is the one or the other, and half of two equal slabs is that slab.
TEST(TreeMix, EndsAndEqualHalves) {
    const Slab a{.f0 = glm::vec3(0.3f), .roughness = 0.4f}, b{.roughness = 0.8f, .albedo = {0.2f, 0.4f, 0.6f}};
    const glm::dvec3 light(0.0, 0.6, 0.8);
    const auto seen = [&](const Slab& first, const Slab& second, float amount, bool blended) {
        Tree tree{.name = "mix"};
        const NodeIndex x = tree.add(first), y = tree.add(second);
        tree.nodes[tree.mix(x, y, amount)].parameter_blend = blended;
        return reflected(shade(*flatten(tree), view_at(0.6)), light);
    };
    Tree alone{.name = "alone"};
    alone.add(b);
    const glm::dvec3 expected = reflected(shade(*flatten(alone), view_at(0.6)), light);
    for (const bool blended : {false, true}) {
        for (int channel = 0; channel < 3; ++channel) {
            EXPECT_NEAR(seen(a, b, 1.0f, blended)[channel], expected[channel], 1e-9);
            EXPECT_NEAR(seen(b, a, 0.0f, blended)[channel], expected[channel], 1e-9);
            EXPECT_NEAR(seen(b, b, 0.5f, blended)[channel], expected[channel], 1e-9);
        }
    }
    const glm::dvec3 half = seen(a, b, 0.5f, false), sum = 0.5 * (seen(a, a, 0.0f, false) + expected);
    EXPECT_NEAR(half.x, sum.x, 1e-9);
}

// A clear coat over a metal.
FlattenedTree coated_metal(float coat_roughness, float roughness) {
    Tree tree{.name = "coated metal"};
    const NodeIndex metal = tree.add(Slab{.f0 = glm::vec3(0.9f), .roughness = roughness, .albedo = glm::vec3(0.0f)});
    Slab coat{.roughness = coat_roughness, .albedo = glm::vec3(0.0f)};
    coat.features = slab_medium;
    coat.mean_free_path = glm::vec3(std::numeric_limits<float>::infinity());
    tree.layer(tree.add(coat), metal);
    return *flatten(tree);
}

// A rough top makes what is below rougher, and only as much as it covers; a smooth one leaves the roughness as it is.
TEST(TreeLayer, RoughnessIsTracked) {
    const auto below = [](float top_roughness, float coverage) {
        Tree tree{.name = "tracked"};
        const NodeIndex base = tree.add(Slab{.f0 = glm::vec3(0.9f), .roughness = 0.2f, .albedo = glm::vec3(0.0f)});
        Slab coat{.roughness = top_roughness, .albedo = glm::vec3(0.0f)};
        coat.features = slab_medium;
        coat.coverage = coverage;
        coat.mean_free_path = glm::vec3(1.0f);
        tree.layer(tree.add(coat), base);
        return shade(*flatten(tree), view_at(1.0)).closures[1].slab.roughness;
    };
    EXPECT_NEAR(below(0.0f, 1.0f), 0.2, 1e-6);
    EXPECT_GT(below(0.6f, 1.0f), below(0.0f, 1.0f) + 0.02);
    EXPECT_GT(below(0.9f, 1.0f), below(0.6f, 1.0f));
    EXPECT_LT(below(0.6f, 0.5f), below(0.6f, 1.0f));
    EXPECT_NEAR(below(0.6f, 1e-6f), 0.2, 1e-4);
}

// Mean and spread of what leaves, in the plane of incidence (x) and across it (y).
struct LobeShape {
    double light = 0.0, mean = 0.0, along = 0.0, across = 0.0;

    void add(const glm::dvec3& direction, double weight) {
        light += weight;
        mean += weight * direction.x;
        along += weight * direction.x * direction.x;
        across += weight * direction.y * direction.y;
    }
    void finish() {
        mean /= light;
        along = std::sqrt(along / light - mean * mean);
        across = std::sqrt(across / light);
    }
};

// A lobe under a coat is wider outside, wider along the plane of incidence than across it, and ends where the coat
// reflects all: what passes the coat once, against the walk's paths that met the metal once.
TEST(TreeLayer, LobesBelowACoatAreRefracted) {
    closures::Lobes lobes;
    for (const float roughness : {0.2f, 0.35f, 0.6f}) {
        const FlattenedTree flat = coated_metal(0.0f, roughness);
        const RandomWalk walk(flat);
        for (const double cosine : {1.0, 0.7, 0.4}) {
            RandomWalk::Generator random(1);
            LobeShape walked, shaded;
            for (int i = 0; i < 60'000; ++i) {
                const WalkExit path = walk.walk(view_at(cosine), random);
                if (path.ground_reflections == 1) walked.add(path.direction, path.weight.x);
            }
            walked.finish();
            closures::Library::Closure once = shade(flat, view_at(cosine)).closures[1].closure;
            once.again = closures::Library().scaled_lobe(once.again, glm::dvec3(0.0));
            once.ring = glm::dvec3(0.0);
            constexpr int rings = 250, sectors = 200;
            for (int i = 0; i < rings * sectors; ++i) {
                const double z = (i / sectors + 0.5) / rings, radius = std::sqrt(1.0 - z * z);
                const double phi = 2.0 * lobes.pi * (i % sectors + 0.5) / sectors;
                const glm::dvec3 light(radius * std::cos(phi), radius * std::sin(phi), z);
                shaded.add(light, closures::Library().evaluate_closure(once, light).specular.x);
            }
            shaded.finish();
            EXPECT_NEAR(shaded.mean, walked.mean, 0.01) << roughness << " at " << cosine;
            EXPECT_NEAR(shaded.along, walked.along, 0.03 * walked.along) << roughness << " at " << cosine;
            EXPECT_NEAR(shaded.across, walked.across, 0.03 * walked.across) << roughness << " at " << cosine;
        }
    }
}

// Light towards the normal by the cosine it comes at, in rings of equal steps: of the walk, and of the closures.
struct Rings {
    static constexpr int count = 4;
    std::array<double, count> walked{}, shaded{};
};

Rings rings_of(const FlattenedTree& flat) {
    closures::Lobes lobes;
    Rings rings;
    constexpr int paths = 300'000, steps = 4000;
    const RandomWalk walk(flat);
    RandomWalk::Generator random(1);
    for (int i = 0; i < paths; ++i) {
        const WalkExit path = walk.walk(view_at(1.0), random);
        if (path.direction.z > 0.0)
            rings.walked[std::min(static_cast<int>(path.direction.z * Rings::count), Rings::count - 1)] +=
                path.weight.x / paths;
    }
    const ShadedTree shaded = shade(flat, view_at(1.0));
    for (int i = 0; i < steps; ++i) {
        const double cosine = (i + 0.5) / steps;
        rings.shaded[i * Rings::count / steps] +=
            2.0 * lobes.pi / steps * reflected(shaded, {std::sqrt(1.0 - cosine * cosine), 0.0, cosine}).x;
    }
    return rings;
}

FlattenedTree dusty(const Slab& base) {
    Tree tree{.name = "dusty"};
    Slab dust{.f0 = glm::vec3(0.0f), .albedo = glm::vec3(0.5f)};
    dust.features = slab_medium;
    dust.thickness = 1e-3f;
    dust.mean_free_path = glm::vec3(1e-3f / 0.3f);
    const NodeIndex ground = tree.add(base);
    tree.layer(tree.add(dust), ground);
    return *flatten(tree);
}

// A thin medium scatters more along the surface than Lambert's law has it (which gives the last ring seven times the
// light of the first).
TEST(TreeLayer, ThinMediaScatterAlongTheSurface) {
    const Rings rings = rings_of(dusty({.f0 = glm::vec3(0.0f), .albedo = glm::vec3(0.0f)}));
    EXPECT_LT(rings.walked[3], 3.0 * rings.walked[0]);
    for (int i = 0; i < Rings::count; ++i)
        EXPECT_NEAR(rings.shaded[i], rings.walked[i], 0.1 * rings.walked[i]) << i;
}

// What a lobe sends through dust goes straight or is scattered, each by its own share.
TEST(TreeLayer, DustScattersWhatALobeSends) {
    const Rings rings =
        rings_of(dusty({.f0 = glm::vec3(0.9f), .roughness = 0.3f, .albedo = glm::vec3(0.0f)}));
    for (int i = 0; i < Rings::count; ++i)
        EXPECT_NEAR(rings.shaded[i], rings.walked[i], (i == 3 ? 0.02 : 0.15) * rings.walked[i]) << i;
}

}  // namespace
}  // namespace nacre::materials
