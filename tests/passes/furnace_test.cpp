// SPDX-License-Identifier: Apache-2.0
#include "scene/shapes.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(Furnace);

/// A 4 x 4 grid of balls in a white room.
scene::Scene white_room(float metallic, float ior) {
    scene::Scene scene = empty_scene();
    scene.environment = uniform_environment(glm::vec3(1.0f));
    for (int i = 0; i < 16; ++i) {
        materials::MaterialDescription material{.name = "white"};
        material.metallic = metallic;
        material.roughness = static_cast<float>(i) / 15.0f;
        material.ior = ior;
        const std::uint32_t index = add_material(scene, material);
        glm::mat4 transform(1.0f);
        transform[3] =
            glm::vec4(-0.75f + 0.5f * static_cast<float>(i % 4), -0.75f + 0.5f * static_cast<float>(i / 4), 0, 1);
        place(scene, scene::sphere(0.22f, 48, 24), index, transform);
    }
    return scene;
}

void expect_all_white(const Shot& shot, float tolerance) {
    float lowest = 2.0f, highest = 0.0f;
    for (const float value : shot.picture.radiance.pixels) {
        lowest = std::min(lowest, value);
        highest = std::max(highest, value);
    }
    EXPECT_GE(lowest, 1.0f - tolerance);
    EXPECT_LE(highest, 1.0f + tolerance);
}

// What reflects all light in an evenly lit room cannot be seen in it. Half floats hold 1 to 5e-4.
TEST_P(Furnace, WhiteMetalVanishes) {
    expect_all_white(render(white_room(1.0f, 1.5f), {.width = 128, .height = 128, .exposure_ev = 0.0f}), 1e-3f);
}

TEST_P(Furnace, WhiteDielectricVanishes) {
    expect_all_white(render(white_room(0.0f, 1.5f), {.width = 128, .height = 128, .exposure_ev = 0.0f}), 1.5e-3f);
}

TEST_P(Furnace, DenseDielectricVanishes) {
    expect_all_white(render(white_room(0.0f, 4.0f), {.width = 128, .height = 128, .exposure_ev = 0.0f}), 1.5e-3f);
}

// Without an environment, lights and emission nothing is lit, and nothing divides by the nothing.
TEST_P(Furnace, DarkRoomIsBlack) {
    scene::Scene scene = white_room(0.5f, 1.5f);
    scene.environment = uniform_environment(glm::vec3(0.0f));
    const Shot shot = render(scene, {.width = 64, .height = 64});
    for (const float value : shot.picture.radiance.pixels) ASSERT_EQ(value, 0.0f);
    EXPECT_EQ(shot.statistics.exposure_ev, 0.0);
}

TEST_P(Furnace, NothingAtAllShowsTheEnvironment) {
    scene::Scene scene = empty_scene();
    scene.environment = uniform_environment({0.25f, 0.5f, 2.0f});
    const Shot shot = render(scene, {.width = 33, .height = 17, .exposure_ev = 0.0f});
    const glm::vec3 seen = shot.radiance_at(16, 8);
    EXPECT_NEAR(seen.r, 0.25f, 1e-3f);
    EXPECT_NEAR(seen.g, 0.5f, 1e-3f);
    EXPECT_NEAR(seen.b, 2.0f, 2e-3f);
    EXPECT_FALSE(shot.has_pass("lighting"));
}

}  // namespace
}  // namespace nacre::test
