// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/texels.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace nacre::gl {
namespace {

using rhi::Format;
using rhi::FormatKind;

/// A float with `mantissa_bits` of mantissa and 5 of exponent (half, 11 and 10 bits), rounded to the nearest even.
std::uint32_t small_float(float value, int mantissa_bits, bool has_sign) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
    const bool negative = (bits >> 31) != 0;
    const std::uint32_t sign = has_sign && negative ? 1u << (mantissa_bits + 5) : 0;
    const std::uint32_t infinity = 31u << mantissa_bits;
    if (std::isnan(value)) return sign | infinity | (1u << (mantissa_bits - 1));
    if (negative && !has_sign) return 0;
    const float magnitude = std::fabs(value);
    if (std::isinf(value)) return sign | infinity;
    const float step = std::ldexp(1.0f, -14 - mantissa_bits);
    if (magnitude < std::ldexp(1.0f, -14)) {
        // Denormal: a multiple of the smallest step; rounding up to the smallest normal number carries by itself.
        return sign | static_cast<std::uint32_t>(std::nearbyint(magnitude / step));
    }
    int exponent = 0;
    const float fraction = std::frexp(magnitude, &exponent);  // [0.5, 1)
    const auto scaled = static_cast<std::uint32_t>(std::nearbyint(std::ldexp(fraction, mantissa_bits + 1)));
    // `scaled` has the leading one that the format leaves out; it raises the exponent by the missing step.
    const std::uint32_t result = (static_cast<std::uint32_t>(exponent + 13) << mantissa_bits) + scaled;
    if (result >= infinity) return sign | (has_sign ? infinity : infinity - 1);
    return sign | result;
}

/// Shared exponent: OpenGL 4.5, section 8.5.2.
std::uint32_t shared_exponent(const std::array<float, 3>& color) {
    constexpr float largest = 65408.0f;
    std::array<float, 3> clamped{};
    for (std::size_t i = 0; i < 3; ++i)
        clamped[i] = std::isnan(color[i]) ? 0.0f : std::clamp(color[i], 0.0f, largest);
    const float highest = std::max({clamped[0], clamped[1], clamped[2]});
    int exponent = std::max(-16, highest > 0.0f ? std::ilogb(highest) : -16) + 16;
    float scale = std::ldexp(1.0f, exponent - 15 - 9);
    if (std::floor(highest / scale + 0.5f) >= 512.0f) scale = std::ldexp(1.0f, ++exponent - 15 - 9);
    std::uint32_t packed = static_cast<std::uint32_t>(exponent) << 27;
    for (std::size_t i = 0; i < 3; ++i)
        packed |= static_cast<std::uint32_t>(std::floor(clamped[i] / scale + 0.5f)) << (9 * i);
    return packed;
}

std::uint32_t unorm(float value, int bits) {
    const double scale = static_cast<double>((std::uint64_t{1} << bits) - 1);
    return static_cast<std::uint32_t>(
        std::nearbyint(std::clamp<double>(std::isnan(value) ? 0.0 : value, 0.0, 1.0) * scale));
}

std::uint32_t snorm(float value, int bits) {
    const double scale = static_cast<double>((std::uint64_t{1} << (bits - 1)) - 1);
    const double rounded = std::nearbyint(std::clamp<double>(std::isnan(value) ? 0.0 : value, -1.0, 1.0) * scale);
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(rounded));
}

float encode_srgb(float linear) {
    return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

void store(std::uint32_t value, std::size_t bytes, std::byte* destination) {
    std::memcpy(destination, &value, bytes);  // Little-endian: the low bytes come first.
}

}  // namespace

void pack_texel(Format format, const ShaderTexel& texel, std::byte* destination) {
    std::array<float, 4> value{};
    for (std::size_t i = 0; i < 4; ++i) value[i] = std::bit_cast<float>(texel[i]);
    switch (format) {
        case Format::rgb10a2_unorm:
            store(
                unorm(value[0], 10) | unorm(value[1], 10) << 10 | unorm(value[2], 10) << 20 | unorm(value[3], 2) << 30,
                4, destination);
            return;
        case Format::rgb10a2_uint:
            store((texel[0] & 1023) | (texel[1] & 1023) << 10 | (texel[2] & 1023) << 20 | (texel[3] & 3) << 30, 4,
                  destination);
            return;
        case Format::rg11b10_float:
            store(small_float(value[0], 6, false) | small_float(value[1], 6, false) << 11 |
                      small_float(value[2], 5, false) << 22,
                  4, destination);
            return;
        case Format::rgb9e5_float: store(shared_exponent({value[0], value[1], value[2]}), 4, destination); return;
        case Format::d16_unorm: store(unorm(value[0], 16), 2, destination); return;
        case Format::d24_unorm_s8_uint: store(unorm(value[0], 24), 4, destination); return;
        case Format::d32_float:
        case Format::d32_float_s8_uint: store(texel[0], 4, destination); return;
        default: break;
    }
    const rhi::FormatInfo& facts = rhi::info(format);
    const std::size_t bytes = facts.block_bytes / facts.channels;
    const int bits = static_cast<int>(bytes * 8);
    for (std::size_t channel = 0; channel < facts.channels; ++channel, destination += bytes) switch (facts.kind) {
            case FormatKind::unorm: store(unorm(value[channel], bits), bytes, destination); break;
            case FormatKind::snorm: store(snorm(value[channel], bits), bytes, destination); break;
            case FormatKind::uint:
            case FormatKind::sint: store(texel[channel], bytes, destination); break;
            case FormatKind::floating:
                store(bytes == 2 ? small_float(value[channel], 10, true) : texel[channel], bytes, destination);
                break;
            case FormatKind::srgb:
                store(unorm(channel < 3 ? encode_srgb(value[channel]) : value[channel], 8), 1, destination);
                break;
        }
}

ShaderTexel clear_texel(Format format, const rhi::ClearColor& color) {
    if (rhi::info(format).is_integer()) return color.uint;
    ShaderTexel texel{};
    for (std::size_t i = 0; i < 4; ++i) texel[i] = std::bit_cast<std::uint32_t>(color.floating[i]);
    return texel;
}

}  // namespace nacre::gl
