// SPDX-License-Identifier: Apache-2.0
#include "passes/shading_features.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "scene/shapes.h"

namespace nacre::passes {
namespace {

bool has_define(const std::vector<rhi::ShaderDefine>& defines, std::string_view name) {
    return std::ranges::any_of(defines, [&](const rhi::ShaderDefine& define) { return define.name == name; });
}

scene::Primitive quad() { return scene::parallelogram({0, 0, 0}, {1, 0, 0}, {0, 1, 0}); }

TEST(ShadingFeatures, APlainMaterialNeedsNormalsOnly) {
    const ShadingFeatures features = features_of(materials::SingleSlab{}, quad());
    EXPECT_EQ(features.textures, 0u);
    EXPECT_EQ(features.attributes, attribute_bit(Attribute::position) | attribute_bit(Attribute::normal));
    EXPECT_TRUE(vertex_defines(features).size() == 1 && has_define(vertex_defines(features), "HAS_NORMALS"));
}

TEST(ShadingFeatures, TexturesBringTheirCoordinates) {
    materials::SingleSlab slab;
    slab.base_color_texture = {.image = 0, .sampler = 0, .uv_set = 1};
    scene::Primitive primitive = quad();
    // Without a second set of coordinates the texture is not read.
    EXPECT_EQ(features_of(slab, primitive).textures, 0u);
    primitive.uv1 = primitive.uv0;
    const ShadingFeatures features = features_of(slab, primitive);
    EXPECT_EQ(features.textures, texture_bit(TextureSlot::base_color));
    EXPECT_NE(features.attributes & attribute_bit(Attribute::uv1), 0u);
    EXPECT_EQ(features.attributes & attribute_bit(Attribute::uv0), 0u);
    EXPECT_TRUE(has_define(fragment_defines(features), "BASE_COLOR_TEXTURE"));
}

TEST(ShadingFeatures, NormalMapsNeedTangents) {
    materials::SingleSlab slab;
    slab.normal_texture = {.image = 0, .sampler = 0};
    scene::Primitive primitive = quad();
    EXPECT_EQ(features_of(slab, primitive).textures, 0u);
    primitive.tangents.assign(4, {1, 0, 0, 1});
    EXPECT_EQ(features_of(slab, primitive).textures, texture_bit(TextureSlot::normal));
}

TEST(ShadingFeatures, PassesReadOnlyTheirTextures) {
    materials::SingleSlab slab;
    slab.base_color_texture = {.image = 0, .sampler = 0};
    slab.emission = glm::vec3(1.0f);
    slab.emission_texture = {.image = 1, .sampler = 0, .uv_set = 1};
    scene::Primitive primitive = quad();
    primitive.uv1 = primitive.uv0;
    primitive.colors.assign(4, glm::vec4(1.0f));
    const ShadingFeatures all = features_of(slab, primitive);
    const ShadingFeatures emission = restricted(all, texture_bit(TextureSlot::emission), false, false);
    EXPECT_EQ(emission.textures, texture_bit(TextureSlot::emission));
    EXPECT_EQ(emission.attributes, attribute_bit(Attribute::position) | attribute_bit(Attribute::uv1));
    const ShadingFeatures depth = restricted(all, 0, false, false);
    EXPECT_EQ(depth.attributes, attribute_bit(Attribute::position));
    EXPECT_TRUE(vertex_defines(depth).empty());
}

TEST(ShadingFeatures, PointsAndLinesWithoutNormalsAreUnlit) {
    scene::Primitive line;
    line.topology = scene::Topology::line_list;
    line.positions = {{0, 0, 0}, {1, 0, 0}};
    line.indices = {0, 1};
    const ShadingFeatures features = features_of(materials::SingleSlab{}, line);
    EXPECT_TRUE(features.unlit);
    EXPECT_TRUE(has_define(vertex_defines(features), "THIN"));
    EXPECT_FALSE(has_define(vertex_defines(features), "POINTS"));
}

}  // namespace
}  // namespace nacre::passes
