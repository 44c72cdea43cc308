// SPDX-License-Identifier: Apache-2.0
#include "measure/texel_decoding.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "core/srgb.h"

namespace nacre::measure {
namespace {

using rhi::Format;
using rhi::FormatKind;

// Floats of 5 exponent bits and any mantissa, without their sign bit.
double decode_small_float(unsigned bits, int mantissa_bits) {
    const unsigned mantissa = bits & ((1u << mantissa_bits) - 1);
    const int exponent = static_cast<int>(bits >> mantissa_bits & 31);
    if (exponent == 31) {
        return mantissa ? std::numeric_limits<double>::quiet_NaN() : std::numeric_limits<double>::infinity();
    }
    if (exponent == 0) return std::ldexp(double(mantissa), -14 - mantissa_bits);
    return std::ldexp(1.0 + std::ldexp(double(mantissa), -mantissa_bits), exponent - 15);
}

double decode_channel(FormatKind kind, std::uint32_t code, unsigned bits) {
    const double largest_unsigned = std::ldexp(1.0, int(bits)) - 1;
    const double largest_signed = std::ldexp(1.0, int(bits) - 1) - 1;
    const double as_signed = code > largest_signed ? double(code) - largest_unsigned - 1 : double(code);
    switch (kind) {
        case FormatKind::unorm: return double(code) / largest_unsigned;
        case FormatKind::srgb: return double(linear_from_srgb_byte(static_cast<std::uint8_t>(code)));
        case FormatKind::snorm: return std::max(-1.0, as_signed / largest_signed);
        case FormatKind::uint: return code;
        case FormatKind::sint: return as_signed;
        case FormatKind::floating: return bits == 16 ? decode_half(code) : double(std::bit_cast<float>(code));
    }
    return 0.0;
}

std::uint32_t load(const std::byte* at, std::size_t bytes) {
    std::uint32_t value = 0;
    std::memcpy(&value, at, bytes);
    return value;
}

}  // namespace

double decode_half(unsigned bits) {
    const double magnitude = decode_small_float(bits & 0x7fff, 10);
    return bits & 0x8000 ? -magnitude : magnitude;
}

void decode_format(Format format, const std::byte* texel, double (&channels)[4]) {
    std::fill(std::begin(channels), std::end(channels), 0.0);
    const rhi::FormatInfo& facts = rhi::info(format);
    switch (format) {
        case Format::rgb10a2_unorm:
        case Format::rgb10a2_uint: {
            const std::uint32_t word = load(texel, 4);
            for (int c = 0; c < 3; ++c) channels[c] = decode_channel(facts.kind, word >> (10 * c) & 1023, 10);
            channels[3] = decode_channel(facts.kind, word >> 30, 2);
            return;
        }
        case Format::rg11b10_float: {
            const std::uint32_t word = load(texel, 4);
            channels[0] = decode_small_float(word & 2047, 6);
            channels[1] = decode_small_float(word >> 11 & 2047, 6);
            channels[2] = decode_small_float(word >> 22, 5);
            return;
        }
        case Format::rgb9e5_float: {
            const std::uint32_t word = load(texel, 4);
            for (int c = 0; c < 3; ++c) channels[c] = std::ldexp(double(word >> (9 * c) & 511), int(word >> 27) - 24);
            return;
        }
        case Format::d16_unorm: channels[0] = load(texel, 2) / 65535.0; return;
        case Format::d32_float: channels[0] = double(std::bit_cast<float>(load(texel, 4))); return;
        case Format::d24_unorm_s8_uint: {
            const std::uint32_t word = load(texel, 4);
            channels[0] = (word & 0xffffff) / 16777215.0;
            channels[1] = word >> 24;
            return;
        }
        case Format::d32_float_s8_uint:
            channels[0] = double(std::bit_cast<float>(load(texel, 4)));
            channels[1] = load(texel + 4, 1);
            return;
        default: break;
    }
    if (facts.is_compressed() || facts.channels == 0) return;
    const std::size_t bytes = facts.block_bytes / facts.channels;
    for (std::size_t c = 0; c < facts.channels; ++c) {
        // Alpha of an srgb format is not encoded.
        const FormatKind kind = facts.kind == FormatKind::srgb && c == 3 ? FormatKind::unorm : facts.kind;
        channels[c] = decode_channel(kind, load(texel + c * bytes, bytes), static_cast<unsigned>(bytes * 8));
    }
    if (format == Format::bgra8_unorm || format == Format::bgra8_srgb) std::swap(channels[0], channels[2]);
}

}  // namespace nacre::measure
