// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/texel_lanes.h"
#include "backends/cpu/raster/tile_data.h"

/// @file
/// Colors of sixteen lanes into the targets: blending, write masks, packing. Internal linkage, as in simd.h.

namespace nacre::cpu::raster {
namespace {

/// Where the four quads of a batch lie in a target.
struct QuadRows {
    std::byte* top[4];  ///< Texel 0; texel 2 lies one row below.
};

NACRE_LANES_INLINE void store_quad(std::byte* top, std::uint32_t row_stride, std::uint32_t texel_bytes, std::uint32_t live,
                                   const std::uint32_t (*words)[16], std::uint32_t lane) {
    for (std::uint32_t row = 0; row < 2; ++row) {
        std::byte* const texel = top + row * static_cast<std::size_t>(row_stride);
        const std::uint32_t first = lane + 2 * row;
        const std::uint32_t pair = live >> (2 * row) & 3;
        switch (texel_bytes) {
            case 1:
                for (std::uint32_t i = 0; i < 2; ++i)
                    if (pair >> i & 1) std::memcpy(texel + i, &words[0][first + i], 1);
                break;
            case 2:
                for (std::uint32_t i = 0; i < 2; ++i)
                    if (pair >> i & 1) std::memcpy(texel + 2 * i, &words[0][first + i], 2);
                break;
            case 4:
                if (pair == 3) {
                    std::memcpy(texel, &words[0][first], 8);
                } else {
                    for (std::uint32_t i = 0; i < 2; ++i)
                        if (pair >> i & 1) std::memcpy(texel + 4 * i, &words[0][first + i], 4);
                }
                break;
            default:
                for (std::uint32_t i = 0; i < 2; ++i)
                    if (pair >> i & 1)
                        for (std::uint32_t word = 0; word < texel_bytes / 4; ++word)
                            std::memcpy(texel + i * texel_bytes + 4 * word, &words[word][first + i], 4);
                break;
        }
    }
}

inline void load_quad(const std::byte* top, std::uint32_t row_stride, std::uint32_t texel_bytes, std::uint32_t live,
                      std::uint32_t (*words)[16], std::uint32_t lane) {
    for (std::uint32_t i = 0; i < 4; ++i) {
        if ((live >> i & 1) == 0) continue;
        const std::byte* const texel = top + (i >> 1) * static_cast<std::size_t>(row_stride) + (i & 1) * texel_bytes;
        if (texel_bytes < 4) {
            std::uint32_t value = 0;
            std::memcpy(&value, texel, texel_bytes);
            words[0][lane + i] = value;
        } else {
            for (std::uint32_t word = 0; word < texel_bytes / 4; ++word)
                std::memcpy(&words[word][lane + i], texel + 4 * word, 4);
        }
    }
}

/// Texels of 32 bits of a batch whose quads lie inside of the target. Pixels that do not count are written back as they were: no
/// other thread touches the tile, and a branch for each of them would cost more.
/// @param keep  all bits in lanes that do not count
inline void store_words(const QuadRows& rows, std::uint32_t row_stride, std::uint32_t quads, const std::uint32_t* words,
                        const std::uint32_t* keep) {
    for (std::uint32_t quad = 0; quad < quads; ++quad)
        for (std::uint32_t row = 0; row < 2; ++row) {
            std::byte* const texels = rows.top[quad] + row * static_cast<std::size_t>(row_stride);
            std::uint64_t old, fresh, kept;
            std::memcpy(&old, texels, 8);
            std::memcpy(&fresh, words + 4 * quad + 2 * row, 8);
            std::memcpy(&kept, keep + 4 * quad + 2 * row, 8);
            fresh ^= (fresh ^ old) & kept;
            std::memcpy(texels, &fresh, 8);
        }
}
/// The same for a whole block of 4x4 pixels.
inline void store_block_words(std::byte* texels, std::uint32_t row_stride, const std::uint32_t* words) {
    for (std::uint32_t row = 0; row < 4; ++row) {
        const std::uint32_t* const from = words + 8 * (row / 2) + 2 * (row & 1);
        std::uint64_t left, right;
        std::memcpy(&left, from, 8), std::memcpy(&right, from + 4, 8);
        std::memcpy(texels, &left, 8), std::memcpy(texels + 8, &right, 8);
        texels += row_stride;
    }
}

/// What blend factors are made of.
struct BlendInputs {
    Floats source[4], source1[4], destination[4], constant[4];
};

inline Floats blend_factor(rhi::BlendFactor factor, const BlendInputs& inputs, int channel) {
    using enum rhi::BlendFactor;
    const Floats one_lanes = floats(1.0f);
    switch (factor) {
        case zero: return floats(0.0f);
        case one: return one_lanes;
        case source_color: return inputs.source[channel];
        case one_minus_source_color: return one_lanes - inputs.source[channel];
        case source_alpha: return inputs.source[3];
        case one_minus_source_alpha: return one_lanes - inputs.source[3];
        case destination_color: return inputs.destination[channel];
        case one_minus_destination_color: return one_lanes - inputs.destination[channel];
        case destination_alpha: return inputs.destination[3];
        case one_minus_destination_alpha: return one_lanes - inputs.destination[3];
        case constant_color: return inputs.constant[channel];
        case one_minus_constant_color: return one_lanes - inputs.constant[channel];
        case source_alpha_saturated:
            return channel == 3 ? one_lanes : minimum(inputs.source[3], one_lanes - inputs.destination[3]);
        case source1_color: return inputs.source1[channel];
        case one_minus_source1_color: return one_lanes - inputs.source1[channel];
        case source1_alpha: return inputs.source1[3];
        default: return one_lanes - inputs.source1[3];
    }
}

inline Floats blend_channel(rhi::BlendOperation operation, rhi::BlendFactor source_factor,
                            rhi::BlendFactor destination_factor, const BlendInputs& inputs, int channel) {
    const Floats& source = inputs.source[channel];
    const Floats& destination = inputs.destination[channel];
    if (operation == rhi::BlendOperation::minimum) return minimum(source, destination);
    if (operation == rhi::BlendOperation::maximum) return maximum(source, destination);
    // A factor of zero leaves nothing behind, even of an infinity in a target that was never cleared.
    const bool no_source = source_factor == rhi::BlendFactor::zero;
    const bool no_destination = destination_factor == rhi::BlendFactor::zero;
    const Floats from_source = no_source ? floats(0.0f) : source * blend_factor(source_factor, inputs, channel);
    const Floats from_destination =
        no_destination ? floats(0.0f) : destination * blend_factor(destination_factor, inputs, channel);
    switch (operation) {
        case rhi::BlendOperation::subtract: return from_source - from_destination;
        case rhi::BlendOperation::reverse_subtract: return from_destination - from_source;
        default: return from_source + from_destination;
    }
}

/// Fixed-point targets see values, factors and constants in their own range (Vulkan specification, "Blending").
NACRE_LANES_INLINE Floats in_target_range(rhi::FormatKind kind, const Floats& value) {
    if (kind == rhi::FormatKind::unorm || kind == rhi::FormatKind::srgb) return clamp(value, 0.0f, 1.0f);
    if (kind == rhi::FormatKind::snorm) return clamp(value, -1.0f, 1.0f);
    return value;
}

inline void load_channels(const FragmentBatch& batch, std::uint32_t output, std::uint32_t components, Ints (&channels)[4]) {
    for (std::uint32_t i = 0; i < 4; ++i)
        channels[i] = i < components ? load(batch.colors[output][i]) : ints(i == 3 ? 0x3f800000 : 0);
}

/// Packs the colors of `plan` for lanes where the target's own texels do not matter.
inline void pack_colors(const ColorPlan& plan, const ColorTarget& target, const SrgbTables& srgb, const FragmentBatch& batch,
                        std::uint32_t (&words)[4][16]) {
    Ints channels[4], packed[4];
    load_channels(batch, plan.output, plan.components, channels);
    encode_texels(target.format, srgb, channels, packed);
    const std::uint32_t count = target.texel_bytes < 4 ? 1 : target.texel_bytes / 4;
    for (std::uint32_t i = 0; i < count; ++i) store(words[i], packed[i]);
}

/// Colors of `plan` for the lanes in `live`, over what the target holds: read, blended, masked. No two lanes are the same pixel.
inline void blend_colors(const DrawPlan& draw, const ColorPlan& plan, const ColorTarget& target, const SrgbTables& srgb,
                         const FragmentBatch& batch, const QuadRows& rows, std::uint32_t live,
                         std::uint32_t (&words)[4][16]) {
    const std::uint32_t count = target.texel_bytes < 4 ? 1 : target.texel_bytes / 4;
    alignas(64) std::uint32_t old[4][16] = {};
    for (std::uint32_t quad = 0; quad < 4; ++quad)
        if (const std::uint32_t lanes = live >> (4 * quad) & 15)
            load_quad(rows.top[quad], target.row_stride, target.texel_bytes, lanes, old, 4 * quad);
    Ints old_words[4], channels[4], packed[4];
    for (std::uint32_t i = 0; i < 4; ++i) old_words[i] = load(old[i]);
    load_channels(batch, plan.output, plan.components, channels);
    if (plan.blends) {
        const rhi::FormatKind kind = texel_layout(target.format).kind;
        BlendInputs inputs;
        decode_texels(target.format, srgb, old_words, inputs.destination);
        Ints second[4] = {channels[0], channels[1], channels[2], channels[3]};
        if (draw.dual_source) load_channels(batch, dual_source_output, 4, second);
        for (int i = 0; i < 4; ++i) {
            inputs.source[i] = in_target_range(kind, floats_of_bits(channels[i]));
            inputs.source1[i] = in_target_range(kind, floats_of_bits(second[i]));
            inputs.constant[i] = in_target_range(kind, floats(draw.blend_constants[i]));
        }
        const rhi::BlendState& blend = plan.blend;
        for (int i = 0; i < 3; ++i)
            channels[i] = bits_of(
                blend_channel(blend.color_operation, blend.source_color, blend.destination_color, inputs, i));
        channels[3] =
            bits_of(blend_channel(blend.alpha_operation, blend.source_alpha, blend.destination_alpha, inputs, 3));
    }
    encode_texels(target.format, srgb, channels, packed);
    for (std::uint32_t i = 0; i < count; ++i) {
        const Ints written = ints(static_cast<std::int32_t>(plan.word_masks[i]));
        store(words[i], (packed[i] & written) | (old_words[i] & ~written));
    }
}

}  // namespace
}  // namespace nacre::cpu::raster
