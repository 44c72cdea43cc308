// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstring>

#include "backends/cpu/images/texel_formats.h"
#include "backends/cpu/parallel_parts.h"
#include "backends/cpu/texel_rows.h"
#include "backends/cpu/transfer.h"

namespace nacre::cpu {

void Transfer::fill_plane(const std::array<ImageLevel, max_mips>& levels, const ImageView& view, const std::byte* texel,
                          std::uint32_t texel_bytes) {
    for (std::uint32_t mip = 0; mip < view.mip_count; ++mip) {
        const ImageLevel& level = levels[mip];
        // Rows, slices and samples of a layer lie without gaps.
        const std::uint64_t layer_texels = level.sample_stride / texel_bytes * view.samples;
        for (std::uint32_t layer = 0; layer < view.layer_count; ++layer) {
            std::byte* out = level.data + layer * level.layer_stride;
            in_parallel(scheduler_, layer_texels, texel_bytes, [&](std::uint64_t first, std::uint64_t count) {
                fill_row(texel, texel_bytes, count, out + first * texel_bytes);
            });
        }
    }
}

std::array<std::byte, 16> cleared_texel(rhi::Format format, const rhi::ClearColor& color) {
    Texel texel{};
    static_assert(sizeof color == sizeof texel);
    std::memcpy(&texel, &color, sizeof texel);
    std::array<std::byte, 16> bytes{};
    encode_texel(format, texel, bytes.data());
    return bytes;
}

std::array<std::byte, 4> cleared_depth(rhi::Format format, float depth) {
    Texel texel{};
    texel.f[0] = depth > 0.0f ? std::min(depth, 1.0f) : 0.0f;
    std::array<std::byte, 4> bytes{};
    encode_texel(format, texel, bytes.data());
    return bytes;
}

void Transfer::clear_color(const ImageView& view, const rhi::ClearColor& color) {
    fill_plane(view.levels, view, cleared_texel(view.format, color).data(), view.texel_bytes);
}

void Transfer::clear_depth(const ImageView& view, float depth) {
    fill_plane(view.levels, view, cleared_depth(view.format, depth).data(), view.texel_bytes);
}

void Transfer::clear_stencil(const ImageView& view, std::uint8_t stencil) {
    if (!view.stencil_levels[0].data) return;
    const auto byte = static_cast<std::byte>(stencil);
    fill_plane(view.stencil_levels, view, &byte, 1);
}

}  // namespace nacre::cpu
