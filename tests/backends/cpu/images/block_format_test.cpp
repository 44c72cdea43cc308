// SPDX-License-Identifier: Apache-2.0
// Compressed blocks put together by hand, field by field, for every mode.
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <random>

#include "backends/cpu/images/block_cache.h"
#include "backends/cpu/images/block_formats.h"
#include "backends/cpu/images/texel_formats.h"

namespace nacre::cpu::test {
namespace {

using rhi::Format;

// Bits of a block, from the lowest on.
class BlockWriter {
  public:
    BlockWriter& put(std::uint64_t value, int bits) {
        for (int i = 0; i < bits; ++i, ++at_) {
            if (((value >> i) & 1) != 0) block[at_ / 8] |= static_cast<std::byte>(1 << (at_ % 8));
        }
        return *this;
    }
    [[nodiscard]] int size() const { return at_; }
    std::byte block[16] = {};

  private:
    int at_ = 0;
};

std::array<int, 4> bytes_of(std::uint32_t texel) {
    return {static_cast<int>(texel & 255), static_cast<int>((texel >> 8) & 255), static_cast<int>((texel >> 16) & 255),
            static_cast<int>(texel >> 24)};
}

TEST(BlockFormats, ColorsOfBc1) {
    // Red and blue ends; indices 0, 1, 2, 3 in the first row.
    BlockWriter four;
    four.put(0xf800, 16).put(0x001f, 16).put(0b11100100, 32);
    std::uint32_t texels[16];
    decode_rgba8_block(Format::bc1_rgba_unorm, four.block, texels);
    EXPECT_EQ(bytes_of(texels[0]), (std::array{255, 0, 0, 255}));
    EXPECT_EQ(bytes_of(texels[1]), (std::array{0, 0, 255, 255}));
    EXPECT_EQ(bytes_of(texels[2]), (std::array{170, 0, 85, 255}));
    EXPECT_EQ(bytes_of(texels[3]), (std::array{85, 0, 170, 255}));
    // The other order of the ends: their mean, and transparent black.
    BlockWriter three;
    three.put(0x001f, 16).put(0xf800, 16).put(0b11100100, 32);
    decode_rgba8_block(Format::bc1_rgba_unorm, three.block, texels);
    EXPECT_EQ(bytes_of(texels[2]), (std::array{128, 0, 128, 255}));
    EXPECT_EQ(texels[3], 0u);
    // In BC2 and BC3 there are always four colors.
    BlockWriter bc2;
    bc2.put(0xfedcba9876543210, 64).put(0x001f, 16).put(0xf800, 16).put(0b11100100, 32);
    decode_rgba8_block(Format::bc2_rgba_unorm, bc2.block, texels);
    EXPECT_EQ(bytes_of(texels[3]), (std::array{170, 0, 85, 3 * 17}));
    for (std::uint32_t i = 0; i < 16; ++i) EXPECT_EQ(texels[i] >> 24, i * 17);
}

TEST(BlockFormats, ChannelsOfBc3Bc4Bc5) {
    // Every index once in each half.
    const std::uint64_t indices = 0b111110101100011010001000'111110101100011010001000;
    BlockWriter eight;
    eight.put(210, 8).put(70, 8).put(indices, 48);
    float values[16];
    decode_channel_block(eight.block, false, values);
    const double steps[8] = {210, 70, 190, 170, 150, 130, 110, 90};
    for (int i = 0; i < 16; ++i) EXPECT_NEAR(values[i], steps[i % 8] / 255, 1e-7) << i;
    BlockWriter six;
    six.put(50, 8).put(100, 8).put(indices, 48);
    decode_channel_block(six.block, false, values);
    const double others[8] = {50, 100, 60, 70, 80, 90, 0, 255};
    for (int i = 0; i < 16; ++i) EXPECT_NEAR(values[i], others[i % 8] / 255, 1e-7) << i;
    BlockWriter negative;
    negative.put(0x80, 8).put(127, 8).put(indices, 48);  // -128 counts as -127
    decode_channel_block(negative.block, true, values);
    for (int i = 2; i < 6; ++i) EXPECT_NEAR(values[i], (-127.0 * (6 - i) + 127.0 * (i - 1)) / 5 / 127, 1e-6) << i;
    EXPECT_EQ(values[0], -1.0f);
    EXPECT_EQ(values[6], -1.0f);
    EXPECT_EQ(values[7], 1.0f);
    // Two blocks make BC5, one and a color block BC3.
    BlockWriter both;
    both.put(210, 8).put(70, 8).put(indices, 48).put(50, 8).put(100, 8).put(indices, 48);
    const Texel texel = decode_texel(Format::bc5_rg_unorm, both.block, 2, 1);
    EXPECT_NEAR(texel.f[0], 110.0 / 255, 1e-7);
    EXPECT_NEAR(texel.f[1], 0.0, 1e-7);
    std::uint32_t colors[16];
    decode_rgba8_block(Format::bc3_rgba_unorm, both.block, colors);
    EXPECT_EQ(colors[6] >> 24, 110u);
}

// One BC7 block of each mode, all endpoints the same color: whatever the indices, every texel is that color.
TEST(BlockFormats, Bc7OfOneColor) {
    struct Mode {
        int subsets, partition, rotation, selection, color, alpha, endpoint_p, shared_p;
    };
    const Mode modes[8] = {{3, 4, 0, 0, 4, 0, 1, 0}, {2, 6, 0, 0, 6, 0, 0, 1}, {3, 6, 0, 0, 5, 0, 0, 0},
                           {2, 6, 0, 0, 7, 0, 1, 0}, {1, 0, 2, 1, 5, 6, 0, 0}, {1, 0, 2, 0, 7, 8, 0, 0},
                           {1, 0, 0, 0, 7, 7, 1, 0}, {2, 6, 0, 0, 5, 5, 1, 0}};
    std::mt19937_64 random(1);
    for (int m = 0; m < 8; ++m) {
        const Mode& mode = modes[m];
        for (int trial = 0; trial < 200; ++trial) {
            BlockWriter writer;
            writer.put(1ull << m, m + 1).put(random(), mode.partition);
            const auto rotation = mode.rotation != 0 ? static_cast<int>(random() % 4) : 0;
            writer.put(static_cast<std::uint64_t>(rotation), mode.rotation).put(random(), mode.selection);
            std::array<int, 4> code{}, wanted{0, 0, 0, 255};
            const int p = mode.endpoint_p + mode.shared_p > 0 ? static_cast<int>(random() % 2) : -1;
            for (int c = 0; c < (mode.alpha > 0 ? 4 : 3); ++c) {
                const int bits = c == 3 ? mode.alpha : mode.color;
                code[c] = static_cast<int>(random() % (1u << bits));
                for (int e = 0; e < 2 * mode.subsets; ++e) writer.put(static_cast<std::uint64_t>(code[c]), bits);
                const int width = bits + (p >= 0 ? 1 : 0), value = p >= 0 ? 2 * code[c] + p : code[c];
                // Repeat the bits until eight are full.
                int widened = 0;
                for (int b = 7, from = width - 1; b >= 0; --b, from = from == 0 ? width - 1 : from - 1)
                    widened |= ((value >> from) & 1) << b;
                wanted[c] = widened;
            }
            if (p >= 0) {
                const int count = mode.endpoint_p != 0 ? 2 * mode.subsets : mode.subsets;
                for (int i = 0; i < count; ++i) writer.put(static_cast<std::uint64_t>(p), 1);
            }
            writer.put(random(), std::min(64, 128 - writer.size()));
            if (writer.size() < 128) writer.put(random(), 128 - writer.size());
            if (rotation > 0) std::swap(wanted[rotation - 1], wanted[3]);
            std::uint32_t texels[16];
            decode_bc7_block(writer.block, texels);
            for (int i = 0; i < 16; ++i) ASSERT_EQ(bytes_of(texels[i]), wanted) << "mode " << m << " texel " << i;
        }
    }
    std::uint32_t texels[16];
    const std::byte reserved[16] = {};
    decode_bc7_block(reserved, texels);
    for (const std::uint32_t texel : texels) EXPECT_EQ(texel, 0u);
}

// Mode 6: a ramp from black to white, whose indices count up.
TEST(BlockFormats, Bc7Ramp) {
    BlockWriter writer;
    writer.put(1 << 6, 7);
    for (int c = 0; c < 4; ++c) writer.put(0, 7).put(127, 7);
    writer.put(0, 1).put(1, 1);
    writer.put(0, 3);
    for (int i = 1; i < 16; ++i) writer.put(static_cast<std::uint64_t>(i), 4);
    ASSERT_EQ(writer.size(), 128);
    std::uint32_t texels[16];
    decode_bc7_block(writer.block, texels);
    constexpr int weights[16] = {0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64};
    for (int i = 0; i < 16; ++i) EXPECT_EQ(bytes_of(texels[i])[1], (255 * weights[i] + 32) / 64) << i;
}

// The anchor of a subset belongs to it.
TEST(BlockFormats, AnchorsLieInTheirSubset) {
    for (int p = 0; p < 64; ++p) {
        EXPECT_EQ(two_subset_partitions[p] & 1, 0) << p;
        EXPECT_EQ((two_subset_partitions[p] >> two_subset_anchors[p]) & 1, 1) << p;
    }
}

TEST(BlockFormats, Bc6hOfOneRegion) {
    // Mode 00011 (ten bits, no deltas): from 0 to the largest value, indices counting up.
    BlockWriter writer;
    writer.put(0b00011, 5);
    for (int c = 0; c < 3; ++c) writer.put(0, 10);
    for (int c = 0; c < 3; ++c) writer.put(1023, 10);
    writer.put(0, 3);
    for (int i = 1; i < 16; ++i) writer.put(static_cast<std::uint64_t>(i), 4);
    ASSERT_EQ(writer.size(), 128);
    std::uint16_t texels[16][3];
    decode_bc6h_block(writer.block, false, texels);
    constexpr int weights[16] = {0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64};
    for (int i = 0; i < 16; ++i) {
        const int mixed = (0xffff * weights[i] + 32) / 64;
        for (int c = 0; c < 3; ++c) EXPECT_EQ(texels[i][c], mixed * 31 / 64) << i;
    }
    EXPECT_EQ(texels[15][0], 0x7bff);  // The largest finite half.
    // Signed: 511 is the largest, -511 its negative.
    BlockWriter negative;
    negative.put(0b00011, 5);
    for (int c = 0; c < 3; ++c) negative.put(511, 10);
    for (int c = 0; c < 3; ++c) negative.put(0x400 - 511, 10);
    negative.put(0, 3);
    for (int i = 1; i < 16; ++i) negative.put(15, 4);
    decode_bc6h_block(negative.block, true, texels);
    EXPECT_EQ(texels[0][0], 0x7bff);
    EXPECT_EQ(texels[1][1], 0xfbff);
    // Reserved modes are black.
    for (const std::uint64_t code : {0b10011u, 0b10111u, 0b11011u, 0b11111u}) {
        BlockWriter reserved;
        reserved.put(code, 5).put(~0ull, 64).put(~0ull, 59);
        decode_bc6h_block(reserved.block, false, texels);
        for (const auto& texel : texels) EXPECT_EQ(texel[0] | texel[1] | texel[2], 0);
    }
}

TEST(BlockFormats, CacheGivesWhatDecodersGive) {
    std::mt19937 random(9);
    BlockCache& cache = BlockCache::of_this_thread();
    std::vector<std::array<std::byte, 16>> blocks(300);
    for (auto& block : blocks)
        for (std::byte& each : block) each = static_cast<std::byte>(random());
    for (int i = 0; i < 20000; ++i) {
        const auto& block = blocks[random() % blocks.size()];
        const auto format = static_cast<Format>(static_cast<std::uint32_t>(Format::bc1_rgba_unorm) + random() % 14);
        const DecodedBlock& found = cache.find(format, block.data(), rhi::info(format).block_bytes);
        const std::uint32_t at = static_cast<std::uint32_t>(random() % 16);
        const Texel texel = decode_texel(format, block.data(), at % 4, at / 4);
        switch (rhi::info(format).channels) {
            case 1:
            case 2: ASSERT_EQ(found.channels[0][at], texel.f[0]); break;
            case 3: ASSERT_EQ(std::bit_cast<std::uint32_t>(half_to_float(found.halves[at][2])), texel.u[2]); break;
            default: ASSERT_NEAR((found.rgba8[at] >> 24) / 255.0, texel.f[3], 1e-7); break;
        }
    }
}

}  // namespace
}  // namespace nacre::cpu::test
