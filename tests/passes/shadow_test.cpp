// SPDX-License-Identifier: Apache-2.0
#include "scene/shapes.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(Shadow);

constexpr std::uint32_t side = 256;

/// A floor of 2 x 2 m seen from above (the camera looks down -Z) and a tile of 0.4 x 0.4 m, 0.4 m above its middle.
scene::Scene floor_and_tile(bool masked = false) {
    scene::Scene scene = empty_scene();
    const std::uint32_t white = add_material(scene, matte(glm::vec3(1.0f)));
    place(scene, scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), white);
    std::uint32_t material = white;
    if (masked) {
        // A texture whose left half is not there.
        scene::Image image{.name = "half", .width = 2, .height = 1, .has_alpha = true};
        image.pixels = std::make_shared<std::vector<std::uint8_t>>(
            std::vector<std::uint8_t>{255, 255, 255, 0, 255, 255, 255, 255});
        scene.images.push_back(image);
        scene.samplers[0] = {.magnification = scene::Filter::nearest,
                             .minification = scene::Filter::nearest,
                             .mip = scene::MipFilter::none};
        materials::MaterialDescription leaf = matte(glm::vec3(1.0f));
        leaf.alpha_mode = materials::AlphaMode::mask;
        leaf.double_sided = true;
        leaf.base_color_texture = {.image = 0, .sampler = 0};
        material = add_material(scene, leaf);
    }
    place(scene, scene::parallelogram({-0.2f, -0.2f, 0.4f}, {0.4f, 0, 0}, {0, 0.4f, 0}), material);
    return scene;
}

std::uint32_t column_of(float x) { return static_cast<std::uint32_t>((x + 1.0f) * 0.5f * side); }

/// From where to where the middle row of the floor is darker than half of its light at x = -0.9, to the right of the
/// tile.
glm::vec2 shadow_range(const Shot& shot, const scene::Scene&, float from, float to, float lit_at) {
    const std::uint32_t row = side / 2 + 3;
    const float lit = shot.radiance_at(column_of(lit_at), row).g;
    float first = 2.0f, last = -2.0f;
    for (std::uint32_t x = column_of(from); x < column_of(to); ++x) {
        if (shot.radiance_at(x, row).g > 0.5f * lit) continue;
        const float position = (static_cast<float>(x) + 0.5f) / side * 2.0f - 1.0f;
        first = std::min(first, position);
        last = std::max(last, position);
    }
    return {first, last};
}

/// The white floor under 2 lux at 45 degrees.
float lit_floor(const RenderVariant& variant) {
    return static_cast<float>(2.0 * matte_value(variant, {0, 0, 1}, {0, 0, 1}, glm::normalize(glm::dvec3(-1, 0, 1))));
}

// The sun at 45 degrees moves the shadow by the tile's height.
TEST_P(Shadow, OfTheSunLiesWhereItMust) {
    scene::Scene scene = floor_and_tile();
    scene.lights.push_back(directional_light({1, 0, -1}, 2.0f));
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f, .keep_intermediates = true});
    const glm::vec2 range = shadow_range(shot, scene, 0.21f, 1.0f, 0.9f);
    // Under the tile's edge the floor cannot be seen; the shadow ends at 0.2 + 0.4.
    EXPECT_NEAR(range.x, 0.21f, 0.02f);
    EXPECT_NEAR(range.y, 0.6f, 0.02f);
    // Full light elsewhere: 2 lux at 45 degrees.
    const float lit = lit_floor(GetParam());
    EXPECT_NEAR(shot.radiance_at(column_of(0.8f), side / 2).g, lit, 2e-3f);
    EXPECT_NEAR(shot.radiance_at(column_of(-0.8f), side / 2).g, lit, 2e-3f);
    EXPECT_EQ(shot.radiance_at(column_of(0.4f), side / 2).g, 0.0f);
    // The tile itself is lit: no acne.
    for (std::uint32_t x = column_of(-0.18f); x < column_of(0.18f); ++x) {
        ASSERT_NEAR(shot.radiance_at(x, side / 2).g, lit, 3e-3f) << x;
    }
}

TEST_P(Shadow, OfASpotLightLiesWhereItMust) {
    scene::Scene scene = floor_and_tile();
    scene::Light spot{.name = "spot", .kind = scene::LightKind::spot, .intensity = 5.0f, .position = {-0.6f, 0, 1.2f}};
    spot.direction = glm::normalize(glm::vec3(0.6f, 0, -1.2f));
    spot.outer_cone_angle = 0.9f;
    spot.inner_cone_angle = 0.85f;
    scene.lights.push_back(spot);
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    // Seen from the light, the tile's right edge (0.2, 0.4) falls on the floor at -0.6 + 0.8 * 1.2 / 0.8 = 0.6.
    EXPECT_NEAR(shadow_range(shot, scene, 0.21f, 0.75f, 0.7f).y, 0.6f, 0.02f);
    EXPECT_EQ(shot.radiance_at(column_of(0.4f), side / 2).g, 0.0f);
}

TEST_P(Shadow, OfAPointLightLiesWhereItMust) {
    scene::Scene scene = floor_and_tile();
    scene.lights.push_back(
        {.name = "lamp", .kind = scene::LightKind::point, .intensity = 5.0f, .position = {-0.6f, 0, 1.2f}});
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    EXPECT_NEAR(shadow_range(shot, scene, 0.21f, 0.75f, 0.7f).y, 0.6f, 0.03f);
    EXPECT_EQ(shot.radiance_at(column_of(0.4f), side / 2).g, 0.0f);
    // Where faces of the cube of views meet there is no seam: the light falls off smoothly to the left.
    for (std::uint32_t x = 2; x < column_of(-0.3f); ++x) {
        const float a = shot.radiance_at(x - 1, side / 2 + 5).g, b = shot.radiance_at(x, side / 2 + 5).g;
        ASSERT_NEAR(a, b, 0.05f * b) << x;
    }
}

TEST_P(Shadow, LightPassesWhereAMaskedSurfaceIsNot) {
    scene::Scene scene = floor_and_tile(true);
    scene.lights.push_back(directional_light({1, 0, -1}, 2.0f));
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    // Only the right half of the tile, 0 to 0.2, is there: its shadow goes from 0.4 to 0.6.
    const glm::vec2 range = shadow_range(shot, scene, 0.25f, 1.0f, 0.9f);
    EXPECT_NEAR(range.x, 0.4f, 0.02f);
    EXPECT_NEAR(range.y, 0.6f, 0.02f);
    // And through the other half the floor is seen.
    EXPECT_NEAR(shot.radiance_at(column_of(-0.1f), side / 2).g, lit_floor(GetParam()), 2e-3f);
}

TEST_P(Shadow, ALightThatCastsNoneHasNone) {
    scene::Scene scene = floor_and_tile();
    scene.lights.push_back(directional_light({1, 0, -1}, 2.0f));
    scene.lights[0].casts_shadows = false;
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    EXPECT_NEAR(shot.radiance_at(column_of(0.4f), side / 2).g, lit_floor(GetParam()), 2e-3f);
    EXPECT_FALSE(shot.has_pass("shadow maps"));
}

}  // namespace
}  // namespace nacre::test
