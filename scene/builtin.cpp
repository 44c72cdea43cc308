// SPDX-License-Identifier: Apache-2.0
#include "scene/builtin.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "materials/builtin_materials.h"
#include "materials/tree.h"
#include "scene/environment.h"
#include "scene/shapes.h"
#include "scene/tangents.h"

namespace nacre::scene {
namespace {

using materials::AlphaMode;
using materials::MaterialDescription;

MaterialDescription dielectric(std::string name, const glm::vec3& color, float roughness) {
    MaterialDescription material{.name = std::move(name)};
    material.base_color = glm::vec4(color, 1.0f);
    material.metallic = 0.0f;
    material.roughness = roughness;
    return material;
}

MaterialDescription metal(std::string name, const glm::vec3& color, float roughness) {
    MaterialDescription material = dielectric(std::move(name), color, roughness);
    material.metallic = 1.0f;
    return material;
}

/// Adds a mesh of one primitive and one instance of it; returns the mesh index.
std::uint32_t place(Scene& scene, std::string name, Primitive primitive, std::uint32_t material,
                    const glm::mat4& transform = glm::mat4(1.0f)) {
    primitive.material = material;
    const auto mesh = static_cast<std::uint32_t>(scene.meshes.size());
    scene.meshes.push_back({.name = name, .primitives = {std::move(primitive)}});
    scene.instances.push_back({.name = std::move(name), .mesh = mesh, .transforms = {transform}});
    return mesh;
}

std::uint32_t add_material(Scene& scene, MaterialDescription material) {
    scene.materials.push_back(std::move(material));
    return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

glm::mat4 moved_to(const glm::vec3& position) { return glm::translate(glm::mat4(1.0f), position); }

Camera camera_at(const glm::vec3& eye, const glm::vec3& target, float vertical_degrees) {
    Camera camera{.name = "main"};
    camera.world = glm::inverse(glm::lookAt(eye, target, glm::vec3(0.0f, 1.0f, 0.0f)));
    camera.vertical_field_of_view = glm::radians(vertical_degrees);
    return camera;
}

Light spot_at(std::string name, const glm::vec3& position, const glm::vec3& target, float candela,
              float outer_degrees) {
    Light light{.name = std::move(name), .kind = LightKind::spot, .intensity = candela, .position = position};
    light.direction = glm::normalize(target - position);
    light.outer_cone_angle = glm::radians(outer_degrees);
    light.inner_cone_angle = 0.7f * light.outer_cone_angle;
    return light;
}

Scene triangle_scene() {
    Scene scene;
    MaterialDescription material{.name = "vertex colors"};
    material.unlit = true;
    material.double_sided = true;
    add_material(scene, material);
    Primitive triangle;
    triangle.positions = {{-0.5f, -0.433f, 0.0f}, {0.5f, -0.433f, 0.0f}, {0.0f, 0.433f, 0.0f}};
    triangle.normals.assign(3, {0.0f, 0.0f, 1.0f});
    triangle.uv0 = {{0.0f, 1.0f}, {1.0f, 1.0f}, {0.5f, 0.0f}};
    triangle.colors = {{1.0f, 0.05f, 0.05f, 1.0f}, {0.05f, 1.0f, 0.05f, 1.0f}, {0.05f, 0.05f, 1.0f, 1.0f}};
    triangle.indices = {0, 1, 2};
    update_bounds(triangle);
    place(scene, "triangle", triangle, 0);
    scene.cameras.push_back(camera_at({0.0f, 0.0f, 1.4f}, {0.0f, 0.0f, 0.0f}, 45.0f));
    return scene;
}

Scene spheres_scene() {
    constexpr int columns = 7;  // roughness 0 ... 1
    constexpr int rows = 5;     // metalness 0 ... 1
    Scene scene;
    const Primitive ball = sphere(0.42f, 64, 32);
    for (int row = 0; row < rows; ++row) {
        for (int column = 0; column < columns; ++column) {
            MaterialDescription material = dielectric(
                fmt::format("metallic {:.2f} roughness {:.2f}", row / (rows - 1.0), column / (columns - 1.0)),
                {0.95f, 0.62f, 0.35f}, static_cast<float>(column) / (columns - 1));
            material.metallic = static_cast<float>(row) / (rows - 1);
            const std::uint32_t index = add_material(scene, std::move(material));
            const glm::vec3 position(static_cast<float>(column) - 0.5f * (columns - 1), static_cast<float>(row) + 0.45f,
                                     0.0f);
            place(scene, scene.materials[index].name, ball, index, moved_to(position));
        }
    }
    const std::uint32_t floor = add_material(scene, dielectric("floor", {0.35f, 0.36f, 0.38f}, 0.6f));
    place(scene, "floor", parallelogram({-12, 0, 8}, {24, 0, 0}, {0, 0, -16}), floor);

    Light sun{.name = "sun", .kind = LightKind::directional, .intensity = 1.2f};
    sun.color = {1.0f, 0.95f, 0.88f};
    sun.direction = glm::normalize(glm::vec3(-0.5f, -1.0f, -0.7f));
    scene.lights.push_back(sun);
    scene.lights.push_back({.name = "lamp",
                            .kind = LightKind::point,
                            .color = {0.55f, 0.7f, 1.0f},
                            .intensity = 9.0f,
                            .position = {-4.5f, 4.0f, 3.0f},
                            .range = 20.0f});
    Light spot = spot_at("spot", {4.5f, 6.5f, 4.0f}, {1.0f, 1.5f, 0.0f}, 40.0f, 24.0f);
    spot.color = {1.0f, 0.8f, 0.6f};
    scene.lights.push_back(spot);
    scene.cameras.push_back(camera_at({0.0f, 3.4f, 9.2f}, {0.0f, 2.35f, 0.0f}, 38.0f));
    return scene;
}

/// Balls of built-in materials (materials/builtin_materials.h).
Scene materials_scene() {
    constexpr std::string_view names[] = {"silks-under-plastic", "jade-in-gold", "wet-skin",      "coated-carbon",
                                          "dusty-car-paint",     "single-fuzz",  "complex-aniso", "complex-coat"};
    constexpr int columns = 4;
    Scene scene;
    Primitive ball = sphere(0.45f, 96, 48);
    const std::vector<glm::vec2> uv = ball.uv0;
    add_tangents(ball, uv);
    for (int i = 0; i < static_cast<int>(std::size(names)); ++i) {
        auto tree = materials::make_builtin_material(names[i]);
        if (!tree) continue;
        MaterialDescription material = dielectric(std::string(names[i]), glm::vec3(0.5f), 0.5f);
        material.tree = std::make_shared<const materials::Tree>(*std::move(tree));
        const std::uint32_t index = add_material(scene, std::move(material));
        const glm::vec3 position(static_cast<float>(i % columns) - 0.5f * (columns - 1),
                                 1.5f - static_cast<float>(i / columns), 0.0f);
        place(scene, std::string(names[i]), ball, index, moved_to(position));
    }
    const std::uint32_t floor = add_material(scene, dielectric("floor", {0.35f, 0.36f, 0.38f}, 0.6f));
    place(scene, "floor", parallelogram({-12, 0, 8}, {24, 0, 0}, {0, 0, -16}), floor);
    Light sun{.name = "sun", .kind = LightKind::directional, .intensity = 1.5f};
    sun.direction = glm::normalize(glm::vec3(-0.5f, -1.0f, -0.7f));
    scene.lights.push_back(sun);
    Light spot = spot_at("spot", {3.0f, 4.0f, 4.0f}, {0.0f, 1.0f, 0.0f}, 30.0f, 30.0f);
    spot.color = {1.0f, 0.85f, 0.7f};
    scene.lights.push_back(spot);
    scene.cameras.push_back(camera_at({0.0f, 1.7f, 5.4f}, {0.0f, 1.0f, 0.0f}, 32.0f));
    return scene;
}

/// The Cornell box with walls of 5.5 m as measured (Cornell University, 1985; reflectances turned into sRGB
/// primaries), a small round lamp below the ceiling in place of the square one, and a metal and a smooth ball.
Scene cornell_scene() {
    Scene scene;
    const std::uint32_t white = add_material(scene, dielectric("white", {0.725f, 0.71f, 0.68f}, 1.0f));
    const std::uint32_t red = add_material(scene, dielectric("red", {0.63f, 0.065f, 0.05f}, 1.0f));
    const std::uint32_t green = add_material(scene, dielectric("green", {0.14f, 0.45f, 0.091f}, 1.0f));
    const std::uint32_t copper = add_material(scene, metal("copper", {0.95f, 0.64f, 0.54f}, 0.2f));
    const std::uint32_t glossy = add_material(scene, dielectric("glossy", {0.12f, 0.25f, 0.6f}, 0.05f));
    MaterialDescription lamp_material = dielectric("lamp", {0.0f, 0.0f, 0.0f}, 1.0f);
    lamp_material.emissive = {1.0f, 0.85f, 0.6f};
    lamp_material.emissive_strength = 12.0f;
    const std::uint32_t lamp = add_material(scene, std::move(lamp_material));

    constexpr float h = 2.75f;  // half the room
    place(scene, "floor", parallelogram({-h, 0, h}, {2 * h, 0, 0}, {0, 0, -2 * h}), white);
    place(scene, "ceiling", parallelogram({-h, 2 * h, -h}, {2 * h, 0, 0}, {0, 0, 2 * h}), white);
    place(scene, "back wall", parallelogram({-h, 0, -h}, {2 * h, 0, 0}, {0, 2 * h, 0}), white);
    place(scene, "left wall", parallelogram({-h, 0, h}, {0, 0, -2 * h}, {0, 2 * h, 0}), red);
    place(scene, "right wall", parallelogram({h, 0, -h}, {0, 0, 2 * h}, {0, 2 * h, 0}), green);
    place(scene, "lamp", parallelogram({-0.65f, 2 * h - 0.01f, -0.55f}, {1.3f, 0, 0}, {0, 0, 1.1f}), lamp);
    place(scene, "tall block", box({0.82f, 1.65f, 0.82f}), white,
          glm::rotate(moved_to({-0.95f, 1.65f, -0.9f}), glm::radians(17.0f), glm::vec3(0, 1, 0)));
    place(scene, "short block", box({0.82f, 0.55f, 0.82f}), white,
          glm::rotate(moved_to({0.95f, 0.55f, 0.65f}), glm::radians(-17.0f), glm::vec3(0, 1, 0)));
    place(scene, "copper ball", sphere(0.6f, 96, 48), copper, moved_to({0.95f, 1.7f, 0.65f}));
    place(scene, "glossy ball", sphere(0.5f, 96, 48), glossy, moved_to({-1.2f, 0.5f, 1.4f}));

    scene.lights.push_back({.name = "lamp",
                            .kind = LightKind::point,
                            .color = {1.0f, 0.85f, 0.6f},
                            .intensity = 14.0f,
                            .position = {0.0f, 2 * h - 0.35f, 0.0f}});
    scene.environment = studio_environment();
    scene.environment.intensity = 0.4f;  // the light that the walls would scatter
    scene.cameras.push_back(camera_at({0.0f, h, 10.6f}, {0.0f, h, 0.0f}, 39.3f));
    return scene;
}

/// A landscape of 354 x 354 squares: 250,632 triangles, in 16 strips so that there is more than one draw.
Scene grid_scene() {
    constexpr std::uint32_t squares = 354;
    constexpr std::uint32_t strips = 16;
    constexpr float half_size = 20.0f;
    Scene scene;
    const auto height = [](float x, float z) {
        return 0.9f * std::sin(0.45f * x) * std::cos(0.38f * z) + 0.35f * std::sin(1.3f * x + 0.7f * z) +
               0.05f * std::cos(5.1f * x - 4.3f * z);
    };
    const auto coordinate = [](std::uint32_t i) {
        return half_size * (2.0f * static_cast<float>(i) / static_cast<float>(squares) - 1.0f);
    };
    for (std::uint32_t strip = 0; strip < strips; ++strip) {
        const std::uint32_t first_row = squares * strip / strips;
        const std::uint32_t last_row = squares * (strip + 1) / strips;
        Primitive primitive;
        for (std::uint32_t row = first_row; row <= last_row; ++row) {
            for (std::uint32_t column = 0; column <= squares; ++column) {
                const float x = coordinate(column), z = coordinate(row);
                constexpr float step = 0.01f;
                primitive.positions.emplace_back(x, height(x, z), z);
                primitive.normals.push_back(
                    glm::normalize(glm::vec3((height(x - step, z) - height(x + step, z)) / (2 * step), 1.0f,
                                             (height(x, z - step) - height(x, z + step)) / (2 * step))));
                primitive.uv0.emplace_back(static_cast<float>(column) / squares, static_cast<float>(row) / squares);
            }
        }
        for (std::uint32_t row = 0; row < last_row - first_row; ++row) {
            for (std::uint32_t column = 0; column < squares; ++column) {
                const std::uint32_t a = row * (squares + 1) + column, b = a + squares + 1;
                primitive.indices.insert(primitive.indices.end(), {a, b, b + 1, a, b + 1, a + 1});
            }
        }
        update_bounds(primitive);
        const float t = static_cast<float>(strip) / (strips - 1);
        const std::uint32_t material = add_material(
            scene,
            dielectric(fmt::format("strip {}", strip), {0.25f + 0.5f * t, 0.5f, 0.7f - 0.5f * t}, 0.25f + 0.5f * t));
        scene.materials.back().metallic = strip % 4 == 3 ? 1.0f : 0.0f;
        place(scene, fmt::format("strip {}", strip), std::move(primitive), material);
    }
    Light sun{.name = "sun", .kind = LightKind::directional, .color = {1.0f, 0.93f, 0.82f}, .intensity = 2.0f};
    sun.direction = glm::normalize(glm::vec3(0.6f, -0.8f, -0.45f));
    scene.lights.push_back(sun);
    scene.cameras.push_back(camera_at({0.0f, 9.0f, 21.0f}, {0.0f, -1.5f, 1.0f}, 50.0f));
    return scene;
}

/// A square picture with a hard round hole and a soft edge in its alpha; sRGB.
Image leaf_picture() {
    constexpr std::uint32_t side = 128;
    std::vector<std::uint8_t> pixels;
    for (std::uint32_t y = 0; y < side; ++y) {
        for (std::uint32_t x = 0; x < side; ++x) {
            const glm::vec2 at = (glm::vec2(static_cast<float>(x), static_cast<float>(y)) + 0.5f) / float{side} - 0.5f;
            const float angle = std::atan2(at.y, at.x);
            const float outline = 0.36f + 0.09f * std::cos(6.0f * angle);
            const float distance = std::min(outline - glm::length(at), glm::length(at) - 0.1f);  // inside is positive
            const float alpha = std::clamp(distance * 24.0f + 0.5f, 0.0f, 1.0f);
            const bool dark = ((x / 16) + (y / 16)) % 2 == 0;
            pixels.insert(
                pixels.end(),
                {static_cast<std::uint8_t>(dark ? 140 : 235), static_cast<std::uint8_t>(dark ? 180 : 235),
                 static_cast<std::uint8_t>(dark ? 70 : 215), static_cast<std::uint8_t>(std::lround(alpha * 255.0f))});
        }
    }
    return {.name = "leaf",
            .origin = "code",
            .color_space = ColorSpace::srgb,
            .width = side,
            .height = side,
            .has_alpha = true,
            .pixels = std::make_shared<const std::vector<std::uint8_t>>(std::move(pixels))};
}

Scene alpha_scene() {
    Scene scene;
    scene.samplers.emplace_back();
    scene.images.push_back(leaf_picture());
    const std::uint32_t floor = add_material(scene, dielectric("floor", {0.5f, 0.5f, 0.52f}, 0.7f));
    place(scene, "floor", parallelogram({-6, 0, 4}, {12, 0, 0}, {0, 0, -9}), floor);
    const std::uint32_t wall = add_material(scene, dielectric("wall", {0.42f, 0.46f, 0.55f}, 0.8f));
    place(scene, "wall", parallelogram({-6, 0, -5}, {12, 0, 0}, {0, 5, 0}), wall);

    MaterialDescription mask = dielectric("mask", {1.0f, 1.0f, 1.0f}, 0.5f);
    mask.base_color_texture = {.image = 0, .sampler = 0};
    mask.alpha_mode = AlphaMode::mask;
    mask.double_sided = true;
    const std::uint32_t masked = add_material(scene, mask);
    MaterialDescription blend = mask;
    blend.name = "blend";
    blend.alpha_mode = AlphaMode::blend;
    const std::uint32_t blended = add_material(scene, std::move(blend));
    place(scene, "masked leaf", parallelogram({-3.3f, 0.2f, -0.4f}, {2.6f, 0, 0.5f}, {0, 2.6f, 0}), masked);
    place(scene, "blended leaf", parallelogram({-3.1f, 0.2f, 1.2f}, {1.7f, 0, 0.2f}, {0, 1.7f, 0}), blended);

    // Three panes one behind the other, listed out of order: only sorting draws them right.
    const glm::vec4 tints[] = {{0.1f, 0.8f, 0.2f, 0.5f}, {0.9f, 0.1f, 0.1f, 0.5f}, {0.1f, 0.2f, 0.95f, 0.5f}};
    const float depths[] = {0.3f, 1.4f, -0.8f};
    for (int pane = 0; pane < 3; ++pane) {
        MaterialDescription material = dielectric(fmt::format("pane {}", pane), glm::vec3(tints[pane]), 0.1f);
        material.base_color.a = tints[pane].a;
        material.alpha_mode = AlphaMode::blend;
        material.double_sided = true;
        const std::uint32_t index = add_material(scene, std::move(material));
        const float x = 0.3f + 0.55f * static_cast<float>(pane);
        place(scene, fmt::format("pane {}", pane),
              parallelogram({x, 0.3f + 0.3f * static_cast<float>(pane), depths[pane]}, {1.8f, 0, 0}, {0, 1.8f, 0}),
              index);
    }
    Light sun{.name = "sun", .kind = LightKind::directional, .intensity = 1.5f};
    sun.direction = glm::normalize(glm::vec3(0.35f, -1.0f, -0.8f));
    scene.lights.push_back(sun);
    scene.cameras.push_back(camera_at({0.0f, 2.2f, 7.5f}, {0.0f, 1.2f, 0.0f}, 40.0f));
    return scene;
}

/// Each kind of light alone above its own column and ball, in a dim environment, so that each shadow can be told.
Scene lights_scene() {
    Scene scene;
    const std::uint32_t gray = add_material(scene, dielectric("gray", {0.6f, 0.6f, 0.6f}, 0.9f));
    const std::uint32_t shiny = add_material(scene, dielectric("shiny", {0.7f, 0.55f, 0.3f}, 0.3f));
    place(scene, "floor", parallelogram({-9, 0, 9}, {18, 0, 0}, {0, 0, -14}), gray);
    place(scene, "wall", parallelogram({-9, 0, -5}, {18, 0, 0}, {0, 6, 0}), gray);
    const Primitive ball = sphere(0.5f, 64, 32);
    const Primitive column = box({0.3f, 1.0f, 0.3f});
    for (const float x : {-5.0f, 0.0f, 5.0f}) {
        place(scene, "ball", ball, shiny, moved_to({x + 0.9f, 0.5f, 0.5f}));
        place(scene, "column", column, gray, glm::rotate(moved_to({x - 0.8f, 1.0f, -0.5f}), 0.5f, glm::vec3(0, 1, 0)));
    }
    Light sun{.name = "directional", .kind = LightKind::directional, .color = {1.0f, 0.9f, 0.75f}, .intensity = 0.9f};
    sun.direction = glm::normalize(glm::vec3(-0.55f, -1.0f, -0.5f));
    scene.lights.push_back(sun);
    scene.lights.push_back({.name = "point",
                            .kind = LightKind::point,
                            .color = {0.6f, 0.8f, 1.0f},
                            .intensity = 6.0f,
                            .position = {0.1f, 2.4f, 0.6f},
                            .range = 12.0f});
    Light spot = spot_at("spot", {6.8f, 4.5f, 3.2f}, {5.0f, 0.6f, 0.0f}, 45.0f, 22.0f);
    spot.color = {1.0f, 0.55f, 0.5f};
    scene.lights.push_back(spot);
    scene.environment = studio_environment();
    scene.environment.intensity = 0.3f;
    scene.cameras.push_back(camera_at({0.0f, 3.6f, 10.5f}, {0.0f, 1.2f, 0.0f}, 42.0f));
    return scene;
}

}  // namespace

struct BuiltinScene {
    std::string_view name;
    std::string_view description;
    Scene (*make)();
};

static constexpr BuiltinScene builtin_scenes[] = {
    {"builtin:triangle", "One triangle with a color at each corner, unlit.", triangle_scene},
    {"builtin:spheres", "Spheres from smooth to rough and from dielectric to metal, under the studio and three lights.",
     spheres_scene},
    {"builtin:cornell", "The Cornell box with two blocks, a copper and a glossy ball.", cornell_scene},
    {"builtin:grid250k", "A landscape of 250,632 triangles in 16 meshes under a sun.", grid_scene},
    {"builtin:alpha", "Masked and blended leaves and three colored panes that must be sorted.", alpha_scene},
    {"builtin:materials", "Balls of layered materials: silks, jade and gold, skin, carbon, dusty paint, cloth.",
     materials_scene},
    {"builtin:lights", "A directional, a point and a spot light, each with its own shadows.", lights_scene},
};

std::span<const std::string_view> builtin_scene_names() {
    static const std::vector<std::string_view> names = [] {
        std::vector<std::string_view> list;
        for (const BuiltinScene& scene : builtin_scenes) list.push_back(scene.name);
        return list;
    }();
    return names;
}

std::string_view builtin_scene_description(std::string_view name) {
    for (const BuiltinScene& scene : builtin_scenes) {
        if (scene.name == name) return scene.description;
    }
    return {};
}

Expected<Scene> make_builtin_scene(std::string_view name) {
    for (const BuiltinScene& builtin : builtin_scenes) {
        if (builtin.name != name) continue;
        Scene scene = builtin.make();
        scene.name = name;
        if (!scene.environment.present()) scene.environment = studio_environment();
        if (scene.samplers.empty()) scene.samplers.emplace_back();
        return scene;
    }
    return fail(ErrorCode::not_found, "load scene", fmt::format("'{}'", name),
                "there is no built-in scene of that name",
                fmt::format("The built-in scenes are {}.", fmt::join(builtin_scene_names(), ", ")));
}

}  // namespace nacre::scene
