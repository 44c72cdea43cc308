// SPDX-License-Identifier: Apache-2.0
// Arrays of vectors and structures in buffers: lanes that read and write neighboring elements, where compiled code
// takes whole rows of them, and lanes that mean the same element or others, at the ends of the buffers and where only
// some lanes run.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <ostream>
#include <string>
#include <tuple>
#include <vector>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::cpu {
namespace {

constexpr std::uint32_t invocations = 192, source_elements = 150, destination_elements = 101;

/// An element of an array with layout std430, and what the shader writes of it: word w of the destination is word
/// words[w] of the source, and stays as it was where that is negative.
struct Element {
    const char* name;
    const char* declaration;
    const char* type;
    const char* statement;  ///< From `x`, an element, to `to[i]`.
    std::vector<int> words;
};

const std::vector<Element> elements{
    {"uvec2", "", "uvec2", "to[i] = x.yx;", {1, 0}},
    {"uvec3", "", "uvec3", "to[i] = x.zxy;", {2, 0, 1, -1}},
    {"vec3", "", "vec3", "to[i] = x.yzx;", {1, 2, 0, -1}},
    {"copy", "", "uvec4", "to[i] = x;", {0, 1, 2, 3}},
    {"uvec4", "", "uvec4", "to[i] = x.wzyx;", {3, 2, 1, 0}},
    {"twice", "", "uvec4", "to[i] = uvec4(x.xy, x.xy);", {0, 1, 0, 1}},
    {"one_of_four", "", "uvec4", "to[i].z = x.y;", {-1, -1, 1, -1}},
    {"three", "struct E { uint a, b, c; };", "E", "to[i] = E(x.c, x.a, x.b);", {2, 0, 1}},
    {"five", "struct E { uint a, b, c, d, e; };", "E", "to[i] = E(x.e, x.c, x.a, x.d, x.b);", {4, 2, 0, 3, 1}},
    {"six",
     "struct E { uvec2 a; int b; float c; uvec2 d; };",
     "E",
     "to[i] = E(x.d, x.b, x.c, x.a.yx);",
     {4, 5, 2, 3, 1, 0}},
    {"with_gap", "struct E { uint a; uvec2 b; };", "E", "to[i] = E(x.b.y, uvec2(x.a, x.b.x));", {3, -1, 0, 2}},
    {"eight", "struct E { uvec4 a, b; };", "E", "to[i] = E(x.b.wzyx, x.a);", {7, 6, 5, 4, 0, 1, 2, 3}},
    {"member", "struct E { uvec4 a, b; };", "E", "to[i].b = x.a;", {-1, -1, -1, -1, 0, 1, 2, 3}},
    {"mat4", "", "mat4", "to[i] = transpose(x);", {0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15}},
};

void PrintTo(const Element& element, std::ostream* out) { *out << element.name; }

/// Which element an invocation reads, in GLSL and in C++, of the invocation's number.
struct Index {
    const char* name;
    const char* glsl;
    std::uint32_t (*of)(std::uint32_t);
};
void PrintTo(const Index& index, std::ostream* out) { *out << index.name; }
const std::vector<Index> indices{
    {"neighbors", "i + 3u", [](std::uint32_t i) { return i + 3; }},
    {"before_the_first", "i - 2u", [](std::uint32_t i) { return i - 2; }},
    {"in_steps", "numbers[i] / 23u * 7u", [](std::uint32_t i) { return i / 23 * 7; }},
    // Both are 5 elements from the begin if bytes are counted in 32 bits.
    {"same_or_outside", "numbers[i] < 40u ? 5u : 0x20000005u",
     [](std::uint32_t i) { return i < 40 ? 5u : 0x20000005u; }},
    // Evenly rising modulo 2^32 only: 0x40000001 to its fourth power is 1, what is added on the way comes to
    // 0x80000003.
    {"neighbors_by_products",
     "(((i * 0x40000001u + 1u) * 0x40000001u + 1u) * 0x40000001u + 1u) * 0x40000001u - 0x80000003u",
     [](std::uint32_t i) { return i; }},
    {"scattered", "numbers[i] * 37u % 150u", [](std::uint32_t i) { return i * 37 % 150; }},
};

/// Which invocations write.
struct Condition {
    const char* name;
    const char* glsl;
    bool (*of)(std::uint32_t);
};
const std::vector<Condition> conditions{
    {"all", "", [](std::uint32_t) { return true; }},
    {"below", "if (i >= 77u) return;", [](std::uint32_t i) { return i < 77; }},
    {"some", "if ((i & 5u) == 1u) return;", [](std::uint32_t i) { return (i & 5) != 1; }},
    {"none", "if (i < 1000u) return;", [](std::uint32_t) { return false; }},
};

class Rows : public testing::TestWithParam<std::tuple<const char*, Element, Index>> {};

TEST_P(Rows, ElementsComeAndGoWhole) {
    const auto& [spec, element, index] = GetParam();
    const std::size_t words = element.words.size();
    std::vector<std::uint32_t> source(source_elements * words), numbers(invocations);
    for (std::uint32_t i = 0; i < source.size(); ++i) source[i] = 0x3f800000u + i;
    for (std::uint32_t i = 0; i < invocations; ++i) numbers[i] = i;
    const std::vector<std::uint32_t> before(destination_elements * words, 0x40490fdbu);

    rhi::Instance instance(all_backends());
    auto device = instance.create_device({.backend = spec});
    ASSERT_TRUE(device) << device.error().message();
    const auto make_buffer = [&](std::span<const std::uint32_t> content) {
        auto buffer = (*device)->create_buffer({.size = content.size_bytes(), .usage = rhi::BufferUsage::storage});
        EXPECT_TRUE(buffer && (*device)->write_buffer(*buffer, content));
        return *buffer;
    };
    const rhi::Buffer from = make_buffer(source), to = make_buffer(before), number_buffer = make_buffer(numbers);
    for (const Condition& condition : conditions) {
        const std::string type = element.type;
        const std::string text = std::string(element.declaration) + R"(
            layout(local_size_x = 64) in;
            layout(set = 0, binding = 0, std430) readonly buffer From { )" +
                                 type + R"( from[]; };
            layout(set = 0, binding = 1, std430) buffer To { )" +
                                 type + R"( to[]; };
            layout(set = 0, binding = 2, std430) readonly buffer Numbers { uint numbers[]; };
            void main() {
                uint i = gl_GlobalInvocationID.x;
                )" + condition.glsl +
                                 "\n" + type + " x = from[" + index.glsl + "];\n" + element.statement + "\n}\n";
        rhi::ShaderCompiler compiler({});
        const auto code = compiler.compile({.path = "rows.comp", .text = text});
        ASSERT_TRUE(code) << code.error().message();
        const auto shader = (*device)->create_shader(*code);
        const auto pipeline = (*device)->create_compute_pipeline({.shader = *shader, .name = "rows"});
        ASSERT_TRUE(pipeline) << pipeline.error().message();
        const auto layout = (*device)->bind_group_layout(*pipeline, 0);
        const auto group = (*device)->create_bind_group({.layout = *layout,
                                                         .entries = {{.binding = 0, .buffer = from},
                                                                     {.binding = 1, .buffer = to},
                                                                     {.binding = 2, .buffer = number_buffer}},
                                                         .name = "rows"});
        ASSERT_TRUE(group) << group.error().message();
        ASSERT_TRUE((*device)->write_buffer(to, std::span<const std::uint32_t>(before)));
        rhi::CommandList list = (*device)->create_command_list("rows");
        list.set_pipeline(*pipeline);
        list.set_bind_group(0, *group);
        list.dispatch({.x = invocations / 64});
        ASSERT_TRUE((*device)->submit(std::move(list)));
        const auto bytes = (*device)->read_buffer(to);
        ASSERT_TRUE(bytes) << bytes.error().message();
        std::vector<std::uint32_t> found(before.size());
        std::memcpy(found.data(), bytes->data(), bytes->size());
        for (std::uint32_t i = 0; i < destination_elements; ++i)
            for (std::size_t w = 0; w < words; ++w) {
                std::uint32_t expected = before[i * words + w];
                const std::uint32_t read = index.of(i);
                if (condition.of(i) && element.words[w] >= 0)
                    expected =
                        read < source_elements ? source[read * words + static_cast<std::size_t>(element.words[w])] : 0;
                ASSERT_EQ(found[i * words + w], expected) << condition.name << ", invocation " << i << ", word " << w;
            }
    }
}

INSTANTIATE_TEST_SUITE_P(Cpu, Rows,
                         testing::Combine(testing::Values("cpu:consistent:lanes=4", "cpu:fast:lanes=8",
                                                          "cpu:consistent:lanes=16"),
                                          testing::ValuesIn(elements), testing::ValuesIn(indices)),
                         [](const auto& test) {
                             std::string name = std::string(std::get<0>(test.param)) + "_" +
                                                std::get<1>(test.param).name + "_" + std::get<2>(test.param).name;
                             std::ranges::replace_if(
                                 name, [](char c) { return c == ':' || c == '='; }, '_');
                             return name;
                         });

}  // namespace
}  // namespace nacre::cpu
