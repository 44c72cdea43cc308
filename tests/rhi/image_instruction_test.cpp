// SPDX-License-Identifier: Apache-2.0
// The forms in which GLSL reads textures, each against the plain form that it stands for, and what textures tell of
// themselves.
#include <array>
#include <string>
#include <vector>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

class ImageInstructions : public BackendTest {
  public:
    static constexpr std::uint32_t size = 16;

    /// Texels that are all different: their number, halved with each mip.
    Texture numbered(TextureDimension dimension = TextureDimension::d2, std::uint32_t mips = 1,
                     Format format = Format::r32_float, std::uint32_t layers = 1) {
        TextureDesc desc{.dimension = dimension,
                         .format = format,
                         .width = size,
                         .layers = layers,
                         .mips = mips,
                         .usage = TextureUsage::sampled | TextureUsage::copy_destination,
                         .name = "numbered"};
        if (dimension != TextureDimension::d1) desc.height = size;
        if (dimension == TextureDimension::d3) desc.depth = size;
        const Texture made = ok(device().create_texture(desc));
        for (std::uint32_t mip = 0; mip < mips; ++mip)
            for (std::uint32_t layer = 0; layer < layers; ++layer) {
                std::vector<float> texels(mip_bytes(desc, mip) / 4);
                for (std::size_t i = 0; i < texels.size(); ++i)
                    texels[i] = static_cast<float>(i + 1 + 5000 * mip + 20000 * layer) / 65536.0f;
                ok(device().write_texture(made, std::as_bytes(std::span(texels)), mip, layer));
            }
        return made;
    }
    [[nodiscard]] bool is_es() const { return GetParam().backend.starts_with("gles"); }

    /// Runs `a` and `b` (each a float, of `p`: a place in texels' middles that differs from pixel to pixel, and `q`) in
    /// a fragment shader with `source` at binding 0; both must be the same and not 0 everywhere.
    void expect_same(const std::string& type, Texture texture, Sampler sampler, const std::string& a,
                     const std::string& b) {
        const Texture found = target(Format::rgba8_unorm, size, size, "found");
        cover(found,
              "layout(set = 0, binding = 0) uniform " + type +
                  " source;\n"
                  "layout(location = 0) out vec4 color;\n"
                  "void main() {\n"
                  "    vec3 p = vec3(gl_FragCoord.xy, mod(gl_FragCoord.x * 5.0 + gl_FragCoord.y, 16.0)) / 16.0;\n"
                  "    p.z = (floor(p.z * 16.0) + 0.5) / 16.0;\n"
                  "    float q = 0.5 + floor(gl_FragCoord.y) * 0.25;\n    " +
                  "float a = " + a + "; float b = " + b +
                  ";\n    color = vec4(a == b ? 1.0 : 0.0, fract(a * 1234.567), 0.0, 1.0);\n}",
              {{.binding = 0, .texture = texture, .sampler = sampler}});
        const auto values = read<std::array<std::uint8_t, 4>>(found);
        bool is_any_other = false;
        for (std::size_t i = 0; i < values.size(); ++i) {
            ASSERT_EQ(values[i][0], 255) << a << " is not " << b << " at pixel " << i % size << ", " << i / size;
            is_any_other |= values[i][1] != values[0][1];
        }
        EXPECT_TRUE(is_any_other) << a << ": all the same";
    }
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(ImageInstructions);
INSTANTIATE_TEST_SUITE_P(Rhi, ImageInstructions, ::testing::ValuesIn(available_variants()),
                         [](const auto& parameter) { return parameter.param.name; });

TEST_P(ImageInstructions, ProjectedCoordinatesAreDivided) {
    const Texture plane = numbered();
    const Sampler sampler = nearest();
    const char* const plain = "textureLod(source, p.xy, 0.0).x";
    expect_same("sampler2D", plane, sampler, "textureProj(source, vec3(p.xy * q, q)).x", plain);
    expect_same("sampler2D", plane, sampler, "textureProj(source, vec4(p.xy * q, 7.0, q)).x", plain);
    expect_same("sampler2D", plane, sampler, "textureProjLod(source, vec3(p.xy * q, q), 0.0).x", plain);
    expect_same("sampler2D", plane, sampler, "textureProjGrad(source, vec3(p.xy * q, q), vec2(0.0), vec2(0.0)).x",
                plain);
    expect_same("sampler2D", plane, sampler, "textureProjOffset(source, vec3(p.xy * q, q), ivec2(1, -2)).x",
                "textureLodOffset(source, p.xy, 0.0, ivec2(1, -2)).x");
    expect_same("sampler2D", plane, sampler, "textureProjLodOffset(source, vec3(p.xy * q, q), 0.0, ivec2(-1, 3)).x",
                "textureLod(source, p.xy + vec2(-1.0, 3.0) / 16.0, 0.0).x");
    const Texture volume = numbered(TextureDimension::d3);
    expect_same("sampler3D", volume, sampler, "textureProj(source, vec4(p * q, q)).x", "textureLod(source, p, 0.0).x");
    expect_same("sampler3D", volume, sampler, "textureProjLod(source, vec4(p * q, q), 0.0).x",
                "textureLod(source, p, 0.0).x");
}

TEST_P(ImageInstructions, ProjectedComparisonsAreDividedToo) {
    SKIP_WITHOUT(supports(Format::d32_float, FormatSupport::sampled));
    const Texture depth = numbered(TextureDimension::d2, 1, Format::d32_float);
    const Sampler less = sampler({.magnify = Filter::nearest,
                                  .minify = Filter::nearest,
                                  .mip = Filter::nearest,
                                  .address_u = AddressMode::clamp_to_edge,
                                  .address_v = AddressMode::clamp_to_edge,
                                  .comparison = true,
                                  .compare = CompareOperation::less});
    // The reference lies between the least and the greatest texel.
    const char* const plain = "textureGrad(source, vec3(p.xy, 0.002), vec2(0.0), vec2(0.0))";
    expect_same("sampler2DShadow", depth, less, "textureProj(source, vec4(p.xy * q, 0.002 * q, q))", plain);
    expect_same("sampler2DShadow", depth, less, "textureProjLod(source, vec4(p.xy * q, 0.002 * q, q), 0.0)", plain);
    expect_same("sampler2DShadow", depth, less, "textureLod(source, vec3(p.xy, 0.002), 0.0)", plain);
    expect_same("sampler2DShadow", depth, less, "texture(source, vec3(p.xy, 0.002))", plain);
    // The four texels that a linear filter would take, each compared by itself.
    expect_same("sampler2DShadow", depth, less, "dot(textureGather(source, p.xy + 0.02, 0.002), vec4(1, 2, 4, 8))",
                "dot(vec4(textureLod(source, vec3(p.xy + vec2(0, 1) / 16.0, 0.002), 0.0), "
                "textureLod(source, vec3(p.xy + vec2(1, 1) / 16.0, 0.002), 0.0), "
                "textureLod(source, vec3(p.xy + vec2(1, 0) / 16.0, 0.002), 0.0), "
                "textureLod(source, vec3(p.xy, 0.002), 0.0)), vec4(1, 2, 4, 8))");
}

TEST_P(ImageInstructions, OffsetsMoveByWholeTexels) {
    const Texture plane = numbered(TextureDimension::d2, 2);
    const Sampler sampler = nearest();
    expect_same("sampler2D", plane, sampler, "textureOffset(source, p.xy, ivec2(2, 1)).x",
                "textureLod(source, p.xy + vec2(2.0, 1.0) / 16.0, 0.0).x");
    expect_same("sampler2D", plane, sampler, "textureGradOffset(source, p.xy, vec2(0.0), vec2(0.0), ivec2(-3, 1)).x",
                "textureLod(source, p.xy + vec2(-3.0, 1.0) / 16.0, 0.0).x");
    expect_same("sampler2D", plane, sampler, "textureLodOffset(source, p.xy, 1.0, ivec2(1, 1)).x",
                "textureLod(source, p.xy + vec2(1.0, 1.0) / 8.0, 1.0).x");
    // Inside of the texture: texelFetch has no edge to clamp to.
    expect_same("sampler2D", plane, sampler,
                "texelFetchOffset(source, clamp(ivec2(gl_FragCoord.xy), 1, 14), 0, ivec2(1, -1)).x",
                "texelFetch(source, clamp(ivec2(gl_FragCoord.xy), 1, 14) + ivec2(1, -1), 0).x");
    expect_same("sampler2D", plane, sampler,
                "dot(textureGatherOffset(source, p.xy + 0.02, ivec2(1, -2)), vec4(1, 2, 4, 8))",
                "dot(textureGather(source, p.xy + 0.02 + vec2(1, -2) / 16.0), vec4(1, 2, 4, 8))");
}

TEST_P(ImageInstructions, TexturesTellTheirSizes) {
    const Texture array = numbered(TextureDimension::d2, 3, Format::r32_float, 5),
                  volume = numbered(TextureDimension::d3);
    const Buffer result = buffer(16 * 4, BufferUsage::storage, "result");
    dispatch(compute(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { ivec4 result[4]; };
        layout(set = 0, binding = 1) uniform sampler2DArray a;
        layout(set = 0, binding = 2) uniform sampler3D v;
        void main() {
            result[0] = ivec4(textureSize(a, 0), 7);
            result[1] = ivec4(textureSize(a, 2), 7);
            result[2] = ivec4(textureSize(v, 0), 7);
            result[3] = ivec4(0);
        }
    )"),
             {{.binding = 0, .buffer = result},
              {.binding = 1, .texture = array, .sampler = nearest()},
              {.binding = 2, .texture = volume, .sampler = nearest()}});
    EXPECT_EQ(read<std::int32_t>(result),
              (std::vector<std::int32_t>{16, 16, 5, 7, 4, 4, 5, 7, 16, 16, 16, 7, 0, 0, 0, 0}));
}

TEST_P(ImageInstructions, TexturesTellTheirLevelsAndSamples) {
    // ESSL has no such functions; it is not a property of the device.
    if (is_es()) GTEST_SKIP() << "OpenGL ES has no textureQueryLevels, textureQueryLod and textureSamples";
    SKIP_WITHOUT(capabilities().max_samples >= 4);
    const Texture mips = numbered(TextureDimension::d2, 4);
    const Texture samples = target(Format::rgba8_unorm, 8, 8, "samples", TextureUsage::sampled, 4);
    CommandList list = device().create_command_list("clear");
    list.begin_render_pass({.color = {{.view = samples, .load = LoadOperation::clear}}});
    list.end_render_pass();
    run(std::move(list));
    const auto found = evaluate<std::int32_t>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { int result[2]; };
        layout(set = 0, binding = 1) uniform sampler2D m;
        layout(set = 0, binding = 2) uniform sampler2DMS s;
        void main() { result[0] = textureQueryLevels(m); result[1] = textureSamples(s); }
    )",
                                              2,
                                              {{.binding = 1, .texture = mips, .sampler = nearest()},
                                               {.binding = 2, .texture = samples, .sampler = nearest()}});
    EXPECT_EQ(found, (std::vector<std::int32_t>{4, 4}));
    // 16 texels over the picture's 16 pixels, twice over: mip 1.
    const Texture picture = target(Format::rgba32_float, size, size, "picture");
    cover(picture, R"(
        layout(set = 0, binding = 0) uniform sampler2D source;
        layout(location = 0) out vec4 color;
        void main() { color = vec4(textureQueryLod(source, gl_FragCoord.xy / 8.0), 0.0, 1.0); })",
          {{.binding = 0, .texture = mips, .sampler = nearest()}});
    for (const auto& color : read<std::array<float, 4>>(picture)) {
        EXPECT_NEAR(color[0], 1.0f, 0.01f);
        EXPECT_NEAR(color[1], 1.0f, 0.01f);
    }
}

}  // namespace
}  // namespace nacre::test
