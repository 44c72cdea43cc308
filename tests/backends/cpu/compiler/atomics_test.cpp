// SPDX-License-Identifier: Apache-2.0
// Atomic operations whose old values nobody asks for, which are done once for all lanes that mean one place: in memory
// of the workgroup and in buffers, at one place and at several, with one operand and with one for each invocation.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <ostream>
#include <string>
#include <tuple>
#include <vector>

#include "tests/backends/cpu/compiler/compute_runner.h"

namespace nacre::cpu {
namespace {

struct Operation {
    const char* function;
    bool is_signed;
    std::uint32_t (*apply)(std::uint32_t, std::uint32_t);
};
void PrintTo(const Operation& operation, std::ostream* out) {
    *out << operation.function << (operation.is_signed ? "_signed" : "");
}
std::int32_t as_signed(std::uint32_t word) { return static_cast<std::int32_t>(word); }
const std::vector<Operation> operations{
    {"atomicAdd", false, [](std::uint32_t a, std::uint32_t b) { return a + b; }},
    {"atomicAnd", false, [](std::uint32_t a, std::uint32_t b) { return a & b; }},
    {"atomicOr", false, [](std::uint32_t a, std::uint32_t b) { return a | b; }},
    {"atomicXor", false, [](std::uint32_t a, std::uint32_t b) { return a ^ b; }},
    {"atomicMin", false, [](std::uint32_t a, std::uint32_t b) { return std::min(a, b); }},
    {"atomicMax", false, [](std::uint32_t a, std::uint32_t b) { return std::max(a, b); }},
    {"atomicMin", true, [](std::uint32_t a, std::uint32_t b) { return as_signed(a) < as_signed(b) ? a : b; }},
    {"atomicMax", true, [](std::uint32_t a, std::uint32_t b) { return as_signed(a) > as_signed(b) ? a : b; }},
};

/// Numbers of an invocation, in GLSL and in C++.
struct Number {
    const char* name;
    const char* glsl;
    std::uint32_t (*of)(std::uint32_t);
};
void PrintTo(const Number& number, std::ostream* out) { *out << number.name; }
const std::vector<Number> places{{"one", "5u", [](std::uint32_t) { return 5u; }},
                                 {"some", "i / 3u % 4u", [](std::uint32_t i) { return i / 3 % 4; }},
                                 {"own", "i % 8u", [](std::uint32_t i) { return i % 8; }}};
const std::vector<Number> values{{"same", "0x80000003u", [](std::uint32_t) { return 0x80000003u; }},
                                 {"different", "i * 2654435761u", [](std::uint32_t i) { return i * 2654435761u; }}};

class UnaskedAtomics : public testing::TestWithParam<std::tuple<const char*, Operation, Number, Number, bool>> {};

TEST_P(UnaskedAtomics, LeaveWhatOneInvocationAfterTheOtherWould) {
    const auto& [spec, operation, place, value, is_shared] = GetParam();
    const std::string type = operation.is_signed ? "int" : "uint", memory = is_shared ? "own" : "result";
    const std::string text = R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0, std430) buffer Result { )" +
                             type + R"( result[]; };
        shared )" + type + R"( own[8];
        void main() {
            uint i = gl_LocalInvocationIndex;
            if (i < 8u) own[i] = result[i] = )" +
                             type + R"((12345u + i);
            memoryBarrier(); barrier();
            if (i % 7u != 2u) )" +
                             operation.function + "(" + memory + "[" + place.glsl + "], " + type + "(" + value.glsl +
                             R"());
            memoryBarrier(); barrier();
            if (i < 8u) result[i] = )" +
                             memory + R"([i];
        })";
    std::vector<std::uint32_t> expected(8);
    for (std::uint32_t i = 0; i < 8; ++i) expected[i] = 12345 + i;
    for (std::uint32_t i = 0; i < 64; ++i)
        if (i % 7 != 2) expected[place.of(i)] = operation.apply(expected[place.of(i)], value.of(i));
    const auto found = ComputeRunner{.spec = spec, .result_words = 8}.run_glsl(text);
    ASSERT_TRUE(found) << found.error().message();
    EXPECT_EQ(*found, expected);
}

INSTANTIATE_TEST_SUITE_P(Lanes, UnaskedAtomics,
                         testing::Combine(testing::Values("cpu:consistent", "cpu:fast:lanes=8", "cpu:fast:lanes=4"),
                                          testing::ValuesIn(operations), testing::ValuesIn(places),
                                          testing::ValuesIn(values), testing::Bool()));

}  // namespace
}  // namespace nacre::cpu
