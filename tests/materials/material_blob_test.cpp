// SPDX-License-Identifier: Apache-2.0
#include "materials/material_blob.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <random>

namespace nacre::materials {
namespace {

TEST(MaterialBlob, IsOneRunOf128BytesThatMayBeCopied) {
    static_assert(sizeof(MaterialBlob) == 128 && std::is_trivially_copyable_v<MaterialBlob>);
    MaterialBlob blob = plain_slab_blob({.base_color = {0.1f, 0.2f, 0.3f}, .metallic = 0.25f});
    blob.set_texture(3, 17);
    MaterialBlob copy;
    std::memcpy(&copy, &blob, sizeof(blob));
    EXPECT_EQ(copy, blob);
}

// Every field alone and all at once: none may touch another.
TEST(MaterialBlob, HeadersComeBack) {
    std::mt19937 random(7);
    const auto coin = [&] { return (random() & 1u) != 0; };
    for (int i = 0; i < 20'000; ++i) {
        const MaterialHeader header{
            .type = static_cast<std::uint16_t>(random()),
            .number = static_cast<std::uint16_t>(random()),
            .alpha_mode = static_cast<AlphaMode>(random() % 3),
            .double_sided = coin(),
            .unlit = coin(),
            .emits = coin(),
            .alpha_cutoff = std::ldexp(static_cast<float>(random()), -32),
            .sideband = coin() ? MaterialHeader::no_sideband : static_cast<std::uint32_t>(random()),
            .textures = static_cast<std::uint8_t>(random() % 128),
            .second_uv = static_cast<std::uint8_t>(random() % 128),
            .transformed = coin()};
        MaterialBlob blob;
        for (std::uint32_t row = 1; row < blob_rows; ++row)
            blob.rows[row] = glm::uvec4(random(), random(), random(), random());
        const MaterialBlob before = blob;
        blob.set_header(header);
        ASSERT_EQ(blob.header(), header);
        for (std::uint32_t row = 1; row < blob_rows; ++row) ASSERT_EQ(blob.rows[row], before.rows[row]);
    }
}

TEST(MaterialBlob, TexturesAndNumbersShareNoBit) {
    std::mt19937 random(8);
    MaterialBlob blob;
    blob.set_header({.type = 3, .number = 9});
    std::uint32_t textures[blob_textures];
    for (std::uint32_t i = 0; i < blob_textures; ++i) blob.set_texture(i, textures[i] = random() & 0xffffu);
    for (std::uint32_t i = 0; i < blob_textures; ++i) EXPECT_EQ(blob.texture(i), textures[i]) << i;
    EXPECT_EQ(blob.header(), (MaterialHeader{.type = 3, .number = 9}));
    EXPECT_EQ(texture_row(textures), blob.rows[blob_texture_row]);
    EXPECT_EQ(texture_row(std::span(textures, 0)), glm::uvec4(0));
    blob.set_texture(3, 65535);
    EXPECT_EQ(blob.texture(2), textures[2]);
    EXPECT_EQ(blob.texture(3), 65535u);
    EXPECT_EQ(blob.texture(4), textures[4]);
    EXPECT_EQ(blob.rows[blob_payload_row], glm::uvec4(0));

    // Bits of numbers stay as they are: denormals, signed zeros, infinities.
    const glm::vec4 numbers(std::bit_cast<float>(1u), -0.0f, std::numeric_limits<float>::infinity(), 0.1f);
    blob.set_numbers(7, numbers);
    for (int i = 0; i < 4; ++i) {
        EXPECT_EQ(std::bit_cast<std::uint32_t>(blob.numbers(7)[i]), std::bit_cast<std::uint32_t>(numbers[i]));
    }
}

TEST(MaterialBlob, PlainSlabsComeBack) {
    std::mt19937 random(9);
    std::uniform_real_distribution<float> unit(0.0f, 1.0f);
    const auto color = [&] { return glm::vec3(unit(random), unit(random), unit(random)); };
    for (int i = 0; i < 2'000; ++i) {
        SingleSlab slab;
        slab.base_color = color(), slab.alpha = unit(random), slab.metallic = unit(random),
        slab.roughness = unit(random);
        slab.f0 = color(), slab.f90 = unit(random), slab.emission = (i % 3 == 0 ? 0.0f : 1e6f) * color();
        slab.occlusion_strength = unit(random), slab.normal_scale = 4.0f * unit(random) - 2.0f;
        slab.alpha_mode = static_cast<AlphaMode>(i % 3), slab.alpha_cutoff = unit(random);
        slab.unlit = i % 5 == 0, slab.double_sided = i % 7 == 0;
        const MaterialBlob blob = plain_slab_blob(slab);
        EXPECT_EQ(blob.header().emits, slab.emission != glm::vec3(0.0f));
        const SingleSlab back = plain_slab_of(blob);
        EXPECT_EQ(back.base_color, slab.base_color);
        EXPECT_EQ(back.alpha, slab.alpha);
        EXPECT_EQ(back.metallic, slab.metallic);
        EXPECT_EQ(back.roughness, slab.roughness);
        EXPECT_EQ(back.f0, slab.f0);
        EXPECT_EQ(back.f90, slab.f90);
        EXPECT_EQ(back.emission, slab.emission);
        EXPECT_EQ(back.occlusion_strength, slab.occlusion_strength);
        EXPECT_EQ(back.normal_scale, slab.normal_scale);
        EXPECT_EQ(back.alpha_mode, slab.alpha_mode);
        EXPECT_EQ(back.alpha_cutoff, slab.alpha_cutoff);
        EXPECT_EQ(back.unlit, slab.unlit);
        EXPECT_EQ(back.double_sided, slab.double_sided);
        EXPECT_EQ(plain_slab_blob(back), blob);
    }
}

}  // namespace
}  // namespace nacre::materials
