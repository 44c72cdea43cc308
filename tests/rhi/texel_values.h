// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "rhi/format.h"

/// @file
/// What the bytes of a texel or of a vertex attribute mean, computed apart from any driver: the reference for format
/// tests.

namespace nacre::test {

/// The four channels that a shader sees, missing ones as 0, 0, 0, 1; integers as they are.
struct TexelValue {
    std::array<double, 4> channels{0, 0, 0, 1};
    std::array<double, 4> step{};  ///< Distance of two neighboring values at this one; 0 where values are exact.
};

namespace texel_values_detail {

inline double small_float(std::uint32_t bits, int mantissa_bits, bool has_sign) {
    const int exponent = static_cast<int>(bits >> mantissa_bits & 31);
    const double mantissa = static_cast<double>(bits & ((1u << mantissa_bits) - 1)) / (1 << mantissa_bits);
    const double value = exponent == 0 ? std::ldexp(mantissa, -14) : std::ldexp(1.0 + mantissa, exponent - 15);
    return has_sign && (bits >> (mantissa_bits + 5) & 1) ? -value : value;
}

inline double from_srgb(double encoded) {
    return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

/// One channel of `bits` bits.
inline void set_channel(TexelValue& value, std::size_t channel, std::uint32_t raw, int bits, rhi::FormatKind kind) {
    const std::uint32_t mask = bits == 32 ? ~0u : (1u << bits) - 1;
    raw &= mask;
    const auto as_signed = static_cast<std::int32_t>(raw << (32 - bits)) >> (32 - bits);
    switch (kind) {
        case rhi::FormatKind::unorm:
            value.channels[channel] = static_cast<double>(raw) / mask;
            value.step[channel] = 1.0 / mask;
            break;
        case rhi::FormatKind::snorm:
            value.channels[channel] = std::max(static_cast<double>(as_signed) / (mask >> 1), -1.0);
            value.step[channel] = 1.0 / (mask >> 1);
            break;
        case rhi::FormatKind::srgb: {
            const double encoded = static_cast<double>(raw) / mask;
            value.channels[channel] = channel == 3 ? encoded : from_srgb(encoded);
            value.step[channel] = channel == 3 ? 1.0 / mask : from_srgb(encoded + 1.0 / mask) - from_srgb(encoded);
            break;
        }
        case rhi::FormatKind::uint: value.channels[channel] = raw; break;
        case rhi::FormatKind::sint: value.channels[channel] = as_signed; break;
        case rhi::FormatKind::floating:
            if (bits == 32) {
                float number = 0;
                std::memcpy(&number, &raw, 4);
                value.channels[channel] = number;
            } else {
                const int mantissa = bits == 16 ? 10 : bits - 5;
                value.channels[channel] = small_float(raw, mantissa, bits == 16);
                value.step[channel] = std::ldexp(std::max(std::abs(value.channels[channel]), 6.2e-5), -mantissa);
            }
            break;
    }
}

}  // namespace texel_values_detail

/// Decodes one texel of an uncompressed color format.
inline TexelValue decode_texel(rhi::Format format, std::span<const std::byte> bytes) {
    using namespace texel_values_detail;
    const rhi::FormatInfo& facts = rhi::info(format);
    TexelValue value;
    std::uint32_t word = 0;
    std::memcpy(&word, bytes.data(), std::min<std::size_t>(bytes.size(), 4));
    if (format == rhi::Format::rgb10a2_unorm || format == rhi::Format::rgb10a2_uint) {
        for (std::size_t c = 0; c < 4; ++c) set_channel(value, c, word >> (10 * c), c == 3 ? 2 : 10, facts.kind);
    } else if (format == rhi::Format::rg11b10_float) {
        for (std::size_t c = 0; c < 3; ++c) set_channel(value, c, word >> (11 * c), c == 2 ? 10 : 11, facts.kind);
    } else if (format == rhi::Format::rgb9e5_float) {
        // Source: EXT_texture_shared_exponent: value = mantissa * 2^(exponent - 15 - 9).
        const double scale = std::ldexp(1.0, static_cast<int>(word >> 27) - 24);
        for (std::size_t c = 0; c < 3; ++c) {
            value.channels[c] = (word >> (9 * c) & 511) * scale;
            value.step[c] = scale;
        }
    } else {
        const int bits = facts.block_bytes * 8 / facts.channels;
        for (std::size_t c = 0; c < facts.channels; ++c) {
            std::uint32_t raw = 0;
            std::memcpy(&raw, bytes.data() + c * static_cast<std::size_t>(bits) / 8,
                        static_cast<std::size_t>(bits) / 8);
            const bool is_swapped = facts.name.starts_with("bgra") && c != 3;
            // The fourth channel counts as alpha even where a format has none of the others swapped.
            set_channel(value, is_swapped ? 2 - c : c, raw, bits, facts.kind);
        }
    }
    return value;
}

}  // namespace nacre::test
