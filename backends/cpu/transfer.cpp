// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/transfer.h"

#include <algorithm>
#include <cstring>

#include "backends/cpu/images/double_texels.h"
#include "backends/cpu/parallel_parts.h"

namespace nacre::cpu {
namespace {

const CpuBuffer& buffer_of(const rhi::BufferReference& reference) { return *static_cast<CpuBuffer*>(reference.object); }

/// Rows of blocks of a box, in one layer.
struct BoxRows {
    std::byte* first = nullptr;
    std::uint64_t row_stride = 0, slice_stride = 0;
};

BoxRows rows_of(const ImageLevel& level, std::uint32_t layer, const rhi::Offset3D& offset, std::uint32_t block_width,
                std::uint32_t texel_bytes) {
    return {level.data + layer * level.layer_stride + offset.z * level.slice_stride +
                std::uint64_t{offset.y / block_width} * level.row_stride +
                std::uint64_t{offset.x / block_width} * texel_bytes,
            level.row_stride, level.slice_stride};
}

/// The doubles of the texel at an address in a level; null where the level has none.
double* shadow_at(const ImageLevel& level, const std::byte* texel, std::uint32_t texel_bytes) {
    return level.shadow ? level.shadow + static_cast<std::uint64_t>(texel - level.data) / texel_bytes * 4 : nullptr;
}

}  // namespace

void Transfer::copy_buffer(const rhi::CopyBufferCommand& command) {
    const CpuBuffer &source = buffer_of(command.source), &destination = buffer_of(command.destination);
    const std::byte* from = source.data() + command.source_offset;
    std::byte* to = destination.data() + command.destination_offset;
    if (&source == &destination) {
        std::memmove(to, from, command.size);
        if (source.shadow())
            std::memmove(destination.shadow() + 2 * command.destination_offset,
                         source.shadow() + 2 * command.source_offset, 2 * command.size);
        return;
    }
    if (source.shadow())
        copy_bytes(source.shadow() + 2 * command.source_offset, destination.shadow() + 2 * command.destination_offset,
                   2 * command.size);
    copy_bytes(from, to, command.size);
}

void Transfer::copy_bytes(const std::byte* from, std::byte* to, std::uint64_t size) {
    in_parallel(scheduler_, size, 1,
                [&](std::uint64_t first, std::uint64_t count) { std::memcpy(to + first, from + first, count); });
}

void Transfer::fill_buffer(const rhi::FillBufferCommand& command) {
    // What a shadow of zero stands for is the word itself.
    if (std::byte* const shadow = buffer_of(command.buffer).shadow())
        std::memset(shadow + 2 * command.offset, 0, 2 * command.size);
    auto* words = reinterpret_cast<std::uint32_t*>(buffer_of(command.buffer).data() + command.offset);
    in_parallel(scheduler_, command.size / 4, 4,
                [&](std::uint64_t first, std::uint64_t count) { std::fill_n(words + first, count, command.value); });
}

void Transfer::copy_buffer_to_texture(const rhi::CopyBufferToTextureCommand& command) {
    const CpuTexture& texture = texture_of(command.destination);
    const rhi::BufferTextureCopy& region = command.region;
    const std::uint32_t edge = rhi::info(texture.desc.format).block_width, bytes = texture.whole().texel_bytes;
    const ImageLevel& level = texture.whole().levels[region.mip];
    const BoxRows to = rows_of(level, region.layer, region.offset, edge, bytes);
    const std::byte* from = buffer_of(command.source).data() + region.buffer_offset;
    const auto from_offset = [&](std::uint64_t slice, std::uint64_t row) {
        return (slice * region.rows_per_slice + row) * region.bytes_per_row;
    };
    const auto* words = reinterpret_cast<const double*>(buffer_of(command.source).shadow() + 2 * region.buffer_offset);
    const std::uint32_t channels = buffer_of(command.source).shadow() ? float_words(texture.desc.format) : 0;
    const std::uint64_t row_bytes = std::uint64_t{(region.extent.width + edge - 1) / edge} * bytes;
    const std::uint64_t rows = (region.extent.height + edge - 1) / edge;
    // The upper byte of 24-bit depth is undefined in buffers and 0 in textures.
    const bool cuts_depth = texture.desc.format == rhi::Format::d24_unorm_s8_uint;
    in_parallel(scheduler_, rows * region.extent.depth, row_bytes, [&](std::uint64_t first, std::uint64_t count) {
        for (std::uint64_t at = first; at < first + count; ++at) {
            const std::uint64_t slice = at / rows, row = at % rows;
            std::byte* out = to.first + slice * to.slice_stride + row * to.row_stride;
            std::memcpy(out, from + from_offset(slice, row), row_bytes);
            for (std::uint32_t x = 0; cuts_depth && x < region.extent.width; ++x) out[x * 4 + 3] = std::byte{0};
            double* const shadow = shadow_at(level, out, bytes);
            for (std::uint32_t x = 0; shadow && x < region.extent.width; ++x)
                for (std::uint32_t c = 0; c < 4; ++c)
                    shadow[4 * x + c] = c < channels ? words[(from_offset(slice, row) / 4) + channels * x + c] : 0.0;
        }
    });
}

void Transfer::copy_texture_to_buffer(const rhi::CopyTextureToBufferCommand& command) {
    const CpuTexture& texture = texture_of(command.source);
    const rhi::BufferTextureCopy& region = command.region;
    const std::uint32_t edge = rhi::info(texture.desc.format).block_width, bytes = texture.whole().texel_bytes;
    const ImageLevel& level = texture.whole().levels[region.mip];
    const BoxRows from = rows_of(level, region.layer, region.offset, edge, bytes);
    std::byte* to = buffer_of(command.destination).data() + region.buffer_offset;
    std::byte* const to_shadow = buffer_of(command.destination).shadow();
    const std::uint32_t channels = float_words(texture.desc.format);
    const std::uint64_t row_bytes = std::uint64_t{(region.extent.width + edge - 1) / edge} * bytes;
    const std::uint64_t rows = (region.extent.height + edge - 1) / edge;
    in_parallel(scheduler_, rows * region.extent.depth, row_bytes, [&](std::uint64_t first, std::uint64_t count) {
        for (std::uint64_t at = first; at < first + count; ++at) {
            const std::uint64_t slice = at / rows, row = at % rows;
            const std::uint64_t offset = (slice * region.rows_per_slice + row) * region.bytes_per_row;
            const std::byte* const texels = from.first + slice * from.slice_stride + row * from.row_stride;
            std::memcpy(to + offset, texels, row_bytes);
            if (!to_shadow) continue;
            std::byte* const doubles = to_shadow + 2 * (region.buffer_offset + offset);
            std::memset(doubles, 0, 2 * row_bytes);
            const double* const shadow = shadow_at(level, texels, bytes);
            if (!shadow || channels == 0) continue;
            auto* const words = reinterpret_cast<double*>(doubles);
            for (std::uint32_t x = 0; x < region.extent.width; ++x)
                for (std::uint32_t c = 0; c < channels; ++c) words[channels * x + c] = shadow[4 * x + c];
        }
    });
}

void Transfer::copy_texture(const rhi::CopyTextureCommand& command) {
    const CpuTexture &source = texture_of(command.source), &destination = texture_of(command.destination);
    const rhi::TextureCopy& region = command.region;
    const std::uint32_t edge = rhi::info(source.desc.format).block_width;
    const std::uint64_t rows = (region.extent.height + edge - 1) / edge;
    const bool is_same_format = source.desc.format == destination.desc.format;
    const auto copy_plane = [&](const ImageLevel& from_level, const ImageLevel& to_level, std::uint32_t texel_bytes) {
        const BoxRows from = rows_of(from_level, region.source_layer, region.source_offset, edge, texel_bytes);
        const BoxRows to = rows_of(to_level, region.destination_layer, region.destination_offset, edge, texel_bytes);
        const std::uint64_t row_bytes = std::uint64_t{(region.extent.width + edge - 1) / edge} * texel_bytes;
        const std::uint64_t layer_rows = rows * region.extent.depth;
        in_parallel(
            scheduler_, layer_rows * region.layer_count, row_bytes, [&](std::uint64_t first, std::uint64_t count) {
                for (std::uint64_t at = first; at < first + count; ++at) {
                    const std::uint64_t layer = at / layer_rows, slice = at % layer_rows / rows, row = at % rows;
                    std::byte* const out =
                        to.first + layer * to_level.layer_stride + slice * to.slice_stride + row * to.row_stride;
                    const std::byte* const in = from.first + layer * from_level.layer_stride +
                                                slice * from.slice_stride + row * from.row_stride;
                    std::memmove(out, in, row_bytes);
                    double* const out_shadow = shadow_at(to_level, out, texel_bytes);
                    if (!out_shadow) continue;
                    const double* const in_shadow = shadow_at(from_level, in, texel_bytes);
                    const std::uint64_t doubles = row_bytes / texel_bytes * 4;
                    if (in_shadow && is_same_format)
                        std::memmove(out_shadow, in_shadow, doubles * sizeof(double));
                    else
                        std::fill_n(out_shadow, doubles, 0.0);
                }
            });
    };
    const ImageView &from = source.whole(), &to = destination.whole();
    copy_plane(from.levels[region.source_mip], to.levels[region.destination_mip], from.texel_bytes);
    const ImageLevel& stencil = from.stencil_levels[region.source_mip];
    if (stencil.data && to.stencil_levels[region.destination_mip].data)
        copy_plane(stencil, to.stencil_levels[region.destination_mip], 1);
}

}  // namespace nacre::cpu
