// SPDX-License-Identifier: Apache-2.0
#include "materials/building_blocks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "materials/conversions.h"
#include "materials/evaluation.h"

namespace nacre::materials {
namespace {

template <typename Block>
Tree tree_of_block(const Block& block) {
    Tree tree{.name = "block"};
    add(tree, block);
    return tree;
}

glm::dvec3 view_at(double cosine) { return {std::sqrt(1.0 - cosine * cosine), 0.0, cosine}; }

ShadedTree shaded(const Tree& tree, double cosine) {
    const auto flat = flatten(tree);
    EXPECT_TRUE(flat) << flat.error().message();
    return flat ? shade(*flat, view_at(cosine)) : ShadedTree{};
}

// What two trees send to the view agrees for views and lights.
void expect_equal(const Tree& a, const Tree& b, double tolerance = 1e-6) {
    for (const double cosine : {1.0, 0.5, 0.1}) {
        const ShadedTree x = shaded(a, cosine), y = shaded(b, cosine);
        EXPECT_EQ(x.closures.size(), y.closures.size());
        for (const glm::dvec3& light : {glm::dvec3(0, 0, 1), glm::dvec3(-0.6, 0, 0.8), glm::dvec3(0, 0.96, 0.28)}) {
            const glm::dvec3 u = reflected(x, light), v = reflected(y, light);
            for (int channel = 0; channel < 3; ++channel)
                EXPECT_NEAR(u[channel], v[channel], tolerance * (1.0 + v[channel]));
        }
    }
}

TEST(BuildingBlocks, DefaultLitEndsInDielectricAndMetal) {
    const glm::vec3 color(0.8f, 0.3f, 0.1f);
    Tree dielectric{.name = "dielectric"}, metal{.name = "metal"};
    dielectric.add({.f0 = glm::vec3(0.04f), .roughness = 0.3f, .albedo = color});
    metal.add({.f0 = color, .roughness = 0.3f, .albedo = glm::vec3(0.0f)});
    expect_equal(tree_of_block(DefaultLit{.base_color = color, .metallic = 0.0f, .roughness = 0.3f}), dielectric);
    expect_equal(tree_of_block(DefaultLit{.base_color = color, .metallic = 1.0f, .roughness = 0.3f}), metal);
    EXPECT_EQ(shaded(dielectric, 1.0).closures.size(), 1u);
    // Between both it is one slab: the one that metalness becomes without its halo.
    const AlbedoAndF0 both = metalness_to_albedo_f0(color, 0.4f);
    const ShadedTree between =
        shaded(tree_of_block(DefaultLit{.base_color = color, .metallic = 0.4f, .roughness = 0.3f}), 1.0);
    ASSERT_EQ(between.closures.size(), 1u);
    for (int channel = 0; channel < 3; ++channel) {
        EXPECT_NEAR(between.closures[0].slab.f0[channel], both.f0[channel], 1e-6);
        EXPECT_NEAR(between.closures[0].slab.albedo[channel], both.albedo[channel], 1e-6);
    }
}

TEST(BuildingBlocks, PrincipledWithNothingElseIsDefaultLit) {
    std::mt19937 random(1);
    const auto uniform = [&] { return std::uniform_real_distribution<float>(0.0f, 1.0f)(random); };
    for (int i = 0; i < 50; ++i) {
        const glm::vec3 color(uniform(), uniform(), uniform());
        const float metallic = i % 3 == 0 ? 0.0f : uniform(), specular = uniform(), roughness = uniform();
        expect_equal(tree_of_block(Principled{.base_color = color,
                                              .metallic = metallic,
                                              .specular = specular,
                                              .roughness = roughness,
                                              .sheen_tint = 0.0f}),
                     tree_of_block(DefaultLit{
                         .base_color = color, .metallic = metallic, .specular = specular, .roughness = roughness}));
    }
    expect_equal(
        tree_of_block(Principled{.base_color = glm::vec3(0.0f), .metallic = 0.0f, .specular = 0.0f, .roughness = 0.0f}),
        tree_of_block(
            DefaultLit{.base_color = glm::vec3(0.0f), .metallic = 0.0f, .specular = 0.0f, .roughness = 0.0f}));
}

// The standard surface with index 1.5 and no weights but the base's is the same dielectric or metal.
TEST(BuildingBlocks, StandardSurfaceHasTheSameBase) {
    const glm::vec3 color(0.7f, 0.5f, 0.2f);
    for (const float metalness : {0.0f, 0.5f, 1.0f}) {
        expect_equal(tree_of_block(
                         StandardSurface{.base_color = color, .base_metalness = metalness, .specular_roughness = 0.4f}),
                     tree_of_block(DefaultLit{.base_color = color, .metallic = metalness, .roughness = 0.4f}));
    }
    // Weights scale, colors tint.
    const ShadedTree dim = shaded(tree_of_block(StandardSurface{.base_weight = 0.5f,
                                                                .base_color = color,
                                                                .specular_weight = 0.5f,
                                                                .specular_color = {{1.0f, 0.5f, 0.25f}}}),
                                  1.0);
    for (int channel = 0; channel < 3; ++channel) {
        EXPECT_NEAR(dim.closures[0].slab.albedo[channel], 0.5 * color[channel], 1e-6);
        EXPECT_NEAR(dim.closures[0].slab.f0[channel], 0.04 * std::pow(0.5, channel + 1), 1e-7);
    }
}

// Both widths of a stretched lobe are those that each model defines.
TEST(BuildingBlocks, AnisotropyIsConvertedByWidths) {
    closures::Library library;
    for (const float roughness : {0.2f, 0.5f}) {
        for (const float amount : {0.3f, 0.8f}) {
            const double alpha = double(roughness) * roughness;
            const auto widths = [&](const Tree& tree) {
                const auto slab = shaded(tree, 1.0).closures[0].slab;
                EXPECT_NE(slab.features & slab_anisotropy, 0u);
                return library.ggx_alpha(slab.roughness, slab.anisotropy);
            };
            const double aspect = std::sqrt(1.0 - 0.9 * amount);
            const glm::dvec2 disney = widths(tree_of_block(Principled{.roughness = roughness, .anisotropic = amount}));
            EXPECT_NEAR(disney.x, std::min(alpha / aspect, 1.0), 1e-6);
            EXPECT_NEAR(disney.y, alpha * aspect, 1e-6);
            const double narrow = 1.0 - amount, along = alpha * std::sqrt(2.0 / (1.0 + narrow * narrow));
            const glm::dvec2 standard = widths(tree_of_block(
                StandardSurface{.specular_roughness = roughness, .specular_roughness_anisotropy = amount}));
            EXPECT_NEAR(standard.x, along, 1e-6);
            EXPECT_NEAR(standard.y, along * narrow, 1e-6);
        }
    }
}

// Crossed twice along the normal, a coat has its color.
TEST(BuildingBlocks, CoatsTintWhatLiesBelow) {
    const glm::vec3 color(0.9f, 0.3f, 0.05f);
    Tree tree{.name = "coated"};
    const NodeIndex base = add(tree, DefaultLit{.base_color = glm::vec3(0.8f)});
    add(tree, CoatedLayer{.coat_color = color, .coat_ior = 1.3f}, base);
    const auto flat = flatten(tree);
    ASSERT_TRUE(flat);
    const Slab* coat = nullptr;
    for (const TopologyClosure& closure : flat->topology.closures) {
        if (closure.is_top) coat = &flat->visible_tree.nodes[closure.node].slab;
    }
    ASSERT_NE(coat, nullptr);
    const glm::vec3 once = mean_free_path_to_transmittance(coat->mean_free_path, coat->thickness);
    for (int channel = 0; channel < 3; ++channel) EXPECT_NEAR(once[channel] * once[channel], color[channel], 1e-6);
    EXPECT_NEAR(coat->f0.x, std::pow(0.3 / 2.3, 2.0), 1e-7);
    EXPECT_EQ(topology_text(tree), "layer(colored coat, dielectric)");
    EXPECT_EQ(topology_text(tree_of_block(ClearCoat{.clear_coat = 0.5f})), "layer(coverage(clear coat), dielectric)");
    EXPECT_EQ(topology_text(tree_of_block(ClearCoat{.clear_coat = 0.0f})), "dielectric");
}

TEST(BuildingBlocks, GlassHasItsColorAtItsDepth) {
    const Tree tree = tree_of_block(StandardSurface{.transmission_weight = 1.0f,
                                                    .transmission_color = {0.25f, 0.5f, 1.0f},
                                                    .transmission_depth = 0.02f,
                                                    .geometry_thickness = 0.01f});
    EXPECT_EQ(topology_text(tree), "clear");
    const Slab& slab = tree.nodes[tree.root].slab;
    const glm::vec3 through = mean_free_path_to_transmittance(slab.mean_free_path, 0.02f);
    EXPECT_NEAR(through.x, 0.25f, 1e-6f);
    EXPECT_NEAR(through.y, 0.5f, 1e-6f);
    EXPECT_EQ(through.z, 1.0f);
    EXPECT_EQ(slab.albedo, glm::vec3(0.0f));
    EXPECT_EQ(slab.thickness, 0.01f);
    // Milk glass: what scatters cannot be more than what is taken from the beam.
    const Tree milk = tree_of_block(StandardSurface{.transmission_weight = 1.0f,
                                                    .transmission_color = glm::vec3(0.5f),
                                                    .transmission_depth = 0.02f,
                                                    .transmission_scatter = {0.3f, 1.0f, 0.0f}});
    const Slab& scattering = milk.nodes[milk.root].slab;
    EXPECT_NEAR(scattering.mean_free_path.x, 0.02f / std::log(2.0f), 1e-6f);
    EXPECT_NEAR(scattering.mean_free_path.y, 0.02f, 1e-6f) << "all of it scatters";
    EXPECT_NEAR(scattering.albedo.y, 1.0f, 1e-5f);
    EXPECT_GT(scattering.albedo.x, 0.0f);
    EXPECT_EQ(scattering.albedo.z, 0.0f);
}

// Fibers lie on the coat, not below it.
TEST(BuildingBlocks, FibersLieOnTop) {
    EXPECT_EQ(topology_text(tree_of_block(Principled{.sheen = 0.5f, .clearcoat = 1.0f})),
              "layer(fuzz, layer(clear coat, dielectric))");
    EXPECT_EQ(topology_text(tree_of_block(Principled{.sheen = 0.5f})), "dielectric");
    EXPECT_EQ(shaded(tree_of_block(Cloth{}), 1.0).closures[0].slab.features, slab_fuzz);
}

TEST(BuildingBlocks, UnlitOnlyEmits) {
    const Tree tree = tree_of_block(Unlit{.emission = {{1.0f, 2.0f, 3.0f}}, .opacity = 0.5f});
    const ShadedTree result = shaded(tree, 0.5);
    EXPECT_EQ(directional_albedo(result), glm::dvec3(0.0));
    EXPECT_EQ(result.closures[0].slab.emission, glm::dvec3(1.0, 2.0, 3.0));
    EXPECT_EQ(tree.nodes[tree.root].amount, 0.5f);
}

// Textures go where their input goes.
TEST(BuildingBlocks, TexturesFollowTheirInputs) {
    const auto input = [](int image) { return TextureInput{.texture = {.image = image, .sampler = 0}, .channel = 1}; };
    const auto color = [](int image) { return TextureInput{.texture = {.image = image, .sampler = 0}}; };
    const Tree tree = tree_of_block(ClearCoat{.base = {.base_color = {glm::vec3(0.5f), color(0)},
                                                       .metallic = {0.5f, input(1)},
                                                       .specular = {0.5f, input(2)},
                                                       .roughness = {0.5f, input(3)},
                                                       .emission = {glm::vec3(1.0f), color(4)},
                                                       .opacity = {1.0f, input(5)}},
                                              .clear_coat = {1.0f, input(6)},
                                              .clear_coat_roughness = {0.1f, input(7)}});
    ASSERT_TRUE(validate(tree)) << validate(tree).error().message();
    std::vector<std::string> found;
    for (const Node& node : tree.nodes) {
        for (const TextureInput& texture : node.textures)
            found.push_back((node.name.empty() ? std::string(name_of(node.kind)) : node.name) + "." + texture.field +
                            " " + std::to_string(texture.texture.image) + (texture.gray ? " gray" : ""));
    }
    std::ranges::sort(found);
    EXPECT_EQ(found, (std::vector<std::string>{"clear coat.roughness 7", "coverage.amount 5", "coverage.amount 6",
                                               "dielectric.albedo 0", "dielectric.emission 4", "dielectric.f0 2 gray",
                                               "dielectric.roughness 3", "metal.emission 4", "metal.f0 0",
                                               "metal.roughness 3", "mix.amount 1"}));
}

// Any parameters at all: a valid tree that never sends out more than comes in.
TEST(BuildingBlocks, NothingIsCreated) {
    std::mt19937 random(9);
    const auto uniform = [&] { return std::uniform_real_distribution<float>(0.0f, 1.0f)(random); };
    for (const BuildingBlock& block : building_blocks()) {
        double brightest = 0.0;
        for (int i = 0; i < 60; ++i) {
            std::vector<BlockValue> values = block.defaults;
            for (std::size_t input = 0; input < values.size(); ++input) {
                const BlockInput& what = block.inputs[input];
                // Ends of ranges, all of them now and then, and everything between.
                const float high = std::isinf(what.maximum) ? (what.minimum >= 1.0f ? 3.0f : 0.02f) : what.maximum;
                for (int channel = 0; channel < 3; ++channel) {
                    const float r = uniform();
                    values[input].value[channel] = r < 0.2f   ? what.minimum
                                                   : r < 0.4f ? high
                                                              : what.minimum + uniform() * (high - what.minimum);
                }
                if (what.name.find("emission") != std::string_view::npos) values[input].value = glm::vec3(0.0f);
            }
            Tree tree{.name = std::string(block.name)};
            const NodeIndex base = block.has_base ? add(tree, DefaultLit{.base_color = glm::vec3(1.0f)}) : 0;
            block.add(tree, values, base);
            ASSERT_TRUE(validate(tree)) << validate(tree).error().message();
            for (const double cosine : {1.0, 0.6, 0.1, 0.01}) {
                const glm::dvec3 albedo = directional_albedo(shaded(tree, cosine), 12);
                for (int channel = 0; channel < 3; ++channel) {
                    EXPECT_GE(albedo[channel], 0.0);
                    EXPECT_LE(albedo[channel], 1.001)
                        << block.name << " " << i << " at " << cosine << ": " << topology_text(tree);
                    brightest = std::max(brightest, albedo[channel]);
                }
            }
        }
        if (block.name != "unlit") {
            EXPECT_GT(brightest, 0.5) << block.name;
        }
    }
}

// What is out of range is brought into it.
TEST(BuildingBlocks, AnyNumberMakesAValidTree) {
    for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity(), -1.0f, 1e30f, 2.0f}) {
        for (const BuildingBlock& block : building_blocks()) {
            std::vector<BlockValue> values = block.defaults;
            for (BlockValue& value : values) value.value = glm::vec3(bad);
            Tree tree{.name = std::string(block.name)};
            const NodeIndex base = block.has_base ? add(tree, DefaultLit{}) : 0;
            block.add(tree, values, base);
            const auto valid = validate(tree);
            EXPECT_TRUE(valid) << bad << ": " << valid.error().message();
        }
    }
}

}  // namespace
}  // namespace nacre::materials
