// SPDX-License-Identifier: Apache-2.0
// Whole frames of this project on devices that look for faults: there are none.
#include <gtest/gtest.h>

#include <mutex>
#include <string>
#include <vector>

#include "backends/cpu/cpu_backend.h"
#include "passes/renderer.h"
#include "rhi/device.h"
#include "scene/builtin.h"

namespace nacre::cpu {
namespace {

class OwnPasses : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(CpuClean, OwnPasses, ::testing::Values("traps", "sanitize", "hostile"),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST_P(OwnPasses, GiveNoReport) {
    std::vector<std::unique_ptr<rhi::Backend>> backends;
    backends.push_back(make_backend());
    const rhi::Instance instance(std::move(backends));
    for (const std::string_view name : {"builtin:spheres", "builtin:cornell", "builtin:alpha", "builtin:lights"}) {
        SCOPED_TRACE(name);
        auto scene = scene::make_builtin_scene(name);
        ASSERT_TRUE(scene) << scene.error().message();
        std::mutex mutex;
        std::vector<std::string> messages;
        auto device = instance.create_device({.backend = std::string("cpu:") + GetParam()});
        ASSERT_TRUE(device) << device.error().message();
        (*device)->set_message_callback([&](const rhi::Message& message) {
            const std::scoped_lock lock(mutex);
            messages.push_back(message.text);
        });
        auto renderer = passes::Renderer::create(**device, *scene, {.width = 80, .height = 48});
        ASSERT_TRUE(renderer) << renderer.error().message();
        // The second frame finds what the first has left.
        for (int frame = 0; frame < 2; ++frame) {
            const auto rendered = (*renderer)->render_frame();
            ASSERT_TRUE(rendered) << rendered.error().message();
        }
        const auto picture = (*renderer)->read_final();
        ASSERT_TRUE(picture) << picture.error().message();
        renderer->reset();
        device->reset();
        for (const std::string& message : messages) ADD_FAILURE() << message;
    }
}

}  // namespace
}  // namespace nacre::cpu
