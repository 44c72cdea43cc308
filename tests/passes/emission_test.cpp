// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "materials/building_blocks.h"
#include "materials/evaluation.h"
#include "materials/simplification.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(Emission);

materials::MaterialDescription lamp(const glm::vec3& emission) {
    materials::MaterialDescription material = matte(glm::vec3(0.0f));
    material.emissive = emission;
    return material;
}

TEST_P(Emission, IsAddedToWhatIsReflected) {
    scene::Scene scene = empty_scene();
    scene.environment = uniform_environment(glm::vec3(1.0f));
    materials::MaterialDescription material = matte(glm::vec3(0.25f));
    material.emissive = {1.0f, 0.5f, 0.0f};
    material.emissive_strength = 4.0f;
    place(scene, sheet(0.0f), add_material(scene, material));
    const Shot shot = render(scene, {.width = 32, .height = 32, .exposure_ev = 0.0f});
    EXPECT_NEAR(shot.radiance_at(16, 16).r, 4.25f, 0.02f);
    EXPECT_NEAR(shot.radiance_at(16, 16).g, 2.25f, 0.02f);
    EXPECT_NEAR(shot.radiance_at(16, 16).b, 0.25f, 5e-3f);
}

// Light from below a coat has its color, and that of a tree without the plain slab's emission is seen as well.
TEST_P(Emission, IsTintedByTheLayersAbove) {
    materials::Tree tree{.name = "lamp"};
    materials::Slab glow{.albedo = glm::vec3(0.0f)};
    glow.features = materials::slab_emission;
    glow.emission = {4.0f, 2.0f, 3.0f};
    const materials::NodeIndex base = tree.add(glow, "glow");
    materials::add(tree, materials::CoatedLayer{.coat_color = {0.9f, 0.25f, 0.04f}, .coat_roughness = 0.3f}, base);
    // Where a pixel holds no more than one plain slab, that stands for both, with the emission blended into it.
    const bool is_plain = GetParam().profile == "mobile";
    const auto simple = materials::simplify(tree, {.closures = is_plain ? 1u : 8u, .bytes = is_plain ? 12u : 256u});
    ASSERT_TRUE(simple) << simple.error().message();
    const auto flat = materials::flatten(simple->steps.back().tree, simple->steps.back().flatten);
    ASSERT_TRUE(flat) << flat.error().message();
    materials::MaterialDescription material{.name = "lamp"};
    material.tree = std::make_shared<const materials::Tree>(tree);
    scene::Scene scene = empty_scene();
    place(scene, sheet(0.0f), add_material(scene, material));
    const Shot shot = render(scene, {.width = 32, .height = 32, .exposure_ev = 0.0f});
    glm::dvec3 expected(0.0);
    for (const materials::ShadedClosure& closure : materials::shade(*flat, {0.0, 0.0, 1.0}).closures) {
        if ((closure.slab.features & materials::slab_emission) != 0)
            expected += closure.path.weight * closure.coverage * closure.slab.emission;
    }
    const glm::vec3 seen = shot.radiance_at(16, 16);
    EXPECT_LT(expected.b, 1.0) << "the coat takes blue light";
    // Plain slabs come with packed targets: half a step of 9 bits below the exponent of the largest channel.
    const double largest = std::max({expected.r, expected.g, expected.b});
    const double half_step = is_plain ? std::exp2(std::floor(std::log2(largest)) - 9.0) : 0.0;
    for (int channel = 0; channel < 3; ++channel)
        EXPECT_NEAR(seen[channel], expected[channel], std::max(0.01 * expected[channel], half_step));
}

// Faces that coincide give their light once, and hidden ones none.
TEST_P(Emission, CoincidingFacesShineOnce) {
    scene::Scene scene = empty_scene();
    const std::uint32_t material = add_material(scene, lamp(glm::vec3(2.0f)));
    place(scene, sheet(0.0f), material);
    place(scene, sheet(0.0f), material);
    place(scene, sheet(-1.0f), material);
    const Shot shot = render(scene, {.width = 32, .height = 32, .exposure_ev = 0.0f});
    for (std::uint32_t y = 0; y < 32; ++y) {
        for (std::uint32_t x = 0; x < 32; ++x) ASSERT_NEAR(shot.radiance_at(x, y).g, 2.0f, 5e-3f) << x << ", " << y;
    }
}

TEST_P(Emission, OfAnySizeStaysFinite) {
    scene::Scene scene = empty_scene();
    materials::MaterialDescription material = lamp(glm::vec3(1.0f));
    material.emissive_strength = 1e38f;
    place(scene, sheet(0.0f), add_material(scene, material));
    const Shot shot = render(scene, {.width = 32, .height = 32});
    EXPECT_GT(shot.radiance_at(16, 16).g, 6e4f);
    EXPECT_TRUE(std::isfinite(shot.statistics.exposure_ev));
}

}  // namespace
}  // namespace nacre::test
