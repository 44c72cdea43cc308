// SPDX-License-Identifier: Apache-2.0
// Texels of all lanes between memory and channels.
#pragma once

#include "backends/cpu/image_view.h"
#include "backends/cpu/images/block_cache.h"
#include "backends/cpu/images/format_plan.h"
#include "backends/cpu/images/kernels/lane_math.h"
#include "backends/cpu/images/texel_formats.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

/// One level of an image, as the kernels read it.
struct Source {
    const FormatPlan* plan;
    rhi::Format format;
    Codec codec;
    std::byte* base;
    std::int32_t width, height, depth;
    std::int32_t row_stride;
    std::uint64_t slice_stride;  ///< Between layers, or slices of a 3D image.
    std::uint64_t sample_stride;
    [[nodiscard]] NACRE_INLINE bool uses_offsets() const { return codec <= Codec::shared_exponent; }
};

/// Where one texel of each lane lies. Either `offset` counts, or the other three (see Source::uses_offsets). Always
/// inside of the level, also in lanes that are not live.
template <int W>
struct Place {
    Ints<W> offset;
    Ints<W> x, y, slice;
};

/// False where there are no texels, or none that can be read as color.
NACRE_INLINE bool make_source(const ImageView& image, std::uint32_t level_index, Source& source) {
    // Not by std::array's operators: functions of the standard library that were compiled here for one instruction set
    // could be linked into code for another.
    const ImageLevel& level = reinterpret_cast<const ImageLevel*>(&image.levels)[level_index];
    const FormatPlan& plan = format_plan(image.format);
    if (level.data == nullptr || level.width == 0 || level.height == 0 || level.depth == 0 || image.layer_count == 0 ||
        plan.codec == Codec::none) {
        return false;
    }
    const bool is_3d = image.dimension == rhi::ViewDimension::d3;
    source.plan = &plan;
    source.format = image.format;
    source.base = level.data;
    source.width = static_cast<std::int32_t>(level.width);
    source.height = static_cast<std::int32_t>(level.height);
    source.depth = static_cast<std::int32_t>(level.depth);
    source.row_stride = static_cast<std::int32_t>(level.row_stride);
    source.slice_stride = is_3d ? level.slice_stride : level.layer_stride;
    source.sample_stride = level.sample_stride;
    const std::uint64_t slices = is_3d ? level.depth : image.layer_count;
    const std::uint64_t span = (slices - 1) * source.slice_stride + (image.samples - 1) * level.sample_stride +
                               std::uint64_t{level.height} * level.row_stride;
    source.codec = plan.codec <= Codec::shared_exponent && span >= 0x7fffff00u ? Codec::far : plan.codec;
    return true;
}

template <int W>
NACRE_INLINE Place<W> place_texel(const Source& source, Ints<W> x, Ints<W> y, Ints<W> slice) {
    Place<W> place;
    if (source.uses_offsets()) {
        place.offset = x * static_cast<std::int32_t>(source.plan->texel_bytes) + y * source.row_stride +
                       slice * static_cast<std::int32_t>(source.slice_stride);
    } else {
        place.x = x, place.y = y, place.slice = slice;
    }
    return place;
}

/// The word at a place; for texels smaller than a word in its low bits, with other bits above.
template <int W>
NACRE_INLINE Ints<W> load_word(const Source& source, Ints<W> offset) {
    if (source.plan->texel_bytes >= 4) return gather_words<W>(source.base, offset);
    return gather_small_texels<W>(source.base, offset, source.plan->texel_bytes);
}

template <int W>
NACRE_INLINE Ints<W> field(Ints<W> word, std::uint32_t shift, std::uint32_t bits) {
    if (bits == 32) return word;
    return (Ints<W>)((Uints<W>)word >> shift) & static_cast<std::int32_t>((1u << bits) - 1);
}
template <int W>
NACRE_INLINE Ints<W> signed_field(Ints<W> word, std::uint32_t shift, std::uint32_t bits) {
    return (word << static_cast<int>(32 - shift - bits)) >> static_cast<int>(32 - bits);
}

/// A channel before the division by `most`.
template <int W>
NACRE_INLINE Floats<W> decode_channel(const ChannelPlan& channel, Ints<W> word) {
    switch (channel.coding) {
        case ChannelCoding::unorm: return to_floats<W>(field<W>(word, channel.shift, channel.bits));
        case ChannelCoding::snorm:
            return maximum<W>(to_floats<W>(signed_field<W>(word, channel.shift, channel.bits)),
                              splat<W>(-channel.most));
        case ChannelCoding::sint: return (Floats<W>)signed_field<W>(word, channel.shift, channel.bits);
        case ChannelCoding::half: return halves_to_floats<W>(field<W>(word, channel.shift, 16));
        case ChannelCoding::small_float:
            return halves_to_floats<W>(field<W>(word, channel.shift, channel.bits) << (15 - channel.bits));
        default: return (Floats<W>)field<W>(word, channel.shift, channel.bits);
    }
}

/// Linear values of the codes in the three lower bytes.
template <int W>
NACRE_INLINE void decode_srgb(Ints<W> word, Floats<W>* out) {
#ifdef __AVX512VBMI__
    look_up_three_bytes<W>(srgb_to_linear_bytes(), word, out);
#else
    const auto* table = reinterpret_cast<const std::byte*>(srgb_to_linear_table());
    for (unsigned c = 0; c < 3; ++c)
        out[c] = (Floats<W>)gather_words<W>(table, (Ints<W>)((Uints<W>)word >> (8 * c) << 2) & 1020);
#endif
}

/// Blocks have no form that all lanes could decode at once: each lane takes its texel from the cache of decoded blocks.
template <int W>
NACRE_INLINE const std::byte* block_address(const Source& source, const Place<W>& place, int lane) {
    return source.base + static_cast<std::uint64_t>(place.slice[lane]) * source.slice_stride +
           static_cast<std::uint64_t>(place.y[lane] >> 2) * static_cast<std::uint64_t>(source.row_stride) +
           static_cast<std::uint64_t>(place.x[lane] >> 2) * source.plan->texel_bytes;
}
template <int W>
[[gnu::noinline]] void load_block_words(const Source& source, const Place<W>& place, Ints<W>& words) {
    BlockCache& cache = BlockCache::of_this_thread();
    const std::byte* last = nullptr;
    const DecodedBlock* block = nullptr;
    for (int lane = 0; lane < W; ++lane) {
        // Neighboring lanes mostly read the same block.
        const std::byte* const address = block_address<W>(source, place, lane);
        if (address != last) block = &cache.find(source.format, address, source.plan->texel_bytes);
        last = address;
        words[lane] = static_cast<std::int32_t>(block->rgba8[(place.y[lane] & 3) * 4 + (place.x[lane] & 3)]);
    }
}
template <int W>
[[gnu::noinline]] void load_block_channels(const Source& source, const Place<W>& place, Floats<W>* channels) {
    BlockCache& cache = BlockCache::of_this_thread();
    const bool is_half = source.plan->channel_count == 3;
    const std::byte* last = nullptr;
    const DecodedBlock* block = nullptr;
    for (int lane = 0; lane < W; ++lane) {
        const std::byte* const address = block_address<W>(source, place, lane);
        if (address != last) block = &cache.find(source.format, address, source.plan->texel_bytes);
        last = address;
        const int texel = (place.y[lane] & 3) * 4 + (place.x[lane] & 3);
        for (int c = 0; c < source.plan->channel_count; ++c) {
            channels[c][lane] = is_half ? half_to_float(block->halves[texel][c]) : block->channels[c][texel];
        }
    }
}
template <int W>
[[gnu::noinline]] void load_far_texels(const Source& source, const Place<W>& place, Floats<W>* channels) {
    for (int lane = 0; lane < W; ++lane) {
        const std::byte* at =
            source.base + static_cast<std::uint64_t>(place.slice[lane]) * source.slice_stride +
            static_cast<std::uint64_t>(place.y[lane]) * static_cast<std::uint64_t>(source.row_stride) +
            static_cast<std::uint64_t>(place.x[lane]) * source.plan->texel_bytes;
        const Texel texel = decode_texel(source.format, at);
        for (int c = 0; c < 4; ++c) channels[c][lane] = texel.f[c];
    }
}

/// Channels that `load_raw` sets.
template <Codec C>
NACRE_INLINE int raw_channels(const FormatPlan& plan) {
    if constexpr (C == Codec::word)
        return 1;
    else if constexpr (C == Codec::half2)
        return 2;
    else if constexpr (C == Codec::general || C == Codec::block_channels)
        return plan.channel_count;
    else if constexpr (C == Codec::shared_exponent)
        return 3;
    else
        return 4;
}

/// Words of a texel that `decode_raw` takes; 0: the codec has other ways to its texels.
template <Codec C>
inline constexpr int raw_words = C == Codec::word || C == Codec::rgba8 || C == Codec::srgb8 || C == Codec::half2 ? 1
                                 : C == Codec::half4                                                             ? 2
                                 : C == Codec::float4                                                            ? 4
                                                                                                                 : 0;

/// Channels of texels whose words are known, `raw_scale` times too large.
template <int W, Codec C>
NACRE_INLINE void decode_raw(const Ints<W>* words, Floats<W>* out) {
    if constexpr (C == Codec::word) {
        out[0] = (Floats<W>)words[0];
    } else if constexpr (C == Codec::rgba8 || C == Codec::srgb8) {
        const Ints<W> word = words[0];
        if constexpr (C == Codec::srgb8) {
            decode_srgb<W>(word, out);
        } else {
            for (int c = 0; c < 3; ++c) out[c] = to_floats<W>((word >> (8 * c)) & 255);
        }
        out[3] = to_floats<W>((Ints<W>)((Uints<W>)word >> 24));
    } else if constexpr (C == Codec::half2 || C == Codec::half4) {
        for (int pair = 0; pair < raw_words<C>; ++pair) {
            out[2 * pair] = halves_to_floats<W>(words[pair] & 0xffff);
            out[2 * pair + 1] = halves_to_floats<W>((Ints<W>)((Uints<W>)words[pair] >> 16));
        }
    } else {
        static_assert(C == Codec::float4);
        for (int c = 0; c < 4; ++c) out[c] = (Floats<W>)words[c];
    }
}

/// The words of a texel for `decode_raw`.
template <int W, Codec C>
NACRE_INLINE void load_words(const Source& source, Ints<W> offset, Ints<W>* words) {
    if constexpr (raw_words<C> == 1) {
        words[0] = gather_words<W>(source.base, offset);
    } else {
        for (int i = 0; i < raw_words<C>; i += 2) gather_pairs<W>(source.base + 4 * i, offset, words[i], words[i + 1]);
    }
}

/// Channels that are `raw_scale` times too large.
template <int W, Codec C>
NACRE_INLINE void load_raw(const Source& source, const Place<W>& place, Floats<W>* out) {
    if constexpr (raw_words<C> != 0) {
        Ints<W> words[raw_words<C>];
        load_words<W, C>(source, place.offset, words);
        decode_raw<W, C>(words, out);
    } else if constexpr (C == Codec::block_rgba8 || C == Codec::block_srgb8) {
        Ints<W> word;
        load_block_words<W>(source, place, word);
        decode_raw<W, C == Codec::block_srgb8 ? Codec::srgb8 : Codec::rgba8>(&word, out);
    } else if constexpr (C == Codec::general) {
        const FormatPlan& plan = *source.plan;
        Ints<W> words[4];
        words[0] = load_word<W>(source, place.offset);
        for (int i = 1; i < plan.words; ++i) words[i] = gather_words<W>(source.base, place.offset + 4 * i);
        for (int c = 0; c < plan.channel_count; ++c)
            out[c] = decode_channel<W>(plan.channels[c], words[plan.channels[c].word]);
    } else if constexpr (C == Codec::shared_exponent) {
        const Ints<W> word = gather_words<W>(source.base, place.offset);
        // 2^(exponent - 24) as bits; the exponent is 0 to 31.
        const auto scale = (Floats<W>)((field<W>(word, 27, 5) + (127 - 24)) << 23);
        for (int c = 0; c < 3; ++c) out[c] = to_floats<W>(field<W>(word, static_cast<std::uint32_t>(9 * c), 9)) * scale;
    } else if constexpr (C == Codec::block_channels) {
        load_block_channels<W>(source, place, out);
    } else if constexpr (C == Codec::far) {
        load_far_texels<W>(source, place, out);
    }
}

/// Two texels of each lane. `are_neighbors`: the second lies behind the first in all lanes, as it mostly does in a
/// footprint, and both are read at once.
template <int W, Codec C>
NACRE_INLINE void load_two_raw(const Source& source, const Place<W>& first, const Place<W>& second, bool are_neighbors,
                               Floats<W> (&out)[2][4]) {
    if constexpr (raw_words<C> == 1) {
        Ints<W> words[2];
        if (are_neighbors) {
            gather_pairs<W>(source.base, first.offset, words[0], words[1]);
        } else {
            words[0] = gather_words<W>(source.base, first.offset);
            words[1] = gather_words<W>(source.base, second.offset);
        }
        decode_raw<W, C>(&words[0], out[0]);
        decode_raw<W, C>(&words[1], out[1]);
    } else if constexpr (raw_words<C> == 2) {
        Ints<W> words[4];
        if (are_neighbors) {
            gather_quads<W>(source.base, first.offset, words);
        } else {
            gather_pairs<W>(source.base, first.offset, words[0], words[1]);
            gather_pairs<W>(source.base, second.offset, words[2], words[3]);
        }
        decode_raw<W, C>(&words[0], out[0]);
        decode_raw<W, C>(&words[2], out[1]);
    } else {
        load_raw<W, C>(source, first, out[0]);
        load_raw<W, C>(source, second, out[1]);
    }
}

#ifdef __AVX512F__
/// The texels of footprints of two by two that begin at (x, y), where those of all lanes lie within four by three
/// texels of one slice, as they do where an image is magnified: these are loaded and converted once, and lanes take
/// theirs by permutations. False: they do not, and nothing was done. The footprints lie inside of the level.
/// @param texels  left and right of the upper row, then of the lower one
NACRE_INLINE bool load_near_footprints(const Source& source, Ints<16> x, Ints<16> y, Ints<16> slice,
                                       Floats<16> (&texels)[4][4]) {
    constexpr std::int32_t window_width = 4;
    if (source.width < window_width) return false;
    // The window begins where the lane before the first one does that lies farthest from it, inside of the level.
    const std::int32_t first_x = x[0], first_y = y[0], first_slice = slice[0];
    const auto any = [](Ints<16> lanes) { return mask_bits<16>(lanes) != 0 ? 1 : 0; };
    const std::int32_t leftmost = first_x - any(x < first_x) - any(x < first_x - 1), top = first_y - any(y < first_y);
    const std::int32_t left = leftmost < source.width - window_width ? leftmost : source.width - window_width;
    const Ints<16> column = x - left, row = y - top;
    if (any(((Uints<16>)column > 2u) | ((Uints<16>)row > 1u) | (slice != first_slice)) != 0) return false;
    const std::byte* const begin = source.base + static_cast<std::uint64_t>(first_slice) * source.slice_stride +
                                   static_cast<std::ptrdiff_t>(left) * 8;
    // Nobody takes anything from a row behind the last.
    const auto load = [&](std::int32_t number) {
        const std::int32_t row_loaded = number < source.height ? number : source.height - 1;
        const std::byte* const from = begin + static_cast<std::ptrdiff_t>(row_loaded) * source.row_stride;
        return _mm512_maskz_cvtph_ps(0xffff, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)));
    };
    const __m512 rows[3] = {load(top), load(top + 1), load(top + 2)};
    const Ints<16> place = column * 4 + row * 16;
    for (int right = 0; right < 2; ++right)
        for (int c = 0; c < 4; ++c) {
            const auto at = (__m512i)(place + (4 * right + c));
            texels[right][c] = (Floats<16>)_mm512_permutex2var_ps(rows[0], at, rows[1]);
            texels[2 + right][c] = (Floats<16>)_mm512_permutex2var_ps(rows[1], at, rows[2]);
        }
    return true;
}
#endif

template <Codec C>
NACRE_INLINE float raw_scale(const FormatPlan& plan, int c) {
    if constexpr (C == Codec::rgba8 || C == Codec::block_rgba8)
        return 255.0f;
    else if constexpr (C == Codec::srgb8 || C == Codec::block_srgb8)
        return c == 3 ? 255.0f : 1.0f;
    else if constexpr (C == Codec::general)
        return plan.channels[c].most;
    else
        return 1.0f;
}

/// Divides by the scale and adds the channels that the format lacks. Values of texels come out as `decode_texel` gives
/// them.
template <int W, Codec C>
NACRE_INLINE void finish_raw(const FormatPlan& plan, Floats<W>* channels) {
    const int count = raw_channels<C>(plan);
    for (int c = 0; c < count; ++c) {
        const float scale = raw_scale<C>(plan, c);
        if (scale != 1.0f) channels[c] = quotient<W>(channels[c], scale);
    }
    if constexpr (C == Codec::rgba8 || C == Codec::srgb8) {
        if (plan.red_is_third) {
            const Floats<W> third = channels[0];
            channels[0] = channels[2];
            channels[2] = third;
        }
    }
    if (count == 4) return;
    for (int c = count; c < 3; ++c) channels[c] = splat<W>(0.0f);
    channels[3] = plan.is_integer ? (Floats<W>)splat<W>(1) : splat<W>(1.0f);
}

template <int W, Codec C>
[[gnu::noinline]] void load_by_codec(const Source& source, const Place<W>& place, Floats<W>* out) {
    load_raw<W, C>(source, place, out);
    finish_raw<W, C>(*source.plan, out);
}

/// Calls `visit.template operator()<C>()` for the codec of a source.
template <typename Visit>
NACRE_INLINE void visit_codec(Codec codec, Visit visit) {
    switch (codec) {
        case Codec::word: visit.template operator()<Codec::word>(); break;
        case Codec::rgba8: visit.template operator()<Codec::rgba8>(); break;
        case Codec::srgb8: visit.template operator()<Codec::srgb8>(); break;
        case Codec::half2: visit.template operator()<Codec::half2>(); break;
        case Codec::half4: visit.template operator()<Codec::half4>(); break;
        case Codec::float4: visit.template operator()<Codec::float4>(); break;
        case Codec::general: visit.template operator()<Codec::general>(); break;
        case Codec::shared_exponent: visit.template operator()<Codec::shared_exponent>(); break;
        case Codec::block_rgba8: visit.template operator()<Codec::block_rgba8>(); break;
        case Codec::block_srgb8: visit.template operator()<Codec::block_srgb8>(); break;
        case Codec::block_channels: visit.template operator()<Codec::block_channels>(); break;
        case Codec::far: visit.template operator()<Codec::far>(); break;
        case Codec::none: break;
    }
}

/// One texel for each lane, as floats or as the bits of integers.
template <int W>
NACRE_INLINE void load_texels(const Source& source, const Place<W>& place, Floats<W>* out) {
    visit_codec(source.codec, [&]<Codec C>() { load_by_codec<W, C>(source, place, out); });
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
