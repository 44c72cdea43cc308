// SPDX-License-Identifier: Apache-2.0
// Samplers against closed forms. Sampled in compute shaders with explicit levels, so every device can.
#include <algorithm>
#include <cmath>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(Samplers);

/// Samples a row of `count` points of a 2D texture from u = first in steps, at v and a level.
std::string row_shader(const std::string& type = "sampler2D") {
    return R"(
        layout(local_size_x = 1) in;
        layout(push_constant) uniform Row { float first; float step; float v; float lod; int count; };
        layout(set = 0, binding = 0) buffer Result { vec4 result[]; };
        layout(set = 0, binding = 1) uniform )" +
           type + R"( image;
        void main() {
            for (int i = 0; i < count; ++i) result[i] = textureLod(image, vec2(first + step * float(i), v), lod);
        }
    )";
}

struct Row {
    float first, step, v, lod;
    std::int32_t count;
};

class SamplerRows : public BackendTest {
  public:
    std::vector<std::array<float, 4>> sample(Texture texture, const SamplerDesc& desc, const Row& row) {
        const ComputePipeline pipeline = compute(row_shader());
        const Buffer result = buffer(static_cast<std::uint64_t>(row.count) * 16, BufferUsage::storage);
        CommandList list = device().create_command_list("row");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group(pipeline, {{.binding = 0, .buffer = result},
                                                {.binding = 1, .texture = texture, .sampler = sampler(desc)}}));
        list.set_push_constants(row);
        list.dispatch({});
        run(std::move(list));
        return read<std::array<float, 4>>(result);
    }
    /// Four texels 0, 1, 2, 3 of 4 in red, as 8-bit values; green tells the same upside down.
    Texture ramp() {
        std::vector<std::uint8_t> texels;
        for (int i = 0; i < 4; ++i)
            for (const int value : {i * 60, 255 - i * 60, 0, 255}) texels.push_back(static_cast<std::uint8_t>(value));
        return texture_of<std::uint8_t>(Format::rgba8_unorm, 4, 1, texels, "ramp");
    }
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(SamplerRows);
INSTANTIATE_TEST_SUITE_P(Rhi, SamplerRows, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

constexpr float unit = 60.0f / 255.0f;

float address(AddressMode mode, int i, bool& border) {
    border = false;
    switch (mode) {
        case AddressMode::repeat: return static_cast<float>(((i % 4) + 4) % 4);
        case AddressMode::mirrored_repeat: {
            const int at = ((i % 8) + 8) % 8;
            return static_cast<float>(at < 4 ? at : 7 - at);
        }
        case AddressMode::clamp_to_edge: return static_cast<float>(std::clamp(i, 0, 3));
        case AddressMode::clamp_to_border: border = i < 0 || i > 3; return static_cast<float>(std::clamp(i, 0, 3));
    }
    return 0;
}

TEST_P(SamplerRows, AddressModesWithNearestFilter) {
    const Texture texture = ramp();
    for (const AddressMode mode : {AddressMode::repeat, AddressMode::mirrored_repeat, AddressMode::clamp_to_edge,
                                   AddressMode::clamp_to_border}) {
        if (mode == AddressMode::clamp_to_border && !capabilities().border_color) continue;
        const auto values = sample(texture,
                                   {.magnify = Filter::nearest,
                                    .minify = Filter::nearest,
                                    .mip = Filter::nearest,
                                    .address_u = mode,
                                    .address_v = mode,
                                    .border = BorderColor::opaque_white},
                                   {-2.875f, 0.25f, 0.5f, 0.0f, 24});
        for (int i = 0; i < 24; ++i) {
            bool border = false;
            const float texel = address(mode, i - 12, border);
            EXPECT_NEAR(values[static_cast<std::size_t>(i)][0], border ? 1.0f : texel * unit, 1e-5f)
                << "mode " << static_cast<int>(mode) << " at " << i;
        }
    }
}

TEST_P(SamplerRows, LinearFilterWeighsTwoTexels) {
    const Texture texture = ramp();
    for (const AddressMode mode : {AddressMode::repeat, AddressMode::clamp_to_edge}) {
        const auto values =
            sample(texture, {.mip = Filter::nearest, .address_u = mode, .address_v = AddressMode::clamp_to_edge},
                   {-0.5f, 1.0f / 32.0f, 0.5f, 0.0f, 64});
        for (int i = 0; i < 64; ++i) {
            const float x = (-0.5f + static_cast<float>(i) / 32.0f) * 4.0f - 0.5f;
            const int left = static_cast<int>(std::floor(x));
            const float weight = x - static_cast<float>(left);
            bool border = false;
            const float expected =
                address(mode, left, border) * (1 - weight) + address(mode, left + 1, border) * weight;
            // Filter weights have 8 bits.
            EXPECT_NEAR(values[static_cast<std::size_t>(i)][0], expected * unit, 3.0f * unit / 256.0f + 2e-3f) << i;
        }
    }
}

TEST_P(SamplerRows, BorderColors) {
    SKIP_WITHOUT(capabilities().border_color);
    const Texture texture = ramp();
    const std::array<std::array<float, 4>, 3> colors{{{0, 0, 0, 0}, {0, 0, 0, 1}, {1, 1, 1, 1}}};
    for (const BorderColor border :
         {BorderColor::transparent_black, BorderColor::opaque_black, BorderColor::opaque_white}) {
        const auto values = sample(texture,
                                   {.magnify = Filter::nearest,
                                    .minify = Filter::nearest,
                                    .mip = Filter::nearest,
                                    .address_u = AddressMode::clamp_to_border,
                                    .address_v = AddressMode::clamp_to_border,
                                    .border = border},
                                   {-0.5f, 2.0f, 0.5f, 0.0f, 2});
        EXPECT_EQ(values[0], colors[static_cast<std::size_t>(border)]);
        EXPECT_EQ(values[1], colors[static_cast<std::size_t>(border)]);
    }
}

TEST_P(SamplerRows, MipsAreChosenBlendedAndClamped) {
    const TextureDesc desc{.format = Format::rgba8_unorm,
                           .width = 8,
                           .height = 8,
                           .mips = 4,
                           .usage = TextureUsage::sampled | TextureUsage::copy_destination,
                           .name = "mips"};
    const Texture texture = ok(device().create_texture(desc));
    for (std::uint32_t mip = 0; mip < 4; ++mip) {
        const std::vector<std::uint8_t> texels(mip_bytes(desc, mip), static_cast<std::uint8_t>(60 * mip));
        ok(device().write_texture(texture, std::as_bytes(std::span(texels)), mip));
    }
    const auto at = [&](SamplerDesc wanted, float lod) {
        return sample(texture, wanted, {0.5f, 0.0f, 0.5f, lod, 1})[0][0] / unit;
    };
    for (const float lod : {-1.0f, 0.0f, 0.3f, 0.7f, 1.0f, 1.6f, 2.25f, 3.0f, 7.0f}) {
        const float clamped = std::clamp(lod, 0.0f, 3.0f);
        EXPECT_NEAR(at({.mip = Filter::linear}, lod), clamped, 0.03f) << lod;
        EXPECT_NEAR(at({.mip = Filter::nearest}, lod), std::ceil(clamped + 0.5f) - 1.0f, 0.01f) << lod;
        EXPECT_NEAR(at({.mip = Filter::linear, .min_lod = 0.5f, .max_lod = 2.0f}, lod), std::clamp(lod, 0.5f, 2.0f),
                    0.03f)
            << lod;
    }
}

TEST_P(SamplerRows, ComparisonOfDepth) {
    const TextureDesc desc{.format = Format::d32_float,
                           .width = 4,
                           .height = 1,
                           .usage = TextureUsage::sampled | TextureUsage::depth_target | TextureUsage::copy_destination,
                           .name = "depth"};
    const Texture texture = ok(device().create_texture(desc));
    const std::array<float, 4> depths{0.125f, 0.25f, 0.5f, 0.75f};
    ok(device().write_texture(texture, std::as_bytes(std::span(depths))));
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 4) in;
        layout(set = 0, binding = 0) buffer Result { float result[4]; };
        layout(set = 0, binding = 1) uniform sampler2DShadow image;
        void main() {
            uint i = gl_LocalInvocationIndex;
            result[i] = textureLod(image, vec3((float(i) + 0.5) / 4.0, 0.5, 0.5), 0.0);
        }
    )");
    // The reference 0.5 against each depth.
    const std::array<std::pair<CompareOperation, std::array<float, 4>>, 8> cases{{
        {CompareOperation::never, {0, 0, 0, 0}},
        {CompareOperation::less, {0, 0, 0, 1}},
        {CompareOperation::equal, {0, 0, 1, 0}},
        {CompareOperation::less_or_equal, {0, 0, 1, 1}},
        {CompareOperation::greater, {1, 1, 0, 0}},
        {CompareOperation::not_equal, {1, 1, 0, 1}},
        {CompareOperation::greater_or_equal, {1, 1, 1, 0}},
        {CompareOperation::always, {1, 1, 1, 1}},
    }};
    for (const auto& [operation, expected] : cases) {
        const Buffer result = buffer(16, BufferUsage::storage);
        dispatch(pipeline, {{.binding = 0, .buffer = result},
                            {.binding = 1,
                             .texture = texture,
                             .sampler = sampler({.magnify = Filter::nearest,
                                                 .minify = Filter::nearest,
                                                 .mip = Filter::nearest,
                                                 .address_u = AddressMode::clamp_to_edge,
                                                 .address_v = AddressMode::clamp_to_edge,
                                                 .comparison = true,
                                                 .compare = operation})}});
        EXPECT_EQ(read<float>(result), (std::vector<float>(expected.begin(), expected.end())))
            << static_cast<int>(operation);
    }
}

TEST_P(SamplerRows, AnisotropySharpensAlongOneAxis) {
    SKIP_WITHOUT(capabilities().anisotropic_filtering);
    // Rows alternate, so what is sampled tells whether the small or the large axis chose the mip.
    const TextureDesc desc{.format = Format::rgba8_unorm,
                           .width = 64,
                           .height = 64,
                           .mips = 7,
                           .usage = TextureUsage::sampled | TextureUsage::copy_destination,
                           .name = "stripes"};
    const Texture texture = ok(device().create_texture(desc));
    for (std::uint32_t mip = 0; mip < 7; ++mip) {
        const std::vector<std::uint8_t> texels(mip_bytes(desc, mip), static_cast<std::uint8_t>(mip * 40));
        ok(device().write_texture(texture, std::as_bytes(std::span(texels)), mip));
    }
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { float result[1]; };
        layout(set = 0, binding = 1) uniform sampler2D image;
        void main() { result[0] = textureGrad(image, vec2(0.5), vec2(8.0 / 64.0, 0.0), vec2(0.0, 1.0 / 64.0)).r * 255.0 / 40.0; }
    )");
    const auto level = [&](float anisotropy) {
        const Buffer result = buffer(4, BufferUsage::storage);
        dispatch(pipeline, {{.binding = 0, .buffer = result},
                            {.binding = 1, .texture = texture, .sampler = sampler({.max_anisotropy = anisotropy})}});
        return read<float>(result)[0];
    };
    EXPECT_NEAR(level(1.0f), 3.0f, 0.1f);
    EXPECT_LT(level(std::min(8.0f, capabilities().max_anisotropy)), 1.0f);
}

TEST_P(Samplers, CoordinatesBeginAtTheTopLeft) {
    // Row 0 of what is written is v = 0, in textures that were written and in those that were drawn.
    const std::array<std::uint32_t, 4> texels{0xff000000u, 0xff000040u, 0xff000080u, 0xff0000c0u};
    const Texture written = texture_of<std::uint32_t>(Format::rgba8_unorm, 2, 2, texels);
    const Texture drawn = target(Format::rgba8_unorm, 2, 2, "drawn", TextureUsage::sampled);
    cover(drawn,
          "layout(location = 0) out vec4 color; void main() { color = vec4((floor(gl_FragCoord.x) * 64.0 + "
          "floor(gl_FragCoord.y) * 128.0) / 255.0, 0, 0, 1); }");
    EXPECT_EQ(read<std::uint32_t>(drawn), std::vector<std::uint32_t>(texels.begin(), texels.end()));
    const std::string body = R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { float result[4]; };
        layout(set = 0, binding = 1) uniform sampler2D image;
        void main() {
            for (int i = 0; i < 4; ++i)
                result[i] = textureLod(image, vec2(float(i % 2) * 0.5 + 0.25, float(i / 2) * 0.5 + 0.25), 0.0).r * 255.0 / 64.0;
        }
    )";
    for (const Texture texture : {written, drawn}) {
        const auto values = evaluate<float>(body, 4, {{.binding = 1, .texture = texture, .sampler = nearest()}});
        for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(values[i], static_cast<float>(i), 0.02f);
    }
}

TEST_P(Samplers, GatherTakesFourTexels) {
    const std::array<float, 4> texels{1, 2, 3, 4};
    const Texture texture = texture_of<float>(Format::r32_float, 2, 2, texels);
    const auto values = evaluate<float>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { vec4 result; };
        layout(set = 0, binding = 1) uniform sampler2D image;
        void main() { result = textureGather(image, vec2(0.5)); }
    )",
                                        4, {{.binding = 1, .texture = texture, .sampler = nearest()}});
    EXPECT_EQ(values, (std::vector<float>{3, 4, 2, 1}));
}

}  // namespace
}  // namespace nacre::test
