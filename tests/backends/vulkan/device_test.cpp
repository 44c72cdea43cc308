// SPDX-License-Identifier: Apache-2.0
// What the backend does in each of its modes, under the Khronos validation layer with synchronization validation.
#include <algorithm>
#include <cstring>
#include <numeric>

#include "tests/backends/vulkan/vulkan_device.h"

namespace nacre::vulkan::test {
namespace {

using namespace rhi;

class DeviceTest : public EveryMode {
  protected:
    Texture make_target(Format format, std::uint32_t width, std::uint32_t height, std::uint32_t samples = 1,
                        TextureUsage more = TextureUsage::none) {
        return must(gpu().create_texture(
            {.format = format,
             .width = width,
             .height = height,
             .samples = samples,
             .usage = (info(format).has_depth ? TextureUsage::depth_target : TextureUsage::color_target) |
                      (samples == 1 ? TextureUsage::copy_source : TextureUsage::none) | more,
             .name = "target"}));
    }
    Shader make_shader(const std::string& path, const std::string& text) {
        return must(gpu().create_shader(compile_text(path, text)));
    }
    GraphicsPipeline make_pipeline(GraphicsPipelineDesc desc, const std::string& vertex, const std::string& fragment) {
        desc.vertex = make_shader("test.vert", vertex);
        if (!fragment.empty()) desc.fragment = make_shader("test.frag", fragment);
        return must(gpu().create_graphics_pipeline(desc));
    }
    template <typename T>
    std::vector<T> read(Texture texture, std::uint32_t mip = 0, std::uint32_t layer = 0) {
        const std::vector<std::byte> bytes = must(gpu().read_texture(texture, mip, layer));
        std::vector<T> values(bytes.size() / sizeof(T));
        std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
        return values;
    }
    template <typename T>
    std::vector<T> read(Buffer buffer) {
        const std::vector<std::byte> bytes = must(gpu().read_buffer(buffer));
        std::vector<T> values(bytes.size() / sizeof(T));
        std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
        return values;
    }
};

/// A triangle that covers everything, at a depth given by push constants.
const std::string covering_vertex = R"(
layout(push_constant) uniform Push { float depth; };
void main() {
    vec2 corner = vec2(gl_VertexIndex == 1 ? 3 : -1, gl_VertexIndex == 2 ? 3 : -1);
    gl_Position = vec4(corner, depth, 1);
})";

const std::string red_fragment = "layout(location = 0) out vec4 color; void main() { color = vec4(1, 0, 0, 1); }";

TEST_P(DeviceTest, DrawsATriangle) {
    const Texture target = make_target(Format::rgba8_unorm, 16, 8);
    const GraphicsPipeline pipeline = make_pipeline({.color_targets = {{.format = Format::rgba8_unorm}}}, R"(
        void main() {
            // The left half of the picture, upper left corner first.
            const vec2 corners[6] = vec2[](vec2(-1, -1), vec2(-1, 1), vec2(0, -1), vec2(0, -1), vec2(-1, 1), vec2(0, 1));
            gl_Position = vec4(corners[gl_VertexIndex], 0, 1);
        })",
                                                    red_fragment);
    CommandList list = gpu().create_command_list("triangle");
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}, .name = "pass"});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 6});
    list.end_render_pass();
    must(gpu().submit(std::move(list)));
    const auto pixels = read<std::uint32_t>(target);
    ASSERT_EQ(pixels.size(), 16u * 8u);
    for (std::uint32_t y = 0; y < 8; ++y)
        for (std::uint32_t x = 0; x < 16; ++x)
            EXPECT_EQ(pixels[y * 16 + x], x < 8 ? 0xff0000ffu : 0u) << x << ", " << y;
}

TEST_P(DeviceTest, ComputesInTwoDispatchesThatDepend) {
    const Buffer buffer = must(gpu().create_buffer({.size = 1024, .usage = BufferUsage::storage, .name = "values"}));
    const Buffer sums = must(gpu().create_buffer({.size = 1024, .usage = BufferUsage::storage, .name = "sums"}));
    const ComputePipeline first = must(gpu().create_compute_pipeline({.shader = make_shader("first.comp", R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) writeonly buffer Values { uint values[]; };
        layout(push_constant) uniform Push { uint scale; };
        void main() { values[gl_GlobalInvocationID.x] = gl_GlobalInvocationID.x * scale; })")}));
    const ComputePipeline second = must(gpu().create_compute_pipeline({.shader = make_shader("second.comp", R"(
        layout(local_size_x = 64) in;
        layout(constant_id = 3) const uint offset = 1;
        layout(set = 0, binding = 0) readonly buffer Values { uint values[]; };
        layout(set = 0, binding = 1) writeonly buffer Sums { uint sums[]; };
        void main() {
            uint i = gl_GlobalInvocationID.x;
            sums[i] = values[i] + values[255 - i] + offset;
        })"),
                                                                       .specialization = {{3, 1000u}}}));
    const BindGroup first_group = must(gpu().create_bind_group(
        {.layout = must(gpu().bind_group_layout(first, 0)), .entries = {{.binding = 0, .buffer = buffer}}}));
    const BindGroup second_group =
        must(gpu().create_bind_group({.layout = must(gpu().bind_group_layout(second, 0)),
                                      .entries = {{.binding = 0, .buffer = buffer}, {.binding = 1, .buffer = sums}}}));
    CommandList list = gpu().create_command_list("compute");
    list.set_pipeline(first);
    list.set_bind_group(0, first_group);
    list.set_push_constants(3u);
    list.dispatch({.x = 4});
    list.set_pipeline(second);
    list.set_bind_group(0, second_group);
    list.dispatch({.x = 4});
    must(gpu().submit(std::move(list)));
    const auto values = read<std::uint32_t>(sums);
    for (std::uint32_t i = 0; i < 256; ++i) ASSERT_EQ(values[i], 255u * 3u + 1000u) << i;
}

TEST_P(DeviceTest, ResolvesFourSamples) {
    if (gpu().capabilities().max_samples < 4) GTEST_SKIP() << "no multisampling";
    const Texture target = make_target(Format::rgba8_unorm, 8, 8, 4);
    const Texture resolved = make_target(Format::rgba8_unorm, 8, 8);
    const GraphicsPipeline pipeline =
        make_pipeline({.samples = 4, .color_targets = {{.format = Format::rgba8_unorm}}}, R"(
        void main() {
            // Everything above the diagonal.
            gl_Position = vec4(gl_VertexIndex == 2 ? 1 : -1, gl_VertexIndex == 1 ? 1 : -1, 0, 1);
        })",
                      red_fragment);
    CommandList list = gpu().create_command_list("resolve");
    list.begin_render_pass(
        {.color = {
             {.view = target, .load = LoadOperation::clear, .store = StoreOperation::discard, .resolve = resolved}}});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    must(gpu().submit(std::move(list)));
    const auto pixels = read<std::uint32_t>(resolved);
    EXPECT_EQ(pixels[0], 0xff0000ffu);
    EXPECT_EQ(pixels[63], 0u);
    const std::uint32_t on_diagonal = pixels[7] & 0xff;
    EXPECT_GT(on_diagonal, 0x20u);
    EXPECT_LT(on_diagonal, 0xe0u);
}

TEST_P(DeviceTest, TestsDepthAndSamplesItReadOnly) {
    const Texture color = make_target(Format::r32_float, 4, 4);
    const Texture depth = make_target(Format::d32_float, 4, 4, 1, TextureUsage::sampled);
    const DepthStencilState state{
        .format = Format::d32_float, .depth_test = true, .depth_write = true, .depth_compare = CompareOperation::less};
    const GraphicsPipeline writer = make_pipeline({.depth_stencil = state}, covering_vertex, "");
    DepthStencilState read_only = state;
    read_only.depth_write = false;
    read_only.depth_compare = CompareOperation::greater;
    const GraphicsPipeline reader = make_pipeline(
        {.depth_stencil = read_only, .color_targets = {{.format = Format::r32_float}}}, covering_vertex, R"(
        layout(set = 0, binding = 0) uniform texture2D depth_texture;
        layout(set = 0, binding = 1) uniform sampler nearest;
        layout(location = 0) out float color;
        void main() { color = texelFetch(sampler2D(depth_texture, nearest), ivec2(gl_FragCoord.xy), 0).r * 2; })");
    const Sampler sampler =
        must(gpu().create_sampler({.magnify = Filter::nearest, .minify = Filter::nearest, .mip = Filter::nearest}));
    const BindGroup group = must(
        gpu().create_bind_group({.layout = must(gpu().bind_group_layout(reader, 0)),
                                 .entries = {{.binding = 0, .texture = depth}, {.binding = 1, .sampler = sampler}}}));
    CommandList list = gpu().create_command_list("depth");
    list.begin_render_pass({.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear}});
    list.set_pipeline(writer);
    list.set_push_constants(0.25f);
    list.draw({.vertex_count = 3});
    list.set_push_constants(0.5f);  // Fails the test.
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    list.begin_render_pass({.color = {{.view = color, .load = LoadOperation::clear}},
                            .depth_stencil = {.view = depth, .read_only = true}});
    list.set_pipeline(reader);
    list.set_bind_group(0, group);
    list.set_push_constants(0.5f);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    must(gpu().submit(std::move(list)));
    for (const float value : read<float>(color)) EXPECT_EQ(value, 0.5f);
    for (const float value : read<float>(depth)) EXPECT_EQ(value, 0.25f);
}

TEST_P(DeviceTest, FillsMipsOfArrays) {
    const Texture texture = must(gpu().create_texture(
        {.format = Format::rgba8_unorm,
         .width = 8,
         .height = 4,
         .layers = 2,
         .mips = 4,
         .usage = TextureUsage::sampled | TextureUsage::copy_source | TextureUsage::copy_destination,
         .name = "mips"}));
    for (std::uint32_t layer = 0; layer < 2; ++layer) {
        std::vector<std::uint32_t> texels(32);
        for (std::uint32_t i = 0; i < 32; ++i)
            texels[i] = i % 8 < 4 ? 0x00000000u : (layer == 0 ? 0x808080ffu : 0x40404040u);
        must(gpu().write_texture(texture, std::as_bytes(std::span(texels)), 0, layer));
    }
    CommandList list = gpu().create_command_list("mips");
    list.generate_mips(texture);
    must(gpu().submit(std::move(list)));
    const auto half = read<std::uint32_t>(texture, 1, 0);
    ASSERT_EQ(half.size(), 8u);
    EXPECT_EQ(half[0], 0u);
    EXPECT_EQ(half[3], 0x808080ffu);
    const auto second = read<std::uint32_t>(texture, 2, 1);
    ASSERT_EQ(second.size(), 2u);
    EXPECT_EQ(second[1], 0x40404040u);
    const auto last = read<std::uint32_t>(texture, 3, 1);
    ASSERT_EQ(last.size(), 1u);
    EXPECT_EQ(last[0], 0x20202020u);
}

TEST_P(DeviceTest, CountsSamplesAndTime) {
    const Texture target = make_target(Format::rgba8_unorm, 16, 16);
    const GraphicsPipeline pipeline =
        make_pipeline({.color_targets = {{.format = Format::rgba8_unorm}}}, covering_vertex, red_fragment);
    const QueryPool occlusion =
        must(gpu().create_query_pool({.type = QueryType::occlusion, .count = 4, .name = "seen"}));
    const QueryPool times = must(gpu().create_query_pool({.type = QueryType::timestamp, .count = 3, .name = "times"}));
    for (int repetition = 0; repetition < 3; ++repetition) {
        CommandList list = gpu().create_command_list("queries");
        list.push_debug_group("around both passes");
        list.write_timestamp(times, 0);
        for (std::uint32_t pass = 0; pass < 2; ++pass) {
            list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}});
            list.set_pipeline(pipeline);
            list.set_push_constants(0.0f);
            // The same queries in both passes: each write starts from nothing.
            list.begin_occlusion_query(occlusion, 0);
            list.draw({.vertex_count = 3});
            list.end_occlusion_query(occlusion, 0);
            list.set_scissor({4, 4, 8, 2});
            list.begin_occlusion_query(occlusion, 1 + pass);
            list.draw({.vertex_count = 3});
            list.end_occlusion_query(occlusion, 1 + pass);
            if (pass == 0) list.write_timestamp(times, 1);
            list.end_render_pass();
        }
        list.write_timestamp(times, 2);
        list.pop_debug_group();
        must(gpu().submit(std::move(list)));
        const auto samples = must(gpu().read_queries(occlusion, 0, 3));
        ASSERT_EQ(samples.size(), 3u);
        if (gpu().capabilities().precise_occlusion) {
            EXPECT_EQ(samples[0], 256u);
            EXPECT_EQ(samples[1], 16u);
            EXPECT_EQ(samples[2], 16u);
        }
        const auto at = must(gpu().read_queries(times, 0, 3));
        ASSERT_EQ(at.size(), 3u);
        EXPECT_LE(at[0], at[1]);
        EXPECT_LT(at[0], at[2]);
        EXPECT_LT(at[2] - at[0], 10'000'000'000u);
    }
}

// A pass that follows a query is recorded into a command buffer of its own; the group around both must not break.
TEST_P(DeviceTest, DebugGroupsReachOverPassesAndQueries) {
    const Texture target = make_target(Format::rgba8_unorm, 4, 4);
    const QueryPool times = must(gpu().create_query_pool({.type = QueryType::timestamp, .count = 6, .name = "times"}));
    for (int repetition = 0; repetition < 3; ++repetition) {
        CommandList list = gpu().create_command_list("groups");
        list.push_debug_group("frame");
        for (std::uint32_t pass = 0; pass < 3; ++pass) {
            list.push_debug_group("pass");
            list.write_timestamp(times, 2 * pass);
            list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}});
            list.end_render_pass();
            list.write_timestamp(times, 2 * pass + 1);
            list.pop_debug_group();
        }
        list.pop_debug_group();
        must(gpu().submit(std::move(list)));
        EXPECT_EQ(must(gpu().read_queries(times, 0, 6)).size(), 6u);
    }
}

TEST_P(DeviceTest, DrawsIndirectlyFromArgumentsThatAShaderWrote) {
    const Texture target = make_target(Format::r32_uint, 4, 1);
    const Buffer arguments = must(gpu().create_buffer({.size = 4 * sizeof(DrawArguments),
                                                       .usage = BufferUsage::storage | BufferUsage::indirect,
                                                       .name = "arguments"}));
    const ComputePipeline writer = must(gpu().create_compute_pipeline({.shader = make_shader("arguments.comp", R"(
        layout(local_size_x = 4) in;
        layout(set = 0, binding = 0) writeonly buffer Arguments { uvec4 arguments[]; };
        void main() { arguments[gl_LocalInvocationIndex] = uvec4(1, 1, gl_LocalInvocationIndex, 0); })")}));
    const GraphicsPipeline pipeline =
        make_pipeline({.topology = Topology::point_list, .color_targets = {{.format = Format::r32_uint}}}, R"(
        layout(location = 0) flat out uint number;
        void main() {
            number = 10 + gl_VertexIndex;
            gl_PointSize = 1;
            gl_Position = vec4((gl_VertexIndex + 0.5) / 2 - 1, 0, 0, 1);
        })",
                      "layout(location = 0) flat in uint number; layout(location = 0) out uint color; void main() { "
                      "color = number; }");
    const BindGroup group = must(gpu().create_bind_group(
        {.layout = must(gpu().bind_group_layout(writer, 0)), .entries = {{.binding = 0, .buffer = arguments}}}));
    CommandList list = gpu().create_command_list("indirect");
    list.set_pipeline(writer);
    list.set_bind_group(0, group);
    list.dispatch({});
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.draw_indirect(arguments, 0, 4);
    list.end_render_pass();
    must(gpu().submit(std::move(list)));
    EXPECT_EQ(read<std::uint32_t>(target), (std::vector<std::uint32_t>{10, 11, 12, 13}));
}

TEST_P(DeviceTest, KeepsGroupsAndConstantsAcrossPipelines) {
    const std::string head = R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Values { uint values[]; };
        layout(push_constant) uniform Push { uint at; uint value; };
        )";
    const ComputePipeline one = must(gpu().create_compute_pipeline(
        {.shader = make_shader("one.comp", head + "void main() { values[at] += value; }")}));
    // A second group with a layout of its own, which `one` does not know.
    const ComputePipeline two = must(gpu().create_compute_pipeline({.shader = make_shader("two.comp", head + R"(
        layout(set = 1, binding = 0) uniform Factor { uint factor; };
        void main() { values[at] = (values[at] + value) * factor; })")}));
    const Buffer values = must(gpu().create_buffer(
        {.size = 64, .usage = BufferUsage::storage | BufferUsage::copy_destination, .name = "values"}));
    const Buffer factor = must(gpu().create_buffer({.size = 256, .usage = BufferUsage::uniform, .name = "factor"}));
    const std::uint32_t five[64] = {5};
    must(gpu().write_buffer(factor, std::as_bytes(std::span(five))));
    const BindGroup shared = must(gpu().create_bind_group(
        {.layout = must(gpu().bind_group_layout(one, 0)), .entries = {{.binding = 0, .buffer = values}}}));
    const BindGroup second = must(gpu().create_bind_group(
        {.layout = must(gpu().bind_group_layout(two, 1)), .entries = {{.binding = 0, .buffer = factor}}}));
    CommandList list = gpu().create_command_list("state");
    list.fill_buffer(values, 0);
    struct Push {
        std::uint32_t at, value;
    };
    list.set_bind_group(0, shared);  // Before any pipeline.
    list.set_bind_group(1, second);
    list.set_push_constants(Push{2, 7});
    list.set_pipeline(one);
    list.dispatch({});
    list.set_pipeline(two);
    list.dispatch({});
    list.set_pipeline(one);
    list.dispatch({});
    must(gpu().submit(std::move(list)));
    EXPECT_EQ(read<std::uint32_t>(values)[2], ((0u + 7) + 7) * 5 + 7);
}

TEST_P(DeviceTest, CopiesClearsAndReadsEveryKindOfTexture) {
    struct Case {
        TextureDimension dimension;
        std::uint32_t width, height, depth, layers;
    };
    for (const Case& each : {Case{TextureDimension::d1, 16, 1, 1, 2}, Case{TextureDimension::d2, 8, 4, 1, 3},
                             Case{TextureDimension::d3, 4, 4, 4, 1}, Case{TextureDimension::cube, 4, 4, 1, 6}}) {
        const TextureDesc desc{
            .dimension = each.dimension,
            .format = Format::rgba16_float,
            .width = each.width,
            .height = each.height,
            .depth = each.depth,
            .layers = each.layers,
            .usage = TextureUsage::sampled | TextureUsage::copy_source | TextureUsage::copy_destination,
            .name = "copied"};
        const Texture from = must(gpu().create_texture(desc)), to = must(gpu().create_texture(desc));
        std::vector<std::uint64_t> texels(mip_bytes(desc, 0) / 8);
        std::iota(texels.begin(), texels.end(), std::uint64_t{1});
        const std::uint32_t layer = each.layers - 1;
        must(gpu().write_texture(from, std::as_bytes(std::span(texels)), 0, layer));
        CommandList list = gpu().create_command_list("copies");
        ClearColor color;
        color.floating = {1.0f, 0.5f, 0.0f, 2.0f};
        list.clear_texture(to, color);
        list.copy_texture(from, to, {.source_layer = layer, .destination_layer = layer, .extent = {2, 1, 1}});
        must(gpu().submit(std::move(list)));
        const auto result = read<std::uint64_t>(to, 0, layer);
        ASSERT_EQ(result.size(), texels.size());
        EXPECT_EQ(result[0], texels[0]);
        EXPECT_EQ(result[1], texels[1]);
        for (std::size_t i = 2; i < result.size(); ++i) ASSERT_EQ(result[i], 0x4000'0000'3800'3c00u) << i;
    }
}

TEST_P(DeviceTest, WritesStorageImagesAndSamplesThem) {
    const Texture image = must(gpu().create_texture({.format = Format::r32_uint,
                                                     .width = 8,
                                                     .height = 8,
                                                     .layers = 2,
                                                     .usage = TextureUsage::storage | TextureUsage::sampled,
                                                     .name = "image"}));
    const Buffer sum = must(gpu().create_buffer({.size = 16, .usage = BufferUsage::storage, .name = "sum"}));
    const ComputePipeline writer = must(gpu().create_compute_pipeline({.shader = make_shader("write.comp", R"(
        layout(local_size_x = 8, local_size_y = 8) in;
        layout(set = 0, binding = 0, r32ui) writeonly uniform uimage2DArray image;
        void main() { imageStore(image, ivec3(gl_GlobalInvocationID), uvec4(gl_LocalInvocationIndex)); })")}));
    const ComputePipeline reader = must(gpu().create_compute_pipeline({.shader = make_shader("read.comp", R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) uniform usampler2DArray image;
        layout(set = 0, binding = 1) writeonly buffer Sum { uint sum[]; };
        void main() {
            uint total = 0;
            for (int i = 0; i < 128; ++i)
                total += texelFetch(image, ivec3(i % 8, i / 8 % 8, i / 64), 0).r;
            sum[0] = total;
        })")}));
    const BindGroup write_group = must(gpu().create_bind_group(
        {.layout = must(gpu().bind_group_layout(writer, 0)), .entries = {{.binding = 0, .texture = image}}}));
    const Sampler sampler =
        must(gpu().create_sampler({.magnify = Filter::nearest, .minify = Filter::nearest, .mip = Filter::nearest}));
    const BindGroup read_group = must(gpu().create_bind_group(
        {.layout = must(gpu().bind_group_layout(reader, 0)),
         .entries = {{.binding = 0, .texture = image, .sampler = sampler}, {.binding = 1, .buffer = sum}}}));
    CommandList list = gpu().create_command_list("image");
    list.set_pipeline(writer);
    list.set_bind_group(0, write_group);
    list.dispatch({1, 1, 2});
    list.set_pipeline(reader);
    list.set_bind_group(0, read_group);
    list.dispatch({});
    must(gpu().submit(std::move(list)));
    EXPECT_EQ(read<std::uint32_t>(sum)[0], 2u * 63 * 64 / 2);
}

INSTANTIATE_TEST_SUITE_P(Vulkan, DeviceTest, every_mode, mode_name);

}  // namespace
}  // namespace nacre::vulkan::test
