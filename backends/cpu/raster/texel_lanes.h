// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/simd.h"
#include "backends/cpu/raster/srgb_tables.h"
#include "rhi/format.h"

/// @file
/// Texels of color targets for sixteen lanes: packed words to channels and back. Internal linkage, as in simd.h.

namespace nacre::cpu::raster {
namespace {

/// How the channels of a color target lie in its words.
struct TexelLayout {
    rhi::FormatKind kind;
    std::uint32_t channels, bits;  ///< Bits of a channel: 8, 16, 32; 0: packed in another way.
    bool blue_first;
};

inline TexelLayout texel_layout(rhi::Format format) {
    using enum rhi::Format;
    using rhi::FormatKind;
    switch (format) {
        case r8_unorm: return {FormatKind::unorm, 1, 8, false};
        case r8_snorm: return {FormatKind::snorm, 1, 8, false};
        case r8_uint: return {FormatKind::uint, 1, 8, false};
        case r8_sint: return {FormatKind::sint, 1, 8, false};
        case rg8_unorm: return {FormatKind::unorm, 2, 8, false};
        case rg8_snorm: return {FormatKind::snorm, 2, 8, false};
        case rg8_uint: return {FormatKind::uint, 2, 8, false};
        case rg8_sint: return {FormatKind::sint, 2, 8, false};
        case rgba8_unorm: return {FormatKind::unorm, 4, 8, false};
        case rgba8_srgb: return {FormatKind::srgb, 4, 8, false};
        case rgba8_snorm: return {FormatKind::snorm, 4, 8, false};
        case rgba8_uint: return {FormatKind::uint, 4, 8, false};
        case rgba8_sint: return {FormatKind::sint, 4, 8, false};
        case bgra8_unorm: return {FormatKind::unorm, 4, 8, true};
        case bgra8_srgb: return {FormatKind::srgb, 4, 8, true};
        case r16_unorm: return {FormatKind::unorm, 1, 16, false};
        case r16_snorm: return {FormatKind::snorm, 1, 16, false};
        case r16_uint: return {FormatKind::uint, 1, 16, false};
        case r16_sint: return {FormatKind::sint, 1, 16, false};
        case r16_float: return {FormatKind::floating, 1, 16, false};
        case rg16_unorm: return {FormatKind::unorm, 2, 16, false};
        case rg16_snorm: return {FormatKind::snorm, 2, 16, false};
        case rg16_uint: return {FormatKind::uint, 2, 16, false};
        case rg16_sint: return {FormatKind::sint, 2, 16, false};
        case rg16_float: return {FormatKind::floating, 2, 16, false};
        case rgba16_unorm: return {FormatKind::unorm, 4, 16, false};
        case rgba16_snorm: return {FormatKind::snorm, 4, 16, false};
        case rgba16_uint: return {FormatKind::uint, 4, 16, false};
        case rgba16_sint: return {FormatKind::sint, 4, 16, false};
        case rgba16_float: return {FormatKind::floating, 4, 16, false};
        case r32_uint: return {FormatKind::uint, 1, 32, false};
        case r32_sint: return {FormatKind::sint, 1, 32, false};
        case r32_float: return {FormatKind::floating, 1, 32, false};
        case rg32_uint: return {FormatKind::uint, 2, 32, false};
        case rg32_sint: return {FormatKind::sint, 2, 32, false};
        case rg32_float: return {FormatKind::floating, 2, 32, false};
        case rgba32_uint: return {FormatKind::uint, 4, 32, false};
        case rgba32_sint: return {FormatKind::sint, 4, 32, false};
        case rgba32_float: return {FormatKind::floating, 4, 32, false};
        case rgb10a2_unorm: return {FormatKind::unorm, 4, 0, false};
        case rgb10a2_uint: return {FormatKind::uint, 4, 0, false};
        case rg11b10_float: return {FormatKind::floating, 3, 0, false};
        default: return {FormatKind::uint, 0, 0, false};
    }
}

/// Bits of a float without sign and with 5 bits of exponent, `mantissa` bits of mantissa; halves to the even one.
/// Values of `overflow` and above become infinity; what is not a number stays so.
template <int mantissa>
NACRE_LANES_INLINE Ints small_float(const Floats& magnitude, float overflow) {
    constexpr int dropped = 23 - mantissa;
    const Ints rebased = bits_of(magnitude) - ints(112 << 23);
    const Ints rounded =
        shift_right<dropped>(rebased + ints((1 << (dropped - 1)) - 1) + (shift_right<dropped>(rebased) & ints(1)));
    const Floats unit = floats(static_cast<float>(1 << (14 + mantissa)));
    const Floats tiny = select(less(magnitude, floats(1.0f)), magnitude, floats(0.0f));
    Ints result = select(less(magnitude, floats(0x1p-14f)), round_to_ints(tiny * unit), rounded);
    result = select(less_or_equal(floats(overflow), magnitude), ints(31 << mantissa), result);
    return select(less(bits_of(magnitude), ints(0x7f800001)), result, ints(31 << mantissa | 1 << (mantissa - 1)));
}

template <int mantissa>
NACRE_LANES_INLINE Floats from_small_float(const Ints& bits) {
    const Ints exponent = shift_right<mantissa>(bits);
    const Ints normal = shift_left<23 - mantissa>(bits) + ints(112 << 23);
    const Ints special = normal + ints(112 << 23);
    const Floats tiny = to_floats(bits) * floats(1.0f / static_cast<float>(1 << (14 + mantissa)));
    const Ints result = select(equal(exponent, ints(31)), special, normal);
    return select(equal(exponent, ints(0)), tiny, floats_of_bits(result));
}

NACRE_LANES_INLINE Ints to_half(const Ints& value) {
    const Ints sign = shift_right<16>(value) & ints(0x8000);
    return sign | small_float<10>(absolute(floats_of_bits(value)), 65520.0f);
}
NACRE_LANES_INLINE Floats from_half(const Ints& bits) {
    const Ints sign = shift_left<16>(bits & ints(0x8000));
    return floats_of_bits(bits_of(from_small_float<10>(bits & ints(0x7fff))) | sign);
}

/// Finite values beyond the largest one become it, values below zero become zero.
template <int mantissa>
NACRE_LANES_INLINE Ints to_unsigned_float(const Ints& value) {
    constexpr float largest = 65536.0f - static_cast<float>(1 << (15 - mantissa));
    const Floats real = floats_of_bits(value);
    const Ints magnitude_bits = value & ints(0x7fffffff);
    const Lanes is_finite = less(magnitude_bits, ints(0x7f800000));
    const Floats bounded = select(is_finite, minimum(real, floats(largest)), real);
    const Lanes below = less(real, floats(0.0f)) | (is_finite & ~less(floats(0.0f), real));
    const Ints result = small_float<mantissa>(floats_of_bits(bits_of(bounded) & ints(0x7fffffff)), 65536.0f);
    return select(below, ints(0), result);
}

NACRE_LANES_INLINE Ints to_unorm(const Ints& value, int bits) {
    const float largest = static_cast<float>((1u << bits) - 1);
    return round_to_ints(clamp(floats_of_bits(value), 0.0f, 1.0f) * floats(largest));
}
NACRE_LANES_INLINE Floats from_unorm(const Ints& value, int bits) {
    return to_floats(value) / floats(static_cast<float>((1u << bits) - 1));
}
NACRE_LANES_INLINE Ints to_snorm(const Ints& value, int bits) {
    const Floats real = floats_of_bits(value);
    const Floats number = select(less_or_equal(real, real), real, floats(0.0f));
    const float largest = static_cast<float>((1u << (bits - 1)) - 1);
    return round_to_ints(clamp(number, -1.0f, 1.0f) * floats(largest)) & ints((1 << bits) - 1);
}
NACRE_LANES_INLINE Ints sign_extended(const Ints& value, int bits) {
    const Ints sign = ints(1 << (bits - 1));
    return (value ^ sign) - sign;
}
NACRE_LANES_INLINE Floats from_snorm(const Ints& value, int bits) {
    const float largest = static_cast<float>((1u << (bits - 1)) - 1);
    return maximum(to_floats(sign_extended(value, bits)) / floats(largest), floats(-1.0f));
}
/// Integers that do not fit keep their low bits.
NACRE_LANES_INLINE Ints to_integer(const Ints& value, int bits) { return value & ints((1 << bits) - 1); }

inline Ints to_srgb8(const SrgbTables& tables, const Ints& value) {
    float values[16];
    std::int32_t codes[16];
    store(values, clamp(floats_of_bits(value), 0.0f, 1.0f));
    for (int lane = 0; lane < 16; ++lane) {
        const float linear = values[lane];
        if (linear < SrgbTables::first_value) {
            codes[lane] = 0;
            continue;
        }
        std::uint32_t bits;
        std::memcpy(&bits, &linear, sizeof(bits));
        std::uint32_t code = tables.starts[(bits - SrgbTables::first_bits) >> SrgbTables::bucket_shift];
        while (code < 255 && linear >= tables.thresholds[code]) ++code;
        codes[lane] = static_cast<std::int32_t>(code);
    }
    return load(codes);
}
inline Floats from_srgb8(const SrgbTables& tables, const Ints& value) {
    std::int32_t codes[16];
    float values[16];
    store(codes, value);
    for (int lane = 0; lane < 16; ++lane) values[lane] = tables.linear[codes[lane] & 255];
    return load(values);
}

/// @param channels  bits of floats, or integers for integer formats
/// @param words     as many as a texel has; texels below 32 bits lie in the low bits
inline void encode_texels(rhi::Format format, const SrgbTables& tables, const Ints (&channels)[4], Ints (&words)[4]) {
    const TexelLayout layout = texel_layout(format);
    using rhi::FormatKind;
    if (layout.bits == 32) {
        for (std::uint32_t i = 0; i < 4; ++i) words[i] = channels[i];
        return;
    }
    if (layout.bits == 0) {
        if (format == rhi::Format::rg11b10_float) {
            words[0] = to_unsigned_float<6>(channels[0]) | shift_left<11>(to_unsigned_float<6>(channels[1])) |
                       shift_left<22>(to_unsigned_float<5>(channels[2]));
        } else if (format == rhi::Format::rgb10a2_unorm) {
            words[0] = to_unorm(channels[0], 10) | shift_left<10>(to_unorm(channels[1], 10)) |
                       shift_left<20>(to_unorm(channels[2], 10)) | shift_left<30>(to_unorm(channels[3], 2));
        } else {
            words[0] = to_integer(channels[0], 10) | shift_left<10>(to_integer(channels[1], 10)) |
                       shift_left<20>(to_integer(channels[2], 10)) | shift_left<30>(to_integer(channels[3], 2));
        }
        return;
    }
    const int bits = static_cast<int>(layout.bits);
    words[0] = words[1] = ints(0);
    for (std::uint32_t i = 0; i < layout.channels; ++i) {
        const Ints& value = channels[layout.blue_first && i < 3 ? 2 - i : i];
        Ints code;
        switch (layout.kind) {
            case FormatKind::unorm: code = to_unorm(value, bits); break;
            case FormatKind::snorm: code = to_snorm(value, bits); break;
            case FormatKind::uint:
            case FormatKind::sint: code = to_integer(value, bits); break;
            case FormatKind::srgb: code = i < 3 ? to_srgb8(tables, value) : to_unorm(value, bits); break;
            default: code = to_half(value); break;
        }
        const int place = static_cast<int>(i) * bits;
        Ints& word = words[place / 32];
        word = word | shift_left(code, place % 32);
    }
}

/// The opposite; channels that the format lacks become 0, alpha 1. Formats of floats, normalized and sRGB only.
inline void decode_texels(rhi::Format format, const SrgbTables& tables, const Ints (&words)[4], Floats (&channels)[4]) {
    const TexelLayout layout = texel_layout(format);
    using rhi::FormatKind;
    channels[0] = channels[1] = channels[2] = floats(0.0f);
    channels[3] = floats(1.0f);
    if (layout.bits == 32) {
        for (std::uint32_t i = 0; i < layout.channels; ++i) channels[i] = floats_of_bits(words[i]);
        return;
    }
    if (layout.bits == 0) {
        if (format == rhi::Format::rg11b10_float) {
            channels[0] = from_small_float<6>(words[0] & ints(0x7ff));
            channels[1] = from_small_float<6>(shift_right<11>(words[0]) & ints(0x7ff));
            channels[2] = from_small_float<5>(shift_right<22>(words[0]));
        } else {
            channels[0] = from_unorm(words[0] & ints(1023), 10);
            channels[1] = from_unorm(shift_right<10>(words[0]) & ints(1023), 10);
            channels[2] = from_unorm(shift_right<20>(words[0]) & ints(1023), 10);
            channels[3] = from_unorm(shift_right<30>(words[0]), 2);
        }
        return;
    }
    const int bits = static_cast<int>(layout.bits);
    for (std::uint32_t i = 0; i < layout.channels; ++i) {
        const int place = static_cast<int>(i) * bits;
        const Ints code = shift_right(words[place / 32], place % 32) & ints((1 << bits) - 1);
        Floats& channel = channels[layout.blue_first && i < 3 ? 2 - i : i];
        switch (layout.kind) {
            case FormatKind::unorm: channel = from_unorm(code, bits); break;
            case FormatKind::snorm: channel = from_snorm(code, bits); break;
            case FormatKind::srgb: channel = i < 3 ? from_srgb8(tables, code) : from_unorm(code, bits); break;
            default: channel = from_half(code); break;
        }
    }
}

}  // namespace
}  // namespace nacre::cpu::raster
