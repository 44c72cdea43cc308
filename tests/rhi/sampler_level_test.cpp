// SPDX-License-Identifier: Apache-2.0
// Sampling against a reference: filters, address modes, borders, levels of detail, comparison, anisotropy.
#include "tests/rhi/backend_test.h"

#include <array>
#include <cmath>

namespace nacre::test {
namespace {

using namespace rhi;
using Texel = std::array<std::uint8_t, 4>;

constexpr std::uint32_t size = 4;        // Of the texture.
constexpr std::uint32_t pictures = 56;   // Samples in each direction.

std::uint8_t texel_red(int x, int y) { return static_cast<std::uint8_t>(20 + 13 * x + 47 * y); }

/// Index of the texel that an address mode gives; -1: the border.
int addressed(int i, AddressMode mode) {
    const int n = static_cast<int>(size);
    switch (mode) {
        case AddressMode::repeat: return ((i % n) + n) % n;
        case AddressMode::mirrored_repeat: {
            const int m = ((i % (2 * n)) + 2 * n) % (2 * n);
            return m < n ? m : 2 * n - 1 - m;
        }
        case AddressMode::clamp_to_edge: return std::clamp(i, 0, n - 1);
        case AddressMode::clamp_to_border: return i < 0 || i >= n ? -1 : i;
    }
    return 0;
}

double reference_texel(int x, int y, AddressMode u, AddressMode v, double border) {
    const int i = addressed(x, u), j = addressed(y, v);
    return i < 0 || j < 0 ? border : texel_red(i, j) / 255.0;
}

double reference(double u, double v, Filter filter, AddressMode address_u, AddressMode address_v, double border) {
    const double x = u * size, y = v * size;
    if (filter == Filter::nearest)
        return reference_texel(static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y)), address_u, address_v,
                               border);
    const double left = std::floor(x - 0.5), top = std::floor(y - 0.5), a = x - 0.5 - left, b = y - 0.5 - top;
    const int i = static_cast<int>(left), j = static_cast<int>(top);
    const auto at = [&](int dx, int dy) { return reference_texel(i + dx, j + dy, address_u, address_v, border); };
    return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

class Sampling : public BackendTest {
  public:
    /// Evaluates `expression` (a vec4, of `uv` from -1.75 to 1.75 and the sampler `source`) in a compute shader.
    std::vector<std::array<float, 4>> evaluate(Texture texture, Sampler sampler, const std::string& expression,
                                               const std::string& type = "sampler2D") {
        const ComputePipeline pipeline = compute(
            "layout(local_size_x = 8, local_size_y = 8) in;\n"
            "layout(set = 0, binding = 0) uniform highp " + type + " source;\n"
            "layout(set = 0, binding = 1) buffer Results { vec4 results[]; };\n"
            "void main() {\n"
            "    uvec2 at = gl_GlobalInvocationID.xy;\n"
            "    vec2 uv = (vec2(at) + 0.5) / 16.0 - 1.75;\n"
            "    results[at.y * 56u + at.x] = " + expression + ";\n}");
        const Buffer results = buffer(pictures * pictures * 16, BufferUsage::storage);
        const BindGroup group = ok(device().create_bind_group(
            {.layout = ok(device().bind_group_layout(pipeline, 0)),
             .entries = {{.binding = 0, .texture = texture, .sampler = sampler}, {.binding = 1, .buffer = results}}}));
        CommandList list = device().create_command_list("sample");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group);
        list.dispatch({.x = pictures / 8, .y = pictures / 8});
        run(std::move(list));
        const auto values = read<std::array<float, 4>>(results);
        device().destroy(pipeline);
        device().destroy(results);
        return values;
    }

    Texture pattern() {
        std::array<Texel, size * size> texels{};
        for (std::uint32_t y = 0; y < size; ++y)
            for (std::uint32_t x = 0; x < size; ++x)
                texels[y * size + x] = {texel_red(static_cast<int>(x), static_cast<int>(y)), 0, 0, 255};
        const Texture texture =
            ok(device().create_texture({.format = Format::rgba8_unorm,
                                        .width = size,
                                        .height = size,
                                        .usage = TextureUsage::sampled | TextureUsage::copy_destination,
                                        .name = "pattern"}));
        ok(device().write_texture(texture, std::as_bytes(std::span(texels))));
        return texture;
    }

    /// Each mip has one value: 20 times its number plus 10.
    Texture levels(std::uint32_t width = 64) {
        const TextureDesc desc{.format = Format::rgba8_unorm, .width = width, .height = width,
                               .mips = full_mip_count(width, width),
                               .usage = TextureUsage::sampled | TextureUsage::copy_destination, .name = "levels"};
        const Texture texture = ok(device().create_texture(desc));
        for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
            const auto value = static_cast<std::uint8_t>(20 * mip + 10);
            const std::vector<Texel> texels(mip_bytes(desc, mip) / 4, Texel{value, value, value, 255});
            ok(device().write_texture(texture, std::as_bytes(std::span(texels)), mip));
        }
        return texture;
    }
    static double level_of(float value) { return (value * 255.0 - 10.0) / 20.0; }
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Sampling);
INSTANTIATE_TEST_SUITE_P(Rhi, Sampling, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

TEST_P(Sampling, FiltersAndAddressModes) {
    const Texture texture = pattern();
    const std::pair<AddressMode, AddressMode> modes[] = {
        {AddressMode::repeat, AddressMode::clamp_to_edge}, {AddressMode::clamp_to_edge, AddressMode::mirrored_repeat},
        {AddressMode::mirrored_repeat, AddressMode::repeat}};
    for (const Filter filter : {Filter::nearest, Filter::linear}) {
        for (const auto& [u, v] : modes) {
            const Sampler sampler = ok(device().create_sampler(
                {.magnify = filter, .minify = filter, .mip = Filter::nearest, .address_u = u, .address_v = v}));
            const auto found = evaluate(texture, sampler, "textureLod(source, uv, 0.0)");
            for (std::uint32_t y = 0; y < pictures; ++y)
                for (std::uint32_t x = 0; x < pictures; ++x) {
                    const double expected = reference((x + 0.5) / 16 - 1.75, (y + 0.5) / 16 - 1.75, filter, u, v, 0);
                    // Weights have at least 8 bits (1/256 of the difference of two texels in each direction).
                    ASSERT_NEAR(found[y * pictures + x][0], expected, filter == Filter::nearest ? 0.001 : 0.006)
                        << x << ", " << y << ", filter " << static_cast<int>(filter) << ", modes "
                        << static_cast<int>(u) << ", " << static_cast<int>(v);
                }
        }
    }
}

TEST_P(Sampling, LevelsOfDetailAreClampedAndMixed) {
    const Texture texture = levels();
    const auto level = [&](const SamplerDesc& desc, const std::string& expression) {
        return level_of(evaluate(texture, ok(device().create_sampler(desc)), expression)[0][0]);
    };
    const SamplerDesc linear{}, nearest{.mip = Filter::nearest};
    EXPECT_NEAR(level(linear, "textureLod(source, uv, 2.5)"), 2.5, 0.06);
    EXPECT_NEAR(level(nearest, "textureLod(source, uv, 2.4)"), 2.0, 0.01);
    EXPECT_NEAR(level(nearest, "textureLod(source, uv, 2.6)"), 3.0, 0.01);
    EXPECT_NEAR(level(linear, "textureLod(source, uv, 40.0)"), 6.0, 0.01);
    EXPECT_NEAR(level({.min_lod = 1.0f, .max_lod = 3.0f}, "textureLod(source, uv, 0.0)"), 1.0, 0.06);
    EXPECT_NEAR(level({.min_lod = 1.0f, .max_lod = 3.0f}, "textureLod(source, uv, 5.0)"), 3.0, 0.06);
    // One texel of mip 2 for each step: its size is 16.
    EXPECT_NEAR(level(linear, "textureGrad(source, uv, vec2(1.0 / 16.0, 0), vec2(0, 1.0 / 16.0))"), 2.0, 0.06);
    EXPECT_NEAR(level(linear, "textureGrad(source, uv, vec2(1.0 / 16.0, 0), vec2(0, 1.0 / 64.0))"), 2.0, 0.06);
    EXPECT_NEAR(level({.max_lod = 0.0f}, "textureGrad(source, uv, vec2(0.5, 0), vec2(0, 0.5))"), 0.0, 0.01);
}

TEST_P(Sampling, ImplicitLevelsAndBias) {
    const Texture texture = levels();
    const Texture picture = target(Format::rgba8_unorm, 16, 16);
    const auto level = [&](float scale, float sampler_bias, float shader_bias) {
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(
            {.vertex = shader(ShaderStage::vertex, fullscreen_vertex),
             .fragment = shader(ShaderStage::fragment, R"(
                layout(set = 0, binding = 0) uniform sampler2D source;
                layout(push_constant) uniform Parameters { float scale; float bias; } parameters;
                layout(location = 0) in vec2 uv;
                layout(location = 0) out vec4 color;
                void main() { color = texture(source, uv * parameters.scale, parameters.bias); })"),
             .color_targets = {{.format = Format::rgba8_unorm}}, .name = "bias"}));
        const BindGroup group = ok(device().create_bind_group(
            {.layout = ok(device().bind_group_layout(pipeline, 0)),
             .entries = {{.binding = 0, .texture = texture,
                          .sampler = ok(device().create_sampler({.mip_bias = sampler_bias}))}}}));
        CommandList list = device().create_command_list("bias");
        list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group);
        list.set_push_constants(std::array{scale, shader_bias});
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        return level_of(read<Texel>(picture)[7 * 16 + 7][0] / 255.0f);
    };
    // 64 texels over 16 pixels: level 2.
    EXPECT_NEAR(level(1.0f, 0, 0), 2.0, 0.1);
    EXPECT_NEAR(level(2.0f, 0, 0), 3.0, 0.1);
    EXPECT_NEAR(level(1.0f, 0, 1.5f), 3.5, 0.1);
    EXPECT_NEAR(level(1.0f, 0, -5), 0.0, 0.1);
    if (capabilities().sampler_mip_bias) {
        EXPECT_NEAR(level(1.0f, 1, 0), 3.0, 0.1);
    } else {
        expect_message("N-232");
        EXPECT_EQ(device().create_sampler({.mip_bias = 1.0f}).error().code, ErrorCode::unsupported);
    }
}

TEST_P(Sampling, CubesAndVolumesAreFiltered) {
    // A volume whose value grows along z alone.
    const Texture volume =
        ok(device().create_texture({.dimension = TextureDimension::d3,
                                    .format = Format::r8_unorm,
                                    .width = 2,
                                    .height = 2,
                                    .depth = 4,
                                    .usage = TextureUsage::sampled | TextureUsage::copy_destination}));
    std::vector<std::uint8_t> texels;
    for (int z = 0; z < 4; ++z) texels.insert(texels.end(), 4, static_cast<std::uint8_t>(60 * z));
    ok(device().write_texture(volume, std::as_bytes(std::span(texels))));
    const Sampler clamp = ok(device().create_sampler({.address_u = AddressMode::clamp_to_edge,
                                                      .address_v = AddressMode::clamp_to_edge,
                                                      .address_w = AddressMode::clamp_to_edge}));
    EXPECT_NEAR(evaluate(volume, clamp, "textureLod(source, vec3(0.5, 0.5, 0.5), 0.0)", "sampler3D")[0][0] * 255, 90,
                1);
    EXPECT_NEAR(evaluate(volume, clamp, "textureLod(source, vec3(0.5, 0.5, 2.0), 0.0)", "sampler3D")[0][0] * 255, 180,
                1);

    // A cube whose faces have one value each, in the order +x, -x, +y, -y, +z, -z.
    const Texture cube = ok(device().create_texture({.dimension = TextureDimension::cube, .format = Format::r8_unorm,
                                                     .width = 2, .height = 2, .layers = 6,
                                                     .usage = TextureUsage::sampled | TextureUsage::copy_destination}));
    for (std::uint32_t face = 0; face < 6; ++face) {
        const std::vector<std::uint8_t> value(4, static_cast<std::uint8_t>(40 * face));
        ok(device().write_texture(cube, std::as_bytes(std::span(value)), 0, face));
    }
    const char* directions[] = {"1, 0.1, 0.2",  "-1, 0.1, 0.2", "0.1, 1, 0.2",
                                "0.1, -1, 0.2", "0.1, 0.2, 1",  "0.1, 0.2, -1"};
    for (int face = 0; face < 6; ++face)
        EXPECT_NEAR(evaluate(cube, clamp, std::string("textureLod(source, vec3(") + directions[face] + "), 0.0)",
                             "samplerCube")[0][0] * 255, 40 * face, 1);
}

}  // namespace
}  // namespace nacre::test
