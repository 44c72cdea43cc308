// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/texture.h"

#include <fmt/format.h>

#include <algorithm>

#include "backends/cpu/images/double_texels.h"
#include "backends/cpu/checks/check_functions.h"

namespace nacre::cpu {
namespace {

DirectTexels direct_texels(rhi::Format format, std::uint64_t bytes) {
    if (bytes >= std::uint64_t{1} << 31) return DirectTexels::no;
    switch (format) {
        case rhi::Format::r32_float:
        case rhi::Format::d32_float:
        case rhi::Format::d32_float_s8_uint: return DirectTexels::float_word;
        case rhi::Format::r32_uint:
        case rhi::Format::r32_sint: return DirectTexels::integer_word;
        case rhi::Format::rg32_uint:
        case rhi::Format::rg32_sint: return DirectTexels::integer_pair;
        case rhi::Format::rgba16_float: return DirectTexels::half4;
        case rhi::Format::rgba8_unorm: return DirectTexels::unorm8x4;
        default: return DirectTexels::no;
    }
}

/// Lays out one plane from byte `start` on and returns where it ends. `data` holds offsets until there is memory.
std::uint64_t lay_out(std::array<ImageLevel, max_mips>& levels, std::array<std::uint64_t, max_mips>& offsets,
                      const rhi::TextureDesc& desc, std::uint32_t texel_bytes, std::uint32_t block_width,
                      std::uint64_t start) {
    std::uint64_t at = start;
    for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
        const rhi::Extent3D extent = rhi::mip_extent(desc, mip);
        ImageLevel& level = levels[mip];
        level.width = extent.width, level.height = extent.height, level.depth = extent.depth;
        level.row_stride = (extent.width + block_width - 1) / block_width * texel_bytes;
        level.slice_stride = std::uint64_t{level.row_stride} * ((extent.height + block_width - 1) / block_width);
        level.sample_stride = level.slice_stride * extent.depth;
        // Whole cache lines, so that threads that write different layers never share one.
        level.layer_stride = (level.sample_stride * desc.samples + 63) / 64 * 64;
        offsets[mip] = at;
        at += level.layer_stride * desc.layers;
    }
    return at;
}

rhi::ViewDimension whole_dimension(const rhi::TextureDesc& desc) {
    switch (desc.dimension) {
        case rhi::TextureDimension::d1: return rhi::ViewDimension::d1_array;
        case rhi::TextureDimension::d2: return rhi::ViewDimension::d2_array;
        case rhi::TextureDimension::d3: return rhi::ViewDimension::d3;
        case rhi::TextureDimension::cube: return rhi::ViewDimension::cube_array;
    }
    return rhi::ViewDimension::d2_array;
}

/// Textures that are only copied to and sampled hold what the host gave, which their format holds exactly.
bool is_written_by_shaders(rhi::TextureUsage usage) {
    return (usage & (rhi::TextureUsage::color_target | rhi::TextureUsage::depth_target | rhi::TextureUsage::storage)) !=
           rhi::TextureUsage::none;
}

}  // namespace

std::uint32_t stored_texel_bytes(rhi::Format format) { return rhi::info(format).block_bytes; }

Expected<std::unique_ptr<rhi::BackendTexture>> CpuTexture::create(const std::shared_ptr<HostMemory>& memory,
                                                                  const rhi::TextureDesc& desc, std::uint32_t checks) {
    const rhi::FormatInfo& facts = rhi::info(desc.format);
    if (desc.mips > max_mips)
        return fail(ErrorCode::unsupported, "create texture", fmt::format("'{}'", desc.name),
                    fmt::format("expected at most {} mips, found {}", max_mips, desc.mips), "Use a smaller texture.");
    auto texture = std::make_unique<CpuTexture>();
    texture->desc = desc;
    ImageView& whole = texture->whole_;
    whole.format = desc.format;
    whole.dimension = whole_dimension(desc);
    whole.mip_count = desc.mips;
    whole.layer_count = desc.layers;
    whole.samples = desc.samples;
    whole.texel_bytes = stored_texel_bytes(desc.format);
    std::array<std::uint64_t, max_mips> offsets{}, stencil_offsets{};
    std::uint64_t bytes = lay_out(whole.levels, offsets, desc, whole.texel_bytes, facts.block_width, 0);
    if (facts.has_stencil) bytes = lay_out(whole.stencil_levels, stencil_offsets, desc, 1, 1, bytes);
    texture->block_ = MemoryBlock(memory, bytes);
    std::byte* const data = texture->block_.data();
    if (!data)
        return fail(
            ErrorCode::out_of_memory, "create texture", fmt::format("'{}'", desc.name),
            fmt::format("{} bytes for {}x{}x{} texels, {} layers, {} mips, {} samples of {} could not be had: the "
                        "device holds {} of the {} bytes of this machine",
                        bytes, desc.width, desc.height, desc.depth, desc.layers, desc.mips, desc.samples, facts.name,
                        memory->reserved_bytes(), memory->capacity()),
            "Free other resources or use a smaller texture.");
    for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
        whole.levels[mip].data = data + offsets[mip];
        if (facts.has_stencil) whole.stencil_levels[mip].data = data + stencil_offsets[mip];
    }
    if (memory->shadows && is_written_by_shaders(desc.usage) && has_shadow(desc.format)) {
        constexpr std::uint64_t doubles_of_texel = 4;
        texture->shadow_ = MemoryBlock(memory->shadows, bytes / whole.texel_bytes * doubles_of_texel * sizeof(double));
        auto* const doubles = reinterpret_cast<double*>(texture->shadow_.data());
        if (!doubles)
            return fail(ErrorCode::out_of_memory, "create texture", fmt::format("'{}'", desc.name),
                        "there is no memory for its values in double precision",
                        "Free other resources or use a smaller texture.");
        for (std::uint32_t mip = 0; mip < desc.mips; ++mip)
            whole.levels[mip].shadow = doubles + offsets[mip] / whole.texel_bytes * doubles_of_texel;
    }
    texture->memory_bytes = bytes;
    if (checks) {
        const bool is_poisoned = (checks & (check_sanitize | check_hostile)) != 0;
        texture->checked =
            std::make_unique<CheckedMemory>(fmt::format("texture '{}'", desc.name), data, bytes, !is_poisoned);
        if (is_poisoned) poison(data, bytes);
    }
    return texture;
}

ImageView CpuTexture::make_view(const rhi::ViewReference& reference) const {
    ImageView view;
    view.format = reference.format;
    view.dimension = reference.dimension;
    view.samples = whole_.samples;
    view.texel_bytes = whole_.texel_bytes;
    view.mip_count = std::min(reference.mip_count, whole_.mip_count - std::min(reference.base_mip, whole_.mip_count));
    view.layer_count = reference.dimension == rhi::ViewDimension::d3 ? 1 : reference.layer_count;
    for (std::uint32_t mip = 0; mip < view.mip_count; ++mip) {
        const auto part = [&](const ImageLevel& from) {
            ImageLevel level = from;
            if (level.data) level.data += level.layer_stride * reference.base_layer;
            if (level.shadow) level.shadow += level.layer_stride * reference.base_layer / whole_.texel_bytes * 4;
            return level;
        };
        view.levels[mip] = part(whole_.levels[reference.base_mip + mip]);
        view.stencil_levels[mip] = part(whole_.stencil_levels[reference.base_mip + mip]);
    }
    const ImageLevel& first = view.levels[0];
    const std::uint64_t bytes = first.layer_stride * view.layer_count + first.slice_stride * first.depth +
                                std::uint64_t{first.row_stride} * first.height;
    if (view.samples == 1) view.direct_texels = direct_texels(view.format, bytes);
    return view;
}

ImageView texel_view(const CpuBuffer& buffer, const rhi::BackendBinding& binding) {
    const std::uint64_t bytes = std::min(binding.size, buffer.size_from(binding.offset));
    ImageView view;
    view.format = binding.format;
    view.dimension = rhi::ViewDimension::d1;
    view.mip_count = view.layer_count = 1;
    view.texel_bytes = stored_texel_bytes(binding.format);
    view.direct_texels = direct_texels(binding.format, bytes);
    ImageLevel& level = view.levels[0];
    level.data = buffer.data() + binding.offset;
    level.width = static_cast<std::uint32_t>(bytes / view.texel_bytes);
    level.height = level.depth = 1;
    level.row_stride = level.width * view.texel_bytes;
    level.slice_stride = level.layer_stride = level.sample_stride = level.row_stride;
    view.shadow_doubles = float_words(binding.format);
    if (buffer.shadow() && view.shadow_doubles != 0)
        level.shadow = reinterpret_cast<double*>(buffer.shadow() + 2 * binding.offset);
    return view;
}

const ImageView* CpuTexture::view(const rhi::ViewReference& reference) {
    const ViewKey key{reference.dimension, reference.format,     reference.base_mip,
                      reference.mip_count, reference.base_layer, reference.layer_count};
    std::unique_ptr<ImageView>& kept = views_[key];
    if (!kept) kept = std::make_unique<ImageView>(make_view(reference));
    return kept.get();
}

}  // namespace nacre::cpu
