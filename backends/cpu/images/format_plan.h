// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "rhi/format.h"

/// @file
/// How kernels take texels apart: the 32-bit words of a texel, and where each channel lies in them.

namespace nacre::cpu {

/// Ways to read a texel. The first six are `general` for layouts that matter most, without its choices for each
/// channel.
enum class Codec : std::uint8_t {
    none,     ///< Cannot be read as color (undefined, unknown).
    word,     ///< One channel of 32 bits: r32, d32.
    rgba8,    ///< rgba8_unorm and bgra8_unorm.
    srgb8,    ///< rgba8_srgb and bgra8_srgb.
    half2,    ///< rg16_float
    half4,    ///< rgba16_float
    float4,   ///< rgba32
    general,  ///< By `FormatPlan::channels`.
    shared_exponent,
    block_rgba8,
    block_srgb8,     ///< BC1, BC2, BC3, BC7.
    block_channels,  ///< BC4, BC5, BC6H.
    far,  ///< By `decode_texel` at 64-bit addresses: levels so large that 32-bit offsets do not reach every texel.
};

enum class ChannelCoding : std::uint8_t { unorm, snorm, uint, sint, half, small_float, single, srgb };

struct ChannelPlan {
    std::uint8_t word = 0, shift = 0, bits = 0;
    ChannelCoding coding = ChannelCoding::unorm;
    float most = 1.0f;  ///< unorm and snorm: the code of 1.
};

struct FormatPlan {
    Codec codec = Codec::none;
    std::uint8_t texel_bytes = 0;    ///< Or block bytes.
    std::uint8_t words = 0;          ///< 32-bit words that hold a texel; 1 also for smaller texels.
    std::uint8_t channel_count = 0;  ///< Depth formats: 1.
    bool is_integer = false;
    bool is_fixed_point_depth = false;
    bool red_is_third = false;  ///< bgra8: red and blue change places.
    bool can_store = false;     ///< All channels are coded by `encode_channel`.
    ChannelPlan channels[4];
};

/// By format; made at start.
extern const FormatPlan* const format_plans;

/// Never fails; formats that cannot be read have Codec::none.
[[gnu::always_inline]] inline const FormatPlan& format_plan(rhi::Format format) {
    const auto index = static_cast<std::uint32_t>(format);
    return format_plans[index < rhi::format_count ? index : 0];
}

}  // namespace nacre::cpu
