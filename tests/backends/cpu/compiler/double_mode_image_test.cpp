// SPDX-License-Identifier: Apache-2.0
// Images and texel buffers on devices in double precision, against closed forms in double.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/backends/cpu/compiler/double_mode_bench.h"

namespace nacre::cpu {
namespace {

using namespace double_mode;

TEST(DoubleMode, StorageImagesKeepDoublesAndSamplingFiltersThem) {
    Bench bench("cpu:double");
    for (const auto& [format, name] : {std::pair{Format::rgba16_float, "rgba16f"},
                                       std::pair{Format::rgba8_unorm, "rgba8"}, std::pair{Format::r32_float, "r32f"}}) {
        const Texture image = make_texture(bench, format, TextureUsage::storage | TextureUsage::sampled);
        const Buffer to = bench.storage(64 * 2 * 8);
        bench.dispatch(
            prelude + "layout(set = 0, binding = 1, " + name +
                ") writeonly uniform image2D image;\n"
                "void main() { for (int y = 0; y < 64; ++y)\n"
                "imageStore(image, ivec2(at, y), vec4(1.0 / float(at + 3u) / float(y + 1), 0.25, 1.0, 1.0)); }\n",
            {{.binding = 1, .texture = image}});
        const Sampler linear = Bench::ok(bench.device().create_sampler(
            {.address_u = AddressMode::clamp_to_edge, .address_v = AddressMode::clamp_to_edge, .name = "linear"}));
        bench.dispatch(
            prelude + result +
                "layout(set = 0, binding = 1) uniform texture2D image;\n"
                "layout(set = 0, binding = 2) uniform sampler linear;\n"
                "void main() { result[2 * at] = exactly(texelFetch(image, ivec2(at, 5), 0).x);\n"
                "vec2 place = vec2(float(at) + 0.8, 9.9) / 64.0;\n"
                "result[2 * at + 1] = exactly(textureLod(sampler2D(image, linear), place, 0.0).x); }\n",
            {{.binding = 0, .buffer = to}, {.binding = 1, .texture = image}, {.binding = 2, .sampler = linear}});
        const auto found = bench.read<double>(to, 64 * 2);
        const auto value = [](int x, int y) { return 1.0 / (std::min(x, 63) + 3.0) / (y + 1.0); };
        const double fx = static_cast<double>(0.8f) - 0.5, fy = static_cast<double>(9.9f) - 9.5;
        for (int at = 0; at < 64; ++at) {
            EXPECT_NEAR(found[static_cast<std::size_t>(2 * at)], value(at, 5), 1e-16) << name << " " << at;
            const double filtered = (value(at, 9) * (1 - fx) + value(at + 1, 9) * fx) * (1 - fy) +
                                    (value(at, 10) * (1 - fx) + value(at + 1, 10) * fx) * fy;
            EXPECT_NEAR(found[static_cast<std::size_t>(2 * at + 1)], filtered, 1e-14) << name << " " << at;
        }
    }
}

TEST(DoubleMode, TexelBuffersOfFloatsHaveTheDoublesOfTheirBuffer) {
    Bench bench("cpu:double");
    struct Case {
        Format format;
        const char* layout;
        std::size_t channels;
    };
    for (const Case& one : {Case{Format::r32_float, "r32f", 1}, Case{Format::rg32_float, "rg32f", 2},
                            Case{Format::rgba32_float, "rgba32f", 4}}) {
        const std::size_t words = 64 * one.channels;
        const auto value = [](std::size_t word) { return 1.0 / static_cast<double>(3 + word); };
        const auto texels = [&](std::uint32_t binding, Buffer buffer) {
            return BindGroupEntry{.binding = binding, .buffer = buffer, .offset = 32, .format = one.format};
        };
        // Written as a block, fetched and loaded as elements.
        const Buffer block = bench.storage(32 + 4 * words), image = bench.storage(32 + 4 * words),
                     to = bench.storage(words * 2 * 8);
        const std::string channels = std::to_string(one.channels);
        const std::string floats = "layout(set = 0, binding = 1) buffer Floats { float before[8]; float floats[]; };\n";
        bench.dispatch(prelude + floats + "void main() { for (uint c = 0; c < " + channels + "; ++c)\nfloats[at * " +
                           channels + " + c] = 1.0 / float(3 + at * " + channels + " + c); }\n",
                       {{.binding = 1, .buffer = block}});
        bench.dispatch(prelude + result +
                           "layout(set = 0, binding = 1) uniform samplerBuffer fetched;\n"
                           "layout(set = 0, binding = 2, " + one.layout + ") readonly uniform imageBuffer loaded;\n"
                           "layout(set = 0, binding = 3, " + one.layout + ") writeonly uniform imageBuffer stored;\n"
                           "void main() {\nvec4 a = texelFetch(fetched, int(at)), b = imageLoad(loaded, int(at));\n"
                           "imageStore(stored, int(at), b);\nfor (uint c = 0; c < " + channels + "; ++c) {\n"
                           "result[2 * (at * " + channels + " + c)] = exactly(a[c]);\n"
                           "result[2 * (at * " + channels + " + c) + 1] = exactly(b[c]); } }\n",
                       {{.binding = 0, .buffer = to}, texels(1, block), texels(2, block), texels(3, image)});
        auto found = bench.read<double>(to, words * 2);
        for (std::size_t i = 0; i < words; ++i) {
            ASSERT_EQ(found[2 * i], value(i)) << one.layout << " " << i;
            ASSERT_EQ(found[2 * i + 1], value(i)) << one.layout << " " << i;
        }
        // Written as elements, read as a block.
        bench.dispatch(prelude + result + floats + "void main() { for (uint c = 0; c < " + channels +
                           "; ++c) result[at * " + channels + " + c] = exactly(floats[at * " + channels + " + c]); }\n",
                       {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = image}});
        found = bench.read<double>(to, words);
        for (std::size_t i = 0; i < words; ++i) ASSERT_EQ(found[i], value(i)) << one.layout << " " << i;
        // What the host writes hides the doubles.
        std::vector<float> host(8 + words, 0.1f);
        Bench::ok(bench.device().write_buffer(image, std::span<const float>(host)));
        bench.dispatch(prelude + result + "layout(set = 0, binding = 1) uniform samplerBuffer fetched;\n"
                           "void main() { result[at] = exactly(texelFetch(fetched, int(at)).x); }\n",
                       {{.binding = 0, .buffer = to}, texels(1, image)});
        for (const double one_value : bench.read<double>(to, 64)) ASSERT_EQ(one_value, static_cast<double>(0.1f));
    }
    // Other formats hold what their bits hold.
    const Buffer halves = bench.storage(64 * 8), to = bench.storage(64 * 8);
    bench.dispatch(prelude + "layout(set = 0, binding = 1, rgba16f) writeonly uniform imageBuffer stored;\n"
                             "void main() { imageStore(stored, int(at), vec4(1.0 / 3.0)); }\n",
                   {{.binding = 1, .buffer = halves, .format = Format::rgba16_float}});
    bench.dispatch(prelude + result + "layout(set = 0, binding = 1) uniform samplerBuffer fetched;\n"
                                      "void main() { result[at] = exactly(texelFetch(fetched, int(at)).x); }\n",
                   {{.binding = 0, .buffer = to}, {.binding = 1, .buffer = halves, .format = Format::rgba16_float}});
    for (const double one_value : bench.read<double>(to, 64)) ASSERT_EQ(one_value, 0x1.554p-2);
}

TEST(DoubleMode, CodesOfTexturesAreExactInDouble) {
    Bench bench("cpu:double");
    const TextureUsage usage = TextureUsage::sampled | TextureUsage::copy_destination;
    const Texture unorm = make_texture(bench, Format::rgba8_unorm, usage),
                  srgb = make_texture(bench, Format::rgba8_srgb, usage);
    std::vector<std::uint8_t> codes(64 * 64 * 4);
    for (std::size_t i = 0; i < codes.size(); ++i) codes[i] = static_cast<std::uint8_t>(i / 4 % 256);
    Bench::ok(bench.device().write_texture(unorm, std::as_bytes(std::span(codes))));
    Bench::ok(bench.device().write_texture(srgb, std::as_bytes(std::span(codes))));
    const Buffer to = bench.storage(256 * 2 * 8);
    bench.dispatch(prelude + result +
                       "layout(set = 0, binding = 1) uniform texture2D codes;\n"
                       "layout(set = 0, binding = 2) uniform texture2D curved;\n"
                       "void main() { ivec2 place = ivec2(at % 64u, at / 64u);\n"
                       "result[2 * at] = exactly(texelFetch(codes, place, 0).x);\n"
                       "result[2 * at + 1] = exactly(texelFetch(curved, place, 0).x); }\n",
                   {{.binding = 0, .buffer = to}, {.binding = 1, .texture = unorm}, {.binding = 2, .texture = srgb}},
                   4);
    const auto found = bench.read<double>(to, 256 * 2);
    for (int code = 0; code < 256; ++code) {
        const double c = code / 255.0;
        EXPECT_DOUBLE_EQ(found[static_cast<std::size_t>(2 * code)], c);
        EXPECT_DOUBLE_EQ(found[static_cast<std::size_t>(2 * code + 1)],
                         c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4))
            << code;
    }
}

TEST(DoubleMode, MipsAreAveragesOfDoubles) {
    Bench bench("cpu:double");
    const Texture image = make_texture(bench, Format::rgba8_unorm,
                                       TextureUsage::storage | TextureUsage::sampled | TextureUsage::copy_source |
                                           TextureUsage::copy_destination | TextureUsage::color_target,
                                       16, 3);
    bench.dispatch(
        prelude +
            "layout(set = 0, binding = 1, rgba8) writeonly uniform image2D image;\n"
            "void main() { if (at < 16u) for (int y = 0; y < 16; ++y)\n"
            "imageStore(image, ivec2(at, y), vec4(1.0 / float(at + 3u) / float(y + 1), 0.25, 1.0, 1.0)); }\n",
        {{.binding = 1, .texture = TextureView::subresource(image, 0)}});
    CommandList list = bench.device().create_command_list("mips");
    list.generate_mips(image);
    bench.run(std::move(list));
    const Buffer to = bench.storage(64 * 8);
    bench.dispatch(
        prelude + result +
            "layout(set = 0, binding = 1) uniform texture2D image;\n"
            "void main() { if (at < 16u) result[at] = exactly(texelFetch(image, ivec2(at % 4u, at / 4u), 2).x); }\n",
        {{.binding = 0, .buffer = to}, {.binding = 1, .texture = image}});
    const auto found = bench.read<double>(to, 16);
    for (std::size_t at = 0; at < 16; ++at) {
        double sum = 0;
        for (std::size_t y = 0; y < 4; ++y)
            for (std::size_t x = 0; x < 4; ++x)
                sum += 1.0 / static_cast<double>(at % 4 * 4 + x + 3) / static_cast<double>(at / 4 * 4 + y + 1) / 16;
        EXPECT_NEAR(found[at], sum, 1e-15) << at;
    }
}

}  // namespace
}  // namespace nacre::cpu
