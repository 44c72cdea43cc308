// SPDX-License-Identifier: Apache-2.0
#include "materials/simplification.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "materials/builtin_materials.h"
#include "materials/storage.h"
#include "tests/materials/random_tree.h"

namespace nacre::materials {
namespace {

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
