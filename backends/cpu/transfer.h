// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/buffer.h"
#include "backends/cpu/scheduler.h"
#include "backends/cpu/texture.h"
#include "rhi/command_stream.h"

/// @file
/// Copies, clears, resolves and mip generation. One at a time; large ones use all threads of the scheduler.
///
/// Buffers hold the depth of depth-stencil formats alone, 4 bytes for each texel (24-bit depth in the low bits). Copies
/// between textures take the stencil with them.

namespace nacre::cpu {

/// Bytes of the texel that a clear writes; those behind `rhi::info(format).block_bytes` are zero.
std::array<std::byte, 16> cleared_texel(rhi::Format format, const rhi::ClearColor& color);
/// The same of a depth plane.
std::array<std::byte, 4> cleared_depth(rhi::Format format, float depth);

class Transfer {
  public:
    explicit Transfer(Scheduler& scheduler) : scheduler_(scheduler) {}

    void copy_buffer(const rhi::CopyBufferCommand& command);
    void fill_buffer(const rhi::FillBufferCommand& command);
    void copy_buffer_to_texture(const rhi::CopyBufferToTextureCommand& command);
    void copy_texture_to_buffer(const rhi::CopyTextureToBufferCommand& command);
    void copy_texture(const rhi::CopyTextureCommand& command);

    /// Sets all texels and samples of all mips and layers of a view.
    void clear_color(const ImageView& view, const rhi::ClearColor& color);
    void clear_depth(const ImageView& view, float depth);
    void clear_stencil(const ImageView& view, std::uint8_t stencil);

    /// Mips 1 and up of every layer from mip 0, each from the one above: the average of 2x2 texels (2x2x2 of a volume).
    /// Where a size is odd, the two texels nearest to the place are weighted by their distance, as in a scaling blit of
    /// other APIs.
    void generate_mips(const ImageView& view);

    /// The average of a texel's samples, or the first sample of integer formats.
    void resolve(const ImageView& source, const ImageView& destination, std::uint32_t width, std::uint32_t height);

  private:
    void fill_plane(const std::array<ImageLevel, max_mips>& levels, const ImageView& view, const std::byte* texel,
                    std::uint32_t texel_bytes);

    Scheduler& scheduler_;
};

}  // namespace nacre::cpu
