// SPDX-License-Identifier: Apache-2.0
// Atomic instructions of 32 and 64 bits, in buffers and in a workgroup's memory: what they return and what they leave,
// at the least and largest values and where all invocations meet in one place.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "tests/backends/cpu/compiler/compute_runner.h"

namespace nacre::cpu {
namespace {

constexpr std::uint32_t invocations = 64;

template <typename T>
struct Atomic {
    const char* text;  ///< Behind the name of the result.
    T (*left)(T memory, T value);
};

template <typename T>
std::vector<Atomic<T>> atomics() {
    using S = std::make_signed_t<T>;
    using U = std::make_unsigned_t<T>;
    return {
        {"OpAtomicIAdd %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(U(x) + U(y)); }},
        {"OpAtomicISub %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(U(x) - U(y)); }},
        {"OpAtomicSMin %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(std::min(S(x), S(y))); }},
        {"OpAtomicUMin %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(std::min(U(x), U(y))); }},
        {"OpAtomicSMax %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(std::max(S(x), S(y))); }},
        {"OpAtomicUMax %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(std::max(U(x), U(y))); }},
        {"OpAtomicAnd %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(x & y); }},
        {"OpAtomicOr %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(x | y); }},
        {"OpAtomicXor %t %place %scope %none %y", [](T x, T y) { return static_cast<T>(x ^ y); }},
        {"OpAtomicExchange %t %place %scope %none %y", [](T, T y) { return y; }},
        // Compared with y: one more where it is equal.
        {"OpAtomicCompareExchange %t %place %scope %none %none %y_plus_1 %y",
         [](T x, T y) { return x == y ? static_cast<T>(U(y) + 1) : x; }},
        {"OpAtomicIIncrement %t %place %scope %none", [](T x, T) { return static_cast<T>(U(x) + 1); }},
        {"OpAtomicIDecrement %t %place %scope %none", [](T x, T) { return static_cast<T>(U(x) - 1); }},
        {"OpAtomicLoad %t %place %scope %none", [](T x, T) { return x; }},
    };
}

/// Invocation i has x and y of the edges i / 8 and i % 8.
template <typename T>
void check(bool in_workgroup) {
    using U = std::make_unsigned_t<T>;
    constexpr int bits = sizeof(T) * 8;
    const U least = U{1} << (bits - 1);
    const std::vector<U> edges{0, 1, 5, U(-1), U(-3), least, U(least - 1), U(least + 5)};
    const auto list = atomics<T>();
    std::string text = fmt::format(R"(
        OpCapability Shader
        {}
        OpMemoryModel Logical GLSL450
        OpEntryPoint GLCompute %main "main" %index
        OpExecutionMode %main LocalSize {} 1 1
        OpDecorate %index BuiltIn LocalInvocationIndex
        OpDecorate %values ArrayStride {}
        OpMemberDecorate %block 0 Offset 0
        OpDecorate %block Block
        OpDecorate %result DescriptorSet 0
        OpDecorate %result Binding 0
        %void = OpTypeVoid
        %procedure = OpTypeFunction %void
        %t = OpTypeInt {} {}
        )",
                                   bits == 64 ? "OpCapability Int64\nOpCapability Int64Atomics" : "", invocations,
                                   sizeof(T), bits, std::is_signed_v<T> ? 1 : 0);
    const std::string word = std::is_same_v<T, std::uint32_t> ? "%t" : "%u32";
    if (word != "%t") text += "%u32 = OpTypeInt 32 0\n";
    text += fmt::format(R"(
        %none = OpConstant {0} 0
        %eight = OpConstant {0} 8
        %many = OpConstant {0} {1}
        %one = OpConstant %t 1
        %values = OpTypeRuntimeArray %t
        %block = OpTypeStruct %values
        %block_pointer = OpTypePointer StorageBuffer %block
        %value_pointer = OpTypePointer StorageBuffer %t
        %index_pointer = OpTypePointer Input {0}
        %edge_array = OpTypeArray %t %eight
        %edges_pointer = OpTypePointer Private %edge_array
        %edge_pointer = OpTypePointer Private %t
        %shared_array = OpTypeArray %t %many
        %shared_pointer = OpTypePointer Workgroup %shared_array
        %shared_value_pointer = OpTypePointer Workgroup %t
        %result = OpVariable %block_pointer StorageBuffer
        %index = OpVariable %index_pointer Input
        %shared = OpVariable %shared_pointer Workgroup
        %device = OpConstant {0} 1
        %workgroup = OpConstant {0} 2
        )",
                        word, invocations);
    std::string members;
    for (std::size_t i = 0; i < edges.size(); ++i) {
        text += fmt::format("%edge{} = OpConstant %t {}\n", i, static_cast<T>(edges[i]));
        members += fmt::format(" %edge{}", i);
    }
    for (std::size_t i = 0; i < list.size() * 2; ++i)
        text += fmt::format("%at{} = OpConstant {} {}\n", i, word, i * invocations);
    text += fmt::format(R"(%all_edges = OpConstantComposite %edge_array{1}
        %edges = OpVariable %edges_pointer Private %all_edges
        %main = OpFunction %void None %procedure
        %entry = OpLabel
        %i = OpLoad {0} %index
        %x_at = OpUDiv {0} %i %eight
        %y_at = OpUMod {0} %i %eight
        %x_place = OpAccessChain %edge_pointer %edges %x_at
        %y_place = OpAccessChain %edge_pointer %edges %y_at
        %x = OpLoad %t %x_place
        %y = OpLoad %t %y_place
        %y_plus_1 = OpIAdd %t %y %one
        %shared_place = OpAccessChain %shared_value_pointer %shared %i
        )",
                        word, members);
    for (std::size_t i = 0; i < list.size(); ++i) {
        text += fmt::format(
            "%before_at{0} = OpIAdd {3} %at{1} %i\n%left_at{0} = OpIAdd {3} %at{2} %i\n"
            "%before_place{0} = OpAccessChain %value_pointer %result %none %before_at{0}\n"
            "%left_place{0} = OpAccessChain %value_pointer %result %none %left_at{0}\n",
            i, i * 2, i * 2 + 1, word);
        const std::string place = in_workgroup ? "%shared_place" : fmt::format("%left_place{}", i);
        std::string instruction = list[i].text;
        instruction.replace(instruction.find("%place"), 6, place);
        instruction.replace(instruction.find("%scope"), 6, in_workgroup ? "%workgroup" : "%device");
        text += fmt::format("OpStore {1} %x\n%before{0} = {2}\nOpStore %before_place{0} %before{0}\n", i, place,
                            instruction);
        if (in_workgroup)
            text += fmt::format("%left{0} = OpLoad %t %shared_place\nOpStore %left_place{0} %left{0}\n", i);
    }
    for (const char* spec : {"cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16"}) {
        SCOPED_TRACE(spec);
        const ComputeRunner runner{
            .spec = spec, .result_words = static_cast<std::uint32_t>(list.size() * 2 * invocations * sizeof(T) / 4)};
        const auto found = runner.run_assembly(text + "OpReturn\nOpFunctionEnd\n", 0x10300);
        ASSERT_TRUE(found) << found.error().message();
        std::vector<T> values(list.size() * 2 * invocations);
        std::memcpy(values.data(), found->data(), values.size() * sizeof(T));
        for (std::size_t i = 0; i < list.size(); ++i)
            for (std::size_t at = 0; at < invocations; ++at) {
                const T x = static_cast<T>(edges[at / 8]), y = static_cast<T>(edges[at % 8]);
                EXPECT_EQ(values[i * 2 * invocations + at], x) << list[i].text << " returns what was there";
                EXPECT_EQ(values[(i * 2 + 1) * invocations + at], list[i].left(x, y))
                    << list[i].text << " of " << +x << ", " << +y;
            }
    }
}

template <typename T>
class AtomicEdges : public testing::Test {};
using Widths = testing::Types<std::int32_t, std::uint32_t, std::int64_t, std::uint64_t>;
TYPED_TEST_SUITE(AtomicEdges, Widths);

TYPED_TEST(AtomicEdges, InABuffer) { check<TypeParam>(false); }
TYPED_TEST(AtomicEdges, InAWorkgroup) { check<TypeParam>(true); }

TEST(AtomicsOf64Bits, OfAllInvocationsInOnePlaceCountEachOnce) {
    const ComputeRunner runner{.spec = "cpu:consistent", .result_words = 16};
    const auto found = runner.run_glsl(R"(
        #extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
        #extension GL_EXT_shader_atomic_int64 : require
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) buffer Result { uint64_t sum, most; int64_t least; uint64_t all, odd, shared_sum; } r;
        shared uint64_t total;
        void main() {
            uint64_t id = uint64_t(gl_LocalInvocationIndex);
            if (id == 0) { r.sum = 0ul, r.most = 0ul, r.least = 0l, r.all = ~0ul, r.odd = 0ul, total = 0ul; }
            memoryBarrierBuffer();
            barrier();
            atomicAdd(r.sum, id << 40);
            atomicMax(r.most, id * 0x100000001ul);
            atomicMin(r.least, -int64_t(id) << 33);
            atomicAnd(r.all, ~(1ul << id));
            atomicXor(r.odd, (id & 1ul) << id);
            if ((id & 1ul) == 1ul) atomicAdd(total, 0x100000000ul + id);
            barrier();
            if (id == 7) r.shared_sum = total;
        })");
    ASSERT_TRUE(found) << found.error().message();
    const auto value = [&](std::size_t i) { return (*found)[i * 2] | std::uint64_t{(*found)[i * 2 + 1]} << 32; };
    EXPECT_EQ(value(0), std::uint64_t{63 * 64 / 2} << 40);
    EXPECT_EQ(value(1), 63 * 0x100000001ull);
    EXPECT_EQ(static_cast<std::int64_t>(value(2)), -63 * (std::int64_t{1} << 33));
    EXPECT_EQ(value(3), 0u);
    EXPECT_EQ(value(4), 0xaaaaaaaaaaaaaaaaull);
    EXPECT_EQ(value(5), (std::uint64_t{32} << 32) + 32 * 32);
}

}  // namespace
}  // namespace nacre::cpu
