// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/texel_lanes.h"
#include "backends/cpu/raster/tile_data.h"

/// @file
/// Colors of sixteen lanes as texels: blending, write masks, packing. Internal linkage, as in simd.h.

namespace nacre::cpu::raster {
namespace {

/// Writes pixels of a quad; those that do not count are written back as they were: no other thread touches the tile, and
/// a branch for each of them would cost more.
/// @param keep  all bits in pixels that do not count
NACRE_LANES_INLINE void store_quad(std::uint32_t* to, const std::uint32_t* from, Int4 keep) {
    const Int4 old = load4(to), fresh = load4(from);
    store4(to, fresh ^ ((fresh ^ old) & keep));
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

inline void load_channels(const FragmentBatch& batch, std::uint32_t output, std::uint32_t components,
                          Ints (&channels)[4]) {
    for (std::uint32_t i = 0; i < 4; ++i)
        channels[i] = i < components ? load(batch.colors[output][i]) : ints(i == 3 ? 0x3f800000 : 0);
}

/// Packs the colors of `plan` for lanes where the target's own texels do not matter.
inline void pack_colors(const ColorPlan& plan, const ColorTarget& target, const SrgbTables& srgb,
                        const FragmentBatch& batch, std::uint32_t (&words)[4][16]) {
    Ints channels[4], packed[4];
    load_channels(batch, plan.output, plan.components, channels);
    encode_texels(target.format, srgb, channels, packed);
    for (std::uint32_t i = 0; i < target.words; ++i) store(words[i], packed[i]);
}

/// Colors of `plan` over `old`, what the target holds: blended, masked.
inline void blend_colors(const DrawPlan& draw, const ColorPlan& plan, const ColorTarget& target, const SrgbTables& srgb,
                         const FragmentBatch& batch, const std::uint32_t (&old)[4][16],
                         std::uint32_t (&words)[4][16]) {
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
            channels[i] =
                bits_of(blend_channel(blend.color_operation, blend.source_color, blend.destination_color, inputs, i));
        channels[3] =
            bits_of(blend_channel(blend.alpha_operation, blend.source_alpha, blend.destination_alpha, inputs, 3));
    }
    encode_texels(target.format, srgb, channels, packed);
    for (std::uint32_t i = 0; i < target.words; ++i) {
        const Ints written = ints(static_cast<std::int32_t>(plan.word_masks[i]));
        store(words[i], (packed[i] & written) | (old_words[i] & ~written));
    }
}

}  // namespace
}  // namespace nacre::cpu::raster
