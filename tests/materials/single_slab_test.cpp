// SPDX-License-Identifier: Apache-2.0
#include "materials/single_slab.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace nacre::materials {
namespace {

TEST(SingleSlab, DefaultsAreThoseOfGltf) {
    const SingleSlab slab = single_slab(MaterialDescription{});
    EXPECT_EQ(slab.base_color, glm::vec3(1.0f));
    EXPECT_EQ(slab.alpha, 1.0f);
    EXPECT_EQ(slab.metallic, 1.0f);
    EXPECT_EQ(slab.roughness, 1.0f);
    EXPECT_NEAR(slab.f0.x, 0.04f, 1e-6f);
    EXPECT_EQ(slab.f90, 1.0f);
    EXPECT_EQ(slab.emission, glm::vec3(0.0f));
    EXPECT_EQ(slab.alpha_mode, AlphaMode::opaque);
    EXPECT_FALSE(slab.unlit);
    EXPECT_FALSE(slab.double_sided);
}

TEST(SingleSlab, IorAndSpecularMakeTheReflectance) {
    MaterialDescription material;
    material.ior = 2.0f;
    EXPECT_NEAR(single_slab(material).f0.x, 1.0f / 9.0f, 1e-6f);
    material.specular = Specular{.factor = 0.5f, .color = {2.0f, 1.0f, 20.0f}};
    const SingleSlab slab = single_slab(material);
    EXPECT_NEAR(slab.f0.x, 1.0f / 9.0f, 1e-6f);
    EXPECT_NEAR(slab.f0.y, 0.5f / 9.0f, 1e-6f);
    EXPECT_NEAR(slab.f0.z, 0.5f, 1e-6f) << "the product of F0 and tint is clamped before the factor applies";
    EXPECT_EQ(slab.f90, 0.5f);
    material.specular.reset();
    material.ior = 0.0f;
    EXPECT_EQ(single_slab(material).f0, glm::vec3(1.0f));
}

TEST(SingleSlab, EmissionIsScaledAndStaysFinite) {
    MaterialDescription material;
    material.emissive = {1.0f, 0.5f, 0.0f};
    material.emissive_strength = 8.0f;
    EXPECT_EQ(single_slab(material).emission, glm::vec3(8.0f, 4.0f, 0.0f));
    material.emissive_strength = 1e38f;
    material.emissive = glm::vec3(1e38f);
    const glm::vec3 emission = single_slab(material).emission;
    EXPECT_TRUE(std::isfinite(emission.x));
    EXPECT_LE(emission.x, 1e30f);
}

TEST(SingleSlab, ValuesOutOfRangeAreClampedAndNotANumberBecomesTheDefault) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    MaterialDescription material;
    material.base_color = {2.0f, -1.0f, nan, 7.0f};
    material.metallic = -3.0f;
    material.roughness = nan;
    material.ior = 0.5f;
    material.alpha_cutoff = nan;
    const SingleSlab slab = single_slab(material);
    EXPECT_EQ(slab.base_color, glm::vec3(1.0f, 0.0f, 1.0f));
    EXPECT_EQ(slab.alpha, 1.0f);
    EXPECT_EQ(slab.metallic, 0.0f);
    EXPECT_EQ(slab.roughness, 1.0f);
    EXPECT_EQ(slab.f0, glm::vec3(0.0f)) << "an ior below 1 counts as 1";
    EXPECT_EQ(slab.alpha_cutoff, 0.5f);
}

TEST(SingleSlab, SpecularGlossinessBecomesADielectric) {
    MaterialDescription material;
    material.specular_glossiness =
        SpecularGlossiness{.diffuse = {0.1f, 0.2f, 0.3f, 0.4f}, .specular = {0.5f, 0.6f, 0.7f}, .glossiness = 0.75f};
    const SingleSlab slab = single_slab(material);
    EXPECT_EQ(slab.base_color, glm::vec3(0.1f, 0.2f, 0.3f));
    EXPECT_EQ(slab.alpha, 0.4f);
    EXPECT_EQ(slab.metallic, 0.0f);
    EXPECT_EQ(slab.roughness, 0.25f);
    EXPECT_EQ(slab.f0, glm::vec3(0.5f, 0.6f, 0.7f));
}

TEST(SingleSlab, TexturesAndFlagsAreKept) {
    MaterialDescription material;
    material.base_color_texture = {.image = 1, .sampler = 0, .uv_set = 1, .transform = {.rotation = 0.5f}};
    material.normal_texture = {.image = 2, .sampler = 0, .scale = -0.5f};
    material.occlusion_texture = {.image = 3, .sampler = 0, .scale = 0.25f};
    material.alpha_mode = AlphaMode::mask;
    material.alpha_cutoff = 0.3f;
    material.double_sided = material.unlit = true;
    const SingleSlab slab = single_slab(material);
    EXPECT_EQ(slab.base_color_texture, material.base_color_texture);
    EXPECT_EQ(slab.normal_scale, -0.5f);
    EXPECT_EQ(slab.occlusion_strength, 0.25f);
    EXPECT_EQ(slab.alpha_mode, AlphaMode::mask);
    EXPECT_EQ(slab.alpha_cutoff, 0.3f);
    EXPECT_TRUE(slab.double_sided && slab.unlit);
}

TEST(Description, TangentsAreNeededForNormalMapsAndAnisotropy) {
    MaterialDescription material;
    EXPECT_FALSE(needs_tangents(material));
    material.clearcoat = Clearcoat{};
    EXPECT_FALSE(needs_tangents(material));
    material.clearcoat->normal_texture.image = 0;
    EXPECT_TRUE(needs_tangents(material));
    material = {};
    material.anisotropy = Anisotropy{};
    EXPECT_TRUE(needs_tangents(material));
}

TEST(Description, EveryTexturePresentIsVisitedWithItsColorSpace) {
    MaterialDescription material;
    material.base_color_texture.image = 0;
    material.normal_texture.image = 1;
    material.sheen = Sheen{};
    material.sheen->color_texture.image = 2;
    int srgb_count = 0, linear_count = 0;
    for_each_texture(material, [&](TextureReference& reference, bool srgb) {
        (srgb ? srgb_count : linear_count) += 1;
        reference.image += 10;
    });
    EXPECT_EQ(srgb_count, 2);
    EXPECT_EQ(linear_count, 1);
    EXPECT_EQ(material.sheen->color_texture.image, 12);
}

}  // namespace
}  // namespace nacre::materials
