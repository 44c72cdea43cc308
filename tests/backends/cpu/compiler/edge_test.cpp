// SPDX-License-Identifier: Apache-2.0
// Operations at the edges of their ranges, in shaders: what backends/cpu/compiler/math/math.h promises there.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::cpu {
namespace {

using Word = std::uint32_t;

float as_float(Word bits) { return std::bit_cast<float>(bits); }
Word as_bits(float value) { return std::bit_cast<Word>(value); }
std::int32_t as_int(Word bits) { return std::bit_cast<std::int32_t>(bits); }
bool is_nan(Word bits) { return std::isnan(as_float(bits)); }

const std::vector<Word> edges{0u,          1u,          2u,          31u,         32u,         33u,
                              0x7fffffffu, 0x80000000u, 0xffffffffu, 0x7f800000u, 0xff800000u, 0x3f800000u,
                              0xbfc00000u, 0x4f000000u, 0x7f7fffffu, 0x4f800000u};

struct Operation {
    const char* glsl;                ///< Of uint x, y; int a, b; float f, g with the same bits; a uint.
    Word (*expected)(Word, Word);
    bool is_float = false;           ///< One NaN is as good as another.
};

Word saturated_int(float x) {
    if (std::isnan(x)) return 0;
    if (x >= 2147483648.0f) return 0x7fffffff;
    if (x < -2147483648.0f) return 0x80000000u;
    return static_cast<Word>(static_cast<std::int32_t>(x));
}
Word saturated_uint(float x) {
    if (!(x > 0)) return 0;
    return x >= 4294967296.0f ? ~0u : static_cast<Word>(x);
}
Word field(Word x, Word offset, Word count) {
    if (offset >= 32 || count == 0) return 0;
    const Word bits = std::min(count, 32 - offset);
    return (x >> offset) & (bits == 32 ? ~0u : (1u << bits) - 1);
}

const Operation operations[] = {
    {"x + y", [](Word x, Word y) { return x + y; }},
    {"x * y", [](Word x, Word y) { return x * y; }},
    {"x / y", [](Word x, Word y) { return y ? x / y : ~0u; }},
    {"x % y", [](Word x, Word y) { return y ? x % y : ~0u; }},
    {"uint(a / b)",
     [](Word x, Word y) { return y == 0     ? 0u
                                 : y == ~0u ? 0u - x
                                            : static_cast<Word>(as_int(x) / as_int(y)); }},
    {"uint(-a)", [](Word x, Word) { return 0u - x; }},
    {"uint(abs(a))", [](Word x, Word) { return as_int(x) < 0 ? 0u - x : x; }},
    {"x << y", [](Word x, Word y) { return x << (y & 31); }},
    {"x >> y", [](Word x, Word y) { return x >> (y & 31); }},
    {"uint(a >> b)", [](Word x, Word y) { return static_cast<Word>(as_int(x) >> (y & 31)); }},
    {"uint(bitCount(x))", [](Word x, Word) { return static_cast<Word>(std::popcount(x)); }},
    {"uint(findLSB(x))", [](Word x, Word) { return x ? static_cast<Word>(std::countr_zero(x)) : ~0u; }},
    {"uint(findMSB(x))", [](Word x, Word) { return x ? 31u - static_cast<Word>(std::countl_zero(x)) : ~0u; }},
    {"uint(findMSB(a))",
     [](Word x, Word) {
         const Word bits = as_int(x) < 0 ? ~x : x;
         return bits ? 31u - static_cast<Word>(std::countl_zero(bits)) : ~0u;
     }},
    {"bitfieldExtract(x, int(y & 31u), 0)", [](Word, Word) { return 0u; }},
    {"bitfieldExtract(x, 0, b)", [](Word x, Word y) { return field(x, 0, y); }},
    {"bitfieldExtract(x, b, 32)", [](Word x, Word y) { return field(x, y, 32); }},
    {"bitfieldInsert(x, y, 5, 0)", [](Word x, Word) { return x; }},
    {"bitfieldInsert(x, y, 0, 32)", [](Word, Word y) { return y; }},
    {"uint(int(f))", [](Word x, Word) { return saturated_int(as_float(x)); }},
    {"uint(f)", [](Word x, Word) { return saturated_uint(as_float(x)); }},
    {"floatBitsToUint(float(x))", [](Word x, Word) { return as_bits(static_cast<float>(x)); }, true},
    {"floatBitsToUint(float(a))", [](Word x, Word) { return as_bits(static_cast<float>(as_int(x))); }, true},
    {"uint(f < g)", [](Word x, Word y) { return Word{as_float(x) < as_float(y)}; }},
    {"uint(f >= g)", [](Word x, Word y) { return Word{as_float(x) >= as_float(y)}; }},
    {"uint(f == g)", [](Word x, Word y) { return Word{as_float(x) == as_float(y)}; }},
    {"uint(f != g)", [](Word x, Word y) { return Word{as_float(x) != as_float(y)}; }},
    {"uint(isnan(f))", [](Word x, Word) { return Word{std::isnan(as_float(x))}; }},
    {"uint(isinf(f))", [](Word x, Word) { return Word{std::isinf(as_float(x))}; }},
    {"floatBitsToUint(min(f, g))", [](Word x, Word y) { return as_float(x) < as_float(y) ? x : y; }, true},
    {"floatBitsToUint(max(f, g))", [](Word x, Word y) { return as_float(x) > as_float(y) ? x : y; }, true},
    {"floatBitsToUint(abs(f))", [](Word x, Word) { return x & 0x7fffffff; }, true},
    {"floatBitsToUint(-f)", [](Word x, Word) { return x ^ 0x80000000; }, true},
    {"floatBitsToUint(floor(f))", [](Word x, Word) { return as_bits(std::floor(as_float(x))); }, true},
    {"floatBitsToUint(trunc(f))", [](Word x, Word) { return as_bits(std::trunc(as_float(x))); }, true},
    {"floatBitsToUint(roundEven(f))", [](Word x, Word) { return as_bits(std::nearbyint(as_float(x))); }, true},
    {"floatBitsToUint(sqrt(f))", [](Word x, Word) { return as_bits(std::sqrt(as_float(x))); }, true},
    {"floatBitsToUint(sign(f))",
     [](Word x, Word) {
         return is_nan(x) ? 0u : as_bits(as_float(x) > 0 ? 1.0f : as_float(x) < 0 ? -1.0f : 0.0f);
     },
     true},
};

class CpuEdges : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Cpu, CpuEdges,
                         testing::Values("cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16"),
                         [](const auto& parameter) {
                             return "lanes_" +
                                    std::string(parameter.param).substr(std::strlen("cpu:consistent:lanes="));
                         });

TEST_P(CpuEdges, OperationsGiveWhatTheyPromise) {
    rhi::Instance instance(all_backends());
    const auto device = instance.create_device({.backend = GetParam()});
    ASSERT_TRUE(device) << device.error().message();
    const std::size_t count = std::size(operations), pairs = edges.size() * edges.size();
    std::string text =
        "layout(local_size_x = 256) in;\n"
        "layout(set = 0, binding = 0) buffer Result { uint result[]; };\n"
        "layout(set = 0, binding = 1) readonly buffer Edges { uint edges[16]; };\n"
        "void main() {\n"
        "uint at = gl_LocalInvocationIndex; uint x = edges[at / 16u], y = edges[at % 16u];\n"
        "int a = int(x), b = int(y); float f = uintBitsToFloat(x), g = uintBitsToFloat(y);\n";
    for (std::size_t i = 0; i < count; ++i)
        text += "result[at + " + std::to_string(i * pairs) + "u] = " + operations[i].glsl + ";\n";
    rhi::ShaderCompiler compiler({});
    const auto words = compiler.compile({.path = "edges.comp", .text = text + "}\n"});
    ASSERT_TRUE(words) << words.error().message();
    const auto shader = (*device)->create_shader(*words);
    const auto pipeline = (*device)->create_compute_pipeline({.shader = *shader, .name = "edges"});
    ASSERT_TRUE(pipeline) << pipeline.error().message();
    const auto result = (*device)->create_buffer({.size = count * pairs * 4, .usage = rhi::BufferUsage::storage});
    const auto input = (*device)->create_buffer({.size = edges.size() * 4, .usage = rhi::BufferUsage::storage});
    ASSERT_TRUE((*device)->write_buffer(*input, std::span<const Word>(edges)));
    const auto layout = (*device)->bind_group_layout(*pipeline, 0);
    const auto group =
        (*device)->create_bind_group({.layout = *layout,
                                      .entries = {{.binding = 0, .buffer = *result}, {.binding = 1, .buffer = *input}},
                                      .name = "edges"});
    rhi::CommandList list = (*device)->create_command_list("edges");
    list.set_pipeline(*pipeline);
    list.set_bind_group(0, *group);
    list.dispatch({});
    ASSERT_TRUE((*device)->submit(std::move(list)));
    const auto bytes = (*device)->read_buffer(*result);
    std::vector<Word> found(count * pairs);
    std::memcpy(found.data(), bytes->data(), bytes->size());
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t at = 0; at < pairs; ++at) {
            const Word x = edges[at / 16], y = edges[at % 16], expected = operations[i].expected(x, y),
                       value = found[i * pairs + at];
            // min and max of two zeros may be either.
            const bool is_equal =
                value == expected || (operations[i].is_float &&
                                      ((is_nan(value) && is_nan(expected)) || as_float(value) == as_float(expected)));
            EXPECT_TRUE(is_equal) << operations[i].glsl << " of " << std::hex << x << ", " << y << ": " << value
                                  << ", not " << expected;
        }
}

}  // namespace
}  // namespace nacre::cpu
