// SPDX-License-Identifier: Apache-2.0
// Textures of every dimension and format: content, copies, clears, mips.
#include <cmath>
#include <random>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(Textures);

/// Bytes that are different for each seed and, as floats of any width, neither infinite nor NaN.
std::vector<std::byte> bytes_for(std::uint64_t count, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::vector<std::byte> bytes(count);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() & 0x3b);
    return bytes;
}

TEST_P(Textures, EveryMipAndLayerOfEachDimension) {
    struct Case {
        TextureDesc desc;
        bool needed = true;
    };
    std::vector<Case> cases{
        {{.dimension = TextureDimension::d1, .width = 13, .mips = 4, .name = "1D"}},
        {{.dimension = TextureDimension::d1, .width = 8, .layers = 3, .mips = 4, .name = "1D array"}},
        {{.width = 13, .height = 6, .mips = 4, .name = "2D"}},
        {{.width = 8, .height = 16, .layers = 5, .mips = 5, .name = "2D array"}},
        {{.dimension = TextureDimension::d3, .width = 7, .height = 5, .depth = 9, .mips = 4, .name = "3D"}},
        {{.dimension = TextureDimension::cube, .width = 8, .height = 8, .layers = 6, .mips = 4, .name = "cube"}},
    };
    if (capabilities().cube_arrays)
        cases.push_back(
            {{.dimension = TextureDimension::cube, .width = 4, .height = 4, .layers = 12, .mips = 3, .name = "cubes"}});
    for (Case& one : cases) {
        one.desc.format = Format::rgba8_unorm;
        one.desc.usage = TextureUsage::sampled | all_copies;
        const Texture texture = ok(device().create_texture(one.desc));
        for (std::uint32_t layer = 0; layer < one.desc.layers; ++layer)
            for (std::uint32_t mip = 0; mip < one.desc.mips; ++mip)
                ok(device().write_texture(texture, bytes_for(mip_bytes(one.desc, mip), layer * 16 + mip), mip, layer));
        for (std::uint32_t layer = 0; layer < one.desc.layers; ++layer)
            for (std::uint32_t mip = 0; mip < one.desc.mips; ++mip)
                EXPECT_EQ(ok(device().read_texture(texture, mip, layer)),
                          bytes_for(mip_bytes(one.desc, mip), layer * 16 + mip))
                    << one.desc.name << ", mip " << mip << ", layer " << layer;
        device().destroy(texture);
    }
}

TEST_P(Textures, ContentOfEveryFormat) {
    int formats = 0;
    for (std::uint32_t i = 1; i < format_count; ++i) {
        const auto format = static_cast<Format>(i);
        if (!supports(format, FormatSupport::sampled) || info(format).has_stencil) continue;
        const TextureDesc desc{.format = format,
                               .width = 20,
                               .height = 12,
                               .usage = TextureUsage::sampled | all_copies,
                               .name = std::string(info(format).name)};
        const Texture texture = ok(device().create_texture(desc));
        std::vector<std::byte> content = bytes_for(mip_bytes(desc, 0), i);
        if (format == Format::rgb9e5_float) {
            // Numbers have several codes there; with the highest bit of red set there is but one.
            for (std::size_t at = 1; at < content.size(); at += 4) content[at] |= std::byte{1};
        }
        if (format == Format::d32_float) {
            std::vector<float> depths(content.size() / 4);
            for (std::size_t at = 0; at < depths.size(); ++at) depths[at] = static_cast<float>(at) / 1024.0f;
            std::memcpy(content.data(), depths.data(), content.size());
        }
        ok(device().write_texture(texture, content));
        EXPECT_EQ(ok(device().read_texture(texture)), content) << info(format).name;
        device().destroy(texture);
        ++formats;
    }
    EXPECT_GT(formats, 30);
}

TEST_P(Textures, CopyBetweenBufferAndTextureWithRows) {
    const TextureDesc desc{.format = Format::r32_uint,
                           .width = 8,
                           .height = 6,
                           .layers = 3,
                           .usage = TextureUsage::sampled | all_copies,
                           .name = "t"};
    const Texture texture = ok(device().create_texture(desc));
    std::vector<std::uint32_t> values(64);
    for (std::uint32_t i = 0; i < values.size(); ++i) values[i] = 1000 + i;
    const Buffer from = buffer_of<std::uint32_t>(values, BufferUsage::copy_source | BufferUsage::copy_destination);
    const Buffer to = buffer(256, BufferUsage::copy_destination | BufferUsage::copy_source);
    CommandList list = device().create_command_list("rows");
    list.clear_texture(texture, {.uint = {7, 0, 0, 0}});
    // 3x2 texels to (2, 1) of layer 1; rows of 5 texels in the buffer, from the fourth value.
    list.copy_buffer_to_texture(
        from, texture,
        {.buffer_offset = 16, .bytes_per_row = 20, .layer = 1, .offset = {2, 1, 0}, .extent = {3, 2, 1}});
    list.fill_buffer(to, 0);
    list.copy_texture_to_buffer(
        texture, to, {.buffer_offset = 8, .bytes_per_row = 32, .layer = 1, .offset = {1, 1, 0}, .extent = {4, 2, 1}});
    run(std::move(list));
    for (std::uint32_t layer = 0; layer < 3; ++layer) {
        const auto texels = read<std::uint32_t>(texture, 0, layer);
        for (std::uint32_t y = 0; y < 6; ++y)
            for (std::uint32_t x = 0; x < 8; ++x) {
                const bool inside = layer == 1 && x >= 2 && x < 5 && y >= 1 && y < 3;
                EXPECT_EQ(texels[y * 8 + x], inside ? 1004 + (y - 1) * 5 + (x - 2) : 7u)
                    << layer << ": " << x << ", " << y;
            }
    }
    const auto back = read<std::uint32_t>(to);
    const std::vector<std::uint32_t> expected{0, 0, 7, 1004, 1005, 1006, 0, 0, 0, 0, 7, 1009, 1010, 1011, 0, 0};
    EXPECT_EQ(std::vector<std::uint32_t>(back.begin(), back.begin() + 16), expected);
}

TEST_P(Textures, CopyBetweenTextures) {
    TextureDesc desc{.format = Format::rgba8_unorm,
                     .width = 8,
                     .height = 8,
                     .layers = 4,
                     .mips = 3,
                     .usage = TextureUsage::sampled | all_copies,
                     .name = "from"};
    const Texture from = ok(device().create_texture(desc));
    desc.name = "to";
    const Texture to = ok(device().create_texture(desc));
    for (std::uint32_t layer = 0; layer < 4; ++layer) {
        ok(device().write_texture(from, bytes_for(256, layer), 0, layer));
        ok(device().write_texture(from, bytes_for(64, 10 + layer), 1, layer));
        ok(device().write_texture(to, std::vector<std::byte>(256, std::byte{9}), 0, layer));
        ok(device().write_texture(to, std::vector<std::byte>(64, std::byte{9}), 1, layer));
    }
    CommandList list = device().create_command_list("copy");
    list.copy_texture(
        from, to, {.source_mip = 1, .source_layer = 1, .destination_mip = 1, .destination_layer = 0, .layer_count = 2});
    list.copy_texture(from, to,
                      {.source_layer = 3,
                       .source_offset = {1, 2, 0},
                       .destination_layer = 3,
                       .destination_offset = {4, 5, 0},
                       .extent = {3, 2, 1}});
    list.copy_texture(from, from, {.source_mip = 1, .source_layer = 0, .destination_mip = 1, .destination_layer = 3});
    run(std::move(list));
    EXPECT_EQ(ok(device().read_texture(to, 1, 0)), bytes_for(64, 11));
    EXPECT_EQ(ok(device().read_texture(to, 1, 1)), bytes_for(64, 12));
    EXPECT_EQ(ok(device().read_texture(to, 1, 2)), std::vector<std::byte>(64, std::byte{9}));
    EXPECT_EQ(ok(device().read_texture(from, 1, 3)), bytes_for(64, 10));
    const auto source = cast<std::uint32_t>(bytes_for(256, 3));
    const auto copied = read<std::uint32_t>(to, 0, 3);
    for (std::uint32_t y = 0; y < 8; ++y)
        for (std::uint32_t x = 0; x < 8; ++x) {
            const bool inside = x >= 4 && x < 7 && y >= 5 && y < 7;
            EXPECT_EQ(copied[y * 8 + x], inside ? source[(y - 3) * 8 + x - 3] : 0x09090909u) << x << ", " << y;
        }
}

TEST_P(Textures, CopyPartsOfVolumes) {
    const TextureDesc desc{.dimension = TextureDimension::d3,
                           .format = Format::r32_uint,
                           .width = 4,
                           .height = 4,
                           .depth = 4,
                           .usage = TextureUsage::sampled | all_copies,
                           .name = "volume"};
    const Texture volume = ok(device().create_texture(desc));
    ok(device().write_texture(volume, std::vector<std::byte>(256)));
    const std::array<std::uint32_t, 8> values{1, 2, 3, 4, 5, 6, 7, 8};
    const Buffer from = buffer_of<std::uint32_t>(values, BufferUsage::copy_source);
    CommandList list = device().create_command_list("volume");
    list.copy_buffer_to_texture(from, volume, {.offset = {1, 1, 2}, .extent = {2, 2, 2}});
    run(std::move(list));
    const auto texels = read<std::uint32_t>(volume);
    for (std::uint32_t z = 0; z < 4; ++z)
        for (std::uint32_t y = 0; y < 4; ++y)
            for (std::uint32_t x = 0; x < 4; ++x) {
                const bool inside = x >= 1 && x < 3 && y >= 1 && y < 3 && z >= 2;
                EXPECT_EQ(texels[z * 16 + y * 4 + x], inside ? 1 + (z - 2) * 4 + (y - 1) * 2 + (x - 1) : 0u)
                    << x << ", " << y << ", " << z;
            }
}

TEST_P(Textures, ClearOfFloatIntegerAndDepth) {
    CommandList list = device().create_command_list("clears");
    const auto make = [&](Format format, TextureUsage more = TextureUsage::none) {
        return ok(device().create_texture({.format = format,
                                           .width = 4,
                                           .height = 4,
                                           .layers = 2,
                                           .mips = 2,
                                           .usage = TextureUsage::sampled | all_copies | more,
                                           .name = std::string(info(format).name)}));
    };
    const Texture unorm = make(Format::rgba8_unorm);
    const Texture uint = make(Format::rgba32_uint);
    const Texture sint = make(Format::r16_sint);
    const Texture floating = make(Format::rgba16_float);
    const Texture depth = make(Format::d32_float, TextureUsage::depth_target);
    list.clear_texture(unorm, {.floating = {0.0f, 0.2f, 0.4f, 1.0f}});
    list.clear_texture(uint, {.uint = {1, 0x80000000u, 3, 0xffffffffu}});
    list.clear_texture(sint, {.sint = {-123, 0, 0, 0}});
    list.clear_texture(floating, {.floating = {-2.0f, 0.5f, 1024.0f, 0.0f}});
    list.clear_depth_stencil(depth, 0.375f);
    // A part keeps the rest.
    list.clear_texture(TextureView::subresource(unorm, 1, 1), {.floating = {1.0f, 1.0f, 1.0f, 1.0f}});
    run(std::move(list));
    for (const std::uint32_t texel : read<std::uint32_t>(unorm, 0, 1)) EXPECT_EQ(texel, 0xff663300u);
    for (const std::uint32_t texel : read<std::uint32_t>(unorm, 1, 0)) EXPECT_EQ(texel, 0xff663300u);
    for (const std::uint32_t texel : read<std::uint32_t>(unorm, 1, 1)) EXPECT_EQ(texel, 0xffffffffu);
    const std::array<std::uint32_t, 4> expected{1, 0x80000000u, 3, 0xffffffffu};
    for (const auto& texel : read<std::array<std::uint32_t, 4>>(uint, 1, 1)) EXPECT_EQ(texel, expected);
    for (const std::int16_t texel : read<std::int16_t>(sint, 0, 1)) EXPECT_EQ(texel, -123);
    const std::array<std::uint16_t, 4> half{0xc000, 0x3800, 0x6400, 0};
    for (const auto& texel : read<std::array<std::uint16_t, 4>>(floating)) EXPECT_EQ(texel, half);
    for (const float texel : read<float>(depth, 1, 1)) EXPECT_EQ(texel, 0.375f);
}

TEST_P(Textures, GeneratedMipsAverageFourTexels) {
    const TextureDesc desc{.format = Format::rgba8_unorm,
                           .width = 8,
                           .height = 4,
                           .layers = 2,
                           .mips = 4,
                           .usage = TextureUsage::sampled | all_copies,
                           .name = "mips"};
    const Texture texture = ok(device().create_texture(desc));
    for (std::uint32_t layer = 0; layer < 2; ++layer) {
        std::vector<std::uint8_t> texels(8 * 4 * 4);
        for (std::size_t i = 0; i < texels.size(); ++i)
            texels[i] = static_cast<std::uint8_t>((i * 37 + layer * 90) % 251);
        ok(device().write_texture(texture, std::as_bytes(std::span(texels)), 0, layer));
    }
    CommandList list = device().create_command_list("mips");
    list.generate_mips(texture);
    run(std::move(list));
    for (std::uint32_t layer = 0; layer < 2; ++layer)
        for (std::uint32_t mip = 1; mip < 3; ++mip) {
            const Extent3D above = mip_extent(desc, mip - 1);
            const Extent3D size = mip_extent(desc, mip);
            const auto source = read<std::uint8_t>(texture, mip - 1, layer);
            const auto result = read<std::uint8_t>(texture, mip, layer);
            for (std::uint32_t y = 0; y < size.height; ++y)
                for (std::uint32_t x = 0; x < size.width; ++x)
                    for (std::uint32_t c = 0; c < 4; ++c) {
                        double sum = 0;
                        for (std::uint32_t dy = 0; dy < 2; ++dy)
                            for (std::uint32_t dx = 0; dx < 2; ++dx)
                                sum += source[((2 * y + dy) * above.width + 2 * x + dx) * 4 + c];
                        EXPECT_NEAR(result[(y * size.width + x) * 4 + c], sum / 4, 1.0)
                            << "mip " << mip << " layer " << layer;
                    }
        }
}

TEST_P(Textures, GeneratedMipsAverageSrgbInLinearLight) {
    SKIP_WITHOUT(supports(Format::rgba8_srgb, FormatSupport::color_target | FormatSupport::filtered));
    const TextureDesc desc{.format = Format::rgba8_srgb,
                           .width = 2,
                           .height = 2,
                           .mips = 2,
                           .usage = TextureUsage::sampled | all_copies,
                           .name = "srgb"};
    const Texture texture = ok(device().create_texture(desc));
    const std::array<std::uint32_t, 4> texels{0xff000000u, 0xffffffffu, 0xffffffffu, 0xff000000u};
    ok(device().write_texture(texture, std::as_bytes(std::span(texels))));
    CommandList list = device().create_command_list("mips");
    list.generate_mips(texture);
    run(std::move(list));
    const auto result = read<std::uint8_t>(texture, 1);
    // Half of the light is 188 in sRGB; half of the code values would be 128.
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(result[static_cast<std::size_t>(c)], 188, 1);
    EXPECT_EQ(result[3], 255);
}

TEST_P(Textures, BlockCompressedTexelsAreDecoded) {
    SKIP_WITHOUT(capabilities().block_compression && supports(Format::bc1_rgba_unorm, FormatSupport::sampled));
    // A BC1 block: color 0 is pure red, color 1 pure blue (565), all texels of row 0 color 0, of row 1 color 1, of row
    // 2 two thirds red, of row 3 one third red.
    const std::array<std::uint8_t, 8> block{0x00, 0xf8, 0x1f, 0x00, 0x00, 0x55, 0xaa, 0xff};
    const Texture texture = ok(device().create_texture({.format = Format::bc1_rgba_unorm,
                                                        .width = 4,
                                                        .height = 4,
                                                        .usage = TextureUsage::sampled | all_copies,
                                                        .name = "bc1"}));
    ok(device().write_texture(texture, std::as_bytes(std::span(block))));
    const auto values = evaluate<float>(R"(
        layout(local_size_x = 4, local_size_y = 4) in;
        layout(set = 0, binding = 0) buffer Result { vec4 result[16]; };
        layout(set = 0, binding = 1) uniform sampler2D image;
        void main() { result[gl_LocalInvocationIndex] = texelFetch(image, ivec2(gl_LocalInvocationID.xy), 0); }
    )",
                                        64, {{.binding = 1, .texture = texture, .sampler = nearest()}});
    const std::array<float, 4> red{1.0f, 0.0f, 2.0f / 3.0f, 1.0f / 3.0f};
    for (std::size_t y = 0; y < 4; ++y)
        for (std::size_t x = 0; x < 4; ++x) {
            EXPECT_NEAR(values[(y * 4 + x) * 4 + 0], red[y], 0.01f) << x << ", " << y;
            EXPECT_NEAR(values[(y * 4 + x) * 4 + 2], 1.0f - red[y], 0.01f) << x << ", " << y;
            EXPECT_EQ(values[(y * 4 + x) * 4 + 3], 1.0f);
        }
}

TEST_P(Textures, IntegerTexelsAreExactInShaders) {
    const std::array<std::uint32_t, 4> values{0, 0x80000001u, 0xffffffffu, 123456789u};
    const Texture texture = texture_of<std::uint32_t>(Format::r32_uint, 2, 2, values);
    const auto result = evaluate<std::uint32_t>(R"(
        layout(local_size_x = 2, local_size_y = 2) in;
        layout(set = 0, binding = 0) buffer Result { uint result[4]; };
        layout(set = 0, binding = 1) uniform usampler2D image;
        void main() { result[gl_LocalInvocationIndex] = texelFetch(image, ivec2(gl_LocalInvocationID.xy), 0).r; }
    )",
                                                4, {{.binding = 1, .texture = texture, .sampler = nearest()}});
    EXPECT_EQ(result, std::vector<std::uint32_t>(values.begin(), values.end()));
}

TEST_P(Textures, StorageImagesOfEveryFormat) {
    int formats = 0;
    struct Case {
        Format format;
        const char* qualifier;
        const char* type;
    };
    for (const Case& one : {Case{Format::rgba32_float, "rgba32f", "image2D"},
                            {Format::rgba16_float, "rgba16f", "image2D"},
                            {Format::r32_float, "r32f", "image2D"},
                            {Format::rgba8_unorm, "rgba8", "image2D"},
                            {Format::rgba8_snorm, "rgba8_snorm", "image2D"},
                            {Format::rgba32_uint, "rgba32ui", "uimage2D"},
                            {Format::rgba16_uint, "rgba16ui", "uimage2D"},
                            {Format::rgba8_uint, "rgba8ui", "uimage2D"},
                            {Format::r32_uint, "r32ui", "uimage2D"},
                            {Format::rgba32_sint, "rgba32i", "iimage2D"},
                            {Format::rgba16_sint, "rgba16i", "iimage2D"},
                            {Format::rgba8_sint, "rgba8i", "iimage2D"},
                            {Format::r32_sint, "r32i", "iimage2D"}}) {
        ASSERT_TRUE(supports(one.format, FormatSupport::storage_image)) << info(one.format).name;
        const Texture image = ok(device().create_texture({.format = one.format,
                                                          .width = 4,
                                                          .height = 4,
                                                          .usage = TextureUsage::storage | all_copies,
                                                          .name = one.qualifier}));
        const std::string prefix = one.type[0] == 'i' && one.type[1] == 'm' ? "" : std::string(1, one.type[0]);
        // Writes 1 in red (or the index where that fits), and reads it back into the buffer.
        const auto result = evaluate<std::uint32_t>(
            "layout(local_size_x = 4, local_size_y = 4) in;\n"
            "layout(set = 0, binding = 0) buffer Result { uint result[16]; };\n"
            "layout(set = 0, binding = 1, " +
                std::string(one.qualifier) + ") uniform writeonly " + one.type +
                " image;\n"
                "void main() {\n"
                "    imageStore(image, ivec2(gl_LocalInvocationID.xy), " +
                prefix +
                "vec4(gl_LocalInvocationID.x == 2u ? 1 : 0));\n"
                "    result[gl_LocalInvocationIndex] = gl_LocalInvocationIndex;\n"
                "}\n",
            16, {{.binding = 1, .texture = image}});
        EXPECT_EQ(result[15], 15u);
        const auto read_back = evaluate<float>(
            "layout(local_size_x = 4, local_size_y = 4) in;\n"
            "layout(set = 0, binding = 0) buffer Result { float result[16]; };\n"
            "layout(set = 0, binding = 1, " +
                std::string(one.qualifier) + ") uniform readonly " + one.type +
                " image;\n"
                "void main() { result[gl_LocalInvocationIndex] = float(imageLoad(image, "
                "ivec2(gl_LocalInvocationID.xy)).r); }\n",
            16, {{.binding = 1, .texture = image}});
        for (std::size_t i = 0; i < 16; ++i)
            EXPECT_EQ(read_back[i], i % 4 == 2 ? 1.0f : 0.0f) << one.qualifier << " " << i;
        ++formats;
    }
    EXPECT_EQ(formats, 13);
}

TEST_P(Textures, LayersOfStorageImages) {
    const Texture image = ok(device().create_texture({.format = Format::r32_uint,
                                                      .width = 4,
                                                      .height = 4,
                                                      .layers = 3,
                                                      .usage = TextureUsage::storage | all_copies,
                                                      .name = "layers"}));
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 4, local_size_y = 4) in;
        layout(set = 0, binding = 0, r32ui) uniform writeonly uimage2DArray image;
        void main() {
            imageStore(image, ivec3(gl_GlobalInvocationID), uvec4(gl_GlobalInvocationID.z * 100u + gl_LocalInvocationIndex));
        }
    )");
    dispatch(pipeline, {{.binding = 0, .texture = image}}, {1, 1, 3});
    for (std::uint32_t layer = 0; layer < 3; ++layer) {
        const auto texels = read<std::uint32_t>(image, 0, layer);
        for (std::uint32_t i = 0; i < 16; ++i) EXPECT_EQ(texels[i], layer * 100 + i);
    }
}

TEST_P(Textures, ImageAtomicsCount) {
    SKIP_WITHOUT(supports(Format::r32_uint, FormatSupport::storage_atomic));
    const Texture image = ok(device().create_texture({.format = Format::r32_uint,
                                                      .width = 2,
                                                      .height = 1,
                                                      .usage = TextureUsage::storage | all_copies,
                                                      .name = "counter"}));
    CommandList list = device().create_command_list("clear");
    list.clear_texture(image, {.uint = {5, 0, 0, 0}});
    run(std::move(list));
    dispatch(compute(R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0, r32ui) uniform uimage2D image;
        void main() { imageAtomicAdd(image, ivec2(gl_LocalInvocationID.x % 2u, 0), 3u); }
    )"),
             {{.binding = 0, .texture = image}}, {4, 1, 1});
    EXPECT_EQ(read<std::uint32_t>(image), (std::vector<std::uint32_t>{5 + 128 * 3, 5 + 128 * 3}));
}

}  // namespace
}  // namespace nacre::test
