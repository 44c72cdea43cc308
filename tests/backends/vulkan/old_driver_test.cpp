// SPDX-License-Identifier: Apache-2.0
// Drivers that are older than the one here: Vulkan 1.2, where what 1.3 has in its core are extensions.
#include <cstring>

#include "backends/vulkan/device.h"
#include "tests/backends/vulkan/vulkan_device.h"

// Not within nacre::vulkan, whose names for its own objects are those of the RHI.
namespace nacre::test {
namespace {

using namespace rhi;
using vulkan::test::compile_text;
using vulkan::test::must;
using vulkan::test::TestDevice;
using DriverMode = vulkan::Mode;

/// Devices of Vulkan 1.2, whatever the driver offers beyond.
class OldBackend final : public rhi::Backend {
  public:
    explicit OldBackend(DriverMode mode) : mode_(mode) {}
    std::string_view name() const override { return "vulkan"; }
    std::span<const Mode> modes() const override {
        static constexpr Mode list[] = {{"", "as an old driver"}};
        return list;
    }
    Expected<std::vector<rhi::AdapterInfo>> adapters() override { return vulkan::make_backend()->adapters(); }
    Expected<std::unique_ptr<rhi::BackendDevice>> create_device(const rhi::BackendDeviceDesc& desc) override {
        NACRE_TRY(auto library, vulkan::Library::open());
        NACRE_TRY(auto instance, vulkan::Instance::create(library, {.validation = desc.desc->driver_validation,
                                                                    .report = desc.report,
                                                                    .highest_version = VK_API_VERSION_1_2}));
        EXPECT_LT(instance->version(), VK_API_VERSION_1_3);
        return vulkan::Device::create(std::move(instance), mode_, desc);
    }

  private:
    DriverMode mode_;
};

class OldDriver : public testing::TestWithParam<DriverMode> {};

TEST_P(OldDriver, DrawsAndComputes) {
    std::vector<std::unique_ptr<Backend>> backends;
    backends.push_back(std::make_unique<OldBackend>(GetParam()));
    const Instance instance(std::move(backends));
    auto made = instance.create_device({.backend = "vulkan", .driver_validation = TestDevice::has_validation_layer()});
    if (!made && made.error().code == ErrorCode::not_found) GTEST_SKIP() << made.error().message();
    ASSERT_TRUE(made) << made.error().message();
    rhi::Device& device = **made;
    std::mutex mutex;
    device.set_message_callback([&](const Message& message) {
        const std::lock_guard lock(mutex);
        ADD_FAILURE() << message.code << ": " << message.text;
    });
    const TextureUsage usage = TextureUsage::color_target | TextureUsage::copy_source;
    const Texture target =
        must(device.create_texture({.format = Format::rgba8_unorm, .width = 8, .height = 8, .usage = usage}));
    const Texture depth = must(device.create_texture({.format = Format::d32_float,
                                                      .width = 8,
                                                      .height = 8,
                                                      .usage = TextureUsage::depth_target | TextureUsage::sampled}));
    GraphicsPipelineDesc desc;
    desc.vertex = must(device.create_shader(compile_text("all.vert", R"(
        void main() {
            gl_Position = vec4(gl_VertexIndex == 1 ? 3 : -1, gl_VertexIndex == 2 ? 3 : -1, 0.5, 1);
        })")));
    desc.fragment = must(device.create_shader(compile_text("all.frag", R"(
        layout(location = 0) out vec4 color;
        void main() { color = vec4(0, 1, 0, 1); })")));
    desc.color_targets = {{.format = Format::rgba8_unorm}};
    desc.depth_stencil = {.format = Format::d32_float, .depth_test = true, .depth_write = true};
    const GraphicsPipeline pipeline = must(device.create_graphics_pipeline(desc));
    const ComputePipeline compute =
        must(device.create_compute_pipeline({.shader = must(device.create_shader(compile_text("add.comp", R"(
            layout(local_size_x = 1) in;
            layout(set = 0, binding = 0) buffer Values { uint values[]; };
            void main() { values[0] += 5; })")))}));
    const Buffer values =
        must(device.create_buffer({.size = 16, .usage = BufferUsage::storage | BufferUsage::copy_destination}));
    CommandList list = device.create_command_list("old");
    list.fill_buffer(values, 1);
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}},
                            .depth_stencil = {.view = depth, .depth_load = LoadOperation::clear}});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    list.begin_render_pass({.color = {{.view = target}}, .depth_stencil = {.view = depth, .read_only = true}});
    list.end_render_pass();
    list.set_pipeline(compute);
    list.set_bind_group(0, must(device.create_bind_group({.layout = must(device.bind_group_layout(compute, 0)),
                                                          .entries = {{.binding = 0, .buffer = values}}})));
    list.dispatch({});
    list.dispatch({});
    must(device.submit(std::move(list)));
    const auto pixels = must(device.read_texture(target));
    for (std::size_t i = 0; i < pixels.size(); i += 4) {
        std::uint32_t pixel = 0;
        std::memcpy(&pixel, &pixels[i], 4);
        ASSERT_EQ(pixel, 0xff00ff00u);
    }
    std::uint32_t value = 0;
    std::memcpy(&value, must(device.read_buffer(values)).data(), 4);
    EXPECT_EQ(value, 11u);
    made->reset();
}

INSTANTIATE_TEST_SUITE_P(Vulkan, OldDriver,
                         testing::Values(DriverMode::automatic, DriverMode::render_pass, DriverMode::legacy),
                         [](const auto& each) {
                             return each.param == DriverMode::automatic     ? "extensions"
                                    : each.param == DriverMode::render_pass ? "renderpass"
                                                                            : "legacy";
                         });

}  // namespace
}  // namespace nacre::test
