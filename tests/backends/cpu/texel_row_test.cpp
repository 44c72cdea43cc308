// SPDX-License-Identifier: Apache-2.0
// Rows against single texels: whatever is done for speed gives what one texel at a time gives.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "backends/cpu/images/texel_formats.h"
#include "backends/cpu/texel_rows.h"

namespace nacre::cpu {
namespace {

using rhi::Format;

bool is_averaged(Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    return facts.block_bytes != 0 && facts.block_bytes != 12 && !facts.is_compressed() && !facts.is_depth_stencil() &&
           !facts.is_integer();
}

// Rows decode these by a multiplication with the rounded reciprocal.
bool is_unorm_byte(Format format, std::size_t channel) {
    const rhi::FormatInfo& facts = rhi::info(format);
    if (facts.block_bytes != facts.channels || format == Format::rgb10a2_unorm) return false;
    return facts.kind == rhi::FormatKind::unorm || (facts.kind == rhi::FormatKind::srgb && channel == 3);
}

TEST(TexelRows, DecodeEveryCodeAsSingleTexelsAre) {
    for (std::uint32_t i = 1; i < rhi::format_count; ++i) {
        const auto format = static_cast<Format>(i);
        if (!is_averaged(format)) continue;
        const std::uint32_t bytes = rhi::info(format).block_bytes;
        // All pairs of bytes, infinities and NaN among them.
        constexpr std::uint32_t count = 65536;
        std::vector<std::byte> texels(std::size_t{count} * bytes);
        for (std::uint32_t at = 0; at < count; ++at)
            for (std::uint32_t byte = 0; byte < bytes; ++byte)
                texels[std::size_t{at} * bytes + byte] =
                    static_cast<std::byte>((at + byte / 2 * 12289) >> (byte % 2 * 8));
        std::vector<LinearTexel> row(count);
        decode_row(format, texels.data(), count, row.data());
        for (std::uint32_t at = 0; at < count; ++at) {
            const Texel one = decode_texel(format, texels.data() + std::size_t{at} * bytes);
            for (std::size_t c = 0; c < 4; ++c) {
                const float expected =
                    is_unorm_byte(format, c) ? std::round(one.f[c] * 255) * (1.0f / 255.0f) : one.f[c];
                ASSERT_TRUE(row[at][c] == expected || (std::isnan(row[at][c]) && std::isnan(expected)))
                    << rhi::info(format).name << " texel " << at << ": " << row[at][c] << " and " << expected;
            }
        }
    }
}

TEST(TexelRows, EncodeNumbersAsSingleTexelsAre) {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> unit(-0.2f, 1.2f), wide(-70'000.0f, 70'000.0f);
    constexpr std::uint32_t count = 20'000;
    std::vector<LinearTexel> row(count);
    for (std::uint32_t at = 0; at < count; ++at)
        for (float& channel : row[at])
            channel = at % 3 == 0 ? wide(random) : at % 3 == 1 ? unit(random) : std::ldexp(unit(random), -20);
    const float specials[]{0.0f, -0.0f, 1.0f, NAN, INFINITY, -INFINITY, 65504.0f, 65520.0f, 1e-8f, 3e38f, 0.5f};
    for (std::size_t at = 0; at < std::size(specials); ++at) row[at].fill(specials[at]);
    for (std::uint32_t i = 1; i < rhi::format_count; ++i) {
        const auto format = static_cast<Format>(i);
        if (!is_averaged(format)) continue;
        const std::uint32_t bytes = rhi::info(format).block_bytes;
        std::vector<std::byte> texels(std::size_t{count} * bytes);
        encode_row(format, row.data(), count, texels.data());
        for (std::uint32_t at = 0; at < count; ++at) {
            Texel one{};
            std::memcpy(one.f, row[at].data(), sizeof one.f);
            std::array<std::byte, 16> expected{};
            encode_texel(format, one, expected.data());
            if (std::memcmp(texels.data() + std::size_t{at} * bytes, expected.data(), bytes) == 0) continue;
            // The payload of a NaN is free.
            const Texel found = decode_texel(format, texels.data() + std::size_t{at} * bytes);
            const Texel wanted = decode_texel(format, expected.data());
            for (std::size_t c = 0; c < rhi::info(format).channels; ++c)
                ASSERT_TRUE(std::isnan(found.f[c]) && std::isnan(wanted.f[c]))
                    << rhi::info(format).name << " of " << row[at][c] << ": " << found.f[c] << " and " << wanted.f[c];
        }
    }
}

TEST(TexelRows, FillAnyTexelSize) {
    const auto source = std::array<std::byte, 16>{std::byte{1}, std::byte{2},  std::byte{3},  std::byte{4},
                                                  std::byte{5}, std::byte{6},  std::byte{7},  std::byte{8},
                                                  std::byte{9}, std::byte{10}, std::byte{11}, std::byte{12}};
    for (const std::uint32_t bytes : {1u, 2u, 4u, 8u, 16u})
        for (const std::uint32_t count : {0u, 1u, 3u, 100u}) {
            std::vector<std::byte> row(std::size_t{count} * bytes + 16, std::byte{77});
            fill_row(source.data(), bytes, count, row.data());
            for (std::size_t i = 0; i < row.size(); ++i)
                ASSERT_EQ(row[i], i < std::size_t{count} * bytes ? source[i % bytes] : std::byte{77})
                    << bytes << ", " << count;
        }
}

}  // namespace
}  // namespace nacre::cpu
