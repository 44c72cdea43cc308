// SPDX-License-Identifier: Apache-2.0
#include "scene/builtin.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "scene/environment.h"
#include "scene/shapes.h"

namespace nacre::scene {
namespace {

using materials::AlphaMode;
using materials::MaterialDescription;

constexpr float pi = std::numbers::pi_v<float>;

MaterialDescription dielectric(std::string name, const glm::vec3& color, float roughness) {
    MaterialDescription material{.name = std::move(name)};
    material.base_color = glm::vec4(color, 1.0f);
    material.metallic = 0.0f;
    material.roughness = roughness;
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
    const Primitive ball = sphere(0.42f, 96, 48);
    for (int row = 0; row < rows; ++row) {
        for (int column = 0; column < columns; ++column) {
            MaterialDescription material = dielectric(
                fmt::format("metallic {:.2f} roughness {:.2f}", row / (rows - 1.0), column / (columns - 1.0)),
                {0.95f, 0.62f, 0.35f}, static_cast<float>(column) / (columns - 1));
            material.metallic = static_cast<float>(row) / (rows - 1);
            const std::uint32_t index = add_material(scene, std::move(material));
            const glm::vec3 position(static_cast<float>(column) - 0.5f * (columns - 1),
                                     static_cast<float>(row) + 0.45f, 0.0f);
            place(scene, scene.materials[index].name, ball, index, moved_to(position));
        }
    }
    const std::uint32_t floor = add_material(scene, dielectric("floor", {0.35f, 0.36f, 0.38f}, 0.6f));
    place(scene, "floor", parallelogram({-12, 0, 8}, {24, 0, 0}, {0, 0, -16}), floor);

    Light sun{.name = "sun", .kind = LightKind::directional, .intensity = 1.2f};
    sun.color = {1.0f, 0.95f, 0.88f};
    sun.direction = glm::normalize(glm::vec3(-0.5f, -1.0f, -0.7f));
    scene.lights.push_back(sun);
    scene.lights.push_back({.name = "lamp", .kind = LightKind::point, .color = {0.55f, 0.7f, 1.0f},
                            .intensity = 9.0f, .position = {-4.5f, 4.0f, 3.0f}, .range = 20.0f});
    Light spot = spot_at("spot", {4.5f, 6.5f, 4.0f}, {1.0f, 1.5f, 0.0f}, 40.0f, 24.0f);
    spot.color = {1.0f, 0.8f, 0.6f};
    scene.lights.push_back(spot);
    scene.cameras.push_back(camera_at({0.0f, 3.4f, 9.2f}, {0.0f, 2.35f, 0.0f}, 38.0f));
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
    return fail(ErrorCode::not_found, "load scene", fmt::format("'{}'", name), "there is no built-in scene of that name",
                fmt::format("The built-in scenes are {}.", fmt::join(builtin_scene_names(), ", ")));
}

}  // namespace nacre::scene
