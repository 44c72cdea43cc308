// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "materials/builtin_materials.h"
#include "materials/evaluation.h"
#include "materials/specular_table.h"
#include "materials/storage.h"
#include "passes/gbuffer_layout.h"
#include "scene/builtin.h"
#include "scene/shapes.h"
#include "scene/tangents.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

using materials::closures::Library;

RENDERER_SUITE_OF(Closures, compiler_variants());

constexpr std::uint32_t side = 64;

materials::MaterialDescription described(std::string_view name) {
    materials::MaterialDescription material{.name = std::string(name)};
    material.tree = std::make_shared<const materials::Tree>(*materials::make_builtin_material(name));
    return material;
}

scene::Primitive ball() {
    scene::Primitive result = scene::sphere(0.9f, 128, 64);
    const std::vector<glm::vec2> uv = result.uv0;
    scene::add_tangents(result, uv);
    return result;
}

// The frame that the reader of stored frames makes of a normal, written apart from it: its tangent is x turned by the
// shortest rotation from +z (or -z) to the normal.
glm::dmat3 frame_of(const glm::dvec3& normal, double angle) {
    const double side_of = normal.z >= 0.0 ? 1.0 : -1.0;
    const glm::dvec3 pole(0.0, 0.0, side_of), axis = glm::cross(pole, normal);
    const double cosine = glm::dot(pole, normal);
    const auto turned = [&](const glm::dvec3& v) {
        return cosine * v + glm::cross(axis, v) + axis * (glm::dot(axis, v) / (1.0 + cosine));
    };
    const glm::dvec3 x = turned({1.0, 0.0, 0.0}), y = turned({0.0, side_of, 0.0});
    return {std::cos(angle) * x + std::sin(angle) * y, std::cos(angle) * y - std::sin(angle) * x, normal};
}

// Every pixel of lit balls against the closures evaluated in double precision from the same words.
TEST_P(Closures, LightingAgreesWithWhatIsStored) {
    Library library;
    library.tints = materials::tints_of(materials::default_specular_tables());
    const passes::Field normal_field = *std::ranges::find(passes::gbuffer_fields(), "normal", &passes::Field::name);
    const passes::Field roughness_field =
        *std::ranges::find(passes::gbuffer_fields(), "roughness", &passes::Field::name);
    for (const char* name : {"complex-coat", "silks-under-plastic", "single-sss", "special-speclut"}) {
        scene::Scene scene = empty_scene();
        place(scene, ball(), add_material(scene, described(name)));
        scene::Light sun = directional_light({-0.4f, -0.8f, -1.0f}, 2.0f);
        sun.casts_shadows = false;
        scene.lights.push_back(sun);
        const Shot shot =
            render(scene, {.width = side, .height = side, .exposure_ev = 0.0f, .keep_intermediates = true});
        const auto words_0 = shot.intermediate<std::uint32_t>("material.0"),
                   words_1 = shot.intermediate<std::uint32_t>("material.1");
        const auto tops = shot.intermediate<std::uint32_t>("top_layer");
        std::vector<std::vector<std::uint32_t>> slices;
        for (const passes::IntermediateDescription& description : shot.renderer->intermediates()) {
            for (std::uint32_t i = 0; description.name == "material.slices" && i < description.layers; ++i) {
                slices.push_back(shot.intermediate<std::uint32_t>("material.slices", i));
            }
        }
        if (GetParam().profile == "mobile") {
            EXPECT_TRUE(slices.empty()) << "a profile without storage images must do with the color targets";
            for (const std::uint32_t word : words_0) EXPECT_NE(word & 3u, 3u);
            continue;
        }
        const glm::dvec3 to_light = -glm::dvec3(sun.direction), to_viewer(0.0, 0.0, 1.0);
        int compared = 0;
        double worst = 0.0;
        for (std::uint32_t i = 0; i < words_0.size(); ++i) {
            if ((words_0[i] & 3u) != 3u) continue;
            materials::StoredPixel pixel{.words = {words_0[i], words_1[i]}};
            for (const auto& slice : slices) pixel.words.push_back(slice[i]);
            pixel.subsurface = pixel.words.back();
            pixel.roughness = passes::decode_field(roughness_field, tops[i])[0];
            const auto top = passes::decode_field(normal_field, tops[i]);
            const auto material = materials::unpack_pixel(pixel);
            ASSERT_TRUE(material) << material.error().message();
            glm::dvec3 expected(0.0);
            for (const materials::UnpackedClosure& stored : material->closures) {
                const glm::dvec3 normal =
                    stored.frame == 0 ? glm::dvec3(top[0], top[1], top[2]) : material->normals[stored.frame - 1];
                const glm::dmat3 to_local = glm::transpose(frame_of(normal, material->tangent_angles[stored.frame]));
                glm::dvec3 view = to_local * to_viewer;
                view = glm::normalize(glm::dvec3(view.x, view.y, std::max(view.z, 1e-4)));
                Library::Slab slab = stored.slab;
                slab.roughness = std::max(slab.roughness, 0.045);
                // 2 meters on 64 pixels.
                const Library::Closure closure = library.closure_below(slab, stored.path, view, 2.0 / side);
                const glm::dvec3 light = to_local * to_light;
                const Library::ClosureValue value = library.evaluate_closure(closure, light);
                expected += 2.0 * stored.path.weight * (value.specular + value.diffuse + value.subsurface) *
                            library.top_transmittance(stored.path, std::max(light.z, 0.0));
            }
            const glm::vec3 seen = shot.radiance_at(i % side, i / side);
            for (int channel = 0; channel < 3; ++channel) {
                worst = std::max(worst, std::abs(seen[channel] - expected[channel]) / (expected[channel] + 0.01));
            }
            ++compared;
        }
        EXPECT_GT(compared, 2000) << name;
        // Half floats have 11 bits; what is left is single precision.
        EXPECT_LT(worst, 3e-3) << name;
    }
}

// A mesh with colors looks like one whose material has them.
TEST_P(Closures, VertexColorsMultiplyTheBaseColor) {
    const glm::vec4 color(0.5f, 0.25f, 1.0f, 1.0f);
    for (const float metallic : {0.0f, 0.6f, 1.0f}) {
        const auto shot_of = [&](bool by_vertex) {
            scene::Scene scene = empty_scene();
            materials::MaterialDescription material{.name = "coated"};
            material.metallic = metallic;
            material.roughness = 0.5f;
            material.clearcoat = materials::Clearcoat{.factor = 1.0f, .roughness = 0.2f};
            if (!by_vertex) material.base_color = color;
            scene::Primitive shape = ball();
            if (by_vertex) shape.colors.assign(shape.positions.size(), color);
            place(scene, shape, add_material(scene, material));
            scene.lights.push_back(directional_light({-0.2f, -0.3f, -1.0f}, 2.0f));
            return render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
        };
        const Shot by_vertex = shot_of(true), by_material = shot_of(false);
        glm::vec3 sum(0.0f);
        for (std::uint32_t i = 0; i < side * side; ++i) {
            const glm::vec3 a = by_vertex.radiance_at(i % side, i / side),
                            b = by_material.radiance_at(i % side, i / side);
            for (int channel = 0; channel < 3; ++channel)
                ASSERT_NEAR(a[channel], b[channel], 0.02f * b[channel] + 2e-3f) << i;
            sum += b;
        }
        EXPECT_GT(sum.b, 1.3f * sum.g);
    }
}

// A scene's own tables tint what reflects: red alone, or nothing at all.
TEST_P(Closures, ReflectionsHaveTheTintsOfTheScenesTables) {
    const auto shot_of = [&](const glm::vec3& tint) {
        scene::Scene scene = empty_scene();
        materials::MaterialDescription material{.name = "tinted"};
        materials::Tree tree{.name = "tinted"};
        materials::Slab metal{.f0 = glm::vec3(0.9f), .roughness = 0.5f, .albedo = glm::vec3(0.0f)};
        metal.features = materials::slab_specular_lut;
        metal.specular_lut = 1;
        tree.add(metal);
        material.tree = std::make_shared<const materials::Tree>(tree);
        place(scene, ball(), add_material(scene, material));
        scene.lights.push_back(directional_light({-0.2f, -0.3f, -1.0f}, 2.0f));
        scene.specular_tables.resize(2);
        scene.specular_tables[1].entries.fill(tint);
        const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
        glm::dvec3 sum(0.0);
        for (std::uint32_t i = 0; i < side * side; ++i) sum += glm::dvec3(shot.radiance_at(i % side, i / side));
        return sum;
    };
    const glm::dvec3 white = shot_of(glm::vec3(1.0f)), red = shot_of({0.5f, 0.0f, 0.0f}),
                     black = shot_of(glm::vec3(0.0f));
    EXPECT_GT(white.g, 10.0);
    EXPECT_NEAR(red.r - black.r, 0.5 * (white.r - black.r), 0.01 * white.r);
    EXPECT_NEAR(red.g, black.g, 1e-3 * white.g);
    EXPECT_LT(black.r, 0.01 * white.r);
}

// A clear pane before a glowing one: what shows through is what the closures say that the view keeps.
TEST_P(Closures, WhatLiesBehindShowsThroughAsMuchAsTheTreeSays) {
    materials::MaterialDescription glass{.name = "glass"};
    glass.metallic = 0.0f;
    glass.roughness = 0.3f;
    glass.base_color = {0.5f, 0.25f, 1.0f, 1.0f};
    glass.transmission = materials::Transmission{.factor = 1.0f};
    materials::MaterialDescription glow{.name = "glow"};
    glow.unlit = true;
    scene::Scene scene = empty_scene();
    place(scene, scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), add_material(scene, glow));
    place(scene, scene::parallelogram({-1, -1, 1}, {2, 0, 0}, {0, 2, 0}), add_material(scene, glass));
    const Shot shot = render(scene, {.width = 16, .height = 16, .exposure_ev = 0.0f});
    // Straight down an interface of index 1.5 reflects about 4 percent, so that 0.96 of each channel's tint is left.
    const glm::vec3 seen = shot.radiance_at(8, 8);
    if (device().capabilities().dual_source_blending && GetParam().profile != "mobile") {
        EXPECT_NEAR(seen.r, 0.96f * 0.5f, 0.02f);
        EXPECT_NEAR(seen.g, 0.96f * 0.25f, 0.02f);
        EXPECT_NEAR(seen.b, 0.96f * 1.0f, 0.02f);
    } else {
        EXPECT_NEAR(seen.g, 0.96f * 0.5833f, 0.02f);
        EXPECT_NEAR(seen.r, seen.g, 1e-3f);
    }
}

// A coat that covers nearly nothing leaves the picture of the plain slab: both are shaded by the same closures.
// Compared are means over rings of a ball, since stored closures are dithered. What white textures multiply is what it
// was. Two textures of a blended tree once broke a driver.
TEST_P(Closures, WhiteTexturesLeaveWhatShowsThrough) {
    const auto seen = [&](bool is_textured) {
        scene::Scene scene = empty_scene();
        scene::Image white{.name = "white", .color_space = scene::ColorSpace::linear, .width = 1, .height = 1};
        white.pixels = std::make_shared<std::vector<std::uint8_t>>(std::vector<std::uint8_t>(4, 255));
        scene.images.push_back(white);
        materials::MaterialDescription glass{.name = "glass"};
        glass.metallic = 0.2f;
        glass.roughness = 0.3f;
        glass.base_color = {0.5f, 0.25f, 1.0f, 1.0f};
        glass.transmission = materials::Transmission{.factor = 0.8f};
        glass.double_sided = true;
        if (is_textured) glass.transmission->texture = glass.metallic_roughness_texture = {.image = 0};
        materials::MaterialDescription glow{.name = "glow"};
        glow.unlit = true;
        place(scene, scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), add_material(scene, glow));
        place(scene, scene::parallelogram({-1, -1, 1}, {2, 0, 0}, {0, 2, 0}), add_material(scene, glass));
        return render(scene, {.width = 16, .height = 16, .exposure_ev = 0.0f}).radiance_at(8, 8);
    };
    const glm::vec3 plain = seen(false), textured = seen(true);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(textured[i], plain[i], 1e-3f + 2e-3f * plain[i]);
}

TEST_P(Closures, EmptyCoatsLeaveWhatTheyCover) {
    constexpr int rings = 4;
    const auto ring_means = [&](const materials::MaterialDescription& material) {
        scene::Scene scene = empty_scene();
        place(scene, ball(), add_material(scene, material));
        scene::Light sun = directional_light({-0.6f, -0.5f, -0.6f}, 2.0f);
        sun.casts_shadows = false;
        scene.lights.push_back(sun);
        scene.environment = uniform_environment(glm::vec3(0.1f));
        const Shot shot = render(scene, {.width = side, .height = side, .exposure_ev = 0.0f});
        std::array<glm::dvec3, rings> sums{};
        std::array<int, rings> counts{};
        for (std::uint32_t y = 0; y < side; ++y) {
            for (std::uint32_t x = 0; x < side; ++x) {
                const double radius = std::hypot((x + 0.5) / side * 2.0 - 1.0, (y + 0.5) / side * 2.0 - 1.0) / 0.87;
                if (radius >= 1.0) continue;
                const auto ring = static_cast<std::size_t>(radius * rings);
                sums[ring] += glm::dvec3(shot.radiance_at(x, y));
                ++counts[ring];
            }
        }
        for (std::size_t i = 0; i < rings; ++i) sums[i] /= counts[i];
        return sums;
    };
    // With KHR_materials_specular as well: a factor below 1 dims the rim, which a plain slab and a tree say in two
    // ways.
    for (const auto& [metallic, roughness, specular] :
         {std::tuple{1.0f, 0.5f, 1.0f}, std::tuple{0.0f, 0.8f, 1.0f}, std::tuple{0.0f, 0.25f, 1.0f},
          std::tuple{0.0f, 0.25f, 0.2f}, std::tuple{0.4f, 0.5f, 0.0f}}) {
        materials::MaterialDescription bare{.name = "bare"};
        bare.base_color = {0.8f, 0.5f, 0.3f, 1.0f};
        bare.metallic = metallic;
        bare.roughness = roughness;
        if (specular < 1.0f) bare.specular = materials::Specular{.factor = specular, .color = {1.0f, 0.6f, 0.9f}};
        materials::MaterialDescription coated = bare;
        coated.clearcoat = materials::Clearcoat{.factor = 1e-4f};
        const auto plain = ring_means(bare), covered = ring_means(coated);
        for (std::size_t i = 0; i < rings; ++i) {
            for (int channel = 0; channel < 3; ++channel) {
                EXPECT_NEAR(covered[i][channel], plain[i][channel], 0.015 * plain[i][channel])
                    << "metallic " << metallic << " roughness " << roughness << " specular " << specular << " ring "
                    << i << " channel " << channel;
            }
        }
    }
}

}  // namespace
}  // namespace nacre::test
