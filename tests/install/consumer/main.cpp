// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/cpu_backend.h"
#include "backends/gl/gl_backend.h"
#include "backends/vulkan/vulkan_backend.h"
#include "materials/custom_material.h"
#include "passes/renderer.h"
#include "rhi/device.h"
#include "scene/scene.h"
#include "scene/shapes.h"

#include <cmath>
#include <iostream>

/// A kind of material that Nacre does not know: a checkerboard that glows.
class Checker final : public nacre::materials::CustomMaterial {
  public:
    nacre::materials::MaterialModule module() const override {
        return {"checker", R"(
bool checker_is_light() {
    vec2 square = floor(in_uv0 * custom_numbers(0).x);
    return mod(square.x + square.y, 2.0) == 0.0;
}
vec4 checker_base_color() { return vec4(0.0, 0.0, 0.0, 1.0); }
vec3 checker_emission() { return checker_is_light() ? vec3(custom_numbers(0).y) : vec3(0.0); }
SingleSlab checker_slab(vec3 color) { return SingleSlab(color, vec3(0.0), 0.0, 1.0, shading_normal(), 1.0); }
)"};
    }
    nacre::materials::CustomMaterialData data() const override {
        nacre::materials::CustomMaterialData data;
        data.numbers[0] = {2.0f, 3.0f, 0.0f, 0.0f};  // two squares along each side, 3 cd/m2
        data.emits = true;
        data.reads = nacre::materials::reads_uv0;
        return data;
    }
};

/// Whether the squares are where they should be.
bool draws_checkers(nacre::rhi::Device& device) {
    nacre::scene::Scene scene;
    nacre::materials::MaterialDescription material{.name = "checker"};
    material.custom = std::make_shared<Checker>();
    scene.materials.push_back(material);
    scene.meshes.push_back(
        {.name = "sheet", .primitives = {nacre::scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0})}});
    scene.instances.push_back({.name = "sheet", .mesh = 0, .transforms = {glm::mat4(1.0f)}});
    nacre::scene::Camera camera;
    camera.world[3] = glm::vec4(0.0f, 0.0f, 2.0f, 1.0f);
    scene.cameras.push_back(camera);
    auto renderer = nacre::passes::Renderer::create(device, scene, {.width = 32, .height = 32, .exposure_ev = 0.0f});
    if (!renderer) {
        std::cout << renderer.error().message() << '\n';
        return false;
    }
    if (const auto frame = (*renderer)->render_frame(); !frame) {
        std::cout << frame.error().message() << '\n';
        return false;
    }
    const auto picture = (*renderer)->read_final();
    if (!picture) return false;
    const auto glows = [&](std::uint32_t x, std::uint32_t y) {
        return std::abs(picture->radiance.texel(x, y)[0] - 3.0f) < 0.01f;
    };
    // (0, 0) of the texture is the upper left corner.
    return glows(12, 12) && glows(20, 20) && !glows(20, 12) && !glows(12, 20);
}

int main() {
    std::vector<std::unique_ptr<nacre::rhi::Backend>> backends;
    backends.push_back(nacre::vulkan::make_backend());
    backends.push_back(nacre::gl::make_backend());
    backends.push_back(nacre::cpu::make_backend());
    const nacre::rhi::Instance instance(std::move(backends));
    for (const auto& adapter : instance.adapters()) std::cout << adapter.backend << ": " << adapter.name << '\n';
    for (const auto& missing : instance.unavailable())
        std::cout << missing.backend << ": " << missing.error.message() << '\n';
    const auto device = instance.create_device({.backend = "cpu"});
    if (!device) {
        std::cout << device.error().message() << '\n';
        return 1;
    }
    if (!draws_checkers(**device)) {
        std::cout << "a kind of material of the program's own was not drawn as it should be\n";
        return 1;
    }
    std::cout << "nacre works\n";
}
