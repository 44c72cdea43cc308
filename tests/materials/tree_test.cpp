// SPDX-License-Identifier: Apache-2.0
#include "materials/tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "materials/topology.h"

namespace nacre::materials {
namespace {

using testing::HasSubstr;

Slab slab_with(std::uint32_t features) {
    Slab slab;
    slab.features = features;
    return slab;
}

// A clear coat over carbon fiber beside metal: the motive of the talk.
Tree coated_mix() {
    Tree tree{.name = "coated mix"};
    const NodeIndex fiber = tree.add(slab_with(slab_anisotropy), "fiber");
    const NodeIndex metal = tree.add(slab_with(0), "metal");
    const NodeIndex coat = tree.add(slab_with(slab_medium), "coat");
    tree.layer(coat, tree.mix(fiber, metal, 0.25f), 1e-4f);
    return tree;
}

TEST(Tree, AFlattenedTreeYieldsOneClosureForEachSlab) {
    const auto flat = flatten(coated_mix());
    ASSERT_TRUE(flat) << flat.error().message();
    const Topology& topology = flat->topology;
    ASSERT_EQ(topology.closures.size(), 3u);
    EXPECT_EQ(topology.features, slab_anisotropy | slab_medium);
    for (const TopologyClosure& closure : topology.closures) {
        const std::string& name = flat->visible_tree.nodes[closure.node].name;
        EXPECT_EQ(closure.is_top, name == "coat") << name;
        EXPECT_EQ(closure.is_bottom, name != "coat") << name;
        EXPECT_EQ(closure.features, flat->visible_tree.nodes[closure.node].slab.features);
    }
    EXPECT_EQ(topology_text(flat->visible_tree), "layer(coat, mix(fiber, metal))");
}

TEST(Tree, ALayerGivesItsTopTheThicknessAndAThinSurfaceItsBottom) {
    Tree tree = coated_mix();
    tree.thin = true;
    tree.surface_thickness = 2e-3f;
    const auto flat = flatten(tree);
    ASSERT_TRUE(flat);
    for (std::size_t i = 0; i < 3; ++i) {
        const bool is_coat = flat->visible_tree.nodes[flat->topology.slabs[i]].name == "coat";
        EXPECT_EQ(flat->topology.thickness[i], is_coat ? 1e-4f : 2e-3f);
    }
    tree.thin = false;
    const auto thick = flatten(tree);
    ASSERT_TRUE(thick);
    for (std::size_t i = 0; i < 3; ++i) {
        const bool is_coat = thick->visible_tree.nodes[thick->topology.slabs[i]].name == "coat";
        EXPECT_EQ(thick->topology.thickness[i], is_coat ? 1e-4f : -1.0f);
    }
}

TEST(Tree, EqualFramesAreStoredOnce) {
    Tree tree{.name = "silks"};
    const std::uint32_t along = tree.add_frame({});
    const std::uint32_t across = tree.add_frame({.rotation = 1.5f});
    EXPECT_EQ(along, 0u);
    EXPECT_EQ(tree.add_frame({.rotation = 1.5f}), across);
    tree.frames.push_back({.rotation = 1.5f});  // equal, but written twice
    const NodeIndex a = tree.add({}, "a", across), b = tree.add({}, "b", 2), c = tree.add({}, "c", along);
    tree.mix(tree.mix(a, b, 0.5f), c, 0.5f);
    const auto flat = flatten(tree);
    ASSERT_TRUE(flat);
    EXPECT_EQ(flat->topology.frames.size(), 2u);
    EXPECT_EQ(flat->topology.closures[0].frame, flat->topology.closures[1].frame);
}

TEST(Tree, WhatCannotBeSeenGoes) {
    struct Case {
        const char* what;
        float first_amount, second_amount;
        bool textured;
        std::size_t closures;
    };
    for (const Case& c : {Case{"both", 0.5f, 0.5f, false, 3}, Case{"mix of 0", 0.0f, 0.5f, false, 2},
                          Case{"mix of 1", 1.0f, 0.5f, false, 2}, Case{"mix of 1 times a texture", 1.0f, 0.5f, true, 3},
                          Case{"no coverage", 0.5f, 0.0f, false, 2}, Case{"all coverage", 0.5f, 1.0f, false, 3}}) {
        Tree tree{.name = c.what};
        const NodeIndex a = tree.add(slab_with(0)), b = tree.add(slab_with(0)), top = tree.add(slab_with(slab_medium));
        const NodeIndex mix = tree.mix(a, b, c.first_amount);
        if (c.textured) tree.nodes[mix].textures.push_back({.field = "amount", .texture = {.image = 0, .sampler = 0}});
        tree.layer(tree.coverage(top, c.second_amount), mix);
        const auto flat = flatten(tree);
        ASSERT_TRUE(flat) << flat.error().message();
        EXPECT_EQ(flat->topology.closures.size(), c.closures) << c.what;
    }
}

TEST(Tree, AnOpaqueTopHidesItsBase) {
    Tree tree{.name = "painted over"};
    const NodeIndex base = tree.add({}), paint = tree.add({}, "paint");
    tree.layer(paint, base);
    EXPECT_EQ(flatten(tree)->topology.closures.size(), 1u);
    tree.nodes[paint].slab.coverage = 0.99f;
    EXPECT_EQ(flatten(tree)->topology.closures.size(), 2u);
    tree.nodes[paint].slab.coverage = 1.0f;
    tree.nodes[paint].slab.features = slab_medium;  // a medium may let light through
    EXPECT_EQ(flatten(tree)->topology.closures.size(), 2u);
    tree.nodes[paint].slab.features = slab_edge_coverage;
    EXPECT_EQ(flatten(tree)->topology.closures.size(), 2u);
}

TEST(Tree, BlendedOperatorsYieldOneClosure) {
    Tree tree = coated_mix();
    for (Node& node : tree.nodes) node.parameter_blend = node.kind == NodeKind::mix;
    EXPECT_EQ(flatten(tree)->topology.closures.size(), 2u);
    for (Node& node : tree.nodes) node.parameter_blend = node.kind == NodeKind::layer;
    const auto one = flatten(tree);
    ASSERT_EQ(one->topology.closures.size(), 1u);
    EXPECT_EQ(one->topology.closures[0].features, slab_anisotropy | slab_medium);
    EXPECT_TRUE(one->topology.closures[0].is_top && one->topology.closures[0].is_bottom);
    const auto dropped = flatten(tree, {.dropped_features = slab_anisotropy});
    EXPECT_EQ(dropped->topology.features, slab_medium);
}

TEST(Tree, FaultsAreNamed) {
    const auto message = [](const Tree& tree) {
        const auto result = flatten(tree);
        return result ? std::string() : result.error().message();
    };
    Tree tree{.name = "faulty"};
    EXPECT_THAT(message(tree), HasSubstr("'faulty'"));
    EXPECT_THAT(message(tree), HasSubstr("there are 0 nodes"));
    const NodeIndex a = tree.add({}, "paint");
    tree.nodes[a].slab.roughness = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THAT(message(tree), HasSubstr("node 0 (slab 'paint'): roughness is nan"));
    tree.nodes[a].slab.roughness = 1.5f;
    EXPECT_THAT(message(tree), HasSubstr("[0, 1]"));
    tree.nodes[a].slab = {};
    tree.mix(a, a, 0.5f);
    EXPECT_THAT(message(tree), HasSubstr("used twice"));
    tree.nodes[1].second = 7;
    EXPECT_THAT(message(tree), HasSubstr("its child is node 7, but there are 2 nodes"));
    tree.nodes[1].second = 1;  // a cycle
    EXPECT_THAT(message(tree), HasSubstr("used twice"));
    tree.root = a;
    tree.nodes[a].frame = 3;
    EXPECT_THAT(message(tree), HasSubstr("frame is 3"));
    tree.nodes[a].frame = 0;
    tree.nodes[a].textures.push_back({.field = "colour", .texture = {.image = 0, .sampler = 0}});
    EXPECT_THAT(message(tree), HasSubstr("'colour'"));
    tree.nodes[a].textures[0].field = "fuzz_color";
    EXPECT_THAT(message(tree), HasSubstr("feature"));
    tree.nodes[a].textures[0] = {.field = "albedo", .texture = {.image = 0, .sampler = 0}, .channel = 2};
    EXPECT_THAT(message(tree), HasSubstr("3 channels from 2"));
    tree.nodes[a].textures[0].gray = true;
    EXPECT_EQ(message(tree), "");
    tree.nodes[a].vertex_colored = {"albedo"};
    EXPECT_EQ(message(tree), "");
    for (const char* wrong : {"roughness", "fuzz_color", "amount", "colour"}) {
        tree.nodes[a].vertex_colored = {wrong};
        EXPECT_THAT(message(tree), HasSubstr(wrong));
    }
    tree.nodes[a].vertex_colored.clear();

    Tree deep{.name = "deep"};
    NodeIndex root = deep.add({});
    for (std::uint32_t i = 0; i < max_tree_depth; ++i) root = deep.coverage(root, 0.5f);
    EXPECT_EQ(message(deep), "");
    deep.coverage(root, 0.5f);
    EXPECT_THAT(message(deep), HasSubstr("more than 16 operators"));

    Tree wide{.name = "wide"};
    std::vector<NodeIndex> open;
    for (std::uint32_t i = 0; i <= max_tree_slabs; ++i) open.push_back(wide.add({}));
    while (open.size() > 1) {  // balanced, so that it is wide and not deep
        std::vector<NodeIndex> next;
        for (std::size_t i = 0; i + 1 < open.size(); i += 2) next.push_back(wide.mix(open[i], open[i + 1], 0.5f));
        if (open.size() % 2 == 1) next.push_back(open.back());
        open = next;
    }
    EXPECT_THAT(message(wide), HasSubstr("more than 32 slabs"));
}

}  // namespace
}  // namespace nacre::materials
