// SPDX-License-Identifier: Apache-2.0
// Devices in double precision ("cpu:double"), against closed forms in double: registers, buffers and workgroup memory
// hold doubles, and what goes through single precision does so and no more.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <spirv-tools/libspirv.hpp>
#include <string>
#include <vector>

#include "tests/backends/cpu/compiler/double_mode_bench.h"

namespace nacre::cpu {
namespace {

using namespace double_mode;

TEST(DoubleMode, SumsThatSinglePrecisionGetsWrongAreRight) {
    // The harmonic series from its large end: single precision loses the small terms.
    const std::string text = prelude + result +
                             "void main() { float sum = 0.0;\n"
                             "for (int i = 1; i <= 1000000; ++i) sum += 1.0 / float(i);\n"
                             "if (at == 0) result[0] = exactly(sum); }\n";
    double expected = 0;
    for (int i = 1; i <= 1000000; ++i) expected += 1.0 / i;
    const auto sum = [&](const char* backend) {
        Bench bench(backend);
        const Buffer to = bench.storage(8);
        bench.dispatch(text, {{.binding = 0, .buffer = to}});
        return bench.read<double>(to, 1)[0];
    };
    EXPECT_DOUBLE_EQ(sum("cpu:double"), expected);
    EXPECT_GT(std::abs(sum("cpu:consistent") - expected), 1e-4) << "the sum is too easy to tell anything";
}

TEST(DoubleMode, FunctionsAreThoseOfDoublePrecision) {
    struct Function {
        const char* glsl;
        double (*expected)(double);
    };
    const Function functions[] = {
        {"sin(x)", [](double x) { return std::sin(x); }},
        {"exp(x)", [](double x) { return std::exp(x); }},
        {"pow(x, 1.0 / 3.0)", [](double x) { return std::pow(x, static_cast<double>(1.0f / 3.0f)); }},
        {"sqrt(x)", [](double x) { return std::sqrt(x); }},
        {"inversesqrt(x)", [](double x) { return 1 / std::sqrt(x); }},
        {"log2(x)", [](double x) { return std::log2(x); }},
        {"atan(x, 3.0)", [](double x) { return std::atan2(x, 3.0); }},
        {"smoothstep(0.0, 100.0, x)",
         [](double x) {
             const double t = x / 100;
             return t * t * (3 - 2 * t);
         }},
        {"length(vec3(x, 1.0, 2.0))", [](double x) { return std::sqrt(x * x + 5); }},
        {"normalize(vec3(x, 1.0, 2.0)).x", [](double x) { return x / std::sqrt(x * x + 5); }},
        {"dot(vec2(x), vec2(0.1, x))", [](double x) { return x * static_cast<double>(0.1f) + x * x; }},
        {"inverse(mat2(x, 1.0, 2.0, x))[0].x", [](double x) { return x / (x * x - 2); }},
        {"mod(x, 0.75)", [](double x) { return x - 0.75 * std::floor(x / 0.75); }},
        {"mix(x, 7.0, 0.3)",
         [](double x) {
             const double a = static_cast<double>(0.3f);
             return x * (1 - a) + 7 * a;
         }},
        {"fract(x)", [](double x) { return x - std::floor(x); }},
        {"float(uint(x * 1000.0)) / 3.0", [](double x) { return std::trunc(x * 1000) / 3; }},
        {"subgroupShuffleXor(x, 0)", [](double x) { return x; }},
    };
    std::string text = "#extension GL_KHR_shader_subgroup_shuffle : require\n" + prelude + result +
                       "void main() { float x = (float(at) + 1.5) / 3.0;\n";
    const std::size_t count = std::size(functions);
    for (std::size_t i = 0; i < count; ++i)
        text += "result[at + " + std::to_string(64 * i) + "u] = exactly(" + functions[i].glsl + ");\n";
    for (const char* backend : {"cpu:double", "cpu:double:lanes=4"}) {
        Bench bench(backend);
        const Buffer to = bench.storage(count * 64 * 8);
        bench.dispatch(text + "}\n", {{.binding = 0, .buffer = to}});
        const auto found = bench.read<double>(to, count * 64);
        for (std::size_t i = 0; i < count; ++i)
            for (int at = 0; at < 64; ++at) {
                const double expected = functions[i].expected((at + 1.5) / 3);
                EXPECT_NEAR(found[64 * i + static_cast<std::size_t>(at)], expected,
                            4e-15 * std::max(1.0, std::abs(expected)))
                    << functions[i].glsl << " at " << at << " on " << backend;
            }
    }
}

TEST(DoubleMode, BuffersKeepDoublesBetweenDispatches) {
    Bench bench("cpu:double");
    const Buffer values = bench.storage(64 * 16), copied = bench.storage(64 * 16), to = bench.storage(64 * 3 * 8);
    const std::string block = "struct Part { vec3 v; int n; };\n";
    bench.dispatch(prelude + block +
                       "layout(set = 0, binding = 0) buffer Values { Part parts[]; };\n"
                       "void main() { parts[at].v = vec3(1.0, 2.0, 3.0) / float(at + 7u); parts[at].n = int(at); }\n",
                   {{.binding = 0, .buffer = values}});
    CommandList list = bench.device().create_command_list("copy");
    list.copy_buffer(values, 0, copied, 0, 64 * 16);
    bench.run(std::move(list));
    bench.dispatch(
        prelude + result + block +
            "layout(set = 0, binding = 1) buffer Values { Part parts[]; };\n"
            "void main() { vec3 v = parts[63u - at].v; int n = parts[63u - at].n;\n"
            "result[3 * n] = exactly(v.x); result[3 * n + 1] = exactly(v.y); result[3 * n + 2] = exactly(v.z); }\n",
        {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = copied}});
    const auto found = bench.read<double>(to, 64 * 3);
    for (int at = 0; at < 64; ++at)
        for (int c = 0; c < 3; ++c)
            EXPECT_DOUBLE_EQ(found[static_cast<std::size_t>(3 * at + c)], (c + 1.0) / (at + 7)) << at << " " << c;
    // The host sees the rounded values.
    const auto floats = bench.read<float>(copied, 64 * 4);
    EXPECT_EQ(floats[0], static_cast<float>(1.0 / 7));
}

TEST(DoubleMode, WhatTheHostWritesHidesOlderDoubles) {
    Bench bench("cpu:double");
    const Buffer values = bench.storage(64 * 4), to = bench.storage(64 * 8);
    const std::string block = "layout(set = 0, binding = 1) buffer Values { float values[]; };\n";
    bench.dispatch(prelude + block + "void main() { values[at] = 1.0 / float(at + 3u); }\n",
                   {{.binding = 1, .buffer = values}});
    std::vector<float> host(64, 0.1f);
    Bench::ok(bench.device().write_buffer(values, std::as_bytes(std::span(host))));
    const std::string show = prelude + result + block + "void main() { result[at] = exactly(values[at]); }\n";
    bench.dispatch(show, {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = values}});
    EXPECT_EQ(bench.read<double>(to, 64)[5], static_cast<double>(0.1f));
    // And what a shader writes as an integer.
    bench.dispatch(prelude +
                       "layout(set = 0, binding = 1) buffer Values { uint values[]; };\n"
                       "void main() { values[at] = floatBitsToUint(0.3); }\n",
                   {{.binding = 1, .buffer = values}});
    bench.dispatch(show, {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = values}});
    EXPECT_EQ(bench.read<double>(to, 64)[5], static_cast<double>(0.3f));
}

TEST(DoubleMode, WorkgroupMemoryAndArraysKeepDoubles) {
    Bench bench("cpu:double");
    const Buffer to = bench.storage(64 * 8);
    bench.dispatch(prelude + result +
                       "shared float parts[64]; shared int places[64];\n"
                       "void main() { parts[at] = 1.0 / float(at + 3u); places[at] = int(at);\n"
                       "float own[8]; int number[8];\n"
                       "barrier();\n"
                       "for (int i = 0; i < 8; ++i) { own[i] = parts[(at + uint(i)) % 64u]; number[i] = places[(at + "
                       "uint(i)) % 64u]; }\n"
                       "int k = int(at % 8u);\n"
                       "result[at] = exactly(own[k] + float(number[k])); }\n",
                   {{.binding = 0, .buffer = to}});
    const auto found = bench.read<double>(to, 64);
    for (std::size_t at = 0; at < 64; ++at) {
        const std::size_t from = (at + at % 8) % 64;
        EXPECT_DOUBLE_EQ(found[at], 1.0 / static_cast<double>(from + 3) + static_cast<double>(from)) << at;
    }
}

TEST(DoubleMode, VariablesThatTakeMoreThanTheStackRun) {
    // 100 arrays, each small enough for the stack: 3 MiB with 16 lanes. Indices that differ keep them from registers.
    const int count = 100, length = 256;
    std::string text = prelude + result + "void main() {\n";
    for (int i = 0; i < count; ++i) {
        const std::string name = "a" + std::to_string(i);
        text += "float " + name + "[" + std::to_string(length) + "];\n";
        text += "for (uint i = 0u; i < " + std::to_string(length) + "u; ++i) " + name + "[(i * 5u + at) % " +
                std::to_string(length) + "u] = float(i) / float(at + " + std::to_string(i + 3) + "u);\n";
    }
    text += "float sum = 0.0;\n";
    for (int i = 0; i < count; ++i)
        text += "sum += a" + std::to_string(i) + "[(at * 7u + " + std::to_string(i) + "u) % " + std::to_string(length) +
                "u];\n";
    text += "result[at] = exactly(sum); }\n";
    Bench bench("cpu:double");
    const Buffer to = bench.storage(64 * 8);
    bench.dispatch(text, {{.binding = 0, .buffer = to}});
    const auto found = bench.read<double>(to, 64);
    for (int at = 0; at < 64; ++at) {
        double sum = 0;
        for (int i = 0; i < count; ++i) {
            int from = 0;  // What was put where it is read.
            while ((from * 5 + at) % length != (at * 7 + i) % length) ++from;
            sum += static_cast<double>(from) / (at + i + 3);
        }
        EXPECT_DOUBLE_EQ(found[static_cast<std::size_t>(at)], sum) << at;
    }
}

TEST(DoubleMode, ValuesThatTakeMoreThanTheStackRunWithFewerLanes) {
    // A copy of an array holds all of it in registers, which are on the stack: 3.4 MiB with 16 lanes.
    const int length = 28000;
    const std::string text = prelude + result + "void main() { float a[" + std::to_string(length) + "], b[" +
                             std::to_string(length) +
                             "];\n"
                             "for (uint i = 0u; i < a.length(); ++i) a[(i + at) % a.length()] = 1.0 / float(i + 3u);\n"
                             "b = a; a[at] = 2.0;\n"
                             "result[at] = exactly(b[2u * at] + a[at]); }\n";
    Bench bench("cpu:double");
    const Buffer to = bench.storage(64 * 8);
    bench.dispatch(text, {{.binding = 0, .buffer = to}});
    const auto found = bench.read<double>(to, 64);
    for (std::size_t at = 0; at < 64; ++at) EXPECT_DOUBLE_EQ(found[at], 1.0 / static_cast<double>(at + 3) + 2.0) << at;
}

TEST(DoubleMode, BitsPackingAndAtomicsGoThroughSinglePrecision) {
    Bench bench("cpu:double");
    const Buffer to = bench.storage(64 * 3 * 8);
    bench.dispatch(prelude + result +
                       "void main() { float third = 1.0 / float(at + 3u);\n"
                       "result[3 * at] = exactly(uintBitsToFloat(floatBitsToUint(third)));\n"
                       "result[3 * at + 1] = exactly(unpackUnorm2x16(packUnorm2x16(vec2(third))).x);\n"
                       "result[3 * at + 2] = exactly(unpackHalf2x16(packHalf2x16(vec2(third, 0.5))).y); }\n",
                   {{.binding = 0, .buffer = to}});
    const auto found = bench.read<double>(to, 64 * 3);
    for (std::size_t at = 0; at < 64; ++at) {
        const float third = static_cast<float>(1.0 / static_cast<double>(at + 3));
        EXPECT_EQ(found[3 * at], static_cast<double>(third));
        EXPECT_NEAR(found[3 * at + 1], third, 0.5 / 65535 + 1e-7);
        EXPECT_EQ(found[3 * at + 2], 0.5);
    }
}

TEST(DoubleMode, WhatGoesThroughSinglePrecisionIsListedWithItsLine) {
    Bench bench("cpu:double");
    EXPECT_EQ(bench.device().capabilities().float_bits, 53u);
    bench.compute(
        "layout(local_size_x = 1) in;\n"
        "layout(set = 0, binding = 0) buffer Result { float f; uint u; } r;\n"
        "void main() {\n"
        "r.f = sin(r.f);\n"
        "r.u = floatBitsToUint(r.f);\n"
        "r.f += unpackHalf2x16(r.u).x; }\n");
    const std::vector<NarrowedOperation> found = bench.device().narrowed_operations();
    ASSERT_EQ(found.size(), 2u);
    EXPECT_EQ(found[0], (NarrowedOperation{"test.comp", "test.comp:6", "bit cast"}));
    EXPECT_EQ(found[1], (NarrowedOperation{"test.comp", "test.comp:7", "unpacking"}));
    Bench single("cpu");
    EXPECT_EQ(single.device().capabilities().float_bits, 24u);
    single.compute("layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer R { float f; uint u; } r;\n"
                   "void main() { r.u = floatBitsToUint(r.f); }\n");
    EXPECT_TRUE(single.device().narrowed_operations().empty());
}

TEST(DoubleMode, VariablePointersGoThroughSinglePrecisionAndAreListed) {
    // id / 3 is stored through a pointer that depends on the lane, and through a plain one.
    const std::string text = R"(
        OpCapability Shader
        OpCapability VariablePointersStorageBuffer
        OpExtension "SPV_KHR_variable_pointers"
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %main "main" %index
        OpExecutionMode %main LocalSize 64 1 1
        OpDecorate %index BuiltIn LocalInvocationIndex
        OpDecorate %numbers DescriptorSet 0
        OpDecorate %numbers Binding 0
        OpDecorate %floats ArrayStride 4
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
        %void = OpTypeVoid
        %bool = OpTypeBool
        %uint = OpTypeInt 32 0
        %float = OpTypeFloat 32
        %floats = OpTypeRuntimeArray %float
        %block = OpTypeStruct %floats
        %block_pointer = OpTypePointer StorageBuffer %block
        %pointer = OpTypePointer StorageBuffer %float
        %input_pointer = OpTypePointer Input %uint
        %index = OpVariable %input_pointer Input
        %numbers = OpVariable %block_pointer StorageBuffer
        %c0 = OpConstant %uint 0
        %c1 = OpConstant %uint 1
        %c64 = OpConstant %uint 64
        %three = OpConstant %float 3
        %main_type = OpTypeFunction %void
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %further = OpIAdd %uint %id %c64
        %a = OpAccessChain %pointer %numbers %c0 %id
        %b = OpAccessChain %pointer %numbers %c0 %further
        %odd = OpBitwiseAnd %uint %id %c1
        %is_odd = OpINotEqual %bool %odd %c0
        %p = OpSelect %pointer %is_odd %b %a
        %n = OpConvertUToF %float %id
        %third = OpFDiv %float %n %three
        OpStore %PLACE %third
        OpReturn
        OpFunctionEnd
    )";
    for (const bool is_variable : {false, true}) {
        std::string with_place = text;
        with_place.replace(text.find("%PLACE"), 6, is_variable ? "%p" : "%a");
        std::vector<std::uint32_t> words;
        ASSERT_TRUE(spvtools::SpirvTools(SPV_ENV_VULKAN_1_1).Assemble(with_place, &words));
        Bench bench("cpu:double");
        const ComputePipeline pipeline = Bench::ok(bench.device().create_compute_pipeline(
            {.shader = Bench::ok(bench.device().create_shader(
                 {.spirv = std::move(words), .stage = ShaderStage::compute, .name = "pointers"})),
             .name = "pointers"}));
        const std::vector<NarrowedOperation> expected = {{"pointers", "", "variable pointer"}};
        EXPECT_EQ(bench.device().narrowed_operations(), is_variable ? expected : std::vector<NarrowedOperation>());
        const Buffer numbers = bench.storage(128 * 4), to = bench.storage(64 * 8);
        CommandList list = bench.device().create_command_list("pointers");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, bench.group(pipeline, {{.binding = 0, .buffer = numbers}}));
        list.dispatch({});
        bench.run(std::move(list));
        bench.dispatch(prelude + result +
                           "layout(set = 0, binding = 1) buffer Numbers { float numbers[]; };\n"
                           "void main() { result[at] = exactly(numbers[at + " +
                           (is_variable ? "64u * (at % 2u)" : "0u") + "]); }\n",
                       {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = numbers}});
        const auto found = bench.read<double>(to, 64);
        for (std::size_t at = 0; at < 64; ++at) {
            const double third = static_cast<double>(at) / 3;
            EXPECT_EQ(found[at], is_variable ? static_cast<double>(static_cast<float>(third)) : third) << at;
        }
    }
}

TEST(DoubleMode, SubgroupsAreAsLargeAsTheDeviceSays) {
    for (const char* backend : {"cpu:double", "cpu:double:lanes=4", "cpu:double:lanes=8"}) {
        Bench bench(backend);
        const Buffer to = bench.storage(64 * 8);
        bench.dispatch("#extension GL_KHR_shader_subgroup_arithmetic : require\n" + prelude + result +
                           "void main() { result[at] = exactly(subgroupAdd(1.0) + float(gl_SubgroupSize)); }\n",
                       {{.binding = 0, .buffer = to}});
        EXPECT_EQ(bench.read<double>(to, 64)[5], 2.0 * bench.device().capabilities().subgroup_size) << backend;
    }
}

}  // namespace
}  // namespace nacre::cpu
