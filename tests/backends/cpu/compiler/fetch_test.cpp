// SPDX-License-Identifier: Apache-2.0
// texelFetch of textures of one word or two integers, which compiled code reads without a call, and of others, for
// which it makes one: inside of the texture the texel, everywhere else zero.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::cpu {
namespace {

constexpr std::int32_t width = 5, height = 3, layers = 2, mips = 2;
// Coordinates from two below to two above what is there.
constexpr std::int32_t columns = width + 4, rows = height + 4, slices = layers + 4, levels = mips + 4;
constexpr std::int32_t points = columns * rows * slices;

struct Content {
    const char* name;
    rhi::Format format;
    bool is_integer;
    int channels;
};
constexpr Content contents[] = {{"r32_uint", rhi::Format::r32_uint, true, 1},
                                {"r32_float", rhi::Format::r32_float, false, 1},
                                {"rg32_uint", rhi::Format::rg32_uint, true, 2},
                                {"rgba32_uint", rhi::Format::rgba32_uint, true, 4}};

std::uint32_t texel_value(std::int32_t x, std::int32_t y, std::int32_t layer, std::int32_t mip, int channel) {
    return static_cast<std::uint32_t>(1 + x + 10 * y + 100 * layer + 1000 * mip + 10000 * channel);
}

std::array<std::uint32_t, 4> expected_texel(const Content& content, std::int32_t x, std::int32_t y, std::int32_t layer,
                                            std::int32_t level) {
    std::array<std::uint32_t, 4> texel{};
    if (level < 0 || level >= mips || x < 0 || x >= width >> level || y < 0 || y >= std::max(height >> level, 1) ||
        layer < 0 || layer >= layers)
        return texel;
    for (int channel = 0; channel < content.channels; ++channel)
        texel[static_cast<std::size_t>(channel)] = texel_value(x, y, layer, level, channel);
    if (content.channels < 4) texel[3] = 1;
    return texel;
}

Expected<rhi::Texture> make_texture(rhi::Device& device, const Content& content) {
    NACRE_TRY(const rhi::Texture texture,
              device.create_texture({.format = content.format,
                                     .width = width,
                                     .height = height,
                                     .layers = layers,
                                     .mips = mips,
                                     .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::copy_destination,
                                     .name = "texels"}));
    for (std::int32_t mip = 0; mip < mips; ++mip)
        for (std::int32_t layer = 0; layer < layers; ++layer) {
            std::vector<std::uint32_t> texels;
            for (std::int32_t y = 0; y < std::max(height >> mip, 1); ++y)
                for (std::int32_t x = 0; x < width >> mip; ++x)
                    for (int channel = 0; channel < content.channels; ++channel) {
                        const std::uint32_t value = texel_value(x, y, layer, mip, channel);
                        const auto number = static_cast<float>(value);
                        std::uint32_t bits = value;
                        if (!content.is_integer) std::memcpy(&bits, &number, 4);
                        texels.push_back(bits);
                    }
            NACRE_CHECK(device.write_texture(texture, std::as_bytes(std::span(texels)), static_cast<std::uint32_t>(mip),
                                                 static_cast<std::uint32_t>(layer)));
        }
    return texture;
}

class Fetch : public testing::TestWithParam<std::tuple<const char*, Content, bool>> {};

TEST_P(Fetch, GivesTexelsInsideAndZeroOutside) {
    const auto& [spec, content, is_divergent] = GetParam();
    const std::string text = std::string(R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) uniform )") +
                             (content.is_integer ? "usampler2DArray" : "sampler2DArray") + R"( source;
        layout(set = 0, binding = 1, std430) writeonly buffer Result { uvec4 result[]; };
        layout(push_constant) uniform Parameters { int level; };
        void main() {
            int point = int(gl_GlobalInvocationID.x);
            if (point >= )" + std::to_string(points) +
                             R"() return;
            int x = point % )" +
                             std::to_string(columns) + " - 2, y = point / " + std::to_string(columns) + " % " +
                             std::to_string(rows) + " - 2, layer = point / " + std::to_string(columns * rows) + R"( - 2;
            result[point] = uvec4(texelFetch(source, ivec3(x, y, layer), )" +
                             // The same level in all lanes, or one that only looks as if lanes could differ.
                             (is_divergent ? "level + (x > 1000 ? 1 : 0)" : "level") + "));\n}\n";
    rhi::Instance instance(all_backends());
    auto device = instance.create_device({.backend = spec});
    ASSERT_TRUE(device) << device.error().message();
    rhi::ShaderCompiler compiler({});
    auto words = compiler.compile({.path = "fetch.comp", .text = text});
    ASSERT_TRUE(words) << words.error().message();
    const auto shader = (*device)->create_shader(*words);
    const auto pipeline = (*device)->create_compute_pipeline({.shader = *shader, .name = "fetch"});
    ASSERT_TRUE(pipeline) << pipeline.error().message();
    const auto texture = make_texture(**device, content);
    ASSERT_TRUE(texture) << texture.error().message();
    const auto sampler = (*device)->create_sampler(
        {.magnify = rhi::Filter::nearest, .minify = rhi::Filter::nearest, .mip = rhi::Filter::nearest});
    const auto result = (*device)->create_buffer({.size = points * 16, .usage = rhi::BufferUsage::storage});
    const auto layout = (*device)->bind_group_layout(*pipeline, 0);
    rhi::TextureView view(*texture);
    view.dimension = rhi::ViewDimension::d2_array;
    const auto group = (*device)->create_bind_group(
        {.layout = *layout,
         .entries = {{.binding = 0, .texture = view, .sampler = *sampler}, {.binding = 1, .buffer = *result}},
         .name = "fetch"});
    ASSERT_TRUE(group) << group.error().message();
    for (std::int32_t level = -2; level < levels - 2; ++level) {
        rhi::CommandList list = (*device)->create_command_list("fetch");
        list.set_pipeline(*pipeline);
        list.set_bind_group(0, *group);
        list.set_push_constants(level);
        list.dispatch({.x = (points + 63) / 64});
        ASSERT_TRUE((*device)->submit(std::move(list)));
        const auto bytes = (*device)->read_buffer(*result);
        ASSERT_TRUE(bytes) << bytes.error().message();
        for (std::int32_t point = 0; point < points; ++point) {
            const std::int32_t x = point % columns - 2, y = point / columns % rows - 2,
                               layer = point / (columns * rows) - 2;
            const auto expected = expected_texel(content, x, y, layer, level);
            std::uint32_t found[4];
            std::memcpy(found, bytes->data() + point * 16, 16);
            for (int channel = 0; channel < 4; ++channel)
                ASSERT_EQ(found[channel], expected[channel])
                    << "x " << x << " y " << y << " layer " << layer << " level " << level << " channel " << channel;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Lanes, Fetch,
                         testing::Combine(testing::Values("cpu:consistent", "cpu:fast:lanes=8", "cpu:fast:lanes=4"),
                                          testing::ValuesIn(contents), testing::Bool()));

class FetchInFragments : public testing::TestWithParam<std::tuple<const char*, Content, bool>> {};

// Arguments that are the same for a whole draw: such texels are read ahead of its fragments.
TEST_P(FetchInFragments, GivesTheTexelOfTheDraw) {
    const auto& [spec, content, is_array] = GetParam();
    const std::string text = std::string("layout(set = 0, binding = 0) uniform ") + (content.is_integer ? "u" : "") +
                             (is_array ? "sampler2DArray" : "sampler2D") + R"( source;
        layout(push_constant) uniform Parameters { ivec4 at; };
        layout(location = 0) out uvec4 texel;
        void main() { texel = uvec4(texelFetch(source, at.)" +
                             (is_array ? "xyz" : "xy") + ", at.w)); }\n";
    rhi::Instance instance(all_backends());
    auto device = instance.create_device({.backend = spec});
    ASSERT_TRUE(device) << device.error().message();
    rhi::ShaderCompiler compiler({});
    const auto vertex = compiler.compile({.path = "all.vert", .text = R"(
        void main() { gl_Position = vec4(vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0, 0.0, 1.0); })"});
    ASSERT_TRUE(vertex) << vertex.error().message();
    const auto fragment = compiler.compile({.path = "fetch.frag", .text = text});
    ASSERT_TRUE(fragment) << fragment.error().message();
    const auto pipeline = (*device)->create_graphics_pipeline({.vertex = *(*device)->create_shader(*vertex),
                                                               .fragment = *(*device)->create_shader(*fragment),
                                                               .color_targets = {{.format = rhi::Format::rgba32_uint}},
                                                               .name = "fetch"});
    ASSERT_TRUE(pipeline) << pipeline.error().message();
    const auto texture = make_texture(**device, content);
    ASSERT_TRUE(texture) << texture.error().message();
    const auto sampler = (*device)->create_sampler(
        {.magnify = rhi::Filter::nearest, .minify = rhi::Filter::nearest, .mip = rhi::Filter::nearest});
    const auto layout = (*device)->bind_group_layout(*pipeline, 0);
    rhi::TextureView view(*texture);
    view.dimension = is_array ? rhi::ViewDimension::d2_array : rhi::ViewDimension::d2;
    view.layer_count = is_array ? layers : 1;
    const auto group = (*device)->create_bind_group(
        {.layout = *layout, .entries = {{.binding = 0, .texture = view, .sampler = *sampler}}, .name = "fetch"});
    ASSERT_TRUE(group) << group.error().message();
    const auto target =
        (*device)->create_texture({.format = rhi::Format::rgba32_uint, .width = points, .height = levels,
                                   .usage = rhi::TextureUsage::color_target | rhi::TextureUsage::copy_source});
    ASSERT_TRUE(target) << target.error().message();
    const auto place_of = [&](std::int32_t point) {
        return std::array{point % columns - 2, point / columns % rows - 2, is_array ? point / (columns * rows) - 2 : 0};
    };
    rhi::CommandList list = (*device)->create_command_list("fetch");
    list.begin_render_pass({.color = {{.view = *target, .load = rhi::LoadOperation::clear}}});
    list.set_pipeline(*pipeline);
    list.set_bind_group(0, *group);
    for (std::int32_t row = 0; row < levels; ++row)
        for (std::int32_t point = 0; point < points; ++point) {
            const auto [x, y, layer] = place_of(point);
            list.set_push_constants(std::array{x, y, layer, row - 2});
            list.set_scissor({.x = static_cast<std::uint32_t>(point),
                              .y = static_cast<std::uint32_t>(row),
                              .width = 1,
                              .height = 1});
            list.draw({.vertex_count = 3});
        }
    list.end_render_pass();
    ASSERT_TRUE((*device)->submit(std::move(list)));
    const auto bytes = (*device)->read_texture(*target);
    ASSERT_TRUE(bytes) << bytes.error().message();
    for (std::int32_t row = 0; row < levels; ++row)
        for (std::int32_t point = 0; point < points; ++point) {
            const auto [x, y, layer] = place_of(point);
            std::array<std::uint32_t, 4> found{};
            std::memcpy(found.data(), bytes->data() + (row * points + point) * 16, 16);
            ASSERT_EQ(found, expected_texel(content, x, y, layer, row - 2))
                << "x " << x << " y " << y << " layer " << layer << " level " << row - 2;
        }
}

INSTANTIATE_TEST_SUITE_P(Lanes, FetchInFragments,
                         testing::Combine(testing::Values("cpu:consistent", "cpu:fast:lanes=8", "cpu:fast:lanes=4"),
                                          testing::ValuesIn(contents), testing::Bool()));

}  // namespace
}  // namespace nacre::cpu
