// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "backends/gl/buffer.h"
#include "backends/gl/texture.h"

/// @file
/// Copies, clears, resolves and mip generation. Worker thread only.
///
/// Desktop OpenGL copies every format between buffers and textures in its own layout. OpenGL ES reads only a few
/// layouts, so texels come back as integers or floats (drawn as such where the format cannot be attached to a
/// framebuffer) and are put together on the host. Uploads of d24_unorm_s8_uint and d32_float_s8_uint keep the stencil
/// on desktop and set it to 0 in OpenGL ES, which cannot read it; depth of 24 bits, read there as a float, may be off
/// by one step.

namespace nacre::gl {

class Transfer {
  public:
    explicit Transfer(Driver& driver) : driver_(driver), gl_(driver.gl) {}

    void copy_buffer(const rhi::CopyBufferCommand& command);
    void fill_buffer(const rhi::FillBufferCommand& command);
    void copy_buffer_to_texture(const rhi::CopyBufferToTextureCommand& command);
    void copy_texture_to_buffer(const rhi::CopyTextureToBufferCommand& command);
    void copy_texture(const rhi::CopyTextureCommand& command);
    void clear_texture(const rhi::ClearTextureCommand& command);
    void clear_depth_stencil(const rhi::ClearDepthStencilCommand& command);
    void generate_mips(GlTexture& texture);
    void resolve(const rhi::ViewReference& source, const rhi::ViewReference& destination, std::uint32_t width,
                 std::uint32_t height);
    void destroy();

  private:
    /// A box of texels of one mip and layer (of one mip of a 3D texture: several slices).
    struct Box {
        std::uint32_t mip = 0, layer = 0;
        rhi::Offset3D offset{};
        rhi::Extent3D extent{};
    };
    /// Bytes between rows and slices, in blocks.
    struct Pitch {
        std::uint32_t row_texels = 0, slice_rows = 0;
    };
    /// Uploads from `pixels` (an offset where an unpack buffer is bound).
    void upload(GlTexture& texture, const Box& box, const void* pixels, const Pitch& pitch);
    void upload_compressed(GlTexture& texture, const Box& box, std::uint64_t pixels, const Pitch& pitch);
    void upload_depth_stencil(GlTexture& texture, const Box& box, const rhi::CopyBufferToTextureCommand& command);
    /// Reads on desktop into the bound pack buffer at `pixels`, or to memory.
    void download(GlTexture& texture, const Box& box, void* pixels, std::uint64_t bytes, const Pitch& pitch,
                  GLenum format, GLenum type);
    /// Reads on any OpenGL into tight rows on the host, in the format's own layout.
    std::vector<std::byte> read(GlTexture& texture, const Box& box);
    void read_slice(GlTexture& texture, const Box& box, std::uint32_t slice, std::byte* destination);
    void read_slice_by_shader(GlTexture& texture, const Box& box, std::uint32_t slice, std::byte* destination);
    void read_slice_compressed(GlTexture& texture, const Box& box, std::uint32_t slice, std::byte* destination);
    GLuint fetch_program(GLenum target);
    void attach_read(GlTexture& texture, std::uint32_t mip, std::uint32_t layer, GLenum point);
    template <typename Visitor>
    void for_each_layer(const rhi::ViewReference& view, Visitor&& visit);

    Driver& driver_;
    const Functions& gl_;
    struct FetchProgram {
        GLenum target = 0;
        GLuint name = 0;
    };
    std::vector<FetchProgram> fetch_programs_;
    GLuint empty_vertex_array_ = 0;
};

}  // namespace nacre::gl
