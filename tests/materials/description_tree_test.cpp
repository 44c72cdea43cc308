// SPDX-License-Identifier: Apache-2.0
#include "materials/description_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "materials/evaluation.h"

namespace nacre::materials {
namespace {

FlattenedTree flat(const MaterialDescription& material) {
    auto result = flatten(tree_of(material));
    EXPECT_TRUE(result) << result.error().message();
    return result ? *result : FlattenedTree{};
}

const Slab& only_slab(const FlattenedTree& tree) {
    EXPECT_EQ(tree.topology.closures.size(), 1u);
    return tree.visible_tree.nodes[tree.topology.closures[0].node].slab;
}

TEST(DescriptionTree, MetalAndDielectric) {
    MaterialDescription material{.name = "plain"};
    material.base_color = {0.8f, 0.4f, 0.2f, 1.0f};
    material.roughness = 0.3f;
    material.metallic = 0.0f;
    material.ior = 1.5f;
    const FlattenedTree plastic = flat(material);
    EXPECT_NEAR(only_slab(plastic).f0.x, 0.04f, 1e-6f);
    EXPECT_EQ(only_slab(plastic).albedo, glm::vec3(0.8f, 0.4f, 0.2f));
    material.metallic = 1.0f;
    const FlattenedTree metal = flat(material);
    EXPECT_EQ(only_slab(metal).f0, glm::vec3(0.8f, 0.4f, 0.2f));
    EXPECT_EQ(only_slab(metal).albedo, glm::vec3(0.0f));
    // In between one closure stands for both: its medium gets less light and sends out what half of the dielectric's
    // does.
    material.metallic = 0.5f;
    const FlattenedTree between = flat(material);
    ASSERT_EQ(between.topology.closures.size(), 1u);
    const ShadedTree shaded = shade(between, {0.0, 0.0, 1.0});
    EXPECT_NEAR(shaded.closures[0].slab.f0.x, 0.5 * (0.04 + 0.8), 1e-6);
    EXPECT_NEAR(shaded.closures[0].slab.albedo.x, 0.5 * 0.8 * (1.0 - 0.04) / (1.0 - 0.5 * (0.04 + 0.8)), 1e-6);
}

// KHR_materials_specular: the color tints F0, the factor and its texture scale the whole curve.
TEST(DescriptionTree, SpecularIsAWeightWithATexture) {
    MaterialDescription material{.name = "satin"};
    material.metallic = 0.0f;
    material.specular = Specular{.factor = 0.5f, .color = {1.0f, 0.5f, 30.0f}};
    const FlattenedTree plain = flat(material);
    EXPECT_NEAR(only_slab(plain).f0.y, 0.02f, 1e-6f);
    EXPECT_EQ(only_slab(plain).f0.z, 1.0f) << "what is above 1 is cut before it is scaled";
    EXPECT_EQ(only_slab(plain).specular_weight, 0.5f);
    material.specular = Specular{.factor = 1.0f};
    EXPECT_EQ(only_slab(flat(material)).features, 0u) << "a whole interface is one without features";
    material.specular->texture = {.image = 3, .sampler = 0};
    material.specular->color_texture = {.image = 4, .sampler = 0};
    const Tree tree = tree_of(material);
    const auto texture = [&](std::string_view field) {
        const auto& textures = tree.nodes[tree.root].textures;
        const auto found = std::ranges::find(textures, field, &TextureInput::field);
        return found == textures.end() ? TextureInput{} : *found;
    };
    EXPECT_EQ(texture("specular_weight").texture.image, 3);
    EXPECT_EQ(texture("specular_weight").channel, 3u);
    EXPECT_EQ(texture("f0").texture.image, 4);
    // Without the feature, F0 keeps the factor.
    material.specular = Specular{.factor = 0.5f};
    const auto dropped = flatten(tree_of(material), {.dropped_features = slab_f90});
    ASSERT_TRUE(dropped);
    EXPECT_NEAR(only_slab(*dropped).f0.x, 0.02f, 1e-6f);
}

// Both widths of the lobe are those of glTF's definition, alpha_t = mix(alpha, 1, strength^2) and alpha_b = alpha.
TEST(DescriptionTree, AnisotropyIsConvertedByWidths) {
    for (const float roughness : {0.1f, 0.5f, 1.0f}) {
        for (const float strength : {0.25f, 0.7f, 1.0f}) {
            MaterialDescription material{.name = "brushed"};
            material.roughness = roughness;
            material.anisotropy = Anisotropy{.strength = strength, .rotation = 0.5f};
            const FlattenedTree tree = flat(material);
            const Slab& slab = only_slab(tree);
            closures::Library library;
            const glm::dvec2 alpha = library.ggx_alpha(slab.roughness, slab.anisotropy);
            const double own = roughness * roughness;
            EXPECT_NEAR(alpha.x, own + (1.0 - own) * strength * strength, 1e-5);
            EXPECT_NEAR(alpha.y, own, 1e-5);
            EXPECT_EQ(tree.visible_tree.frames[0].rotation, 0.5f);
        }
    }
}

TEST(DescriptionTree, ExtensionsBecomeSlabsAndOperators) {
    MaterialDescription material{.name = "all"};
    material.metallic = 0.0f;
    material.base_color = {0.5f, 0.5f, 0.5f, 0.75f};
    material.alpha_mode = AlphaMode::blend;
    material.clearcoat = Clearcoat{.factor = 0.5f, .roughness = 0.1f};
    material.sheen = Sheen{.color = {0.4f, 0.2f, 0.1f}, .roughness = 0.6f};
    material.iridescence = Iridescence{.factor = 1.0f, .ior = 1.4f, .thickness_maximum = 350e-9f};
    material.transmission = Transmission{.factor = 0.25f};
    material.volume =
        Volume{.thickness = 0.01f, .attenuation_distance = 0.02f, .attenuation_color = {0.5f, 1.0f, 0.0f}};
    material.emissive = {1.0f, 2.0f, 3.0f};
    material.emissive_strength = 2.0f;
    const FlattenedTree tree = flat(material);
    EXPECT_EQ(topology_text(tree.visible_tree), "coverage(layer(coverage(clear coat), mix(dielectric, transmissive)))");
    ASSERT_EQ(tree.topology.closures.size(), 3u);
    const Slab& dielectric = tree.visible_tree.nodes[tree.topology.closures[1].node].slab;
    EXPECT_FLOAT_EQ(dielectric.fuzz_amount, 0.4f);
    EXPECT_FLOAT_EQ(dielectric.fuzz_color.y, 0.5f);
    EXPECT_FLOAT_EQ(dielectric.film_thickness, 350e-9f);
    EXPECT_EQ(dielectric.emission, glm::vec3(2.0f, 4.0f, 6.0f));
    const Slab& glass = tree.visible_tree.nodes[tree.topology.closures[2].node].slab;
    // Half of the red is left after 0.02 m.
    EXPECT_NEAR(std::exp(-0.02 / glass.mean_free_path.x), 0.5, 1e-5);
    EXPECT_GT(glass.mean_free_path.y, 1e11f);
    EXPECT_EQ(glass.mean_free_path.z, 0.0f);
    EXPECT_NEAR(shade(tree, {0.0, 0.0, 1.0}).whole.coverage, 0.75, 1e-6);
}

TEST(DescriptionTree, TexturesAreWhereTheyBelong) {
    const TextureReference texture{.image = 4, .sampler = 0};
    MaterialDescription material{.name = "textured"};
    material.base_color_texture = texture;
    material.metallic_roughness_texture = texture;
    material.normal_texture = texture;
    material.clearcoat =
        Clearcoat{.factor = 1.0f, .texture = texture, .roughness_texture = texture, .normal_texture = texture};
    const Tree tree = tree_of(material);
    EXPECT_TRUE(validate(tree));
    EXPECT_TRUE(tree.frames[0].normal_texture.present());
    int inputs = 0;
    for (const Node& node : tree.nodes) inputs += static_cast<int>(node.textures.size());
    // albedo, f0 of the metal, roughness of both, metallic; coverage and roughness of the coat.
    EXPECT_EQ(inputs, 7);
}

// Whatever a file says, the tree is valid.
TEST(DescriptionTree, WildValuesAreClamped) {
    const float wild[] = {std::numeric_limits<float>::quiet_NaN(), -1.0f, 1e30f,
                          std::numeric_limits<float>::infinity()};
    for (const float value : wild) {
        MaterialDescription material{.name = "wild"};
        material.base_color = glm::vec4(value);
        material.metallic = material.roughness = material.ior = value;
        material.emissive = glm::vec3(value);
        material.alpha_mode = AlphaMode::blend;
        material.clearcoat = Clearcoat{.factor = value, .roughness = value};
        material.sheen = Sheen{.color = glm::vec3(value), .roughness = value};
        material.anisotropy = Anisotropy{.strength = value, .rotation = 0.0f};
        material.transmission = Transmission{.factor = value};
        material.volume =
            Volume{.thickness = value, .attenuation_distance = value, .attenuation_color = glm::vec3(value)};
        material.specular = Specular{.factor = value, .color = glm::vec3(value)};
        material.iridescence =
            Iridescence{.factor = value, .ior = value, .thickness_minimum = value, .thickness_maximum = value};
        const Tree tree = tree_of(material);
        const auto valid = validate(tree);
        EXPECT_TRUE(valid) << value << ": " << valid.error().message();
    }
}

TEST(DescriptionTree, UnlitShowsItsColorAlone) {
    MaterialDescription material{.name = "sign"};
    material.unlit = true;
    material.base_color = {0.2f, 0.4f, 0.6f, 1.0f};
    const FlattenedTree tree = flat(material);
    const ShadedTree shaded = shade(tree, {0.0, 0.0, 1.0});
    EXPECT_LT(directional_albedo(shaded).x, 1e-9);
    EXPECT_EQ(only_slab(tree).emission, glm::vec3(0.2f, 0.4f, 0.6f));
}

}  // namespace
}  // namespace nacre::materials
