// SPDX-License-Identifier: Apache-2.0
// Compute shaders that go over pictures: what they fetch and store of layouts that compiled code knows, in workgroups
// whose lanes are rows of pixels and in others, at the borders of the picture and where only some lanes run.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <ostream>
#include <string>
#include <tuple>
#include <vector>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::cpu {
namespace {

constexpr std::int32_t width = 21, height = 13;
constexpr std::int32_t first_x = -3, first_y = -2, columns = 48, rows = 48;  // Of the invocations.

struct Layout {
    const char* name;
    rhi::Format format;
    const char* qualifier;
    bool is_integer;
    std::uint32_t bytes;
};
constexpr Layout word_float{"r32_float", rhi::Format::r32_float, "r32f", false, 4},
    word_integer{"r32_uint", rhi::Format::r32_uint, "r32ui", true, 4},
    halves{"rgba16_float", rhi::Format::rgba16_float, "rgba16f", false, 8},
    bytes{"rgba8_unorm", rhi::Format::rgba8_unorm, "rgba8", false, 4},
    floats{"rgba32_float", rhi::Format::rgba32_float, "rgba32f", false, 16};

/// Channel c of texel (x, y): halves hold it exactly where they are the source.
double source_value(const Layout& layout, std::int32_t x, std::int32_t y, int c) {
    const std::int32_t number = 1 + x + width * y;
    if (layout.is_integer) return c == 0 ? number * 1000003 : c == 3 ? 1 : 0;
    if (layout.format == rhi::Format::r32_float) return c == 0 ? number / 3.0f : c == 3 ? 1 : 0;
    if (layout.format == rhi::Format::rgba16_float) return (c % 2 == 1 ? -0.25 : 0.5) * (number + c);
    if (layout.format == rhi::Format::rgba8_unorm) return static_cast<float>((number * 7 + c) % 256) / 255.0f;
    switch ((number + c) % 5) {
        case 0: return std::numeric_limits<double>::quiet_NaN();
        case 1: return static_cast<float>(number) + 0.1f * static_cast<float>(c);
        case 2: return -0.3f;
        // Codes and what lies in the middle of two.
        case 3: return static_cast<float>(number % 255 + 0.5) / 255.0f;
        default: return std::ldexp(static_cast<float>(number % 255), -8);
    }
}

double nearest_half(double value) {
    if (value == 0 || std::isnan(value)) return value;
    const double unit = std::ldexp(1.0, std::max(std::ilogb(value), -14) - 10);
    return std::nearbyint(value / unit) * unit;
}
double value_of_half(std::uint16_t half) {
    const int exponent = half >> 10 & 31, mantissa = half & 1023;
    if (exponent == 31) return std::numeric_limits<double>::quiet_NaN();
    const double size = exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
    return half >> 15 ? -size : size;
}

/// What storing a value leaves, as the number that is read back; the first channel of words.
double stored_value(const Layout& layout, double value) {
    if (layout.format == rhi::Format::rgba16_float) return nearest_half(value);
    if (layout.format == rhi::Format::rgba8_unorm)
        return std::isnan(value) ? 0 : std::nearbyint(std::min(std::max(value, 0.0), 1.0) * 255.0);
    return value;
}
double read_value(const Layout& layout, const std::byte* texel, int c) {
    if (layout.bytes == 4 && layout.format != rhi::Format::rgba8_unorm) {
        std::uint32_t word;
        float number;
        std::memcpy(&word, texel, 4), std::memcpy(&number, texel, 4);
        return layout.is_integer ? static_cast<double>(static_cast<std::int32_t>(word)) : number;
    }
    if (layout.format == rhi::Format::rgba8_unorm) return static_cast<double>(texel[c]);
    std::uint16_t half;
    std::memcpy(&half, texel + 2 * c, 2);
    return value_of_half(half);
}

std::vector<std::byte> source_texels(const Layout& layout) {
    std::vector<std::byte> texels(std::size_t{layout.bytes} * width * height);
    const int channels = layout.bytes == 4 && layout.format != rhi::Format::rgba8_unorm ? 1 : 4;
    const std::size_t size = layout.bytes / static_cast<std::size_t>(channels);
    for (std::int32_t i = 0; i < width * height; ++i)
        for (int c = 0; c < channels; ++c) {
            const double value = source_value(layout, i % width, i / width, c);
            std::byte* const to =
                texels.data() + static_cast<std::size_t>(i) * layout.bytes + static_cast<std::size_t>(c) * size;
            const auto number = static_cast<float>(value);
            const auto integer = static_cast<std::int32_t>(layout.is_integer ? value : 0);
            if (layout.is_integer) {
                std::memcpy(to, &integer, 4);
            } else if (size == 4) {
                std::memcpy(to, &number, 4);
            } else if (size == 1) {
                *to = static_cast<std::byte>(std::lround(value * 255));
            } else {
                const int exponent = std::ilogb(value);
                const auto half = static_cast<std::uint16_t>(
                    (value < 0 ? 0x8000 : 0) + ((exponent + 15) << 10) +
                    static_cast<int>(std::ldexp(std::abs(value), 10 - exponent)) - 1024);
                std::memcpy(to, &half, 2);
            }
        }
    return texels;
}

struct Group {
    const char* name;
    int x, y;
};
void PrintTo(const Group& group, std::ostream* out) { *out << group.name; }
struct Ways {
    Layout from, to;
};
void PrintTo(const Ways& ways, std::ostream* out) { *out << ways.from.name << "_to_" << ways.to.name; }

class TexelRows : public testing::TestWithParam<std::tuple<const char*, Group, Ways>> {};

TEST_P(TexelRows, AreFetchedAndStored) {
    const auto& [spec, size, ways] = GetParam();
    const auto& [from, to] = ways;
    rhi::Instance instance(all_backends());
    auto device = instance.create_device({.backend = spec});
    ASSERT_TRUE(device) << device.error().message();
    const auto make_texture = [&](const Layout& layout, rhi::TextureUsage usage,
                                  const std::vector<std::byte>& content) {
        const auto made = (*device)->create_texture(
            {.format = layout.format,
             .width = width,
             .height = height,
             .usage = usage | rhi::TextureUsage::copy_destination | rhi::TextureUsage::copy_source,
             .name = layout.name});
        EXPECT_TRUE(made && (*device)->write_texture(*made, content));
        return *made;
    };
    const rhi::Texture source = make_texture(from, rhi::TextureUsage::sampled, source_texels(from));
    const auto sampler = (*device)->create_sampler(
        {.magnify = rhi::Filter::nearest, .minify = rhi::Filter::nearest, .mip = rhi::Filter::nearest});
    const std::vector<std::byte> before(std::size_t{to.bytes} * width * height, std::byte{0x3c});
    struct Condition {
        const char* glsl;
        bool (*holds)(std::int32_t, std::int32_t);
    };
    const Condition conditions[] = {
        {"", [](std::int32_t, std::int32_t) { return true; }},
        {"if (any(greaterThanEqual(pixel, ivec2(17, 11)))) return;",
         [](std::int32_t x, std::int32_t y) { return x < 17 && y < 11; }},
        {"if ((pixel.x * 3 + pixel.y) % 5 == 0) return;",
         [](std::int32_t x, std::int32_t y) { return (x * 3 + y) % 5 != 0; }}};
    for (const Condition& condition : conditions) {
        const std::string kind = from.is_integer ? "u" : "";
        const std::string text = "layout(local_size_x = " + std::to_string(size.x) +
                                 ", local_size_y = " + std::to_string(size.y) + R"() in;
            layout(set = 0, binding = 0) uniform )" +
                                 kind + R"(sampler2D source;
            layout(set = 0, binding = 1, )" +
                                 to.qualifier + ") uniform writeonly " + kind + R"(image2D to;
            void main() {
                ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(-3, -2);
                )" + condition.glsl +
                                 "\n" + kind + R"(vec4 texel = texelFetch(source, pixel, 0);
                imageStore(to, pixel + ivec2(1, 0), )" +
                                 (to.bytes == 4 && to.format != bytes.format ? "texel" : "texel.wxzy") + R"();
            })";
        rhi::ShaderCompiler compiler({});
        auto words = compiler.compile({.path = "rows.comp", .text = text});
        ASSERT_TRUE(words) << words.error().message();
        const auto shader = (*device)->create_shader(*words);
        const auto pipeline = (*device)->create_compute_pipeline({.shader = *shader, .name = "rows"});
        ASSERT_TRUE(pipeline) << pipeline.error().message();
        const rhi::Texture destination = make_texture(to, rhi::TextureUsage::storage, before);
        const auto layout = (*device)->bind_group_layout(*pipeline, 0);
        const auto group =
            (*device)->create_bind_group({.layout = *layout,
                                          .entries = {{.binding = 0, .texture = source, .sampler = *sampler},
                                                      {.binding = 1, .texture = destination}},
                                          .name = "rows"});
        ASSERT_TRUE(group) << group.error().message();
        rhi::CommandList list = (*device)->create_command_list("rows");
        list.set_pipeline(*pipeline);
        list.set_bind_group(0, *group);
        list.dispatch(
            {.x = static_cast<std::uint32_t>(columns / size.x), .y = static_cast<std::uint32_t>(rows / size.y)});
        ASSERT_TRUE((*device)->submit(std::move(list)));
        const auto found = (*device)->read_texture(destination);
        ASSERT_TRUE(found) << found.error().message();
        const bool is_word = to.bytes == 4 && to.format != bytes.format;
        for (std::int32_t y = 0; y < height; ++y)
            for (std::int32_t x = 0; x < width; ++x) {
                // Of the pixel to the left, which may lie outside.
                const bool is_stored = condition.holds(x - 1, y);
                for (int c = 0; c < (is_word ? 1 : 4); ++c) {
                    const std::size_t place = static_cast<std::size_t>(y * width + x) * to.bytes;
                    double expected = read_value(to, before.data() + place, c);
                    if (is_stored) {
                        const int channel = is_word ? c : (c == 0 ? 3 : c == 1 ? 0 : c == 3 ? 1 : 2);
                        expected = stored_value(to, x == 0 ? 0.0 : source_value(from, x - 1, y, channel));
                    }
                    const double value = read_value(to, found->data() + place, c);
                    ASSERT_TRUE(value == expected || (std::isnan(value) && std::isnan(expected)))
                        << "x " << x << " y " << y << " channel " << c << ": " << value << " for " << expected
                        << " where " << condition.glsl;
                }
            }
    }
}

INSTANTIATE_TEST_SUITE_P(
    Lanes, TexelRows,
    testing::Combine(testing::Values("cpu:consistent", "cpu:fast:lanes=8", "cpu:fast:lanes=4"),
                     testing::Values(Group{"square", 8, 8}, Group{"line", 16, 2}, Group{"odd", 6, 6}),
                     testing::Values(Ways{word_float, word_float}, Ways{word_integer, word_integer},
                                     Ways{halves, halves}, Ways{floats, halves}, Ways{floats, bytes},
                                     Ways{halves, bytes}, Ways{bytes, halves})));

}  // namespace
}  // namespace nacre::cpu
