// SPDX-License-Identifier: Apache-2.0
// Modules as others make them: what no shader of this project uses, each with the result that arithmetic by hand gives.
#include <algorithm>
#include <bit>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/backends/cpu/compiler/compute_runner.h"

namespace nacre::cpu {
namespace {

constexpr const char* lane_specs[] = {"cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16",
                                      "cpu:double"};

class ForeignModule : public testing::TestWithParam<const char*> {
  public:
    void expect(const Expected<std::vector<std::uint32_t>>& words,
                const std::function<std::uint32_t(std::uint32_t)>& expected, std::uint32_t count = 64) {
        ASSERT_TRUE(words) << words.error().message();
        for (std::uint32_t i = 0; i < count; ++i) ASSERT_EQ((*words)[i], expected(i)) << "word " << i;
    }
};

const std::string glsl_head = R"(
    layout(local_size_x = 64) in;
    layout(set = 0, binding = 0) buffer Result { uint result[]; };
    layout(set = 0, binding = 1) readonly buffer Numbers { int n[]; };
)";

/// What all assembled modules have: types, the buffers, the invocation's number, in %id.
std::string assembly_head(const std::string& capabilities, const std::string& declarations, bool lists_all) {
    return capabilities + fmt::format(R"(
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %main "main" %index {}
        OpExecutionMode %main LocalSize 64 1 1
        OpDecorate %index BuiltIn LocalInvocationIndex
        OpDecorate %result DescriptorSet 0
        OpDecorate %result Binding 0
        OpDecorate %numbers DescriptorSet 0
        OpDecorate %numbers Binding 1
        OpDecorate %uints ArrayStride 4
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
        OpDecorate %pointer ArrayStride 4
        %void = OpTypeVoid
        %bool = OpTypeBool
        %int = OpTypeInt 32 1
        %uint = OpTypeInt 32 0
        %uints = OpTypeRuntimeArray %uint
        %block = OpTypeStruct %uints
        %block_pointer = OpTypePointer StorageBuffer %block
        %pointer = OpTypePointer StorageBuffer %uint
        %input_pointer = OpTypePointer Input %uint
        %index = OpVariable %input_pointer Input
        %result = OpVariable %block_pointer StorageBuffer
        %numbers = OpVariable %block_pointer StorageBuffer
        %c0 = OpConstant %uint 0
        %c1 = OpConstant %uint 1
        %c2 = OpConstant %uint 2
        %c3 = OpConstant %uint 3
        %c4 = OpConstant %uint 4
        %c64 = OpConstant %uint 64
        %c100 = OpConstant %uint 100
        %c1000 = OpConstant %uint 1000
        %main_type = OpTypeFunction %void
    )", lists_all ? "%result %numbers" : "") + declarations;
}

// ---- Size

TEST_P(ForeignModule, CallsThatDoubleAtEachOfTwelveLevels) {
    std::string text =
        glsl_head + "uint f0(uint x) { uint a = x; for (uint i = 0u; i < x % 3u; ++i) a = a * 3u + i; return a; }\n";
    for (int i = 1; i <= 12; ++i)
        text += fmt::format(
            "uint f{0}(uint x) {{ uint a = f{1}(x + {0}u); if ((a & {0}u) == 0u) a += f{1}(a * 5u); else a ^= f{1}(a); "
            "return a; }}\n",
            i, i - 1);
    text += "void main() { int id = n[gl_LocalInvocationIndex]; result[id] = f12(uint(id)); }";
    const std::function<std::uint32_t(std::uint32_t, std::uint32_t)> f = [&](std::uint32_t level, std::uint32_t x) {
        if (level == 0) {
            std::uint32_t a = x;
            for (std::uint32_t i = 0; i < x % 3; ++i) a = a * 3 + i;
            return a;
        }
        std::uint32_t a = f(level - 1, x + level);
        if ((a & level) == 0) a += f(level - 1, a * 5);
        else a ^= f(level - 1, a);
        return a;
    };
    expect(ComputeRunner{GetParam()}.run_glsl(text), [&](std::uint32_t id) { return f(12, id); });
}

TEST_P(ForeignModule, AFunctionWithSideEffectsCalledFiveHundredTimes) {
    // What it writes: a parameter, a private variable, a buffer; and it returns in the middle of a loop.
    std::string text = glsl_head + R"(
        uint calls = 0u;
        uint f(uint x, inout uint state, int limit, vec2 unused[3]) {
            uint a = x;
            ++calls;
            for (int i = 0; i < limit; ++i) {
                if ((a & 1u) == 0u) { a = a / 2u + state; } else { a = 3u * a + 1u; state ^= a; if (a > 100000u) return a; }
                switch (a % 4u) { case 0u: a += 1u; case 1u: a ^= state; break; case 2u: state += a; break; default: a -= 3u; }
            }
            if (unused[1].x > 2.0) state += 1u;
            return a ^ state;
        }
        void main() {
            int id = n[gl_LocalInvocationIndex];
            uint state = uint(id), a = uint(id);
            vec2 unused[3] = vec2[3](vec2(0), vec2(id), vec2(1));
    )";
    constexpr int count = 500;
    for (int i = 0; i < count; ++i) text += fmt::format("a += f(a + {}u, state, id % {}, unused);\n", i, i % 3 + 2);
    text += "result[id] = a + state + calls; }";
    expect(ComputeRunner{GetParam()}.run_glsl(text), [](std::uint32_t id) {
        std::uint32_t state = id, sum = id, calls = 0;
        const auto f = [&](std::uint32_t a, std::uint32_t limit) {
            ++calls;
            for (std::uint32_t i = 0; i < limit; ++i) {
                if ((a & 1) == 0) {
                    a = a / 2 + state;
                } else {
                    a = 3 * a + 1, state ^= a;
                    if (a > 100000) return a;
                }
                switch (a % 4) {
                    case 0: a += 1; [[fallthrough]];
                    case 1: a ^= state; break;
                    case 2: state += a; break;
                    default: a -= 3;
                }
            }
            if (id > 2) state += 1;
            return a ^ state;
        };
        for (std::uint32_t i = 0; i < count; ++i) sum += f(sum + i, id % (i % 3 + 2));
        return sum + state + calls;
    });
}

TEST_P(ForeignModule, SelectionsNestedAHundredDeep) {
    constexpr std::uint32_t depth = 120;
    std::string text = glsl_head + "void main() { int id = n[gl_LocalInvocationIndex]; uint a = 0u;\n";
    for (std::uint32_t i = 0; i < depth; ++i)
        text += fmt::format("if (((id * {}) & {}) == 0) {{ a += {}u;\n", i * 7 + 3, 1 << (i % 5), i);
    for (std::uint32_t i = depth; i-- > 0;)
        text += fmt::format("a ^= {}u; }} else {{ a = a * 3u + {}u; }}\n", i * 3, i);
    text += "result[id] = a; }";
    expect(ComputeRunner{GetParam()}.run_glsl(text), [](std::uint32_t id) {
        std::uint32_t a = 0;
        const std::function<void(std::uint32_t)> level = [&](std::uint32_t i) {
            if (i == depth) return;
            if (((id * (i * 7 + 3)) & (1u << (i % 5))) == 0) a += i, level(i + 1), a ^= i * 3;
            else a = a * 3 + i;
        };
        level(0);
        return a;
    });
}

TEST_P(ForeignModule, ASwitchOfTwoThousandCasesThatFallThrough) {
    constexpr int cases = 2000;
    std::string text =
        glsl_head + "void main() { int id = n[gl_LocalInvocationIndex]; uint a = 0u; switch (id * 31) {\n";
    for (int i = 0; i < cases; ++i) text += fmt::format("case {}: a += {}u; {}\n", i, i * 5 + 1, i % 3 ? "break;" : "");
    text += "default: a = 7u; } result[id] = a; }";
    expect(ComputeRunner{GetParam()}.run_glsl(text), [](std::uint32_t id) {
        std::uint32_t a = 0;
        for (std::uint32_t i = id * 31;; ++i) {
            if (i >= cases) return 7u;
            a += i * 5 + 1;
            if (i % 3) return a;
        }
    });
}

TEST_P(ForeignModule, AConstantArrayOfTenThousandElements) {
    constexpr std::uint32_t elements = 10000;
    std::string values;
    for (std::uint32_t i = 0; i < elements; ++i) values += fmt::format("{}{}.0", i ? ", " : "", i * 7 % 1000);
    const std::string text = glsl_head + fmt::format("const float t[{0}] = float[{0}]({1});\n", elements, values) +
                             "void main() { int id = n[gl_LocalInvocationIndex]; result[id] = uint(t[id * 97] + "
                             "t[n[3]] + t[5] + t[id * 1000]); }";
    expect(ComputeRunner{GetParam()}.run_glsl(text), [](std::uint32_t id) {
        const auto t = [](std::uint32_t i) { return i < elements ? i * 7 % 1000 : 0; };
        return t(id * 97) + t(3) + t(5) + t(id * 1000);
    });
}

// ---- Pointers

TEST_P(ForeignModule, PointersIntoBuffersDependOnControlFlow) {
    // p = odd ? &numbers[100] : &numbers[id]; it moves on once for each round of a loop; what it points to goes through
    // a function and a private variable. The result goes to one of two places.
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability VariablePointersStorageBuffer
        OpCapability VariablePointers
    )", R"(
        %private_pointer = OpTypePointer Private %pointer
        %kept = OpVariable %private_pointer Private
        %read_type = OpTypeFunction %uint %pointer
        %read = OpFunction %uint None %read_type
        %where = OpFunctionParameter %pointer
        %read_label = OpLabel
        %got = OpLoad %uint %where
        OpReturnValue %got
        OpFunctionEnd
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %odd = OpBitwiseAnd %uint %id %c1
        %is_odd = OpINotEqual %bool %odd %c0
        %far = OpAccessChain %pointer %numbers %c0 %c100
        %near = OpAccessChain %pointer %numbers %c0 %id
        %first = OpSelect %pointer %is_odd %far %near
        %rounds = OpUMod %uint %id %c3
        OpBranch %loop
        %loop = OpLabel
        %p = OpPhi %pointer %first %start %moved %again
        %round = OpPhi %uint %c0 %start %next_round %again
        OpLoopMerge %done %again None
        OpBranch %test
        %test = OpLabel
        %goes_on = OpULessThan %bool %round %rounds
        OpBranchConditional %goes_on %again %done
        %again = OpLabel
        %moved = OpPtrAccessChain %pointer %p %c1
        %next_round = OpIAdd %uint %round %c1
        OpBranch %loop
        %done = OpLabel
        OpStore %kept %p
        %out_near = OpAccessChain %pointer %result %c0 %id
        %beyond = OpIAdd %uint %id %c64
        %out_far = OpAccessChain %pointer %result %c0 %beyond
        OpSelectionMerge %merge None
        OpBranchConditional %is_odd %yes %no
        %yes = OpLabel
        OpBranch %merge
        %no = OpLabel
        OpBranch %merge
        %merge = OpLabel
        %out = OpPhi %pointer %out_far %yes %out_near %no
        %again_p = OpLoad %pointer %kept
        %value = OpFunctionCall %uint %read %again_p
        OpStore %out %value
        OpReturn
        OpFunctionEnd
    )", false);
    expect(ComputeRunner{GetParam(), 128}.run_assembly(text, 0x10300), [](std::uint32_t word) {
        const std::uint32_t id = word % 64;
        if ((word >= 64) != (id % 2 == 1)) return 12345u;
        return (id % 2 ? 100 : id) + id % 3;
    }, 128);
}

TEST_P(ForeignModule, PointersAreComparedAndSubtracted) {
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability VariablePointers
        OpCapability VariablePointersStorageBuffer
    )", R"(
        %true_word = OpConstant %uint 100
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %a = OpAccessChain %pointer %numbers %c0 %id
        %b = OpAccessChain %pointer %numbers %c0 %c4
        %same = OpPtrEqual %bool %a %b
        %other = OpPtrNotEqual %bool %a %b
        %difference = OpPtrDiff %int %a %b
        %bits = OpBitcast %uint %difference
        %is_same = OpSelect %uint %same %true_word %c0
        %is_other = OpSelect %uint %other %c1000 %c0
        %sum = OpIAdd %uint %is_same %is_other
        %all = OpIAdd %uint %sum %bits
        %out = OpAccessChain %pointer %result %c0 %id
        OpStore %out %all
        OpReturn
        OpFunctionEnd
    )", true);
    expect(ComputeRunner{GetParam()}.run_assembly(text, 0x10400),
           [](std::uint32_t id) { return (id == 4 ? 100 : 1000) + id - 4; });
}

TEST_P(ForeignModule, PointersIntoWorkgroupMemoryDependOnALane) {
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability VariablePointers
        OpCapability VariablePointersStorageBuffer
    )", R"(
        %shared_array = OpTypeArray %uint %c64
        %shared_array_pointer = OpTypePointer Workgroup %shared_array
        %shared_pointer = OpTypePointer Workgroup %uint
        %one = OpVariable %shared_array_pointer Workgroup
        %two = OpVariable %shared_array_pointer Workgroup
        %semantics = OpConstant %uint 264
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %in_one = OpAccessChain %shared_pointer %one %id
        %in_two = OpAccessChain %shared_pointer %two %id
        %far = OpIAdd %uint %id %c1000
        OpStore %in_one %id
        OpStore %in_two %far
        OpControlBarrier %c2 %c2 %semantics
        %reversed = OpISub %uint %c64 %id
        %from = OpISub %uint %reversed %c1
        %from_one = OpAccessChain %shared_pointer %one %from
        %from_two = OpAccessChain %shared_pointer %two %from
        %odd = OpBitwiseAnd %uint %id %c1
        %is_odd = OpINotEqual %bool %odd %c0
        %p = OpSelect %shared_pointer %is_odd %from_two %from_one
        %value = OpLoad %uint %p
        %out = OpAccessChain %pointer %result %c0 %id
        OpStore %out %value
        OpReturn
        OpFunctionEnd
    )", false);
    expect(ComputeRunner{GetParam()}.run_assembly(text, 0x10300),
           [](std::uint32_t id) { return 63 - id + (id % 2 ? 1000 : 0); });
}

TEST_P(ForeignModule, APointerInAVariableMovesOnInALoop) {
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability VariablePointers
        OpCapability VariablePointersStorageBuffer
    )", R"(
        %kept_pointer = OpTypePointer Function %pointer
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %kept = OpVariable %kept_pointer Function
        %id = OpLoad %uint %index
        %first = OpAccessChain %pointer %numbers %c0 %id
        OpStore %kept %first
        %rounds = OpUMod %uint %id %c4
        OpBranch %loop
        %loop = OpLabel
        %round = OpPhi %uint %c0 %start %next_round %again
        %sum = OpPhi %uint %c0 %start %next_sum %again
        %p = OpLoad %pointer %kept
        %goes_on = OpULessThan %bool %round %rounds
        OpLoopMerge %done %again None
        OpBranchConditional %goes_on %body %done
        %body = OpLabel
        %value = OpLoad %uint %p
        %next_sum = OpIAdd %uint %sum %value
        OpBranch %again
        %again = OpLabel
        %moved = OpPtrAccessChain %pointer %p %c1
        OpStore %kept %moved
        %next_round = OpIAdd %uint %round %c1
        OpBranch %loop
        %done = OpLabel
        %out = OpAccessChain %pointer %result %c0 %id
        OpStore %out %sum
        OpReturn
        OpFunctionEnd
    )", false);
    expect(ComputeRunner{GetParam()}.run_assembly(text, 0x10300), [](std::uint32_t id) {
        std::uint32_t sum = 0;
        for (std::uint32_t k = 0; k < id % 4; ++k) sum += id + k;
        return sum;
    });
}

TEST_P(ForeignModule, SpecializationConstantsAreTakenApart) {
    const std::string text = assembly_head("OpCapability Shader\n", R"(
        %v3 = OpTypeVector %uint 3
        %v2 = OpTypeVector %uint 2
        %s0 = OpSpecConstant %uint 5
        %s1 = OpSpecConstant %uint 7
        %s2 = OpSpecConstantOp %uint IMul %s0 %s1
        %whole = OpSpecConstantComposite %v3 %s0 %s1 %s2
        %turned = OpSpecConstantOp %v2 VectorShuffle %whole %whole 2 0
        %filled = OpSpecConstantOp %v2 CompositeInsert %s1 %turned 1
        %a = OpSpecConstantOp %uint CompositeExtract %turned 0
        %b = OpSpecConstantOp %uint CompositeExtract %filled 1
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %scaled = OpIMul %uint %id %a
        %sum = OpIAdd %uint %scaled %b
        %out = OpAccessChain %pointer %result %c0 %id
        OpStore %out %sum
        OpReturn
        OpFunctionEnd
    )", false);
    expect(ComputeRunner{GetParam()}.run_assembly(text, 0x10300), [](std::uint32_t id) { return id * 35 + 7; });
}

TEST_P(ForeignModule, LargeVariablesOfEachInvocation) {
    // 400 KB of variables for each subgroup of 16 lanes, in a function that is called and in the entry point.
    const std::string text = glsl_head + R"(
        void main() {
            int id = n[gl_LocalInvocationIndex];
            uint a[3000], b[3000];
            for (int i = 0; i < 3000; ++i) { a[i] = uint(i * id); b[2999 - i] = uint(i ^ id); }
            result[id] = a[(id * 47) % 3000] + b[(id * 31) % 3000];
        }
    )";
    expect(ComputeRunner{GetParam()}.run_glsl(text),
           [](std::uint32_t id) { return id * 47 % 3000 * id + ((2999 - id * 31 % 3000) ^ id); });
}

// ---- Atomics, dot products, switches, structures

TEST_P(ForeignModule, AtomicSumsOfFloatsAndDoubles) {
    const std::string text = R"(
        #extension GL_EXT_shader_atomic_float : require
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) buffer Result { float sum; float last; double total; uint counted[64]; };
        layout(set = 0, binding = 1) readonly buffer Numbers { uint n[]; };
        shared float inside;
        void main() {
            uint id = gl_LocalInvocationIndex;
            if (id == 0u) { sum = 0.0; last = -1.0; total = 0.0LF; inside = 0.0; }
            barrier();
            atomicAdd(sum, float(n[id]));
            float before = atomicAdd(inside, 1.0);
            atomicAdd(total, double(n[id]) * 0.5LF);
            atomicExchange(last, 5.0);
            counted[uint(before)] = 1u;
            barrier();
            if (id == 0u) last += inside;
        }
    )";
    const auto words = ComputeRunner{GetParam(), 128}.run_glsl(text);
    ASSERT_TRUE(words) << words.error().message();
    EXPECT_EQ(std::bit_cast<float>((*words)[0]), 2016.0f);
    EXPECT_EQ(std::bit_cast<float>((*words)[1]), 69.0f);
    EXPECT_EQ(std::bit_cast<double>((*words)[2] | std::uint64_t{(*words)[3]} << 32), 1008.0);
    // What each invocation found was another's count.
    for (std::size_t i = 0; i < 64; ++i) EXPECT_EQ((*words)[4 + i], 1u) << i;
}

TEST_P(ForeignModule, DotProductsOfIntegers) {
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability Int8
        OpCapability DotProduct
        OpCapability DotProductInput4x8BitPacked
        OpCapability DotProductInputAll
        OpExtension "SPV_KHR_integer_dot_product"
    )", R"(
        %v2 = OpTypeVector %int 2
        %most = OpConstant %int 2147483600
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %factor = OpConstantNull %uint
        %packed = OpIMul %uint %id %four_ways
        %signed_sum = OpSDot %int %packed %weights PackedVectorFormat4x8Bit
        %unsigned_sum = OpUDot %uint %packed %weights PackedVectorFormat4x8Bit
        %mixed_sum = OpSUDot %int %weights %packed PackedVectorFormat4x8Bit
        %signed_id = OpBitcast %int %id
        %pair = OpCompositeConstruct %v2 %signed_id %signed_id
        %square = OpSDotAccSat %int %pair %pair %most
        %square_bits = OpBitcast %uint %square
        %signed_bits = OpBitcast %uint %signed_sum
        %mixed_bits = OpBitcast %uint %mixed_sum
        %four = OpIMul %uint %id %c4
        %place_1 = OpIAdd %uint %four %c1
        %place_2 = OpIAdd %uint %four %c2
        %place_3 = OpIAdd %uint %four %c3
        %out_0 = OpAccessChain %pointer %result %c0 %four
        %out_1 = OpAccessChain %pointer %result %c0 %place_1
        %out_2 = OpAccessChain %pointer %result %c0 %place_2
        %out_3 = OpAccessChain %pointer %result %c0 %place_3
        OpStore %out_0 %signed_bits
        OpStore %out_1 %unsigned_sum
        OpStore %out_2 %mixed_bits
        OpStore %out_3 %square_bits
        OpReturn
        OpFunctionEnd
    )", false);
    // Bytes 3 * id mod 256 (id up to 63: up to 189, so some are negative as signed ones) four times; weights 1, -2, 3,
    // -128.
    std::string whole = text;
    const std::string constants = "%four_ways = OpConstant %uint 50529027\n%weights = OpConstant %uint 2147745281\n";
    whole.insert(whole.find("%main_type ="), constants);
    whole.erase(whole.find("        %factor = OpConstantNull %uint\n"),
                std::string("        %factor = OpConstantNull %uint\n").size());
    constexpr std::uint32_t weights = 0x8003fe01;
    static_assert(weights == 2147745281u && 50529027 == 0x03030303);
    const auto byte = [](std::uint32_t word, int i) { return static_cast<std::int32_t>(word >> (8 * i) & 0xff); };
    const auto as_signed = [](std::int32_t x) { return x > 127 ? x - 256 : x; };
    expect(ComputeRunner{GetParam(), 256}.run_assembly(whole, 0x10300), [&](std::uint32_t at) {
        const std::uint32_t id = at / 4, packed = id * 0x03030303u;
        std::int32_t sum = 0;
        if (at % 4 == 3) {
            const std::int64_t exact = 2147483600ll + 2 * std::int64_t{id} * id;
            return static_cast<std::uint32_t>(std::min<std::int64_t>(exact, 0x7fffffff));
        }
        for (int i = 0; i < 4; ++i) {
            const std::int32_t x = byte(packed, i), w = byte(weights, i);
            sum += at % 4 == 0 ? as_signed(x) * as_signed(w) : at % 4 == 1 ? x * w : as_signed(w) * x;
        }
        return static_cast<std::uint32_t>(sum);
    }, 256);
}

TEST_P(ForeignModule, SaturatingDotProductsStopAtTheEnds) {
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability DotProduct
        OpCapability DotProductInput4x8BitPacked
        OpExtension "SPV_KHR_integer_dot_product"
    )", R"(
        %near_end = OpConstant %uint 4294960000
        %least = OpConstant %int -2147480000
        %threes = OpConstant %uint 50529027
        %most = OpConstant %uint 4294967295
        %highest = OpConstant %uint 2155905152
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %packed = OpIMul %uint %id %threes
        %unsigned_sum = OpUDotAccSat %uint %packed %most %near_end PackedVectorFormat4x8Bit
        %mixed_sum = OpSUDotAccSat %int %highest %packed %least PackedVectorFormat4x8Bit
        %mixed_bits = OpBitcast %uint %mixed_sum
        %two = OpIMul %uint %id %c2
        %place = OpIAdd %uint %two %c1
        %out_0 = OpAccessChain %pointer %result %c0 %two
        %out_1 = OpAccessChain %pointer %result %c0 %place
        OpStore %out_0 %unsigned_sum
        OpStore %out_1 %mixed_bits
        OpReturn
        OpFunctionEnd
    )", false);
    // Four bytes of 3 * id; times 255 as unsigned, times -128 as signed ones.
    static_assert(50529027 == 0x03030303 && 2155905152 == 0x80808080);
    expect(ComputeRunner{GetParam(), 128}.run_assembly(text, 0x10300), [](std::uint32_t at) {
        const std::int64_t byte = at / 2 * 3;
        if (at % 2 == 0)
            return static_cast<std::uint32_t>(std::min<std::int64_t>(4294960000 + 4 * 255 * byte, 0xffffffff));
        return static_cast<std::uint32_t>(std::max<std::int64_t>(-2147480000 - 4 * 128 * byte, -2147483648));
    }, 128);
}

TEST_P(ForeignModule, FormsThatGlslDoesNotMake) {
    std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability VariablePointers
        OpCapability VariablePointersStorageBuffer
    )", R"(
        %array = OpTypeArray %uint %c3
        %array_pointer = OpTypePointer Function %array
        %local_pointer = OpTypePointer Function %uint
        %none = OpConstantNull %array
        %semantics = OpConstant %uint 72
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %first = OpVariable %array_pointer Function %none
        %second = OpVariable %array_pointer Function
        %id = OpLoad %uint %index
        %in = OpAccessChain %pointer %numbers %c0 %id
        %out = OpAccessChain %pointer %result %c0 %id
        %slot = OpAccessChain %local_pointer %first %c2
        OpCopyMemory %slot %in
        OpCopyMemory %second %first
        %other = OpAccessChain %local_pointer %second %c2
        OpCopyMemory %out %other
        %next = OpPtrAccessChain %pointer %in %c3
        %more = OpLoad %uint %next
        OpMemoryBarrier %c1 %semantics
        %old = OpLoad %uint %out
        %sum = OpIAdd %uint %old %more
        OpAtomicStore %out %c1 %c0 %sum
        OpReturn
        OpFunctionEnd
    )", false);
    const auto replace = [&](const std::string& what, const std::string& with) {
        ASSERT_NE(text.find(what), std::string::npos);
        text.replace(text.find(what), what.size(), with);
    };
    // One decoration for both.
    replace("OpDecorate %result DescriptorSet 0", "OpDecorate %in_set DescriptorSet 0\n%in_set = OpDecorationGroup");
    replace("OpDecorate %numbers DescriptorSet 0", "OpGroupDecorate %in_set %result %numbers");
    expect(ComputeRunner{GetParam()}.run_assembly(text, 0x10300), [](std::uint32_t id) { return id + id + 3; });
}

TEST_P(ForeignModule, SwitchesOnEightSixteenAndSixtyFourBits) {
    const auto module_for = [](int bits, const std::string& capability, const std::string& big) {
        return assembly_head("OpCapability Shader\nOpCapability " + capability + "\n", fmt::format(R"(
        %wide = OpTypeInt {0} 1
        %big = OpConstant %wide {1}
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %signed_id = OpBitcast %int %id
        %{2} = OpSConvert %wide %signed_id
        %three = OpIMul %wide %{2} %big
        OpSelectionMerge %merge None
        OpSwitch %three %otherwise 0 %zero {1} %once -1 %never
        %zero = OpLabel
        OpBranch %once
        %once = OpLabel
        %value = OpPhi %uint %c100 %zero %c3 %start
        OpBranch %merge
        %never = OpLabel
        OpBranch %merge
        %otherwise = OpLabel
        OpBranch %merge
        %merge = OpLabel
        %all = OpPhi %uint %value %once %c64 %never %c1000 %otherwise
        %out = OpAccessChain %pointer %result %c0 %id
        OpStore %out %all
        OpReturn
        OpFunctionEnd
        )", bits, big, "narrow"), false);
    };
    const auto expected = [](std::uint32_t id) { return id == 0 ? 100u : id == 1 ? 3u : 1000u; };
    expect(ComputeRunner{GetParam()}.run_assembly(module_for(64, "Int64", "68719476736"), 0x10300), expected);
    expect(ComputeRunner{GetParam()}.run_assembly(module_for(16, "Int16", "101"), 0x10300), expected);
    expect(ComputeRunner{GetParam()}.run_assembly(module_for(8, "Int8", "97"), 0x10300), expected);
}

TEST_P(ForeignModule, InstructionSetsWithoutMeaningAreIgnoredAndStructuresCopied) {
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpExtension "SPV_KHR_non_semantic_info"
        %notes = OpExtInstImport "NonSemantic.Notes.1"
    )", R"(
        %pair = OpTypeStruct %uint %uint
        %other_pair = OpTypeStruct %uint %uint
        %undefined = OpUndef %uint
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %note = OpExtInst %void %notes 7 %c3
        %id = OpLoad %uint %index
        %twice = OpIMul %uint %id %c2
        %one = OpCompositeConstruct %pair %id %twice
        %two = OpCompositeConstruct %pair %twice %c100
        %is_small = OpULessThan %bool %id %c4
        %chosen = OpSelect %pair %is_small %one %two
        %copied = OpCopyLogical %other_pair %chosen
        %a = OpCompositeExtract %uint %copied 0
        %b = OpCompositeExtract %uint %copied 1
        %masked = OpBitwiseAnd %uint %undefined %c0
        %sum = OpIAdd %uint %a %b
        %all = OpIAdd %uint %sum %masked
        %length = OpArrayLength %uint %numbers 0
        %whole = OpIAdd %uint %all %length
        %out = OpAccessChain %pointer %result %c0 %id
        OpStore %out %whole
        OpReturn
        OpFunctionEnd
    )", true);
    expect(ComputeRunner{GetParam()}.run_assembly(text, 0x10400),
           [](std::uint32_t id) { return (id < 4 ? 3 * id : 2 * id + 100) + 256; });
}

INSTANTIATE_TEST_SUITE_P(Lanes, ForeignModule, testing::ValuesIn(lane_specs),
                         [](const auto& parameter) { return name_of_lanes(parameter.param); });

// ---- Subgroups

TEST(Subgroups, HaveSixteenLanesWhereArithmeticIsConsistent) {
    const std::string text = R"(
        #extension GL_KHR_shader_subgroup_arithmetic : require
        #extension GL_KHR_shader_subgroup_ballot : require
        #extension GL_KHR_shader_subgroup_shuffle : require
        #extension GL_KHR_shader_subgroup_clustered : require
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) buffer Result { uint result[]; };
        layout(set = 0, binding = 1) readonly buffer Numbers { uint n[]; };
        void main() {
            uint id = n[gl_LocalInvocationIndex];
            uint at = id * 9u;
            result[at] = subgroupAdd(id);
            result[at + 1u] = subgroupInclusiveMul(id % 3u + 1u);
            result[at + 2u] = subgroupShuffleXor(id, 9u);
            result[at + 3u] = subgroupBallot(id % 3u == 0u).x;
            result[at + 4u] = subgroupClusteredMax(id * 37u % 64u, 8u);
            result[at + 5u] = gl_SubgroupSize;
            result[at + 6u] = gl_SubgroupInvocationID + 100u * gl_SubgroupID + 1000u * gl_NumSubgroups;
            if (id % 5u < 2u) result[at + 7u] = subgroupAdd(1u); else result[at + 7u] = subgroupMin(id);
            result[at + 8u] = subgroupExclusiveAdd(id + 1u);
        }
    )";
    for (const char* spec : lane_specs) {
        const auto words = ComputeRunner{spec, 576}.run_glsl(text);
        ASSERT_TRUE(words) << words.error().message();
        for (std::uint32_t id = 0; id < 64; ++id) {
            const std::uint32_t first = id / 16 * 16;
            const auto over = [&](const std::function<void(std::uint32_t)>& visit) {
                for (std::uint32_t i = first; i < first + 16; ++i) visit(i);
            };
            std::uint32_t sum = 0, product = 1, ballot = 0, most = 0, few = 0, least = ~0u, before = 0;
            over([&](std::uint32_t i) {
                sum += i;
                if (i <= id) product *= i % 3 + 1;
                if (i % 3 == 0) ballot |= 1u << (i - first);
                if (i < id) before += i + 1;
                if (i / 8 == id / 8) most = std::max(most, i * 37 % 64);
                if (i % 5 < 2) ++few;
                else least = std::min(least, i);
            });
            const std::uint32_t expected[] = {
                sum,   product, id ^ 9, ballot, most, 16, id % 16 + 100 * (id / 16) + 4000, id % 5 < 2 ? few : least,
                before};
            for (std::size_t i = 0; i < 9; ++i)
                ASSERT_EQ((*words)[id * 9 + i], expected[i]) << spec << " invocation " << id << " value " << i;
        }
    }
}

TEST(Subgroups, RotateWithAndWithoutClusters) {
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability GroupNonUniform
        OpCapability GroupNonUniformRotateKHR
        OpExtension "SPV_KHR_subgroup_rotate"
    )", R"(
        %main = OpFunction %void None %main_type
        %start = OpLabel
        %id = OpLoad %uint %index
        %whole = OpGroupNonUniformRotateKHR %uint %c3 %id %c3
        %part = OpGroupNonUniformRotateKHR %uint %c3 %id %c1 %c4
        %far = OpIMul %uint %part %c1000
        %all = OpIAdd %uint %whole %far
        %out = OpAccessChain %pointer %result %c0 %id
        OpStore %out %all
        OpReturn
        OpFunctionEnd
    )", false);
    for (const char* spec : lane_specs) {
        const auto words = ComputeRunner{spec}.run_assembly(text, 0x10300);
        ASSERT_TRUE(words) << words.error().message();
        for (std::uint32_t id = 0; id < 64; ++id)
            ASSERT_EQ((*words)[id], id / 16 * 16 + (id + 3) % 16 + 1000 * (id / 4 * 4 + (id + 1) % 4))
                << spec << " invocation " << id;
    }
}

TEST(Subgroups, BarriersOfASubgroupDoNotHoldTheWorkgroup) {
    const std::string text = R"(
        #extension GL_KHR_shader_subgroup_basic : require
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) buffer Result { uint result[]; };
        shared uint seen[64];
        void main() {
            uint id = gl_LocalInvocationIndex;
            // Only some subgroups come here, each as often as its number.
            for (uint i = 0u; i < gl_SubgroupID; ++i) subgroupBarrier();
            seen[id] = id;
            barrier();
            result[id] = seen[63u - id];
        }
    )";
    for (const char* spec : lane_specs) {
        const auto words = ComputeRunner{spec}.run_glsl(text);
        ASSERT_TRUE(words) << words.error().message();
        for (std::uint32_t id = 0; id < 64; ++id) ASSERT_EQ((*words)[id], 63 - id) << spec;
    }
}

// ---- Refused by devices that cannot do it

TEST(ForeignModuleRefusal, NamesTheCapabilityOnDevicesWithoutIt) {
    const std::string text = assembly_head(R"(
        OpCapability Shader
        OpCapability VariablePointersStorageBuffer
    )", R"(
        %main = OpFunction %void None %main_type
        %start = OpLabel
        OpReturn
        OpFunctionEnd
    )", false);
    std::string absent;
    for (const char* spec : {"vulkan", "gl"}) {
        const auto words = ComputeRunner{spec}.run_assembly(text, 0x10300);
        ASSERT_FALSE(words) << spec;
        if (words.error().code == ErrorCode::not_found) {
            absent += words.error().message() + "\n";
            continue;
        }
        EXPECT_EQ(words.error().code, ErrorCode::unsupported) << words.error().message();
        EXPECT_NE(words.error().message().find("VariablePointersStorageBuffer"), std::string::npos)
            << words.error().message();
    }
    if (!absent.empty()) GTEST_SKIP() << absent;
}

}  // namespace
}  // namespace nacre::cpu
