// SPDX-License-Identifier: Apache-2.0
// texelFetch of textures of single words, which compiled code reads without a call, and of others, for which it makes one:
// inside of the texture the texel, everywhere else zero.
#include <algorithm>
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
                                {"rg32_uint", rhi::Format::rg32_uint, true, 2}};

std::uint32_t texel_value(std::int32_t x, std::int32_t y, std::int32_t layer, std::int32_t mip, int channel) {
    return static_cast<std::uint32_t>(1 + x + 10 * y + 100 * layer + 1000 * mip + 10000 * channel);
}

class Fetch : public testing::TestWithParam<std::tuple<const char*, Content, bool>> {};

TEST_P(Fetch, GivesTexelsInsideAndZeroOutside) {
    const auto& [spec, content, is_divergent] = GetParam();
    const std::string text = std::string(R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) uniform )") + (content.is_integer ? "usampler2DArray" : "sampler2DArray") + R"( source;
        layout(set = 0, binding = 1, std430) writeonly buffer Result { uvec4 result[]; };
        layout(push_constant) uniform Parameters { int level; };
        void main() {
            int point = int(gl_GlobalInvocationID.x);
            if (point >= )" + std::to_string(points) + R"() return;
            int x = point % )" + std::to_string(columns) + " - 2, y = point / " + std::to_string(columns) + " % " +
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
    const auto texture =
        (*device)->create_texture({.format = content.format, .width = width, .height = height, .layers = layers, .mips = mips,
                                   .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::copy_destination, .name = "texels"});
    ASSERT_TRUE(texture) << texture.error().message();
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
            ASSERT_TRUE((*device)->write_texture(*texture, std::as_bytes(std::span(texels)), static_cast<std::uint32_t>(mip),
                                                 static_cast<std::uint32_t>(layer)));
        }
    const auto sampler = (*device)->create_sampler({.magnify = rhi::Filter::nearest, .minify = rhi::Filter::nearest, .mip = rhi::Filter::nearest});
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
            const std::int32_t x = point % columns - 2, y = point / columns % rows - 2, layer = point / (columns * rows) - 2;
            std::uint32_t expected[4] = {}, found[4];
            if (level >= 0 && level < mips && x >= 0 && x < width >> level && y >= 0 && y < std::max(height >> level, 1) &&
                layer >= 0 && layer < layers) {
                for (int channel = 0; channel < content.channels; ++channel)
                    expected[channel] = texel_value(x, y, layer, level, channel);
                expected[3] = 1;
            }
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

}  // namespace
}  // namespace nacre::cpu
