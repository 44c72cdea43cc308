// SPDX-License-Identifier: Apache-2.0
// What goes from the vertex to the fragment stage: values of 64 bits, and distances to clip planes.
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <spirv-tools/libspirv.hpp>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::cpu {
namespace {

constexpr std::uint32_t side = 4;

/// Draws one triangle over a target of 4x4 pixels; the words of its pixels.
Expected<std::vector<std::uint32_t>> draw(const char* spec, const rhi::ShaderDesc& vertex_words,
                                          const std::string& fragment_text) {
    rhi::Instance instance(all_backends());
    NACRE_TRY(auto device, instance.create_device({.backend = spec}));
    rhi::ShaderCompiler compiler({});
    NACRE_TRY(auto fragment_words, compiler.compile({.path = "interface.frag", .text = fragment_text}));
    NACRE_TRY(const auto vertex, device->create_shader(vertex_words));
    NACRE_TRY(const auto fragment, device->create_shader(fragment_words));
    NACRE_TRY(const auto target,
              device->create_texture({.format = rhi::Format::rgba32_uint,
                                      .width = side,
                                      .height = side,
                                      .usage = rhi::TextureUsage::color_target | rhi::TextureUsage::copy_source,
                                      .name = "target"}));
    NACRE_TRY(const auto pipeline,
              device->create_graphics_pipeline({.vertex = vertex,
                                                .fragment = fragment,
                                                .color_targets = {{.format = rhi::Format::rgba32_uint}},
                                                .name = "interface"}));
    rhi::CommandList list = device->create_command_list("interface");
    list.begin_render_pass({.color = {{.view = target, .load = rhi::LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    NACRE_CHECK(device->submit(std::move(list)));
    NACRE_TRY(const auto bytes, device->read_texture(target));
    std::vector<std::uint32_t> words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), bytes.size());
    return words;
}

Expected<std::vector<std::uint32_t>> draw(const char* spec, const std::string& vertex_text,
                                          const std::string& fragment_text) {
    rhi::ShaderCompiler compiler({});
    NACRE_TRY(const auto vertex_words, compiler.compile({.path = "interface.vert", .text = vertex_text}));
    return draw(spec, vertex_words, fragment_text);
}

const std::string corner =
    "vec4 corner() { return vec4(float(gl_VertexIndex & 1) * 4.0 - 1.0, float(gl_VertexIndex >> 1) * 4.0 - 1.0, 0.0, "
    "1.0); }\n";

class Interface : public testing::TestWithParam<const char*> {};

TEST_P(Interface, HandsOnDoubles) {
    const auto words = draw(GetParam(),
                            corner + R"(
        layout(location = 0) flat out dvec3 three;
        layout(location = 2) flat out double one;
        layout(location = 3) flat out uint plain;
        void main() {
            three = dvec3(1.5LF, -2.25LF, 1234567890123.0LF);
            one = 3.0LF / 7.0LF;
            plain = 77u;
            gl_Position = corner();
        })",
                            R"(
        layout(location = 0) flat in dvec3 three;
        layout(location = 2) flat in double one;
        layout(location = 3) flat in uint plain;
        layout(location = 0) out uvec4 color;
        void main() {
            uvec2 last = unpackDouble2x32(three.z), single = unpackDouble2x32(one);
            color = uvec4(uint(three.x * 2.0LF) + uint(three.y * -4.0LF), last.x ^ last.y, single.x ^ single.y, plain);
        })");
    ASSERT_TRUE(words) << words.error().message();
    const auto folded = [](double value) {
        const auto bits = std::bit_cast<std::uint64_t>(value);
        return static_cast<std::uint32_t>(bits) ^ static_cast<std::uint32_t>(bits >> 32);
    };
    for (std::size_t pixel = 0; pixel < side * side; ++pixel) {
        EXPECT_EQ((*words)[pixel * 4], 3u + 9u);
        EXPECT_EQ((*words)[pixel * 4 + 1], folded(1234567890123.0));
        EXPECT_EQ((*words)[pixel * 4 + 2], folded(3.0 / 7.0));
        EXPECT_EQ((*words)[pixel * 4 + 3], 77u);
    }
}

TEST_P(Interface, ShowsDistancesToTheFragmentStage) {
    const auto words = draw(GetParam(), corner + R"(
        out float gl_ClipDistance[2];
        void main() {
            gl_Position = corner();
            gl_ClipDistance[0] = gl_Position.x + 3.0;
            gl_ClipDistance[1] = gl_Position.y;
        })",
                            R"(
        in float gl_ClipDistance[2];
        layout(location = 0) out uvec4 color;
        void main() { color = uvec4(uint(gl_ClipDistance[0] * 100.0 + 0.5), uint(gl_ClipDistance[1] * 100.0 + 0.5), 1u, 1u); })");
    ASSERT_TRUE(words) << words.error().message();
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
            const std::uint32_t* pixel = words->data() + (y * side + x) * 4;
            // Centers lie at -0.75, -0.25, 0.25, 0.75; what lies behind the plane y = 0 is cut off.
            const std::uint32_t expected_y = y < 2 ? 0 : y == 2 ? 25 : 75;
            EXPECT_EQ(pixel[0], y < 2 ? 0u : 225 + 50 * x) << x << " " << y;
            EXPECT_EQ(pixel[1], expected_y) << x << " " << y;
            EXPECT_EQ(pixel[2], y < 2 ? 0u : 1u) << x << " " << y;
        }
}

TEST_P(Interface, InterpolatesAtPlacesInPixels) {
    const auto words = draw(GetParam(), corner + R"(
        layout(location = 0) out vec2 place;
        void main() {
            gl_Position = corner();
            place = (gl_Position.xy * 0.5 + 0.5) * 4.0;
        })",
                            R"(
        layout(location = 0) in vec2 place;
        layout(location = 0) out uvec4 color;
        uvec2 hundredths(vec2 x) { return uvec2(x * 100.0 + 0.5); }
        void main() {
            uvec2 same = hundredths(interpolateAtOffset(place, vec2(0.25, -0.25)));
            uvec2 own = hundredths(interpolateAtOffset(place, vec2(gl_FragCoord.x > 2.0 ? -0.5 : 0.25, 0.0)));
            uvec2 sample_0 = hundredths(interpolateAtSample(place, 0)), inside = hundredths(interpolateAtCentroid(place));
            color = uvec4(same.x * 1000u + same.y, own.x * 1000u + own.y, sample_0.x * 1000u + sample_0.y, inside.x * 1000u + inside.y);
        })");
    ASSERT_TRUE(words) << words.error().message();
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
            const std::uint32_t* pixel = words->data() + (y * side + x) * 4;
            EXPECT_EQ(pixel[0], (x * 100 + 75) * 1000 + y * 100 + 25) << x << " " << y;
            EXPECT_EQ(pixel[1], (x * 100 + (x < 2 ? 75 : 0)) * 1000 + y * 100 + 50) << x << " " << y;
            EXPECT_EQ(pixel[2], (x * 100 + 50) * 1000 + y * 100 + 50) << x << " " << y;
            EXPECT_EQ(pixel[3], (x * 100 + 50) * 1000 + y * 100 + 50) << x << " " << y;
        }
}

// The number of the instruction Sqrt is that of the output block's id: none of its distances is written for that.
TEST_P(Interface, DemotedInvocationsHelpTheirNeighborsAndWriteNothing) {
    const auto words = draw(GetParam(), corner + "void main() { gl_Position = corner(); }", R"(
        #extension GL_EXT_demote_to_helper_invocation : require
        layout(location = 0) out uvec4 color;
        void main() {
            bool before = helperInvocationEXT();
            if (int(gl_FragCoord.x) == 1) demote;
            float after = helperInvocationEXT() ? 1.0 : 0.0;
            float slope = dFdxFine(gl_FragCoord.x * 3.0), change = dFdxFine(after);
            color = uvec4(before ? 2u : 1u, uint(slope), uint(change + 4.0), 9u);
        })");
    ASSERT_TRUE(words) << words.error().message();
    for (std::uint32_t i = 0; i < side * side; ++i) {
        const std::vector<std::uint32_t> pixel(words->begin() + i * 4, words->begin() + i * 4 + 4);
        const std::uint32_t x = i % side;
        if (x == 1)
            EXPECT_EQ(pixel, (std::vector<std::uint32_t>{0, 0, 0, 0})) << i;
        else
            EXPECT_EQ(pixel, (std::vector<std::uint32_t>{1, 3, x == 0 ? 5u : 4u, 9})) << i;
    }
}

TEST(InterfaceOfForeignModules, NumbersThatLookLikeAnOutputDoNotWriteIt) {
    const char* const text = R"(
        OpCapability Shader
        %1 = OpExtInstImport "GLSL.std.450"
        OpMemoryModel Logical GLSL450
        OpEntryPoint Vertex %2 "main" %31 %3
        OpMemberDecorate %20 0 BuiltIn Position
        OpMemberDecorate %20 1 BuiltIn PointSize
        OpMemberDecorate %20 2 BuiltIn ClipDistance
        OpMemberDecorate %20 3 BuiltIn CullDistance
        OpDecorate %20 Block
        OpDecorate %3 BuiltIn VertexIndex
        %4 = OpTypeVoid
        %5 = OpTypeFunction %4
        %6 = OpTypeInt 32 1
        %7 = OpTypeInt 32 0
        %8 = OpTypeFloat 32
        %9 = OpTypeVector %8 4
        %10 = OpConstant %7 1
        %11 = OpTypeArray %8 %10
        %20 = OpTypeStruct %9 %8 %11 %11
        %21 = OpTypePointer Output %20
        %22 = OpTypePointer Output %9
        %23 = OpTypePointer Input %6
        %31 = OpVariable %21 Output
        %3 = OpVariable %23 Input
        %40 = OpConstant %6 0
        %41 = OpConstant %6 1
        %42 = OpConstant %8 0
        %43 = OpConstant %8 1
        %44 = OpConstant %8 4
        %2 = OpFunction %4 None %5
        %50 = OpLabel
        %51 = OpLoad %6 %3
        %52 = OpBitwiseAnd %6 %51 %41
        %53 = OpShiftRightArithmetic %6 %51 %41
        %54 = OpConvertSToF %8 %52
        %55 = OpConvertSToF %8 %53
        %56 = OpFMul %8 %54 %44
        %57 = OpFMul %8 %55 %44
        %58 = OpFSub %8 %56 %43
        %59 = OpFSub %8 %57 %43
        %60 = OpExtInst %8 %1 Sqrt %54
        %61 = OpFMul %8 %60 %42
        %62 = OpCompositeConstruct %9 %58 %59 %61 %43
        %63 = OpAccessChain %22 %31 %40
        OpStore %63 %62
        OpReturn
        OpFunctionEnd)";
    rhi::ShaderDesc vertex{.stage = rhi::ShaderStage::vertex, .name = "foreign"};
    spvtools::SpirvTools assembler(SPV_ENV_VULKAN_1_1);
    ASSERT_TRUE(assembler.Assemble(text, &vertex.spirv, SPV_TEXT_TO_BINARY_OPTION_PRESERVE_NUMERIC_IDS));
    // Where the distances were taken for written, what is undefined in them would cull the triangle.
    const auto words = draw("cpu:consistent:hostile", vertex,
                            "layout(location = 0) out uvec4 color; void main() { color = uvec4(5u); }");
    ASSERT_TRUE(words) << words.error().message();
    for (const std::uint32_t word : *words) EXPECT_EQ(word, 5u);
}

INSTANTIATE_TEST_SUITE_P(Lanes, Interface,
                         testing::Values("cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16"),
                         [](const auto& parameter) { return "Lanes" + std::string(parameter.param).substr(21); });

}  // namespace
}  // namespace nacre::cpu
