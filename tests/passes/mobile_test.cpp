// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "scene/builtin.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(Mobile);

double psnr(const ImageBytes& a, const ImageBytes& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.bytes.size(); ++i) {
        const double d = (static_cast<double>(a.bytes[i]) - b.bytes[i]) / 255.0;
        sum += d * d;
    }
    return sum == 0.0 ? 200.0 : -10.0 * std::log10(sum / static_cast<double>(a.bytes.size()));
}

scene::Scene builtin(const char* name) {
    auto scene = scene::make_builtin_scene(name);
    EXPECT_TRUE(scene) << (scene ? "" : scene.error().message());
    return scene ? *std::move(scene) : empty_scene();
}

// Integer targets and compute shaders in place of float targets: the same picture as profile "low" as far as nine bits
// of blended and emitted color go. (Profiles differ in tables and shadows; those are equal between mobile and low but
// for the environment, which is why the scene gets a plain one.)
TEST_P(Mobile, ShowsWhatLowShows) {
    for (const char* name : {"builtin:alpha", "builtin:cornell"}) {
        scene::Scene scene = builtin(name);
        scene.environment = uniform_environment(glm::vec3(0.4f));
        const Shot mobile = render(scene, {.profile = "mobile", .width = 160, .height = 90, .exposure_ev = 0.0f});
        const Shot low = render(scene, {.profile = "low", .width = 160, .height = 90, .exposure_ev = 0.0f});
        EXPECT_GT(psnr(mobile.picture.tone_mapped, low.picture.tone_mapped), 45.0) << name;
    }
}

// No pass of the mobile profile draws into more than three color targets or writes storage from a fragment shader; the
// restricted device would refuse both.
TEST_P(Mobile, DrawsIntoIntegersOnly) {
    const Shot shot = render(builtin("builtin:alpha"), {.profile = "mobile", .width = 64, .height = 36});
    for (const auto& resource : shot.renderer->plan().resources) {
        const bool drawn = std::ranges::any_of(shot.renderer->plan().passes, [&](const auto& pass) {
            return pass.draws > 0 && std::ranges::count(pass.writes, resource.name) > 0;
        });
        if (!drawn) continue;
        const bool is_integer_or_depth = resource.format == "r32_uint" || resource.format.starts_with("d");
        EXPECT_TRUE(is_integer_or_depth) << resource.name << " " << resource.format;
    }
    EXPECT_TRUE(shot.has_resource("blend.color"));
    EXPECT_EQ(shot.renderer->plan().gbuffer_bytes_per_pixel, 12u);
}

}  // namespace
}  // namespace nacre::test
