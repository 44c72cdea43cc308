// SPDX-License-Identifier: Apache-2.0
#include "tests/passes/renderer_test.h"

#include <algorithm>
#include <map>
#include <mutex>

#include "core/disk_cache.h"
#include "materials/closures/library.h"
#include "passes/profiles.h"
#include "samples/backends.h"
#include "scene/shapes.h"

namespace nacre::test {
namespace {

const rhi::Instance& instance() {
    static const rhi::Instance all(all_backends());
    return all;
}

struct MadeDevice {
    std::unique_ptr<rhi::Device> device;
    std::mutex mutex;
    std::vector<std::string> messages;
};

Expected<std::unique_ptr<rhi::Device>> make_device(const RenderVariant& variant) {
    rhi::DeviceDesc desc{.backend = variant.backend,
                         .restriction = variant.restriction,
                         .driver_validation = true,
                         .verify_statements = true,
                         .name = variant.name};
    auto device = instance().create_device(desc);
    if (device || device.error().code != ErrorCode::not_found) return device;
    // The driver may be here without the layer that checks it.
    desc.driver_validation = false;
    return instance().create_device(desc);
}

std::map<std::string, std::unique_ptr<MadeDevice>>& made_devices() {
    static std::map<std::string, std::unique_ptr<MadeDevice>> made;
    return made;
}

/// One device for each variant, for all tests of the program.
MadeDevice* device_for(const RenderVariant& variant) {
    auto& entry = made_devices()[variant.name];
    if (entry == nullptr) {
        auto device = make_device(variant);
        if (!device) return nullptr;
        entry = std::make_unique<MadeDevice>();
        entry->device = std::move(*device);
        entry->device->set_message_callback([raw = entry.get()](const rhi::Message& message) {
            if (message.severity == rhi::MessageSeverity::info) return;
            const std::lock_guard lock(raw->mutex);
            raw->messages.push_back(message.code + ": " + message.text);
        });
    }
    return entry.get();
}

}  // namespace

std::vector<RenderVariant> compiler_variants() {
    std::vector<RenderVariant> variants = render_variants();
    const bool has_gles = std::ranges::find(variants, "gles", &RenderVariant::name) != variants.end();
    std::erase_if(variants, [&](const RenderVariant& variant) {
        return variant.name == "vulkan_renderpass" || (variant.name == "gl" && has_gles);
    });
    return variants;
}

const std::vector<RenderVariant>& render_variants() {
    static const std::vector<RenderVariant> available = [] {
        const RenderVariant all[] = {{"vulkan", "vulkan", "none", "high"},
                                     {"vulkan_renderpass", "vulkan:renderpass", "none", "high"},
                                     {"gl", "gl", "none", "high"},
                                     {"gles", "gles", "none", "high"},
                                     {"gles_minimum_mobile", "gles", "gles31-minimum", "mobile"},
                                     {"cpu", "cpu:consistent", "none", "high"}};
        std::vector<RenderVariant> usable;
        for (const RenderVariant& variant : all) {
            // A device that is here and does not work stays in: its tests say so.
            const auto device = make_device(variant);
            if (device || device.error().code != ErrorCode::not_found) usable.push_back(variant);
        }
        return usable;
    }();
    return available;
}

Expected<std::unique_ptr<rhi::Device>> make_failing_device(const RenderVariant& variant,
                                                           const rhi::FaultInjection& faults) {
    return instance().create_device({.backend = variant.backend,
                                     .restriction = variant.restriction,
                                     .faults = faults,
                                     .name = variant.name + " that fails"});
}

void release_devices() { made_devices().clear(); }

std::vector<std::string> messages_of(const RenderVariant& variant) {
    MadeDevice* made = device_for(variant);
    if (made == nullptr) return {};
    const std::lock_guard lock(made->mutex);
    return made->messages;
}

void RendererTest::SetUp() {
    MadeDevice* made = device_for(GetParam());
    ASSERT_NE(made, nullptr);
    device_ = made->device.get();
    const std::lock_guard lock(made->mutex);
    made->messages.clear();
}

void RendererTest::TearDown() {
    for (const std::string& message : messages_of(GetParam())) ADD_FAILURE() << message;
}

Shot RendererTest::render(const scene::Scene& scene, passes::RenderOptions options) {
    static DiskCache cache;
    if (options.cache == nullptr) options.cache = &cache;
    if (options.profile == "high") options.profile = GetParam().profile;
    Shot shot;
    auto renderer = passes::Renderer::create(device(), scene, options);
    if (!renderer) {
        ADD_FAILURE() << renderer.error().message();
        throw std::runtime_error("no renderer");
    }
    shot.renderer = std::move(*renderer);
    auto statistics = shot.renderer->render_frame();
    if (!statistics) {
        ADD_FAILURE() << statistics.error().message();
        throw std::runtime_error("no frame");
    }
    shot.statistics = *statistics;
    auto picture = shot.renderer->read_final();
    if (!picture) {
        ADD_FAILURE() << picture.error().message();
        throw std::runtime_error("no picture");
    }
    shot.picture = std::move(*picture);
    std::size_t wrong = 0;
    for (const float value : shot.picture.radiance.pixels) wrong += !(value >= 0.0f && value <= 65504.0f);
    EXPECT_EQ(wrong, 0u) << "values that are negative, infinite or not a number";
    return shot;
}

glm::vec3 Shot::radiance_at(std::uint32_t x, std::uint32_t y) const {
    const float* texel = picture.radiance.texel(x, y);
    return {texel[0], texel[1], texel[2]};
}

glm::ivec3 Shot::bytes_at(std::uint32_t x, std::uint32_t y) const {
    const std::size_t at = 4 * (std::size_t{y} * picture.tone_mapped.width + x);
    const auto& bytes = picture.tone_mapped.bytes;
    return {bytes[at], bytes[at + 1], bytes[at + 2]};
}

bool Shot::has_pass(std::string_view name) const {
    return std::ranges::any_of(renderer->plan().passes, [&](const auto& pass) { return pass.name == name; });
}

bool Shot::has_resource(std::string_view name) const {
    return std::ranges::any_of(renderer->plan().resources, [&](const auto& resource) { return resource.name == name; });
}

scene::Scene empty_scene() {
    scene::Scene scene;
    scene.name = "test";
    scene::Camera camera{.name = "test", .projection = scene::Projection::orthographic};
    camera.world[3] = glm::vec4(0, 0, 10, 1);
    camera.near_distance = 0.0f;
    camera.far_distance = 20.0f;
    scene.cameras.push_back(camera);
    scene.samplers.emplace_back();
    scene.environment = uniform_environment(glm::vec3(0.0f));
    return scene;
}

scene::Environment uniform_environment(const glm::vec3& radiance) {
    scene::Environment environment{.name = "uniform", .width = 64, .height = 32};
    environment.texels.assign(64 * 32, glm::vec4(radiance, 1.0f));
    return environment;
}

std::uint32_t add_material(scene::Scene& scene, const materials::MaterialDescription& material) {
    scene.materials.push_back(material);
    return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

materials::MaterialDescription matte(const glm::vec3& albedo) {
    materials::MaterialDescription material{.name = "matte"};
    material.base_color = glm::vec4(albedo, 1.0f);
    material.metallic = 0.0f;
    material.specular = materials::Specular{.factor = 0.0f};
    return material;
}

glm::dvec3 in_frame_of(const glm::dvec3& normal, const glm::dvec3& direction) {
    const glm::dvec3 axis = std::abs(normal.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    const glm::dvec3 tangent = glm::normalize(axis - normal * glm::dot(axis, normal));
    return {glm::dot(direction, tangent), glm::dot(direction, glm::cross(normal, tangent)),
            glm::dot(direction, normal)};
}

double matte_value(const RenderVariant& variant, const glm::dvec3& normal, const glm::dvec3& to_viewer,
                   const glm::dvec3& to_light) {
    materials::closures::Library library;
    const glm::dvec3 view = in_frame_of(normal, to_viewer), light = in_frame_of(normal, to_light);
    if ((*passes::find_profile(variant.profile))->diffuse_model == passes::DiffuseModel::lambert)
        return library.lambert_diffuse(light);
    const double gloss = library.chan_gloss(1.0);
    return library.chan_diffuse(view, light, gloss) / library.chan_albedo_by_table(std::min(view.z, 1.0), gloss);
}

void place(scene::Scene& scene, scene::Primitive primitive, std::uint32_t material, const glm::mat4& transform) {
    primitive.material = material;
    scene.meshes.push_back({.name = "mesh", .primitives = {std::move(primitive)}});
    scene.instances.push_back({.name = "instance",
                               .mesh = static_cast<std::uint32_t>(scene.meshes.size() - 1),
                               .transforms = {transform}});
}

scene::Primitive sheet(float z) { return scene::parallelogram({-1, -1, z}, {2, 0, 0}, {0, 2, 0}); }

scene::Light directional_light(const glm::vec3& direction, float lux) {
    scene::Light light{.name = "sun", .kind = scene::LightKind::directional, .intensity = lux};
    light.direction = glm::normalize(direction);
    return light;
}

}  // namespace nacre::test
