// SPDX-License-Identifier: Apache-2.0
// Drawing on devices in double precision: what goes between the stages, vertices, blending.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/backends/cpu/compiler/double_mode_bench.h"

namespace nacre::cpu {
namespace {

using namespace double_mode;

/// Draws into an rgba32_float target, once for each of `draws`, and gives its texels back as the doubles that they are.
class Picture {
  public:
    static constexpr std::uint32_t size = 16;
    explicit Picture(Bench& bench, Format format = Format::rgba32_float, std::uint32_t samples = 1)
        : bench_(bench), samples_(samples) {
        const TextureUsage usage = TextureUsage::color_target | TextureUsage::sampled;
        target_ = make_texture(bench, format, usage, size);
        depth_ = make_texture(bench, Format::d32_float, TextureUsage::depth_target | TextureUsage::sampled, size);
        if (samples == 1) return;
        many_ = Bench::ok(bench.device().create_texture({.format = format,
                                                         .width = size,
                                                         .height = size,
                                                         .samples = samples,
                                                         .usage = TextureUsage::color_target,
                                                         .name = "many"}));
    }

    void draw(GraphicsPipelineDesc desc, const std::string& vertex, const std::string& fragment, std::uint32_t draws,
              Buffer vertices = {}, std::uint32_t vertex_count = 3) {
        desc.vertex = bench_.shader("test.vert", vertex), desc.fragment = bench_.shader("test.frag", fragment);
        desc.samples = samples_;
        const bool has_depth = desc.depth_stencil.format != Format::undefined;
        desc.name = "test";
        const GraphicsPipeline pipeline = Bench::ok(bench_.device().create_graphics_pipeline(desc));
        CommandList list = bench_.device().create_command_list("draw");
        RenderPassDesc pass{.name = "draw"};
        pass.color = {{.view = samples_ == 1 ? target_ : many_, .load = LoadOperation::clear}};
        if (samples_ > 1) pass.color[0].resolve = target_;
        if (has_depth) pass.depth_stencil = {.view = depth_, .depth_load = LoadOperation::clear, .clear_depth = 1.0f};
        list.begin_render_pass(pass);
        list.set_pipeline(pipeline);
        if (vertices) list.set_vertex_buffer(0, vertices, 0);
        for (std::uint32_t i = 0; i < draws; ++i) list.draw({.vertex_count = vertex_count});
        list.end_render_pass();
        bench_.run(std::move(list));
    }

    /// Four channels of each texel; `depth`: of the depth target.
    std::vector<double> texels(bool depth = false) {
        const Buffer to = bench_.storage(size * size * 4 * 8);
        bench_.dispatch(prelude + result +
                            "layout(set = 0, binding = 1) uniform texture2D image;\n"
                            "void main() { vec4 texel = texelFetch(image, ivec2(at % 16u, at / 16u), 0);\n"
                            "for (int c = 0; c < 4; ++c) result[4 * at + c] = exactly(texel[c]); }\n",
                        {{.binding = 0, .buffer = to}, {.binding = 1, .texture = depth ? depth_ : target_}}, 4);
        return bench_.read<double>(to, size * size * 4);
    }

  private:
    Bench& bench_;
    std::uint32_t samples_;
    Texture target_, depth_, many_;
};

/// Into the targets of Picture, by depth.
GraphicsPipelineDesc keeping_the_nearest() {
    GraphicsPipelineDesc desc;
    desc.color_targets = {{.format = Format::rgba32_float}};
    desc.depth_stencil = {
        .format = Format::d32_float, .depth_test = true, .depth_write = true, .depth_compare = CompareOperation::less};
    return desc;
}

TEST(DoubleMode, ValuesBetweenTheStagesAreInterpolatedInDouble) {
    Bench bench("cpu:double");
    Picture picture(bench);
    const GraphicsPipelineDesc desc = keeping_the_nearest();
    // A triangle that covers all pixels, with a different w at each vertex.
    picture.draw(
        desc,
        "layout(location = 0) out float perspective;\n"
        "layout(location = 1) noperspective out float linear;\n"
        "layout(location = 2) flat out float constant;\n"
        "layout(location = 3) flat out int number;\n"
        "void main() { vec2 corner = vec2(gl_VertexIndex == 1 ? 7.0 : -1.0, gl_VertexIndex == 2 ? 7.0 : -1.0);\n"
        "float w = float(gl_VertexIndex + 1);\n"
        "perspective = 1.0 / float(gl_VertexIndex + 3); linear = perspective; constant = perspective; number = "
        "gl_VertexIndex + 5;\n"
        "gl_Position = vec4(corner * w, w / float(gl_VertexIndex + 3), w); }\n",
        "layout(location = 0) in float perspective;\n"
        "layout(location = 1) noperspective in float linear;\n"
        "layout(location = 2) flat in float constant;\n"
        "layout(location = 3) flat in int number;\n"
        "layout(location = 0) out vec4 color;\n"
        "void main() { color = vec4(perspective, linear, gl_FragCoord.z, constant + float(number)); }\n",
        1);
    const std::vector<double> found = picture.texels(), depths = picture.texels(true);
    for (std::uint32_t y = 0; y < 16; ++y)
        for (std::uint32_t x = 0; x < 16; ++x) {
            const double nx = (x + 0.5) / 8 - 1, ny = (y + 0.5) / 8 - 1;
            const double b1 = (nx + 1) / 8, b2 = (ny + 1) / 8, b0 = 1 - b1 - b2;
            const double values[3] = {1.0 / 3, 1.0 / 4, 1.0 / 5};
            const double linear = b0 * values[0] + b1 * values[1] + b2 * values[2];
            const double numerator = b0 * values[0] + b1 * values[1] / 2 + b2 * values[2] / 3,
                         denominator = b0 + b1 / 2 + b2 / 3;
            const std::size_t at = (y * 16 + x) * 4;
            EXPECT_NEAR(found[at], numerator / denominator, 1e-14) << x << " " << y;
            EXPECT_NEAR(found[at + 1], linear, 1e-14) << x << " " << y;
            EXPECT_NEAR(found[at + 2], linear, 1e-14) << x << " " << y;
            EXPECT_NEAR(found[at + 3], 1.0 / 3 + 5, 1e-15) << x << " " << y;
            EXPECT_NEAR(depths[at], linear, 1e-14) << x << " " << y;
        }
}

TEST(DoubleMode, WhatIsHiddenLeavesWhatWaitsAsItIs) {
    Bench bench("cpu:double");
    Picture picture(bench);
    const GraphicsPipelineDesc desc = keeping_the_nearest();
    // The first is near; the others lie behind it, many more than a tile can keep.
    constexpr std::uint32_t triangles = 1000;
    picture.draw(
        desc,
        "layout(location = 0) out float number;\n"
        "void main() { int triangle = gl_VertexIndex / 3, corner = gl_VertexIndex % 3;\n"
        "number = float(triangle + 1);\n"
        "gl_Position = vec4(corner == 1 ? 0.0 : -0.6, corner == 2 ? 0.0 : -0.6, triangle == 0 ? 0.1 : 0.5, 1.0); }\n",
        "layout(location = 0) in float number;\n"
        "layout(location = 0) out vec4 color;\n"
        "void main() { color = vec4(number); }\n",
        1, {}, 3 * triangles);
    const std::vector<double> found = picture.texels(), depths = picture.texels(true);
    std::uint32_t covered = 0;
    for (std::size_t at = 0; at < found.size(); at += 4) {
        if (depths[at] == 1.0) continue;
        ++covered;
        EXPECT_NEAR(found[at], 1.0, 1e-12) << at / 4;
    }
    EXPECT_GT(covered, 4u);
}

TEST(DoubleMode, ArraysAndStructsBetweenTheStagesKeepDoublesWhateverTheIndex) {
    Bench bench("cpu:double");
    Picture picture(bench);
    GraphicsPipelineDesc desc;
    desc.color_targets = {{.format = Format::rgba32_float}};
    const std::string types = "struct Pair { vec2 v; float a; };\n";
    picture.draw(
        desc,
        types +
            "layout(location = 0) out Pair pairs[3];\n"
            "layout(location = 6) flat out int numbers[3];\n"
            "void main() { for (int i = 0; i < 3; ++i) { float k = float(3 * i + gl_InstanceIndex + 3);\n"
            "pairs[i].v = vec2(1.0 / k, 1.0 / (k + 1.0)); pairs[i].a = 1.0 / (k + 2.0);\n"
            "numbers[i] = i + 7 + gl_InstanceIndex; }\n"
            "gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.0, 1.0); }\n",
        types +
            "layout(location = 0) in Pair pairs[3];\n"
            "layout(location = 6) flat in int numbers[3];\n"
            "layout(location = 0) out vec4 color;\n"
            "void main() { int i = int(gl_FragCoord.x) % 3, j = int(gl_FragCoord.y) % 2;\n"
            "Pair pair = pairs[i]; color = vec4(pair.v[j], pairs[i].a, float(numbers[i]), pairs[2].v.x); }\n",
        1);
    const auto found = picture.texels();
    for (std::size_t y = 0; y < 16; ++y)
        for (std::size_t x = 0; x < 16; ++x) {
            const double k = static_cast<double>(3 * (x % 3) + 3);
            const double* texel = &found[(y * 16 + x) * 4];
            EXPECT_NEAR(texel[0], 1.0 / (k + static_cast<double>(y % 2)), 1e-15) << x << " " << y;
            EXPECT_NEAR(texel[1], 1.0 / (k + 2.0), 1e-15) << x << " " << y;
            EXPECT_EQ(texel[2], static_cast<double>(x % 3 + 7)) << x << " " << y;
            EXPECT_NEAR(texel[3], 1.0 / 9, 1e-15) << x << " " << y;
        }
}

TEST(DoubleMode, VerticesThatShadersWroteKeepTheirDoubles) {
    Bench bench("cpu:double");
    const Buffer vertices = bench.storage(3 * 16);
    bench.dispatch(prelude +
                       "layout(set = 0, binding = 0) buffer Vertices { vec4 vertices[]; };\n"
                       // Constant expressions are computed in single precision, long before any device sees them.
                       "void main() { float zero = float(gl_NumWorkGroups.x - 1u); if (at < 3u) vertices[at] = vec4(at "
                       "== 1u ? 3.0 : -1.0, at == 2u ? 3.0 : -1.0, 1.0 / (3.0 + zero), 1.0 / (7.0 + zero)); }\n",
                   {{.binding = 0, .buffer = vertices}});
    Picture picture(bench);
    GraphicsPipelineDesc desc;
    desc.vertex_attributes = {{.location = 0, .format = Format::rgba32_float}};
    desc.vertex_buffers = {{.stride = 16}};
    desc.color_targets = {{.format = Format::rgba32_float}};
    picture.draw(desc,
                 "layout(location = 0) in vec4 vertex; layout(location = 0) out vec2 value;\n"
                 "void main() { value = vertex.zw; gl_Position = vec4(vertex.xy, 0.0, 1.0); }\n",
                 "layout(location = 0) in vec2 value; layout(location = 0) out vec4 color;\n"
                 "void main() { color = vec4(value, dFdx(gl_FragCoord.x * value.x), 1.0); }\n",
                 1, vertices);
    const auto found = picture.texels();
    EXPECT_NEAR(found[0], 1.0 / 3, 1e-15);
    EXPECT_NEAR(found[1], 1.0 / 7, 1e-15);
    EXPECT_NEAR(found[2], 1.0 / 3, 1e-14);
}

TEST(DoubleMode, BlendingAddsDoublesWhateverTheFormat) {
    for (const Format format : {Format::rgba16_float, Format::rgba8_unorm, Format::rgba32_float})
        for (const std::uint32_t samples : {1u, 4u}) {
            Bench bench("cpu:double");
            Picture picture(bench, format, samples);
            GraphicsPipelineDesc desc;
            desc.color_targets = {{.format = format,
                                   .blend = {.enabled = true,
                                             .source_color = BlendFactor::source_alpha,
                                             .destination_color = BlendFactor::one},
                                   .write_mask = 7}};
            picture.draw(desc,
                         "void main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 "
                         ": -1.0, 0.0, 1.0); }\n",
                         "layout(location = 0) out vec4 color; void main() { color = vec4(1.0 / (3.0 + "
                         "gl_FragCoord.z), gl_FragCoord.x / 300.0, 0.0, 0.1); }\n",
                         7);
            const auto found = picture.texels();
            for (std::size_t x = 0; x < 16; ++x) {
                EXPECT_NEAR(found[4 * x], 7.0 / 3 * static_cast<double>(0.1f), 1e-14)
                    << rhi::info(format).name << " " << samples;
                EXPECT_NEAR(found[4 * x + 1], 7 * (static_cast<double>(x) + 0.5) / 300 * static_cast<double>(0.1f),
                            1e-14);
                EXPECT_EQ(found[4 * x + 3], 0.0);
            }
        }
}

}  // namespace
}  // namespace nacre::cpu
