// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "materials/closures/library.h"
#include "passes/gbuffer_layout.h"
#include "passes/profiles.h"
#include "scene/shapes.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

using passes::decode_field;
using passes::fields_of;

RENDERER_SUITE(Lighting);

constexpr std::uint32_t side = 128;
constexpr glm::dvec3 to_viewer(0.0, 0.0, 1.0);

/// The unit ball in the middle of the picture; x and y of a pixel's center on it.
glm::dvec2 plane_position(std::uint32_t x, std::uint32_t y) {
    return {(x + 0.5) / side * 2.0 - 1.0, 1.0 - (y + 0.5) / side * 2.0};
}

scene::Scene ball(const materials::MaterialDescription& material) {
    scene::Scene scene = empty_scene();
    place(scene, scene::sphere(0.9f, 256, 128), add_material(scene, material));
    return scene;
}

// A diffuse ball under a directional light.
TEST_P(Lighting, MatteBallUnderTheSun) {
    scene::Scene scene = ball(matte({0.64f, 0.25f, 0.04f}));
    scene::Light sun = directional_light({-0.6f, -0.5f, -1.0f}, 3.0f);
    sun.casts_shadows = false;
    scene.lights.push_back(sun);
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    int compared = 0;
    for (std::uint32_t y = 0; y < side; ++y) {
        for (std::uint32_t x = 0; x < side; ++x) {
            const glm::dvec2 p = plane_position(x, y) / 0.9;
            const double rest = 1.0 - glm::dot(p, p);
            if (rest < 0.1) continue;  // the facets of the mesh show at the rim
            const glm::dvec3 normal(p, std::sqrt(rest));
            const glm::vec3 seen = shot.radiance_at(x, y);
            const double expected = 0.64 * 3.0 * matte_value(GetParam(), normal, to_viewer, -glm::dvec3(sun.direction));
            // Albedo has steps of 1 % at 8 bits, the normal of 1e-3.
            ASSERT_NEAR(seen.r, expected, 0.01 * expected + 2e-3) << x << ", " << y;
            ASSERT_NEAR(seen.g, expected * 0.25 / 0.64, 0.01 * expected + 2e-3);
            ++compared;
        }
    }
    EXPECT_GT(compared, 5000);
}

// Every pixel of a lit ball against the closure evaluated in double precision from the same G-buffer words.
TEST_P(Lighting, AgreesWithTheClosureInDoublePrecision) {
    using materials::closures::Library;
    Library library;
    struct Case {
        float metallic, roughness, ior, specular;
    };
    const bool is_lambert =
        (*passes::find_profile(GetParam().profile))->diffuse_model == passes::DiffuseModel::lambert;
    for (const Case& c : {Case{0.0f, 0.1f, 1.5f, 1.0f}, Case{0.0f, 0.6f, 2.0f, 0.5f}, Case{1.0f, 0.3f, 1.5f, 1.0f},
                          Case{1.0f, 1.0f, 1.5f, 1.0f}, Case{0.5f, 0.0f, 1.5f, 1.0f}}) {
        materials::MaterialDescription material{.name = "model"};
        material.base_color = {0.9f, 0.5f, 0.2f, 1.0f};
        material.metallic = c.metallic;
        material.roughness = c.roughness;
        material.ior = c.ior;
        material.specular = materials::Specular{.factor = c.specular};
        scene::Scene scene = ball(material);
        scene::Light sun = directional_light({-0.4f, -0.8f, -1.0f}, 2.0f);
        sun.casts_shadows = false;
        scene.lights.push_back(sun);
        const Shot shot =
            render(scene, {.width = side, .height = side, .exposure_ev = 0.0f, .keep_intermediates = true});
        const auto words_0 = shot.intermediate<std::uint32_t>("material.0");
        const auto words_1 = shot.intermediate<std::uint32_t>("material.1");
        const auto tops = shot.intermediate<std::uint32_t>("top_layer");
        ASSERT_EQ(words_0.size(), std::size_t{side} * side);
        const auto field = [](const char* name, std::uint32_t word) {
            for (const passes::Field& f : passes::gbuffer_fields()) {
                if (f.name == name) return decode_field(f, word);
            }
            return std::array<float, 3>{};
        };
        const glm::dvec3 l = -glm::dvec3(sun.direction);
        double worst = 0.0;
        int compared = 0;
        for (std::uint32_t i = 0; i < words_0.size(); ++i) {
            if (field("pixel_class", words_0[i])[0] != 1.0f) continue;
            const glm::dvec3 diffuse(field("diffuse_r", words_0[i])[0], field("diffuse_g", words_0[i])[0],
                                     field("diffuse_b", words_0[i])[0]);
            const glm::dvec3 f0(field("f0_r", words_1[i])[0], field("f0_g", words_1[i])[0],
                                field("f0_b", words_1[i])[0]);
            const auto n = field("normal", tops[i]);
            const glm::dvec3 normal = glm::normalize(glm::dvec3(n[0], n[1], n[2]));
            if (normal.z < 1e-3) continue;
            const double f90 = field("f90", words_1[i])[0];
            Library::Slab slab{.features = 0, .coverage = 1.0, .f0 = f0, .albedo = diffuse};
            slab.roughness = std::max(double{field("roughness", tops[i])[0]}, 0.045);
            Library::Fresnel bare = library.slab_fresnel(slab);
            bare.grazing = glm::min(bare.grazing, glm::dvec3(f90));
            const Library::Closure closure =
                library.prepare_closure_under(slab, bare, in_frame_of(normal, to_viewer), 0.0);
            const glm::dvec3 light = in_frame_of(normal, l);
            const Library::ClosureValue value = library.evaluate_closure(closure, light);
            const double lobe = is_lambert ? library.lambert_diffuse(light)
                                           : library.chan_diffuse_of(closure.chan, std::max(light.z, 0.0),
                                                                     library.half_vector_cosine(closure.view, light),
                                                                     library.half_vector(closure.view, light).z);
            const glm::dvec3 expected = 2.0 * (value.specular + closure.diffuse * lobe);
            const glm::vec3 seen = shot.radiance_at(i % side, i / side);
            // Half floats have 11 bits; below 1e-4 their steps are even.
            for (int channel = 0; channel < 3; ++channel) {
                worst = std::max(worst, std::abs(seen[channel] - expected[channel]) / (expected[channel] + 2e-3));
            }
            ++compared;
        }
        EXPECT_GT(compared, 5000);
        EXPECT_LT(worst, 5e-3) << "metallic " << c.metallic << " roughness " << c.roughness;
    }
}

// A point light over a matte floor: candela / distance^2, fading to nothing at its range.
TEST_P(Lighting, PointLightFollowsDistanceAndRange) {
    scene::Scene scene = empty_scene();
    place(scene, scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), add_material(scene, matte(glm::vec3(1.0f))));
    scene::Light lamp{.name = "lamp", .kind = scene::LightKind::point, .intensity = 2.0f, .position = {0, 0, 0.5f}};
    lamp.range = 0.9f;
    lamp.casts_shadows = false;
    scene.lights.push_back(lamp);
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    for (std::uint32_t x = 0; x < side; ++x) {
        const glm::dvec2 p = plane_position(x, side / 2);
        const double distance2 = glm::dot(p, p) + 0.25;
        const double window = std::clamp(1.0 - std::pow(distance2 / 0.81, 2.0), 0.0, 1.0);
        const glm::dvec3 to_light = glm::normalize(glm::dvec3(-p, 0.5));
        const double expected = 2.0 * window / distance2 * matte_value(GetParam(), to_viewer, to_viewer, to_light);
        ASSERT_NEAR(shot.radiance_at(x, side / 2).g, expected, 2e-3 * expected + 1e-4) << x;
    }
}

// A spot light: full inside the inner cone, nothing outside the outer one, the glTF falloff between.
TEST_P(Lighting, SpotLightFollowsItsCone) {
    scene::Scene scene = empty_scene();
    place(scene, scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), add_material(scene, matte(glm::vec3(1.0f))));
    scene::Light lamp{.name = "spot", .kind = scene::LightKind::spot, .intensity = 4.0f, .position = {0, 0, 1}};
    lamp.direction = {0, 0, -1};
    lamp.inner_cone_angle = 0.3f;
    lamp.outer_cone_angle = 0.6f;
    lamp.casts_shadows = false;
    scene.lights.push_back(lamp);
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    for (std::uint32_t x = 0; x < side; ++x) {
        const glm::dvec2 p = plane_position(x, side / 2);
        const double distance2 = glm::dot(p, p) + 1.0, cosine = 1.0 / std::sqrt(distance2);
        const double scale = 1.0 / (std::cos(0.3) - std::cos(0.6));
        const double falloff = std::pow(std::clamp(scale * (cosine - std::cos(0.6)), 0.0, 1.0), 2.0);
        const glm::dvec3 to_light = glm::normalize(glm::dvec3(-p, 1.0));
        const double expected = 4.0 * falloff / distance2 * matte_value(GetParam(), to_viewer, to_viewer, to_light);
        ASSERT_NEAR(shot.radiance_at(x, side / 2).g, expected, 5e-3 * expected + 5e-4) << x;
    }
}

// Unlit surfaces ignore lights; their color is the base color.
TEST_P(Lighting, UnlitIsShownAsItIs) {
    materials::MaterialDescription material{.name = "unlit"};
    material.base_color = {0.25f, 0.5f, 1.0f, 1.0f};
    material.unlit = true;
    scene::Scene scene = ball(material);
    scene.lights.push_back(directional_light({0, 0, -1}, 10.0f));
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    EXPECT_NEAR(shot.radiance_at(side / 2, side / 2).r, 0.25f, 3e-3f);
    EXPECT_NEAR(shot.radiance_at(side / 2, side / 2).g, 0.5f, 4e-3f);
    EXPECT_NEAR(shot.radiance_at(side / 2, side / 2).b, 1.0f, 1e-3f);
    EXPECT_FALSE(shot.has_pass("shadow maps"));
}

// Mirrored and unevenly scaled instances keep their outward normals.
TEST_P(Lighting, NormalsSurviveMirroringAndScale) {
    scene::Scene scene = empty_scene();
    const std::uint32_t material = add_material(scene, matte(glm::vec3(1.0f)));
    glm::mat4 left(1.0f), right(1.0f);
    left[0][0] = 0.4f, left[1][1] = 0.8f, left[2][2] = 1e-3f, left[3] = glm::vec4(-0.5f, 0, 0, 1);
    right[0][0] = -0.4f, right[1][1] = 0.8f, right[2][2] = 1e-3f, right[3] = glm::vec4(0.5f, 0, 0, 1);
    place(scene, scene::sphere(1.0f, 32, 16), material, left);
    place(scene, scene::sphere(1.0f, 32, 16), material, right);
    const double lobe = matte_value(GetParam(), to_viewer, to_viewer, to_viewer);
    scene::Light sun = directional_light({0, 0, -1}, static_cast<float>(1.0 / lobe));
    sun.casts_shadows = false;
    scene.lights.push_back(sun);
    const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
    // Flattened by a thousand, both look straight at the viewer.
    EXPECT_NEAR(shot.radiance_at(side / 4, side / 2).g, 1.0f, 5e-3f);
    EXPECT_NEAR(shot.radiance_at(3 * side / 4, side / 2).g, 1.0f, 5e-3f);
    EXPECT_NEAR(shot.radiance_at(3 * side / 4 + 10, side / 2 + 10).g, 1.0f, 5e-3f);
}

}  // namespace
}  // namespace nacre::test
