// SPDX-License-Identifier: Apache-2.0
// What each format means: as a sampled texture, as a color target and as a vertex attribute, against a decoder of our
// own.
#include "tests/rhi/backend_test.h"
#include "tests/rhi/texel_values.h"

#include <random>

namespace nacre::test {
namespace {

using namespace rhi;

std::string_view prefix(FormatKind kind) {
    return kind == FormatKind::uint ? "u" : kind == FormatKind::sint ? "i" : "";
}

std::vector<Format> formats_with(const Capabilities& capabilities, FormatSupport what) {
    std::vector<Format> result;
    for (std::uint32_t i = 1; i < format_count; ++i) {
        const auto format = static_cast<Format>(i);
        if (capabilities.supports(format, what) && !info(format).is_depth_stencil() && !info(format).is_compressed())
            result.push_back(format);
    }
    return result;
}

/// Random texels, without NaN and infinity in float formats.
std::vector<std::byte> random_texels(Format format, std::size_t count, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::vector<std::byte> bytes(count * info(format).block_bytes);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
    if (info(format).kind != FormatKind::floating) return bytes;
    const bool is_packed = format == Format::rg11b10_float || format == Format::rgb9e5_float;
    const std::size_t width = is_packed ? 4 : info(format).block_bytes / info(format).channels;
    for (std::size_t i = 0; i + width <= bytes.size(); i += width) {
        std::uint32_t word = 0;
        std::memcpy(&word, &bytes[i], width);
        if (format == Format::rg11b10_float) word &= ~(1u << 10 | 1u << 21 | 1u << 31);  // Exponents below 16.
        else if (width == 2) word &= 0xbfff;
        else if (width == 4 && !is_packed) word = (word & 0x807fffffu) | (100 + word % 50) << 23;
        std::memcpy(&bytes[i], &word, width);
    }
    return bytes;
}

class Formats : public BackendTest {
  public:
    static std::string title(Format format) { return std::string(info(format).name); }

    void expect_near(const TexelValue& expected, std::span<const std::uint32_t> found, FormatKind kind, int channels,
                     double steps, const std::string& where) {
        for (int c = 0; c < channels; ++c) {
            const auto i = static_cast<std::size_t>(c);
            float number = 0;
            std::memcpy(&number, &found[i], 4);
            const double value = kind == FormatKind::uint   ? static_cast<double>(found[i])
                                 : kind == FormatKind::sint ? static_cast<double>(static_cast<std::int32_t>(found[i]))
                                                            : static_cast<double>(number);
            ASSERT_NEAR(value, expected.channels[i], expected.step[i] * steps) << where << ", channel " << c;
        }
    }
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Formats);
INSTANTIATE_TEST_SUITE_P(Rhi, Formats, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

TEST_P(Formats, SampledTexelsMeanWhatTheyShould) {
    constexpr std::uint32_t width = 16, height = 4;
    for (const Format format : formats_with(capabilities(), FormatSupport::sampled)) {
        const std::string p(prefix(info(format).kind));
        const auto texels = random_texels(format, width * height, static_cast<std::uint32_t>(format));
        const Texture texture =
            ok(device().create_texture({.format = format,
                                        .width = width,
                                        .height = height,
                                        .usage = TextureUsage::sampled | TextureUsage::copy_destination,
                                        .name = title(format)}));
        ok(device().write_texture(texture, texels));
        const bool is_integer = info(format).is_integer();
        const ComputePipeline pipeline = compute(
            "layout(local_size_x = 16, local_size_y = 4) in;\n"
            "layout(set = 0, binding = 0) uniform " +
                p +
                "sampler2D source;\n"
                "layout(set = 0, binding = 1) buffer Results { uvec4 results[]; };\n"
                "void main() {\n"
                "    ivec2 at = ivec2(gl_LocalInvocationID.xy);\n"
                "    results[at.y * 16 + at.x] = " +
                (is_integer ? "uvec4(" : "floatBitsToUint(") +
                "texelFetch(source, at, 0));\n"
                "}",
            {}, title(format));
        const Buffer results = buffer(width * height * 16, BufferUsage::storage);
        const Sampler sampler = ok(device().create_sampler(
            {.magnify = Filter::nearest, .minify = Filter::nearest, .mip = Filter::nearest}));
        const BindGroup group = ok(device().create_bind_group(
            {.layout = ok(device().bind_group_layout(pipeline, 0)),
             .entries = {{.binding = 0, .texture = texture, .sampler = sampler}, {.binding = 1, .buffer = results}}}));
        CommandList list = device().create_command_list(title(format));
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group);
        list.dispatch({});
        run(std::move(list));
        const auto found = read<std::array<std::uint32_t, 4>>(results);
        const std::size_t bytes = info(format).block_bytes;
        for (std::size_t i = 0; i < found.size(); ++i)
            // Normalized numbers become floats by a division that may be off by a little; sRGB by a table or a curve.
            expect_near(decode_texel(format, std::span(texels).subspan(i * bytes, bytes)), found[i], info(format).kind,
                        4, info(format).kind == FormatKind::srgb ? 0.5 : 0.02,
                        title(format) + " texel " + std::to_string(i));
        device().destroy(texture);
        device().destroy(results);
    }
}

TEST_P(Formats, ColorTargetsKeepWhatIsDrawn) {
    for (const Format format : formats_with(capabilities(), FormatSupport::color_target)) {
        const FormatKind kind = info(format).kind;
        const std::string p(prefix(kind));
        // Beyond what unorm can hold where the format can; integers that fill their 8 bits.
        std::array<double, 4> drawn{0.25, 0.5, 0.75, 0.9};
        if (kind == FormatKind::snorm) drawn = {-0.25, 0.5, -0.75, 0.9};
        if (kind == FormatKind::floating) drawn = {0.25, 3.5, 0.75, 0.9};
        if (kind == FormatKind::uint) drawn = {250, 3, 127, 2};
        if (kind == FormatKind::sint) drawn = {-120, 3, 127, -2};
        std::string values;
        for (const double value : drawn) values += (values.empty() ? "" : ", ") + std::to_string(value);
        const Texture picture = ok(device().create_texture(
            {.format = format, .width = 3, .height = 2, .usage = TextureUsage::color_target | TextureUsage::copy_source,
             .name = title(format)}));
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(
            {.vertex = shader(ShaderStage::vertex, fullscreen_vertex),
             .fragment = shader(ShaderStage::fragment, "layout(location = 0) out " + p +
                                                           "vec4 color;\nvoid main() { color = " + p + "vec4(" +
                                                           values + "); }"),
             .color_targets = {{.format = format}},
             .name = title(format)}));
        CommandList list = device().create_command_list(title(format));
        list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}, .name = title(format)});
        list.set_scissor({.x = 0, .y = 0, .width = 3, .height = 1});
        list.set_pipeline(pipeline);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        const auto texels = ok(device().read_texture(picture));
        const std::size_t bytes = info(format).block_bytes;
        ASSERT_EQ(texels.size(), bytes * 6);
        for (std::size_t texel = 0; texel < 6; ++texel) {
            const TexelValue found = decode_texel(format, std::span(texels).subspan(texel * bytes, bytes));
            for (std::size_t c = 0; c < info(format).channels; ++c) {
                const double expected = texel < 3 ? drawn[c] : 0.0;
                EXPECT_NEAR(found.channels[c], expected, found.step[c] * 1.01 + 1e-7)
                    << title(format) << " texel " << texel << " channel " << c;
            }
        }
        device().destroy(picture);
        device().destroy(pipeline);
    }
}

TEST_P(Formats, VertexAttributesMeanWhatTheyShould) {
    SKIP_WITHOUT(supports(Format::rgba32_uint, FormatSupport::color_target));
    const Texture picture = target(Format::rgba32_uint, 4, 1);
    for (const Format format : formats_with(capabilities(), FormatSupport::vertex)) {
        const std::string p(prefix(info(format).kind));
        const bool is_integer = info(format).is_integer();
        const std::size_t bytes = info(format).block_bytes;
        // One value for each instance, behind an offset, at a stride that is not the size.
        const std::uint32_t offset = 8, stride = 24;
        constexpr std::size_t count = 4;
        const auto values = random_texels(format, count, static_cast<std::uint32_t>(format) + 100);
        std::vector<std::byte> content(offset + stride * count);
        for (std::size_t i = 0; i < count; ++i)
            std::memcpy(content.data() + offset + i * stride, values.data() + i * bytes, bytes);
        const Buffer attributes = buffer_of(std::span<const std::byte>(content), BufferUsage::vertex, title(format));
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(
            {.vertex = shader(ShaderStage::vertex, "layout(location = 5) in " + p + R"(vec4 value;
                layout(location = 0) flat out uvec4 bits;
                void main() {
                    // A column of the picture for each instance.
                    vec2 corner = vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2) * 0.5;
                    gl_Position = vec4((float(gl_InstanceIndex) + corner.x * 2.0) * 0.5 - 1.0, corner.y * 4.0 - 1.0, 0, 1);
                    bits = )" + (is_integer ? "uvec4(value);" : "floatBitsToUint(value);") +
                                                       "\n}"),
             .fragment = shader(ShaderStage::fragment, R"(
                layout(location = 0) flat in uvec4 bits;
                layout(location = 0) out uvec4 color;
                void main() { color = bits; })"),
             .vertex_buffers = {{.stride = stride, .per_instance = true}},
             .vertex_attributes = {{.location = 5, .buffer = 0, .offset = offset, .format = format}},
             .color_targets = {{.format = Format::rgba32_uint}},
             .name = title(format)}));
        CommandList list = device().create_command_list(title(format));
        list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}, .name = title(format)});
        list.set_pipeline(pipeline);
        list.set_vertex_buffer(0, attributes);
        list.draw({.vertex_count = 3, .instance_count = count});
        list.end_render_pass();
        run(std::move(list));
        const auto found = read<std::array<std::uint32_t, 4>>(picture);
        for (std::size_t i = 0; i < count; ++i)
            expect_near(decode_texel(format, std::span(values).subspan(i * bytes, bytes)), found[i], info(format).kind,
                        4, 0.02, title(format) + " instance " + std::to_string(i));
        device().destroy(pipeline);
    }
}

TEST_P(Formats, SeveralTargetsOfDifferentFormats) {
    // The G-buffer of a small profile: three targets of packed words.
    const Texture words[] = {target(Format::r32_uint, 8, 8), target(Format::r32_uint, 8, 8),
                             target(Format::r32_uint, 8, 8)};
    GraphicsPipelineDesc desc{
        .vertex = shader(ShaderStage::vertex, fullscreen_vertex),
        .fragment = shader(ShaderStage::fragment, R"(
                                  layout(location = 0) out uint material_0;
                                  layout(location = 1) out uint material_1;
                                  layout(location = 2) out uint top_layer;
                                  void main() {
                                      uvec2 at = uvec2(gl_FragCoord.xy);
                                      material_0 = at.x | at.y << 16u;
                                      material_1 = 0xdeadbeefu;
                                      top_layer = ~at.y;
                                  })"),
        .color_targets = {{.format = Format::r32_uint}, {.format = Format::r32_uint}, {.format = Format::r32_uint}},
        .name = "base pass"};
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    CommandList list = device().create_command_list("base pass");
    list.begin_render_pass({.color = {{.view = words[0], .load = LoadOperation::discard},
                                      {.view = words[1], .load = LoadOperation::discard},
                                      {.view = words[2], .load = LoadOperation::discard}}, .name = "base pass"});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    const auto first = read<std::uint32_t>(words[0]), second = read<std::uint32_t>(words[1]),
               third = read<std::uint32_t>(words[2]);
    for (std::uint32_t y = 0; y < 8; ++y)
        for (std::uint32_t x = 0; x < 8; ++x) {
            ASSERT_EQ(first[y * 8 + x], x | y << 16);
            ASSERT_EQ(second[y * 8 + x], 0xdeadbeefu);
            ASSERT_EQ(third[y * 8 + x], ~y);
        }
}

}  // namespace
}  // namespace nacre::test
