// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/format_plan.h"

#include <array>

namespace nacre::cpu {
namespace {

using rhi::Format;
using rhi::FormatKind;

ChannelPlan channel(std::uint32_t bit, std::uint32_t bits, ChannelCoding coding) {
    ChannelPlan plan{.word = static_cast<std::uint8_t>(bit / 32),
                     .shift = static_cast<std::uint8_t>(bit % 32),
                     .bits = static_cast<std::uint8_t>(bits),
                     .coding = coding};
    if (coding == ChannelCoding::unorm) plan.most = static_cast<float>((std::uint64_t{1} << bits) - 1);
    if (coding == ChannelCoding::snorm) plan.most = static_cast<float>((std::uint64_t{1} << (bits - 1)) - 1);
    return plan;
}

ChannelCoding coding_of(FormatKind kind, std::uint32_t bits) {
    switch (kind) {
        case FormatKind::unorm: return ChannelCoding::unorm;
        case FormatKind::snorm: return ChannelCoding::snorm;
        case FormatKind::uint: return ChannelCoding::uint;
        case FormatKind::sint: return ChannelCoding::sint;
        case FormatKind::srgb: return ChannelCoding::srgb;
        case FormatKind::floating: break;
    }
    return bits == 32 ? ChannelCoding::single : ChannelCoding::half;
}

FormatPlan make_plan(Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    FormatPlan plan;
    if (facts.channels == 0) return plan;
    plan.texel_bytes = facts.block_bytes;
    plan.channel_count = facts.channels;
    plan.is_integer = facts.is_integer();
    plan.words = static_cast<std::uint8_t>((facts.block_bytes + 3) / 4);
    if (facts.is_compressed()) {
        switch (format) {
            case Format::bc4_r_unorm:
            case Format::bc4_r_snorm:
            case Format::bc5_rg_unorm:
            case Format::bc5_rg_snorm:
            case Format::bc6h_rgb_ufloat:
            case Format::bc6h_rgb_sfloat: plan.codec = Codec::block_channels; break;
            default: plan.codec = facts.kind == FormatKind::srgb ? Codec::block_srgb8 : Codec::block_rgba8; break;
        }
        return plan;
    }
    plan.codec = Codec::general;
    switch (format) {
        case Format::d16_unorm:
            plan.channels[0] = channel(0, 16, ChannelCoding::unorm);
            plan.is_fixed_point_depth = true;
            return plan;
        case Format::d24_unorm_s8_uint:
            plan.channels[0] = channel(0, 24, ChannelCoding::unorm);
            plan.channel_count = 1;
            plan.texel_bytes = 4, plan.words = 1;
            plan.is_fixed_point_depth = true;
            return plan;
        case Format::d32_float:
        case Format::d32_float_s8_uint:
            plan.codec = Codec::word;
            plan.channels[0] = channel(0, 32, ChannelCoding::single);
            plan.channel_count = 1;
            plan.texel_bytes = 4, plan.words = 1;
            return plan;
        case Format::rgb10a2_unorm:
        case Format::rgb10a2_uint:
            for (std::uint32_t c = 0; c < 3; ++c) plan.channels[c] = channel(10 * c, 10, coding_of(facts.kind, 10));
            plan.channels[3] = channel(30, 2, coding_of(facts.kind, 2));
            plan.can_store = true;
            return plan;
        case Format::rg11b10_float:
            for (std::uint32_t c = 0; c < 3; ++c)
                plan.channels[c] = channel(11 * c, c < 2 ? 11 : 10, ChannelCoding::small_float);
            plan.can_store = true;
            return plan;
        case Format::rgb9e5_float: plan.codec = Codec::shared_exponent; return plan;
        default: break;
    }
    const std::uint32_t bits = 8u * facts.block_bytes / facts.channels;
    plan.red_is_third = format == Format::bgra8_unorm || format == Format::bgra8_srgb;
    for (std::uint32_t c = 0; c < facts.channels; ++c) {
        const std::uint32_t place = plan.red_is_third && c < 3 ? 2 - c : c;
        ChannelCoding coding = coding_of(facts.kind, bits);
        if (coding == ChannelCoding::srgb && c == 3) coding = ChannelCoding::unorm;
        plan.channels[c] = channel(place * bits, bits, coding);
    }
    plan.can_store = facts.kind != FormatKind::srgb;
    if (facts.channels == 1 && bits == 32) plan.codec = Codec::word;
    if (facts.channels == 4 && bits == 32) plan.codec = Codec::float4;
    if (format == Format::rgba16_float) plan.codec = Codec::half4;
    if (format == Format::rg16_float) plan.codec = Codec::half2;
    if (format == Format::rgba8_unorm || format == Format::bgra8_unorm) plan.codec = Codec::rgba8;
    if (format == Format::rgba8_srgb || format == Format::bgra8_srgb) plan.codec = Codec::srgb8;
    return plan;
}

// Made at start, so that kernels read it without a check.
const std::array<FormatPlan, rhi::format_count> plans = [] {
    std::array<FormatPlan, rhi::format_count> all;
    for (std::uint32_t i = 0; i < rhi::format_count; ++i) all[i] = make_plan(static_cast<Format>(i));
    return all;
}();

}  // namespace

const FormatPlan* const format_plans = plans.data();

}  // namespace nacre::cpu
