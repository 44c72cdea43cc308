// SPDX-License-Identifier: Apache-2.0
// Render passes over a rasterizer of the test's own: targets, load and store operations, resolves, and the state of
// draws.
#include <stdlib.h>

#include <atomic>
#include <thread>

#include "tests/backends/cpu/cpu_device.h"
#include "tests/backends/cpu/fake_rasterizer.h"

namespace nacre::cpu {
namespace {

using rhi::Format;
using rhi::LoadOperation;
using rhi::TextureUsage;

void no_vertices(const ShaderContext*, const VertexDraw*, VertexBatch*, std::uint32_t) {}
void no_fragments(const ShaderContext*, FragmentBatch*, std::uint32_t) {}

struct RenderPasses : testing::Test {
    void SetUp() override { FakeRaster::forget(); }
    void TearDown() override { FakeRaster::forget(); }

    std::unique_ptr<rhi::Device> device = make_device();

    rhi::GraphicsPipeline pipeline(Format format, std::uint32_t samples = 1) {
        FakePrograms::set("draw.vert", VertexProgram{.run = no_vertices});
        FakePrograms::set("draw.frag", FragmentProgram{.run = no_fragments});
        rhi::GraphicsPipelineDesc desc;
        desc.vertex = make_shader(*device, "draw.vert", R"(
            layout(push_constant) uniform Parameters { uint value; };
            layout(location = 0) in vec4 place;
            void main() { gl_Position = place * float(value); })");
        desc.fragment =
            make_shader(*device, "draw.frag", "layout(location = 0) out vec4 color; void main() { color = vec4(1); }");
        desc.vertex_buffers = {{.stride = 16}};
        desc.vertex_attributes = {{.location = 0, .buffer = 0, .offset = 0, .format = Format::rgba32_float}};
        desc.color_targets = {{.format = format}};
        desc.samples = samples;
        desc.name = "draw";
        return ok(device->create_graphics_pipeline(desc));
    }
    rhi::Texture target(Format format, std::uint32_t width, std::uint32_t height, std::uint32_t samples = 1,
                        std::uint32_t layers = 1, std::uint32_t mips = 1) {
        return ok(
            device->create_texture({.format = format,
                                    .width = width,
                                    .height = height,
                                    .layers = layers,
                                    .mips = mips,
                                    .samples = samples,
                                    .usage = samples > 1 ? TextureUsage::color_target
                                                         : TextureUsage::color_target | TextureUsage::copy_source |
                                                               TextureUsage::copy_destination,
                                    .name = "target"}));
    }
};

TEST_F(RenderPasses, LoadClearAndKeepTheirTargets) {
    const rhi::Texture first = target(Format::rgba8_unorm, 6, 5, 1, 2, 2), second = target(Format::r32_uint, 3, 2);
    rhi::CommandList list = device->create_command_list();
    list.clear_texture(first, {.floating = {1, 1, 1, 1}});
    list.clear_texture(second, {.uint = {5, 0, 0, 0}});
    list.begin_render_pass({.color = {{.view = rhi::TextureView::subresource(first, 1, 1),
                                       .load = LoadOperation::clear,
                                       .clear = {.floating = {0, 1, 0, 1}}},
                                      {.view = second, .load = LoadOperation::load}}});
    list.end_render_pass();
    run(*device, std::move(list));
    for (std::uint32_t mip = 0; mip < 2; ++mip)
        for (std::uint32_t layer = 0; layer < 2; ++layer)
            for (const std::uint32_t texel : as_values<std::uint32_t>(ok(device->read_texture(first, mip, layer))))
                EXPECT_EQ(texel, mip == 1 && layer == 1 ? 0xff00ff00u : 0xffffffffu);
    for (const std::uint32_t texel : as_values<std::uint32_t>(ok(device->read_texture(second)))) EXPECT_EQ(texel, 5u);
    ASSERT_EQ(FakeRaster::passes.size(), 1u);
    EXPECT_EQ(FakeRaster::passes[0].width, 3u);
    EXPECT_EQ(FakeRaster::passes[0].height, 2u);
    ASSERT_EQ(FakeRaster::passes[0].colors.size(), 2u);
    EXPECT_EQ(FakeRaster::passes[0].colors[0].mip_count, 1u);
    EXPECT_EQ(FakeRaster::passes[0].depth_stencil.format, Format::undefined);
}

TEST_F(RenderPasses, ClearDepthAndStencilUnlessTheyAreReadOnly) {
    const rhi::Texture depth = ok(device->create_texture(
        {.format = Format::d32_float_s8_uint,
         .width = 4,
         .height = 4,
         .usage = TextureUsage::depth_target | TextureUsage::copy_destination | TextureUsage::copy_source,
         .name = "depth"}));
    const auto stencils = [&] {
        const ImageLevel& level = FakeRaster::passes.back().depth_stencil.stencil_levels[0];
        return std::vector<std::byte>(level.data, level.data + 16);
    };
    rhi::CommandList list = device->create_command_list();
    list.begin_render_pass({.depth_stencil = {.view = depth,
                                              .depth_load = LoadOperation::clear,
                                              .clear_depth = 0.25f,
                                              .stencil_load = LoadOperation::clear,
                                              .clear_stencil = 3}});
    list.end_render_pass();
    run(*device, std::move(list));
    for (const float value : as_values<float>(ok(device->read_texture(depth)))) EXPECT_EQ(value, 0.25f);
    EXPECT_EQ(stencils(), std::vector<std::byte>(16, std::byte{3}));
    rhi::CommandList one = device->create_command_list();
    one.begin_render_pass({.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear, .clear_depth = 0.5f}});
    one.end_render_pass();
    one.begin_render_pass({.depth_stencil = {.view = depth, .read_only = true}});
    one.end_render_pass();
    run(*device, std::move(one));
    for (const float value : as_values<float>(ok(device->read_texture(depth)))) EXPECT_EQ(value, 0.5f);
    EXPECT_EQ(stencils(), std::vector<std::byte>(16, std::byte{3}));
}

TEST_F(RenderPasses, ResolveWhatWasDrawn) {
    const rhi::Texture samples = target(Format::r8_unorm, 4, 4, 4), picture = target(Format::r8_unorm, 4, 4);
    FakeRaster::paint = [](const RenderTargets& targets, const FakeDraw&) {
        const ImageLevel& level = targets.colors[0].levels[0];
        for (std::uint32_t sample = 0; sample < 4; ++sample)
            for (std::uint32_t i = 0; i < 16; ++i)
                level.data[sample * level.sample_stride + i] = static_cast<std::byte>(sample * 40 + i);
    };
    const auto drawn = pipeline(Format::r8_unorm, 4);
    rhi::CommandList list = device->create_command_list();
    list.begin_render_pass({.color = {{.view = samples, .load = LoadOperation::clear, .resolve = picture}}});
    list.set_pipeline(drawn);
    list.set_push_constants(std::uint32_t{1});
    list.set_vertex_buffer(0, make_buffer(*device, 64));
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(*device, std::move(list));
    const auto texels = as_values<std::uint8_t>(ok(device->read_texture(picture)));
    for (std::uint32_t i = 0; i < 16; ++i) EXPECT_EQ(texels[i], 60 + i);
}

TEST_F(RenderPasses, GiveEachDrawItsState) {
    const rhi::Texture picture = target(Format::r8_unorm, 20, 10);
    const auto drawn = pipeline(Format::r8_unorm);
    const rhi::Buffer vertices = make_buffer(*device, 256), indices = make_buffer(*device, 64);
    rhi::CommandList list = device->create_command_list();
    list.begin_render_pass({.color = {{.view = picture}}});
    list.set_pipeline(drawn);
    list.set_push_constants(std::uint32_t{1});
    list.set_vertex_buffer(0, vertices, 32);
    list.set_push_constants(std::uint32_t{11});
    list.draw({.vertex_count = 3, .instance_count = 2, .first_vertex = 5, .first_instance = 7});
    list.set_push_constants(std::uint32_t{22});
    list.set_viewport({1, 2, 3, 4, 0.25f, 0.75f});
    list.set_scissor({15, 8, 2, 1});
    list.set_stencil_reference(200);
    list.set_blend_constants({1, 2, 3, 4});
    list.set_index_buffer(indices, rhi::IndexType::uint16, 8);
    list.draw_indexed({.index_count = 6, .first_index = 2, .vertex_offset = -4, .first_instance = 1});
    list.end_render_pass();
    run(*device, std::move(list));
    ASSERT_EQ(FakeRaster::draws.size(), 2u);
    const FakeDraw &first = FakeRaster::draws[0], &second = FakeRaster::draws[1];
    // The rasterizer looked at the constants only after both were recorded.
    EXPECT_EQ(as_values<std::uint32_t>(first.push_constants)[0], 11u);
    EXPECT_EQ(as_values<std::uint32_t>(second.push_constants)[0], 22u);
    EXPECT_EQ(first.state.viewport.width, 20.0f);
    EXPECT_EQ(first.state.viewport.height, 10.0f);
    EXPECT_EQ(first.state.viewport.max_depth, 1.0f);
    EXPECT_EQ(first.state.scissor.width, 20u);
    EXPECT_EQ(first.state.vertex.base_vertex, 5);
    EXPECT_EQ(first.state.vertex.base_instance, 7u);
    EXPECT_EQ(first.state.vertex.buffers[0].size, 224u);
    EXPECT_EQ(first.state.vertex.buffers[1].data, nullptr);
    EXPECT_EQ(first.call.first, 5u);
    EXPECT_EQ(first.call.count, 3u);
    EXPECT_EQ(first.call.instance_count, 2u);
    EXPECT_FALSE(first.call.indexed);
    EXPECT_EQ(second.state.viewport.x, 1.0f);
    EXPECT_EQ(second.state.viewport.min_depth, 0.25f);
    EXPECT_EQ(second.state.scissor.x, 15u);
    EXPECT_EQ(second.state.scissor.width, 2u);
    EXPECT_EQ(second.state.stencil_reference, 200);
    EXPECT_EQ(second.state.blend_constants[3], 4.0f);
    EXPECT_TRUE(second.call.indexed);
    EXPECT_EQ(second.call.index_type, rhi::IndexType::uint16);
    EXPECT_EQ(second.call.index_bytes, 56u);
    EXPECT_EQ(second.call.first, 2u);
    EXPECT_EQ(second.call.vertex_offset, -4);
    EXPECT_EQ(second.state.vertex.base_vertex, -4);
    EXPECT_EQ(second.state.pipeline->color_targets[0].format, Format::r8_unorm);
}

TEST_F(RenderPasses, ReadIndirectDraws) {
    const rhi::Texture picture = target(Format::r8_unorm, 4, 4);
    const auto drawn = pipeline(Format::r8_unorm);
    const rhi::Buffer vertices = make_buffer(*device, 256), arguments = make_buffer(*device, 96),
                      indices = make_buffer(*device, 64);
    ok(device->write_buffer(arguments, std::span<const std::uint32_t>(std::array<std::uint32_t, 15>{
                                           3, 1, 0, 0, 99, 4, 2, 1, 9, 99, /* indexed: */ 6, 1, 2, 0xfffffffeu, 3})));
    rhi::CommandList list = device->create_command_list();
    list.begin_render_pass({.color = {{.view = picture}}});
    list.set_pipeline(drawn);
    list.set_push_constants(std::uint32_t{1});
    list.set_vertex_buffer(0, vertices);
    list.set_index_buffer(indices, rhi::IndexType::uint32);
    list.draw_indirect(arguments, 0, 2, 20);
    list.draw_indexed_indirect(arguments, 40);
    list.end_render_pass();
    run(*device, std::move(list));
    ASSERT_EQ(FakeRaster::draws.size(), 3u);
    EXPECT_EQ(FakeRaster::draws[0].call.count, 3u);
    EXPECT_EQ(FakeRaster::draws[0].state.vertex.draw_index, 0u);
    EXPECT_EQ(FakeRaster::draws[1].call.count, 4u);
    EXPECT_EQ(FakeRaster::draws[1].call.instance_count, 2u);
    EXPECT_EQ(FakeRaster::draws[1].state.vertex.base_vertex, 1);
    EXPECT_EQ(FakeRaster::draws[1].state.vertex.base_instance, 9u);
    EXPECT_EQ(FakeRaster::draws[1].state.vertex.draw_index, 1u);
    EXPECT_TRUE(FakeRaster::draws[2].call.indexed);
    EXPECT_EQ(FakeRaster::draws[2].call.count, 6u);
    EXPECT_EQ(FakeRaster::draws[2].call.vertex_offset, -2);
}

TEST_F(RenderPasses, WhoseDrawsDoNotEndLoseTheDevice) {
    ::setenv("NACRE_CPU_WATCHDOG_SECONDS", "0.1", 1);
    device = make_device();
    ::unsetenv("NACRE_CPU_WATCHDOG_SECONDS");
    const rhi::Texture samples = target(Format::r8_unorm, 4, 4, 4), picture = target(Format::r8_unorm, 4, 4);
    const auto drawn = pipeline(Format::r8_unorm, 4);
    FakeRaster::paint = [](const RenderTargets&, const FakeDraw& draw) {
        while (std::atomic_ref(draw.state.context.state->expired).load() == 0) std::this_thread::yield();
    };
    rhi::CommandList list = device->create_command_list();
    list.begin_render_pass({.color = {{.view = samples, .resolve = picture}}});
    list.set_pipeline(drawn);
    list.set_push_constants(std::uint32_t{1});
    list.set_vertex_buffer(0, make_buffer(*device, 64));
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    const auto waited = device->wait(ok(device->submit(std::move(list))));
    ASSERT_FALSE(waited);
    EXPECT_EQ(waited.error().code, ErrorCode::device_lost);
    EXPECT_THAT(waited.error().message(), testing::HasSubstr("draw.frag"));
    device.reset();
}

TEST_F(RenderPasses, CountSamplesBetweenBeginAndEnd) {
    const rhi::Texture picture = target(Format::r8_unorm, 4, 4);
    const auto drawn = pipeline(Format::r8_unorm);
    const rhi::QueryPool pool = ok(device->create_query_pool({.type = rhi::QueryType::occlusion, .count = 3}));
    rhi::CommandList list = device->create_command_list();
    list.begin_render_pass({.color = {{.view = picture}}});
    list.set_pipeline(drawn);
    list.set_push_constants(std::uint32_t{1});
    list.set_vertex_buffer(0, make_buffer(*device, 16'000));
    list.draw({.vertex_count = 1000});
    list.begin_occlusion_query(pool, 1);
    list.draw({.vertex_count = 3, .instance_count = 4});
    list.draw({.vertex_count = 5});
    list.end_occlusion_query(pool, 1);
    list.draw({.vertex_count = 100});
    list.begin_occlusion_query(pool, 0);
    list.end_occlusion_query(pool, 0);
    list.end_render_pass();
    list.begin_render_pass({.color = {{.view = picture}}});
    list.set_pipeline(drawn);
    list.set_push_constants(std::uint32_t{1});
    list.set_vertex_buffer(0, make_buffer(*device, 256));
    list.begin_occlusion_query(pool, 2);
    list.draw({.vertex_count = 6});
    list.end_occlusion_query(pool, 2);
    list.end_render_pass();
    run(*device, std::move(list));
    EXPECT_EQ(ok(device->read_queries(pool, 0, 3)), (std::vector<std::uint64_t>{0, 17, 6}));
}

}  // namespace
}  // namespace nacre::cpu
