// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <bit>

#include "tests/backends/gl/gl_device.h"

/// @file
/// How shaders see resources that OpenGL has in another form: push constants, specialization constants, separate
/// textures and samplers, views, storage images, blending.

namespace nacre::rhi {
namespace {

template <typename T, std::size_t count>
std::vector<std::byte> bytes_of(const std::array<T, count>& values) {
    const auto bytes = std::as_bytes(std::span(values));
    return {bytes.begin(), bytes.end()};
}

class GlResourceTest : public GlTest {
  protected:
    /// Runs one workgroup of a compute shader whose binding 0 is a buffer of `count` words, and reads them.
    std::vector<std::uint32_t> compute(Device& device, const std::string& text, std::uint32_t count,
                                       std::vector<BindGroupEntry> entries = {},
                                       std::span<const std::byte> push_constants = {},
                                       std::vector<SpecializationConstant> specialization = {},
                                       std::uint32_t groups = 1) {
        const Buffer result = expect(device.create_buffer(
            {.size = count * 4, .usage = BufferUsage::storage | BufferUsage::copy_destination, .name = "result"}));
        const ComputePipeline pipeline =
            expect(device.create_compute_pipeline({.shader = make_shader(device, "test.comp", text),
                                                   .specialization = std::move(specialization),
                                                   .name = "test"}));
        if (!pipeline) return {};
        entries.push_back({.binding = 0, .buffer = result});
        const BindGroup group = expect(device.create_bind_group(
            {.layout = expect(device.bind_group_layout(pipeline, 0)), .entries = entries, .name = "test"}));
        CommandList list = device.create_command_list("test");
        list.fill_buffer(result, 0xdeadbeef);
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group);
        if (!push_constants.empty()) list.set_push_constants(push_constants);
        list.dispatch({.x = groups});
        expect(device.submit(std::move(list)));
        return as_values<std::uint32_t>(expect(device.read_buffer(result)));
    }
};
INSTANTIATE_TEST_SUITE_P(All, GlResourceTest, testing::ValuesIn(device_kinds), name_of);

TEST_P(GlResourceTest, TakesPushConstantsOfEveryShape) {
    if (!has_device()) return;
    constexpr const char* text = R"(
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
struct Inner { vec2 pair; int whole; };
layout(push_constant) uniform Parameters {
    float values[5];
    layout(row_major) mat2x3 by_rows;
    layout(column_major) mat2 by_columns;
    Inner inner[2];
    uint last;
} parameters;
void main() {
    uint at = 0u;
    for (int i = 0; i < 5; ++i) result[at++] = floatBitsToUint(parameters.values[i]);
    for (int c = 0; c < 2; ++c) for (int r = 0; r < 3; ++r) result[at++] = floatBitsToUint(parameters.by_rows[c][r]);
    for (int c = 0; c < 2; ++c) for (int r = 0; r < 2; ++r) result[at++] = floatBitsToUint(parameters.by_columns[c][r]);
    for (int i = 0; i < 2; ++i) {
        result[at++] = floatBitsToUint(parameters.inner[i].pair.x);
        result[at++] = floatBitsToUint(parameters.inner[i].pair.y);
        result[at++] = uint(parameters.inner[i].whole);
    }
    result[at++] = parameters.last;
}
)";
    // std430: values at 0, by_rows at 24 (3 rows of 2, 8 apart), by_columns at 48, inner at 64 (16 apart), last at 96.
    std::array<std::uint32_t, 25> constants{};
    for (std::uint32_t i = 0; i < constants.size(); ++i)
        constants[i] = std::bit_cast<std::uint32_t>(static_cast<float>(i) + 0.5f);
    constants[18] = static_cast<std::uint32_t>(-7), constants[22] = 9, constants[24] = 0x80000001u;
    const std::array<std::uint32_t, 22> places{0,  1,  2,  3,  4,  6,  8,  10, 7,  9,  11,
                                               12, 13, 14, 15, 16, 17, 18, 20, 21, 22, 24};
    std::vector<std::uint32_t> wanted;
    for (std::uint32_t place : places) wanted.push_back(constants[place]);
    EXPECT_EQ(compute(*device_, text, 22, {}, bytes_of(constants)), wanted);
}

TEST_P(GlResourceTest, KeepsPushConstantsOfTwoStagesApart) {
    if (!has_device()) return;
    const Texture target = expect(device_->create_texture({.format = Format::rgba32_uint, .width = 8, .height = 8,
        .usage = TextureUsage::color_target | TextureUsage::copy_source, .name = "target"}));
    // Blocks and members of one name that mean different things in the two stages.
    const GraphicsPipeline pipeline =
        expect(device_->create_graphics_pipeline({.vertex = make_shader(*device_, "a.vert", R"(
layout(push_constant) uniform Parameters { layout(offset = 0) vec4 value; } parameters;
layout(set = 0, binding = 0) uniform Block { vec4 offset; } block;
void main() {
    gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.5, 1.0) * parameters.value.x +
                  block.offset;
})"),
                                                  .fragment = make_shader(*device_, "a.frag", R"(
layout(push_constant) uniform Parameters { layout(offset = 16) uvec2 value; } parameters;
layout(set = 0, binding = 1) uniform Block { uvec4 offset; } block;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(parameters.value, 5, 6) + block.offset; }
)"),
                                                  .color_targets = {{.format = Format::rgba32_uint}},
                                                  .name = "two stages"}));
    const Buffer zero = expect(device_->create_buffer({.size = 16, .usage = BufferUsage::uniform, .name = "zero"}));
    const Buffer one = expect(device_->create_buffer({.size = 16, .usage = BufferUsage::uniform, .name = "one"}));
    expect(device_->write_buffer(zero, bytes_of(std::array<float, 4>{})));
    expect(device_->write_buffer(one, bytes_of(std::array<std::uint32_t, 4>{1, 1, 1, 1})));
    const BindGroup group = expect(
        device_->create_bind_group({.layout = expect(device_->bind_group_layout(pipeline, 0)),
                                    .entries = {{.binding = 0, .buffer = zero}, {.binding = 1, .buffer = one}}}));
    CommandList list = device_->create_command_list();
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group);
    list.set_push_constants(std::array<float, 4>{1, 0, 0, 0});
    list.set_push_constants(std::array<std::uint32_t, 2>{40, 50}, 16);
    list.draw({.vertex_count = 3});
    // The next draw must see the change.
    list.set_scissor({.x = 4, .y = 0, .width = 4, .height = 8});
    list.set_push_constants(std::array<std::uint32_t, 1>{60}, 16);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    expect(device_->submit(std::move(list)));
    const auto picture = texels<std::uint32_t>(*device_, target);
    EXPECT_EQ(std::vector(picture.begin(), picture.begin() + 4), (std::vector<std::uint32_t>{41, 51, 6, 7}));
    EXPECT_EQ(std::vector(picture.begin() + 16, picture.begin() + 20), (std::vector<std::uint32_t>{61, 51, 6, 7}));
}

TEST_P(GlResourceTest, SpecializesConstantsOfEveryType) {
    if (!has_device()) return;
    constexpr const char* text = R"(
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool flag = false;
layout(constant_id = 2) const int number = 5;
layout(constant_id = 3) const uint count = 6;
layout(constant_id = 4) const float ratio = 7.5;
layout(constant_id = 5) const uint unset = 8;
layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
shared uint values[count];
void main() {
    if (gl_LocalInvocationID.x == 0u) {
        result[0] = flag ? 1u : 0u;
        result[1] = uint(number);
        result[2] = count;
        result[3] = floatBitsToUint(ratio);
        result[4] = unset;
        result[5] = gl_WorkGroupSize.x;
        result[6] = uint(values.length());
    }
    result[8u + gl_LocalInvocationID.x] = gl_LocalInvocationID.x;
}
)";
    const auto found = compute(*device_, text, 16, {}, {},
                               {{0, 4u}, {1, true}, {2, -3}, {3, 12u}, {4, 0.25f}});
    EXPECT_EQ(found, (std::vector<std::uint32_t>{1, 0xfffffffdu, 12, 0x3e800000u, 8, 4, 12, 0xdeadbeef, 0, 1, 2, 3,
                                                 0xdeadbeef, 0xdeadbeef, 0xdeadbeef, 0xdeadbeef}));
}

TEST_P(GlResourceTest, PairsTexturesWithSamplersAsTheShaderDoes) {
    if (!has_device()) return;
    const Texture ramp = expect(device_->create_texture({.format = Format::rgba8_unorm, .width = 2, .height = 1,
        .usage = TextureUsage::sampled | TextureUsage::copy_destination, .name = "ramp"}));
    expect(device_->write_texture(ramp, bytes_of(std::array<std::uint32_t, 2>{0x00000000u, 0xffffffffu})));
    const auto sampler = [&](Filter filter, AddressMode mode) {
        return expect(device_->create_sampler({.magnify = filter, .minify = filter, .mip = Filter::nearest,
            .address_u = mode, .address_v = mode}));
    };
    const auto found = compute(*device_, R"(
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
layout(set = 0, binding = 1) uniform texture2D ramp;
layout(set = 0, binding = 2) uniform sampler smooth_clamped;
layout(set = 0, binding = 3) uniform sampler sharp_repeated;
layout(set = 0, binding = 4) uniform texture2D more[2];
uint bits(vec4 color) { return uint(color.r * 100.0 + 0.5); }
void main() {
    result[0] = bits(textureLod(sampler2D(ramp, smooth_clamped), vec2(0.5), 0.0));
    result[1] = bits(textureLod(sampler2D(ramp, sharp_repeated), vec2(1.25, 0.5), 0.0));
    result[2] = bits(textureLod(sampler2D(ramp, smooth_clamped), vec2(1.25, 0.5), 0.0));
    result[3] = bits(textureLod(sampler2D(more[1], sharp_repeated), vec2(0.75, 0.5), 0.0));
}
)", 4, {{.binding = 1, .texture = ramp}, {.binding = 2, .sampler = sampler(Filter::linear, AddressMode::clamp_to_edge)},
        {.binding = 3, .sampler = sampler(Filter::nearest, AddressMode::repeat)},
        {.binding = 4, .texture = ramp, .element = 0}, {.binding = 4, .texture = ramp, .element = 1}});
    EXPECT_EQ(found, (std::vector<std::uint32_t>{50, 0, 100, 100}));
}

TEST_P(GlResourceTest, StoresAndLoadsImagesOfEveryFormat) {
    if (!has_device()) return;
    const std::vector<std::pair<Format, const char*>> qualifiers{{Format::r8_unorm, "r8"},
                                                                 {Format::r8_snorm, "r8_snorm"},
                                                                 {Format::r8_uint, "r8ui"},
                                                                 {Format::r8_sint, "r8i"},
                                                                 {Format::rg8_unorm, "rg8"},
                                                                 {Format::rg8_uint, "rg8ui"},
                                                                 {Format::rgba8_unorm, "rgba8"},
                                                                 {Format::rgba8_snorm, "rgba8_snorm"},
                                                                 {Format::rgba8_uint, "rgba8ui"},
                                                                 {Format::rgba8_sint, "rgba8i"},
                                                                 {Format::r16_unorm, "r16"},
                                                                 {Format::r16_uint, "r16ui"},
                                                                 {Format::r16_float, "r16f"},
                                                                 {Format::rg16_float, "rg16f"},
                                                                 {Format::rgba16_unorm, "rgba16"},
                                                                 {Format::rgba16_uint, "rgba16ui"},
                                                                 {Format::rgba16_sint, "rgba16i"},
                                                                 {Format::rgba16_float, "rgba16f"},
                                                                 {Format::r32_uint, "r32ui"},
                                                                 {Format::r32_sint, "r32i"},
                                                                 {Format::r32_float, "r32f"},
                                                                 {Format::rg32_uint, "rg32ui"},
                                                                 {Format::rg32_float, "rg32f"},
                                                                 {Format::rgba32_uint, "rgba32ui"},
                                                                 {Format::rgba32_sint, "rgba32i"},
                                                                 {Format::rgba32_float, "rgba32f"},
                                                                 {Format::rgb10a2_unorm, "rgb10_a2"},
                                                                 {Format::rgb10a2_uint, "rgb10_a2ui"},
                                                                 {Format::rg11b10_float, "r11f_g11f_b10f"}};
    std::uint32_t tried = 0;
    for (const auto& [format, qualifier] : qualifiers) {
        if (!device_->capabilities().supports(format, FormatSupport::storage_image)) continue;
        SCOPED_TRACE(qualifier);
        ++tried;
        const FormatInfo& facts = info(format);
        const char* prefix = facts.kind == FormatKind::uint ? "u" : facts.kind == FormatKind::sint ? "i" : "";
        const Texture image = expect(device_->create_texture({.format = format, .width = 4, .height = 2, .layers = 3,
            .usage = TextureUsage::storage | TextureUsage::sampled | TextureUsage::copy_source, .name = qualifier}));
        const std::string store = fmt::format(R"(
layout(local_size_x = 4, local_size_y = 2, local_size_z = 3) in;
layout(set = 0, binding = 0) writeonly buffer Result {{ uint result[]; }};
layout(set = 0, binding = 1, {}) writeonly uniform {}image2DArray image;
void main() {{
    ivec3 at = ivec3(gl_LocalInvocationID);
    imageStore(image, at, {}vec4(at.x, at.y, at.z, 1) {});
    result[0] = 1u;
}}
)", qualifier, prefix, prefix, facts.is_integer() ? "" : "* 0.25");
        compute(*device_, store, 1, {{.binding = 1, .texture = image}});
        // One layer of the array as an image of its own, and the array by a fetch.
        const std::string load = fmt::format(R"(
layout(local_size_x = 4, local_size_y = 2) in;
layout(set = 0, binding = 0) writeonly buffer Result {{ uint result[]; }};
layout(set = 0, binding = 1, {}) readonly uniform {}image2D image;
void main() {{
    ivec2 at = ivec2(gl_LocalInvocationID.xy);
    result[at.y * 4 + at.x] = uint(float(imageLoad(image, at).x) {} + 0.5);
}}
)", qualifier, prefix, facts.is_integer() ? "" : "/ 0.25");
        const std::string fetch = fmt::format(R"(
#extension GL_EXT_samplerless_texture_functions : require
layout(local_size_x = 4, local_size_y = 2) in;
layout(set = 0, binding = 0) writeonly buffer Result {{ uint result[]; }};
layout(set = 0, binding = 1) uniform {}texture2DArray image;
void main() {{
    ivec2 at = ivec2(gl_LocalInvocationID.xy);
    result[at.y * 4 + at.x] = uint(float(texelFetch(image, ivec3(at, 2), 0).x) {} + 0.5);
}}
)", prefix, facts.is_integer() ? "" : "/ 0.25");
        const std::vector<std::uint32_t> wanted{0, 1, 2, 3, 0, 1, 2, 3};
        EXPECT_EQ(compute(*device_, load, 8, {{.binding = 1, .texture = TextureView::subresource(image, 0, 2)}}),
                  wanted);
        EXPECT_EQ(compute(*device_, fetch, 8, {{.binding = 1, .texture = image}}), wanted);
    }
    EXPECT_GE(tried, std::string_view(GetParam().backend) == "gles" ? 10u : 25u);
}

TEST_P(GlResourceTest, ShowsPartsOfTextures) {
    if (!has_device()) return;
    const Texture texture = expect(device_->create_texture({.format = Format::rgba8_unorm, .width = 8, .height = 8,
        .layers = 4, .mips = 3, .usage = TextureUsage::sampled | TextureUsage::copy_destination, .name = "parts"}));
    for (std::uint32_t mip = 0; mip < 3; ++mip)
        for (std::uint32_t layer = 0; layer < 4; ++layer) {
            const std::vector<std::uint32_t> values((8u >> mip) * (8u >> mip), 0xff000000u | (mip * 10 + layer));
            expect(device_->write_texture(texture, std::as_bytes(std::span(values)), mip, layer));
        }
    constexpr const char* text = R"(
#extension GL_EXT_samplerless_texture_functions : require
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
layout(set = 0, binding = 1) uniform KIND part;
void main() {
    result[0] = uint(texelFetch(part, AT, LEVEL).r * 255.0 + 0.5);
    result[1] = uint(textureSize(part, 0).x);
    result[2] = uint(textureSize(part, LEVEL).x);
}
)";
    const auto look = [&](const char* kind, const char* at, const char* level, const TextureView& view) {
        std::string filled = text;
        for (const auto& [from, to] : {std::pair{"KIND", kind}, {"AT", at}, {"LEVEL", level}, {"LEVEL", level}})
            filled.replace(filled.find(from), std::strlen(from), to);
        return compute(*device_, filled, 3, {{.binding = 1, .texture = view}});
    };
    TextureView mips(texture);
    mips.base_mip = 1, mips.mip_count = 2;
    EXPECT_EQ(look("texture2DArray", "ivec3(0, 0, 3)", "1", mips), (std::vector<std::uint32_t>{23, 4, 2}));
    // The whole again, after a part was seen.
    EXPECT_EQ(look("texture2DArray", "ivec3(0, 0, 2)", "1", texture), (std::vector<std::uint32_t>{12, 8, 4}));
    if (!device_->capabilities().texture_view_formats) return;
    TextureView layers(texture);
    layers.base_layer = 1, layers.layer_count = 2;
    EXPECT_EQ(look("texture2DArray", "ivec3(0, 0, 1)", "2", layers), (std::vector<std::uint32_t>{22, 8, 2}));
    EXPECT_EQ(look("texture2D", "ivec2(0, 0)", "0", TextureView::subresource(texture, 1, 3)),
              (std::vector<std::uint32_t>{13, 4, 4}));
}

TEST_P(GlResourceTest, ShowsTwoRangesOfMipsOrSaysThatItCannot) {
    if (!has_device()) return;
    const Texture texture = expect(device_->create_texture({.format = Format::rgba8_unorm, .width = 8, .height = 8,
        .mips = 4, .usage = TextureUsage::sampled | TextureUsage::copy_destination, .name = "chain"}));
    for (std::uint32_t mip = 0; mip < 4; ++mip) {
        const std::vector<std::uint32_t> values((8u >> mip) * (8u >> mip), 0xff000000u | mip);
        expect(device_->write_texture(texture, std::as_bytes(std::span(values)), mip));
    }
    const ComputePipeline pipeline =
        expect(device_->create_compute_pipeline({.shader = make_shader(*device_, "a.comp", R"(
#extension GL_EXT_samplerless_texture_functions : require
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
layout(set = 0, binding = 1) uniform texture2D fine;
layout(set = 0, binding = 2) uniform texture2D coarse;
void main() {
    result[0] = uint(texelFetch(fine, ivec2(0), 0).r * 255.0 + 0.5);
    result[1] = uint(texelFetch(coarse, ivec2(0), 0).r * 255.0 + 0.5);
}
)"),
                                                 .name = "two ranges"}));
    const Buffer result = expect(device_->create_buffer({.size = 8, .usage = BufferUsage::storage}));
    TextureView fine(texture), coarse(texture);
    fine.mip_count = 2;
    coarse.base_mip = 2, coarse.mip_count = 2;
    // Refused by the front end or by the backend, but never drawn wrong.
    device_->set_message_callback([](const Message&) {});
    const auto group = device_->create_bind_group({.layout = expect(device_->bind_group_layout(pipeline, 0)),
                                                   .entries = {{.binding = 0, .buffer = result},
                                                               {.binding = 1, .texture = fine},
                                                               {.binding = 2, .texture = coarse}},
                                                   .name = "two ranges"});
    if (!device_->capabilities().texture_view_formats) {
        ASSERT_FALSE(group);
        EXPECT_THAT(group.error().message(), testing::HasSubstr("chain"));
        return;
    }
    ASSERT_TRUE(group) << group.error().message();
    CommandList list = device_->create_command_list();
    list.set_pipeline(pipeline);
    list.set_bind_group(0, *group);
    list.dispatch({});
    expect(device_->submit(std::move(list)));
    EXPECT_EQ(as_values<std::uint32_t>(expect(device_->read_buffer(result))), (std::vector<std::uint32_t>{0, 2}));
}

TEST_P(GlResourceTest, BlendsAsVulkanDoes) {
    if (!has_device()) return;
    if (!reference_device()) GTEST_SKIP() << "there is no Vulkan device to compare with";
    const Capabilities& capabilities = device_->capabilities();
    struct Case {
        const char* name;
        bool possible;
        std::array<BlendState, 2> blends;
        std::array<std::uint8_t, 2> masks{0xf, 0xf};
        bool dual = false;
    };
    const BlendState over{true, BlendFactor::source_alpha, BlendFactor::one_minus_source_alpha, BlendOperation::add,
                          BlendFactor::one, BlendFactor::one_minus_source_alpha, BlendOperation::add};
    const BlendState constant{true,
                              BlendFactor::constant_color,
                              BlendFactor::one_minus_constant_color,
                              BlendOperation::reverse_subtract,
                              BlendFactor::zero,
                              BlendFactor::one,
                              BlendOperation::maximum};
    const BlendState dual{true, BlendFactor::one, BlendFactor::source1_color, BlendOperation::add,
                          BlendFactor::one, BlendFactor::one_minus_source1_alpha, BlendOperation::add};
    for (const Case& test : {Case{"same for both", true, {over, over}}, Case{"constant", true, {constant, constant}},
                             Case{"each its own", capabilities.independent_blend, {over, constant}, {0xf, 0x5}},
                             Case{"dual source", capabilities.dual_source_blending, {dual, {}}, {0xf, 0xf}, true}}) {
        if (!test.possible) continue;
        SCOPED_TRACE(test.name);
        const std::size_t targets = test.dual ? 1 : 2;
        std::array<std::vector<std::uint32_t>, 2> found;
        const std::array devices{reference_device(), device_.get()};
        for (std::size_t i = 0; i < 2; ++i) {
            Device& device = *devices[i];
            RenderPassDesc pass;
            GraphicsPipelineDesc desc{.vertex = make_shader(device, "a.vert", R"(
void main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.5, 1.0); }
)"), .fragment = make_shader(device, "a.frag", test.dual ? R"(
layout(location = 0, index = 0) out vec4 first;
layout(location = 0, index = 1) out vec4 second;
void main() { first = vec4(0.25, 0.1, 0.3, 0.5); second = vec4(0.5, 0.25, 1.0, 0.2); }
)" : R"(
layout(location = 0) out vec4 first;
layout(location = 1) out vec4 second;
void main() { first = vec4(gl_FragCoord.xy / 16.0, 0.3, 0.5); second = vec4(0.9, 0.2, 0.4, 0.75); }
)"), .name = test.name};
            std::vector<Texture> textures;
            for (std::size_t k = 0; k < targets; ++k) {
                textures.push_back(
                    expect(device.create_texture({.format = Format::rgba8_unorm,
                                                  .width = 16,
                                                  .height = 16,
                                                  .usage = TextureUsage::color_target | TextureUsage::copy_source,
                                                  .name = "target"})));
                pass.color.push_back({.view = textures[k], .load = LoadOperation::clear,
                                      .clear = {.floating = {0.2f, 0.6f, 0.8f, 0.4f}}});
                desc.color_targets.push_back({Format::rgba8_unorm, test.blends[k], test.masks[k]});
            }
            const GraphicsPipeline pipeline = expect(device.create_graphics_pipeline(desc));
            CommandList list = device.create_command_list();
            list.begin_render_pass(pass);
            list.set_pipeline(pipeline);
            list.set_blend_constants({0.25f, 0.5f, 0.75f, 1.0f});
            list.draw({.vertex_count = 3});
            list.end_render_pass();
            expect(device.submit(std::move(list)));
            for (const Texture& texture : textures) {
                const auto values = texels<std::uint32_t>(device, texture);
                found[i].insert(found[i].end(), values.begin(), values.end());
            }
        }
        EXPECT_EQ(found[0], found[1]);
    }
}

TEST_P(GlResourceTest, TestsStencilAndBiasesDepthAsVulkanDoes) {
    if (!has_device()) return;
    if (!reference_device()) GTEST_SKIP() << "there is no Vulkan device to compare with";
    for (Format format : {Format::d32_float_s8_uint, Format::d24_unorm_s8_uint}) {
        const auto needed = FormatSupport::depth_target;
        if (!device_->capabilities().supports(format, needed) ||
            !reference_device()->capabilities().supports(format, needed))
            continue;
        SCOPED_TRACE(info(format).name);
        std::array<std::vector<std::uint32_t>, 2> colors;
        const std::array devices{reference_device(), device_.get()};
        for (std::size_t i = 0; i < 2; ++i) {
            Device& device = *devices[i];
            const Texture color = expect(device.create_texture({.format = Format::r32_uint, .width = 32, .height = 32,
                .usage = TextureUsage::color_target | TextureUsage::copy_source, .name = "color"}));
            const Texture depth = expect(device.create_texture({.format = format, .width = 32, .height = 32,
                .usage = TextureUsage::depth_target, .name = "depth"}));
            GraphicsPipelineDesc desc{.vertex = make_shader(device, "a.vert", R"(
layout(push_constant) uniform P { vec4 place; } p;
void main() {
    const vec2 corners[3] = vec2[](vec2(-0.9, -0.7), vec2(0.8, -0.8), vec2(0.1, 0.9));
    gl_Position = vec4(corners[gl_VertexIndex] + p.place.xy, 0.25 + float(gl_VertexIndex) * 0.125 + p.place.z, 1.0);
})"), .fragment = make_shader(device, "a.frag", R"(
layout(push_constant) uniform P { vec4 place; } p;
layout(location = 0) out uint result;
void main() { result = uint(p.place.w) + (gl_FrontFacing ? 100u : 200u); }
)"), .color_targets = {{.format = Format::r32_uint}}};
            desc.depth_stencil = {.format = format, .depth_test = true, .depth_write = true,
                                  .depth_compare = CompareOperation::less, .stencil_test = true};
            desc.depth_stencil.front = {.depth_fail = StencilOperation::increment_clamp,
                                        .pass = StencilOperation::replace, .compare = CompareOperation::always};
            desc.depth_stencil.back = desc.depth_stencil.front;
            const GraphicsPipeline write = expect(device.create_graphics_pipeline(desc));
            desc.depth_stencil.front.compare = desc.depth_stencil.back.compare = CompareOperation::equal;
            desc.depth_stencil.front.read_mask = desc.depth_stencil.back.read_mask = 0x0f;
            desc.depth_stencil.depth_bias = -4.0f;
            desc.depth_stencil.depth_bias_slope = -0.5f;
            const GraphicsPipeline biased = expect(device.create_graphics_pipeline(desc));
            CommandList list = device.create_command_list();
            list.begin_render_pass({.color = {{.view = color, .load = LoadOperation::clear}},
                                    .depth_stencil = {.view = depth, .depth_load = LoadOperation::clear,
                                                      .stencil_load = LoadOperation::clear, .clear_stencil = 3}});
            list.set_pipeline(write);
            list.set_stencil_reference(0x25);
            list.set_push_constants(std::array<float, 4>{0, 0, 0, 1});
            list.draw({.vertex_count = 3});
            list.set_push_constants(std::array<float, 4>{0.3f, 0.2f, 0.05f, 2});
            list.draw({.vertex_count = 3});
            list.set_pipeline(biased);
            list.set_stencil_reference(0xf5);
            list.set_push_constants(std::array<float, 4>{0, 0, 0, 3});
            list.draw({.vertex_count = 3});
            list.set_stencil_reference(0x03);
            list.set_push_constants(std::array<float, 4>{-0.2f, 0.1f, 0, 4});
            list.draw({.vertex_count = 3});
            list.end_render_pass();
            expect(device.submit(std::move(list)));
            colors[i] = texels<std::uint32_t>(device, color);
        }
        EXPECT_EQ(colors[0], colors[1]);
        for (std::uint32_t value : {101u, 102u, 103u, 104u})
            EXPECT_TRUE(std::ranges::find(colors[1], value) != colors[1].end() ||
                        std::ranges::find(colors[1], value + 100) != colors[1].end())
                << value;
    }
}

}  // namespace
}  // namespace nacre::rhi
