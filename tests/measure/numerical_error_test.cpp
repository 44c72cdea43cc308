// SPDX-License-Identifier: Apache-2.0
#include "measure/numerical_error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::measure {
namespace {

using testing::HasSubstr;

TextureData floats(std::vector<float> values, std::uint32_t width) {
    TextureData texture{.name = "t",
                        .format = rhi::Format::r32_float,
                        .width = width,
                        .height = static_cast<std::uint32_t>(values.size()) / width};
    texture.bytes.resize(values.size() * 4);
    std::memcpy(texture.bytes.data(), values.data(), texture.bytes.size());
    return texture;
}

TEST(NumericalErrorTest, TellsTheLargestErrorAndItsPixel) {
    NumericalError sum{.texture = "t"};
    ASSERT_TRUE(add_numerical_error(floats({1, 2, 3, 4}, 2), floats({1, 2.5f, 3, 3}, 2), {}, 1, 2, sum));
    EXPECT_EQ(sum.values, 4u);
    EXPECT_FALSE(sum.is_exact);
    EXPECT_EQ(sum.largest.error, 1.0);
    EXPECT_EQ(sum.largest.x, 1u);
    EXPECT_EQ(sum.largest.y, 1u);
    EXPECT_EQ(sum.largest.layer, 1u);
    EXPECT_EQ(sum.largest.mip, 2u);
    EXPECT_EQ(sum.largest.name, "r");
    EXPECT_DOUBLE_EQ(sum.max_rel, 0.25);
    EXPECT_DOUBLE_EQ(sum.rms, std::sqrt((0.25 + 1.0) / 4));
    EXPECT_DOUBLE_EQ(sum.share(), 0.25);
}

TEST(NumericalErrorTest, DoublesOfTheReferenceShowErrorsBelowItsFormat) {
    NumericalError sum{.texture = "t"};
    const std::vector<double> exact{1.0 / 3, 0, 0, 1};
    ASSERT_TRUE(add_numerical_error(floats({1.0f / 3}, 1), floats({1.0f / 3}, 1), exact, 0, 0, sum));
    EXPECT_TRUE(sum.is_exact);
    EXPECT_DOUBLE_EQ(sum.largest.error, static_cast<double>(1.0f / 3) - 1.0 / 3);
}

TEST(NumericalErrorTest, FieldsAreDecodedAndIdentifiersLeftOut) {
    TextureData a{.name = "w", .format = rhi::Format::r32_uint, .width = 1, .height = 1};
    a.fields = {{"id", 0, 0, 8, FieldKind::uint}, {"roughness", 0, 8, 8, FieldKind::unorm}};
    TextureData b = a;
    const std::uint32_t words[2] = {0x00005101, 0x00005202};
    a.bytes.resize(4), b.bytes.resize(4);
    std::memcpy(a.bytes.data(), &words[0], 4), std::memcpy(b.bytes.data(), &words[1], 4);
    NumericalError sum{.texture = "w"};
    ASSERT_TRUE(add_numerical_error(a, b, {}, 0, 0, sum));
    EXPECT_EQ(sum.values, 1u);
    EXPECT_EQ(sum.largest.name, "roughness");
    EXPECT_NEAR(sum.largest.error, 1.0 / 255, 1e-12);
}

/// What the invocation computes that writes texel (x, y) of a 16x16 image with the GLSL of `body`.
rhi::InvocationTrace trace_compute(const char* backend, const std::string& body, std::uint32_t x, std::uint32_t y) {
    const rhi::Instance instance(all_backends());
    auto device = instance.create_device({.backend = backend});
    EXPECT_TRUE(device) << device.error().message();
    rhi::ShaderCompiler compiler({});
    auto words = compiler.compile({.path = "pass/wrong.comp", .text = body});
    EXPECT_TRUE(words) << words.error().message();
    auto shader = (*device)->create_shader(*words);
    auto pipeline = (*device)->create_compute_pipeline({.shader = *shader, .name = "wrong"});
    EXPECT_TRUE(pipeline) << pipeline.error().message();
    auto image = (*device)->create_texture({.format = rhi::Format::r32_float,
                                            .width = 16,
                                            .height = 16,
                                            .usage = rhi::TextureUsage::storage,
                                            .name = "image"});
    auto layout = (*device)->bind_group_layout(*pipeline, 0);
    auto group = (*device)->create_bind_group(
        {.layout = *layout, .entries = {{.binding = 0, .texture = *image}}, .name = "group"});
    EXPECT_TRUE(group) << group.error().message();
    const auto run = [&](const rhi::TraceRequest& request) {
        EXPECT_TRUE((*device)->start_trace(request));
        rhi::CommandList list = (*device)->create_command_list("list");
        list.set_pipeline(*pipeline);
        list.set_bind_group(0, *group);
        list.dispatch({16, 16, 1});
        EXPECT_TRUE((*device)->submit(std::move(list)));
        auto trace = (*device)->finish_trace();
        EXPECT_TRUE(trace) << trace.error().message();
        return *std::move(trace);
    };
    rhi::Trace trace = run({.shader = "pass", .x = x, .y = y});
    if (trace.writers.size() != 1) {
        ADD_FAILURE() << trace.writers.size() << " invocations wrote the texel";
        return {};
    }
    trace = run({.shader = "pass", .x = x, .y = y, .invocation = trace.writers[0]});
    if (trace.invocations.size() != 1) {
        ADD_FAILURE() << trace.invocations.size() << " invocations were traced";
        return {};
    }
    return std::move(trace.invocations[0]);
}

// Invocations write texels in another order than their own coordinates; the difference in line 9 cancels all but a few
// bits.
const char* const cancelling =
    "#version 460\n"                                                                          // 1
    "layout(local_size_x = 1) in;\n"                                                          // 2
    "layout(set = 0, binding = 0, r32f) uniform writeonly image2D image;\n"                   // 3
    "void main() {\n"                                                                         // 4
    "    ivec2 texel = ivec2(15 - int(gl_GlobalInvocationID.x), gl_GlobalInvocationID.y);\n"  // 5
    "    float x = 1.0 + float(texel.x) * 0.001;\n"                                           // 6
    "    float square = x * x;\n"                                                             // 7
    "    float other = square + 1.0 / 1024.0 / 16384.0 / float(texel.y + 3);\n"               // 8
    "    float tiny = other - square;\n"                                                      // 9
    "    float scaled = tiny * 1000.0;\n"                                                     // 10
    "    if (texel.y > 100) scaled += 1.0;\n"                                                 // 11
    "    imageStore(image, texel, vec4(scaled));\n"                                           // 12
    "}\n";

TEST(ErrorOriginTest, IsTheLineWhereDigitsCancel) {
    const auto reference = trace_compute("cpu:double", cancelling, 4, 5), test = trace_compute("cpu", cancelling, 4, 5);
    const auto origin = find_error_origin(reference, test);
    ASSERT_TRUE(origin);
    EXPECT_THAT(origin->line, HasSubstr("wrong.comp:9")) << origin->text;
    EXPECT_EQ(origin->shader, "pass/wrong.comp");
}

TEST(ErrorOriginTest, IsNothingWhereBothComputeTheSame) {
    const auto once = trace_compute("cpu", cancelling, 4, 5);
    EXPECT_FALSE(find_error_origin(once, once));
}

rhi::InvocationTrace made_up(std::vector<std::vector<double>> values) {
    rhi::InvocationTrace trace{"made.comp",
                               {{"Load", "a:1", 1, {9}, true},
                                {"FMul", "a:2", 2, {1, 1}, true},
                                {"FSub", "a:3", 3, {2, 1}, true},
                                {"FMul", "a:4", 4, {3, 3}, true},
                                {"Store", "a:5", 8, {4}, true}},
                               {}};
    for (std::size_t i = 0; i < values.size(); ++i) trace.events.push_back({static_cast<std::uint32_t>(i), values[i]});
    return trace;
}

TEST(ErrorOriginTest, IsWhereTheRelativeErrorGrowsMost) {
    // The product of line 2 is off by 1e-6; the difference of line 3 is small and takes that over, and so on to the
    // store.
    const auto reference = made_up({{1.001}, {1.002001}, {0.001001}, {1.002001e-6}, {1.002001e-6}});
    const auto test = made_up({{1.001}, {1.002002}, {0.001002}, {1.002999e-6}, {1.002999e-6}});
    const auto origin = find_error_origin(reference, test);
    ASSERT_TRUE(origin);
    EXPECT_EQ(origin->line, "a:3");
    EXPECT_EQ(origin->operation, "FSub");
    EXPECT_NEAR(origin->growth, 1e-6 / 0.001002 - 1e-6 / 1.002002, 1e-9);
}

TEST(ErrorOriginTest, EndsAtWhatCameInWrong) {
    const auto reference = made_up({{1.0}, {1.0}, {3.0}, {9.0}, {9.0}});
    const auto test = made_up({{1.5}, {2.25}, {3.1}, {9.6}, {9.6}});
    const auto origin = find_error_origin(reference, test);
    ASSERT_TRUE(origin);
    EXPECT_EQ(origin->line, "a:1");
    EXPECT_THAT(origin->text, HasSubstr("a value that came in"));
}

}  // namespace
}  // namespace nacre::measure
