// SPDX-License-Identifier: Apache-2.0
#include "passes/gbuffer_layout.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace nacre::passes {
namespace {

const Field& field(std::string_view name) {
    for (const Field& f : gbuffer_fields()) {
        if (f.name == name) return f;
    }
    ADD_FAILURE() << "no field " << name;
    return gbuffer_fields()[0];
}

TEST(GBufferLayout, FieldsFillTwelveBytesWithoutOverlap) {
    std::map<std::string_view, std::uint32_t> taken;
    for (const Field& f : gbuffer_fields()) {
        const std::uint32_t mask = ((1ull << f.bits) - 1) << f.shift;
        EXPECT_LE(f.shift + f.bits, 32) << f.name;
        EXPECT_EQ(taken[f.word] & mask, 0u) << f.name;
        taken[f.word] |= mask;
    }
    ASSERT_EQ(taken.size(), 3u);
    for (const auto& [word, bits] : taken) EXPECT_EQ(bits, ~0u) << word;
    EXPECT_EQ(fields_of("material.0").size() + fields_of("material.1").size() + fields_of("top_layer").size(),
              gbuffer_fields().size());
    EXPECT_TRUE(fields_of("depth").empty());
}

TEST(GBufferLayout, EndsOfRangesAreExact) {
    EXPECT_EQ(decode_field(field("roughness"), 0u)[0], 0.0f);
    EXPECT_EQ(decode_field(field("roughness"), 0xff000000u)[0], 1.0f);
    EXPECT_EQ(decode_field(field("diffuse_r"), 0x0000ff00u)[0], 1.0f);
    EXPECT_FLOAT_EQ(decode_field(field("f0_r"), 0x80u)[0], static_cast<float>((128.0 / 255.0) * (128.0 / 255.0)));
}

TEST(GBufferLayout, AxesAreExact) {
    // Codes 0, 2047 and 4094 of each coordinate are -1, 0 and 1.
    const Field& normal = field("normal");
    const auto word = [](std::uint32_t x, std::uint32_t y) { return x | y << 12; };
    EXPECT_EQ(decode_field(normal, word(2047, 2047)), (std::array<float, 3>{0, 0, 1}));
    EXPECT_EQ(decode_field(normal, word(4094, 2047)), (std::array<float, 3>{1, 0, 0}));
    EXPECT_EQ(decode_field(normal, word(2047, 0)), (std::array<float, 3>{0, -1, 0}));
    EXPECT_FLOAT_EQ(decode_field(normal, word(4094, 4094))[2], -1.0f);
}

TEST(GBufferLayout, OneStepIsNoDifferenceAndTwoAre) {
    const Field& roughness = field("roughness");
    EXPECT_FALSE(field_differs(roughness, 10u << 24, 11u << 24));
    EXPECT_TRUE(field_differs(roughness, 10u << 24, 12u << 24));
    EXPECT_FALSE(field_differs(roughness, 10u, 500u));  // other fields of the word
    EXPECT_TRUE(field_differs(field("pixel_class"), 1u, 2u));
    const Field& normal = field("normal");
    const auto word = [](std::uint32_t x, std::uint32_t y) { return x | y << 12; };
    EXPECT_FALSE(field_differs(normal, word(1000, 1000), word(1001, 999)));
    EXPECT_TRUE(field_differs(normal, word(2047, 2047), word(2055, 2047)));
    // All corners are the same direction, -Z.
    EXPECT_FALSE(field_differs(normal, word(0, 0), word(4094, 4094)));
    // Across the seam in the lower half the directions are neighbors.
    EXPECT_FALSE(field_differs(normal, word(0, 1000), word(0, 3094)));
}

TEST(GBufferLayout, GlslNamesEveryField) {
    const std::string text = gbuffer_glsl();
    for (const Field& f : gbuffer_fields()) {
        EXPECT_NE(text.find("pack_" + std::string(f.name) + "("), std::string::npos) << f.name;
        EXPECT_NE(text.find("unpack_" + std::string(f.name) + "("), std::string::npos) << f.name;
    }
}

}  // namespace
}  // namespace nacre::passes
