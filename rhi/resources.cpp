// SPDX-License-Identifier: Apache-2.0
#include "rhi/resources.h"

#include <algorithm>
#include <bit>

#include "rhi/objects.h"

namespace nacre::rhi {

std::uint32_t full_mip_count(std::uint32_t width, std::uint32_t height, std::uint32_t depth) {
    return static_cast<std::uint32_t>(std::bit_width(std::max({width, height, depth, 1u})));
}

Extent3D mip_extent(const TextureDesc& desc, std::uint32_t mip) {
    const auto shrink = [&](std::uint32_t size) { return mip < 32 ? std::max(1u, size >> mip) : 1u; };
    return {shrink(desc.width), shrink(desc.height), shrink(desc.depth)};
}

std::uint64_t mip_bytes(const TextureDesc& desc, std::uint32_t mip) {
    const FormatInfo& format = info(desc.format);
    const Extent3D extent = mip_extent(desc, mip);
    const std::uint64_t block = format.block_width;
    const std::uint64_t columns = (extent.width + block - 1) / block;
    const std::uint64_t rows = (extent.height + block - 1) / block;
    // Stencil is not copied: a texel of a depth-stencil format counts with its depth alone.
    const std::uint64_t bytes = format.has_stencil ? 4 : format.block_bytes;
    return columns * rows * extent.depth * bytes;
}

ViewReference complete_view(const TextureView& view, const TextureDesc& desc) {
    ViewReference complete;
    complete.base_mip = view.base_mip;
    complete.base_layer = view.base_layer;
    complete.mip_count = view.mip_count;
    complete.layer_count = view.layer_count;
    const std::uint32_t layers = layers_of(desc);
    if (view.mip_count == all_remaining) complete.mip_count = desc.mips > view.base_mip ? desc.mips - view.base_mip : 0;
    if (view.layer_count == all_remaining)
        complete.layer_count = layers > view.base_layer ? layers - view.base_layer : 0;
    complete.format = view.format == Format::undefined ? desc.format : view.format;
    complete.dimension = view.dimension;
    if (view.dimension == ViewDimension::automatic) {
        switch (desc.dimension) {
            case TextureDimension::d1:
                complete.dimension = layers > 1 ? ViewDimension::d1_array : ViewDimension::d1;
                break;
            case TextureDimension::d2:
                complete.dimension = layers > 1 ? ViewDimension::d2_array : ViewDimension::d2;
                break;
            case TextureDimension::d3: complete.dimension = ViewDimension::d3; break;
            case TextureDimension::cube:
                complete.dimension = layers > 6 ? ViewDimension::cube_array : ViewDimension::cube;
                break;
        }
    }
    return complete;
}

BufferTextureCopy complete_region(const BufferTextureCopy& region, const TextureDesc& desc) {
    BufferTextureCopy complete = region;
    if (region.extent.width == 0) complete.extent = mip_extent(desc, region.mip);
    const FormatInfo& format = info(desc.format);
    const std::uint32_t block = format.block_width;
    const std::uint32_t bytes = format.has_stencil ? 4 : format.block_bytes;
    if (region.bytes_per_row == 0) complete.bytes_per_row = (complete.extent.width + block - 1) / block * bytes;
    if (region.rows_per_slice == 0) complete.rows_per_slice = (complete.extent.height + block - 1) / block;
    return complete;
}

TextureCopy complete_region(const TextureCopy& region, const TextureDesc& source) {
    TextureCopy complete = region;
    if (region.extent.width == 0) complete.extent = mip_extent(source, region.source_mip);
    return complete;
}

std::uint64_t region_bytes(const BufferTextureCopy& region, const TextureDesc& desc) {
    const FormatInfo& format = info(desc.format);
    const std::uint64_t block = format.block_width;
    const std::uint64_t bytes = format.has_stencil ? 4 : format.block_bytes;
    const std::uint64_t rows = (region.extent.height + block - 1) / block;
    const std::uint64_t columns = (region.extent.width + block - 1) / block;
    if (rows == 0 || columns == 0 || region.extent.depth == 0) return 0;
    return (std::uint64_t{region.extent.depth - 1} * region.rows_per_slice + (rows - 1)) * region.bytes_per_row +
           columns * bytes;
}

}  // namespace nacre::rhi
