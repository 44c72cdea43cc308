// SPDX-License-Identifier: Apache-2.0
// Control flow that lanes take apart: each test computes what a shader must give in a few lines of C++.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::cpu {
namespace {

class ControlFlow : public testing::TestWithParam<const char*> {
  public:
    /// Runs `body`, which sets `uint r` from `int id`, for 64 invocations. `n` is a buffer with 0, 1, 2, ...
    std::vector<std::uint32_t> evaluate(const std::string& declarations, const std::string& body) {
        const std::string text =
            R"(
            layout(local_size_x = 64) in;
            layout(set = 0, binding = 0) buffer Result { uint result[64]; };
            layout(set = 0, binding = 1) readonly buffer Numbers { int n[64]; };
            )" +
            declarations +
            "\nvoid main() { int id = n[gl_LocalInvocationIndex]; uint r = 7777u; result[id] = 12345u;\n" + body +
            "\nresult[id] = r; }\n";
        rhi::Instance instance(all_backends());
        auto device = instance.create_device({.backend = GetParam()});
        rhi::ShaderCompiler compiler({});
        auto words = compiler.compile({.path = "control_flow.comp", .text = text});
        if (!device || !words) {
            ADD_FAILURE() << (device ? words.error() : device.error()).message();
            return std::vector<std::uint32_t>(64);
        }
        std::vector<std::int32_t> numbers(64);
        for (std::int32_t i = 0; i < 64; ++i) numbers[static_cast<std::size_t>(i)] = i;
        const auto shader = (*device)->create_shader(*words);
        const auto pipeline = (*device)->create_compute_pipeline({.shader = *shader, .name = "control flow"});
        const auto result = (*device)->create_buffer({.size = 256, .usage = rhi::BufferUsage::storage});
        const auto input = (*device)->create_buffer({.size = 256, .usage = rhi::BufferUsage::storage});
        EXPECT_TRUE((*device)->write_buffer(*input, std::span<const std::int32_t>(numbers)));
        const auto layout = (*device)->bind_group_layout(*pipeline, 0);
        const auto group = (*device)->create_bind_group(
            {.layout = *layout,
             .entries = {{.binding = 0, .buffer = *result}, {.binding = 1, .buffer = *input}},
             .name = "control flow"});
        rhi::CommandList list = (*device)->create_command_list("control flow");
        list.set_pipeline(*pipeline);
        list.set_bind_group(0, *group);
        list.dispatch({});
        EXPECT_TRUE((*device)->submit(std::move(list)));
        std::vector<std::uint32_t> values(64);
        const auto bytes = (*device)->read_buffer(*result);
        std::memcpy(values.data(), bytes->data(), 256);
        return values;
    }
    void expect(const std::string& declarations, const std::string& body,
                const std::function<std::uint32_t(int)>& expected) {
        const std::vector<std::uint32_t> values = evaluate(declarations, body);
        for (int id = 0; id < 64; ++id)
            ASSERT_EQ(values[static_cast<std::size_t>(id)], expected(id)) << "invocation " << id;
    }
};

TEST_P(ControlFlow, LanesLeaveALoopInDifferentIterationsWhileOthersReturn) {
    expect("", R"(
        int i = 0;
        for (; i < id % 5; ++i)
            if (id % 7 == 6 && i == 2) return;
        r = uint(i) + 100u;)",
           [](int id) { return id % 7 == 6 && id % 5 > 2 ? 12345u : static_cast<std::uint32_t>(id % 5) + 100u; });
}

TEST_P(ControlFlow, ContinueSkipsAStoreOfAUniformValue) {
    expect("", R"(
        int kept[4] = int[4](0, 0, 0, 0);
        for (int i = 0; i < 4; ++i) {
            if ((id & 1) == 1) continue;
            kept[n[i]] = 10 + i;
        }
        r = uint(kept[n[3]]);)",
           [](int id) { return id % 2 == 1 ? 0u : 13u; });
}

TEST_P(ControlFlow, ContinueBringsAnotherConstantToTheNextIteration) {
    expect("", R"(
        int before = 5, sum = 0;
        for (int i = 0; i < 3; ++i) {
            sum += before;
            if (id % 3 == i) { before = 1; continue; }
            before = 2;
        }
        r = uint(sum * 10 + before);)",
           [](int id) {
               int before = 5, sum = 0;
               for (int i = 0; i < 3; ++i) sum += before, before = id % 3 == i ? 1 : 2;
               return static_cast<std::uint32_t>(sum * 10 + before);
           });
}

TEST_P(ControlFlow, BreakOutOfASwitchSkipsAStoreOfAUniformValue) {
    expect("int kept = 3;", R"(
        switch (n[1]) {
            case 1:
                if ((id & 2) == 2) break;
                kept = 8;
                break;
            default: kept = 9;
        }
        r = uint(kept);)",
           [](int id) { return (id & 2) == 2 ? 3u : 8u; });
}

TEST_P(ControlFlow, AValueOfAnInnerLoopReachesTheNextIterationOfTheOuterOne) {
    expect("", R"(
        int carried = 0, sum = 0;
        for (int j = 0; j < 3; ++j) {
            sum = sum * 10 + carried;
            int i = 0;
            do { carried = i + j; ++i; } while (i < id % 4);
        }
        r = uint(sum * 10 + carried);)",
           [](int id) {
               int carried = 0, sum = 0;
               for (int j = 0; j < 3; ++j) sum = sum * 10 + carried, carried = std::max(id % 4, 1) - 1 + j;
               return static_cast<std::uint32_t>(sum * 10 + carried);
           });
}

TEST_P(ControlFlow, WhatWasLoadedInALoopStaysWithThoseWhoLeaveItFirst) {
    expect("", R"(
        int loaded = 0, count = 0;
        do { loaded = n[(id + count) & 63]; } while (count++ < id % 6);
        r = uint(loaded * 100 + count);)",
           [](int id) { return static_cast<std::uint32_t>((id + id % 6) % 64 * 100 + id % 6 + 1); });
}

TEST_P(ControlFlow, AComponentThatAllLanesShareMayChooseBetweenValues) {
    expect("", R"(
        bvec2 is_zero = equal(gl_GlobalInvocationID.xy, uvec2(0u));
        r = (is_zero.y ? 5u : 1u + uint(id)) + (is_zero.x ? 100u : 200u);
        r += is_zero.y ? 1000u + uint(id) : 3000u;)",
           [](int id) { return static_cast<std::uint32_t>(1005 + id + (id == 0 ? 100 : 200)); });
}

TEST_P(ControlFlow, AnEarlyReturnOfAFunctionSkipsAStoreToAPrivateVariable) {
    expect(R"(int kept = 3;
        int early(int id, int a) {
            for (int i = 0; i < 3; ++i) { if (id % 4 == i) return i; kept = 20 + i; }
            kept = a;
            return 9;
        })",
           "int got = early(id, 50); r = uint(kept * 10 + got);",
           [](int id) {
               const int which = id % 4;
               return static_cast<std::uint32_t>(which == 3 ? 509 : (which == 0 ? 3 : 19 + which) * 10 + which);
           });
}

INSTANTIATE_TEST_SUITE_P(Lanes, ControlFlow,
                         testing::Values("cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16"),
                         [](const auto& parameter) { return "Lanes" + std::string(parameter.param).substr(21); });

}  // namespace
}  // namespace nacre::cpu
