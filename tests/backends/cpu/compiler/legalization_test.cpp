// SPDX-License-Identifier: Apache-2.0
// What legalization leaves of functions.
#include "backends/cpu/compiler/legalization.h"

#include <gtest/gtest.h>

#include <spirv/unified1/spirv.hpp11>

#include "rhi/shader_compiler.h"
#include "rhi/spirv.h"

namespace nacre::cpu {
namespace {

struct Functions {
    int all = 0;   ///< With the entry point.
    int kept = 0;  ///< That the code made has as functions.
    int calls = 0;
};

Functions functions_left(const std::string& body) {
    rhi::ShaderCompiler compiler({.debug_information = false});
    const auto desc = compiler.compile({.path = "functions.comp", .text = body});
    EXPECT_TRUE(desc) << desc.error().message();
    const auto words = legalize(desc->spirv, {}, "functions.comp");
    EXPECT_TRUE(words) << words.error().message();
    Functions result;
    for (const rhi::spirv::Instruction& at : rhi::spirv::instructions(*words)) {
        const auto op = static_cast<spv::Op>(at.opcode());
        if (op == spv::Op::OpFunctionCall) ++result.calls;
        if (op != spv::Op::OpFunction) continue;
        ++result.all;
        if (at.operand(2) & static_cast<std::uint32_t>(spv::FunctionControlMask::DontInline)) ++result.kept;
    }
    return result;
}

constexpr const char* head = R"(
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) buffer Values { float values[]; };
)";
constexpr const char* twice = R"(
void main() { values[0] = f(values[1]) + f(values[2]); }
)";

TEST(Legalization, CallsAreReplaced) {
    const Functions left =
        functions_left(std::string(head) + "float f(float x) { if (x > 1.0) x *= 2.0; return x + 1.0; }" + twice);
    EXPECT_EQ(left.all, 1);
    EXPECT_EQ(left.calls, 0);
}

// SPIRV-Tools cannot; the compiler puts them in the place of their calls itself.
TEST(Legalization, WhatReturnsFromWithinAConstructIsNotKept) {
    for (const char* function : {"float f(float x) { if (x > 1.0) return 2.0; return x + 1.0; }",
                                 "float f(float x) { for (int i = 0; i < 9; ++i) { x *= x; if (x > 3.0) return x; } "
                                 "return -x; }",
                                 "float f(float x) { if (x > 1.0) { x = 3.0; } if (x > 2.0) return x; return 1.0; }"}) {
        const Functions left = functions_left(std::string(head) + function + twice);
        EXPECT_EQ(left.all, 2) << function;
        EXPECT_EQ(left.calls, 2) << function;
        EXPECT_EQ(left.kept, 0) << function;
    }
}

}  // namespace
}  // namespace nacre::cpu
