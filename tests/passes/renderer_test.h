// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <glm/glm.hpp>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "passes/renderer.h"
#include "scene/scene.h"

/// @file
/// Tests of whole pictures, registered once and run on every backend present.
///
///     RENDERER_SUITE(Furnace);
///     TEST_P(Furnace, WhiteMetalVanishes) {
///         const Shot shot = render(scene, {.width = 64, .height = 64});
///         EXPECT_NEAR(shot.radiance_at(32, 32).r, 1.0f, 2e-3f);
///     }
///
/// Devices have our validation, the driver's and verify mode on; any message fails the test. Every picture is searched
/// for values that are negative or not finite.

namespace nacre::test {

struct RenderVariant {
    std::string name, backend, restriction, profile;
};
inline void PrintTo(const RenderVariant& variant, std::ostream* out) { *out << variant.name; }

/// Those of which a device can be made here.
const std::vector<RenderVariant>& render_variants();
/// One of them for each compiler that shaders meet, for tests whose shaders take long to compile.
std::vector<RenderVariant> compiler_variants();

/// A frame, and the renderer that can still be asked.
struct Shot {
    std::unique_ptr<passes::Renderer> renderer;
    passes::FrameStatistics statistics;
    passes::FinalPicture picture;

    [[nodiscard]] glm::vec3 radiance_at(std::uint32_t x, std::uint32_t y) const;
    [[nodiscard]] glm::ivec3 bytes_at(std::uint32_t x, std::uint32_t y) const;
    /// The words or floats of an intermediate texture.
    template <typename T>
    [[nodiscard]] std::vector<T> intermediate(const char* name, std::uint32_t layer = 0) const {
        auto content = renderer->read_intermediate(name, layer);
        if (!content) {
            ADD_FAILURE() << content.error().message();
            return {};
        }
        std::vector<T> values(content->bytes.size() / sizeof(T));
        std::memcpy(values.data(), content->bytes.data(), values.size() * sizeof(T));
        return values;
    }
    [[nodiscard]] bool has_pass(std::string_view name) const;
    [[nodiscard]] bool has_resource(std::string_view name) const;
};

class RendererTest : public ::testing::TestWithParam<RenderVariant> {
  public:
    void SetUp() override;
    void TearDown() override;

    rhi::Device& device() { return *device_; }
    /// Renders one frame with the variant's profile (unless the options name another than "high") and looks it over.
    Shot render(const scene::Scene& scene, passes::RenderOptions options);

  private:
    rhi::Device* device_ = nullptr;
};

/// Another device of a variant, without the driver's validation, that fails as told.
Expected<std::unique_ptr<rhi::Device>> make_failing_device(const RenderVariant& variant,
                                                           const rhi::FaultInjection& faults);

/// Destroys the devices, before the static objects of drivers and layers go.
void release_devices();
/// Messages that a device has given so far.
std::vector<std::string> messages_of(const RenderVariant& variant);

/// A scene with a material and nothing else; black environment; camera of 2 x 2 meters looking down -Z from z = 10.
scene::Scene empty_scene();
/// An environment of one color.
scene::Environment uniform_environment(const glm::vec3& radiance);
/// Adds a material; returns its index.
std::uint32_t add_material(scene::Scene& scene, const materials::MaterialDescription& material);
/// A material of roughness 1 that only scatters diffusely.
materials::MaterialDescription matte(const glm::vec3& albedo);
/// What a matte surface of albedo 1 sends to the viewer of a light of 1 lux, by the variant's profile; unit vectors, in
/// double precision.
double matte_value(const RenderVariant& variant, const glm::dvec3& normal, const glm::dvec3& to_viewer,
                   const glm::dvec3& to_light);
/// A direction in a frame whose z is the normal, for surfaces that look alike however they are turned.
glm::dvec3 in_frame_of(const glm::dvec3& normal, const glm::dvec3& direction);
/// Places a primitive with a material.
void place(scene::Scene& scene, scene::Primitive primitive, std::uint32_t material,
           const glm::mat4& transform = glm::mat4(1.0f));
/// 2 x 2 meters at height z, facing the camera.
scene::Primitive sheet(float z);
scene::Light directional_light(const glm::vec3& direction, float lux);

#define RENDERER_SUITE_OF(Suite, variants)                           \
    class Suite : public ::nacre::test::RendererTest {};             \
    GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Suite);            \
    INSTANTIATE_TEST_SUITE_P(Passes, Suite, ::testing::ValuesIn(variants), \
                             [](const auto& parameter) { return parameter.param.name; })
#define RENDERER_SUITE(Suite) RENDERER_SUITE_OF(Suite, ::nacre::test::render_variants())

}  // namespace nacre::test
