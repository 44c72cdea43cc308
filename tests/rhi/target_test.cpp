// SPDX-License-Identifier: Apache-2.0
// Render passes: several samples, depth, stencil, viewports, scissors, and what is kept between passes.
#include <functional>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(Targets);

const char* const white = "layout(location = 0) out vec4 color; void main() { color = vec4(1); }";
/// Covers everything at a depth that push constants give.
const char* const depth_vertex = R"(
    layout(push_constant) uniform Place { float depth; };
    void main() {
        gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, depth, 1.0);
    }
)";

std::size_t count_of(const std::vector<std::uint8_t>& texels, std::uint8_t value) {
    std::size_t count = 0;
    for (const std::uint8_t texel : texels) count += texel == value;
    return count;
}

TEST_P(Targets, FourSamplesAreResolvedToTheirAverage) {
    SKIP_WITHOUT(capabilities().max_samples >= 4 && supports(Format::rgba8_unorm, FormatSupport::multisampled));
    const Texture samples = target(Format::rgba8_unorm, 16, 16, "samples", TextureUsage::none, 4);
    const Texture picture = target(Format::rgba8_unorm, 16, 16, "picture");
    GraphicsPipelineDesc desc;
    // An edge from (3, 0) to (13, 16).
    desc.vertex = shader(ShaderStage::vertex, R"(
        void main() {
            const vec2 corners[3] = vec2[](vec2(-37, -64), vec2(53, 80), vec2(-37, 80));
            gl_Position = vec4(corners[gl_VertexIndex] / 8.0 - 1.0, 0.0, 1.0);
        }
    )");
    desc.fragment = shader(ShaderStage::fragment, white);
    desc.color_targets = {{.format = Format::rgba8_unorm}};
    desc.samples = 4;
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    CommandList list = device().create_command_list("samples");
    list.begin_render_pass(
        {.color =
             {{.view = samples, .load = LoadOperation::clear, .store = StoreOperation::discard, .resolve = picture}},
         .name = "samples"});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    const auto texels = read<std::array<std::uint8_t, 4>>(picture);
    int partly = 0;
    for (std::uint32_t y = 0; y < 16; ++y)
        for (std::uint32_t x = 0; x < 16; ++x) {
            const std::uint8_t value = texels[y * 16 + x][0];
            // Distance of the center from the edge, in texels along x; covered is what lies left of it.
            const double edge = 3.0 + (y + 0.5) * 10.0 / 16.0;
            if (x + 0.5 < edge - 1.0) {
                EXPECT_EQ(value, 255) << x << ", " << y;
            } else if (x + 0.5 > edge + 1.0) {
                EXPECT_EQ(value, 0) << x << ", " << y;
            }
            EXPECT_TRUE(value == 0 || value == 255 || value % 64 <= 1 || value % 64 >= 63) << int{value};
            partly += value != 0 && value != 255;
        }
    EXPECT_GE(partly, 10);
}

TEST_P(Targets, SamplesAreReadOneByOne) {
    SKIP_WITHOUT(capabilities().max_samples >= 4 && supports(Format::rgba8_unorm, FormatSupport::multisampled));
    const Texture samples = target(Format::rgba8_unorm, 4, 4, "samples", TextureUsage::sampled, 4);
    CommandList list = device().create_command_list("samples");
    list.begin_render_pass(
        {.color = {{.view = samples, .load = LoadOperation::clear, .clear = {.floating = {0.2f, 0.4f, 0.6f, 1.0f}}}}});
    list.end_render_pass();
    run(std::move(list));
    const auto values = evaluate<float>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { vec4 result[4]; };
        layout(set = 0, binding = 1) uniform sampler2DMS image;
        void main() { for (int i = 0; i < 4; ++i) result[i] = texelFetch(image, ivec2(1, 2), i); }
    )",
                                        16, {{.binding = 1, .texture = samples, .sampler = nearest()}});
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_NEAR(values[i * 4], 0.2f, 1e-3f);
        EXPECT_NEAR(values[i * 4 + 2], 0.6f, 1e-3f);
    }
}

TEST_P(Targets, DepthComparisons) {
    const std::array<std::array<bool, 3>, 8> expected{{
        // Depth below, equal to, above what is there.
        {false, false, false},
        {true, false, false},
        {false, true, false},
        {true, true, false},
        {false, false, true},
        {true, false, true},
        {false, true, true},
        {true, true, true},
    }};
    const Texture picture = target(Format::r8_unorm, 2, 2);
    const Texture depth = target(Format::d32_float, 2, 2);
    for (std::uint32_t operation = 0; operation < 8; ++operation) {
        GraphicsPipelineDesc desc;
        desc.vertex = shader(ShaderStage::vertex, depth_vertex);
        desc.fragment = shader(ShaderStage::fragment, white);
        desc.color_targets = {{.format = Format::r8_unorm}};
        desc.depth_stencil = {.format = Format::d32_float,
                              .depth_test = true,
                              .depth_write = true,
                              .depth_compare = static_cast<CompareOperation>(operation)};
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
        for (std::size_t at = 0; at < 3; ++at) {
            const float drawn = at == 0 ? 0.25f : at == 1 ? 0.5f : 0.75f;
            CommandList list = device().create_command_list("depth");
            list.begin_render_pass(
                {.color = {{.view = picture, .load = LoadOperation::clear}},
                 .depth_stencil = {.view = depth, .depth_load = LoadOperation::clear, .clear_depth = 0.5f}});
            list.set_pipeline(pipeline);
            list.set_push_constants(drawn);
            list.draw({.vertex_count = 3});
            list.end_render_pass();
            run(std::move(list));
            EXPECT_EQ(read<std::uint8_t>(picture)[0], expected[operation][at] ? 255 : 0) << operation << ", " << at;
            EXPECT_EQ(read<float>(depth)[3], expected[operation][at] ? drawn : 0.5f) << operation << ", " << at;
        }
    }
}

TEST_P(Targets, DepthIsKeptBetweenPassesAndReadWhileTested) {
    const Texture picture = target(Format::r8_unorm, 4, 4);
    const Texture depth = target(Format::d32_float, 4, 4, "depth", TextureUsage::sampled);
    GraphicsPipelineDesc desc;
    desc.vertex = shader(ShaderStage::vertex, depth_vertex);
    desc.depth_stencil = {.format = Format::d32_float,
                          .depth_test = true,
                          .depth_write = true,
                          .depth_compare = CompareOperation::always};
    const GraphicsPipeline prepass = ok(device().create_graphics_pipeline(desc));
    desc.fragment = shader(ShaderStage::fragment, R"(
        layout(set = 0, binding = 0) uniform sampler2D image;
        layout(location = 0) out vec4 color;
        void main() { color = vec4(texelFetch(image, ivec2(gl_FragCoord.xy), 0).r * 0.8); }
    )");
    desc.color_targets = {{.format = Format::r8_unorm}};
    desc.depth_stencil.depth_write = false;
    desc.depth_stencil.depth_compare = CompareOperation::equal;
    const GraphicsPipeline shade = ok(device().create_graphics_pipeline(desc));
    const BindGroup bound = group(shade, {{.binding = 0, .texture = depth, .sampler = nearest()}});
    CommandList list = device().create_command_list("prepass");
    list.begin_render_pass({.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear}, .name = "prepass"});
    list.set_pipeline(prepass);
    list.set_scissor({0, 0, 2, 4});
    list.set_push_constants(0.5f);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}},
                            .depth_stencil = {.view = depth, .read_only = true},
                            .name = "shade"});
    list.set_pipeline(shade);
    list.set_bind_group(0, bound);
    list.set_push_constants(0.5f);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    const auto texels = read<std::uint8_t>(picture);
    for (std::uint32_t i = 0; i < 16; ++i) EXPECT_EQ(texels[i], i % 4 < 2 ? 102 : 0) << i;
}

TEST_P(Targets, StencilOperations) {
    SKIP_WITHOUT(supports(Format::d32_float_s8_uint, FormatSupport::depth_target));
    const Texture picture = target(Format::r8_unorm, 2, 2);
    const Texture depth = ok(device().create_texture({.format = Format::d32_float_s8_uint,
                                                      .width = 2,
                                                      .height = 2,
                                                      .usage = TextureUsage::depth_target,
                                                      .name = "stencil"}));
    struct Case {
        StencilOperation operation;
        std::uint8_t before, reference, after;
    };
    for (const Case& one : {Case{StencilOperation::keep, 7, 3, 7},
                            {StencilOperation::zero, 7, 3, 0},
                            {StencilOperation::replace, 7, 3, 3},
                            {StencilOperation::increment_clamp, 255, 3, 255},
                            {StencilOperation::increment_clamp, 7, 3, 8},
                            {StencilOperation::decrement_clamp, 0, 3, 0},
                            {StencilOperation::invert, 0x0f, 3, 0xf0},
                            {StencilOperation::increment_wrap, 255, 3, 0},
                            {StencilOperation::decrement_wrap, 0, 3, 255}}) {
        GraphicsPipelineDesc desc;
        desc.vertex = shader(ShaderStage::vertex, depth_vertex);
        desc.depth_stencil = {.format = Format::d32_float_s8_uint,
                              .stencil_test = true,
                              .front = {.pass = one.operation},
                              .back = {.pass = one.operation}};
        const GraphicsPipeline change = ok(device().create_graphics_pipeline(desc));
        desc.fragment = shader(ShaderStage::fragment, white);
        desc.color_targets = {{.format = Format::r8_unorm}};
        desc.depth_stencil.front = desc.depth_stencil.back = {.compare = CompareOperation::equal};
        const GraphicsPipeline show = ok(device().create_graphics_pipeline(desc));
        CommandList list = device().create_command_list("stencil");
        list.begin_render_pass({.depth_stencil = {.view = depth,
                                                  .depth_load = LoadOperation::clear,
                                                  .stencil_load = LoadOperation::clear,
                                                  .clear_stencil = one.before}});
        list.set_pipeline(change);
        list.set_push_constants(0.5f);
        list.set_stencil_reference(one.reference);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        list.begin_render_pass(
            {.color = {{.view = picture, .load = LoadOperation::clear}}, .depth_stencil = {.view = depth}});
        list.set_pipeline(show);
        list.set_push_constants(0.5f);
        list.set_stencil_reference(one.after);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        EXPECT_EQ(count_of(read<std::uint8_t>(picture), 255), 4u)
            << "operation " << static_cast<int>(one.operation) << " on " << int{one.before};
    }
}

TEST_P(Targets, ViewportsAndScissors) {
    const Texture picture = target(Format::r8_unorm, 16, 16);
    const GraphicsPipeline pipeline = fullscreen(white, Format::r8_unorm);
    CommandList list = device().create_command_list("viewport");
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.set_viewport({.x = 2, .y = 3, .width = 8, .height = 10});
    list.set_scissor({4, 1, 12, 7});
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    const auto texels = read<std::uint8_t>(picture);
    for (std::uint32_t y = 0; y < 16; ++y)
        for (std::uint32_t x = 0; x < 16; ++x)
            EXPECT_EQ(texels[y * 16 + x], x >= 4 && x < 10 && y >= 3 && y < 8 ? 255 : 0) << x << ", " << y;
}

TEST_P(Targets, ViewportDepthRange) {
    const Texture depth = target(Format::d32_float, 2, 2);
    GraphicsPipelineDesc desc;
    desc.vertex = shader(ShaderStage::vertex, depth_vertex);
    desc.depth_stencil = {.format = Format::d32_float,
                          .depth_test = true,
                          .depth_write = true,
                          .depth_compare = CompareOperation::always};
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    CommandList list = device().create_command_list("range");
    list.begin_render_pass({.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear}});
    list.set_pipeline(pipeline);
    list.set_viewport({.width = 2, .height = 2, .min_depth = 0.25f, .max_depth = 0.75f});
    list.set_push_constants(0.5f);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    for (const float value : read<float>(depth)) EXPECT_FLOAT_EQ(value, 0.5f);
}

TEST_P(Targets, ClearLoadAndWholeTargetState) {
    const Texture picture = target(Format::r8_unorm, 4, 4);
    const GraphicsPipeline pipeline = fullscreen(white, Format::r8_unorm);
    CommandList list = device().create_command_list("load");
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear, .clear = {.floating = {0.2f}}}}});
    list.set_scissor({0, 0, 1, 4});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    // The scissor of the pass before does not reach into this one.
    list.begin_render_pass({.color = {{.view = picture}}});
    list.set_pipeline(pipeline);
    list.set_scissor({0, 0, 4, 1});
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    list.begin_render_pass({.color = {{.view = picture}}});
    list.end_render_pass();
    run(std::move(list));
    const auto texels = read<std::uint8_t>(picture);
    for (std::uint32_t i = 0; i < 16; ++i) EXPECT_EQ(texels[i], i % 4 == 0 || i < 4 ? 255 : 51) << i;
}

TEST_P(Targets, ClearsIgnoreScissorsAndMasks) {
    const Texture picture = target(Format::rgba8_unorm, 4, 4);
    GraphicsPipelineDesc desc = fullscreen_desc(white, {{.format = Format::rgba8_unorm, .write_mask = 0x2}});
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    CommandList list = device().create_command_list("masks");
    for (int i = 0; i < 2; ++i) {
        list.begin_render_pass(
            {.color = {
                 {.view = picture, .load = LoadOperation::clear, .clear = {.floating = {0.2f, 0.2f, 0.2f, 0.2f}}}}});
        list.set_pipeline(pipeline);
        list.set_scissor({0, 0, 1, 1});
        list.draw({.vertex_count = 3});
        list.end_render_pass();
    }
    run(std::move(list));
    const auto texels = read<std::uint32_t>(picture);
    EXPECT_EQ(texels[0], 0x3333ff33u);
    for (std::size_t i = 1; i < 16; ++i) EXPECT_EQ(texels[i], 0x33333333u);
}

TEST_P(Targets, EarlyTestsKeepHiddenFragmentsFromWriting) {
    SKIP_WITHOUT(capabilities().storage_in_fragment);
    const Buffer counter = buffer(4, BufferUsage::storage);
    ok(device().write_buffer(counter, std::vector<std::byte>(4)));
    const Texture depth = target(Format::d32_float, 4, 4);
    GraphicsPipelineDesc desc;
    desc.vertex = shader(ShaderStage::vertex, depth_vertex);
    desc.fragment = shader(ShaderStage::fragment, R"(
        layout(early_fragment_tests) in;
        layout(set = 0, binding = 0) buffer Counter { uint count; };
        void main() { atomicAdd(count, 1u); }
    )");
    desc.depth_stencil = {
        .format = Format::d32_float, .depth_test = true, .depth_write = true, .depth_compare = CompareOperation::less};
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    const BindGroup bound = group(pipeline, {{.binding = 0, .buffer = counter}});
    CommandList list = device().create_command_list("early");
    list.begin_render_pass({.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear}});
    list.set_pipeline(pipeline);
    list.set_bind_group(0, bound);
    for (const float at : {0.25f, 0.5f, 0.25f}) {
        list.set_push_constants(at);
        list.draw({.vertex_count = 3});
    }
    list.end_render_pass();
    run(std::move(list));
    EXPECT_EQ(read<std::uint32_t>(counter)[0], 16u);
}

TEST_P(Targets, DepthClampKeepsWhatLiesBehind) {
    SKIP_WITHOUT(capabilities().depth_clamp);
    for (const bool clamp : {false, true}) {
        const Texture depth = target(Format::d32_float, 2, 2);
        GraphicsPipelineDesc desc;
        desc.vertex = shader(ShaderStage::vertex, depth_vertex);
        desc.depth_stencil = {.format = Format::d32_float,
                              .depth_test = true,
                              .depth_write = true,
                              .depth_compare = CompareOperation::always,
                              .depth_clamp = clamp};
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
        CommandList list = device().create_command_list("clamp");
        list.begin_render_pass(
            {.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear, .clear_depth = 0.25f}});
        list.set_pipeline(pipeline);
        list.set_push_constants(1.5f);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        EXPECT_FLOAT_EQ(read<float>(depth)[0], clamp ? 1.0f : 0.25f);
    }
}

TEST_P(Targets, DepthBiasMovesDepth) {
    const auto drawn = [&](float bias, float slope) {
        const Texture depth = target(Format::d32_float, 2, 2);
        GraphicsPipelineDesc desc;
        desc.vertex = shader(ShaderStage::vertex, R"(
            void main() {
                vec2 corner = vec2(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0);
                gl_Position = vec4(corner, 0.5 + 0.1 * corner.x, 1.0);
            }
        )");
        desc.depth_stencil = {.format = Format::d32_float,
                              .depth_test = true,
                              .depth_write = true,
                              .depth_compare = CompareOperation::always,
                              .depth_bias = bias,
                              .depth_bias_slope = slope};
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
        CommandList list = device().create_command_list("bias");
        list.begin_render_pass({.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear}});
        list.set_pipeline(pipeline);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        return read<float>(depth)[0];
    };
    const float plain = drawn(0, 0);
    EXPECT_NEAR(plain, 0.45f, 1e-5f);
    EXPECT_GT(drawn(1000, 0), plain);
    EXPECT_LT(drawn(-1000, 0), plain);
    // The slope is 0.1 over a texel.
    EXPECT_NEAR(drawn(0, 1), plain + 0.1f, 1e-4f);
}

TEST_P(Targets, AlphaCoversSamples) {
    SKIP_WITHOUT(capabilities().max_samples >= 4 && supports(Format::rgba8_unorm, FormatSupport::multisampled));
    const Texture samples = target(Format::rgba8_unorm, 4, 4, "samples", TextureUsage::none, 4);
    const Texture picture = target(Format::rgba8_unorm, 4, 4, "picture");
    for (const float alpha : {0.0f, 1.0f}) {
        GraphicsPipelineDesc desc =
            fullscreen_desc("layout(location = 0) out vec4 color; void main() { color = vec4(1, 1, 1, " +
                                std::to_string(alpha) + "); }",
                            {{.format = Format::rgba8_unorm}});
        desc.samples = 4;
        desc.alpha_to_coverage = true;
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
        CommandList list = device().create_command_list("coverage");
        list.begin_render_pass({.color = {{.view = samples, .load = LoadOperation::clear, .resolve = picture}}});
        list.set_pipeline(pipeline);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        const std::uint8_t red = read<std::array<std::uint8_t, 4>>(picture)[5][0];
        EXPECT_EQ(red, alpha > 0.5f ? 255 : 0);
    }
}

TEST_P(Targets, WireframesLeaveTheInsideOpen) {
    SKIP_WITHOUT(capabilities().wireframe);
    const Texture picture = target(Format::r8_unorm, 16, 16);
    GraphicsPipelineDesc desc;
    desc.vertex = shader(ShaderStage::vertex,
                         "void main() { const vec2 c[3] = vec2[](vec2(-0.9, -0.9), vec2(0.9, -0.9), vec2(-0.9, 0.9)); "
                         "gl_Position = vec4(c[gl_VertexIndex], 0, 1); }");
    desc.fragment = shader(ShaderStage::fragment, white);
    desc.fill = FillMode::line;
    desc.color_targets = {{.format = Format::r8_unorm}};
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    CommandList list = device().create_command_list("lines");
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    const auto texels = read<std::uint8_t>(picture);
    EXPECT_EQ(texels[5 * 16 + 5], 0);
    EXPECT_NEAR(static_cast<double>(count_of(texels, 255)), 43, 8);
}

BACKEND_SUITE(Queries);

TEST_P(Queries, TimestampsRise) {
    SKIP_WITHOUT(capabilities().timestamps);
    const QueryPool pool = ok(device().create_query_pool({.type = QueryType::timestamp, .count = 4, .name = "times"}));
    const Texture picture = target(Format::rgba8_unorm, 256, 256);
    const GraphicsPipeline pipeline = fullscreen(
        "layout(location = 0) in vec2 uv; layout(location = 0) out vec4 color; void main() { float a = uv.x; for (int "
        "i = 0; i < 50; ++i) a = sin(a) + uv.y; color = vec4(a); }",
        Format::rgba8_unorm);
    for (int round = 0; round < 2; ++round) {  // The second round overwrites the first.
        CommandList list = device().create_command_list("times");
        list.write_timestamp(pool, 1);
        list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
        list.set_pipeline(pipeline);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        list.write_timestamp(pool, 2);
        run(std::move(list));
        const auto times = ok(device().read_queries(pool, 1, 2));
        ASSERT_EQ(times.size(), 2u);
        EXPECT_GT(times[1], times[0]);
        EXPECT_LT(times[1] - times[0], 10'000'000'000u);
    }
}

TEST_P(Queries, OcclusionCountsOrTellsWhetherAnythingPassed) {
    const QueryPool pool = ok(device().create_query_pool({.type = QueryType::occlusion, .count = 3, .name = "seen"}));
    const Texture picture = target(Format::r8_unorm, 8, 8);
    const GraphicsPipeline pipeline = fullscreen(white, Format::r8_unorm);
    CommandList list = device().create_command_list("occlusion");
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.begin_occlusion_query(pool, 0);
    list.set_scissor({1, 1, 3, 5});
    list.draw({.vertex_count = 3});
    list.end_occlusion_query(pool, 0);
    list.begin_occlusion_query(pool, 2);
    list.set_scissor({0, 0, 0, 0});
    list.draw({.vertex_count = 3});
    list.end_occlusion_query(pool, 2);
    list.end_render_pass();
    run(std::move(list));
    const auto seen = ok(device().read_queries(pool, 0, 1));
    EXPECT_GT(seen[0], 0u);
    if (capabilities().precise_occlusion) {
        EXPECT_EQ(seen[0], 15u);
    }
    EXPECT_EQ(ok(device().read_queries(pool, 2, 1))[0], 0u);
}

TEST_P(Queries, DebugGroupsReachOverPasses) {
    const Texture picture = target(Format::r8_unorm, 4, 4);
    CommandList list = device().create_command_list("groups");
    list.push_debug_group("frame");
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}, .name = "pass"});
    list.push_debug_group("inside");
    list.pop_debug_group();
    list.end_render_pass();
    list.pop_debug_group();
    run(std::move(list));
}

}  // namespace
}  // namespace nacre::test
