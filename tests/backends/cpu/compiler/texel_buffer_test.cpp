// SPDX-License-Identifier: Apache-2.0
// Texel buffers at and behind the ends of their ranges, with lanes that differ: elements inside, zero and nothing
// elsewhere, whatever lies around the range.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"
#include "tests/rhi/texel_values.h"

namespace nacre::cpu {
namespace {

using namespace rhi;

/// Elements in the range; before and behind it lie more bytes that nobody may see or change.
constexpr std::uint32_t count = 21;
constexpr std::uint64_t offset = 48;
constexpr std::uint32_t guard_word = 0xc0de1234u;

struct Element {
    Format format;
    const char* prefix;  ///< Of GLSL's types.
    const char* layout;
};
constexpr Element elements[] = {
    // Those that compiled code reads by itself, then others.
    {Format::r32_uint, "u", "r32ui"},        {Format::r32_sint, "i", "r32i"},
    {Format::r32_float, "", "r32f"},         {Format::rgba16_float, "", "rgba16f"},
    {Format::rgba8_unorm, "", "rgba8"},      {Format::rg32_uint, "u", "rg32ui"},
    {Format::rgba32_float, "", "rgba32f"},   {Format::r8_uint, "u", "r8ui"},
    {Format::r16_float, "", "r16f"},         {Format::rgba8_snorm, "", "rgba8_snorm"},
    {Format::rgb10a2_unorm, "", "rgb10_a2"},
};

/// What is asked for: around both ends, far away, and where a product with the bytes of an element overflows.
std::vector<std::int32_t> indices() {
    std::vector<std::int32_t> result;
    for (std::int32_t i = -5; i < static_cast<std::int32_t>(count) + 6; ++i) result.push_back(i);
    for (const std::int32_t i : {std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max(),
                                 1 << 30, 1 << 29, 1 << 28, (1 << 28) + 1, -(1 << 30), -(1 << 28) + 3, 1000000})
        result.push_back(i);
    return result;
}

class TexelBuffers : public ::testing::TestWithParam<const char*> {
  protected:
    TexelBuffers() : instance_(all_backends()) { device_ = ok(instance_.create_device({.backend = GetParam()})); }

    template <typename T>
    static T ok(Expected<T> result) {
        if (!result) throw std::runtime_error(result.error().message());
        return *std::move(result);
    }
    static void ok(Expected<void> result) {
        if (!result) throw std::runtime_error(result.error().message());
    }

    Buffer buffer_of(const std::vector<std::byte>& content) {
        const Buffer made = ok(device_->create_buffer(
            {.size = content.size(),
             .usage = BufferUsage::storage | BufferUsage::uniform_texel | BufferUsage::storage_texel,
             .name = "elements"}));
        ok(device_->write_buffer(made, std::span(content)));
        return made;
    }
    template <typename T>
    Buffer buffer_of(const std::vector<T>& values) {
        std::vector<std::byte> bytes(values.size() * sizeof(T));
        std::memcpy(bytes.data(), values.data(), bytes.size());
        return buffer_of(bytes);
    }
    template <typename T>
    std::vector<T> read(Buffer from) {
        const std::vector<std::byte> bytes = ok(device_->read_buffer(from));
        std::vector<T> values(bytes.size() / sizeof(T));
        std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
        return values;
    }
    void dispatch(const std::string& body, std::vector<BindGroupEntry> entries, std::uint32_t groups = 1) {
        ShaderCompiler compiler({});
        const Shader shader =
            ok(device_->create_shader(ok(compiler.compile({.path = "texels.comp", .text = "#version 460\n" + body}))));
        const ComputePipeline pipeline = ok(device_->create_compute_pipeline({.shader = shader, .name = "texels"}));
        const BindGroup group = ok(device_->create_bind_group(
            {.layout = ok(device_->bind_group_layout(pipeline, 0)), .entries = std::move(entries), .name = "group"}));
        CommandList list = device_->create_command_list("texels");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group);
        list.dispatch({groups, 1, 1});
        ok(device_->wait(ok(device_->submit(std::move(list)))));
    }

    /// A buffer of guards with random elements in the range; numbers are finite.
    static std::vector<std::byte> surrounded(Format format) {
        std::vector<std::uint32_t> words((2 * offset + count * info(format).block_bytes + 3) / 4, guard_word);
        std::vector<std::byte> bytes(words.size() * 4);
        std::memcpy(bytes.data(), words.data(), bytes.size());
        for (std::uint64_t i = 0; i < count * info(format).block_bytes; ++i)
            bytes[offset + i] = static_cast<std::byte>((i * 37 + 11) % 120);
        return bytes;
    }
    static BindGroupEntry range_of(Buffer buffer, const Element& element, std::uint32_t binding) {
        return {.binding = binding,
                .buffer = buffer,
                .offset = offset,
                .size = count * info(element.format).block_bytes,
                .format = element.format};
    }
    static std::string fetching(const Element& element, bool is_image) {
        const bool is_integer = info(element.format).is_integer();
        return std::string(
                   "layout(local_size_x = 64) in;\n"
                   "layout(set = 0, binding = 0) writeonly buffer Result { uvec4 result[]; };\n"
                   "layout(set = 0, binding = 1) readonly buffer Indices { int indices[]; };\n"
                   "layout(set = 0, binding = 2") +
               (is_image ? std::string(", ") + element.layout + ") uniform readonly " + element.prefix + "imageBuffer"
                         : std::string(") uniform ") + element.prefix + "samplerBuffer") +
               " source;\nvoid main() {\n"
               "    uint i = gl_GlobalInvocationID.x;\n"
               "    if (i >= uint(indices.length())) return;\n"
               "    result[i] = " +
               (is_integer ? "uvec4(" : "floatBitsToUint(") + (is_image ? "imageLoad" : "texelFetch") +
               "(source, indices[i]));\n}\n";
    }

    std::unique_ptr<Device> device_;

  private:
    Instance instance_;
};
INSTANTIATE_TEST_SUITE_P(Cpu, TexelBuffers,
                         ::testing::Values("cpu:lanes=4", "cpu:lanes=8", "cpu:lanes=16", "cpu:consistent:lanes=4",
                                           "cpu:double", "cpu:sanitize", "cpu:hostile:lanes=8"),
                         [](const auto& parameter) {
                             std::string name = parameter.param;
                             std::ranges::replace_if(
                                 name, [](char c) { return c == ':' || c == '='; }, '_');
                             return name;
                         });

TEST_P(TexelBuffers, ReadsGiveElementsInsideAndZeroOutside) {
    const auto asked = indices();
    for (const Element& element : elements)
        for (const bool is_image : {false, true}) {
            const auto content = surrounded(element.format);
            const Buffer result = buffer_of(std::vector<std::uint32_t>(asked.size() * 4));
            dispatch(fetching(element, is_image),
                     {{.binding = 0, .buffer = result},
                      {.binding = 1, .buffer = buffer_of(asked)},
                      range_of(buffer_of(content), element, 2)},
                     static_cast<std::uint32_t>(asked.size() + 63) / 64);
            const auto found = read<std::uint32_t>(result);
            for (std::size_t i = 0; i < asked.size(); ++i) {
                const bool is_inside = asked[i] >= 0 && asked[i] < static_cast<std::int32_t>(count);
                test::TexelValue expected;
                const std::size_t bytes = info(element.format).block_bytes;
                if (is_inside)
                    expected = test::decode_texel(
                        element.format,
                        std::span(content).subspan(offset + static_cast<std::size_t>(asked[i]) * bytes, bytes));
                else
                    expected.channels = {0, 0, 0, 0};
                for (std::size_t c = 0; c < 4; ++c) {
                    const std::uint32_t word = found[4 * i + c];
                    const FormatKind kind = info(element.format).kind;
                    const double value = kind == FormatKind::uint   ? word
                                         : kind == FormatKind::sint ? static_cast<std::int32_t>(word)
                                                                    : static_cast<double>(std::bit_cast<float>(word));
                    // Nothing but the last bit of a float may differ, and that of normalized formats alone.
                    const double tolerance = expected.step[c] == 0 ? 0 : std::abs(expected.channels[c]) * 0x1p-23;
                    ASSERT_NEAR(value, expected.channels[c], tolerance)
                        << element.layout << (is_image ? " image" : " sampler") << ", index " << asked[i]
                        << ", channel " << c;
                }
            }
        }
}

TEST_P(TexelBuffers, SizesAreThoseOfTheRange) {
    for (const Element& element : elements) {
        const Buffer result = buffer_of(std::vector<std::uint32_t>(2));
        const Buffer content = buffer_of(surrounded(element.format));
        dispatch(std::string("layout(local_size_x = 1) in;\n"
                             "layout(set = 0, binding = 0) writeonly buffer Result { int result[]; };\n"
                             "layout(set = 0, binding = 1) uniform ") +
                     element.prefix +
                     "samplerBuffer fetched;\n"
                     "layout(set = 0, binding = 2, " +
                     element.layout + ") uniform readonly " + element.prefix +
                     "imageBuffer loaded;\n"
                     "void main() { result[0] = textureSize(fetched); result[1] = imageSize(loaded); }\n",
                 {{.binding = 0, .buffer = result}, range_of(content, element, 1), range_of(content, element, 2)});
        EXPECT_EQ(read<std::uint32_t>(result), (std::vector<std::uint32_t>{count, count})) << element.layout;
    }
}

TEST_P(TexelBuffers, StoresReachNothingOutside) {
    const auto asked = indices();
    for (const Element& element : elements) {
        const auto before = surrounded(element.format);
        const Buffer content = buffer_of(before);
        const bool is_integer = info(element.format).is_integer();
        // Elements of even index stay as they are.
        dispatch(std::string("layout(local_size_x = 64) in;\n"
                             "layout(set = 0, binding = 1) readonly buffer Indices { int indices[]; };\n"
                             "layout(set = 0, binding = 2, ") +
                     element.layout + ") uniform writeonly " + element.prefix +
                     "imageBuffer destination;\n"
                     "void main() {\n"
                     "    uint i = gl_GlobalInvocationID.x;\n"
                     "    if (i >= uint(indices.length())) return;\n"
                     "    int at = indices[i];\n"
                     "    if ((at & 1) == 1) imageStore(destination, at, " +
                     element.prefix + "vec4(" + (is_integer ? "7" : "1.0") + "));\n}\n",
                 {{.binding = 1, .buffer = buffer_of(asked)}, range_of(content, element, 2)},
                 static_cast<std::uint32_t>(asked.size() + 63) / 64);
        const auto after = read<std::byte>(content);
        const std::size_t bytes = info(element.format).block_bytes;
        ASSERT_EQ(after.size(), before.size());
        for (std::size_t at = 0; at < after.size(); ++at) {
            const bool is_inside = at >= offset && at < offset + count * bytes;
            if (is_inside && (at - offset) / bytes % 2 == 1) continue;
            ASSERT_EQ(after[at], before[at]) << element.layout << ", byte " << at;
        }
        for (std::size_t i = 1; i < count; i += 2) {
            const auto value = test::decode_texel(element.format, std::span(after).subspan(offset + i * bytes, bytes));
            for (std::size_t c = 0; c < info(element.format).channels; ++c)
                ASSERT_EQ(value.channels[c], is_integer ? 7 : 1) << element.layout << ", element " << i;
        }
    }
}

TEST_P(TexelBuffers, WholeRowsOfNeighborsAreStored) {
    // Every invocation its own element: what compiled code may store at once; the last workgroup reaches over the end.
    for (const Element& element : elements) {
        constexpr std::uint32_t many = 200;
        const FormatInfo& facts = info(element.format);
        const std::size_t bytes = facts.block_bytes;
        std::vector<std::byte> before(256 * bytes, std::byte{0x5a});
        const Buffer content = buffer_of(before);
        dispatch(std::string("layout(local_size_x = 64) in;\nlayout(set = 0, binding = 0, ") + element.layout +
                     ") uniform writeonly " + element.prefix +
                     "imageBuffer destination;\nvoid main() {\n"
                     "    int at = int(gl_GlobalInvocationID.x);\n    imageStore(destination, at, " +
                     element.prefix + "vec4(" + (facts.is_integer() ? "at % 128" : "float(at % 2)") + "));\n}\n",
                 {{.binding = 0, .buffer = content, .size = many * bytes, .format = element.format}}, 4);
        const auto after = read<std::byte>(content);
        for (std::size_t i = 0; i < 256; ++i) {
            const auto value = test::decode_texel(element.format, std::span(after).subspan(i * bytes, bytes));
            const double expected = facts.is_integer() ? static_cast<double>(i % 128) : static_cast<double>(i % 2);
            if (i < many)
                for (std::size_t c = 0; c < facts.channels; ++c)
                    ASSERT_EQ(value.channels[c], expected) << element.layout << ", element " << i;
            else
                ASSERT_EQ(after[i * bytes], std::byte{0x5a}) << element.layout << ", element " << i;
        }
    }
}

TEST_P(TexelBuffers, AtomicsOutsideGiveZeroAndChangeNothing) {
    const auto asked = indices();
    const auto before = surrounded(Format::r32_uint);
    const Buffer content = buffer_of(before), result = buffer_of(std::vector<std::uint32_t>(asked.size() * 2, 5u));
    dispatch(R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
        layout(set = 0, binding = 1) readonly buffer Indices { int indices[]; };
        layout(set = 0, binding = 2, r32ui) uniform coherent uimageBuffer words;
        void main() {
            uint i = gl_GlobalInvocationID.x;
            if (i >= uint(indices.length())) return;
            result[2u * i] = imageAtomicAdd(words, indices[i], 3u);
            result[2u * i + 1u] = imageAtomicCompSwap(words, indices[i], 0u, 9u);
        }
    )",
             {{.binding = 0, .buffer = result},
              {.binding = 1, .buffer = buffer_of(asked)},
              range_of(content, elements[0], 2)},
             static_cast<std::uint32_t>(asked.size() + 63) / 64);
    const auto found = read<std::uint32_t>(result);
    const auto after = read<std::uint32_t>(content);
    std::vector<std::uint32_t> words(before.size() / 4);
    std::memcpy(words.data(), before.data(), before.size());
    for (std::size_t i = 0; i < asked.size(); ++i) {
        if (asked[i] < 0 || asked[i] >= static_cast<std::int32_t>(count)) {
            ASSERT_EQ(found[2 * i], 0u) << asked[i];
            ASSERT_EQ(found[2 * i + 1], 0u) << asked[i];
            continue;
        }
        std::uint32_t& word = words[offset / 4 + static_cast<std::size_t>(asked[i])];
        ASSERT_EQ(found[2 * i], word) << asked[i];
        ASSERT_EQ(found[2 * i + 1], word + 3) << asked[i];
        word += 3;
    }
    EXPECT_EQ(after, words);
}

TEST_P(TexelBuffers, LanesChooseAmongSeveral) {
    constexpr std::uint32_t buffers = 5;
    std::vector<BindGroupEntry> entries;
    const Buffer result = buffer_of(std::vector<std::uint32_t>(64 * 2));
    entries.push_back({.binding = 0, .buffer = result});
    for (std::uint32_t i = 0; i < buffers; ++i) {
        std::vector<std::uint32_t> words;
        for (std::uint32_t k = 0; k < 10 + i; ++k) words.push_back(1000 * (i + 1) + k);
        entries.push_back({.binding = 1, .buffer = buffer_of(words), .element = i, .format = Format::r32_uint});
    }
    dispatch(R"(
        #extension GL_EXT_nonuniform_qualifier : require
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) writeonly buffer Result { uvec2 result[]; };
        layout(set = 0, binding = 1) uniform usamplerBuffer sources[5];
        void main() {
            uint i = gl_LocalInvocationID.x, which = i * 7u % 5u;
            result[i] = uvec2(texelFetch(sources[nonuniformEXT(which)], int(i % 12u)).x,
                              uint(textureSize(sources[nonuniformEXT(which)])));
        }
    )",
             entries);
    const auto found = read<std::uint32_t>(result);
    for (std::uint32_t i = 0; i < 64; ++i) {
        const std::uint32_t which = i * 7 % 5, at = i % 12;
        EXPECT_EQ(found[2 * i], at < 10 + which ? 1000 * (which + 1) + at : 0u) << i;
        EXPECT_EQ(found[2 * i + 1], 10 + which) << i;
    }
}

TEST_P(TexelBuffers, WhatIsStoredIsLoadedByTheNextInvocations) {
    // Neighbors through a texel buffer, with barriers between.
    const Buffer words = buffer_of(std::vector<std::uint32_t>(64)), result = buffer_of(std::vector<std::uint32_t>(64));
    dispatch(R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
        layout(set = 0, binding = 1, r32ui) uniform coherent uimageBuffer words;
        void main() {
            int i = int(gl_LocalInvocationID.x);
            imageStore(words, i, uvec4(uint(i) * 3u));
            memoryBarrierImage();
            barrier();
            result[i] = imageLoad(words, (i + 17) % 64).x;
        }
    )",
             {{.binding = 0, .buffer = result}, {.binding = 1, .buffer = words, .format = Format::r32_uint}});
    const auto found = read<std::uint32_t>(result);
    for (std::uint32_t i = 0; i < 64; ++i) EXPECT_EQ(found[i], (i + 17) % 64 * 3) << i;
}

}  // namespace
}  // namespace nacre::cpu
