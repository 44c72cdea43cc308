// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/block_formats.h"

#include <algorithm>
#include <cstring>

namespace nacre::cpu {
namespace {

using rhi::Format;

std::uint64_t read_bits(const std::byte* from) {
    std::uint64_t value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

std::uint32_t pack(std::uint32_t red, std::uint32_t green, std::uint32_t blue, std::uint32_t alpha) {
    return red | (green << 8) | (blue << 16) | (alpha << 24);
}

// Color weights `a` and `b` of two 5:6:5 colors.
std::uint32_t mix_colors(std::uint32_t color0, std::uint32_t color1, std::uint32_t a, std::uint32_t b) {
    const auto channel = [&](std::uint32_t shift, std::uint32_t bits) {
        const auto widen = [&](std::uint32_t color) {
            const std::uint32_t code = (color >> shift) & ((1u << bits) - 1);
            return (code << (8 - bits)) | (code >> (2 * bits - 8));
        };
        return (a * widen(color0) + b * widen(color1) + (a + b) / 2) / (a + b);
    };
    return pack(channel(11, 5), channel(5, 6), channel(0, 5), 255);
}

void decode_color_block(const std::byte* block, bool always_four_colors, std::uint32_t (&texels)[16]) {
    const std::uint64_t bits = read_bits(block);
    const auto color0 = static_cast<std::uint32_t>(bits & 0xffff),
               color1 = static_cast<std::uint32_t>((bits >> 16) & 0xffff);
    std::uint32_t palette[4] = {mix_colors(color0, color1, 1, 0), mix_colors(color0, color1, 0, 1), 0, 0};
    if (always_four_colors || color0 > color1) {
        palette[2] = mix_colors(color0, color1, 2, 1);
        palette[3] = mix_colors(color0, color1, 1, 2);
    } else {
        palette[2] = mix_colors(color0, color1, 1, 1);  // And [3] is transparent black.
    }
    for (int i = 0; i < 16; ++i) texels[i] = palette[(bits >> (32 + 2 * i)) & 3];
}

}  // namespace

void decode_channel_block(const std::byte* block, bool is_signed, float (&texels)[16]) {
    const std::uint64_t bits = read_bits(block);
    std::int32_t low = static_cast<std::int32_t>(bits & 0xff), high = static_cast<std::int32_t>((bits >> 8) & 0xff);
    std::int32_t most = 255;
    bool six_steps = low > high;
    if (is_signed) {
        // -128 means the same as -127, but which palette is meant depends on the codes as they are.
        low = static_cast<std::int8_t>(low), high = static_cast<std::int8_t>(high), most = 127;
        six_steps = low > high;
        low = std::max(low, -127), high = std::max(high, -127);
    }
    const auto mix = [&](std::int32_t a, std::int32_t b) {
        return static_cast<float>(static_cast<double>(a * low + b * high) / ((a + b) * most));
    };
    float palette[8] = {mix(1, 0), mix(0, 1)};
    if (six_steps) {
        for (int i = 1; i < 7; ++i) palette[i + 1] = mix(7 - i, i);
    } else {
        for (int i = 1; i < 5; ++i) palette[i + 1] = mix(5 - i, i);
        palette[6] = is_signed ? -1.0f : 0.0f;
        palette[7] = 1.0f;
    }
    for (int i = 0; i < 16; ++i) texels[i] = palette[(bits >> (16 + 3 * i)) & 7];
}

void decode_rgba8_block(Format format, const std::byte* block, std::uint32_t (&texels)[16]) {
    switch (format) {
        case Format::bc1_rgba_unorm:
        case Format::bc1_rgba_srgb: decode_color_block(block, false, texels); break;
        case Format::bc2_rgba_unorm:
        case Format::bc2_rgba_srgb: {
            decode_color_block(block + 8, true, texels);
            const std::uint64_t alpha = read_bits(block);
            for (int i = 0; i < 16; ++i) {
                texels[i] = (texels[i] & 0xffffff) | (static_cast<std::uint32_t>((alpha >> (4 * i)) & 15) * 17) << 24;
            }
            break;
        }
        case Format::bc3_rgba_unorm:
        case Format::bc3_rgba_srgb: {
            decode_color_block(block + 8, true, texels);
            float alpha[16];
            decode_channel_block(block, false, alpha);
            for (int i = 0; i < 16; ++i) {
                texels[i] = (texels[i] & 0xffffff) | static_cast<std::uint32_t>(alpha[i] * 255.0f + 0.5f) << 24;
            }
            break;
        }
        case Format::bc7_rgba_unorm:
        case Format::bc7_rgba_srgb: decode_bc7_block(block, texels); break;
        default: std::fill(std::begin(texels), std::end(texels), 0u); break;
    }
}

}  // namespace nacre::cpu
