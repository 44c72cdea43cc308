// SPDX-License-Identifier: Apache-2.0
// The words of texels that all lanes store. Bits are those of `encode_texel`.
#pragma once

#include "backends/cpu/images/kernels/texel_codecs.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

/// Rounds x * most to nearest even as if the product were exact; most = 2^bits - 1, 0 <= |x| <= 1, bits <= 16.
template <int W>
NACRE_INLINE Ints<W> scale_and_round(Floats<W> x, std::uint32_t bits) {
    // x * 2^bits is exact, so the error of the product is that of one subtraction, which is known exactly. It decides
    // ties.
    const Floats<W> scaled = x * static_cast<float>(1u << bits);
    const Floats<W> product = scaled - x, error = (scaled - product) - x;
    const Floats<W> rounded = round_small<W>(product), rest = product - rounded;
    const Floats<W> one = splat<W>(1.0f), zero = splat<W>(0.0f);
    const Floats<W> up = ((rest == 0.5f) & (error > 0.0f)) ? one : zero;
    const Floats<W> down = ((rest == -0.5f) & (error < 0.0f)) ? one : zero;
    return truncate<W>(rounded + up - down);
}

template <int W>
NACRE_INLINE Ints<W> encode_channel(const ChannelPlan& channel, Ints<W> value) {
    const auto x = (Floats<W>)value;
    switch (channel.coding) {
        case ChannelCoding::unorm: return scale_and_round<W>(clamp<W>(x, splat<W>(0.0f), splat<W>(1.0f)), channel.bits);
        case ChannelCoding::snorm: {
            const Floats<W> known = x == x ? x : splat<W>(0.0f);
            return scale_and_round<W>(clamp<W>(known, splat<W>(-1.0f), splat<W>(1.0f)), channel.bits - 1u);
        }
        case ChannelCoding::half: return floats_to_halves<W>(x);
        case ChannelCoding::small_float: {
            const Ints<W> code = floats_to_small<W>(x, channel.bits - 5, true);
            return x <= 0.0f ? splat<W>(0) : code;
        }
        default: return value;
    }
}

template <int W>
NACRE_INLINE void encode_words(const FormatPlan& plan, const Ints<W>* values, Ints<W>* words) {
    // Layouts that matter most, without choices for each channel.
    switch (plan.codec) {
        case Codec::word: words[0] = values[0]; return;
        case Codec::float4:
            for (int c = 0; c < 4; ++c) words[c] = values[c];
            return;
        case Codec::half4:
            for (int pair = 0; pair < 2; ++pair)
                words[pair] = floats_to_halves<W>((Floats<W>)values[2 * pair]) |
                              floats_to_halves<W>((Floats<W>)values[2 * pair + 1]) << 16;
            return;
        case Codec::rgba8: {
            const Floats<W> zero = splat<W>(0.0f), one = splat<W>(1.0f);
            const auto code = [&](int c) { return scale_and_round<W>(clamp<W>((Floats<W>)values[c], zero, one), 8); };
            const Ints<W> red = code(0), blue = code(2);
            words[0] = (plan.red_is_third ? blue : red) | code(1) << 8 | (plan.red_is_third ? red : blue) << 16 | code(3) << 24;
            return;
        }
        default: break;
    }
    for (int i = 0; i < plan.words; ++i) words[i] = splat<W>(0);
    for (int c = 0; c < plan.channel_count; ++c) {
        const ChannelPlan& channel = plan.channels[c];
        const Ints<W> code = encode_channel<W>(channel, values[c]);
        words[channel.word] |= field<W>(code, 0, channel.bits) << static_cast<int>(channel.shift);
    }
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
