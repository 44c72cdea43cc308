// SPDX-License-Identifier: Apache-2.0
#include "measure/texture_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>

#include "measure/texel_decoding.h"

namespace nacre::measure {
namespace {

using rhi::Format;
using testing::HasSubstr;

template <typename T>
TextureData texture(Format format, std::uint32_t width, const std::vector<T>& values,
                    std::vector<BitField> fields = {}) {
    TextureData data{.name = "texture", .format = format, .width = width, .height = 1, .fields = std::move(fields)};
    data.bytes.resize(values.size() * sizeof(T));
    std::memcpy(data.bytes.data(), values.data(), data.bytes.size());
    return data;
}

std::array<double, 4> decode(Format format, std::uint64_t bits) {
    double channels[4];
    std::byte texel[16] = {};
    std::memcpy(texel, &bits, 8);
    decode_format(format, texel, channels);
    return {channels[0], channels[1], channels[2], channels[3]};
}

using Four = std::array<double, 4>;

TEST(TexelDecodingTest, FormatsAreRead) {
    EXPECT_EQ(decode(Format::rgba8_unorm, 0xff3300ff), (Four{1, 0, 0.2, 1}));
    EXPECT_EQ(decode(Format::bgra8_unorm, 0xff3300ff), (Four{0.2, 0, 1, 1}));
    EXPECT_EQ(decode(Format::rgba8_snorm, 0x00817f80), (Four{-1, 1, -1, 0}));
    EXPECT_NEAR(decode(Format::rgba8_srgb, 0x800000bc)[0], 0.5029, 1e-4);
    EXPECT_NEAR(decode(Format::rgba8_srgb, 0x800000bc)[3], 128 / 255.0, 1e-6);
    EXPECT_EQ(decode(Format::rg16_float, 0xc0003c00), (Four{1, -2, 0, 0}));
    EXPECT_EQ(decode(Format::r16_float, 0x0001)[0], std::ldexp(1.0, -24));
    EXPECT_TRUE(std::isinf(decode(Format::r16_float, 0x7c00)[0]));
    EXPECT_TRUE(std::isnan(decode(Format::r16_float, 0x7c01)[0]));
    EXPECT_EQ(decode(Format::r32_float, std::bit_cast<std::uint32_t>(-0.75f))[0], -0.75);
    EXPECT_EQ(decode(Format::r32_sint, 0xffffffff)[0], -1.0);
    EXPECT_EQ(decode(Format::r32_uint, 0xffffffff)[0], 4294967295.0);
    EXPECT_EQ(decode(Format::rgb10a2_unorm, 0xc00003ff), (Four{1, 0, 0, 1}));
    EXPECT_EQ(decode(Format::rg11b10_float, 0x3c0 | 0x400u << 11 | 0x1c0u << 22), (Four{1, 2, 0.5, 0}));
    EXPECT_EQ(decode(Format::rgb9e5_float, 256u | 128u << 9 | 16u << 27), (Four{1, 0.5, 0, 0}));
    EXPECT_EQ(decode(Format::d16_unorm, 65535)[0], 1.0);
    EXPECT_EQ(decode(Format::d24_unorm_s8_uint, 0x07ffffff), (Four{1, 7, 0, 0}));
}

TEST(TextureComparisonTest, EqualTexturesDoNotDiffer) {
    const auto a = texture<float>(Format::r32_float, 3, {1, 2, std::nanf("")});
    const auto result = compare_textures(a, a);
    ASSERT_TRUE(result) << result.error().message();
    EXPECT_EQ(result->texels, 3u);
    EXPECT_EQ(result->differing, 0u);
    EXPECT_EQ(result->max_abs, 0.0);
}

TEST(TextureComparisonTest, FloatsAreMeasured) {
    const auto a = texture<float>(Format::rg32_float, 3, {1, 2, 3, 4, 5, 0.0f});
    const auto b = texture<float>(Format::rg32_float, 3, {1, 2, 3.5f, 4, 5, -0.0f});
    const auto result = compare_textures(a, b);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->differing, 2u);  // -0 is not bit-equal to 0 ...
    EXPECT_EQ(result->fields_differing, 0u);
    EXPECT_DOUBLE_EQ(result->max_abs, 0.5);  // ... but no distance away.
    EXPECT_DOUBLE_EQ(result->max_rel, 0.5 / 3.5);
    const auto c = texture<float>(Format::rg32_float, 3, {1, 2, std::nanf(""), 4, 5, 0.0f});
    EXPECT_TRUE(std::isinf(compare_textures(a, c)->max_abs));
}

TEST(TextureComparisonTest, FieldsDifferByMoreThanOneStep) {
    const std::vector<BitField> fields = {{"a", 0, 0, 8, FieldKind::unorm}, {"flags", 0, 8, 8, FieldKind::uint},
                                          {"s", 0, 16, 8, FieldKind::snorm}, {"angle", 0, 24, 8, FieldKind::circular}};
    const auto differing = [&](std::uint32_t a, std::uint32_t b) {
        const auto result = compare_textures(texture<std::uint32_t>(Format::r32_uint, 1, {a}, fields),
                                             texture<std::uint32_t>(Format::r32_uint, 1, {b}, fields));
        EXPECT_TRUE(result) << result.error().message();
        std::string names;
        for (const auto& field : result->fields) names += field.differing ? field.name + " " : "";
        EXPECT_EQ(result->fields_differing, names.empty() ? 0u : 1u);
        EXPECT_EQ(result->differing, a == b ? 0u : 1u);
        return names;
    };
    EXPECT_EQ(differing(0x10, 0x10), "");
    EXPECT_EQ(differing(0x10, 0x11), "");
    EXPECT_EQ(differing(0x10, 0x12), "a ");
    EXPECT_EQ(differing(0x0100, 0x0200), "flags ");
    EXPECT_EQ(differing(0x00ff0000, 0x00000000), "");        // -1 and 0
    EXPECT_EQ(differing(0x00ff0000, 0x00010000), "s ");      // -1 and 1
    EXPECT_EQ(differing(0xff000000, 0x00000000), "");        // the last code neighbors the first
    EXPECT_EQ(differing(0xff000000, 0x01000000), "angle ");
    EXPECT_EQ(differing(0x00000000, 0x80000105), "a flags angle ");
}

TEST(TextureComparisonTest, FieldDistancesAreThoseOfDecodedValues) {
    const std::vector<BitField> fields = {{"a", 1, 4, 10, FieldKind::unorm}};
    const auto a = texture<std::uint32_t>(Format::rg32_uint, 1, {7, 100u << 4}, fields);
    const auto b = texture<std::uint32_t>(Format::rg32_uint, 1, {7, 130u << 4}, fields);
    const auto result = compare_textures(a, b);
    ASSERT_TRUE(result);
    EXPECT_DOUBLE_EQ(result->max_abs, 30.0 / 1023);
    EXPECT_DOUBLE_EQ(result->max_rel, 30.0 / 130);
}

// The code of a direction, rounded to the nearest.
std::uint32_t octahedral_code(double x, double y, double z, unsigned half) {
    const double sum = std::abs(x) + std::abs(y) + std::abs(z);
    double u = x / sum, v = y / sum;
    if (z < 0) {
        const double folded_u = (1 - std::abs(v)) * (u >= 0 ? 1 : -1);
        v = (1 - std::abs(u)) * (v >= 0 ? 1 : -1);
        u = folded_u;
    }
    const double half_range = double((1u << (half - 1)) - 1);
    const auto code = [&](double t) { return static_cast<std::uint32_t>(std::lround((t + 1.0) * half_range)); };
    return code(u) | code(v) << half;
}

TEST(TextureComparisonTest, OctahedralDirectionsAreComparedOnTheSphere) {
    const BitField field{"normal", 0, 0, 24, FieldKind::octahedral};
    for (const auto& [x, y, z] : {std::tuple{0.3, -0.5, 0.8}, {0.0, 0.0, -1.0}, {-0.6, 0.1, -0.79}, {1.0, 0.0, 0.0}}) {
        double direction[3];
        decode_octahedral(field, octahedral_code(x, y, z, 12), direction);
        const double length = std::hypot(x, y, z);
        EXPECT_NEAR(direction[0], x / length, 1e-3);
        EXPECT_NEAR(direction[1], y / length, 1e-3);
        EXPECT_NEAR(direction[2], z / length, 1e-3);
    }
    const auto differs = [&](std::uint32_t a, std::uint32_t b) {
        return compare_textures(texture<std::uint32_t>(Format::r32_uint, 1, {a}, {field}),
                                texture<std::uint32_t>(Format::r32_uint, 1, {b}, {field}))
            ->fields_differing != 0;
    };
    const auto code = [](std::uint32_t x, std::uint32_t y) { return x | y << 12; };
    EXPECT_FALSE(differs(code(2000, 1500), code(2001, 1499)));
    EXPECT_TRUE(differs(code(2000, 1500), code(2002, 1500)));
    // The four corners are all the direction (0, 0, -1); points mirrored about the middle of a side are one direction.
    EXPECT_FALSE(differs(code(0, 0), code(4094, 4094)));
    EXPECT_FALSE(differs(code(0, 1000), code(0, 3094)));
    EXPECT_TRUE(differs(code(0, 1000), code(0, 3090)));
    EXPECT_TRUE(differs(code(0, 0), code(2047, 2047)));
    const auto opposite = compare_textures(texture<std::uint32_t>(Format::r32_uint, 1, {code(0, 0)}, {field}),
                                           texture<std::uint32_t>(Format::r32_uint, 1, {code(2047, 2047)}, {field}));
    EXPECT_NEAR(opposite->max_abs, std::numbers::pi, 1e-3);
}

TEST(TextureComparisonTest, MismatchesAreErrors) {
    const auto a = texture<float>(Format::r32_float, 2, {1, 2});
    const auto message = [&](const TextureData& b) {
        const auto result = compare_textures(a, b);
        return result ? std::string() : result.error().message();
    };
    EXPECT_THAT(message(texture<float>(Format::r32_float, 1, {1})), HasSubstr("'texture'"));
    EXPECT_THAT(message(texture<std::uint32_t>(Format::r32_uint, 2, {1, 2})), HasSubstr("r32_uint"));
    EXPECT_THAT(message(texture<float>(Format::r32_float, 3, {1, 2})), HasSubstr("need 12 bytes"));
    auto bad_field = a;
    bad_field.fields = {{"wide", 0, 30, 4, FieldKind::unorm}};
    EXPECT_THAT(message(bad_field), HasSubstr("'wide'"));
    auto compressed = a;
    compressed.format = Format::bc7_rgba_unorm;
    EXPECT_THAT(message(compressed), HasSubstr("block-compressed"));
}

TEST(TextureComparisonTest, PicturesAndMasks) {
    const auto depth = texture<float>(Format::d32_float, 3, {0.5f, 0.75f, 1.0f});
    const auto picture = picture_of(depth);
    ASSERT_TRUE(picture);
    EXPECT_EQ(picture->pixels, (std::vector<float>{0, 0, 0, 0.5, 0.5, 0.5, 1, 1, 1}));
    const auto other = texture<float>(Format::d32_float, 3, {0.5f, 0.76f, 1.0f});
    EXPECT_EQ(difference_mask(depth, other)->pixels, (std::vector<float>{0, 1, 0}));
    const std::vector<BitField> fields = {{"a", 0, 0, 8, FieldKind::unorm}, {"b", 0, 8, 8, FieldKind::uint}};
    const auto words = texture<std::uint32_t>(Format::r32_uint, 2, {0xff33, 0}, fields);
    EXPECT_EQ(picture_of(words)->pixels, (std::vector<float>{0.2f, 1, 0, 0, 0, 0}));
}

TEST(TextureComparisonTest, LayersForFilesKeepWords) {
    const auto words = texture<std::uint32_t>(Format::rg32_uint, 1, {0xdeadbeef, 7});
    const auto layer = exr_layer_of(words);
    ASSERT_TRUE(layer);
    ASSERT_EQ(layer->channels.size(), 2u);
    EXPECT_EQ(std::get<std::vector<std::uint32_t>>(layer->channels[0].values)[0], 0xdeadbeef);
    const auto depth = exr_layer_of(texture<float>(Format::d32_float, 1, {0.25f}));
    EXPECT_EQ(depth->channels[0].name, "Z");
    EXPECT_EQ(std::get<std::vector<float>>(depth->channels[0].values)[0], 0.25f);
}

}  // namespace
}  // namespace nacre::measure
