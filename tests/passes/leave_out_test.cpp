// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "scene/builtin.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

using passes::Feature;

RENDERER_SUITE(LeaveOut);

struct OptionalFeature {
    const char* name;
    Feature feature;
    void (*add)(scene::Scene&);  ///< Makes the plain scene use it.
    void (*prepare)(scene::Scene&) = [](scene::Scene&) {};  ///< What the plain scene needs to be comparable.
};

int add_image(scene::Scene& scene, scene::ColorSpace color_space) {
    scene::Image image{.name = "image", .color_space = color_space, .width = 2, .height = 2};
    image.pixels = std::make_shared<std::vector<std::uint8_t>>(16, std::uint8_t{128});
    scene.images.push_back(image);
    return static_cast<int>(scene.images.size()) - 1;
}

const OptionalFeature optional_features[] = {
    {"emission", Feature::emission, [](scene::Scene& s) { s.materials[0].emissive = glm::vec3(1.0f); }},
    {"alpha test", Feature::alpha_test,
     [](scene::Scene& s) { s.materials[0].alpha_mode = materials::AlphaMode::mask; }},
    {"blend", Feature::blend, [](scene::Scene& s) { s.materials[1].alpha_mode = materials::AlphaMode::blend; }},
    {"unlit", Feature::unlit, [](scene::Scene& s) { s.materials[1].unlit = true; }},
    {"shadows", Feature::shadows, [](scene::Scene& s) { s.lights[0].casts_shadows = true; },
     [](scene::Scene& s) {
         s.lights.push_back(directional_light({0, -1, -1}, 1.0f));
         s.lights[0].casts_shadows = false;
     }},
    {"lights", Feature::lights,
     [](scene::Scene& s) {
         s.lights.push_back(directional_light({0, -1, -1}, 1.0f));
         s.lights.back().casts_shadows = false;
     }},
    {"normal maps", Feature::normal_maps,
     [](scene::Scene& s) {
         s.materials[0].normal_texture = {.image = add_image(s, scene::ColorSpace::linear), .sampler = 0};
         for (scene::Primitive& p : s.meshes[0].primitives) p.tangents.assign(p.positions.size(), {1, 0, 0, 1});
     }},
    {"occlusion", Feature::occlusion,
     [](scene::Scene& s) {
         s.materials[0].occlusion_texture = {.image = add_image(s, scene::ColorSpace::linear), .sampler = 0};
     }},
    {"vertex colors", Feature::vertex_colors,
     [](scene::Scene& s) {
         for (scene::Primitive& p : s.meshes[0].primitives) p.colors.assign(p.positions.size(), glm::vec4(0.5f));
     }},
    {"texture transforms", Feature::texture_transforms,
     [](scene::Scene& s) { s.materials[1].base_color_texture.transform.offset.x = 0.5f; }},
    {"closures", Feature::closures,
     [](scene::Scene& s) { s.materials[0].clearcoat = materials::Clearcoat{.factor = 1.0f}; }},
    {"specular textures", Feature::specular_textures,
     [](scene::Scene& s) {
         s.materials[0].specular = materials::Specular{};
         s.materials[0].specular->texture = {.image = add_image(s, scene::ColorSpace::linear), .sampler = 0};
     }},
};

/// Two sheets, one with a texture.
scene::Scene plain_scene() {
    scene::Scene scene = empty_scene();
    scene.environment = uniform_environment(glm::vec3(1.0f));
    materials::MaterialDescription textured{.name = "textured"};
    textured.base_color_texture = {.image = add_image(scene, scene::ColorSpace::srgb), .sampler = 0};
    place(scene, sheet(0.0f), add_material(scene, materials::MaterialDescription{.name = "plain"}));
    place(scene, sheet(1.0f), add_material(scene, textured));
    return scene;
}

void expect_equal_plans(const passes::Plan& a, const passes::Plan& b, const char* feature) {
    EXPECT_EQ(a.passes, b.passes) << feature;
    EXPECT_EQ(a.resources, b.resources) << feature;
    EXPECT_EQ(a.left_out, b.left_out) << feature;
    EXPECT_EQ(a.transient_bytes, b.transient_bytes) << feature;
    EXPECT_EQ(a.persistent_bytes, b.persistent_bytes) << feature;
    EXPECT_EQ(a.geometry_bytes, b.geometry_bytes) << feature;
    EXPECT_EQ(a.texture_bytes, b.texture_bytes) << feature;
}

// For every optional feature, a scene without it gives the plan (passes, SPIR-V, memory) of a renderer that does not
// know it; and a scene with it gives another one, so that the comparison means something.
TEST_P(LeaveOut, WhatASceneDoesNotUseCostsNothing) {
    const passes::RenderOptions options{.width = 64, .height = 64, .exposure_ev = 0.0f};
    for (const OptionalFeature& optional : optional_features) {
        scene::Scene plain_one = plain_scene();
        optional.prepare(plain_one);
        const Shot plain = render(plain_one, options);
        passes::RenderOptions without = options;
        without.without = optional.feature;
        const Shot unknown = render(plain_one, without);
        expect_equal_plans(plain.renderer->plan(), unknown.renderer->plan(), optional.name);

        scene::Scene using_it = plain_one;
        optional.add(using_it);
        const Shot used = render(using_it, options);
        EXPECT_FALSE(plain.renderer->plan().passes == used.renderer->plan().passes) << optional.name;
        const Shot taken_away = render(using_it, without);
        // Geometry and textures that only the feature read are gone too.
        expect_equal_plans(plain.renderer->plan(), taken_away.renderer->plan(), optional.name);
    }
}

TEST_P(LeaveOut, MeteringIsLeftOutWhereTheExposureIsGiven) {
    EXPECT_TRUE(render(plain_scene(), {.width = 64, .height = 64}).has_pass("exposure"));
    EXPECT_FALSE(render(plain_scene(), {.width = 64, .height = 64, .exposure_ev = 1.0f}).has_pass("exposure"));
}

// The stencil part of the depth target exists for emission only.
TEST_P(LeaveOut, DepthHasStencilOnlyForEmission) {
    scene::Scene scene = plain_scene();
    const auto depth_format = [](const Shot& shot) {
        for (const auto& resource : shot.renderer->plan().resources) {
            if (resource.name == "depth") return resource.format;
        }
        return std::string();
    };
    EXPECT_EQ(depth_format(render(scene, {.width = 64, .height = 64})), "d32_float");
    scene.materials[0].emissive = glm::vec3(1.0f);
    EXPECT_NE(depth_format(render(scene, {.width = 64, .height = 64})), "d32_float");
}

}  // namespace
}  // namespace nacre::test
