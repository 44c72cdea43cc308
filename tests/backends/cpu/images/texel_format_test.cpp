// SPDX-License-Identifier: Apache-2.0
// Decoding and encoding of texels against the formulas of the specifications in double precision.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "backends/cpu/images/texel_formats.h"

namespace nacre::cpu::test {
namespace {

using rhi::Format;
using rhi::FormatKind;

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

// (-1)^sign * 2^(e - bias) * (1 + m / 2^bits), by the definition.
double floating_value(std::uint32_t code, int exponent_bits, int mantissa_bits, bool has_sign) {
    const std::uint32_t mantissa = code & ((1u << mantissa_bits) - 1),
                        exponent = (code >> mantissa_bits) & ((1u << exponent_bits) - 1);
    const bool is_negative = has_sign && ((code >> (mantissa_bits + exponent_bits)) & 1) != 0;
    const int bias = (1 << (exponent_bits - 1)) - 1;
    double value;
    if (exponent == (1u << exponent_bits) - 1)
        value = mantissa == 0 ? infinite : not_a_number;
    else if (exponent == 0)
        value = std::ldexp(mantissa, 1 - bias - mantissa_bits);
    else
        value = std::ldexp(1.0 + std::ldexp(mantissa, -mantissa_bits), static_cast<int>(exponent) - bias);
    return is_negative ? -value : value;
}

double channel_value(std::uint32_t code, int bits, FormatKind kind, bool is_alpha) {
    const auto as_signed = static_cast<double>(static_cast<std::int32_t>(code << (32 - bits)) >> (32 - bits));
    const double most = std::ldexp(1.0, bits) - 1, most_signed = std::ldexp(1.0, bits - 1) - 1;
    switch (kind) {
        case FormatKind::unorm: return code / most;
        case FormatKind::snorm: return std::max(as_signed / most_signed, -1.0);
        case FormatKind::uint: return code;
        case FormatKind::sint: return as_signed;
        case FormatKind::floating: return bits == 32 ? std::bit_cast<float>(code) : floating_value(code, 5, 10, true);
        default: break;
    }
    const double c = code / most;
    if (is_alpha) return c;
    return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

double channel_of(const Texel& texel, int c, FormatKind kind) {
    if (kind == FormatKind::uint) return texel.u[c];
    if (kind == FormatKind::sint) return texel.i[c];
    return texel.f[c];
}

void expect_same(double found, double wanted, const char* what, std::uint32_t code) {
    if (std::isnan(wanted)) {
        ASSERT_TRUE(std::isnan(found)) << what << " " << code;
    } else if (std::isinf(wanted)) {
        ASSERT_EQ(found, wanted) << what << " " << code;
    } else {
        // One rounding to float; the power of sRGB may be off by its own last bit.
        ASSERT_NEAR(found, static_cast<float>(wanted), std::abs(wanted) * 0x1p-24) << what << " " << code;
    }
}

bool has_plain_channels(Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    if (format == Format::undefined || facts.is_compressed() || facts.is_depth_stencil()) return false;
    return format != Format::rgb10a2_unorm && format != Format::rgb10a2_uint && format != Format::rg11b10_float &&
           format != Format::rgb9e5_float;
}

TEST(TexelFormats, DecodeEveryPatternOfEveryChannel) {
    for (std::uint32_t f = 1; f < rhi::format_count; ++f) {
        const auto format = static_cast<Format>(f);
        if (!has_plain_channels(format)) continue;
        const rhi::FormatInfo& facts = rhi::info(format);
        SCOPED_TRACE(facts.name);
        const int bytes = facts.block_bytes / facts.channels, bits = 8 * bytes;
        const bool is_bgra = format == Format::bgra8_unorm || format == Format::bgra8_srgb;
        std::mt19937 random(3);
        const std::uint32_t patterns = bits == 32 ? 10000u : 1u << bits;
        for (std::uint32_t i = 0; i < patterns; ++i) {
            std::byte memory[16];
            for (std::byte& each : memory) each = static_cast<std::byte>(random());
            const std::uint32_t code = bits == 32 ? static_cast<std::uint32_t>(random()) : i;
            const int channel = static_cast<int>(random() % facts.channels),
                      place = is_bgra && channel < 3 ? 2 - channel : channel;
            std::memcpy(memory + place * bytes, &code, static_cast<std::size_t>(bytes));
            const Texel texel = decode_texel(format, memory);
            ASSERT_NO_FATAL_FAILURE(expect_same(channel_of(texel, channel, facts.kind),
                                                channel_value(code, bits, facts.kind, channel == 3), "code", code));
            for (int c = facts.channels; c < 4; ++c) ASSERT_EQ(channel_of(texel, c, facts.kind), c == 3 ? 1.0 : 0.0);

            // What was decoded is encoded to the same bits. Exceptions: the second code of -1, payloads of NaN.
            std::byte again[16] = {};
            encode_texel(format, texel, again);
            const Texel twice = decode_texel(format, again);
            for (int c = 0; c < facts.channels; ++c) {
                const double once = channel_of(texel, c, facts.kind);
                if (!std::isnan(once)) {
                    ASSERT_EQ(channel_of(twice, c, facts.kind), once) << "code " << code;
                }
            }
            const bool is_unique = facts.kind != FormatKind::snorm && facts.kind != FormatKind::floating;
            if (is_unique) {
                ASSERT_EQ(std::memcmp(memory, again, facts.block_bytes), 0) << "code " << code;
            }
        }
    }
}

TEST(TexelFormats, DecodePackedFormats) {
    std::mt19937 random(5);
    for (std::uint32_t i = 0; i < (1u << 17); ++i) {
        const auto bits = static_cast<std::uint32_t>(random());
        std::byte memory[4];
        std::memcpy(memory, &bits, 4);
        const Texel small = decode_texel(Format::rg11b10_float, memory);
        ASSERT_NO_FATAL_FAILURE(expect_same(small.f[0], floating_value(bits & 2047, 5, 6, false), "red", bits));
        ASSERT_NO_FATAL_FAILURE(
            expect_same(small.f[1], floating_value((bits >> 11) & 2047, 5, 6, false), "green", bits));
        ASSERT_NO_FATAL_FAILURE(expect_same(small.f[2], floating_value(bits >> 22, 5, 5, false), "blue", bits));
        const Texel shared = decode_texel(Format::rgb9e5_float, memory);
        const Texel unorm = decode_texel(Format::rgb10a2_unorm, memory),
                    uint = decode_texel(Format::rgb10a2_uint, memory);
        for (int c = 0; c < 3; ++c) {
            ASSERT_EQ(shared.f[c], std::ldexp((bits >> (9 * c)) & 511, static_cast<int>(bits >> 27) - 24));
            ASSERT_EQ(uint.u[c], (bits >> (10 * c)) & 1023);
            ASSERT_NO_FATAL_FAILURE(expect_same(unorm.f[c], uint.u[c] / 1023.0, "unorm", bits));
        }
        ASSERT_EQ(uint.u[3], bits >> 30);
        ASSERT_EQ(unorm.f[3], static_cast<float>((bits >> 30) / 3.0));
        for (const Format format : {Format::rgb10a2_unorm, Format::rgb10a2_uint}) {
            std::uint32_t again = 0;
            encode_texel(format, format == Format::rgb10a2_uint ? uint : unorm, reinterpret_cast<std::byte*>(&again));
            ASSERT_EQ(again, bits);
        }
        const Texel d24 = decode_texel(Format::d24_unorm_s8_uint, memory);
        ASSERT_NO_FATAL_FAILURE(expect_same(d24.f[0], (bits & 0xffffff) / 16777215.0, "d24", bits));
        std::uint32_t again = 0;
        encode_texel(Format::d24_unorm_s8_uint, d24, reinterpret_cast<std::byte*>(&again));
        // A float has just enough bits to tell the codes below 1 / 2 apart, and rounds to even above.
        ASSERT_NEAR(static_cast<double>(again), bits & 0xffffff, 0.5);
        const Texel d16 = decode_texel(Format::d16_unorm, memory);
        ASSERT_NO_FATAL_FAILURE(expect_same(d16.f[0], (bits & 0xffff) / 65535.0, "d16", bits));
        ASSERT_EQ(decode_texel(Format::d32_float_s8_uint, memory).u[0], bits);
        ASSERT_EQ(d16.f[1], 0.0f);
        ASSERT_EQ(d16.f[3], 1.0f);
    }
}

// The nearest of all codes, by search among neighbors of what was found; ties go to the even one.
void expect_nearest(double value, std::uint32_t code, std::uint32_t most, const auto& value_of) {
    const double error = std::abs(value_of(code) - value);
    for (const std::int64_t step : {-1, 1}) {
        const std::int64_t other = static_cast<std::int64_t>(code) + step;
        if (other < 0 || other > most) continue;
        const double other_error = std::abs(value_of(static_cast<std::uint32_t>(other)) - value);
        ASSERT_LE(error, other_error) << value << " became " << code;
        if (error == other_error) {
            ASSERT_EQ(code % 2, 0u) << value << " became " << code;
        }
    }
}

TEST(TexelFormats, EncodingTakesTheNearestCode) {
    std::mt19937 random(7);
    for (int i = 0; i < 200000; ++i) {
        Texel texel;
        const auto draw = [&] {
            // Half of the values close to ties of 8 bits, the others of all magnitudes.
            if (random() % 2 == 0)
                return static_cast<float>((static_cast<double>(random() % 255) + 0.5) / 255 +
                                          std::ldexp(static_cast<double>(random() % 5) - 2, -26));
            return std::ldexp(static_cast<float>(random() >> 8), -24 - static_cast<int>(random() % 24)) *
                   (random() % 8 == 0 ? 65536.0f : 1.0f);
        };
        for (float& each : texel.f) each = draw();
        const float x = texel.f[0];
        std::byte out[16];
        const auto encoded = [&](Format format) {
            std::memset(out, 0, sizeof out);
            encode_texel(format, texel, out);
            std::uint32_t word;
            std::memcpy(&word, out, 4);
            return word;
        };
        const double unit = std::min(x, 1.0f);
        ASSERT_NO_FATAL_FAILURE(expect_nearest(unit * 255.0, encoded(Format::r8_unorm), 255,
                                               [](std::uint32_t c) { return static_cast<double>(c); }));
        ASSERT_NO_FATAL_FAILURE(expect_nearest(unit * 65535.0, encoded(Format::r16_unorm), 65535,
                                               [](std::uint32_t c) { return static_cast<double>(c); }));
        ASSERT_NO_FATAL_FAILURE(expect_nearest(unit * 127.0, encoded(Format::r8_snorm), 127,
                                               [](std::uint32_t c) { return static_cast<double>(c); }));
        // The nearest sRGB code is the nearest after the inverse function.
        const double srgb = unit <= 0.0031308 ? 12.92 * unit : 1.055 * std::pow(unit, 1 / 2.4) - 0.055;
        ASSERT_NEAR(encoded(Format::rgba8_srgb) & 255, srgb * 255.0, 0.5 + 2e-4);
        if (x < 65504.0f) {
            ASSERT_NO_FATAL_FAILURE(expect_nearest(x, encoded(Format::r16_float), 0x7bff,
                                                   [](std::uint32_t c) { return floating_value(c, 5, 10, true); }));
            const std::uint32_t small = encoded(Format::rg11b10_float);
            if (x < 65024.0f) {
                ASSERT_NO_FATAL_FAILURE(expect_nearest(x, small & 2047, 0x7bf,
                                                       [](std::uint32_t c) { return floating_value(c, 5, 6, false); }));
            }
            if (texel.f[2] < 64512.0f) {
                ASSERT_NO_FATAL_FAILURE(expect_nearest(texel.f[2], small >> 22, 0x3df,
                                                       [](std::uint32_t c) { return floating_value(c, 5, 5, false); }));
            }
        }
        // Shared exponents: half a step of the largest channel; and no smaller exponent could have held it.
        const std::uint32_t shared = encoded(Format::rgb9e5_float);
        const double step = std::ldexp(1.0, static_cast<int>(shared >> 27) - 24);
        const double largest = std::max({texel.f[0], texel.f[1], texel.f[2]});
        const Texel back = decode_texel(Format::rgb9e5_float, out);
        for (int c = 0; c < 3; ++c) ASSERT_LE(std::abs(back.f[c] - std::min(texel.f[c], 65408.0f)), 0.5 * step);
        if ((shared >> 27) > 0) {
            ASSERT_GT(std::min(largest, 65408.0), 511.4 * step / 2);
        }
    }
}

TEST(TexelFormats, EncodingClampsAndKnowsSpecialValues) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    const auto encoded = [](Format format, float value) {
        const Texel texel{.f = {value, value, value, value}};
        std::uint32_t word = 0;
        std::byte out[16] = {};
        encode_texel(format, texel, out);
        std::memcpy(&word, out, 4);
        return word;
    };
    for (const float value : {nan, -1.0f, -infinity, -0.0f}) {
        EXPECT_EQ(encoded(Format::r8_unorm, value), 0u);
        EXPECT_EQ(encoded(Format::rgba8_srgb, value), 0u);
        EXPECT_EQ(encoded(Format::d24_unorm_s8_uint, value), 0u);
        EXPECT_EQ(encoded(Format::rgb9e5_float, value), 0u);
        if (value == value) {
            EXPECT_EQ(encoded(Format::rg11b10_float, value), 0u);
        }
    }
    EXPECT_EQ(encoded(Format::r8_unorm, infinity), 255u);
    EXPECT_EQ(encoded(Format::rgba8_srgb, 2.0f), 0xffffffffu);
    EXPECT_EQ(encoded(Format::r16_snorm, -infinity), 0x8001u);
    EXPECT_EQ(encoded(Format::r16_snorm, nan), 0u);
    EXPECT_EQ(encoded(Format::d24_unorm_s8_uint, 1.5f), 0xffffffu);
    EXPECT_EQ(encoded(Format::r16_float, 65519.0f), 0x7bffu);
    EXPECT_EQ(encoded(Format::r16_float, 65520.0f), 0x7c00u);
    EXPECT_EQ(encoded(Format::r16_float, -infinity), 0xfc00u);
    EXPECT_EQ(encoded(Format::r16_float, -0.0f), 0x8000u);
    EXPECT_GT(encoded(Format::r16_float, nan) & 0x7fff, 0x7c00u);
    EXPECT_EQ(encoded(Format::rg11b10_float, 1e30f), 0x7bfu | (0x7bfu << 11) | (0x3dfu << 22));
    EXPECT_EQ(encoded(Format::rg11b10_float, infinity), 0x7c0u | (0x7c0u << 11) | (0x3e0u << 22));
    EXPECT_TRUE(std::isnan(decode_texel(Format::rg11b10_float,
                                        [&] {
                                            static std::uint32_t word;
                                            word = encoded(Format::rg11b10_float, nan);
                                            return reinterpret_cast<const std::byte*>(&word);
                                        }())
                               .f[2]));
    EXPECT_EQ(encoded(Format::rgb9e5_float, infinity), 0x1ffu * 0x40201u | (31u << 27));
    const std::byte nothing[16] = {};
    for (const std::uint32_t channel : decode_texel(Format::undefined, nothing).u) EXPECT_EQ(channel, 0u);
    EXPECT_EQ(decode_texel(static_cast<Format>(250), nothing).u[3], 0u);
    std::byte kept[16];
    std::memset(kept, 0x5a, sizeof kept);
    encode_texel(Format::bc7_rgba_unorm, {.f = {1, 1, 1, 1}}, kept);
    encode_texel(Format::undefined, {.f = {1, 1, 1, 1}}, kept);
    for (const std::byte each : kept) EXPECT_EQ(each, std::byte{0x5a});
}

TEST(TexelFormats, SrgbTableAndThresholdsFit) {
    for (int code = 0; code < 256; ++code) EXPECT_EQ(linear_to_srgb(srgb_to_linear_table()[code]), code);
}

}  // namespace
}  // namespace nacre::cpu::test
