// SPDX-License-Identifier: Apache-2.0
// Copies, fills, clears and mips.
#include <fmt/format.h>

#include <algorithm>

#include "rhi/command_validator.h"

namespace nacre::rhi {
namespace {

bool ranges_meet(std::uint64_t a, std::uint64_t a_size, std::uint64_t b, std::uint64_t b_size) {
    return a < b + b_size && b < a + a_size;
}

/// Formats between which texels may be copied: equal, or the same but for sRGB encoding.
bool copy_compatible(Format a, Format b) {
    if (a == b) return true;
    const FormatInfo& first = info(a);
    const FormatInfo& second = info(b);
    const auto stem = [](std::string_view name) { return name.substr(0, name.rfind('_')); };
    const auto encoding = [](FormatKind kind) { return kind == FormatKind::unorm || kind == FormatKind::srgb; };
    return stem(first.name) == stem(second.name) && encoding(first.kind) && encoding(second.kind);
}

}  // namespace

Check CommandValidator::copy_buffer(Buffer source, std::uint64_t source_offset, Buffer destination,
                                    std::uint64_t destination_offset, std::uint64_t size) {
    const char* attempted = "copy buffer";
    const std::shared_lock lock(device_->tables_mutex);
    if (auto failed = outside(attempted)) return failed;
    Check failed;
    const BufferObject* from = look_up(source, attempted, "source buffer", failed);
    if (!from) return failed;
    const BufferObject* to = look_up(destination, attempted, "destination buffer", failed);
    if (!to) return failed;
    const auto check_end = [&](const BufferObject& buffer, std::uint64_t offset, BufferUsage usage,
                               const char* end) -> Check {
        const std::string subject = fmt::format("{} buffer '{}'", end, buffer.desc.name);
        if (!has_all(buffer.desc.usage, usage))
            return problem(Rule::copy_usage, attempted,
                           fmt::format("expected usage {}, found {}", text_of(usage), text_of(buffer.desc.usage)),
                           "Add the usage where the buffer is created.", subject);
        if (offset > buffer.desc.size || size > buffer.desc.size - offset)
            return problem(Rule::copy_range, attempted,
                           fmt::format("expected a range within {} bytes, found {} bytes from offset {}",
                                       buffer.desc.size, size, offset),
                           "Correct offset and size.", subject);
        return {};
    };
    if (auto wrong = check_end(*from, source_offset, BufferUsage::copy_source, "source")) return wrong;
    if (auto wrong = check_end(*to, destination_offset, BufferUsage::copy_destination, "destination")) return wrong;
    if (source == destination && ranges_meet(source_offset, size, destination_offset, size))
        return problem(Rule::copy_overlap, attempted,
                       fmt::format("expected ranges that do not overlap, found {} bytes from {} and from {}", size,
                                   source_offset, destination_offset),
                       "Copy through another buffer.", fmt::format("buffer '{}'", from->desc.name));
    return {};
}

Check CommandValidator::check_texture_box(const char* attempted, const TextureDesc& desc, std::uint32_t mip,
                                          std::uint32_t layer, std::uint32_t layer_count, const Offset3D& offset,
                                          const Extent3D& extent) const {
    const std::string subject = fmt::format("texture '{}'", desc.name);
    if (mip >= desc.mips || layer >= layers_of(desc) || layer_count == 0 || layer_count > layers_of(desc) - layer)
        return problem(Rule::copy_range, attempted,
                       fmt::format("expected a mip below {} and layers below {}, found mip {} and {} layers from {}",
                                   desc.mips, layers_of(desc), mip, layer_count, layer),
                       "Name parts that the texture has.", subject);
    if (desc.samples != 1)
        return problem(Rule::copy_samples, attempted, fmt::format("expected 1 sample, found {}", desc.samples),
                       "Resolve the texture first.", subject);
    const Extent3D size = mip_extent(desc, mip);
    const auto fits = [](std::uint32_t at, std::uint32_t length, std::uint32_t all) {
        return length > 0 && at <= all && length <= all - at;
    };
    if (!fits(offset.x, extent.width, size.width) || !fits(offset.y, extent.height, size.height) ||
        !fits(offset.z, extent.depth, size.depth))
        return problem(Rule::copy_range, attempted,
                       fmt::format("expected a box within the {}x{}x{} texels of mip {}, found {}x{}x{} at {}, {}, {}",
                                   size.width, size.height, size.depth, mip, extent.width, extent.height, extent.depth,
                                   offset.x, offset.y, offset.z),
                       "Correct offset and extent.", subject);
    const std::uint32_t block = info(desc.format).block_width;
    const auto aligned = [block](std::uint32_t at, std::uint32_t length, std::uint32_t all) {
        return at % block == 0 && (length % block == 0 || at + length == all);
    };
    if (!aligned(offset.x, extent.width, size.width) || !aligned(offset.y, extent.height, size.height))
        return problem(Rule::copy_alignment, attempted,
                       fmt::format("expected whole blocks of {}x{} texels, found {}x{} at {}, {}", block, block,
                                   extent.width, extent.height, offset.x, offset.y),
                       "Align the box to blocks.", subject);
    return {};
}

Check CommandValidator::copy_buffer_and_texture(Buffer buffer, Texture texture, const BufferTextureCopy& wanted,
                                                bool to_texture) {
    const char* attempted = to_texture ? "copy buffer to texture" : "copy texture to buffer";
    const std::shared_lock lock(device_->tables_mutex);
    if (auto failed = outside(attempted)) return failed;
    Check failed;
    const BufferObject* bytes = look_up(buffer, attempted, "buffer", failed);
    if (!bytes) return failed;
    const TextureObject* texels = look_up(texture, attempted, "texture", failed);
    if (!texels) return failed;
    const TextureDesc& desc = texels->desc;
    const BufferUsage buffer_usage = to_texture ? BufferUsage::copy_source : BufferUsage::copy_destination;
    const TextureUsage texture_usage = to_texture ? TextureUsage::copy_destination : TextureUsage::copy_source;
    if (!has_all(bytes->desc.usage, buffer_usage))
        return problem(Rule::copy_usage, attempted,
                       fmt::format("expected usage {}, found {}", text_of(buffer_usage), text_of(bytes->desc.usage)),
                       "Add the usage where the buffer is created.", fmt::format("buffer '{}'", bytes->desc.name));
    if (desc.samples == 1 && !has_all(desc.usage, texture_usage))
        return problem(Rule::copy_usage, attempted,
                       fmt::format("expected usage {}, found {}", text_of(texture_usage), text_of(desc.usage)),
                       "Add the usage where the texture is created.", fmt::format("texture '{}'", desc.name));
    const BufferTextureCopy region = complete_region(wanted, desc);
    if (auto wrong = check_texture_box(attempted, desc, region.mip, region.layer, 1, region.offset, region.extent))
        return wrong;
    const FormatInfo& format = info(desc.format);
    const std::uint32_t block_bytes = format.has_stencil ? 4 : format.block_bytes;
    const std::uint32_t block = format.block_width;
    const std::uint64_t row = std::uint64_t{(region.extent.width + block - 1) / block} * block_bytes;
    const std::uint32_t rows = (region.extent.height + block - 1) / block;
    const std::string subject = fmt::format("buffer '{}', texture '{}'", bytes->desc.name, desc.name);
    if (region.buffer_offset % block_bytes != 0 || region.buffer_offset % 4 != 0 ||
        region.bytes_per_row % block_bytes != 0 || region.bytes_per_row < row || region.rows_per_slice < rows)
        return problem(
            Rule::copy_alignment, attempted,
            fmt::format("expected a buffer_offset that is a multiple of {} and 4, a bytes_per_row that is a "
                        "multiple of {} and at least {}, and at least {} rows_per_slice, found {}, {} and {}",
                        block_bytes, block_bytes, row, rows, region.buffer_offset, region.bytes_per_row,
                        region.rows_per_slice),
            "Align the rows, or leave them 0 for a tight layout.", subject);
    const std::uint64_t needed = region_bytes(region, desc);
    if (region.buffer_offset > bytes->desc.size || needed > bytes->desc.size - region.buffer_offset)
        return problem(Rule::copy_range, attempted,
                       fmt::format("expected {} bytes from offset {} within {}, found less", needed,
                                   region.buffer_offset, bytes->desc.size),
                       "Make the buffer larger, or copy less.", subject);
    return {};
}

Check CommandValidator::copy_texture(Texture source, Texture destination, const TextureCopy& wanted) {
    const char* attempted = "copy texture";
    const std::shared_lock lock(device_->tables_mutex);
    if (auto failed = outside(attempted)) return failed;
    Check failed;
    const TextureObject* from = look_up(source, attempted, "source texture", failed);
    if (!from) return failed;
    const TextureObject* to = look_up(destination, attempted, "destination texture", failed);
    if (!to) return failed;
    const auto check_usage = [&](const TextureDesc& desc, TextureUsage usage) -> Check {
        if (desc.samples != 1 || has_all(desc.usage, usage)) return {};
        return problem(Rule::copy_usage, attempted,
                       fmt::format("expected usage {}, found {}", text_of(usage), text_of(desc.usage)),
                       "Add the usage where the texture is created.", fmt::format("texture '{}'", desc.name));
    };
    if (auto wrong = check_usage(from->desc, TextureUsage::copy_source)) return wrong;
    if (auto wrong = check_usage(to->desc, TextureUsage::copy_destination)) return wrong;
    if (!copy_compatible(from->desc.format, to->desc.format))
        return problem(Rule::copy_format, attempted,
                       fmt::format("expected formats that are equal but for sRGB, found {} and {}",
                                   info(from->desc.format).name, info(to->desc.format).name),
                       "Draw with a shader to convert between formats.",
                       fmt::format("textures '{}' and '{}'", from->desc.name, to->desc.name));
    const TextureCopy region = complete_region(wanted, from->desc);
    if (auto wrong = check_texture_box(attempted, from->desc, region.source_mip, region.source_layer,
                                       region.layer_count, region.source_offset, region.extent))
        return wrong;
    if (auto wrong = check_texture_box(attempted, to->desc, region.destination_mip, region.destination_layer,
                                       region.layer_count, region.destination_offset, region.extent))
        return wrong;
    if (source == destination && region.source_mip == region.destination_mip &&
        ranges_meet(region.source_layer, region.layer_count, region.destination_layer, region.layer_count))
        return problem(Rule::copy_overlap, attempted,
                       fmt::format("expected different mips or layers, found mip {} on both sides", region.source_mip),
                       "Copy through another texture.", fmt::format("texture '{}'", from->desc.name));
    return {};
}

Check CommandValidator::fill_buffer(Buffer buffer, std::uint64_t offset, std::uint64_t size) {
    const char* attempted = "fill buffer";
    const std::shared_lock lock(device_->tables_mutex);
    if (auto failed = outside(attempted)) return failed;
    Check failed;
    const BufferObject* object = look_up(buffer, attempted, "buffer", failed);
    if (!object) return failed;
    const std::string subject = fmt::format("buffer '{}'", object->desc.name);
    if (!has_all(object->desc.usage, BufferUsage::copy_destination))
        return problem(Rule::copy_usage, attempted,
                       fmt::format("expected usage copy_destination, found {}", text_of(object->desc.usage)),
                       "Add the usage where the buffer is created.", subject);
    if (offset > object->desc.size || (size != ~0ull && size > object->desc.size - offset))
        return problem(Rule::copy_range, attempted,
                       fmt::format("expected a range within {} bytes, found {} bytes from offset {}", object->desc.size,
                                   size, offset),
                       "Correct offset and size.", subject);
    if (offset % 4 != 0 || (size != ~0ull && size % 4 != 0))
        return problem(Rule::copy_alignment, attempted,
                       fmt::format("expected multiples of 4 bytes, found {} bytes from offset {}", size, offset),
                       "Align offset and size.", subject);
    return {};
}

Check CommandValidator::clear(const TextureView& view, bool depth) {
    const char* attempted = depth ? "clear depth and stencil" : "clear texture";
    const std::shared_lock lock(device_->tables_mutex);
    if (auto failed = outside(attempted)) return failed;
    Check failed;
    const TextureObject* texture = look_up(view.texture, attempted, "texture", failed);
    if (!texture) return failed;
    const TextureDesc& desc = texture->desc;
    const std::string subject = fmt::format("texture '{}'", desc.name);
    if (auto wrong = check_view(complete_view(view, desc), desc, capabilities(), attempted, place())) return wrong;
    if (!has_all(desc.usage, TextureUsage::copy_destination))
        return problem(Rule::copy_usage, attempted,
                       fmt::format("expected usage copy_destination, found {}", text_of(desc.usage)),
                       "Add the usage where the texture is created.", subject);
    const FormatInfo& format = info(desc.format);
    if (format.is_depth_stencil() != depth || format.is_compressed())
        return problem(Rule::copy_format, attempted,
                       fmt::format("expected a {} format, found {}", depth ? "depth" : "color", format.name),
                       "Use clear_texture for color and clear_depth_stencil for depth; compressed formats are written.",
                       subject);
    return {};
}

Check CommandValidator::generate_mips(Texture texture) {
    const char* attempted = "generate mips";
    const std::shared_lock lock(device_->tables_mutex);
    if (auto failed = outside(attempted)) return failed;
    Check failed;
    const TextureObject* object = look_up(texture, attempted, "texture", failed);
    if (!object) return failed;
    const TextureDesc& desc = object->desc;
    constexpr TextureUsage needed = TextureUsage::copy_destination;
    const FormatInfo& format = info(desc.format);
    const bool possible = has_all(desc.usage, needed) && desc.samples == 1 && !format.is_compressed() &&
                          !format.is_integer() && !format.is_depth_stencil() &&
                          capabilities().supports(desc.format, FormatSupport::filtered | FormatSupport::color_target);
    if (!possible)
        return problem(
            Rule::generate_mips, attempted,
            fmt::format("expected usage {} and a format that the device supports as filtered and color_target, "
                        "found usage {} and {}",
                        text_of(needed), text_of(desc.usage), format.name),
            "Add the usage, or make the mips by a pass or on the host.", fmt::format("texture '{}'", desc.name));
    return {};
}

}  // namespace nacre::rhi
