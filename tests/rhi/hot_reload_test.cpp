// SPDX-License-Identifier: Apache-2.0
// Shaders that change while a program runs: the picture follows the file; a broken file leaves the old picture.
#include "rhi/pipeline_reloader.h"

#include <gmock/gmock.h>

#include "core/file.h"
#include "tests/core/temporary_folder.h"
#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;
using ::testing::HasSubstr;

BACKEND_SUITE(HotReload);

constexpr std::string_view vertex_text = R"(#version 460
void main() {
    vec2 uv = vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2);
    gl_Position = vec4(uv * 2.0 - 1.0, 0.0, 1.0);
}
)";
constexpr std::string_view fragment_text = R"(#version 460
#include "color.glsl"
layout(location = 0) out vec4 result;
void main() { result = color(); }
)";

TEST_P(HotReload, ThePictureFollowsTheFile) {
    TemporaryFolder folder;
    const auto write = [&](const char* path, std::string_view text) {
        ok(write_file_atomically(folder.path() / path, text));
    };
    write("sky.vert", vertex_text);
    write("sky.frag", fragment_text);
    write("color.glsl", "vec4 color() { return vec4(1, 0, 0, 1); }\n");
    ShaderCompiler compiler({.source_folder = folder.path()});
    PipelineReloader pipelines(device(), compiler);
    const auto desc = [](const char* name) {
        return GraphicsPipelineDesc{.color_targets = {{.format = Format::rgba8_unorm}}, .name = name};
    };
    const auto sky = ok(pipelines.add(desc("sky"), {.path = "sky.vert"}, ShaderSource{.path = "sky.frag"}));
    const auto other = ok(pipelines.add(desc("other"), {.path = "sky.vert"}, ShaderSource{.path = "sky.frag"}));

    const Texture picture = target(Format::rgba8_unorm, 4, 4);
    const auto pixel = [&](ReloadableGraphicsPipeline pipeline) {
        CommandList list = device().create_command_list("frame");
        list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
        list.set_pipeline(pipelines.get(pipeline));
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        return read<std::array<std::uint8_t, 4>>(picture)[5];
    };
    using Pixel = std::array<std::uint8_t, 4>;
    EXPECT_EQ(pixel(sky), (Pixel{255, 0, 0, 255}));
    EXPECT_TRUE(pipelines.reload_changed().empty());

    // An include changes: both pipelines follow.
    write("color.glsl", "vec4 color() { return vec4(0, 1, 0, 1); }\n");
    auto reloads = pipelines.reload_changed();
    ASSERT_EQ(reloads.size(), 2u);
    EXPECT_EQ(reloads[0].pipeline, "sky");
    EXPECT_FALSE(reloads[0].error);
    EXPECT_EQ(pixel(sky), (Pixel{0, 255, 0, 255}));
    EXPECT_EQ(pixel(other), (Pixel{0, 255, 0, 255}));
    EXPECT_TRUE(pipelines.reload_changed().empty());

    // It is broken: the log is reported once, and the old picture stays.
    write("color.glsl", "vec4 color() {\n    return vec4(0, 1, 0, oops);\n}\n");
    reloads = pipelines.reload_changed();
    ASSERT_EQ(reloads.size(), 2u);
    ASSERT_TRUE(reloads[0].error);
    EXPECT_THAT(reloads[0].error->message(), HasSubstr("color.glsl:2: "));
    EXPECT_THAT(reloads[0].error->message(), HasSubstr("oops"));
    EXPECT_EQ(pixel(sky), (Pixel{0, 255, 0, 255}));
    EXPECT_TRUE(pipelines.reload_changed().empty());

    // It compiles, but bind groups in use would no longer fit.
    write("color.glsl", "layout(set = 0, binding = 0) uniform C { vec4 c; } c;\nvec4 color() { return c.c; }\n");
    reloads = pipelines.reload_changed();
    ASSERT_EQ(reloads.size(), 2u);
    ASSERT_TRUE(reloads[0].error);
    EXPECT_THAT(reloads[0].error->message(), HasSubstr("set 0"));
    EXPECT_EQ(pixel(sky), (Pixel{0, 255, 0, 255}));

    // It is mended.
    write("color.glsl", "vec4 color() { return vec4(0, 0, 1, 1); }\n");
    reloads = pipelines.reload_changed();
    ASSERT_EQ(reloads.size(), 2u);
    EXPECT_FALSE(reloads[0].error);
    EXPECT_EQ(pixel(sky), (Pixel{0, 0, 255, 255}));
}

TEST_P(HotReload, ComputeFollowsToo) {
    TemporaryFolder folder;
    const auto write = [&](int number) {
        ok(write_file_atomically(folder.path() / "fill.comp",
                                 "layout(local_size_x = 1) in;\n"
                                 "layout(set = 0, binding = 0) buffer Words { uint word; };\n"
                                 "void main() { word = " + std::to_string(number) + "u; }\n"));
    };
    write(7);
    ShaderCompiler compiler({.source_folder = folder.path()});
    PipelineReloader pipelines(device(), compiler);
    const auto fill = ok(pipelines.add(ComputePipelineDesc{.name = "fill"}, {.path = "fill.comp"}));
    const Buffer words = buffer(4, BufferUsage::storage);
    const BindGroup group =
        ok(device().create_bind_group({.layout = ok(device().bind_group_layout(pipelines.get(fill), 0)),
                                       .entries = {{.binding = 0, .buffer = words}}}));
    const auto value = [&] {
        CommandList list = device().create_command_list("fill");
        list.set_pipeline(pipelines.get(fill));
        list.set_bind_group(0, group);
        list.dispatch({});
        run(std::move(list));
        return read<std::uint32_t>(words)[0];
    };
    EXPECT_EQ(value(), 7u);
    write(8);
    EXPECT_EQ(pipelines.reload_changed().size(), 1u);
    EXPECT_EQ(value(), 8u) << "the bind group made for the old pipeline fits the new one";
}

TEST_P(HotReload, WhatTheProgramBindsAndPushesMustGoOnFitting) {
    TemporaryFolder folder;
    const auto write = [&](std::string_view declarations, std::string_view value) {
        ok(write_file_atomically(folder.path() / "fill.comp",
                                 "layout(local_size_x = 1) in;\n"
                                 "layout(set = 0, binding = 0) buffer Words { uint word; };\n" +
                                     std::string(declarations) + "void main() { word = " + std::string(value) +
                                     "; }\n"));
    };
    // Set 0 has an explicit layout, set 1 that of the shader.
    constexpr std::string_view one =
        "layout(set = 1, binding = 0) uniform Number { uint number; };\n"
        "layout(push_constant) uniform Pushed { uint pushed; };\n";
    write(one, "number + pushed");
    ShaderCompiler compiler({.source_folder = folder.path()});
    PipelineReloader pipelines(device(), compiler);
    const BindGroupLayout words_layout = ok(device().create_bind_group_layout(
        {.bindings = {{0, BindingType::storage_buffer, 1, ShaderStage::compute}}, .name = "words"}));
    const auto fill = ok(pipelines.add(ComputePipelineDesc{.bind_group_layouts = {words_layout}, .name = "fill"},
                                       {.path = "fill.comp"}));
    const Buffer words = buffer(4, BufferUsage::storage);
    const Buffer numbers = buffer_of<std::uint32_t>(std::array<std::uint32_t, 4>{40, 50, 0, 0}, BufferUsage::uniform);
    const BindGroup words_group =
        ok(device().create_bind_group({.layout = words_layout, .entries = {{.binding = 0, .buffer = words}}}));
    const BindGroup number_group =
        ok(device().create_bind_group({.layout = ok(device().bind_group_layout(pipelines.get(fill), 1)),
                                       .entries = {{.binding = 0, .buffer = numbers}}}));
    const auto value = [&] {
        CommandList list = device().create_command_list("fill");
        list.set_pipeline(pipelines.get(fill));
        list.set_bind_group(0, words_group);
        list.set_bind_group(1, number_group);
        list.set_push_constants(std::uint32_t{2});
        list.dispatch({});
        run(std::move(list));
        return read<std::uint32_t>(words)[0];
    };
    EXPECT_EQ(value(), 42u);
    const auto expect_refused = [&](const char* reason) {
        const auto reloads = pipelines.reload_changed();
        ASSERT_EQ(reloads.size(), 1u);
        ASSERT_TRUE(reloads[0].error);
        EXPECT_EQ(reloads[0].error->code, ErrorCode::unsupported);
        EXPECT_THAT(reloads[0].error->message(), HasSubstr(reason));
        EXPECT_EQ(value(), 42u) << "the old pipeline goes on working";
    };
    write(
        "layout(set = 1, binding = 1) uniform Number { uint number; };\n"
        "layout(push_constant) uniform Pushed { uint pushed; };\n",
        "number + pushed");
    expect_refused("set 1");
    write(
        "layout(set = 1, binding = 0) uniform Number { uint number; };\n"
        "layout(push_constant) uniform Pushed { uvec4 pushed; };\n",
        "number + pushed.x");
    expect_refused("push constants");
    write(one, "number - pushed");
    EXPECT_EQ(pipelines.reload_changed().size(), 1u);
    EXPECT_EQ(value(), 38u);
}

TEST_P(HotReload, WhatCannotBeMadeAtFirstIsAnError) {
    TemporaryFolder folder;
    ShaderCompiler compiler({.source_folder = folder.path()});
    PipelineReloader pipelines(device(), compiler);
    const auto missing = pipelines.add(ComputePipelineDesc{.name = "fill"}, {.path = "fill.comp"});
    ASSERT_FALSE(missing);
    EXPECT_EQ(missing.error().code, ErrorCode::not_found);
    EXPECT_FALSE(pipelines.get(ReloadableComputePipeline{}));
    EXPECT_FALSE(pipelines.get(ReloadableGraphicsPipeline{}));
}

}  // namespace
}  // namespace nacre::test
