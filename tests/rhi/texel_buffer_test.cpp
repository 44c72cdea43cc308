// SPDX-License-Identifier: Apache-2.0
// Texel buffers: ranges of buffers as elements of a format, read by texelFetch and as images.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

#include "tests/rhi/backend_test.h"
#include "tests/rhi/texel_values.h"

namespace nacre::test {
namespace {

using namespace rhi;

constexpr BufferUsage both_usages = BufferUsage::uniform_texel | BufferUsage::storage_texel;

std::string prefix(Format format) {
    const FormatKind kind = info(format).kind;
    return kind == FormatKind::uint ? "u" : kind == FormatKind::sint ? "i" : "";
}

/// What GLSL calls the format in a layout qualifier; empty where it has no name for it.
std::string qualifier(Format format) {
    switch (format) {
        case Format::rgba8_unorm: return "rgba8";
        case Format::rgba8_snorm: return "rgba8_snorm";
        case Format::rgba8_uint: return "rgba8ui";
        case Format::rgba8_sint: return "rgba8i";
        case Format::rgba16_unorm: return "rgba16";
        case Format::rgba16_float: return "rgba16f";
        case Format::rgba16_uint: return "rgba16ui";
        case Format::rgba16_sint: return "rgba16i";
        case Format::rgba32_float: return "rgba32f";
        case Format::rgba32_uint: return "rgba32ui";
        case Format::rgba32_sint: return "rgba32i";
        case Format::r8_unorm: return "r8";
        case Format::r8_uint: return "r8ui";
        case Format::rg8_unorm: return "rg8";
        case Format::r16_float: return "r16f";
        case Format::rg16_uint: return "rg16ui";
        case Format::rg32_float: return "rg32f";
        case Format::rg32_uint: return "rg32ui";
        case Format::r32_float: return "r32f";
        case Format::r32_uint: return "r32ui";
        case Format::r32_sint: return "r32i";
        case Format::rgb10a2_unorm: return "rgb10_a2";
        case Format::rg11b10_float: return "r11f_g11f_b10f";
        default: return {};
    }
}

class TexelBuffers : public BackendTest {
  public:
    void SetUp() override {
        BackendTest::SetUp();
        SKIP_WITHOUT(capabilities().texel_buffers);
    }

    template <typename T>
    Buffer elements_of(const std::vector<T>& values, BufferUsage usage, std::string name) {
        return buffer_of(std::span<const T>(values), usage, std::move(name));
    }

    std::vector<Format> formats_with(FormatSupport what) {
        std::vector<Format> result;
        for (std::uint32_t i = 1; i < format_count; ++i)
            if (supports(static_cast<Format>(i), what)) result.push_back(static_cast<Format>(i));
        return result;
    }

    /// Random elements, without NaN and infinity in formats of floats.
    static std::vector<std::byte> random_elements(Format format, std::size_t count) {
        std::mt19937 random(static_cast<std::uint32_t>(format) + 7);
        const FormatInfo& facts = info(format);
        std::vector<std::byte> bytes(count * facts.block_bytes);
        for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
        if (facts.kind != FormatKind::floating || format == Format::rgb9e5_float) return bytes;
        const std::size_t width = format == Format::rg11b10_float ? 4 : facts.block_bytes / facts.channels;
        for (std::size_t i = 0; i < bytes.size(); i += width) {
            std::uint32_t word = 0;
            std::memcpy(&word, &bytes[i], width);
            if (format == Format::rg11b10_float)
                word &= ~(1u << 10 | 1u << 21 | 1u << 31);
            else
                word = width == 2 ? word & 0xbfff : (word & 0x807fffffu) | (100 + word % 50) << 23;
            std::memcpy(&bytes[i], &word, width);
        }
        return bytes;
    }

    void expect_element(Format format, std::span<const std::byte> bytes, const std::array<std::uint32_t, 4>& found,
                        std::size_t element) {
        const TexelValue expected = decode_texel(format, bytes);
        for (std::size_t c = 0; c < 4; ++c) {
            float number = 0;
            std::memcpy(&number, &found[c], 4);
            const FormatKind kind = info(format).kind;
            const double value = kind == FormatKind::uint   ? static_cast<double>(found[c])
                                 : kind == FormatKind::sint ? static_cast<double>(static_cast<std::int32_t>(found[c]))
                                                            : static_cast<double>(number);
            // Normalized numbers become floats by a division that may be off by a little; sRGB by a table or a curve.
            ASSERT_NEAR(value, expected.channels[c], expected.step[c] * (kind == FormatKind::srgb ? 0.5 : 0.02))
                << info(format).name << ", element " << element << ", channel " << c;
        }
    }
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(TexelBuffers);
INSTANTIATE_TEST_SUITE_P(Rhi, TexelBuffers, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

TEST_P(TexelBuffers, FormatsThatEveryDeviceHas) {
    EXPECT_GE(capabilities().max_texel_buffer_elements, 65536u);
    EXPECT_GE(capabilities().texel_buffer_offset_alignment, 1u);
    for (const Format format : {Format::r32_uint, Format::r32_sint, Format::r32_float, Format::rgba32_float,
                                Format::rgba8_unorm, Format::rgba16_float, Format::rgba32_uint}) {
        EXPECT_TRUE(supports(format, FormatSupport::uniform_texel_buffer)) << info(format).name;
        EXPECT_TRUE(supports(format, FormatSupport::storage_texel_buffer)) << info(format).name;
    }
    EXPECT_TRUE(supports(Format::r32_uint, FormatSupport::storage_texel_buffer_atomic));
    EXPECT_FALSE(supports(Format::bc1_rgba_unorm, FormatSupport::uniform_texel_buffer));
    EXPECT_FALSE(supports(Format::d32_float, FormatSupport::storage_texel_buffer));
}

TEST_P(TexelBuffers, FetchedElementsMeanWhatTheyShould) {
    constexpr std::size_t count = 67;
    for (const Format format : formats_with(FormatSupport::uniform_texel_buffer)) {
        const auto elements = random_elements(format, count);
        const Buffer source = elements_of(elements, BufferUsage::uniform_texel, "elements");
        const auto found = evaluate<std::array<std::uint32_t, 4>>(
            "layout(local_size_x = 1) in;\n"
            "layout(set = 0, binding = 0) buffer Result { uvec4 result[]; };\n"
            "layout(set = 0, binding = 1) uniform " +
                prefix(format) +
                "samplerBuffer source;\n"
                "void main() {\n"
                "    int at = int(gl_GlobalInvocationID.x);\n"
                "    result[at] = " +
                (info(format).is_integer() ? "uvec4(" : "floatBitsToUint(") +
                "texelFetch(source, at));\n"
                "}",
            count, {{.binding = 1, .buffer = source, .format = format}}, {count, 1, 1});
        const std::size_t bytes = info(format).block_bytes;
        for (std::size_t i = 0; i < count; ++i)
            expect_element(format, std::span(elements).subspan(i * bytes, bytes), found[i], i);
        device().destroy(source);
    }
}

TEST_P(TexelBuffers, LoadedElementsMeanWhatTheyShould) {
    constexpr std::size_t count = 35;
    for (const Format format : formats_with(FormatSupport::storage_texel_buffer)) {
        if (qualifier(format).empty()) continue;
        const auto elements = random_elements(format, count);
        const Buffer source = elements_of(elements, BufferUsage::storage_texel, "elements");
        const auto found = evaluate<std::array<std::uint32_t, 4>>(
            "layout(local_size_x = 1) in;\n"
            "layout(set = 0, binding = 0) buffer Result { uvec4 result[]; };\n"
            "layout(set = 0, binding = 1, " +
                qualifier(format) + ") uniform readonly " + prefix(format) +
                "imageBuffer source;\n"
                "void main() {\n"
                "    int at = int(gl_GlobalInvocationID.x);\n"
                "    result[at] = " +
                (info(format).is_integer() ? "uvec4(" : "floatBitsToUint(") +
                "imageLoad(source, at));\n"
                "}",
            count, {{.binding = 1, .buffer = source, .format = format}}, {count, 1, 1});
        const std::size_t bytes = info(format).block_bytes;
        for (std::size_t i = 0; i < count; ++i)
            expect_element(format, std::span(elements).subspan(i * bytes, bytes), found[i], i);
        device().destroy(source);
    }
}

TEST_P(TexelBuffers, StoredElementsAreWhatWasWritten) {
    constexpr std::size_t count = 70;
    for (const Format format : formats_with(FormatSupport::storage_texel_buffer)) {
        if (qualifier(format).empty()) continue;
        const FormatInfo& facts = info(format);
        const Buffer written = buffer(count * facts.block_bytes, BufferUsage::storage_texel, "written");
        // Values that differ from element to element and channel to channel, in the range of every format.
        const bool is_integer = facts.is_integer();
        const std::string value = is_integer                        ? "(at + ivec4(0, 1, 2, 3)) % 100"
                                  : facts.kind == FormatKind::snorm ? "(vec4(at, at + 1, at + 2, at + 3) - 36.0) / 37.0"
                                                                    : "vec4(at, at + 1, at + 2, at + 3) / 73.0";
        const ComputePipeline pipeline = compute(
            "layout(local_size_x = 7) in;\n"
            "layout(set = 0, binding = 0, " +
            qualifier(format) + ") uniform writeonly " + prefix(format) +
            "imageBuffer written;\n"
            "void main() {\n"
            "    int at = int(gl_GlobalInvocationID.x);\n"
            "    imageStore(written, at, " +
            prefix(format) + "vec4(" + value +
            "));\n"
            "}");
        dispatch(pipeline, {{.binding = 0, .buffer = written, .format = format}}, {count / 7, 1, 1});
        const auto bytes = read<std::byte>(written);
        for (std::size_t i = 0; i < count; ++i) {
            const TexelValue found =
                decode_texel(format, std::span(bytes).subspan(i * facts.block_bytes, facts.block_bytes));
            for (std::size_t c = 0; c < facts.channels; ++c) {
                const double at = static_cast<double>(i + c);
                const double expected = is_integer                        ? std::fmod(at, 100.0)
                                        : facts.kind == FormatKind::snorm ? (at - 36.0) / 37.0
                                                                          : at / 73.0;
                // Of two bits of alpha integers keep what fits; no such format is here.
                EXPECT_NEAR(found.channels[c], expected, found.step[c] * 1.01 + 1e-6)
                    << facts.name << ", element " << i << ", channel " << c;
            }
        }
        device().destroy(written);
    }
}

TEST_P(TexelBuffers, AtomicsCountAndCompare) {
    SKIP_WITHOUT(supports(Format::r32_uint, FormatSupport::storage_texel_buffer_atomic) &&
                 supports(Format::r32_sint, FormatSupport::storage_texel_buffer_atomic));
    const std::vector<std::uint32_t> start{0, ~0u, 0, ~0u, 0, 5, 7, 0};
    const std::vector<std::int32_t> signed_start{100, -100, 0, 0};
    const Buffer counters = elements_of(start, BufferUsage::storage_texel, "counters");
    const Buffer limits = elements_of(signed_start, BufferUsage::storage_texel, "limits");
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 50) in;
        layout(set = 0, binding = 0, r32ui) uniform uimageBuffer counters;
        layout(set = 0, binding = 1, r32i) uniform iimageBuffer limits;
        layout(set = 0, binding = 2) buffer Old { uint old[]; };
        void main() {
            uint i = gl_GlobalInvocationID.x;
            old[i] = imageAtomicAdd(counters, 0, 3u);
            imageAtomicMin(counters, 1, i + 20u);
            imageAtomicMax(counters, 2, i * 2u);
            imageAtomicAnd(counters, 3, ~(1u << (i % 7u)));
            imageAtomicOr(counters, 4, 1u << (i % 5u));
            imageAtomicXor(counters, 5, i);
            imageAtomicCompSwap(counters, 6, 7u, 1000u + i);
            if (i == 77u) imageAtomicExchange(counters, 7, 123456u);
            imageAtomicMin(limits, 0, int(i) - 60);
            imageAtomicMax(limits, 1, int(i) - 160);
            imageAtomicAdd(limits, 2, -2);
        }
    )");
    constexpr std::uint32_t count = 200;
    const Buffer old = buffer(count * 4, BufferUsage::storage, "old");
    dispatch(pipeline,
             {{.binding = 0, .buffer = counters, .format = Format::r32_uint},
              {.binding = 1, .buffer = limits, .format = Format::r32_sint},
              {.binding = 2, .buffer = old}},
             {4, 1, 1});
    const auto found = read<std::uint32_t>(counters);
    std::uint32_t all = 5;
    for (std::uint32_t i = 0; i < count; ++i) all ^= i;
    EXPECT_EQ(found[0], 3 * count);
    EXPECT_EQ(found[1], 20u);
    EXPECT_EQ(found[2], 2 * (count - 1));
    EXPECT_EQ(found[3], ~127u);
    EXPECT_EQ(found[4], 31u);
    EXPECT_EQ(found[5], all);
    EXPECT_GE(found[6], 1000u);
    EXPECT_LT(found[6], 1000u + count);
    EXPECT_EQ(found[7], 123456u);
    EXPECT_EQ(read<std::int32_t>(limits), (std::vector<std::int32_t>{-60, 39, -2 * static_cast<int>(count), 0}));
    // Each addition saw another value.
    auto seen = read<std::uint32_t>(old);
    std::ranges::sort(seen);
    for (std::uint32_t i = 0; i < count; ++i) ASSERT_EQ(seen[i], 3 * i);
}

TEST_P(TexelBuffers, RangesBeginAndEndWhereTheyShould) {
    const std::uint32_t alignment = std::max(capabilities().texel_buffer_offset_alignment, 16u);
    std::vector<std::uint32_t> values(alignment + 13);
    std::iota(values.begin(), values.end(), 1000u);
    const Buffer source = elements_of(values, both_usages, "values");
    const std::string body = R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { uint result[]; };
        layout(set = 0, binding = 1) uniform usamplerBuffer fetched;
        layout(set = 0, binding = 2, r32ui) uniform readonly uimageBuffer loaded;
        void main() {
            result[0] = uint(textureSize(fetched));
            result[1] = uint(imageSize(loaded));
            result[2] = texelFetch(fetched, 0).x;
            result[3] = texelFetch(fetched, textureSize(fetched) - 1).x;
            result[4] = imageLoad(loaded, 0).x;
            result[5] = imageLoad(loaded, imageSize(loaded) - 1).x;
        }
    )";
    const auto found = evaluate<std::uint32_t>(
        body, 6,
        {{.binding = 1, .buffer = source, .offset = alignment, .size = 36, .format = Format::r32_uint},
         {.binding = 2, .buffer = source, .offset = 2 * alignment, .format = Format::r32_uint}});
    const std::uint32_t first = alignment / 4, all = alignment + 13;
    EXPECT_EQ(found[0], 9u);
    EXPECT_EQ(found[1], all - 2 * first);
    EXPECT_EQ(found[2], 1000 + first);
    EXPECT_EQ(found[3], 1000 + first + 8);
    EXPECT_EQ(found[4], 1000 + 2 * first);
    EXPECT_EQ(found[5], 1000 + all - 1);
}

TEST_P(TexelBuffers, TheDefaultRangeEndsWithTheLastWholeElement) {
    std::vector<std::uint32_t> values(11);
    std::iota(values.begin(), values.end(), 1u);
    const Buffer source = elements_of(values, BufferUsage::uniform_texel, "values");
    const auto found = evaluate<std::uint32_t>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { uint result[]; };
        layout(set = 0, binding = 1) uniform usamplerBuffer fetched;
        void main() {
            result[0] = uint(textureSize(fetched));
            result[1] = texelFetch(fetched, 1).w;
        }
    )",
                                               2, {{.binding = 1, .buffer = source, .format = Format::rgba32_uint}});
    EXPECT_EQ(found[0], 2u);
    EXPECT_EQ(found[1], 8u);
}

// Each step writes through one kind of binding and the next reads through another: any missing barrier shows.
TEST_P(TexelBuffers, EveryKindOfBindingSeesWhatTheOthersWrote) {
    constexpr std::uint32_t count = 4096;
    const BufferUsage usage = both_usages | BufferUsage::storage;
    std::vector<std::uint32_t> start(count);
    std::iota(start.begin(), start.end(), 0u);
    const Buffer a = elements_of(start, usage, "a"), b = buffer(count * 4, usage, "b");
    const auto make = [&](const char* source, const char* read, const char* destination, const char* write) {
        return compute(std::string("layout(local_size_x = 64) in;\nlayout(set = 0, binding = 0") + source +
                       "layout(set = 0, binding = 1" + destination +
                       "void main() { uint i = gl_GlobalInvocationID.x; "
                       "int to = int((i * 1021u + 17u) % 4096u); uint value = " +
                       read + " + 1u; " + write + " }");
    };
    const char* const as_sampler = ") uniform usamplerBuffer source;\n";
    const char* const fetch = "texelFetch(source, int(i)).x";
    const char* const as_image = ", r32ui) uniform readonly uimageBuffer source;\n";
    const char* const load = "imageLoad(source, int(i)).x";
    const char* const as_block = ") readonly buffer Source { uint source[]; };\n";
    const char* const to_image = ", r32ui) uniform writeonly uimageBuffer destination;\n";
    const char* const store = "imageStore(destination, to, uvec4(value));";
    const char* const to_block = ") buffer Destination { uint destination[]; };\n";
    const char* const assign = "destination[to] = value;";
    const std::array pipelines{
        make(as_sampler, fetch, to_image, store),     make(as_image, load, to_block, assign),
        make(as_block, "source[i]", to_image, store), make(as_sampler, fetch, to_block, assign),
        make(as_image, load, to_image, store),        make(as_block, "source[i]", to_block, assign)};
    CommandList list = device().create_command_list("steps");
    for (std::size_t i = 0; i < 4 * pipelines.size(); ++i) {
        const ComputePipeline& pipeline = pipelines[i % pipelines.size()];
        list.set_pipeline(pipeline);
        list.set_bind_group(
            0, group(pipeline, {{.binding = 0, .buffer = i % 2 == 0 ? a : b, .format = Format::r32_uint},
                                {.binding = 1, .buffer = i % 2 == 0 ? b : a, .format = Format::r32_uint}}));
        list.dispatch({count / 64, 1, 1});
    }
    run(std::move(list));
    std::vector<std::uint32_t> expected = start, next(count);
    for (std::size_t i = 0; i < 4 * pipelines.size(); ++i) {
        for (std::uint32_t at = 0; at < count; ++at) next[(at * 1021 + 17) % count] = expected[at] + 1;
        expected.swap(next);
    }
    EXPECT_EQ(read<std::uint32_t>(a), expected);
}

TEST_P(TexelBuffers, AfterACopyTheNewElementsAreRead) {
    const std::vector<float> first{1, 2, 3, 4}, second{5, 6, 7, 8};
    const Buffer from = elements_of(second, BufferUsage::copy_source, "from");
    const Buffer to = elements_of(first, both_usages | BufferUsage::copy_destination, "to");
    const Buffer result = buffer(32, BufferUsage::storage, "result");
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 1) in;
        layout(push_constant) uniform Constants { uint at; };
        layout(set = 0, binding = 0) buffer Result { vec4 result[]; };
        layout(set = 0, binding = 1) uniform samplerBuffer source;
        void main() { result[at] = texelFetch(source, 0); }
    )");
    const BindGroup bound = group(
        pipeline, {{.binding = 0, .buffer = result}, {.binding = 1, .buffer = to, .format = Format::rgba32_float}});
    CommandList list = device().create_command_list("copies");
    for (std::uint32_t i = 0; i < 2; ++i) {
        if (i == 1) list.copy_buffer(from, 0, to, 0, 16);
        list.set_pipeline(pipeline);
        list.set_bind_group(0, bound);
        list.set_push_constants(i);
        list.dispatch({});
    }
    run(std::move(list));
    EXPECT_EQ(read<float>(result), (std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8}));
}

TEST_P(TexelBuffers, ArraysOfThem) {
    const std::vector<float> values{1, 2, 3, 4, 5, 6, 7, 8};
    const Buffer first = buffer_of(std::span<const float>(values).first(4), BufferUsage::uniform_texel, "first");
    const Buffer second = buffer_of(std::span<const float>(values).last(4), BufferUsage::uniform_texel, "second");
    const auto found = evaluate<float>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { float result[]; };
        layout(set = 0, binding = 1) uniform samplerBuffer sources[2];
        void main() {
            for (int i = 0; i < 4; ++i) {
                result[i] = texelFetch(sources[0], i).x;
                result[4 + i] = texelFetch(sources[1], i).x;
            }
        }
    )",
                                       8,
                                       {{.binding = 1, .buffer = first, .format = Format::r32_float},
                                        {.binding = 1, .buffer = second, .element = 1, .format = Format::r32_float}});
    EXPECT_EQ(found, values);
}

TEST_P(TexelBuffers, WithoutASamplerInTheirType) {
    const std::vector<std::int32_t> values{-7, 40000, 3, 1 << 30};
    const Buffer source = elements_of(values, BufferUsage::uniform_texel, "values");
    const auto found = evaluate<std::int32_t>(R"(
        #extension GL_EXT_samplerless_texture_functions : require
        layout(local_size_x = 4) in;
        layout(set = 0, binding = 0) buffer Result { int result[]; };
        layout(set = 0, binding = 1) uniform itextureBuffer source;
        void main() {
            int i = int(gl_LocalInvocationID.x);
            result[i] = texelFetch(source, textureSize(source) - 1 - i).x;
        }
    )",
                                              4, {{.binding = 1, .buffer = source, .format = Format::r32_sint}});
    EXPECT_EQ(found, (std::vector<std::int32_t>{1 << 30, 3, 40000, -7}));
}

TEST_P(TexelBuffers, InVertexAndFragmentShaders) {
    // A square from four corners; its pixels take their colors from a row of elements.
    const std::vector<float> corners{-1, -1, 1, -1, -1, 1, 1, 1};
    std::vector<std::uint8_t> colors(8 * 4);
    for (std::size_t i = 0; i < colors.size(); ++i) colors[i] = static_cast<std::uint8_t>(i * 8 + 3);
    const Buffer positions = elements_of(corners, BufferUsage::uniform_texel, "corners");
    const Buffer palette = elements_of(colors, BufferUsage::uniform_texel, "palette");
    const Texture picture = target(Format::rgba8_unorm, 8, 2);
    const GraphicsPipeline pipeline =
        ok(device().create_graphics_pipeline({.vertex = shader(ShaderStage::vertex, R"(
            layout(set = 0, binding = 0) uniform samplerBuffer corners;
            void main() { gl_Position = vec4(texelFetch(corners, gl_VertexIndex).xy, 0.0, 1.0); })"),
                                              .fragment = shader(ShaderStage::fragment, R"(
            layout(set = 0, binding = 1) uniform samplerBuffer palette;
            layout(location = 0) out vec4 color;
            void main() { color = texelFetch(palette, int(gl_FragCoord.x)); })"),
                                              .topology = Topology::triangle_strip,
                                              .color_targets = {{.format = Format::rgba8_unorm}}}));
    CommandList list = device().create_command_list("square");
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group(pipeline, {{.binding = 0, .buffer = positions, .format = Format::rg32_float},
                                            {.binding = 1, .buffer = palette, .format = Format::rgba8_unorm}}));
    list.draw({.vertex_count = 4});
    list.end_render_pass();
    run(std::move(list));
    auto expected = colors;
    expected.insert(expected.end(), colors.begin(), colors.end());
    EXPECT_EQ(read<std::uint8_t>(picture), expected);
}

TEST_P(TexelBuffers, UploadMemoryCanBeRead) {
    const Buffer source = buffer(16, BufferUsage::uniform_texel, "upload", MemoryKind::upload);
    const std::array<float, 4> values{0.5f, -2, 1e20f, 0};
    std::memcpy(ok(device().map(source)).data(), values.data(), 16);
    ok(device().unmap(source));
    const auto found = evaluate<float>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { vec4 result; };
        layout(set = 0, binding = 1) uniform samplerBuffer source;
        void main() { result = texelFetch(source, 0); }
    )",
                                       4, {{.binding = 1, .buffer = source, .format = Format::rgba32_float}});
    EXPECT_EQ(found, std::vector<float>(values.begin(), values.end()));
}

TEST_P(TexelBuffers, WrongBindingsAreRefused) {
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0, r32ui) uniform uimageBuffer words;
        void main() { imageStore(words, 0, uvec4(1u)); }
    )");
    const Buffer words = buffer(64, BufferUsage::storage_texel, "words");
    const auto layout = ok(device().bind_group_layout(pipeline, 0));
    const auto expect_refused = [&](const BindGroupEntry& entry, const char* part) {
        const auto made = device().create_bind_group({.layout = layout, .entries = {entry}});
        ASSERT_FALSE(made);
        EXPECT_NE(made.error().message().find(part), std::string::npos) << made.error().message();
    };
    expect_message("N-3");
    expect_refused({.binding = 0, .buffer = words}, "expected a format");
    expect_refused({.binding = 0, .buffer = words, .format = Format::bc1_rgba_unorm}, "bc1_rgba_unorm");
    expect_refused({.binding = 0, .buffer = words, .size = 6, .format = Format::r32_uint}, "whole number of elements");
    expect_refused({.binding = 0, .buffer = words, .offset = 64, .format = Format::r32_uint}, "offset below");
    expect_refused({.binding = 0, .buffer = buffer(64, BufferUsage::storage), .format = Format::r32_uint},
                   "storage_texel");
}

BACKEND_SUITE(TexelBufferSupport);

TEST_P(TexelBufferSupport, WithoutThemErrorsSaySo) {
    if (capabilities().texel_buffers) GTEST_SKIP() << "the device has texel buffers";
    expect_message("N-");
    const auto made = device().create_buffer({.size = 64, .usage = BufferUsage::uniform_texel, .name = "elements"});
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().code, ErrorCode::unsupported);
    EXPECT_NE(made.error().message().find("texel_buffers"), std::string::npos) << made.error().message();
    const auto shader = device().create_shader(compile(ShaderStage::compute, R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0, r32ui) uniform uimageBuffer words;
        void main() { imageStore(words, 0, uvec4(1u)); }
    )"));
    ASSERT_FALSE(shader);
    EXPECT_EQ(shader.error().code, ErrorCode::unsupported);
    EXPECT_NE(shader.error().message().find("texel_buffers"), std::string::npos) << shader.error().message();
    for (std::uint32_t i = 1; i < format_count; ++i)
        EXPECT_FALSE(supports(static_cast<Format>(i), FormatSupport::uniform_texel_buffer)) << i;
}

}  // namespace
}  // namespace nacre::test
