// SPDX-License-Identifier: Apache-2.0
#include "materials/specular_table.h"

#include <gtest/gtest.h>

#include "materials/conversions.h"

namespace nacre::materials {
namespace {

TEST(SpecularTable, IsExactAtItsEntriesAndLinearBetween) {
    SpecularTable table;
    for (std::uint32_t i = 0; i < table.entries.size(); ++i)
        table.entries[i] = glm::vec3(static_cast<float>(i) / 255.0f);
    EXPECT_EQ(look_up(table, {0.0, 0.0}), glm::dvec3(0.0));
    EXPECT_EQ(look_up(table, {1.0, 1.0}), glm::dvec3(1.0));
    EXPECT_NEAR(look_up(table, {1.0 / 15.0, 0.0}).x, 1.0 / 255.0, 1e-7) << "columns are views";
    EXPECT_NEAR(look_up(table, {0.0, 1.0 / 15.0}).x, 16.0 / 255.0, 1e-7) << "rows are lights";
    EXPECT_NEAR(look_up(table, {0.5, 0.5}).x, 0.5, 1e-6);
    EXPECT_EQ(look_up(table, {-3.0, 7.0}), look_up(table, {0.0, 1.0}));
}

TEST(SpecularTable, FlipFlopFollowsTheView) {
    const glm::vec3 facing(1.0f, 0.5f, 0.2f), grazing(0.1f, 0.4f, 0.9f);
    const SpecularTable table = flip_flop_table(facing, grazing, 3.0f);
    for (int i = 0; i <= 15; ++i) {
        const glm::vec3 expected = flip_flop(facing, grazing, 3.0f, static_cast<float>(i) / 15.0f);
        for (const double light : {0.0, 0.4, 1.0}) {
            const glm::dvec3 got = look_up(table, {i / 15.0, light});
            for (int channel = 0; channel < 3; ++channel) EXPECT_NEAR(got[channel], expected[channel], 1e-6);
        }
    }
}

TEST(SpecularTable, ListsHaveALastTable) {
    EXPECT_EQ(tints_of({})(0, {0.5, 0.5}), glm::dvec3(1.0));
    const auto tables = default_specular_tables();
    const auto tints = tints_of(tables);
    EXPECT_EQ(tints(0, {0.3, 0.7}), look_up(tables[0], {0.3, 0.7}));
    EXPECT_EQ(tints(1000, {0.3, 0.7}), look_up(tables.back(), {0.3, 0.7}));
    EXPECT_NE(tints(0, {1.0, 1.0}), tints(0, {0.1, 1.0})) << "the first is no white";
    for (const SpecularTable& table : tables) {
        for (const glm::vec3& entry : table.entries) {
            for (int channel = 0; channel < 3; ++channel) EXPECT_TRUE(entry[channel] >= 0.0f && entry[channel] <= 1.0f);
        }
    }
}

}  // namespace
}  // namespace nacre::materials
