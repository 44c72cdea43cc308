// SPDX-License-Identifier: Apache-2.0
#include <numeric>

#include "tests/backends/gl/gl_device.h"

namespace nacre::rhi {
namespace {

using GlDeviceTest = GlTest;
INSTANTIATE_TEST_SUITE_P(All, GlDeviceTest, testing::ValuesIn(device_kinds), name_of);

constexpr const char* double_values = R"(
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) readonly buffer Source { uint source[]; };
layout(set = 0, binding = 1) buffer Destination { uint destination[]; };
layout(push_constant) uniform Parameters { uint count; uint factor; };
void main() {
    if (gl_GlobalInvocationID.x < count) destination[gl_GlobalInvocationID.x] = source[gl_GlobalInvocationID.x] * factor;
}
)";

BindGroup bind_buffers(Device& device, ComputePipeline pipeline, std::vector<Buffer> buffers) {
    BindGroupDesc desc{.layout = expect(device.bind_group_layout(pipeline, 0))};
    for (std::uint32_t i = 0; i < buffers.size(); ++i) desc.entries.push_back({.binding = i, .buffer = buffers[i]});
    return expect(device.create_bind_group(desc));
}

TEST_P(GlDeviceTest, ComputesIntoABuffer) {
    if (!has_device()) return;
    constexpr std::uint32_t count = 1000;
    std::vector<std::uint32_t> values(count);
    std::iota(values.begin(), values.end(), 7u);
    const Buffer source =
        expect(device_->create_buffer({.size = count * 4, .usage = BufferUsage::storage, .name = "in"}));
    const Buffer result =
        expect(device_->create_buffer({.size = count * 4, .usage = BufferUsage::storage, .name = "out"}));
    expect(device_->write_buffer(source, std::span<const std::uint32_t>(values)));
    const ComputePipeline pipeline = expect(device_->create_compute_pipeline(
        {.shader = make_shader(*device_, "double.comp", double_values), .name = "double"}));
    CommandList list = device_->create_command_list("compute");
    list.set_pipeline(pipeline);
    list.set_bind_group(0, bind_buffers(*device_, pipeline, {source, result}));
    list.set_push_constants(std::array<std::uint32_t, 2>{count, 3});
    list.dispatch({.x = (count + 63) / 64});
    expect(device_->wait(expect(device_->submit(std::move(list)))));
    const auto found = as_values<std::uint32_t>(expect(device_->read_buffer(result)));
    ASSERT_EQ(found.size(), count);
    for (std::uint32_t i = 0; i < count; ++i) ASSERT_EQ(found[i], (i + 7) * 3);
}

constexpr const char* triangle_vertex = R"(
layout(location = 0) out vec3 color;
void main() {
    const vec2 corners[3] = vec2[](vec2(-0.8, -0.8), vec2(0.8, -0.8), vec2(0.0, 0.9));
    gl_Position = vec4(corners[gl_VertexIndex], 0.0, 1.0);
    color = vec3(gl_VertexIndex == 0, gl_VertexIndex == 1, gl_VertexIndex == 2);
}
)";
constexpr const char* triangle_fragment = R"(
layout(location = 0) in vec3 color;
layout(location = 0) out vec4 result;
void main() { result = vec4(color, 1.0); }
)";

TEST_P(GlDeviceTest, DrawsATriangle) {
    if (!has_device()) return;
    const Texture target = expect(device_->create_texture({.format = Format::rgba8_unorm, .width = 64, .height = 64,
        .usage = TextureUsage::color_target | TextureUsage::copy_source, .name = "target"}));
    const GraphicsPipeline pipeline = expect(device_->create_graphics_pipeline(
        {.vertex = make_shader(*device_, "triangle.vert", triangle_vertex),
         .fragment = make_shader(*device_, "triangle.frag", triangle_fragment),
         .color_targets = {{.format = Format::rgba8_unorm}},
         .name = "triangle"}));
    CommandList list = device_->create_command_list("triangle");
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear,
                                       .clear = {.floating = {0.0f, 0.0f, 0.25f, 1.0f}}}}, .name = "triangle"});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    expect(device_->submit(std::move(list)));
    const auto picture = texels<std::uint32_t>(*device_, target);
    ASSERT_EQ(picture.size(), 64u * 64u);
    EXPECT_EQ(picture[0], 0xff400000u);            // A corner: the clear color.
    EXPECT_EQ(picture[32 * 64 + 32] >> 24, 0xffu); // The middle: some mix of the corners' colors.
    EXPECT_NE(picture[32 * 64 + 32], 0xff400000u);
    // Vertex 0 (red) is on the top left, vertex 1 (green) on the top right, vertex 2 (blue) at the bottom.
    EXPECT_GT(picture[8 * 64 + 10] & 0xff, 200u);
    EXPECT_GT(picture[8 * 64 + 53] >> 8 & 0xff, 200u);
    EXPECT_GT(picture[58 * 64 + 32] >> 16 & 0xff, 200u);
}

TEST_P(GlDeviceTest, SaysWhatItIs) {
    if (!has_device()) return;
    const Capabilities& capabilities = device_->capabilities();
    EXPECT_FALSE(device_->adapter().name.empty());
    EXPECT_THAT(device_->adapter().api_version, testing::HasSubstr("OpenGL"));
    EXPECT_GE(capabilities.max_texture_2d, 2048u);
    EXPECT_FALSE(capabilities.descriptor_indexing);
    EXPECT_FALSE(capabilities.subgroup_operations);
    EXPECT_TRUE(capabilities.supports(Format::rgba8_unorm, FormatSupport::sampled | FormatSupport::color_target));
    EXPECT_TRUE(capabilities.supports(Format::r32_uint, FormatSupport::color_target | FormatSupport::storage_image));
}

}  // namespace
}  // namespace nacre::rhi
