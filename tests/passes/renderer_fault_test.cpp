// SPDX-License-Identifier: Apache-2.0
// A renderer whose device runs out of memory or is lost, and scenes in which nothing can be seen.
#include <algorithm>

#include "core/disk_cache.h"
#include "scene/shapes.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(RendererFaults);

/// One shadow-casting light over a square: most kinds of passes and tables, few pixels.
scene::Scene small_scene() {
    scene::Scene scene = empty_scene();
    scene.environment = uniform_environment(glm::vec3(0.5f));
    place(scene, scene::parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}),
          add_material(scene, matte(glm::vec3(0.5f))));
    scene.lights.push_back(directional_light({0, -1, -1}, 1.0f));
    return scene;
}

passes::RenderOptions options_for(const RenderVariant& variant) {
    static DiskCache cache;
    return {.profile = variant.profile, .width = 32, .height = 18, .cache = &cache};
}

/// Everything from making a renderer to having its picture.
Expected<ImageBytes> picture_of(rhi::Device& device, const scene::Scene& scene, const RenderVariant& variant) {
    NACRE_TRY(const auto renderer, passes::Renderer::create(device, scene, options_for(variant)));
    NACRE_CHECK(renderer->render_frame());
    NACRE_TRY(passes::FinalPicture picture, renderer->read_final());
    return std::move(picture.tone_mapped);
}

TEST_P(RendererFaults, EachAllocationMayFail) {
    const scene::Scene scene = small_scene();
    const ImageBytes whole = *picture_of(device(), scene, GetParam());
    int failures = 0;
    for (std::uint64_t n = 1;; ++n) {
        ASSERT_LT(n, 500u) << "the planted failure is never reached, nor passed";
        const auto weak = make_failing_device(GetParam(), {.fail_allocation = n});
        if (!weak) {
            EXPECT_EQ(weak.error().code, ErrorCode::out_of_memory) << weak.error().message();
            continue;
        }
        const rhi::MemoryStatistics before = (*weak)->memory_statistics();
        const auto first = picture_of(**weak, scene, GetParam());
        if (first) break;
        ++failures;
        EXPECT_EQ(first.error().code, ErrorCode::out_of_memory) << first.error().message();
        EXPECT_TRUE((*weak)->wait_idle());
        const rhi::MemoryStatistics after = (*weak)->memory_statistics();
        EXPECT_EQ(after.buffer_bytes, before.buffer_bytes) << "allocation " << n;
        EXPECT_EQ(after.texture_bytes, before.texture_bytes) << "allocation " << n;
        // One allocation failed; the same device draws afterwards.
        const auto second = picture_of(**weak, scene, GetParam());
        ASSERT_TRUE(second) << second.error().message();
        EXPECT_EQ(second->bytes, whole.bytes);
    }
    EXPECT_GT(failures, 0);
}

TEST_P(RendererFaults, ALostDeviceIsReportedAndANewOneDrawsTheSame) {
    const scene::Scene scene = small_scene();
    const ImageBytes whole = *picture_of(device(), scene, GetParam());
    int losses = 0;
    for (std::uint64_t n = 1;; ++n) {
        ASSERT_LT(n, 100u);
        const auto weak = make_failing_device(GetParam(), {.lose_device = n});
        ASSERT_TRUE(weak) << weak.error().message();
        const auto first = picture_of(**weak, scene, GetParam());
        if (first) break;
        ++losses;
        EXPECT_EQ(first.error().code, ErrorCode::device_lost) << first.error().message();
        EXPECT_EQ(picture_of(**weak, scene, GetParam()).error().code, ErrorCode::device_lost);
        const auto fresh = make_failing_device(GetParam(), {});
        ASSERT_TRUE(fresh) << fresh.error().message();
        const auto again = picture_of(**fresh, scene, GetParam());
        ASSERT_TRUE(again) << again.error().message();
        EXPECT_EQ(again->bytes, whole.bytes);
    }
    EXPECT_GT(losses, 1) << "the environment and the frame are submissions of their own";
}

TEST_P(RendererFaults, WhereNothingCanBeSeenTheEnvironmentIs) {
    const auto expect_environment = [&](const scene::Scene& scene, const char* what) {
        const Shot shot = render(scene, {.width = 20, .height = 12, .exposure_ev = 0.0f});
        EXPECT_NEAR(shot.radiance_at(10, 6).g, 0.5f, 1e-3f) << what;
    };
    scene::Scene scene = empty_scene();
    scene.environment = uniform_environment(glm::vec3(0.5f));
    scene.cameras.clear();
    expect_environment(scene, "no camera");
    const std::uint32_t material = add_material(scene, matte(glm::vec3(0.0f)));
    place(scene, scene::parallelogram({-100, -100, -1}, {200, 0, 0}, {0, 200, 0}), material);
    scene.instances[0].transforms.clear();
    expect_environment(scene, "no instance");
    place(scene, scene::Primitive{}, material);
    expect_environment(scene, "a mesh without vertices");
    place(scene, scene::parallelogram({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}), material, glm::mat4(0.0f));
    expect_environment(scene, "a transform that leaves nothing");
    scene.cameras.push_back(
        {.name = "broken", .vertical_field_of_view = 0.0f, .near_distance = -1.0f, .far_distance = 0.0f});
    expect_environment(scene, "a camera whose numbers make no sense");
}

}  // namespace
}  // namespace nacre::test
