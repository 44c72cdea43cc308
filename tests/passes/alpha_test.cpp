// SPDX-License-Identifier: Apache-2.0
#include "scene/shapes.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(Alpha);

materials::MaterialDescription glow(const glm::vec3& color, float alpha, materials::AlphaMode mode) {
    materials::MaterialDescription material{.name = "glow"};
    material.base_color = glm::vec4(color, alpha);
    material.alpha_mode = mode;
    material.unlit = true;
    material.double_sided = true;
    return material;
}

scene::Primitive sheet(float z) { return scene::parallelogram({-1, -1, z}, {2, 0, 0}, {0, 2, 0}); }

// Two panes over a wall, given from near to far: each takes its coverage of what is behind it.
TEST_P(Alpha, PanesAreLaidOverFromFarToNear) {
    scene::Scene scene = empty_scene();
    place(scene, sheet(2.0f), add_material(scene, glow({1, 0, 0}, 0.5f, materials::AlphaMode::blend)));
    place(scene, sheet(1.0f), add_material(scene, glow({0, 1, 0}, 0.25f, materials::AlphaMode::blend)));
    place(scene, sheet(0.0f), add_material(scene, glow({0, 0, 1}, 1.0f, materials::AlphaMode::opaque)));
    const Shot shot = render(scene, {.width = 32, .height = 32, .exposure_ev = 0.0f});
    const glm::vec3 seen = shot.radiance_at(16, 16);
    // Packed targets hold 9 bits of color.
    EXPECT_NEAR(seen.r, 0.5f, 2e-3f);
    EXPECT_NEAR(seen.g, 0.5f * 0.25f, 2e-3f);
    EXPECT_NEAR(seen.b, 0.5f * 0.75f, 2e-3f);
}

// The order follows the camera, not the file.
TEST_P(Alpha, OrderFollowsTheCamera) {
    scene::Scene scene = empty_scene();
    place(scene, sheet(-1.0f), add_material(scene, glow({1, 0, 0}, 0.5f, materials::AlphaMode::blend)));
    place(scene, sheet(1.0f), add_material(scene, glow({0, 1, 0}, 0.5f, materials::AlphaMode::blend)));
    Shot shot = render(scene, {.width = 32, .height = 32, .exposure_ev = 0.0f});
    EXPECT_NEAR(shot.radiance_at(16, 16).g, 0.5f, 2e-3f);
    EXPECT_NEAR(shot.radiance_at(16, 16).r, 0.25f, 2e-3f);
    // From behind, red is in front.
    scene::Camera camera = scene.cameras[0];
    camera.world = glm::mat4(-1.0f);
    camera.world[1][1] = 1.0f;
    camera.world[3] = glm::vec4(0, 0, -10, 1);
    shot.renderer->set_camera(camera);
    ASSERT_TRUE(shot.renderer->render_frame());
    auto picture = shot.renderer->read_final();
    ASSERT_TRUE(picture);
    shot.picture = *picture;
    EXPECT_NEAR(shot.radiance_at(16, 16).r, 0.5f, 2e-3f);
    EXPECT_NEAR(shot.radiance_at(16, 16).g, 0.25f, 2e-3f);
}

// A pane behind a wall is not seen.
TEST_P(Alpha, WallsHidePanes) {
    scene::Scene scene = empty_scene();
    place(scene, sheet(-1.0f), add_material(scene, glow({1, 0, 0}, 0.5f, materials::AlphaMode::blend)));
    place(scene, sheet(0.0f), add_material(scene, glow({0, 0, 1}, 1.0f, materials::AlphaMode::opaque)));
    const Shot shot = render(scene, {.width = 32, .height = 32, .exposure_ev = 0.0f});
    EXPECT_EQ(shot.radiance_at(16, 16).r, 0.0f);
}

// Vertex alpha against the cutoff: left of the middle nothing is there.
TEST_P(Alpha, MaskedSurfacesEndAtTheirCutoff) {
    scene::Scene scene = empty_scene();
    scene::Primitive primitive = sheet(0.0f);
    for (const glm::vec3& position : primitive.positions)
        primitive.colors.emplace_back(1, 1, 1, 0.5f * (position.x + 1.0f));
    materials::MaterialDescription material = glow({0.5f, 0.5f, 0.5f}, 1.0f, materials::AlphaMode::mask);
    material.alpha_cutoff = 0.5f;
    place(scene, primitive, add_material(scene, material));
    const Shot shot = render(scene, {.width = 64, .height = 16, .exposure_ev = 0.0f});
    EXPECT_EQ(shot.radiance_at(30, 8).g, 0.0f);
    EXPECT_NEAR(shot.radiance_at(33, 8).g, 0.5f, 4e-3f);
    EXPECT_TRUE(shot.has_pass("alpha test prepass"));
}

}  // namespace
}  // namespace nacre::test
