// SPDX-License-Identifier: Apache-2.0
#include "passes/lights.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nacre::passes {
namespace {

using scene::Light;
using scene::LightKind;

scene::Bounds room() {
    scene::Bounds bounds;
    bounds.add(glm::vec3(-3, 0, -2));
    bounds.add(glm::vec3(5, 4, 7));
    return bounds;
}

TEST(Lights, EveryShadowCasterAndReceiverIsInsideTheSunsView) {
    Profile profile;
    for (const glm::vec3& direction : {glm::vec3(0, -1, 0), glm::vec3(1, -1, 0.3f), glm::vec3(0, 0, 1)}) {
        const Light sun{.kind = LightKind::directional, .direction = glm::normalize(direction)};
        const LightSetup setup = set_up_lights({sun}, room(), profile, true);
        ASSERT_EQ(setup.shadow_views.size(), 1u);
        for (int corner = 0; corner < 8; ++corner) {
            const glm::vec3 point((corner & 1) != 0 ? 5 : -3, (corner & 2) != 0 ? 4 : 0, (corner & 4) != 0 ? 7 : -2);
            const glm::vec4 clip = setup.shadow_views[0] * glm::vec4(point, 1.0f);
            EXPECT_EQ(clip.w, 1.0f);
            EXPECT_LE(std::abs(clip.x), 1.0f);
            EXPECT_LE(std::abs(clip.y), 1.0f);
            EXPECT_GT(clip.z, 0.0f);
            EXPECT_LT(clip.z, 1.0f);
        }
        // Nearer to the light is larger.
        const glm::vec4 a = setup.shadow_views[0] * glm::vec4(0, 2, 0, 1);
        const glm::vec4 b = setup.shadow_views[0] * glm::vec4(glm::vec3(0, 2, 0) + sun.direction, 1);
        EXPECT_GT(a.z, b.z);
    }
}

TEST(Lights, PointLightsTakeSixViewsThatSeeAllDirections) {
    Profile profile;
    const Light lamp{.kind = LightKind::point, .position = {1, 2, 1}};
    const LightSetup setup = set_up_lights({lamp}, room(), profile, true);
    ASSERT_EQ(setup.shadow_views.size(), 6u);
    const glm::vec3 axes[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    for (int face = 0; face < 6; ++face) {
        const glm::vec4 clip = setup.shadow_views[face] * glm::vec4(lamp.position + axes[face], 1.0f);
        EXPECT_NEAR(clip.x / clip.w, 0.0f, 1e-5f);
        EXPECT_NEAR(clip.y / clip.w, 0.0f, 1e-5f);
        EXPECT_GT(clip.w, 0.0f);
    }
}

TEST(Lights, BudgetsAreKeptWithAWarning) {
    Profile profile;
    profile.name = "small";
    profile.lights = 2;
    profile.shadow_views = 6;
    std::vector<Light> lights(3, Light{.kind = LightKind::point, .position = {0, 2, 0}});
    lights[0].intensity = 1.0f;
    lights[1].intensity = 100.0f;
    lights[2].intensity = 50.0f;
    const LightSetup setup = set_up_lights(lights, room(), profile, true);
    ASSERT_EQ(setup.lights.size(), 2u);
    EXPECT_EQ(setup.lights[0].color.r, 100.0f);
    EXPECT_EQ(setup.lights[1].color.r, 50.0f);
    EXPECT_EQ(setup.shadow_views.size(), 6u);
    EXPECT_EQ(setup.lights[1].direction.w, -1.0f);
    EXPECT_EQ(setup.warnings.size(), 2u);
}

TEST(Lights, DarkLightsAreNoLights) {
    Light dark{.kind = LightKind::directional, .intensity = 0.0f};
    EXPECT_TRUE(set_up_lights({dark}, room(), Profile{}, true).lights.empty());
}

TEST(Lights, WideSpotsAreSurrounded) {
    Light spot{.kind = LightKind::spot, .position = {0, 3, 0}};
    spot.outer_cone_angle = 0.5f;
    EXPECT_EQ(set_up_lights({spot}, room(), Profile{}, true).shadow_views.size(), 1u);
    spot.outer_cone_angle = 1.5707f;
    EXPECT_EQ(set_up_lights({spot}, room(), Profile{}, true).shadow_views.size(), 6u);
}

TEST(Lights, ListsHaveFewLengths) {
    EXPECT_EQ(list_capacity(0), 0u);
    EXPECT_EQ(list_capacity(1), 1u);
    EXPECT_EQ(list_capacity(5), 8u);
    EXPECT_EQ(list_capacity(8), 8u);
    Light sun{.kind = LightKind::directional};
    const LightSetup setup = set_up_lights({sun}, room(), Profile{}, true);
    EXPECT_EQ(light_block(setup, 4, 2).size(), 16u + 4 * 64 + 2 * 64);
}

}  // namespace
}  // namespace nacre::passes
