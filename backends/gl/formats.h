// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/gl/traits.h"
#include "rhi/format.h"
#include "rhi/pipeline.h"
#include "rhi/resources.h"

/// @file
/// Formats, and the other enumerations of the RHI, in OpenGL's words.

namespace nacre::gl {

/// How OpenGL names a format and the layout of its texels in buffers.
struct GlFormat {
    GLenum internal = 0;  ///< 0: OpenGL has no such texture format.
    GLenum external = 0;  ///< `format` of transfers, e.g. GL_RGBA_INTEGER.
    GLenum type = 0;      ///< `type` of transfers.
};
const GlFormat& gl_format(rhi::Format format);

/// What textures and vertices of a format can do in this context; `vertex` included.
rhi::FormatSupport format_support(const Functions& gl, const Traits& traits, rhi::Format format);

/// Formats of storage images that OpenGL ES 3.1 has without extensions (OpenGL ES 3.1, table 8.27).
bool is_es_image_format(rhi::Format format);

/// How attributes are read from memory.
struct GlVertexFormat {
    GLenum type = 0;
    GLint size = 0;
    GLboolean normalized = GL_FALSE;
    bool integer = false;
};
GlVertexFormat vertex_format(rhi::Format format);

/// Target of a texture, or of a view of that dimension (`multisampled` for 4 samples).
GLenum texture_target(const rhi::TextureDesc& desc, const Traits& traits);
GLenum view_target(rhi::ViewDimension dimension, bool multisampled, const Traits& traits);

GLenum gl_compare(rhi::CompareOperation operation);
GLenum gl_stencil_operation(rhi::StencilOperation operation);
GLenum gl_blend_factor(rhi::BlendFactor factor);
GLenum gl_blend_operation(rhi::BlendOperation operation);
GLenum gl_topology(rhi::Topology topology);

}  // namespace nacre::gl
