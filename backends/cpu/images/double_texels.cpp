// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/images/double_texels.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "backends/cpu/images/format_plan.h"
#include "backends/cpu/images/texel_formats.h"

namespace nacre::cpu {
namespace {

/// Linear value of an sRGB code in [0, 1]. Source: IEC 61966-2-1.
double linear_of_srgb(double code) { return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4); }

double code_over_most(float value, double most) { return std::nearbyint(static_cast<double>(value) * most) / most; }

double in_range(double value, ChannelCoding coding) {
    switch (coding) {
        case ChannelCoding::unorm:
        case ChannelCoding::srgb: return value > 0.0 ? std::min(value, 1.0) : 0.0;
        case ChannelCoding::snorm: return value == value ? std::clamp(value, -1.0, 1.0) : 0.0;
        case ChannelCoding::small_float: return value <= 0.0 ? 0.0 : value;
        default: return value;
    }
}

void encode(rhi::Format format, const double* values, std::byte* out) {
    Texel texel{};
    for (std::uint32_t c = 0; c < format_plan(format).channel_count; ++c) texel.f[c] = static_cast<float>(values[c]);
    encode_texel(format, texel, out);
}

}  // namespace

std::uint32_t float_words(rhi::Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    const bool is_words =
        facts.kind == rhi::FormatKind::floating && !facts.is_compressed() && facts.block_bytes == 4 * facts.channels;
    return is_words ? facts.channels : 0;
}

bool has_shadow(rhi::Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    return facts.channels != 0 && !facts.is_integer() && !facts.is_compressed() && format != rhi::Format::rgb9e5_float;
}

DoubleTexel decode_double(rhi::Format format, const std::byte* block, std::uint32_t x_in_block,
                          std::uint32_t y_in_block) {
    const Texel texel = decode_texel(format, block, x_in_block, y_in_block);
    DoubleTexel values;
    for (std::size_t c = 0; c < 4; ++c) values[c] = texel.f[c];
    const FormatPlan& plan = format_plan(format);
    if (format == rhi::Format::d24_unorm_s8_uint) {
        std::uint32_t word = 0;
        std::memcpy(&word, block, sizeof word);
        values[0] = (word & 0xffffff) / 16777215.0;
        return values;
    }
    const bool is_srgb_block = plan.codec == Codec::block_srgb8;
    if (is_srgb_block || plan.codec == Codec::block_rgba8) {
        for (std::size_t c = 0; c < 4; ++c)
            values[c] = is_srgb_block && c < 3 ? linear_of_srgb(linear_to_srgb(texel.f[c]) / 255.0)
                                               : code_over_most(texel.f[c], 255.0);
        return values;
    }
    if (plan.codec == Codec::block_channels || plan.codec == Codec::shared_exponent || plan.codec == Codec::none)
        return values;
    for (std::size_t c = 0; c < plan.channel_count; ++c) {
        const ChannelPlan& channel = plan.channels[c];
        if (channel.coding == ChannelCoding::unorm || channel.coding == ChannelCoding::snorm)
            values[c] = code_over_most(texel.f[c], channel.most);
        else if (channel.coding == ChannelCoding::srgb)
            values[c] = linear_of_srgb(linear_to_srgb(texel.f[c]) / 255.0);
    }
    return values;
}

DoubleTexel load_double(rhi::Format format, const std::byte* texel, const double* shadow) {
    if (!shadow) return decode_double(format, texel);
    std::array<std::byte, 16> bits{};
    encode(format, shadow, bits.data());
    if (std::memcmp(bits.data(), texel, format_plan(format).texel_bytes) != 0) return decode_double(format, texel);
    DoubleTexel values{0.0, 0.0, 0.0, 1.0};
    std::copy_n(shadow, format_plan(format).channel_count, values.begin());
    return values;
}

void store_double(rhi::Format format, const DoubleTexel& values, std::byte* texel, double* shadow) {
    const FormatPlan& plan = format_plan(format);
    DoubleTexel kept{};
    for (std::size_t c = 0; c < plan.channel_count && c < 4; ++c)
        kept[c] = in_range(values[c], plan.channels[c].coding);
    encode(format, kept.data(), texel);
    if (shadow) std::copy_n(kept.data(), plan.channel_count, shadow);
}

}  // namespace nacre::cpu
