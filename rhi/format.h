// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace nacre::rhi {

/// Formats of texels and vertex attributes. Channels are listed from the lowest address or the lowest
/// bit; the suffix tells how a channel's bits are read.
enum class Format : std::uint8_t {
    undefined,
    r8_unorm, r8_snorm, r8_uint, r8_sint,
    rg8_unorm, rg8_snorm, rg8_uint, rg8_sint,
    rgba8_unorm, rgba8_srgb, rgba8_snorm, rgba8_uint, rgba8_sint, bgra8_unorm, bgra8_srgb,
    r16_unorm, r16_snorm, r16_uint, r16_sint, r16_float,
    rg16_unorm, rg16_snorm, rg16_uint, rg16_sint, rg16_float,
    rgba16_unorm, rgba16_snorm, rgba16_uint, rgba16_sint, rgba16_float,
    r32_uint, r32_sint, r32_float,
    rg32_uint, rg32_sint, rg32_float,
    rgb32_uint, rgb32_sint, rgb32_float,  ///< Vertex attributes; on some devices uniform texel buffers.
    rgba32_uint, rgba32_sint, rgba32_float,
    rgb10a2_unorm, rgb10a2_uint, rg11b10_float, rgb9e5_float,
    d16_unorm, d32_float, d24_unorm_s8_uint, d32_float_s8_uint,
    bc1_rgba_unorm, bc1_rgba_srgb, bc2_rgba_unorm, bc2_rgba_srgb, bc3_rgba_unorm, bc3_rgba_srgb,
    bc4_r_unorm, bc4_r_snorm, bc5_rg_unorm, bc5_rg_snorm,
    bc6h_rgb_ufloat, bc6h_rgb_sfloat, bc7_rgba_unorm, bc7_rgba_srgb,
};
inline constexpr std::uint32_t format_count = static_cast<std::uint32_t>(Format::bc7_rgba_srgb) + 1;

/// How a shader sees a channel.
enum class FormatKind : std::uint8_t { unorm, snorm, uint, sint, floating, srgb };

/// Facts about a format that hold on every device.
struct FormatInfo {
    std::string_view name;         ///< The enumerator's name, e.g. "rgba8_unorm".
    std::uint8_t block_bytes;      ///< Bytes of a texel, or of a 4x4 block for block-compressed formats.
    std::uint8_t block_width;      ///< 1, or 4 for block-compressed formats (blocks are square).
    std::uint8_t channels;         ///< 1 to 4; 1 for depth, 2 for depth with stencil.
    FormatKind kind;
    bool has_depth;
    bool has_stencil;
    [[nodiscard]] constexpr bool is_compressed() const { return block_width > 1; }
    [[nodiscard]] constexpr bool is_depth_stencil() const { return has_depth || has_stencil; }
    [[nodiscard]] constexpr bool is_integer() const { return kind == FormatKind::uint || kind == FormatKind::sint; }
};

/// Facts about `format`; for `undefined` all zero. Never fails.
const FormatInfo& info(Format format);

/// Format by its enumerator's name; `Format::undefined` where there is none of that name.
Format format_by_name(std::string_view name);

/// What a device can do with a format (see `Capabilities::format_support`).
enum class FormatSupport : std::uint32_t {
    none = 0,
    sampled = 1,          ///< Read through a sampler with nearest filtering, and by texelFetch.
    filtered = 2,         ///< Linear filtering.
    color_target = 4,
    blended = 8,          ///< Color target with blending.
    depth_target = 16,
    storage_image = 32,   ///< imageLoad and imageStore in compute shaders.
    vertex = 64,          ///< Vertex attribute.
    multisampled = 128,   ///< 4 samples as a color or depth target.
    storage_atomic = 256, ///< imageAtomic* in compute shaders.
    uniform_texel_buffer = 512,   ///< Elements of BindingType::uniform_texel_buffer.
    storage_texel_buffer = 1024,  ///< Elements of storage texel buffers: imageLoad and imageStore in compute shaders.
    storage_texel_buffer_atomic = 2048,  ///< imageAtomic* on them.
};
constexpr FormatSupport operator|(FormatSupport a, FormatSupport b) {
    return static_cast<FormatSupport>(static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b));
}
constexpr FormatSupport& operator|=(FormatSupport& a, FormatSupport b) { return a = a | b; }
constexpr bool has_all(FormatSupport a, FormatSupport b) {
    return (static_cast<std::uint32_t>(a) & static_cast<std::uint32_t>(b)) == static_cast<std::uint32_t>(b);
}

}  // namespace nacre::rhi
