// SPDX-License-Identifier: Apache-2.0
// A silent validation layer proves something only where it would speak. Here the barriers that the RHI works out are
// taken away, and the layer must report the hazard; with them it must be silent.
//
// Synchronization validation of 1.3.239 does not see what is written to attachments under dynamic rendering, and
// overlooks hazards between two shaders that both declare a storage buffer writable. The first is why the whole suite
// also runs with render passes; the cases here keep to what the layer sees.
#include <algorithm>

#include "tests/backends/vulkan/altered_backend.h"
#include "tests/backends/vulkan/vulkan_device.h"

namespace nacre::vulkan::test {
namespace {

using namespace rhi;

void keep(std::vector<Barrier>&) {}

/// Leaves nothing to wait for. Layouts still change, so that nothing but the hazard is wrong.
void forget_what_was_before(std::vector<Barrier>& barriers) {
    for (Barrier& barrier : barriers) {
        barrier.before = {};
        barrier.discard = true;
    }
}

class ValidationCanary : public testing::TestWithParam<const char*> {
  protected:
    void SetUp() override {
        if (!TestDevice::has_validation_layer()) GTEST_SKIP() << "the Khronos validation layer is not installed";
    }

    /// Runs `work` with the barriers changed and returns the messages about hazards.
    template <typename Work>
    std::vector<std::string> hazards_of(BarrierChange change, Work work) {
        std::vector<std::unique_ptr<Backend>> backends;
        backends.push_back(std::make_unique<AlteredBackend>(std::move(change)));
        Instance instance(std::move(backends));
        auto device = instance.create_device({.backend = GetParam(), .driver_validation = true});
        if (!device) {
            ADD_FAILURE() << device.error().message();
            return {};
        }
        std::vector<std::string> hazards;
        (*device)->set_message_callback([&](const Message& message) {
            if (message.code.starts_with("SYNC-HAZARD"))
                hazards.push_back(message.code);
            else
                ADD_FAILURE() << message.code << ": " << message.text;
        });
        work(**device);
        must((*device)->wait_idle());
        if (!hazards.empty()) {
            EXPECT_GT((*device)->error_message_count(), 0u);
        }
        return hazards;
    }
};

void copy_twice(Device& device) {
    Buffer buffers[3];
    for (Buffer& each : buffers)
        each = must(device.create_buffer(
            {.size = 256, .usage = BufferUsage::copy_source | BufferUsage::copy_destination, .name = "copied"}));
    CommandList list = device.create_command_list("copies");
    list.copy_buffer(buffers[0], 0, buffers[1], 0, 256);
    list.copy_buffer(buffers[1], 0, buffers[2], 0, 256);
    must(device.submit(std::move(list)));
}

void write_and_read_in_shaders(Device& device) {
    const Buffer buffer = must(device.create_buffer({.size = 256, .usage = BufferUsage::storage, .name = "written"}));
    const Buffer other = must(device.create_buffer({.size = 256, .usage = BufferUsage::storage, .name = "result"}));
    const auto pipeline = [&](const char* text) {
        return must(
            device.create_compute_pipeline({.shader = must(device.create_shader(compile_text("a.comp", text)))}));
    };
    const ComputePipeline write = pipeline(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) writeonly buffer Values { uint values[]; };
        void main() { values[0] = 1; })");
    const ComputePipeline read = pipeline(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) readonly buffer Values { uint values[]; };
        layout(set = 0, binding = 1) writeonly buffer Result { uint result[]; };
        void main() { result[0] = values[0]; })");
    CommandList list = device.create_command_list("shaders");
    list.set_pipeline(write);
    list.set_bind_group(0, must(device.create_bind_group({.layout = must(device.bind_group_layout(write, 0)),
                                                          .entries = {{.binding = 0, .buffer = buffer}}})));
    list.dispatch({});
    list.set_pipeline(read);
    list.set_bind_group(0, must(device.create_bind_group(
                               {.layout = must(device.bind_group_layout(read, 0)),
                                .entries = {{.binding = 0, .buffer = buffer}, {.binding = 1, .buffer = other}}})));
    list.dispatch({});
    must(device.submit(std::move(list)));
}

void draw_and_copy(Device& device) {
    const Texture target = must(device.create_texture({.format = Format::rgba8_unorm,
                                                       .width = 8,
                                                       .height = 8,
                                                       .usage = TextureUsage::color_target | TextureUsage::copy_source,
                                                       .name = "drawn"}));
    const Buffer pixels =
        must(device.create_buffer({.size = 256, .usage = BufferUsage::copy_destination, .name = "pixels"}));
    CommandList list = device.create_command_list("draw");
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}});
    list.end_render_pass();
    list.copy_texture_to_buffer(target, pixels);
    must(device.submit(std::move(list)));
}

TEST_P(ValidationCanary, SpeaksOfCopiesWithoutBarriers) {
    EXPECT_TRUE(hazards_of(keep, copy_twice).empty());
    EXPECT_FALSE(hazards_of(forget_what_was_before, copy_twice).empty());
}

TEST_P(ValidationCanary, SpeaksOfShadersWithoutBarriers) {
    EXPECT_TRUE(hazards_of(keep, write_and_read_in_shaders).empty());
    EXPECT_FALSE(hazards_of(forget_what_was_before, write_and_read_in_shaders).empty());
}

TEST_P(ValidationCanary, SpeaksOfAttachmentsWithoutBarriers) {
    EXPECT_TRUE(hazards_of(keep, draw_and_copy).empty());
    if (std::string_view(GetParam()) == "vulkan") return;  // The blind spot.
    EXPECT_FALSE(hazards_of(forget_what_was_before, draw_and_copy).empty());
}

INSTANTIATE_TEST_SUITE_P(Vulkan, ValidationCanary, every_mode, mode_name);

}  // namespace
}  // namespace nacre::vulkan::test
