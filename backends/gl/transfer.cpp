// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/transfer.h"

#include <algorithm>
#include <cstring>

#include "backends/gl/texels.h"

namespace nacre::gl {
namespace {

bool is_packed_depth_stencil(rhi::Format format) {
    return format == rhi::Format::d24_unorm_s8_uint || format == rhi::Format::d32_float_s8_uint;
}

GlTexture& texture_of(const rhi::TextureReference& reference) { return *static_cast<GlTexture*>(reference.object); }
GlBuffer& buffer_of(const rhi::BufferReference& reference) { return *static_cast<GlBuffer*>(reference.object); }

std::uint32_t mip_size(std::uint32_t size, std::uint32_t mip) { return std::max(1u, size >> mip); }

/// Third coordinate in calls that count layers, faces and slices as depth.
std::uint32_t first_slice(const GlTexture& texture, std::uint32_t layer, const rhi::Offset3D& offset) {
    return texture.target == GL_TEXTURE_3D ? offset.z : layer;
}

}  // namespace

void Transfer::copy_buffer(const rhi::CopyBufferCommand& command) {
    gl_.BindBuffer(GL_COPY_READ_BUFFER, buffer_of(command.source).name);
    gl_.BindBuffer(GL_COPY_WRITE_BUFFER, buffer_of(command.destination).name);
    gl_.CopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, static_cast<GLintptr>(command.source_offset),
                          static_cast<GLintptr>(command.destination_offset), static_cast<GLsizeiptr>(command.size));
}

void Transfer::fill_buffer(const rhi::FillBufferCommand& command) {
    gl_.BindBuffer(GL_COPY_WRITE_BUFFER, buffer_of(command.buffer).name);
    if (driver_.traits.desktop) {
        gl_.ClearBufferSubData(GL_COPY_WRITE_BUFFER, GL_R32UI, static_cast<GLintptr>(command.offset),
                               static_cast<GLsizeiptr>(command.size), GL_RED_INTEGER, GL_UNSIGNED_INT, &command.value);
        return;
    }
    const std::vector<std::uint32_t> pattern(std::min<std::uint64_t>(command.size / 4, 65536), command.value);
    for (std::uint64_t done = 0; done < command.size;) {
        const std::uint64_t bytes = std::min<std::uint64_t>(pattern.size() * 4, command.size - done);
        gl_.BufferSubData(GL_COPY_WRITE_BUFFER, static_cast<GLintptr>(command.offset + done),
                          static_cast<GLsizeiptr>(bytes), pattern.data());
        done += bytes;
    }
}

void Transfer::copy_buffer_to_texture(const rhi::CopyBufferToTextureCommand& command) {
    GlTexture& texture = texture_of(command.destination);
    const rhi::BufferTextureCopy& region = command.region;
    const rhi::FormatInfo& facts = rhi::info(texture.desc.format);
    const Box box{region.mip, region.layer, region.offset, region.extent};
    const Pitch pitch{region.bytes_per_row / facts.block_bytes * facts.block_width,
                      region.rows_per_slice * facts.block_width};
    if (is_packed_depth_stencil(texture.desc.format)) {
        upload_depth_stencil(texture, box, command);
        return;
    }
    gl_.BindBuffer(GL_PIXEL_UNPACK_BUFFER, buffer_of(command.source).name);
    if (facts.is_compressed())
        upload_compressed(texture, box, region.buffer_offset, pitch);
    else
        upload(texture, box, reinterpret_cast<const void*>(region.buffer_offset), pitch);
    gl_.BindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
}

void Transfer::upload(GlTexture& texture, const Box& box, const void* pixels, const Pitch& pitch) {
    const GlFormat& format = gl_format(texture.desc.format);
    driver_.bind_scratch_texture(texture.target, texture.name);
    gl_.PixelStorei(GL_UNPACK_ROW_LENGTH, static_cast<GLint>(pitch.row_texels));
    gl_.PixelStorei(GL_UNPACK_IMAGE_HEIGHT, static_cast<GLint>(pitch.slice_rows));
    const auto mip = static_cast<GLint>(box.mip), x = static_cast<GLint>(box.offset.x);
    const auto y = static_cast<GLint>(box.offset.y), width = static_cast<GLsizei>(box.extent.width);
    const auto height = static_cast<GLsizei>(box.extent.height), layer = static_cast<GLint>(box.layer);
    switch (texture.target) {
        case GL_TEXTURE_1D:
            gl_.TexSubImage1D(texture.target, mip, x, width, format.external, format.type, pixels);
            break;
        case GL_TEXTURE_1D_ARRAY:
            gl_.TexSubImage2D(texture.target, mip, x, layer, width, 1, format.external, format.type, pixels);
            break;
        case GL_TEXTURE_2D:
            gl_.TexSubImage2D(texture.target, mip, x, y, width, height, format.external, format.type, pixels);
            break;
        case GL_TEXTURE_CUBE_MAP:
            gl_.TexSubImage2D(GL_TEXTURE_CUBE_MAP_POSITIVE_X + box.layer, mip, x, y, width, height, format.external,
                              format.type, pixels);
            break;
        case GL_TEXTURE_3D:
            gl_.TexSubImage3D(texture.target, mip, x, y, static_cast<GLint>(box.offset.z), width, height,
                              static_cast<GLsizei>(box.extent.depth), format.external, format.type, pixels);
            break;
        default:
            gl_.TexSubImage3D(texture.target, mip, x, y, layer, width, height, 1, format.external, format.type, pixels);
            break;
    }
    gl_.PixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    gl_.PixelStorei(GL_UNPACK_IMAGE_HEIGHT, 0);
}

void Transfer::upload_compressed(GlTexture& texture, const Box& box, std::uint64_t pixels, const Pitch& pitch) {
    const rhi::FormatInfo& facts = rhi::info(texture.desc.format);
    const GLenum internal = gl_format(texture.desc.format).internal;
    driver_.bind_scratch_texture(texture.target, texture.name);
    const std::uint64_t row_bytes = std::uint64_t{pitch.row_texels} / 4 * facts.block_bytes;
    const std::uint64_t slice_bytes = row_bytes * (pitch.slice_rows / 4);
    const std::uint32_t columns = (box.extent.width + 3) / 4, rows = (box.extent.height + 3) / 4;
    const auto row_size = static_cast<GLsizei>(columns * facts.block_bytes);
    const auto mip = static_cast<GLint>(box.mip), x = static_cast<GLint>(box.offset.x);
    // A row of blocks at a time where rows are padded: OpenGL ES has no pitch for compressed texels.
    const bool tight = row_bytes == columns * facts.block_bytes;
    const std::uint32_t rows_at_once = tight ? rows : 1;
    for (std::uint32_t slice = 0; slice < box.extent.depth; ++slice)
        for (std::uint32_t row = 0; row < rows; row += rows_at_once) {
            const void* source = reinterpret_cast<const void*>(pixels + slice * slice_bytes + row * row_bytes);
            const auto y = static_cast<GLint>(box.offset.y + row * 4);
            const auto height = static_cast<GLsizei>(std::min(rows_at_once * 4, box.extent.height - row * 4));
            const auto width = static_cast<GLsizei>(box.extent.width);
            const auto size = row_size * static_cast<GLsizei>(rows_at_once);
            if (texture.target == GL_TEXTURE_2D)
                gl_.CompressedTexSubImage2D(texture.target, mip, x, y, width, height, internal, size, source);
            else if (texture.target == GL_TEXTURE_CUBE_MAP)
                gl_.CompressedTexSubImage2D(GL_TEXTURE_CUBE_MAP_POSITIVE_X + box.layer, mip, x, y, width, height,
                                            internal, size, source);
            else
                gl_.CompressedTexSubImage3D(texture.target, mip, x, y,
                                            static_cast<GLint>(first_slice(texture, box.layer, box.offset) + slice),
                                            width, height, 1, internal, size, source);
        }
}

void Transfer::upload_depth_stencil(GlTexture& texture, const Box& box,
                                    const rhi::CopyBufferToTextureCommand& command) {
    const bool d24 = texture.desc.format == rhi::Format::d24_unorm_s8_uint;
    const std::size_t texel_bytes = d24 ? 4 : 8;
    const std::size_t width = box.extent.width, height = box.extent.height;
    std::vector<std::byte> texels(width * height * texel_bytes);
    const Pitch tight{box.extent.width, box.extent.height};
    if (driver_.traits.desktop)
        download(texture, box, texels.data(), texels.size(), tight, gl_format(texture.desc.format).external,
                 gl_format(texture.desc.format).type);
    GlBuffer& buffer = buffer_of(command.source);
    gl_.BindBuffer(GL_COPY_READ_BUFFER, buffer.name);
    const std::uint64_t bytes = std::uint64_t{command.region.bytes_per_row} * (height - 1) + width * 4;
    // A buffer that is mapped for its whole life cannot be mapped again.
    const std::byte* source =
        buffer.mapped ? buffer.mapped + command.region.buffer_offset
                      : static_cast<const std::byte*>(gl_.MapBufferRange(
                            GL_COPY_READ_BUFFER, static_cast<GLintptr>(command.region.buffer_offset),
                            static_cast<GLsizeiptr>(bytes), GL_MAP_READ_BIT));
    if (!source) return;
    for (std::size_t y = 0; y < height; ++y)
        for (std::size_t x = 0; x < width; ++x) {
            std::uint32_t depth = 0;
            std::memcpy(&depth, source + y * command.region.bytes_per_row + x * 4, 4);
            std::byte* texel = texels.data() + (y * width + x) * texel_bytes;
            if (d24) {
                std::uint32_t packed = 0;
                std::memcpy(&packed, texel, 4);
                packed = depth << 8 | (packed & 0xff);
                std::memcpy(texel, &packed, 4);
            } else {
                std::memcpy(texel, &depth, 4);
            }
        }
    if (!buffer.mapped) gl_.UnmapBuffer(GL_COPY_READ_BUFFER);
    upload(texture, box, texels.data(), tight);
}

void Transfer::download(GlTexture& texture, const Box& box, void* pixels, std::uint64_t bytes, const Pitch& pitch,
                        GLenum format, GLenum type) {
    gl_.PixelStorei(GL_PACK_ROW_LENGTH, static_cast<GLint>(pitch.row_texels));
    gl_.PixelStorei(GL_PACK_IMAGE_HEIGHT, static_cast<GLint>(pitch.slice_rows));
    const bool rows_are_layers = texture.target == GL_TEXTURE_1D_ARRAY;
    const auto y = static_cast<GLint>(rows_are_layers ? box.layer : box.offset.y);
    const auto z = static_cast<GLint>(rows_are_layers ? 0 : first_slice(texture, box.layer, box.offset));
    const auto size = static_cast<GLsizei>(std::min<std::uint64_t>(bytes, 0x7fffffff));
    gl_.GetTextureSubImage(texture.name, static_cast<GLint>(box.mip), static_cast<GLint>(box.offset.x), y, z,
                           static_cast<GLsizei>(box.extent.width), static_cast<GLsizei>(box.extent.height),
                           static_cast<GLsizei>(box.extent.depth), format, type, size, pixels);
    gl_.PixelStorei(GL_PACK_ROW_LENGTH, 0);
    gl_.PixelStorei(GL_PACK_IMAGE_HEIGHT, 0);
}

void Transfer::copy_texture_to_buffer(const rhi::CopyTextureToBufferCommand& command) {
    GlTexture& texture = texture_of(command.source);
    GlBuffer& buffer = buffer_of(command.destination);
    const rhi::BufferTextureCopy& region = command.region;
    const rhi::FormatInfo& facts = rhi::info(texture.desc.format);
    const Box box{region.mip, region.layer, region.offset, region.extent};
    const bool direct =
        driver_.traits.desktop && !facts.is_compressed() && !is_packed_depth_stencil(texture.desc.format);
    if (direct) {
        const GlFormat& format = gl_format(texture.desc.format);
        gl_.BindBuffer(GL_PIXEL_PACK_BUFFER, buffer.name);
        download(texture, box, reinterpret_cast<void*>(region.buffer_offset), buffer.desc.size - region.buffer_offset,
                 {region.bytes_per_row / facts.block_bytes, region.rows_per_slice}, format.external, format.type);
        gl_.BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
        return;
    }
    const std::vector<std::byte> texels = read(texture, box);
    const std::uint32_t edge = facts.block_width;
    const std::uint64_t row_bytes = std::uint64_t{(box.extent.width + edge - 1) / edge} * facts.block_bytes;
    const std::uint32_t rows = (box.extent.height + edge - 1) / edge;
    gl_.BindBuffer(GL_COPY_WRITE_BUFFER, buffer.name);
    if (row_bytes == region.bytes_per_row && (rows == region.rows_per_slice || box.extent.depth == 1)) {
        gl_.BufferSubData(GL_COPY_WRITE_BUFFER, static_cast<GLintptr>(region.buffer_offset),
                          static_cast<GLsizeiptr>(texels.size()), texels.data());
        return;
    }
    const std::byte* source = texels.data();
    for (std::uint32_t slice = 0; slice < box.extent.depth; ++slice)
        for (std::uint32_t row = 0; row < rows; ++row, source += row_bytes) {
            const std::uint64_t at = region.buffer_offset + (std::uint64_t{slice} * region.rows_per_slice + row) *
                                                                region.bytes_per_row;
            gl_.BufferSubData(GL_COPY_WRITE_BUFFER, static_cast<GLintptr>(at), static_cast<GLsizeiptr>(row_bytes),
                              source);
        }
}

std::vector<std::byte> Transfer::read(GlTexture& texture, const Box& box) {
    const rhi::FormatInfo& facts = rhi::info(texture.desc.format);
    const std::uint32_t edge = facts.block_width;
    const std::size_t slice_bytes = std::size_t{(box.extent.width + edge - 1) / edge} *
                                    ((box.extent.height + edge - 1) / edge) * facts.block_bytes;
    std::vector<std::byte> texels(slice_bytes * box.extent.depth);
    if (driver_.traits.desktop && facts.is_compressed()) {
        gl_.GetCompressedTextureSubImage(
            texture.name, static_cast<GLint>(box.mip), static_cast<GLint>(box.offset.x),
            static_cast<GLint>(box.offset.y), static_cast<GLint>(first_slice(texture, box.layer, box.offset)),
            static_cast<GLsizei>(box.extent.width), static_cast<GLsizei>(box.extent.height),
            static_cast<GLsizei>(box.extent.depth), static_cast<GLsizei>(texels.size()), texels.data());
        return texels;
    }
    if (driver_.traits.desktop && is_packed_depth_stencil(texture.desc.format)) {
        // The depth of 24 bits arrives in the upper bits, above the stencil; 32-bit depth is followed by the stencil.
        const bool d24 = texture.desc.format == rhi::Format::d24_unorm_s8_uint;
        std::vector<std::uint32_t> packed(texels.size() / 4 * (d24 ? 1 : 2));
        download(texture, box, packed.data(), packed.size() * 4, {box.extent.width, box.extent.height},
                 gl_format(texture.desc.format).external, gl_format(texture.desc.format).type);
        for (std::size_t i = 0; i < texels.size() / 4; ++i) {
            const std::uint32_t depth = d24 ? packed[i] >> 8 : packed[i * 2];
            std::memcpy(texels.data() + i * 4, &depth, 4);
        }
        return texels;
    }
    if (driver_.traits.desktop) {
        const GlFormat& format = gl_format(texture.desc.format);
        download(texture, box, texels.data(), texels.size(), {box.extent.width, box.extent.height}, format.external,
                 format.type);
        return texels;
    }
    for (std::uint32_t slice = 0; slice < box.extent.depth; ++slice)
        read_slice(texture, box, slice, texels.data() + slice * slice_bytes);
    return texels;
}

void Transfer::copy_texture(const rhi::CopyTextureCommand& command) {
    GlTexture& source = texture_of(command.source);
    GlTexture& destination = texture_of(command.destination);
    const rhi::TextureCopy& region = command.region;
    const rhi::Extent3D& extent = region.extent;
    const std::uint32_t source_z = first_slice(source, region.source_layer, region.source_offset);
    const std::uint32_t destination_z = first_slice(destination, region.destination_layer, region.destination_offset);
    const std::uint32_t depth = std::max(extent.depth, region.layer_count);
    // Copying 1D arrays counts layers as rows in some drivers and as slices in others: the host copies those.
    const bool by_host = !driver_.traits.copy_image || source.target == GL_TEXTURE_1D_ARRAY ||
                         destination.target == GL_TEXTURE_1D_ARRAY;
    if (!by_host) {
        gl_.CopyImageSubData(source.name, source.target, static_cast<GLint>(region.source_mip),
                             static_cast<GLint>(region.source_offset.x), static_cast<GLint>(region.source_offset.y),
                             static_cast<GLint>(source_z), destination.name, destination.target,
                             static_cast<GLint>(region.destination_mip),
                             static_cast<GLint>(region.destination_offset.x),
                             static_cast<GLint>(region.destination_offset.y), static_cast<GLint>(destination_z),
                             static_cast<GLsizei>(extent.width), static_cast<GLsizei>(extent.height),
                             static_cast<GLsizei>(depth));
        return;
    }
    for (std::uint32_t layer = 0; layer < region.layer_count; ++layer) {
        const Box from{region.source_mip, region.source_layer + layer, region.source_offset, extent};
        const Box to{region.destination_mip, region.destination_layer + layer, region.destination_offset, extent};
        const std::vector<std::byte> texels = read(source, from);
        if (is_packed_depth_stencil(destination.desc.format)) {
            // Read as depth alone; OpenGL ES has no way to read the stencil.
            std::vector<std::uint32_t> packed;
            for (std::size_t i = 0; i < texels.size() / 4; ++i) {
                std::uint32_t bits = 0;
                std::memcpy(&bits, texels.data() + i * 4, 4);
                if (destination.desc.format == rhi::Format::d24_unorm_s8_uint) {
                    packed.push_back(bits << 8);
                } else {
                    packed.push_back(bits);
                    packed.push_back(0);
                }
            }
            upload(destination, to, packed.data(), {extent.width, extent.height});
        } else {
            upload(destination, to, texels.data(), {extent.width, extent.height});
        }
    }
}

template <typename Visitor>
void Transfer::for_each_layer(const rhi::ViewReference& view, Visitor&& visit) {
    const GlTexture& texture = texture_of(view.texture);
    for (std::uint32_t mip = view.base_mip; mip < view.base_mip + view.mip_count; ++mip) {
        const bool volume = texture.target == GL_TEXTURE_3D;
        const std::uint32_t first = volume ? 0 : view.base_layer;
        const std::uint32_t count = volume ? mip_size(texture.desc.depth, mip) : view.layer_count;
        for (std::uint32_t layer = first; layer < first + count; ++layer) visit(mip, layer);
    }
}

void Transfer::clear_texture(const rhi::ClearTextureCommand& command) {
    GlTexture& texture = texture_of(command.view.texture);
    const rhi::Format format = command.view.format;
    const rhi::FormatSupport support = format_support(gl_, driver_.traits, format);
    if (has_all(support, rhi::FormatSupport::color_target)) {
        driver_.bind_draw_framebuffer(driver_.scratch_framebuffers[1]);
        driver_.open_masks();
        for_each_layer(command.view, [&](std::uint32_t mip, std::uint32_t layer) {
            driver_.attach(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, texture.attachment(mip, layer, format));
            driver_.clear_color(0, format, command.color);
        });
        driver_.attach(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, {});
        return;
    }
    std::array<std::byte, 16> texel{};
    pack_texel(format, clear_texel(format, command.color), texel.data());
    const std::size_t texel_bytes = rhi::info(format).block_bytes;
    for_each_layer(command.view, [&](std::uint32_t mip, std::uint32_t layer) {
        const std::uint32_t width = mip_size(texture.desc.width, mip), height = mip_size(texture.desc.height, mip);
        std::vector<std::byte> row(std::size_t{width} * height * texel_bytes);
        for (std::size_t at = 0; at < row.size(); at += texel_bytes)
            std::memcpy(row.data() + at, texel.data(), texel_bytes);
        const bool volume = texture.target == GL_TEXTURE_3D;
        const Box box{mip, volume ? 0 : layer, {0, 0, volume ? layer : 0}, {width, height, 1}};
        upload(texture, box, row.data(), {width, height});
    });
}

void Transfer::clear_depth_stencil(const rhi::ClearDepthStencilCommand& command) {
    GlTexture& texture = texture_of(command.view.texture);
    const bool has_stencil = rhi::info(texture.desc.format).has_stencil;
    const GLenum point = has_stencil ? GL_DEPTH_STENCIL_ATTACHMENT : GL_DEPTH_ATTACHMENT;
    driver_.bind_draw_framebuffer(driver_.scratch_framebuffers[1]);
    driver_.open_masks();
    for_each_layer(command.view, [&](std::uint32_t mip, std::uint32_t layer) {
        driver_.attach(GL_DRAW_FRAMEBUFFER, point, texture.attachment(mip, layer, texture.desc.format));
        if (has_stencil)
            gl_.ClearBufferfi(GL_DEPTH_STENCIL, 0, command.depth, command.stencil);
        else
            gl_.ClearBufferfv(GL_DEPTH, 0, &command.depth);
    });
    driver_.attach(GL_DRAW_FRAMEBUFFER, point, {});
}

void Transfer::generate_mips(GlTexture& texture) {
    texture.show_all_mips();
    driver_.bind_scratch_texture(texture.target, texture.name);
    gl_.GenerateMipmap(texture.target);
}

void Transfer::resolve(const rhi::ViewReference& source, const rhi::ViewReference& destination, std::uint32_t width,
                       std::uint32_t height) {
    const auto right = static_cast<GLint>(width), bottom = static_cast<GLint>(height);
    gl_.BindFramebuffer(GL_READ_FRAMEBUFFER, driver_.scratch_framebuffers[0]);
    driver_.attach(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0,
                   texture_of(source.texture).attachment(source.base_mip, source.base_layer, source.format));
    gl_.ReadBuffer(GL_COLOR_ATTACHMENT0);
    driver_.bind_draw_framebuffer(driver_.scratch_framebuffers[1]);
    driver_.attach(
        GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0,
        texture_of(destination.texture).attachment(destination.base_mip, destination.base_layer, destination.format));
    driver_.open_masks();
    gl_.BlitFramebuffer(0, 0, right, bottom, 0, 0, right, bottom, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    driver_.attach(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, {});
    driver_.attach(GL_DRAW_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, {});
}

void Transfer::destroy() {
    for (const FetchProgram& program : fetch_programs_) gl_.DeleteProgram(program.name);
    if (empty_vertex_array_) gl_.DeleteVertexArrays(1, &empty_vertex_array_);
}

}  // namespace nacre::gl
