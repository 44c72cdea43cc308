// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <bit>
#include <random>

#include "tests/backends/gl/gl_device.h"

/// @file
/// What goes into a texture comes out of it, bit for bit, in every format that a device offers; clears, mips and
/// resolves give Vulkan's bits.

namespace nacre::rhi {
namespace {

class GlTransferTest : public GlTest {
  protected:
    bool is_es() const { return std::string_view(GetParam().backend) == "gles"; }
};
INSTANTIATE_TEST_SUITE_P(All, GlTransferTest, testing::ValuesIn(device_kinds), name_of);

/// Content that every format keeps: no NaN or infinity, no second code for -1, stencil left out.
std::vector<std::byte> random_content(const TextureDesc& desc, std::uint32_t mip, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::vector<std::byte> content(mip_bytes(desc, mip));
    for (std::byte& value : content) value = static_cast<std::byte>(random());
    const FormatInfo& facts = info(desc.format);
    if (facts.is_compressed()) return content;
    for (std::size_t at = 0; at < content.size(); at += facts.block_bytes) {
        std::byte* texel = content.data() + at;
        std::uint32_t word = 0;
        switch (desc.format) {
            case Format::rg11b10_float:
                // Exponents below the highest.
                word = random() & 0xfbfdffbfu & ~(1u << 10 | 1u << 21 | 1u << 31);
                std::memcpy(texel, &word, 4);
                continue;
            case Format::rgb9e5_float:
                // The largest mantissa uses its highest bit, so that the exponent is the only possible one.
                word = static_cast<std::uint32_t>(random()) | 0x100u;
                std::memcpy(texel, &word, 4);
                continue;
            case Format::d24_unorm_s8_uint:
                word = random() & 0xffffff;
                std::memcpy(texel, &word, 4);
                continue;
            case Format::d32_float:
            case Format::d32_float_s8_uint: {
                const float depth = static_cast<float>(random() & 0xffffff) / 16777216.0f;
                std::memcpy(texel, &depth, 4);
                continue;
            }
            default: break;
        }
        const std::size_t bytes = facts.block_bytes / facts.channels;
        for (std::size_t channel = 0; channel < facts.channels; ++channel) {
            std::byte* top = texel + (channel + 1) * bytes - 1;
            if (facts.kind == FormatKind::snorm && *top == std::byte{0x80}) *top = std::byte{0x81};
            // Clearing the lowest bit of a float's exponent field keeps it below the infinite one.
            if (facts.kind == FormatKind::floating && bytes == 2) *top &= std::byte{0xbb};
            if (facts.kind == FormatKind::floating && bytes == 4) *top &= std::byte{0xbf};
        }
    }
    return content;
}

std::string differences(const std::vector<std::byte>& found, const std::vector<std::byte>& wanted, std::size_t texel) {
    std::string text;
    if (found.size() != wanted.size()) return "other sizes";
    int told = 0;
    for (std::size_t at = 0; at < found.size() && told < 4; at += texel) {
        if (std::equal(found.begin() + static_cast<std::ptrdiff_t>(at),
                       found.begin() + static_cast<std::ptrdiff_t>(at + texel),
                       wanted.begin() + static_cast<std::ptrdiff_t>(at)))
            continue;
        ++told;
        text += fmt::format("texel {}: ", at / texel);
        for (const auto* bytes : {&found, &wanted}) {
            for (std::size_t i = texel; i-- > 0;) text += fmt::format("{:02x}", static_cast<int>((*bytes)[at + i]));
            text += bytes == &found ? " for " : "; ";
        }
    }
    return text;
}

TEST_P(GlTransferTest, KeepsEveryFormatInEveryDimension) {
    if (!has_device()) return;
    for (std::uint32_t i = 1; i < format_count; ++i) {
        const auto format = static_cast<Format>(i);
        if (!device_->capabilities().supports(format, FormatSupport::sampled)) continue;
        const FormatInfo& facts = info(format);
        std::vector<TextureDesc> descs;
        const TextureUsage usage = TextureUsage::sampled | TextureUsage::copy_source | TextureUsage::copy_destination;
        descs.push_back({.format = format, .width = 20, .height = 12, .mips = 3, .usage = usage, .name = "2d"});
        descs.push_back({.format = format, .width = 12, .height = 8, .layers = 3, .usage = usage, .name = "2d array"});
        if (!facts.is_depth_stencil() && !facts.is_compressed()) {
            descs.push_back(
                {.dimension = TextureDimension::d1, .format = format, .width = 19, .usage = usage, .name = "1d"});
            descs.push_back({.dimension = TextureDimension::d3, .format = format, .width = 6, .height = 5, .depth = 4,
                             .usage = usage, .name = "3d"});
            descs.push_back({.dimension = TextureDimension::cube,
                             .format = format,
                             .width = 8,
                             .height = 8,
                             .layers = 6,
                             .usage = usage,
                             .name = "cube"});
        }
        for (const TextureDesc& desc : descs) {
            SCOPED_TRACE(std::string(facts.name) + " " + desc.name);
            const Texture texture = expect(device_->create_texture(desc));
            for (std::uint32_t mip = 0; mip < desc.mips; ++mip)
                for (std::uint32_t layer = 0; layer < desc.layers; ++layer)
                    expect(device_->write_texture(texture, random_content(desc, mip, mip * 10 + layer), mip, layer));
            for (std::uint32_t mip = 0; mip < desc.mips; ++mip)
                for (std::uint32_t layer = 0; layer < desc.layers; ++layer) {
                    const auto found = expect(device_->read_texture(texture, mip, layer));
                    const auto wanted = random_content(desc, mip, mip * 10 + layer);
                    if (format == Format::d24_unorm_s8_uint && is_es()) {
                        // Read as a float, which has no bit to spare for 24 bits.
                        const auto steps = as_values<std::uint32_t>(found),
                                   wanted_steps = as_values<std::uint32_t>(wanted);
                        for (std::size_t at = 0; at < steps.size(); ++at)
                            ASSERT_LE(std::abs(static_cast<int>(steps[at]) - static_cast<int>(wanted_steps[at])), 1);
                        continue;
                    }
                    EXPECT_TRUE(found == wanted) << "mip " << mip << ", layer " << layer << ": "
                                                 << differences(found, wanted, facts.block_bytes);
                }
            device_->destroy(texture);
        }
    }
}

TEST_P(GlTransferTest, CopiesPartsWithPaddedRows) {
    if (!has_device()) return;
    for (Format format : {Format::rgba8_unorm, Format::r32_uint, Format::rg16_float, Format::r32_float}) {
        SCOPED_TRACE(info(format).name);
        const TextureDesc desc{
            .format = format,
            .width = 16,
            .height = 16,
            .layers = 2,
            .mips = 2,
            .usage = TextureUsage::sampled | TextureUsage::copy_source | TextureUsage::copy_destination,
            .name = "part"};
        std::array<std::vector<std::byte>, 2> found;
        const std::array devices{reference_device(), device_.get()};
        if (!devices[0]) GTEST_SKIP() << "there is no Vulkan device to compare with";
        for (std::size_t i = 0; i < 2; ++i) {
            Device& device = *devices[i];
            const Texture first = expect(device.create_texture(desc)), second = expect(device.create_texture(desc));
            const Buffer source = expect(device.create_buffer({.size = 4096, .usage = BufferUsage::copy_source}));
            const Buffer result = expect(device.create_buffer({.size = 8192, .usage = BufferUsage::copy_destination}));
            std::vector<float> values(1024);
            for (std::size_t k = 0; k < values.size(); ++k) values[k] = static_cast<float>(k % 61) * 0.25f;
            if (format == Format::rg16_float)
                for (float& value : values)
                    value = std::bit_cast<float>(0x3c003800u + std::bit_cast<std::uint32_t>(value) % 512);
            expect(device.write_buffer(source, std::span<const float>(values)));
            CommandList list = device.create_command_list();
            list.clear_texture(first, {});
            list.clear_texture(second, {});
            list.copy_buffer_to_texture(source, first, {.buffer_offset = 12, .bytes_per_row = 64, .mip = 0, .layer = 1,
                .offset = {3, 5, 0}, .extent = {9, 7, 1}});
            list.copy_texture(first, second, {.source_mip = 0, .source_layer = 1, .source_offset = {2, 4, 0},
                .destination_mip = 1, .destination_layer = 0, .destination_offset = {1, 2, 0}, .extent = {6, 5, 1}});
            list.fill_buffer(result, 0xabcdef01);
            list.copy_texture_to_buffer(first, result, {.buffer_offset = 16, .bytes_per_row = 80, .mip = 0, .layer = 1,
                .offset = {1, 2, 0}, .extent = {14, 12, 1}});
            list.copy_texture_to_buffer(second, result,
                                        {.buffer_offset = 4096,
                                         .bytes_per_row = 48,
                                         .mip = 1,
                                         .layer = 0,
                                         .offset = {0, 1, 0},
                                         .extent = {8, 7, 1}});
            expect(device.submit(std::move(list)));
            found[i] = expect(device.read_buffer(result));
        }
        EXPECT_TRUE(found[1] == found[0]) << differences(found[1], found[0], 4);
    }
}

TEST_P(GlTransferTest, ClearsEveryFormatToVulkansBits) {
    if (!has_device()) return;
    if (!reference_device()) GTEST_SKIP() << "there is no Vulkan device to compare with";
    for (std::uint32_t i = 1; i < format_count; ++i) {
        const auto format = static_cast<Format>(i);
        const FormatInfo& facts = info(format);
        if (facts.is_compressed() || facts.is_depth_stencil()) continue;
        if (!device_->capabilities().supports(format, FormatSupport::sampled) ||
            !reference_device()->capabilities().supports(format, FormatSupport::sampled))
            continue;
        SCOPED_TRACE(facts.name);
        ClearColor color;
        if (facts.kind == FormatKind::uint)
            color.uint = {3, 70, 200, 1};
        else if (facts.kind == FormatKind::sint)
            color.sint = {-3, 70, -100, 1};
        else
            color.floating = {0.2f, 0.75f, 0.0625f, 1.0f};
        const TextureDesc desc{
            .format = format,
            .width = 6,
            .height = 4,
            .layers = 2,
            .mips = 2,
            .usage = TextureUsage::sampled | TextureUsage::copy_source | TextureUsage::copy_destination,
            .name = "clear"};
        std::array<std::vector<std::byte>, 2> found;
        const std::array devices{reference_device(), device_.get()};
        for (std::size_t k = 0; k < 2; ++k) {
            const Texture texture = expect(devices[k]->create_texture(desc));
            CommandList list = devices[k]->create_command_list();
            list.clear_texture(texture, color);
            expect(devices[k]->submit(std::move(list)));
            found[k] = expect(devices[k]->read_texture(texture, 1, 1));
        }
        EXPECT_TRUE(found[1] == found[0]) << differences(found[1], found[0], facts.block_bytes);
    }
}

TEST_P(GlTransferTest, GeneratesVulkansMips) {
    if (!has_device()) return;
    if (!reference_device()) GTEST_SKIP() << "there is no Vulkan device to compare with";
    for (Format format : {Format::rgba8_unorm, Format::rgba8_srgb, Format::rgba16_float}) {
        constexpr auto needed = FormatSupport::filtered | FormatSupport::color_target;
        if (!device_->capabilities().supports(format, needed)) continue;
        SCOPED_TRACE(info(format).name);
        for (std::uint32_t layers : {1u, 3u}) {
            const TextureDesc desc{.format = format, .width = 32, .height = 16, .layers = layers, .mips = 5,
                .usage = TextureUsage::sampled | TextureUsage::color_target | TextureUsage::copy_source |
                         TextureUsage::copy_destination, .name = "mips"};
            std::array<std::vector<std::vector<std::byte>>, 2> found;
            const std::array devices{reference_device(), device_.get()};
            for (std::size_t k = 0; k < 2; ++k) {
                const Texture texture = expect(devices[k]->create_texture(desc));
                for (std::uint32_t layer = 0; layer < layers; ++layer)
                    expect(devices[k]->write_texture(texture, random_content(desc, 0, layer), 0, layer));
                CommandList list = devices[k]->create_command_list();
                list.generate_mips(texture);
                expect(devices[k]->submit(std::move(list)));
                for (std::uint32_t mip = 1; mip < 5; ++mip)
                    found[k].push_back(expect(devices[k]->read_texture(texture, mip, layers - 1)));
            }
            for (std::uint32_t mip = 1; mip < 5; ++mip) {
                std::size_t differing = 0, largest = 0;
                for (std::size_t at = 0; at < found[0][mip - 1].size(); ++at) {
                    const int difference = std::abs(static_cast<int>(found[0][mip - 1][at]) -
                                                    static_cast<int>(found[1][mip - 1][at]));
                    differing += difference != 0;
                    largest = std::max(largest, static_cast<std::size_t>(difference));
                }
                EXPECT_EQ(differing, 0u) << "mip " << mip << ", largest difference " << largest;
            }
        }
    }
}

TEST_P(GlTransferTest, ResolvesToVulkansBits) {
    if (!has_device()) return;
    if (!reference_device()) GTEST_SKIP() << "there is no Vulkan device to compare with";
    constexpr Format format = Format::rgba8_unorm;
    if (!device_->capabilities().supports(format, FormatSupport::multisampled)) GTEST_SKIP() << "no multisampling";
    std::array<std::vector<std::uint32_t>, 2> found;
    const std::array devices{reference_device(), device_.get()};
    for (std::size_t i = 0; i < 2; ++i) {
        Device& device = *devices[i];
        const Texture many = expect(device.create_texture({.format = format, .width = 48, .height = 40, .samples = 4,
            .usage = TextureUsage::color_target, .name = "samples"}));
        const Texture one = expect(device.create_texture({.format = format, .width = 48, .height = 40,
            .usage = TextureUsage::color_target | TextureUsage::copy_source, .name = "resolved"}));
        const GraphicsPipeline pipeline =
            expect(device.create_graphics_pipeline({.vertex = make_shader(device, "a.vert", R"(
void main() {
    const vec2 corners[3] = vec2[](vec2(-0.93, -0.81), vec2(0.87, -0.4), vec2(-0.2, 0.9));
    gl_Position = vec4(corners[gl_VertexIndex], 0.5, 1.0);
})"),
                                                    .fragment = make_shader(device, "a.frag", R"(
layout(location = 0) out vec4 result;
void main() { result = vec4(1.0, 0.5, 0.25, 1.0); }
)"),
                                                    .samples = 4,
                                                    .color_targets = {{.format = format}}}));
        CommandList list = device.create_command_list();
        list.begin_render_pass({.color = {{.view = many, .load = LoadOperation::clear, .store = StoreOperation::discard,
                                           .clear = {.floating = {0, 0, 0.5f, 1}}, .resolve = one}}});
        list.set_pipeline(pipeline);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        expect(device.submit(std::move(list)));
        found[i] = texels<std::uint32_t>(device, one);
    }
    EXPECT_EQ(found[0], found[1]);
}

TEST_P(GlTransferTest, CountsSamplesAndTime) {
    if (!has_device()) return;
    const Capabilities& capabilities = device_->capabilities();
    const Texture target = expect(device_->create_texture({.format = Format::rgba8_unorm, .width = 16, .height = 16,
        .usage = TextureUsage::color_target, .name = "target"}));
    const GraphicsPipeline pipeline =
        expect(device_->create_graphics_pipeline({.vertex = make_shader(*device_, "a.vert", R"(
void main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.5, 1.0); }
)"),
                                                  .fragment = make_shader(*device_, "a.frag", R"(
layout(location = 0) out vec4 result;
void main() { result = vec4(1.0); }
)"),
                                                  .color_targets = {{.format = Format::rgba8_unorm}}}));
    const QueryPool occlusion = expect(device_->create_query_pool({.type = QueryType::occlusion, .count = 2}));
    QueryPool times;
    if (capabilities.timestamps) times = expect(device_->create_query_pool({.type = QueryType::timestamp, .count = 2}));
    CommandList list = device_->create_command_list();
    if (times) list.write_timestamp(times, 0);
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.begin_occlusion_query(occlusion, 0);
    list.draw({.vertex_count = 3});
    list.end_occlusion_query(occlusion, 0);
    list.begin_occlusion_query(occlusion, 1);
    list.end_occlusion_query(occlusion, 1);
    list.end_render_pass();
    if (times) list.write_timestamp(times, 1);
    expect(device_->submit(std::move(list)));
    const auto counts = expect(device_->read_queries(occlusion, 0, 2));
    ASSERT_EQ(counts.size(), 2u);
    EXPECT_EQ(counts[0], capabilities.precise_occlusion ? 256u : 1u);
    EXPECT_EQ(counts[1], 0u);
    if (times) {
        const auto moments = expect(device_->read_queries(times, 0, 2));
        ASSERT_EQ(moments.size(), 2u);
        EXPECT_GT(moments[0], 0u);
        EXPECT_GE(moments[1], moments[0]);
        EXPECT_LT(moments[1] - moments[0], 10'000'000'000u);
    }
}

}  // namespace
}  // namespace nacre::rhi
