// SPDX-License-Identifier: Apache-2.0
#include "materials/simplification.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "materials/builtin_materials.h"
#include "materials/storage.h"
#include "measure/random_tree.h"

namespace nacre::materials {
namespace {

using measure::random_tree;

std::uint32_t bytes_of(std::string_view name) {
    const auto tree = make_builtin_material(name);
    EXPECT_TRUE(tree);
    const auto flat = flatten(*tree);
    EXPECT_TRUE(flat) << flat.error().message();
    return storage_layout(*flat).total_bytes();
}

// The rows of storage of the Substrate talk; each holds all that those before it hold.
TEST(Storage, RowsTakeAtMostWhatTheTalkStates) {
    const std::pair<const char*, std::uint32_t> rows[] = {
        {"simple", 12},         {"single", 16},        {"single-haze-f90", 20}, {"single-fuzz", 24},
        {"single-sss", 28},     {"complex-aniso", 28}, {"complex-coat", 40},    {"special-speclut", 44},
        {"special-glints", 60}, {"complex-opal", 76}};
    std::uint32_t features = 0, closures = 0;
    for (const auto& [name, bytes] : rows) {
        EXPECT_LE(bytes_of(name), bytes) << name;
        const auto flat = flatten(*make_builtin_material(name));
        EXPECT_EQ(features & ~flat->topology.features, 0u) << name << " lacks a feature of the row before";
        EXPECT_GE(flat->topology.closures.size(), closures) << name;
        features = flat->topology.features;
        closures = static_cast<std::uint32_t>(flat->topology.closures.size());
    }
    EXPECT_EQ(bytes_of("simple"), 12u);
}

TEST(Storage, LayoutHasNoFieldTwiceAndCountsItsBits) {
    std::mt19937 random(2);
    std::uint32_t all = 0;
    for (const SlabFeature& feature : slab_features()) all |= feature.bit;
    for (std::uint32_t i = 0; i < 100; ++i) {
        const auto flat = flatten(random_tree(random, {.slabs = 1 + i % 5, .features = all}));
        ASSERT_TRUE(flat) << flat.error().message();
        const StorageLayout layout = storage_layout(*flat);
        std::map<std::pair<std::uint32_t, std::string>, int> seen;
        std::uint32_t bits = 0;
        for (const StorageField& field : layout.fields) {
            bits += field.bits;
            EXPECT_TRUE(field.closure == StorageLayout::no_closure || field.closure < flat->topology.closures.size());
            if (field.closure != StorageLayout::no_closure)
                EXPECT_EQ(++seen[std::pair(field.closure, field.name)], 1) << field.name;
        }
        EXPECT_LE(bits, 32 * layout.material_words());
        EXPECT_TRUE(layout.material_words() == 2 || bits > 32 * (layout.material_words() - 1));
    }
}

// The talk's example: 3 closures in 72 bytes, 2 in 48, 1 in 12.
TEST(Simplification, TheTalksExample) {
    const auto tree = make_builtin_material("coated-carbon");
    ASSERT_TRUE(tree);
    const auto result = simplify(*tree, {.closures = 1, .bytes = 12});
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_TRUE(result->fits);
    ASSERT_GE(result->steps.size(), 3u);
    EXPECT_EQ(result->steps[0].closures, 3u);
    EXPECT_LE(result->steps[0].bytes, 72u);
    EXPECT_EQ(result->steps[1].closures, 2u);
    EXPECT_LE(result->steps[1].bytes, 48u);
    EXPECT_EQ(result->steps[1].what, "blend mix(carbon fiber, metal)");
    EXPECT_EQ(result->steps[2].closures, 1u);
    EXPECT_EQ(result->steps.back().bytes, 12u);
}

TEST(Simplification, StopsAsSoonAsTheBudgetHolds) {
    const auto tree = make_builtin_material("complex-opal");
    ASSERT_TRUE(tree);
    const auto full = simplify(*tree, {});
    EXPECT_EQ(full->steps.size(), 1u);
    EXPECT_TRUE(full->fits);
    for (const std::uint32_t bytes : {64u, 48u, 32u, 20u, 12u}) {
        const auto result = simplify(*tree, {.bytes = bytes});
        ASSERT_TRUE(result);
        EXPECT_TRUE(result->fits) << bytes;
        EXPECT_LE(result->steps.back().bytes, bytes);
        for (std::size_t i = 0; i + 1 < result->steps.size(); ++i) EXPECT_GT(result->steps[i].bytes, bytes);
    }
    EXPECT_FALSE(simplify(*tree, {.bytes = 8})->fits);
    EXPECT_THAT(simplify(*tree, {.closures = 0}).error().message(), testing::HasSubstr("0 closures"));
}

// Whatever the tree, one closure is reached; nothing grows on the way; the deepest operators go first.
TEST(Simplification, AnyTreeBecomesOneClosure) {
    std::mt19937 random(9);
    for (std::uint32_t i = 0; i < 60; ++i) {
        const Tree tree =
            random_tree(random, {.slabs = 1 + i % 7, .features = slab_fuzz | slab_medium | slab_anisotropy});
        const auto result = simplify_fully(tree);
        ASSERT_TRUE(result) << result.error().message();
        EXPECT_TRUE(result->fits);
        EXPECT_EQ(result->steps.back().closures, 1u);
        for (std::size_t s = 1; s < result->steps.size(); ++s) {
            EXPECT_LT(result->steps[s].closures, result->steps[s - 1].closures);
            EXPECT_TRUE(std::isfinite(result->steps[s].albedo_error) && std::isfinite(result->steps[s].lobe_error));
            EXPECT_LE(result->steps[s].lobe_error, 2.0);
        }
    }
}

// Blending what is equal loses nothing; blending what is not does, and says so.
TEST(Simplification, ErrorsAreThoseOfTheBlend) {
    const auto error = [](const Slab& a, const Slab& b) {
        Tree tree{.name = "pair"};
        const NodeIndex x = tree.add(a), y = tree.add(b);
        tree.mix(x, y, 0.5f);
        return simplify_fully(tree)->steps.back();
    };
    const Slab red{.albedo = {0.8f, 0.1f, 0.1f}},
        metal{.f0 = glm::vec3(0.9f), .roughness = 0.1f, .albedo = glm::vec3(0.0f)};
    EXPECT_LT(error(red, red).albedo_error, 1e-9);
    EXPECT_LT(error(red, red).lobe_error, 1e-9);
    EXPECT_GT(error(red, metal).lobe_error, 0.05);
}

TEST(BuiltinMaterials, AreValidAndListed) {
    for (const BuiltinMaterial& material : builtin_materials()) {
        const auto tree = make_builtin_material(material.name);
        ASSERT_TRUE(tree);
        EXPECT_EQ(tree->name, material.name);
        EXPECT_TRUE(flatten(*tree)) << material.name;
        EXPECT_FALSE(material.meaning.empty());
    }
    const auto unknown = make_builtin_material("glitter");
    ASSERT_FALSE(unknown);
    EXPECT_THAT(unknown.error().message(), testing::HasSubstr("coated-carbon"));
}

}  // namespace
}  // namespace nacre::materials
