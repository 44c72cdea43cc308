// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rhi/command_list.h"
#include "rhi/format.h"

/// @file
/// Texels put together on the host, for what an OpenGL ES without extensions cannot read or clear in a format's own
/// layout.

namespace nacre::gl {

/// A texel as a shader sees it: integers, or the bits of floats (linear for srgb formats).
using ShaderTexel = std::array<std::uint32_t, 4>;

/// Writes `texel` in the memory layout of `format` (uncompressed, block_bytes of it; depth formats as in
/// copies: d24 in the low bits). Exact for values that the format can hold; others are rounded to the nearest even and
/// clamped.
void pack_texel(rhi::Format format, const ShaderTexel& texel, std::byte* destination);

/// The clear color as a shader would have written it.
ShaderTexel clear_texel(rhi::Format format, const rhi::ClearColor& color);

}  // namespace nacre::gl
