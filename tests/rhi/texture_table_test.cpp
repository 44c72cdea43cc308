// SPDX-License-Identifier: Apache-2.0
#include "rhi/texture_table.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <random>

#include "rhi/embedded_shaders.h"
#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;
using ::testing::HasSubstr;
using Texel = std::array<std::uint8_t, 4>;

constexpr std::uint32_t picture_size = 96;

class TextureTables : public BackendTest {
  public:
    /// A texture of noise with a full chain of mips (or as many as told).
    Texture noise(std::uint32_t width, std::uint32_t height, std::uint32_t seed, Format format = Format::rgba8_unorm,
                  std::uint32_t mips = 0) {
        const TextureDesc desc{
            .format = format,
            .width = width,
            .height = height,
            .mips = mips ? mips : full_mip_count(width, height),
            .usage = TextureUsage::sampled | TextureUsage::copy_source | TextureUsage::copy_destination,
            .name = "noise " + std::to_string(seed)};
        const Texture texture = ok(device().create_texture(desc));
        std::mt19937 random(seed);
        for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
            std::vector<std::byte> bytes(mip_bytes(desc, mip));
            for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
            ok(device().write_texture(texture, bytes, mip));
        }
        return texture;
    }

    Texture flat(std::uint32_t size, Texel color, Format format = Format::rgba8_unorm) {
        const TextureDesc desc{
            .format = format,
            .width = size,
            .height = size,
            .mips = full_mip_count(size, size),
            .usage = TextureUsage::sampled | TextureUsage::copy_source | TextureUsage::copy_destination,
            .name = "flat"};
        const Texture texture = ok(device().create_texture(desc));
        for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
            std::vector<Texel> texels(mip_bytes(desc, mip) / 4, color);
            ok(device().write_texture(texture, std::as_bytes(std::span(texels)), mip));
        }
        return texture;
    }

    Sampler sampler(Filter filter = Filter::linear, AddressMode address = AddressMode::repeat) {
        return ok(device().create_sampler({.magnify = filter, .minify = filter, .mip = filter, .address_u = address,
                                           .address_v = address, .name = "sampler"}));
    }

    TextureTable table(TextureTableDesc desc = {}) { return ok(TextureTable::create(device(), desc)); }

    /// Shades every pixel of a picture with `expression` of `uv`, `index` and the table's functions. `index` is a
    /// different one for each pixel of a 2x2 quad: the hard case.
    std::vector<std::array<float, 4>> shade(TextureTable& table, const std::string& expression,
                                            std::uint32_t index_count) {
        ShaderCompiler compiler({.embedded = {embedded_files()}});
        const ShaderDesc text =
            ok(compiler.compile({.path = "table.frag", .defines = table.defines(), .text = R"(#version 460
            #include "rhi/shaders/texture_table.glsl"
            layout(push_constant) uniform Parameters { uint index_count; } parameters;
            layout(location = 0) in vec2 uv;
            layout(location = 0) out vec4 color;
            void main() {
                uvec2 pixel = uvec2(gl_FragCoord.xy);
                uint index = (pixel.x + 3u * pixel.y) % parameters.index_count;
                // Across the picture from large magnification to far minification, and over the edge.
                vec2 position = uv * uv * 12.0 - 0.3;
                color = )" + expression + R"(;
            })"}));
        return draw(text, index_count, [&](CommandList& list, GraphicsPipeline pipeline) {
            const std::uint32_t set = 1;
            list.set_bind_group(set, ok(table.bind_group(ok(device().bind_group_layout(pipeline, set)))));
        });
    }

    /// The same with the textures bound one by one.
    std::vector<std::array<float, 4>> shade_directly(std::span<const std::pair<Texture, Sampler>> textures,
                                                     bool explicit_gradients) {
        std::string body = R"(
            layout(push_constant) uniform Parameters { uint index_count; } parameters;
            layout(location = 0) in vec2 uv;
            layout(location = 0) out vec4 color;
)";
        for (std::size_t i = 0; i < textures.size(); ++i)
            body +=
                "layout(set = 0, binding = " + std::to_string(i) + ") uniform sampler2D t" + std::to_string(i) + ";\n";
        body += R"(void main() {
                uvec2 pixel = uvec2(gl_FragCoord.xy);
                uint index = (pixel.x + 3u * pixel.y) % parameters.index_count;
                vec2 position = uv * uv * 12.0 - 0.3;
                color = vec4(0.0);
)";
        // Outside of any branch.
        for (std::size_t i = 0; i < textures.size(); ++i)
            body += "vec4 c" + std::to_string(i) + (explicit_gradients ? " = textureGrad(t" : " = texture(t") +
                    std::to_string(i) +
                    (explicit_gradients ? ", position, dFdx(position), dFdy(position));\n" : ", position);\n");
        for (std::size_t i = 0; i < textures.size(); ++i)
            body += "if (index == " + std::to_string(i) + "u) color = c" + std::to_string(i) + ";\n";
        return draw(compile(ShaderStage::fragment, body + "}"), static_cast<std::uint32_t>(textures.size()),
                    [&](CommandList& list, GraphicsPipeline pipeline) {
                        std::vector<BindGroupEntry> entries;
                        for (std::uint32_t i = 0; i < textures.size(); ++i)
                            entries.push_back(
                                {.binding = i, .texture = textures[i].first, .sampler = textures[i].second});
                        list.set_bind_group(0, ok(device().create_bind_group(
                                                   {.layout = ok(device().bind_group_layout(pipeline, 0)),
                                                    .entries = entries, .name = "direct"})));
                    });
    }

  private:
    template <typename Bind>
    std::vector<std::array<float, 4>> draw(const ShaderDesc& fragment, std::uint32_t index_count, const Bind& bind) {
        const Format format = supports(Format::rgba16_float, FormatSupport::color_target) ? Format::rgba16_float
                                                                                           : Format::rgba8_unorm;
        const Texture picture = target(format, picture_size, picture_size, "picture");
        const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(
            {.vertex = shader(ShaderStage::vertex, fullscreen_vertex), .fragment = ok(device().create_shader(fragment)),
             .color_targets = {{.format = format}}, .name = "table"}));
        CommandList list = device().create_command_list("table");
        list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}, .name = "table"});
        list.set_pipeline(pipeline);
        list.set_push_constants(index_count);
        bind(list, pipeline);
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        run(std::move(list));
        std::vector<std::array<float, 4>> texels;
        if (format == Format::rgba8_unorm) {
            for (const Texel& texel : read<Texel>(picture))
                texels.push_back({texel[0] / 255.0f, texel[1] / 255.0f, texel[2] / 255.0f, texel[3] / 255.0f});
        } else {
            for (const auto& texel : read<std::array<std::uint16_t, 4>>(picture))
                texels.push_back({half(texel[0]), half(texel[1]), half(texel[2]), half(texel[3])});
        }
        return texels;
    }

    static float half(std::uint16_t bits) {
        const int exponent = bits >> 10 & 31;
        const float mantissa = static_cast<float>(bits & 1023);
        const float value = exponent ? std::ldexp(1.0f + mantissa / 1024.0f, exponent - 15) : std::ldexp(mantissa, -24);
        return bits & 0x8000 ? -value : value;
    }
};

/// Share of pixels with a channel off by more than `tolerance`.
double share_beyond(const std::vector<std::array<float, 4>>& a, const std::vector<std::array<float, 4>>& b,
                    float tolerance) {
    if (a.size() != b.size() || a.empty()) return 1.0;
    std::size_t beyond = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        bool is_off = false;
        for (std::size_t c = 0; c < 4; ++c) is_off |= !(std::abs(a[i][c] - b[i][c]) <= tolerance);
        beyond += is_off;
    }
    return static_cast<double>(beyond) / static_cast<double>(a.size());
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(TextureTables);
INSTANTIATE_TEST_SUITE_P(Rhi, TextureTables, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

TEST_P(TextureTables, EveryPixelItsOwnTexture) {
    TextureTable table = this->table();
    const Sampler any = sampler();
    const Texel colors[] = {{255, 0, 0, 255}, {0, 255, 0, 255}, {0, 0, 255, 255}, {10, 20, 30, 40}, {200, 100, 50, 25}};
    // Sizes of every kind, in two formats' worth of pages.
    const std::uint32_t sizes[] = {8, 16, 8, 1, 32};
    for (std::uint32_t i = 0; i < 5; ++i) EXPECT_EQ(ok(table.add(flat(sizes[i], colors[i]), any)), i);
    ok(table.update());
    EXPECT_EQ(table.page_count(), table.uses_pages() ? 4u : 0u);

    for (const char* expression : {"sample_table(index, position)", "sample_table_lod(index, position, 0.0)",
                                   "fetch_table(index, ivec2(0), 0)"}) {
        const auto picture = shade(table, expression, 5);
        for (std::uint32_t y = 0; y < picture_size; ++y) {
            for (std::uint32_t x = 0; x < picture_size; ++x) {
                const Texel& color = colors[(x + 3 * y) % 5];
                for (std::size_t c = 0; c < 4; ++c)
                    ASSERT_NEAR(picture[y * picture_size + x][c], color[c] / 255.0f, 0.003f)
                        << expression << " at " << x << ", " << y;
            }
        }
    }
    const auto sizes_seen = shade(table, "vec4(vec2(table_texture_size(index, 0)) / 64.0, 0, 1)", 5);
    for (std::uint32_t x = 0; x < 5; ++x) EXPECT_NEAR(sizes_seen[x][0] * 64.0f, static_cast<float>(sizes[x]), 0.3f);
}

TEST_P(TextureTables, MipsAndFiltersEqualDirectSampling) {
    const std::pair<Texture, Sampler> textures[] = {
        {noise(64, 64, 1), sampler()},
        {noise(64, 64, 2), sampler(Filter::nearest)},
        {noise(128, 32, 3), sampler()},
        {noise(64, 64, 4), sampler(Filter::linear, AddressMode::clamp_to_edge)},
        {noise(50, 30, 5), sampler(Filter::linear, AddressMode::mirrored_repeat)},
    };
    for (const bool force_pages : {false, true}) {
        TextureTable table = this->table({.force_pages = force_pages});
        for (const auto& [texture, filter] : textures) ok(table.add(texture, filter));
        ok(table.update());
        // Drivers take the level of detail from implicit derivatives with other rounding than from explicit ones, which
        // pages need: each is compared with its own kind.
        const auto direct = shade_directly(textures, table.uses_pages());
        const auto indexed = shade(table, "sample_table(index, position)", 5);
        EXPECT_LT(share_beyond(direct, indexed, 0.002f), 0.001) << (force_pages ? "pages" : "as the device has it");
        if (!capabilities().descriptor_indexing) break;
    }
}

TEST_P(TextureTables, MergedPagesLookTheSameWhenMinified) {
    const Sampler any = sampler();
    const std::pair<Texture, Sampler> textures[] = {{noise(64, 64, 1), any}, {noise(32, 32, 2), any}};
    TextureTable table = this->table({.max_pages = 1, .force_pages = true});
    for (const auto& [texture, filter] : textures) ok(table.add(texture, filter));
    ok(table.update());
    EXPECT_EQ(table.page_count(), 1u);
    const auto direct = shade_directly(textures, true);
    const auto indexed = shade(table, "sample_table(index, position)", 2);
    // The large texture is as it was; the small one, where it is minified, too.
    std::size_t beyond = 0, counted = 0;
    for (std::uint32_t y = picture_size / 2; y < picture_size; ++y) {
        for (std::uint32_t x = picture_size / 2; x < picture_size; ++x) {
            const std::size_t i = y * picture_size + x;
            for (std::size_t c = 0; c < 4; ++c) beyond += std::abs(direct[i][c] - indexed[i][c]) > 0.03f;
            ++counted;
        }
    }
    EXPECT_LT(static_cast<double>(beyond), 0.02 * static_cast<double>(counted));
}

TEST_P(TextureTables, FormatsMergeWhereTheyMust) {
    SKIP_WITHOUT(capabilities().supports(Format::rgba16_float, FormatSupport::color_target));
    const Sampler any = sampler();
    // sRGB 188 is 0.503 in linear light.
    const Texture linear = flat(16, {51, 102, 153, 204}), srgb = flat(8, {188, 188, 188, 204}, Format::rgba8_srgb);
    TextureTable table = this->table({.max_pages = 1, .force_pages = true});
    ok(table.add(linear, any));
    ok(table.add(srgb, any));
    ok(table.update());
    EXPECT_EQ(table.page_count(), 1u);
    const auto picture = shade(table, "sample_table(index, position)", 2);
    EXPECT_NEAR(picture[0][0], 0.2f, 0.002f);
    EXPECT_NEAR(picture[1][0], 0.503f, 0.004f);
    EXPECT_NEAR(picture[1][3], 0.8f, 0.002f);
}

TEST_P(TextureTables, GrowsShrinksAndKeepsItsIndices) {
    for (const bool force_pages : {false, true}) {
        TextureTable table = this->table({.capacity = 40, .force_pages = force_pages});
        const Sampler any = sampler();
        std::vector<Texel> colors;
        for (std::uint8_t i = 0; i < 20; ++i) {
            colors.push_back({static_cast<std::uint8_t>(i * 10), static_cast<std::uint8_t>(255 - i), 7, 255});
            EXPECT_EQ(ok(table.add(flat(8, colors.back()), any)), i);
            if (i % 3 == 0) ok(table.update());
        }
        ok(table.update());
        table.remove(4);
        table.remove(4);
        table.remove(1000);
        colors[4] = {0, 0, 0, 0};
        // The freed index is not given away before shaders have stopped to see the old texture.
        colors.push_back({1, 2, 3, 4});
        EXPECT_EQ(ok(table.add(flat(8, colors.back()), any)), 20u);
        ok(table.update());
        const auto picture = shade(table, "sample_table_lod(index, position, 0.0)", 21);
        for (std::uint32_t x = 0; x < 21; ++x)
            for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(picture[x][c], colors[x][c] / 255.0f, 0.003f) << x;
        EXPECT_EQ(ok(table.add(flat(8, {9, 9, 9, 9}), any)), 4u);
        ok(table.update());
        EXPECT_NEAR(shade(table, "sample_table_lod(index, position, 0.0)", 21)[4][0], 9 / 255.0f, 0.003f);
        EXPECT_NEAR(shade(table, "sample_table_lod(4000000000u, position, 0.0)", 21)[4][0], 0.0f, 0.003f);
        if (!capabilities().descriptor_indexing) break;
    }
}

TEST_P(TextureTables, WrongTexturesAreErrors) {
    TextureTable table = this->table({.capacity = 1});
    const auto refused = [&](TextureDesc desc) {
        desc.name = "wrong";
        const auto result = table.add(ok(device().create_texture(desc)), sampler());
        EXPECT_FALSE(result);
        return result ? std::string() : result.error().message();
    };
    const TextureUsage usage = TextureUsage::sampled | TextureUsage::copy_source;
    EXPECT_THAT(refused({.format = Format::rgba8_unorm, .width = 4, .height = 4, .layers = 2, .usage = usage}),
                HasSubstr("'wrong'"));
    EXPECT_THAT(refused({.format = Format::rgba8_unorm, .width = 4, .height = 4, .usage = TextureUsage::sampled}),
                HasSubstr("copy_source"));
    EXPECT_THAT(refused({.format = Format::rgba8_uint, .width = 4, .height = 4, .usage = usage}),
                HasSubstr("rgba8_uint"));
    ok(table.add(flat(4, {}), sampler()));
    const auto full = table.add(flat(4, {}), sampler());
    ASSERT_FALSE(full);
    EXPECT_EQ(full.error().code, ErrorCode::out_of_memory);

    EXPECT_FALSE(TextureTable::create(device(), {.capacity = 0}));
    EXPECT_FALSE(TextureTable::create(device(), {.capacity = 5000}));
    EXPECT_FALSE(TextureTable::create(device(), {.max_pages = 13}));
    EXPECT_FALSE(TextureTable::create(device(), {.set = 9}));

    TextureTable small = this->table({.max_pages = 1, .force_pages = true});
    ok(small.add(flat(4, {}), sampler()));
    ok(small.add(flat(4, {}), sampler()));  // Another sampler.
    const auto unfit = small.update();
    ASSERT_FALSE(unfit);
    EXPECT_EQ(unfit.error().code, ErrorCode::unsupported);
}

}  // namespace
}  // namespace nacre::test
