// SPDX-License-Identifier: Apache-2.0
// Reads and writes of single texels at integer coordinates: fetch, load, store.
#pragma once

#include "backends/cpu/images/kernels/invocation.h"
#include "backends/cpu/images/kernels/texel_encoding.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

template <int W>
struct TexelCoordinates {
    Ints<W> x, y, slice, sample;
    Ints<W> is_inside;
    bool has_sample;
};

template <int W>
NACRE_INLINE TexelCoordinates<W> texel_coordinates(const Invocation& call, const Source& source) {
    const Axes axes = axes_of(call.image->dimension);
    const auto& coordinates = call.arguments->coordinates;
    TexelCoordinates<W> at;
    at.y = splat<W>(0), at.slice = splat<W>(0), at.sample = splat<W>(0);
    const auto below = [](Ints<W> value, std::uint32_t limit) { return (Ints<W>)((Uints<W>)value < limit); };
    // Unsigned sums wrap, and what wrapped is outside.
    const auto moved = [&](Ints<W> value, int axis) {
        if (!call.has(image_offset)) return value;
        return (Ints<W>)((Uints<W>)value + (Uints<W>)call.ints<W>(call.arguments->offset[axis]));
    };
    at.x = moved(call.ints<W>(coordinates[0]), 0);
    at.is_inside = below(at.x, static_cast<std::uint32_t>(source.width));
    if (axes.spatial > 1) {
        at.y = moved(call.ints<W>(coordinates[1]), 1);
        at.is_inside &= below(at.y, static_cast<std::uint32_t>(source.height));
    }
    // Cubes have the face (and 6 times the layer) where 3D images have z and arrays their layer.
    if (axes.spatial == 3 && !axes.is_cube) {
        at.slice = moved(call.ints<W>(coordinates[2]), 2);
        at.is_inside &= below(at.slice, static_cast<std::uint32_t>(source.depth));
    } else if (axes.is_cube || axes.has_layers) {
        at.slice = call.ints<W>(coordinates[axes.spatial == 1 ? 1 : 2]);
        at.is_inside &= below(at.slice, call.image->layer_count);
    }
    at.has_sample = call.image->samples > 1;
    if (at.has_sample) {
        at.sample = call.ints<W>(call.arguments->sample);
        at.is_inside &= below(at.sample, call.image->samples);
    }
    at.x &= at.is_inside, at.y &= at.is_inside, at.slice &= at.is_inside, at.sample &= at.is_inside;
    return at;
}

/// Texels of one level for all lanes; zero outside.
template <int W>
NACRE_INLINE void read_level(const Invocation& call, std::uint32_t level, Floats<W>* out) {
    Source source;
    if (!make_source(*call.image, level, source)) {
        for (int c = 0; c < 4; ++c) out[c] = splat<W>(0.0f);
        return;
    }
    const TexelCoordinates<W> at = texel_coordinates<W>(call, source);
    Place<W> place = place_texel<W>(source, at.x, at.y, at.slice);
    if (at.has_sample) {
        if (source.uses_offsets()) {
            place.offset += at.sample * static_cast<std::int32_t>(source.sample_stride);
        } else {
            // Samples beyond the reach of offsets: one sample after the other, each as an image of its own.
            for (int c = 0; c < 4; ++c) out[c] = splat<W>(0.0f);
            std::byte* const base = source.base;
            for (std::uint32_t s = 0; s < call.image->samples; ++s) {
                const Ints<W> here = (at.sample == static_cast<std::int32_t>(s)) & at.is_inside;
                if (mask_bits<W>(here) == 0) continue;
                source.base = base + s * source.sample_stride;
                Floats<W> texels[4];
                load_texels<W>(source, place, texels);
                for (int c = 0; c < 4; ++c) out[c] = here ? texels[c] : out[c];
            }
            return;
        }
    }
    if (source.codec == Codec::word) {
        // Compute passes read rows of texels; a plain load costs a small part of a gather.
        const std::int32_t first = place.offset[0];
        Ints<W> word;
        if (mask_bits<W>((place.offset - first == lane_numbers<W>() * 4) & at.is_inside) == all_lanes<W>) {
            word = load_ints<W>(source.base + first);
        } else {
            word = gather_words<W>(source.base, place.offset) & at.is_inside;
        }
        out[0] = (Floats<W>)word;
        out[1] = out[2] = splat<W>(0.0f);
        out[3] = (Floats<W>)((source.plan->is_integer ? splat<W>(1) : (Ints<W>)splat<W>(1.0f)) & at.is_inside);
        return;
    }
    load_texels<W>(source, place, out);
    for (int c = 0; c < 4; ++c) out[c] = (Floats<W>)((Ints<W>)out[c] & at.is_inside);
}

template <int W>
[[gnu::noinline]] void read_texels(const Invocation& call, bool is_fetch) {
    const ImageView& image = *call.image;
    const Ints<W> live = mask_of_bits<W>(call.live);
    if (format_plan(image.format).is_integer != call.has(image_integer)) return write_zeros<W>(call);
    Floats<W> out[4];
    if (!is_fetch || image.samples > 1) {
        if (image.mip_count == 0) return write_zeros<W>(call);
        read_level<W>(call, 0, out);
        return write_result<W>(call, out, live);
    }
    const Ints<W> levels = call.ints<W>(call.arguments->lod);
    std::uint32_t pending = call.live & mask_bits<W>((Ints<W>)((Uints<W>)levels < image.mip_count));
    if (pending == 0) return write_zeros<W>(call);
    const std::int32_t level = levels[first_bit(pending)];
    Ints<W> here = levels == level;
    if ((mask_bits<W>(here) & call.live) == call.live) {
        read_level<W>(call, static_cast<std::uint32_t>(level), out);
        return write_result<W>(call, out, live);
    }
    Floats<W> all[4] = {};
    while (pending != 0) {
        const std::int32_t next = levels[first_bit(pending)];
        here = levels == next;
        read_level<W>(call, static_cast<std::uint32_t>(next), out);
        for (int c = 0; c < 4; ++c) all[c] = here ? out[c] : all[c];
        pending &= ~mask_bits<W>(here);
    }
    write_result<W>(call, all, live);
}

/// Writes texels of N words in the lanes of `stored`, in the order of the lanes. Where eight lanes' texels (or all, if there
/// are fewer) lie side by side they are written at once.
template <int W, int N>
NACRE_INLINE void write_texels(std::byte* base, Ints<W> offset, const Ints<W>* words, std::uint32_t stored) {
    Ints<W> texels[N];
    if constexpr (N == 1) {
        texels[0] = words[0];
    } else if constexpr (N == 2) {
        join_pairs<W>(words[0], words[1], texels[0], texels[1]);
    } else {
        Ints<W> even[2], odd[2];
        join_pairs<W>(words[0], words[2], even[0], even[1]);
        join_pairs<W>(words[1], words[3], odd[0], odd[1]);
        join_pairs<W>(even[0], odd[0], texels[0], texels[1]);
        join_pairs<W>(even[1], odd[1], texels[2], texels[3]);
    }
    alignas(64) std::byte packed[sizeof texels];
    __builtin_memcpy(packed, texels, sizeof texels);
    constexpr int run = W < 8 ? W : 8;
    for (int first = 0; first < W; first += run) {
        const std::uint32_t lanes = ((1u << run) - 1) << first;
        const Ints<W> behind = offset - offset[first] - (lane_numbers<W>() - first) * (4 * N);
        if ((stored & lanes) == lanes && (mask_bits<W>(behind == 0) & lanes) == lanes) {
            __builtin_memcpy(base + offset[first], packed + first * 4 * N, run * 4 * N);
            continue;
        }
        for (std::uint32_t rest = stored & lanes; rest != 0; rest &= rest - 1) {
            const int lane = first_bit(rest);
            __builtin_memcpy(base + offset[lane], packed + lane * 4 * N, 4 * N);
        }
    }
}

template <int W>
[[gnu::noinline]] void store_texels(const Invocation& call) {
    Source source;
    if (call.image->mip_count == 0 || !make_source(*call.image, 0, source)) return;
    const FormatPlan& plan = *source.plan;
    if (plan.is_integer != call.has(image_integer) || plan.codec > Codec::shared_exponent) return;
    const TexelCoordinates<W> at = texel_coordinates<W>(call, source);
    const std::uint32_t stored = mask_bits<W>(at.is_inside) & call.live;
    if (stored == 0) return;
    Ints<W> values[4];
    for (int c = 0; c < 4; ++c) values[c] = call.ints<W>(call.arguments->texel[c]);
    Ints<W> words[4];
    if (plan.can_store) encode_words<W>(plan, values, words);
    if (plan.can_store && source.uses_offsets() && !at.has_sample && plan.texel_bytes >= 4) {
        const Ints<W> offset = place_texel<W>(source, at.x, at.y, at.slice).offset;
        if (plan.words == 1) return write_texels<W, 1>(source.base, offset, words, stored);
        if (plan.words == 2) return write_texels<W, 2>(source.base, offset, words, stored);
        if (plan.words == 4) return write_texels<W, 4>(source.base, offset, words, stored);
    }
    for (std::uint32_t rest = stored; rest != 0; rest &= rest - 1) {
        const int lane = first_bit(rest);
        std::byte* to = source.base + static_cast<std::uint64_t>(at.slice[lane]) * source.slice_stride +
                        static_cast<std::uint64_t>(at.sample[lane]) * source.sample_stride +
                        static_cast<std::uint64_t>(at.y[lane]) * static_cast<std::uint64_t>(source.row_stride) +
                        static_cast<std::uint64_t>(at.x[lane]) * plan.texel_bytes;
        if (!plan.can_store) {
            Texel texel;
            for (int c = 0; c < 4; ++c) texel.i[c] = values[c][lane];
            encode_texel(source.format, texel, to);
        } else if (plan.texel_bytes >= 4) {
            for (int i = 0; i < plan.words; ++i) {
                const std::int32_t word = words[i][lane];
                __builtin_memcpy(to + 4 * i, &word, 4);
            }
        } else {
            const std::int32_t word = words[0][lane];
            if (plan.texel_bytes == 2)
                __builtin_memcpy(to, &word, 2);
            else
                __builtin_memcpy(to, &word, 1);
        }
    }
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
