// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/texel_rows.h"

#include <algorithm>
#include <bit>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "backends/cpu/images/texel_formats.h"
#include "core/srgb.h"

namespace nacre::cpu {
namespace {

using rhi::Format;

// By a multiplication, which is off by one unit in the last place at most: so do Mesa's software drivers, and averages
// that lie in the middle between two codes then fall to the same one.
const std::array<float, 256>& unorm_bytes() {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> values{};
        for (std::uint32_t i = 0; i < 256; ++i) values[i] = static_cast<float>(i) * (1.0f / 255.0f);
        return values;
    }();
    return table;
}

const std::array<float, 256>& srgb_bytes() {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> values{};
        for (std::uint32_t i = 0; i < 256; ++i) values[i] = linear_from_srgb_byte(static_cast<std::uint8_t>(i));
        return values;
    }();
    return table;
}

/// The nearest of 256 codes; NaN counts as 0. Adding 1.5 * 2^23 leaves the rounded value (to even) in the low bits of
/// the float.
std::uint8_t unorm_byte(float value) {
    const float clamped = value > 0.0f ? std::min(value, 1.0f) : 0.0f;
    return static_cast<std::uint8_t>(std::bit_cast<std::uint32_t>(clamped * 255.0f + 12582912.0f));
}

/// Channels of 8 bits; `red` and `blue` say where those lie.
template <std::uint32_t channels, std::size_t red, std::size_t blue>
void decode_bytes(const std::byte* texels, std::uint32_t count, const std::array<float, 256>& color, LinearTexel* out) {
    const std::array<float, 256>& alpha = unorm_bytes();
    for (std::uint32_t i = 0; i < count; ++i, texels += channels) {
        const auto code = [&](std::size_t channel) { return static_cast<std::size_t>(texels[channel]); };
        out[i] = {color[code(red)], 0.0f, 0.0f, 1.0f};
        if constexpr (channels > 1) out[i][1] = color[code(1)];
        if constexpr (channels > 2) out[i][2] = color[code(blue)], out[i][3] = alpha[code(3)];
    }
}

template <std::uint32_t channels, std::size_t red, std::size_t blue, typename Encode>
void encode_bytes(const LinearTexel* texels, std::uint32_t count, std::byte* out, Encode&& color) {
    for (std::uint32_t i = 0; i < count; ++i, out += channels) {
        out[red] = static_cast<std::byte>(color(texels[i][0]));
        if constexpr (channels > 1) out[1] = static_cast<std::byte>(color(texels[i][1]));
        if constexpr (channels > 2) {
            out[blue] = static_cast<std::byte>(color(texels[i][2]));
            out[3] = static_cast<std::byte>(unorm_byte(texels[i][3]));
        }
    }
}

template <std::uint32_t channels>
void decode_floats(const std::byte* texels, std::uint32_t count, LinearTexel* out) {
    for (std::uint32_t i = 0; i < count; ++i, texels += channels * 4) {
        out[i] = {0.0f, 0.0f, 0.0f, 1.0f};
        std::memcpy(out[i].data(), texels, channels * 4);
    }
}

template <std::uint32_t channels>
void encode_floats(const LinearTexel* texels, std::uint32_t count, std::byte* out) {
    for (std::uint32_t i = 0; i < count; ++i, out += channels * 4) std::memcpy(out, texels[i].data(), channels * 4);
}

template <std::uint32_t channels>
void decode_halves(const std::byte* texels, std::uint32_t count, LinearTexel* out) {
    for (std::uint32_t i = 0; i < count; ++i, texels += channels * 2) {
        std::array<std::uint16_t, channels> halves;
        std::memcpy(halves.data(), texels, sizeof halves);
        out[i] = {0.0f, 0.0f, 0.0f, 1.0f};
        for (std::size_t c = 0; c < channels; ++c) out[i][c] = half_to_float(halves[c]);
    }
}

template <std::uint32_t channels>
void encode_halves(const LinearTexel* texels, std::uint32_t count, std::byte* out) {
    for (std::uint32_t i = 0; i < count; ++i, out += channels * 2) {
        std::array<std::uint16_t, channels> halves;
        for (std::size_t c = 0; c < channels; ++c) halves[c] = float_to_half(texels[i][c]);
        std::memcpy(out, halves.data(), sizeof halves);
    }
}

#if defined(__x86_64__)
// Four halves at once where the processor converts them; the same values as above.
bool converts_halves() {
    static const bool has_f16c = __builtin_cpu_supports("f16c");
    return has_f16c;
}

__attribute__((target("f16c"))) void decode_four_halves(const std::byte* texels, std::uint32_t count,
                                                        LinearTexel* out) {
    for (std::uint32_t i = 0; i < count; ++i)
        _mm_storeu_ps(out[i].data(), _mm_cvtph_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(texels + i * 8))));
}

__attribute__((target("f16c"))) void encode_four_halves(const LinearTexel* texels, std::uint32_t count,
                                                        std::byte* out) {
    for (std::uint32_t i = 0; i < count; ++i)
        _mm_storel_epi64(reinterpret_cast<__m128i*>(out + i * 8),
                         _mm_cvtps_ph(_mm_loadu_ps(texels[i].data()), _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC));
}
#else
bool converts_halves() { return false; }
void decode_four_halves(const std::byte*, std::uint32_t, LinearTexel*) {}
void encode_four_halves(const LinearTexel*, std::uint32_t, std::byte*) {}
#endif

template <typename Word>
void fill_words(const std::byte* texel, std::uint64_t count, std::byte* out) {
    Word word;
    std::memcpy(&word, texel, sizeof word);
    std::fill_n(reinterpret_cast<Word*>(out), count, word);
}

}  // namespace

void decode_row(Format format, const std::byte* texels, std::uint32_t count, LinearTexel* out) {
    switch (format) {
        case Format::r8_unorm: return decode_bytes<1, 0, 0>(texels, count, unorm_bytes(), out);
        case Format::rg8_unorm: return decode_bytes<2, 0, 0>(texels, count, unorm_bytes(), out);
        case Format::rgba8_unorm: return decode_bytes<4, 0, 2>(texels, count, unorm_bytes(), out);
        case Format::rgba8_srgb: return decode_bytes<4, 0, 2>(texels, count, srgb_bytes(), out);
        case Format::bgra8_unorm: return decode_bytes<4, 2, 0>(texels, count, unorm_bytes(), out);
        case Format::bgra8_srgb: return decode_bytes<4, 2, 0>(texels, count, srgb_bytes(), out);
        case Format::r16_float: return decode_halves<1>(texels, count, out);
        case Format::rg16_float: return decode_halves<2>(texels, count, out);
        case Format::rgba16_float:
            return converts_halves() ? decode_four_halves(texels, count, out) : decode_halves<4>(texels, count, out);
        case Format::r32_float: return decode_floats<1>(texels, count, out);
        case Format::rg32_float: return decode_floats<2>(texels, count, out);
        case Format::rgba32_float: return decode_floats<4>(texels, count, out);
        default: break;
    }
    const std::uint32_t texel_bytes = rhi::info(format).block_bytes;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Texel texel = decode_texel(format, texels + std::size_t{i} * texel_bytes);
        out[i] = {texel.f[0], texel.f[1], texel.f[2], texel.f[3]};
    }
}

void encode_row(Format format, const LinearTexel* texels, std::uint32_t count, std::byte* out) {
    switch (format) {
        case Format::r8_unorm: return encode_bytes<1, 0, 0>(texels, count, out, unorm_byte);
        case Format::rg8_unorm: return encode_bytes<2, 0, 0>(texels, count, out, unorm_byte);
        case Format::rgba8_unorm: return encode_bytes<4, 0, 2>(texels, count, out, unorm_byte);
        case Format::rgba8_srgb: return encode_bytes<4, 0, 2>(texels, count, out, srgb_byte_from_linear);
        case Format::bgra8_unorm: return encode_bytes<4, 2, 0>(texels, count, out, unorm_byte);
        case Format::bgra8_srgb: return encode_bytes<4, 2, 0>(texels, count, out, srgb_byte_from_linear);
        case Format::r16_float: return encode_halves<1>(texels, count, out);
        case Format::rg16_float: return encode_halves<2>(texels, count, out);
        case Format::rgba16_float:
            return converts_halves() ? encode_four_halves(texels, count, out) : encode_halves<4>(texels, count, out);
        case Format::r32_float: return encode_floats<1>(texels, count, out);
        case Format::rg32_float: return encode_floats<2>(texels, count, out);
        case Format::rgba32_float: return encode_floats<4>(texels, count, out);
        default: break;
    }
    const std::uint32_t texel_bytes = rhi::info(format).block_bytes;
    for (std::uint32_t i = 0; i < count; ++i) {
        Texel texel{};
        std::ranges::copy(texels[i], texel.f);
        encode_texel(format, texel, out + std::size_t{i} * texel_bytes);
    }
}

void fill_row(const std::byte* texel, std::uint32_t texel_bytes, std::uint64_t count, std::byte* out) {
    const bool is_uniform = std::all_of(texel, texel + texel_bytes, [&](std::byte byte) { return byte == texel[0]; });
    if (is_uniform) {
        std::memset(out, static_cast<int>(texel[0]), count * texel_bytes);
        return;
    }
    switch (texel_bytes) {
        case 2: return fill_words<std::uint16_t>(texel, count, out);
        case 4: return fill_words<std::uint32_t>(texel, count, out);
        case 8: return fill_words<std::uint64_t>(texel, count, out);
        default:
            for (std::uint64_t i = 0; i < count; ++i) std::memcpy(out + i * texel_bytes, texel, texel_bytes);
    }
}

}  // namespace nacre::cpu
