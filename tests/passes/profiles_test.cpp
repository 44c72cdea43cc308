// SPDX-License-Identifier: Apache-2.0
#include "passes/profiles.h"

#include <gtest/gtest.h>

namespace nacre::passes {
namespace {

TEST(Profiles, AreThereInOrder) {
    const char* names[] = {"mobile", "low", "medium", "high", "epic", "reference"};
    ASSERT_EQ(profiles().size(), std::size(names));
    for (std::size_t i = 0; i < std::size(names); ++i) EXPECT_EQ(profiles()[i].name, names[i]);
}

TEST(Profiles, BudgetsNeverFall) {
    for (std::size_t i = 1; i < profiles().size(); ++i) {
        const Profile &a = profiles()[i - 1], &b = profiles()[i];
        EXPECT_LE(a.color_targets, b.color_targets) << b.name;
        EXPECT_LE(a.lights, b.lights) << b.name;
        EXPECT_LE(a.shadow_views, b.shadow_views) << b.name;
        EXPECT_LE(a.shadow_map_size, b.shadow_map_size) << b.name;
        EXPECT_LE(a.shadow_filter_width, b.shadow_filter_width) << b.name;
        EXPECT_LE(a.environment_size, b.environment_size) << b.name;
        EXPECT_LE(a.environment_samples, b.environment_samples) << b.name;
        EXPECT_LE(a.blend_groups, b.blend_groups) << b.name;
        EXPECT_LE(a.storage_in_fragment, b.storage_in_fragment) << b.name;
        EXPECT_LE(a.float_color_targets, b.float_color_targets) << b.name;
        EXPECT_FALSE(a.diffuse_model == DiffuseModel::chan && b.diffuse_model == DiffuseModel::lambert) << b.name;
    }
}

TEST(Profiles, MobileHoldsOnOpenGlEs31) {
    const Profile& mobile = profiles()[0];
    EXPECT_LE(mobile.color_targets, 3u);
    EXPECT_FALSE(mobile.storage_in_fragment);
    EXPECT_FALSE(mobile.float_color_targets);
    EXPECT_EQ(mobile.closures_per_pixel, 1u);
    EXPECT_EQ(mobile.gbuffer_bytes_per_pixel, 12u);
    // Lights and shadow views fit into a uniform block of 16 KiB, with lists rounded up to powers of two.
    for (const Profile& profile : profiles()) {
        EXPECT_LE(16 + 128 * 64 + 32 * 64, 16384);
        EXPECT_LE(profile.lights, 128u);
        EXPECT_LE(profile.shadow_views, 32u);
        EXPECT_TRUE(profile.shadow_filter_width == 1 || profile.shadow_filter_width == 3 ||
                    profile.shadow_filter_width == 5);
    }
}

TEST(Profiles, UnknownNamesListTheKnown) {
    const auto found = find_profile("ultra");
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().code, ErrorCode::not_found);
    EXPECT_NE(found.error().message().find("mobile, low, medium, high, epic, reference"), std::string::npos);
}

}  // namespace
}  // namespace nacre::passes
