// SPDX-License-Identifier: Apache-2.0
// The same pictures drawn through the RHI and by hand in Vulkan are the same to the last bit.
#include <cstring>

#include "tests/backends/vulkan/native_vulkan.h"
#include "tests/backends/vulkan/vulkan_device.h"

namespace nacre::vulkan::test {
namespace {

const std::string vertex_text = R"(
layout(set = 0, binding = 0) uniform Placement { vec4 corners[3]; };
layout(push_constant) uniform Push { vec4 tint; };
layout(location = 0) out vec4 color;
void main() {
    color = vec4(gl_VertexIndex == 0, gl_VertexIndex == 1, gl_VertexIndex == 2, 1) * 0.9 + tint;
    gl_Position = corners[gl_VertexIndex];
})";

const std::string fragment_text = R"(
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 result;
void main() { result = color * (1 + 0.1 * sin(gl_FragCoord.x * 0.7) + 0.1 * cos(gl_FragCoord.y)); })";

struct Case {
    const char* name;
    rhi::Format format;
    VkFormat native_format;
    std::uint32_t texel_bytes;
};

class NativeTwin : public testing::TestWithParam<std::tuple<const char*, Case>> {};

TEST_P(NativeTwin, DrawsTheSameTriangles) {
    const auto& [spec, each] = GetParam();
    TestDevice device(spec);
    const auto native = NativeVulkan::create();
    if (!device.get() || !native) GTEST_SKIP() << "no Vulkan device: " << device.error();
    constexpr std::uint32_t width = 97, height = 61;
    // Perspective, odd positions, and the second triangle in part outside of the picture.
    const float corners[2][12] = {{-0.93f, 0.81f, 0.2f, 1.0f, 0.05f, -1.94f, 0.5f, 2.0f, 0.77f, 0.63f, 0.1f, 1.0f},
                                  {-0.5f, -0.4f, 0.0f, 1.0f, 1.7f, 0.3f, 0.5f, 1.0f, -0.1f, 2.5f, 0.9f, 1.3f}};
    const float tints[2][4] = {{0.01f, 0.02f, 0.03f, 0.0f}, {0.1f, 0.0f, 0.05f, 0.0f}};
    const rhi::ShaderDesc vertex = compile_text("twin.vert", vertex_text);
    const rhi::ShaderDesc fragment = compile_text("twin.frag", fragment_text);

    // Through the RHI.
    std::vector<std::byte> ours;
    {
        const auto target =
            must(device->create_texture({.format = each.format,
                                         .width = width,
                                         .height = height,
                                         .usage = rhi::TextureUsage::color_target | rhi::TextureUsage::copy_source}));
        rhi::GraphicsPipelineDesc desc;
        desc.vertex = must(device->create_shader(vertex));
        desc.fragment = must(device->create_shader(fragment));
        desc.color_targets = {{.format = each.format}};
        const auto pipeline = must(device->create_graphics_pipeline(desc));
        const auto layout = must(device->bind_group_layout(pipeline, 0));
        rhi::CommandList list = device->create_command_list("twin");
        list.begin_render_pass({.color = {{.view = target, .load = rhi::LoadOperation::clear}}});
        list.set_pipeline(pipeline);
        for (int i = 0; i < 2; ++i) {
            const auto buffer = must(device->create_buffer({.size = 48, .usage = rhi::BufferUsage::uniform}));
            must(device->write_buffer(buffer, std::as_bytes(std::span(corners[i]))));
            list.set_bind_group(
                0, must(device->create_bind_group({.layout = layout, .entries = {{.binding = 0, .buffer = buffer}}})));
            list.set_push_constants(std::as_bytes(std::span(tints[i])));
            list.draw({.vertex_count = 3});
        }
        list.end_render_pass();
        must(device->submit(std::move(list)));
        ours = must(device->read_texture(target));
    }

    // By hand.
    const NativeImage target = native->make_target(each.native_format, width, height);
    const VkDescriptorType type = VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
    const VkDescriptorSetLayout layout = native->make_set_layout(type, VK_SHADER_STAGE_VERTEX_BIT);
    const NativePipeline pipeline =
        native->make_graphics_pipeline(vertex.spirv, fragment.spirv, each.native_format, layout, 16);
    std::vector<NativeBuffer> buffers;
    for (const auto& triangle : corners) {
        buffers.push_back(native->make_buffer(48, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT));
        std::memcpy(buffers.back().mapped, triangle, 48);
    }
    const std::vector<VkDescriptorSet> sets = native->make_sets(layout, type, buffers);
    const VkCommandBuffer commands = native->begin_commands();
    native->begin_rendering(commands, target, width, height);
    native->vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    for (int i = 0; i < 2; ++i) {
        native->vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &sets[i], 0,
                                         nullptr);
        native->vk.CmdPushConstants(commands, pipeline.layout,
                                    VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, 16, tints[i]);
        native->vk.CmdDraw(commands, 3, 1, 0, 0);
    }
    native->vk.CmdEndRendering(commands);
    native->submit(commands);
    native->wait();
    const std::vector<std::byte> theirs = native->read(target, width, height, each.texel_bytes);
    for (const NativeBuffer& buffer : buffers) native->destroy(buffer);
    native->destroy(target);
    native->destroy(pipeline);

    ASSERT_EQ(ours.size(), theirs.size());
    std::size_t covered = 0, different = 0;
    for (std::size_t i = 0; i < ours.size(); i += each.texel_bytes) {
        const std::vector<std::byte> empty(each.texel_bytes);
        covered += std::memcmp(&theirs[i], empty.data(), each.texel_bytes) != 0;
        different += std::memcmp(&ours[i], &theirs[i], each.texel_bytes) != 0;
    }
    EXPECT_EQ(different, 0u) << "texels differ";
    EXPECT_GT(covered, width * height / 4) << "the pictures are all but empty";
    device.destroy_device();
    for (const std::string& message : device.take_messages()) ADD_FAILURE() << message;
}

INSTANTIATE_TEST_SUITE_P(
    Vulkan, NativeTwin,
    testing::Combine(every_mode,
                     testing::Values(Case{"rgba8", rhi::Format::rgba8_unorm, VK_FORMAT_R8G8B8A8_UNORM, 4},
                                     Case{"srgb", rhi::Format::rgba8_srgb, VK_FORMAT_R8G8B8A8_SRGB, 4},
                                     Case{"float", rhi::Format::rgba32_float, VK_FORMAT_R32G32B32A32_SFLOAT, 16})),
    [](const auto& each) {
        return mode_name({std::get<0>(each.param), each.index}) + "_" + std::get<1>(each.param).name;
    });

}  // namespace
}  // namespace nacre::vulkan::test
