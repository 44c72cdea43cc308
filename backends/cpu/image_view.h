// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rhi/resources.h"

/// @file
/// Textures and texel buffers as shaders and the rasterizer see them: where the texels are, and how to read them.
///
/// Texels lie in rows without padding between texels: texel (x, y, z) of sample s, layer l and mip m is at
///     levels[m].data + l * levels[m].layer_stride + s * levels[m].sample_stride + z * levels[m].slice_stride
///                    + y * levels[m].row_stride + x * block_bytes
/// Block-compressed formats lie there as blocks (x and y counted in blocks). Depth-stencil formats lie as two planes:
/// depth (d24 as 32 bits with the value in the low 24, d16 as 16, d32 as float) in the levels, stencil (8 bits) in
/// `stencil_levels`. Texel buffers are views of dimension d1 with one mip.

namespace nacre::cpu {

inline constexpr std::uint32_t max_mips = 16;

struct ImageLevel {
    std::byte* data = nullptr;
    std::uint32_t width = 0, height = 0, depth = 0;  ///< Texels.
    std::uint32_t row_stride = 0;                    ///< Bytes.
    std::uint64_t slice_stride = 0, layer_stride = 0, sample_stride = 0;
    /// Of devices in double precision, else null: doubles for each texel, those of the texel at data + n * texel_bytes
    /// at shadow + n * ImageView::shadow_doubles. See images/double_texels.h.
    double* shadow = nullptr;
};

/// Views whose texels compiled code reads and writes by itself, by their layout: one sample, offsets below 2^31 bytes.
enum class DirectTexels : std::uint32_t {
    no,
    float_word,    ///< r32_float, depth of 32 bits.
    integer_word,  ///< r32_uint, r32_sint
    integer_pair,  ///< rg32_uint, rg32_sint
    half4,         ///< rgba16_float
    unorm8x4,      ///< rgba8_unorm
};

/// A part of a texture in one dimension and format. Levels count from the view's first mip, layers from its first
/// layer.
struct ImageView {
    rhi::Format format = rhi::Format::undefined;
    rhi::ViewDimension dimension = rhi::ViewDimension::d2;
    std::uint32_t mip_count = 0;
    std::uint32_t layer_count = 0;   ///< Cubes: 6 for each cube. 3D: 1.
    std::uint32_t samples = 1;
    std::uint32_t texel_bytes = 0;   ///< Of a texel, or of a block.
    DirectTexels direct_texels = DirectTexels::no;
    std::array<ImageLevel, max_mips> levels{};
    std::array<ImageLevel, max_mips> stencil_levels{};
    std::uint32_t shadow_doubles = 4;  ///< For each texel: 4 in textures, in texel buffers one for each word.
};

/// A sampler, prepared.
struct SamplerState {
    rhi::SamplerDesc desc;
    /// Anisotropic footprints are ellipses, as in Mesa's software drivers; else several samples along the longer axis,
    /// which costs less.
    bool is_elliptical = false;
};

}  // namespace nacre::cpu
