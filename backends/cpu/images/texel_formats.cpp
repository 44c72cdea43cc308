// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/texel_formats.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "backends/cpu/images/block_formats.h"

namespace nacre::cpu {
namespace {

using rhi::Format;

// Where the channels of a format lie. Formats of 8, 16 and 32 bits a channel differ in nothing else.
enum class Layout : std::uint8_t { none, bytes, bytes_bgra, words, longs, packed };
enum class Coding : std::uint8_t { unorm, snorm, uint, sint, floating, srgb };

template <typename T>
T read(const std::byte* from) {
    T value;
    std::memcpy(&value, from, sizeof value);
    return value;
}
template <typename T>
void write(std::byte* to, T value) {
    std::memcpy(to, &value, sizeof value);
}

// Rounds to nearest even without a call; |value| < 2^51.
double round_even(double value) {
    constexpr double shift = 6755399441055744.0;  // 1.5 * 2^52
    return (value + shift) - shift;
}

float decode_unorm(std::uint32_t code, std::uint32_t most) {
    return static_cast<float>(static_cast<double>(code) / most);
}
float decode_snorm(std::int32_t code, std::int32_t most) {
    return std::max(-1.0f, static_cast<float>(static_cast<double>(code) / most));
}
// The product of 24 significant bits and at most 24 more is exact in double, so there is one rounding.
std::uint32_t encode_unorm(float value, std::uint32_t most) {
    if (!(value > 0.0f)) return 0;
    return static_cast<std::uint32_t>(round_even(std::min(value, 1.0f) * static_cast<double>(most)));
}
std::int32_t encode_snorm(float value, std::int32_t most) {
    if (std::isnan(value)) return 0;
    return static_cast<std::int32_t>(round_even(std::clamp(value, -1.0f, 1.0f) * static_cast<double>(most)));
}

// Floats without a sign, with a 5-bit exponent (bias 15) and `mantissa_bits` below it.
float decode_small_float(std::uint32_t bits, std::uint32_t mantissa_bits) {
    const std::uint32_t exponent = bits >> mantissa_bits, mantissa = bits & ((1u << mantissa_bits) - 1);
    if (exponent == 31) {
        return mantissa != 0 ? std::numeric_limits<float>::quiet_NaN() : std::numeric_limits<float>::infinity();
    }
    if (exponent == 0) return std::ldexp(static_cast<float>(mantissa), -14 - static_cast<int>(mantissa_bits));
    return std::bit_cast<float>(((exponent + 112) << 23) | (mantissa << (23 - mantissa_bits)));
}
std::uint32_t encode_small_float(float value, std::uint32_t mantissa_bits) {
    const std::uint32_t infinity = 31u << mantissa_bits;
    if (std::isnan(value)) {
        const std::uint32_t payload =
            std::bit_cast<std::uint32_t>(value) >> (23 - mantissa_bits) & ((1u << mantissa_bits) - 1);
        return infinity | (1u << (mantissa_bits - 1)) | payload;
    }
    if (!(value > 0.0f)) return 0;
    if (std::isinf(value)) return infinity;
    // Below 2^-14 values are multiples of the smallest one.
    if (value < 0x1p-14f) {
        return static_cast<std::uint32_t>(
            round_even(std::ldexp(static_cast<double>(value), 14 + static_cast<int>(mantissa_bits))));
    }
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(value), dropped = 23 - mantissa_bits;
    const std::uint32_t rounded = (bits + (1u << (dropped - 1)) - 1 + ((bits >> dropped) & 1)) >> dropped;
    return std::min(rounded - (112u << mantissa_bits), infinity - 1);
}

Texel decode_shared_exponent(std::uint32_t bits) {
    Texel texel{.f = {0, 0, 0, 1}};
    const int exponent = static_cast<int>(bits >> 27) - 24;  // Bias 15 and 9 bits of mantissa.
    for (int c = 0; c < 3; ++c) texel.f[c] = std::ldexp(static_cast<float>((bits >> (9 * c)) & 511), exponent);
    return texel;
}

// Vulkan specification, "Conversion From Floating-Point to Shared Exponent", step by step.
std::uint32_t encode_shared_exponent(const float* rgb) {
    constexpr float most = 65408.0f;  // 511 / 512 * 2^16
    float channels[3], largest = 0.0f;
    for (int c = 0; c < 3; ++c) {
        channels[c] = rgb[c] > 0.0f ? std::min(rgb[c], most) : 0.0f;
        largest = std::max(largest, channels[c]);
    }
    int exponent = largest > 0.0f ? std::max(-16, std::ilogb(largest)) + 16 : 0;
    const auto scaled = [](float value, int e) {
        return static_cast<std::uint32_t>(std::floor(std::ldexp(static_cast<double>(value), 24 - e) + 0.5));
    };
    if (scaled(largest, exponent) == 512) ++exponent;
    return scaled(channels[0], exponent) | (scaled(channels[1], exponent) << 9) |
           (scaled(channels[2], exponent) << 18) | (static_cast<std::uint32_t>(exponent) << 27);
}

double srgb_to_linear(double code) { return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4); }

struct SrgbTables {
    std::array<float, 256> linear{};
    // Byte k of linear[i] at 256 * k + i.
    alignas(64) std::array<std::byte, 1024> linear_bytes{};
    // thresholds[k]: smallest float whose nearest code is above k.
    std::array<float, 255> thresholds{};
    SrgbTables() {
        for (std::uint32_t code = 0; code < 256; ++code) {
            linear[code] = static_cast<float>(srgb_to_linear(code / 255.0));
            const auto bits = std::bit_cast<std::uint32_t>(linear[code]);
            for (std::uint32_t k = 0; k < 4; ++k) linear_bytes[256 * k + code] = std::byte(bits >> (8 * k));
        }
        for (int code = 0; code < 255; ++code) {
            const double exact = srgb_to_linear((code + 0.5) / 255.0);
            auto rounded = static_cast<float>(exact);
            if (rounded < exact) rounded = std::nextafter(rounded, 2.0f);
            thresholds[code] = rounded;
        }
    }
};
const SrgbTables& srgb_tables() {
    static const SrgbTables tables;
    return tables;
}

struct Shape {
    Layout layout = Layout::packed;
    std::uint8_t channels = 0;
    Coding coding = Coding::unorm;
};
Shape shape(Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    if (facts.channels == 0) return {Layout::none};
    if (facts.is_compressed() || facts.is_depth_stencil()) return {Layout::packed};
    switch (format) {
        case Format::rgb10a2_unorm:
        case Format::rgb10a2_uint:
        case Format::rg11b10_float:
        case Format::rgb9e5_float: return {Layout::packed};
        case Format::bgra8_unorm: return {Layout::bytes_bgra, 4, Coding::unorm};
        case Format::bgra8_srgb: return {Layout::bytes_bgra, 4, Coding::srgb};
        default: break;
    }
    const std::uint32_t channel_bytes = facts.block_bytes / facts.channels;
    const Layout layout = channel_bytes == 1 ? Layout::bytes : channel_bytes == 2 ? Layout::words : Layout::longs;
    return {layout, facts.channels, static_cast<Coding>(facts.kind)};
}

void decode_byte(Texel& texel, std::uint32_t c, std::uint8_t code, Coding coding) {
    switch (coding) {
        case Coding::unorm: texel.f[c] = decode_unorm(code, 255); break;
        case Coding::snorm: texel.f[c] = decode_snorm(static_cast<std::int8_t>(code), 127); break;
        case Coding::uint: texel.u[c] = code; break;
        case Coding::sint: texel.i[c] = static_cast<std::int8_t>(code); break;
        case Coding::srgb: texel.f[c] = c == 3 ? decode_unorm(code, 255) : srgb_tables().linear[code]; break;
        case Coding::floating: break;
    }
}
std::uint8_t encode_byte(const Texel& texel, std::uint32_t c, Coding coding) {
    switch (coding) {
        case Coding::unorm: return static_cast<std::uint8_t>(encode_unorm(texel.f[c], 255));
        case Coding::snorm: return static_cast<std::uint8_t>(encode_snorm(texel.f[c], 127));
        case Coding::srgb:
            return c == 3 ? static_cast<std::uint8_t>(encode_unorm(texel.f[c], 255)) : linear_to_srgb(texel.f[c]);
        default: return static_cast<std::uint8_t>(texel.u[c]);
    }
}
void decode_word(Texel& texel, std::uint32_t c, std::uint16_t code, Coding coding) {
    switch (coding) {
        case Coding::unorm: texel.f[c] = decode_unorm(code, 65535); break;
        case Coding::snorm: texel.f[c] = decode_snorm(static_cast<std::int16_t>(code), 32767); break;
        case Coding::uint: texel.u[c] = code; break;
        case Coding::sint: texel.i[c] = static_cast<std::int16_t>(code); break;
        case Coding::floating: texel.f[c] = half_to_float(code); break;
        case Coding::srgb: break;
    }
}
std::uint16_t encode_word(const Texel& texel, std::uint32_t c, Coding coding) {
    switch (coding) {
        case Coding::unorm: return static_cast<std::uint16_t>(encode_unorm(texel.f[c], 65535));
        case Coding::snorm: return static_cast<std::uint16_t>(encode_snorm(texel.f[c], 32767));
        case Coding::floating: return float_to_half(texel.f[c]);
        default: return static_cast<std::uint16_t>(texel.u[c]);
    }
}

Texel decode_packed(Format format, const std::byte* block, std::uint32_t element) {
    Texel texel{.f = {0, 0, 0, 1}};
    switch (format) {
        case Format::rgb10a2_unorm: {
            const auto bits = read<std::uint32_t>(block);
            for (int c = 0; c < 3; ++c) texel.f[c] = decode_unorm((bits >> (10 * c)) & 1023, 1023);
            texel.f[3] = decode_unorm(bits >> 30, 3);
            return texel;
        }
        case Format::rgb10a2_uint: {
            const auto bits = read<std::uint32_t>(block);
            return {.u = {bits & 1023, (bits >> 10) & 1023, (bits >> 20) & 1023, bits >> 30}};
        }
        case Format::rg11b10_float: {
            const auto bits = read<std::uint32_t>(block);
            return {.f = {decode_small_float(bits & 2047, 6), decode_small_float((bits >> 11) & 2047, 6),
                          decode_small_float(bits >> 22, 5), 1.0f}};
        }
        case Format::rgb9e5_float: return decode_shared_exponent(read<std::uint32_t>(block));
        case Format::d16_unorm: texel.f[0] = decode_unorm(read<std::uint16_t>(block), 65535); return texel;
        case Format::d24_unorm_s8_uint:
            texel.f[0] = decode_unorm(read<std::uint32_t>(block) & 0xffffff, 0xffffff);
            return texel;
        case Format::d32_float:
        case Format::d32_float_s8_uint: texel.f[0] = read<float>(block); return texel;
        case Format::bc4_r_unorm:
        case Format::bc4_r_snorm:
        case Format::bc5_rg_unorm:
        case Format::bc5_rg_snorm: {
            const bool is_signed = format == Format::bc4_r_snorm || format == Format::bc5_rg_snorm;
            for (int c = 0; c < rhi::info(format).channels; ++c) {
                float values[16];
                decode_channel_block(block + 8 * c, is_signed, values);
                texel.f[c] = values[element];
            }
            return texel;
        }
        case Format::bc6h_rgb_ufloat:
        case Format::bc6h_rgb_sfloat: {
            std::uint16_t values[16][3];
            decode_bc6h_block(block, format == Format::bc6h_rgb_sfloat, values);
            for (int c = 0; c < 3; ++c) texel.f[c] = half_to_float(values[element][c]);
            return texel;
        }
        default: {
            std::uint32_t values[16];
            decode_rgba8_block(format, block, values);
            const Coding coding = rhi::info(format).kind == rhi::FormatKind::srgb ? Coding::srgb : Coding::unorm;
            for (std::uint32_t c = 0; c < 4; ++c) {
                decode_byte(texel, c, static_cast<std::uint8_t>(values[element] >> (8 * c)), coding);
            }
            return texel;
        }
    }
}

void encode_packed(Format format, const Texel& texel, std::byte* out) {
    switch (format) {
        case Format::rgb10a2_unorm:
            write(out, encode_unorm(texel.f[0], 1023) | (encode_unorm(texel.f[1], 1023) << 10) |
                           (encode_unorm(texel.f[2], 1023) << 20) | (encode_unorm(texel.f[3], 3) << 30));
            break;
        case Format::rgb10a2_uint:
            write(out,
                  (texel.u[0] & 1023) | ((texel.u[1] & 1023) << 10) | ((texel.u[2] & 1023) << 20) | (texel.u[3] << 30));
            break;
        case Format::rg11b10_float:
            write(out, encode_small_float(texel.f[0], 6) | (encode_small_float(texel.f[1], 6) << 11) |
                           (encode_small_float(texel.f[2], 5) << 22));
            break;
        case Format::rgb9e5_float: write(out, encode_shared_exponent(texel.f)); break;
        case Format::d16_unorm: write(out, static_cast<std::uint16_t>(encode_unorm(texel.f[0], 65535))); break;
        case Format::d24_unorm_s8_uint: write(out, encode_unorm(texel.f[0], 0xffffff)); break;
        case Format::d32_float:
        case Format::d32_float_s8_uint: write(out, texel.f[0]); break;
        default: break;
    }
}

}  // namespace

float half_to_float(std::uint16_t half) {
    const std::uint32_t sign = static_cast<std::uint32_t>(half & 0x8000) << 16, magnitude = half & 0x7fff;
    if (magnitude >= 0x7c00) {
        const std::uint32_t quiet = magnitude > 0x7c00 ? 0x400000u : 0u;
        return std::bit_cast<float>(sign | 0x7f800000u | quiet | ((magnitude & 0x3ff) << 13));
    }
    // The exponent moves by multiplication, which also normalizes the denormals.
    return std::bit_cast<float>(sign | std::bit_cast<std::uint32_t>(std::bit_cast<float>(magnitude << 13) * 0x1p112f));
}

std::uint16_t float_to_half(float value) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(value), magnitude = bits & 0x7fffffff;
    const auto sign = static_cast<std::uint16_t>((bits >> 16) & 0x8000);
    if (magnitude > 0x7f800000) return static_cast<std::uint16_t>(sign | 0x7e00 | ((magnitude >> 13) & 0x3ff));
    if (magnitude >= 0x477ff000) return sign | 0x7c00;  // 65520 and above round to infinity.
    if (magnitude < 0x38800000) {
        const double scaled = static_cast<double>(std::bit_cast<float>(magnitude)) * 0x1p24;
        return static_cast<std::uint16_t>(sign | static_cast<std::uint16_t>(round_even(scaled)));
    }
    const std::uint32_t rounded = (magnitude + 0xfff + ((magnitude >> 13) & 1)) >> 13;
    return static_cast<std::uint16_t>(sign | (rounded - (112u << 10)));
}

const float* srgb_to_linear_table() { return srgb_tables().linear.data(); }
const std::byte* srgb_to_linear_bytes() { return srgb_tables().linear_bytes.data(); }

std::uint8_t linear_to_srgb(float linear) {
    if (!(linear > 0.0f)) return 0;
    const auto& thresholds = srgb_tables().thresholds;
    return static_cast<std::uint8_t>(std::upper_bound(thresholds.begin(), thresholds.end(), linear) -
                                     thresholds.begin());
}

Texel decode_texel(Format format, const std::byte* block, std::uint32_t x_in_block, std::uint32_t y_in_block) {
    const Shape form = shape(format);
    if (form.layout == Layout::none) return {.u = {0, 0, 0, 0}};
    if (form.layout == Layout::packed) return decode_packed(format, block, (y_in_block & 3) * 4 + (x_in_block & 3));
    Texel texel{.u = {0, 0, 0, 1}};
    if (form.coding != Coding::uint && form.coding != Coding::sint) texel.f[3] = 1.0f;
    for (std::uint32_t c = 0; c < form.channels; ++c) {
        switch (form.layout) {
            case Layout::bytes: decode_byte(texel, c, read<std::uint8_t>(block + c), form.coding); break;
            case Layout::bytes_bgra:
                decode_byte(texel, c, read<std::uint8_t>(block + (c < 3 ? 2 - c : 3)), form.coding);
                break;
            case Layout::words: decode_word(texel, c, read<std::uint16_t>(block + 2 * c), form.coding); break;
            default: texel.u[c] = read<std::uint32_t>(block + 4 * c); break;
        }
    }
    return texel;
}

void encode_texel(Format format, const Texel& texel, std::byte* out) {
    const Shape form = shape(format);
    if (form.layout == Layout::packed) return encode_packed(format, texel, out);
    for (std::uint32_t c = 0; c < form.channels; ++c) {
        switch (form.layout) {
            case Layout::bytes: write(out + c, encode_byte(texel, c, form.coding)); break;
            case Layout::bytes_bgra: write(out + (c < 3 ? 2 - c : 3), encode_byte(texel, c, form.coding)); break;
            case Layout::words: write(out + 2 * c, encode_word(texel, c, form.coding)); break;
            default: write(out + 4 * c, texel.u[c]); break;
        }
    }
}

}  // namespace nacre::cpu
