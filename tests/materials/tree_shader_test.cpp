// SPDX-License-Identifier: Apache-2.0
#include "materials/tree_shader.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "materials/evaluation.h"
#include "tests/materials/random_tree.h"
#include "tests/materials/tree_run.h"

namespace nacre::materials {
namespace {

constexpr const char* evaluate_text = R"(
layout(set = 0, binding = 2, std430) writeonly buffer Results { vec4 results[]; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    vec3 views[tree_frame_count];
    vec3 lights[tree_frame_count];
    for (uint frame = 0u; frame < tree_frame_count; ++frame) {
        views[frame] = directions[2u * i].xyz;
        lights[frame] = directions[2u * i + 1u].xyz;
    }
    TreeState state = shade_tree(views, 1e-3);
    results[2u * i] = vec4(tree_reflected(state, views, lights, 1e-3), state.whole.coverage);
    results[2u * i + 1u] = vec4(state.whole.view_transmittance, state.top.coverage);
})";

class TreeShaderTest : public TreeDeviceTest {
  protected:
    Expected<std::vector<glm::vec4>> run(const TreeShader& tree, const std::vector<glm::vec4>& inputs) {
        NACRE_TRY(const std::vector<std::byte> bytes,
                  run_tree(*device_, tree, tree.glsl + evaluate_text, inputs, inputs.size() * sizeof(glm::vec4)));
        std::vector<glm::vec4> values(inputs.size());
        std::memcpy(values.data(), bytes.data(), bytes.size());
        return values;
    }

    // Compares what the device makes of a tree with the host, which counts in doubles.
    void compare(const FlattenedTree& flat, const FlattenedTree& host_tree, std::mt19937& random) {
        const std::vector<glm::vec4> inputs = random_directions(random);
        const auto results = run(tree_shader(flat), inputs);
        ASSERT_TRUE(results) << results.error().message();
        double worst = 0.0;
        std::uint32_t worst_at = 0;
        for (std::uint32_t i = 0; i < direction_pairs; ++i) {
            const glm::dvec3 view = glm::normalize(glm::dvec3(inputs[2 * i])),
                             light = glm::normalize(glm::dvec3(inputs[2 * i + 1]));
            const ShadedTree shaded = shade(host_tree, view);
            const glm::dvec3 expected = reflected(shaded, light);
            for (int channel = 0; channel < 3; ++channel) {
                const double got = results->at(2 * i)[channel];
                ASSERT_TRUE(std::isfinite(got) && got >= 0.0) << topology_text(flat.visible_tree);
                const double error = std::abs(got - expected[channel]) / (expected[channel] + 1e-4);
                if (error > worst) worst = error, worst_at = i;
            }
            EXPECT_NEAR(results->at(2 * i).w, shaded.whole.coverage, 1e-5);
            EXPECT_NEAR(results->at(2 * i + 1).w, shaded.top.coverage, 1e-5);
            for (int channel = 0; channel < 3; ++channel)
                EXPECT_NEAR(results->at(2 * i + 1)[channel], shaded.whole.view_transmittance[channel], 1e-4);
        }
        EXPECT_LT(worst, 1e-3) << topology_text(flat.visible_tree) << " view " << inputs[2 * worst_at].z << " light "
                               << inputs[2 * worst_at + 1].z;
    }
};

TEST_P(TreeShaderTest, ShadesAsTheHostDoes) {
    std::mt19937 random(11);
    for (const std::uint32_t slabs : {1u, 2u, 4u}) {
        const Tree tree = random_tree(random, {.slabs = slabs,
                                               .features = slab_anisotropy | slab_f90 | slab_f82 | slab_second_lobe |
                                                           slab_fuzz | slab_medium | slab_edge_coverage});
        const auto flat = flatten(tree);
        ASSERT_TRUE(flat) << flat.error().message();
        compare(*flat, *flat, random);
    }
}

TEST_P(TreeShaderTest, BlendsAsTheHostDoes) {
    std::mt19937 random(12);
    for (const NodeKind kind : {NodeKind::mix, NodeKind::layer}) {
        Tree tree = random_tree(random, {.slabs = 3, .features = slab_second_lobe | slab_fuzz | slab_medium});
        for (Node& node : tree.nodes) node.parameter_blend = node.kind == kind;
        const auto flat = flatten(tree);
        ASSERT_TRUE(flat);
        compare(*flat, *flat, random);
    }
}

TEST_P(TreeShaderTest, TexturesAndVertexColorsMultiplyTheirInputs) {
    Tree tree{.name = "textured"};
    Slab slab{.f0 = {0.4f, 0.2f, 0.1f}, .roughness = 0.8f, .albedo = {0.5f, 0.25f, 1.0f}};
    const NodeIndex a = tree.add(slab), b = tree.add(slab);
    tree.mix(a, b, 0.5f);
    const TextureReference texture{.image = 0, .sampler = 0};
    tree.nodes[a].textures = {{.field = "roughness", .texture = texture, .channel = 1},
                              {.field = "albedo", .texture = texture, .scale = -1.0f, .bias = 1.0f},
                              {.field = "f0", .texture = texture, .channel = 2, .gray = true}};
    tree.nodes[tree.root].textures = {{.field = "amount", .texture = texture, .channel = 2}};
    tree.nodes[b].vertex_colored = {"albedo"};
    tree.nodes[tree.root].vertex_colored = {"amount"};
    Tree plain = tree;  // what that comes to
    for (Node& node : plain.nodes) {
        node.textures.clear();
        node.vertex_colored.clear();
    }
    plain.nodes[b].slab.albedo = {0.25f, 0.0625f, 1.0f};
    plain.nodes[a].slab.roughness = 0.4f;
    plain.nodes[a].slab.f0 = {0.3f, 0.15f, 0.075f};
    plain.nodes[a].slab.albedo = {0.375f, 0.125f, 0.25f};
    plain.nodes[plain.root].amount = 0.1875f;
    std::mt19937 random(13);
    compare(*flatten(tree), *flatten(plain), random);
}

INSTANTIATE_TEST_SUITE_P(Backends, TreeShaderTest, testing::ValuesIn(TreeDeviceTest::backends),
                         TreeDeviceTest::name_of);

// Materials of one topology share a shader, whatever their numbers are.
TEST(TreeShader, TextDependsOnTopologyAndFeaturesOnly) {
    std::mt19937 random(3);
    Tree tree = random_tree(random, {.slabs = 3, .features = slab_fuzz | slab_medium});
    for (Node& node : tree.nodes) node.amount = node.kind == NodeKind::layer ? 0.0f : 0.5f;
    const auto flat = flatten(tree);
    ASSERT_TRUE(flat);
    Tree other = tree;
    for (Node& node : other.nodes) {
        node.name = "another";
        node.slab.roughness *= 0.5f;
        node.slab.albedo = glm::vec3(0.3f);
        if (node.kind == NodeKind::mix) node.amount = 0.25f;
    }
    EXPECT_EQ(tree_shader(*flat).glsl, tree_shader(*flatten(other)).glsl);
    EXPECT_EQ(tree_shader(*flat).defines, tree_shader(*flatten(other)).defines);
    EXPECT_NE(tree_shader(*flat).parameters, tree_shader(*flatten(other)).parameters);
    for (Node& node : other.nodes) node.slab.features |= slab_anisotropy;
    EXPECT_NE(tree_shader(*flat).glsl, tree_shader(*flatten(other)).glsl);
}

}  // namespace
}  // namespace nacre::materials
