// SPDX-License-Identifier: Apache-2.0
#include "rhi/format.h"

#include <array>

namespace nacre::rhi {
namespace {

using enum FormatKind;

// Name, bytes of a block, width of a block, channels, kind, depth, stencil; in the order of the enumeration.
constexpr std::array<FormatInfo, format_count> table{{
    {"undefined", 0, 1, 0, unorm, false, false},
    {"r8_unorm", 1, 1, 1, unorm, false, false},
    {"r8_snorm", 1, 1, 1, snorm, false, false},
    {"r8_uint", 1, 1, 1, uint, false, false},
    {"r8_sint", 1, 1, 1, sint, false, false},
    {"rg8_unorm", 2, 1, 2, unorm, false, false},
    {"rg8_snorm", 2, 1, 2, snorm, false, false},
    {"rg8_uint", 2, 1, 2, uint, false, false},
    {"rg8_sint", 2, 1, 2, sint, false, false},
    {"rgba8_unorm", 4, 1, 4, unorm, false, false},
    {"rgba8_srgb", 4, 1, 4, srgb, false, false},
    {"rgba8_snorm", 4, 1, 4, snorm, false, false},
    {"rgba8_uint", 4, 1, 4, uint, false, false},
    {"rgba8_sint", 4, 1, 4, sint, false, false},
    {"bgra8_unorm", 4, 1, 4, unorm, false, false},
    {"bgra8_srgb", 4, 1, 4, srgb, false, false},
    {"r16_unorm", 2, 1, 1, unorm, false, false},
    {"r16_snorm", 2, 1, 1, snorm, false, false},
    {"r16_uint", 2, 1, 1, uint, false, false},
    {"r16_sint", 2, 1, 1, sint, false, false},
    {"r16_float", 2, 1, 1, floating, false, false},
    {"rg16_unorm", 4, 1, 2, unorm, false, false},
    {"rg16_snorm", 4, 1, 2, snorm, false, false},
    {"rg16_uint", 4, 1, 2, uint, false, false},
    {"rg16_sint", 4, 1, 2, sint, false, false},
    {"rg16_float", 4, 1, 2, floating, false, false},
    {"rgba16_unorm", 8, 1, 4, unorm, false, false},
    {"rgba16_snorm", 8, 1, 4, snorm, false, false},
    {"rgba16_uint", 8, 1, 4, uint, false, false},
    {"rgba16_sint", 8, 1, 4, sint, false, false},
    {"rgba16_float", 8, 1, 4, floating, false, false},
    {"r32_uint", 4, 1, 1, uint, false, false},
    {"r32_sint", 4, 1, 1, sint, false, false},
    {"r32_float", 4, 1, 1, floating, false, false},
    {"rg32_uint", 8, 1, 2, uint, false, false},
    {"rg32_sint", 8, 1, 2, sint, false, false},
    {"rg32_float", 8, 1, 2, floating, false, false},
    {"rgb32_uint", 12, 1, 3, uint, false, false},
    {"rgb32_sint", 12, 1, 3, sint, false, false},
    {"rgb32_float", 12, 1, 3, floating, false, false},
    {"rgba32_uint", 16, 1, 4, uint, false, false},
    {"rgba32_sint", 16, 1, 4, sint, false, false},
    {"rgba32_float", 16, 1, 4, floating, false, false},
    {"rgb10a2_unorm", 4, 1, 4, unorm, false, false},
    {"rgb10a2_uint", 4, 1, 4, uint, false, false},
    {"rg11b10_float", 4, 1, 3, floating, false, false},
    {"rgb9e5_float", 4, 1, 3, floating, false, false},
    {"d16_unorm", 2, 1, 1, unorm, true, false},
    {"d32_float", 4, 1, 1, floating, true, false},
    {"d24_unorm_s8_uint", 4, 1, 2, unorm, true, true},
    {"d32_float_s8_uint", 4, 1, 2, floating, true, true},
    {"bc1_rgba_unorm", 8, 4, 4, unorm, false, false},
    {"bc1_rgba_srgb", 8, 4, 4, srgb, false, false},
    {"bc2_rgba_unorm", 16, 4, 4, unorm, false, false},
    {"bc2_rgba_srgb", 16, 4, 4, srgb, false, false},
    {"bc3_rgba_unorm", 16, 4, 4, unorm, false, false},
    {"bc3_rgba_srgb", 16, 4, 4, srgb, false, false},
    {"bc4_r_unorm", 8, 4, 1, unorm, false, false},
    {"bc4_r_snorm", 8, 4, 1, snorm, false, false},
    {"bc5_rg_unorm", 16, 4, 2, unorm, false, false},
    {"bc5_rg_snorm", 16, 4, 2, snorm, false, false},
    {"bc6h_rgb_ufloat", 16, 4, 3, floating, false, false},
    {"bc6h_rgb_sfloat", 16, 4, 3, floating, false, false},
    {"bc7_rgba_unorm", 16, 4, 4, unorm, false, false},
    {"bc7_rgba_srgb", 16, 4, 4, srgb, false, false},
}};

}  // namespace

const FormatInfo& info(Format format) {
    const auto index = static_cast<std::uint32_t>(format);
    return table[index < format_count ? index : 0];
}

Format format_by_name(std::string_view name) {
    for (std::uint32_t i = 1; i < format_count; ++i)
        if (table[i].name == name) return static_cast<Format>(i);
    return Format::undefined;
}

}  // namespace nacre::rhi
