// SPDX-License-Identifier: Apache-2.0
// Parts of textures, and textures seen in another way.
#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(Views);

TEST_P(Views, OneMipAndOneLayer) {
    SKIP_WITHOUT(capabilities().texture_views);
    TextureDesc desc{.format = Format::r32_uint,
                     .width = 4,
                     .height = 4,
                     .layers = 3,
                     .mips = 3,
                     .usage = TextureUsage::sampled | all_copies,
                     .name = "t"};
    const Texture texture = ok(device().create_texture(desc));
    for (std::uint32_t layer = 0; layer < 3; ++layer)
        for (std::uint32_t mip = 0; mip < 3; ++mip) {
            const std::vector<std::uint32_t> texels(mip_bytes(desc, mip) / 4, layer * 10 + mip);
            ok(device().write_texture(texture, std::as_bytes(std::span(texels)), mip, layer));
        }
    TextureView view = TextureView::subresource(texture, 1, 2);
    const auto one = evaluate<std::uint32_t>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { uint result[2]; };
        layout(set = 0, binding = 1) uniform usampler2D image;
        void main() {
            result[0] = texelFetch(image, ivec2(0), 0).r;
            result[1] = uint(textureSize(image, 0).x);
        }
    )",
                                             2, {{.binding = 1, .texture = view, .sampler = nearest()}});
    EXPECT_EQ(one[0], 21u);
    EXPECT_EQ(one[1], 2u);
    TextureView layers(texture);
    layers.base_layer = 1;
    layers.base_mip = 2;
    const auto array = evaluate<std::uint32_t>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { uint result[3]; };
        layout(set = 0, binding = 1) uniform usampler2DArray image;
        void main() {
            result[0] = texelFetch(image, ivec3(0, 0, 0), 0).r;
            result[1] = texelFetch(image, ivec3(0, 0, 1), 0).r;
            result[2] = uint(textureSize(image, 0).z);
        }
    )",
                                               3, {{.binding = 1, .texture = layers, .sampler = nearest()}});
    EXPECT_EQ(array, (std::vector<std::uint32_t>{12, 22, 2}));
}

TEST_P(Views, FacesOfACube) {
    const TextureDesc desc{.dimension = TextureDimension::cube,
                           .format = Format::rgba8_unorm,
                           .width = 2,
                           .height = 2,
                           .layers = 6,
                           .usage = TextureUsage::sampled | all_copies,
                           .name = "cube"};
    const Texture texture = ok(device().create_texture(desc));
    for (std::uint32_t layer = 0; layer < 6; ++layer) {
        const std::vector<std::uint32_t> texels(4, 0xff000000u | (layer * 40));
        ok(device().write_texture(texture, std::as_bytes(std::span(texels)), 0, layer));
    }
    const auto faces = evaluate<float>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { float result[6]; };
        layout(set = 0, binding = 1) uniform samplerCube image;
        void main() {
            const vec3 axes[6] = vec3[](vec3(1, 0, 0), vec3(-1, 0, 0), vec3(0, 1, 0), vec3(0, -1, 0), vec3(0, 0, 1), vec3(0, 0, -1));
            for (int i = 0; i < 6; ++i) result[i] = textureLod(image, axes[i], 0.0).r * 255.0;
        }
    )",
                                       6, {{.binding = 1, .texture = texture, .sampler = nearest()}});
    for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(faces[i], static_cast<float>(i) * 40.0f, 0.5f) << i;
    if (!capabilities().texture_views) return;
    // The same faces as layers of a 2D array.
    TextureView array(texture);
    array.dimension = ViewDimension::d2_array;
    const auto layers = evaluate<float>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { float result[6]; };
        layout(set = 0, binding = 1) uniform sampler2DArray image;
        void main() { for (int i = 0; i < 6; ++i) result[i] = texelFetch(image, ivec3(0, 0, i), 0).r * 255.0; }
    )",
                                        6, {{.binding = 1, .texture = array, .sampler = nearest()}});
    EXPECT_EQ(layers, faces);
}

TEST_P(Views, OtherFormatOfTheSameSize) {
    SKIP_WITHOUT(capabilities().texture_view_formats);
    const std::array<std::uint32_t, 1> texel{0xff8000bcu};
    const Texture texture = texture_of<std::uint32_t>(Format::rgba8_unorm, 1, 1, texel);
    TextureView srgb(texture);
    srgb.format = Format::rgba8_srgb;
    const auto values = evaluate<float>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { vec4 result[2]; };
        layout(set = 0, binding = 1) uniform sampler2D as_unorm;
        layout(set = 0, binding = 2) uniform sampler2D as_srgb;
        void main() { result[0] = texelFetch(as_unorm, ivec2(0), 0); result[1] = texelFetch(as_srgb, ivec2(0), 0); }
    )",
                                        8,
                                        {{.binding = 1, .texture = texture, .sampler = nearest()},
                                         {.binding = 2, .texture = srgb, .sampler = nearest()}});
    EXPECT_NEAR(values[0], 188.0f / 255.0f, 1e-5f);
    EXPECT_NEAR(values[4], 0.5029f, 2e-3f);
    EXPECT_NEAR(values[2], 128.0f / 255.0f, 1e-5f);
    EXPECT_NEAR(values[6], 0.2159f, 2e-3f);
}

TEST_P(Views, MipsAndLayersAsTargets) {
    const TextureDesc desc{.format = Format::rgba8_unorm,
                           .width = 8,
                           .height = 8,
                           .layers = 2,
                           .mips = 3,
                           .usage = TextureUsage::color_target | all_copies,
                           .name = "targets"};
    const Texture texture = ok(device().create_texture(desc));
    const GraphicsPipeline pipeline =
        fullscreen("layout(location = 0) out vec4 color; void main() { color = vec4(gl_FragCoord.xy / 255.0, 1, 1); }",
                   Format::rgba8_unorm);
    CommandList list = device().create_command_list("targets");
    list.clear_texture(texture, {});
    list.begin_render_pass({.color = {{.view = TextureView::subresource(texture, 1, 1)}}, .name = "mip 1 of layer 1"});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
    for (std::uint32_t layer = 0; layer < 2; ++layer)
        for (std::uint32_t mip = 0; mip < 3; ++mip) {
            const auto texels = read<std::array<std::uint8_t, 4>>(texture, mip, layer);
            for (const auto& texel : texels)
                EXPECT_EQ(texel[2], mip == 1 && layer == 1 ? 255 : 0) << mip << ", " << layer;
        }
    const auto drawn = read<std::array<std::uint8_t, 4>>(texture, 1, 1);
    EXPECT_LE(drawn[15][0] - 3, 1);
    EXPECT_LE(drawn[15][1] - 3, 1);
    EXPECT_LE(drawn[3][0] - 3, 1);
    EXPECT_LE(drawn[3][1], 1);
}

}  // namespace
}  // namespace nacre::test
