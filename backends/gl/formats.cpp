// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/formats.h"

#include <array>

namespace nacre::gl {
namespace {

using rhi::Format;
using rhi::FormatSupport;

// From extensions that glcorearb.h leaves out.
constexpr GLenum srgb_alpha_s3tc_dxt1 = 0x8C4D, srgb_alpha_s3tc_dxt3 = 0x8C4E, srgb_alpha_s3tc_dxt5 = 0x8C4F;

// In the order of rhi::Format. OpenGL has no BGRA storage: a view or an image of it would see other channels than on
// the other backends, so those two formats are not offered at all.
constexpr std::array<GlFormat, rhi::format_count> table{{
    {},
    {GL_R8, GL_RED, GL_UNSIGNED_BYTE},
    {GL_R8_SNORM, GL_RED, GL_BYTE},
    {GL_R8UI, GL_RED_INTEGER, GL_UNSIGNED_BYTE},
    {GL_R8I, GL_RED_INTEGER, GL_BYTE},
    {GL_RG8, GL_RG, GL_UNSIGNED_BYTE},
    {GL_RG8_SNORM, GL_RG, GL_BYTE},
    {GL_RG8UI, GL_RG_INTEGER, GL_UNSIGNED_BYTE},
    {GL_RG8I, GL_RG_INTEGER, GL_BYTE},
    {GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE},
    {GL_SRGB8_ALPHA8, GL_RGBA, GL_UNSIGNED_BYTE},
    {GL_RGBA8_SNORM, GL_RGBA, GL_BYTE},
    {GL_RGBA8UI, GL_RGBA_INTEGER, GL_UNSIGNED_BYTE},
    {GL_RGBA8I, GL_RGBA_INTEGER, GL_BYTE},
    {},
    {},
    {GL_R16, GL_RED, GL_UNSIGNED_SHORT},
    {GL_R16_SNORM, GL_RED, GL_SHORT},
    {GL_R16UI, GL_RED_INTEGER, GL_UNSIGNED_SHORT},
    {GL_R16I, GL_RED_INTEGER, GL_SHORT},
    {GL_R16F, GL_RED, GL_HALF_FLOAT},
    {GL_RG16, GL_RG, GL_UNSIGNED_SHORT},
    {GL_RG16_SNORM, GL_RG, GL_SHORT},
    {GL_RG16UI, GL_RG_INTEGER, GL_UNSIGNED_SHORT},
    {GL_RG16I, GL_RG_INTEGER, GL_SHORT},
    {GL_RG16F, GL_RG, GL_HALF_FLOAT},
    {GL_RGBA16, GL_RGBA, GL_UNSIGNED_SHORT},
    {GL_RGBA16_SNORM, GL_RGBA, GL_SHORT},
    {GL_RGBA16UI, GL_RGBA_INTEGER, GL_UNSIGNED_SHORT},
    {GL_RGBA16I, GL_RGBA_INTEGER, GL_SHORT},
    {GL_RGBA16F, GL_RGBA, GL_HALF_FLOAT},
    {GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT},
    {GL_R32I, GL_RED_INTEGER, GL_INT},
    {GL_R32F, GL_RED, GL_FLOAT},
    {GL_RG32UI, GL_RG_INTEGER, GL_UNSIGNED_INT},
    {GL_RG32I, GL_RG_INTEGER, GL_INT},
    {GL_RG32F, GL_RG, GL_FLOAT},
    {},
    {},
    {},
    {GL_RGBA32UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT},
    {GL_RGBA32I, GL_RGBA_INTEGER, GL_INT},
    {GL_RGBA32F, GL_RGBA, GL_FLOAT},
    {GL_RGB10_A2, GL_RGBA, GL_UNSIGNED_INT_2_10_10_10_REV},
    {GL_RGB10_A2UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT_2_10_10_10_REV},
    {GL_R11F_G11F_B10F, GL_RGB, GL_UNSIGNED_INT_10F_11F_11F_REV},
    {GL_RGB9_E5, GL_RGB, GL_UNSIGNED_INT_5_9_9_9_REV},
    {GL_DEPTH_COMPONENT16, GL_DEPTH_COMPONENT, GL_UNSIGNED_SHORT},
    {GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT},
    {GL_DEPTH24_STENCIL8, GL_DEPTH_STENCIL, GL_UNSIGNED_INT_24_8},
    {GL_DEPTH32F_STENCIL8, GL_DEPTH_STENCIL, GL_FLOAT_32_UNSIGNED_INT_24_8_REV},
    {GL_COMPRESSED_RGBA_S3TC_DXT1_EXT, 0, 0},
    {srgb_alpha_s3tc_dxt1, 0, 0},
    {GL_COMPRESSED_RGBA_S3TC_DXT3_EXT, 0, 0},
    {srgb_alpha_s3tc_dxt3, 0, 0},
    {GL_COMPRESSED_RGBA_S3TC_DXT5_EXT, 0, 0},
    {srgb_alpha_s3tc_dxt5, 0, 0},
    {GL_COMPRESSED_RED_RGTC1, 0, 0},
    {GL_COMPRESSED_SIGNED_RED_RGTC1, 0, 0},
    {GL_COMPRESSED_RG_RGTC2, 0, 0},
    {GL_COMPRESSED_SIGNED_RG_RGTC2, 0, 0},
    {GL_COMPRESSED_RGB_BPTC_UNSIGNED_FLOAT, 0, 0},
    {GL_COMPRESSED_RGB_BPTC_SIGNED_FLOAT, 0, 0},
    {GL_COMPRESSED_RGBA_BPTC_UNORM, 0, 0},
    {GL_COMPRESSED_SRGB_ALPHA_BPTC_UNORM, 0, 0},
}};

bool is_16bit_normalized(Format format) {
    switch (format) {
        case Format::r16_unorm: case Format::r16_snorm: case Format::rg16_unorm: case Format::rg16_snorm:
        case Format::rgba16_unorm: case Format::rgba16_snorm: return true;
        default: return false;
    }
}

bool is_32bit_float(Format format) {
    return format == Format::r32_float || format == Format::rg32_float || format == Format::rgba32_float;
}
bool is_16bit_float(Format format) {
    return format == Format::r16_float || format == Format::rg16_float || format == Format::rgba16_float;
}

// OpenGL 4.5, table 8.26, without those of OpenGL ES.
bool is_desktop_image_format(Format format) {
    switch (format) {
        case Format::rg32_float: case Format::rg16_float: case Format::rg11b10_float: case Format::r16_float:
        case Format::rgba16_unorm: case Format::rgb10a2_unorm: case Format::rg16_unorm: case Format::rg8_unorm:
        case Format::r16_unorm: case Format::r8_unorm: case Format::rgba16_snorm: case Format::rg16_snorm:
        case Format::rg8_snorm: case Format::r16_snorm: case Format::r8_snorm: case Format::rgb10a2_uint:
        case Format::rg32_uint: case Format::rg16_uint: case Format::rg8_uint: case Format::r16_uint:
        case Format::r8_uint: case Format::rg32_sint: case Format::rg16_sint: case Format::rg8_sint:
        case Format::r16_sint: case Format::r8_sint: return true;
        default: return false;
    }
}

bool exists(const Traits& traits, Format format) {
    if (table[static_cast<std::uint32_t>(format)].internal == 0) return false;
    if (is_16bit_normalized(format)) return traits.unorm16;
    switch (format) {
        case Format::bc1_rgba_unorm: case Format::bc2_rgba_unorm: case Format::bc3_rgba_unorm: return traits.s3tc;
        case Format::bc1_rgba_srgb: case Format::bc2_rgba_srgb: case Format::bc3_rgba_srgb: return traits.s3tc_srgb;
        case Format::bc4_r_unorm: case Format::bc4_r_snorm: case Format::bc5_rg_unorm: case Format::bc5_rg_snorm:
            return traits.rgtc;
        case Format::bc6h_rgb_ufloat: case Format::bc6h_rgb_sfloat: case Format::bc7_rgba_unorm:
        case Format::bc7_rgba_srgb: return traits.bptc;
        default: return true;
    }
}

// OpenGL 4.5, table 8.12; OpenGL ES 3.1, table 8.13.
bool is_color_renderable(const Traits& traits, Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    if (facts.is_compressed() || facts.is_depth_stencil() || format == Format::rgb9e5_float) return false;
    if (facts.kind == rhi::FormatKind::snorm) return traits.snorm_targets;
    if (format == Format::rg11b10_float) return traits.float_targets;
    if (is_16bit_float(format)) return traits.half_float_targets;
    if (is_32bit_float(format)) return traits.float_targets;
    return true;
}

/// Formats of buffer textures (OpenGL 4.5, table 8.16; OpenGL ES 3.2, table 8.18).
bool is_buffer_format(const Traits& traits, Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    if (facts.is_compressed() || facts.is_depth_stencil() || facts.kind == rhi::FormatKind::snorm ||
        facts.kind == rhi::FormatKind::srgb || facts.block_bytes == 12)
        return false;
    switch (format) {
        case Format::bgra8_unorm:
        case Format::rgb10a2_unorm:
        case Format::rgb10a2_uint:
        case Format::rg11b10_float:
        case Format::rgb9e5_float: return false;
        case Format::r16_unorm:
        case Format::rg16_unorm:
        case Format::rgba16_unorm: return traits.desktop;
        default: return true;
    }
}

}  // namespace

bool is_es_image_format(Format format) {
    switch (format) {
        case Format::rgba32_float: case Format::rgba16_float: case Format::r32_float: case Format::rgba32_uint:
        case Format::rgba16_uint: case Format::rgba8_uint: case Format::r32_uint: case Format::rgba32_sint:
        case Format::rgba16_sint: case Format::rgba8_sint: case Format::r32_sint: case Format::rgba8_unorm:
        case Format::rgba8_snorm: return true;
        default: return false;
    }
}

const GlFormat& gl_format(Format format) { return table[static_cast<std::uint32_t>(format)]; }

FormatSupport format_support(const Functions& gl, const Traits& traits, Format format) {
    FormatSupport support = FormatSupport::none;
    if (vertex_format(format).type != 0) support |= FormatSupport::vertex;
    if (!exists(traits, format)) return support;
    const rhi::FormatInfo& facts = rhi::info(format);
    support |= FormatSupport::sampled;
    const bool filtered = !facts.is_integer() && (!is_32bit_float(format) || traits.float_filter) &&
                          (!facts.is_depth_stencil() || traits.desktop);
    if (filtered) support |= FormatSupport::filtered;
    if (facts.is_depth_stencil()) support |= FormatSupport::depth_target;
    if (is_color_renderable(traits, format)) {
        support |= FormatSupport::color_target;
        if (!facts.is_integer() && (!is_32bit_float(format) || traits.float_blend)) support |= FormatSupport::blended;
    }
    if (is_es_image_format(format) || (traits.image_formats && is_desktop_image_format(format))) {
        support |= FormatSupport::storage_image;
        if (traits.image_atomics && (format == Format::r32_uint || format == Format::r32_sint))
            support |= FormatSupport::storage_atomic;
    }
    if (traits.buffer_textures && is_buffer_format(traits, format)) {
        support |= FormatSupport::uniform_texel_buffer;
        if (has_all(support, FormatSupport::storage_image)) support |= FormatSupport::storage_texel_buffer;
        if (has_all(support, FormatSupport::storage_atomic)) support |= FormatSupport::storage_texel_buffer_atomic;
    }
    if (facts.is_depth_stencil() || is_color_renderable(traits, format)) {
        std::array<GLint, 16> counts{};
        GLint number = 0;
        gl.GetInternalformativ(GL_TEXTURE_2D_MULTISAMPLE, gl_format(format).internal, GL_NUM_SAMPLE_COUNTS, 1, &number);
        if (number > static_cast<GLint>(counts.size())) number = static_cast<GLint>(counts.size());
        if (number > 0)
            gl.GetInternalformativ(GL_TEXTURE_2D_MULTISAMPLE, gl_format(format).internal, GL_SAMPLES, number,
                                   counts.data());
        for (GLint i = 0; i < number; ++i)
            if (counts[static_cast<std::size_t>(i)] == 4) support |= FormatSupport::multisampled;
    }
    return support;
}

GlVertexFormat vertex_format(Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    if (facts.is_compressed() || facts.is_depth_stencil() || facts.kind == rhi::FormatKind::srgb) return {};
    GlVertexFormat result;
    result.size = facts.channels;
    result.integer = facts.is_integer();
    result.normalized = facts.kind == rhi::FormatKind::unorm || facts.kind == rhi::FormatKind::snorm;
    switch (format) {
        case Format::undefined: case Format::bgra8_unorm: case Format::rgb9e5_float: case Format::rg11b10_float:
        case Format::rgb10a2_uint: return {};
        case Format::rgb10a2_unorm: result.type = GL_UNSIGNED_INT_2_10_10_10_REV; return result;
        default: break;
    }
    const bool is_signed = facts.kind == rhi::FormatKind::snorm || facts.kind == rhi::FormatKind::sint;
    switch (facts.block_bytes / facts.channels) {
        case 1: result.type = is_signed ? GL_BYTE : GL_UNSIGNED_BYTE; break;
        case 2:
            result.type = facts.kind == rhi::FormatKind::floating ? GL_HALF_FLOAT
                          : is_signed                             ? GL_SHORT
                                                                  : GL_UNSIGNED_SHORT;
            break;
        default:
            result.type = facts.kind == rhi::FormatKind::floating ? GL_FLOAT : is_signed ? GL_INT : GL_UNSIGNED_INT;
            break;
    }
    return result;
}

GLenum texture_target(const rhi::TextureDesc& desc, const Traits& traits) {
    switch (desc.dimension) {
        case rhi::TextureDimension::d1:
            if (traits.es) return desc.layers > 1 ? GL_TEXTURE_2D_ARRAY : GL_TEXTURE_2D;
            return desc.layers > 1 ? GL_TEXTURE_1D_ARRAY : GL_TEXTURE_1D;
        case rhi::TextureDimension::d2:
            if (desc.samples > 1) return desc.layers > 1 ? GL_TEXTURE_2D_MULTISAMPLE_ARRAY : GL_TEXTURE_2D_MULTISAMPLE;
            return desc.layers > 1 ? GL_TEXTURE_2D_ARRAY : GL_TEXTURE_2D;
        case rhi::TextureDimension::d3: return GL_TEXTURE_3D;
        case rhi::TextureDimension::cube: return desc.layers > 6 ? GL_TEXTURE_CUBE_MAP_ARRAY : GL_TEXTURE_CUBE_MAP;
    }
    return GL_TEXTURE_2D;
}

GLenum view_target(rhi::ViewDimension dimension, bool multisampled, const Traits& traits) {
    switch (dimension) {
        case rhi::ViewDimension::d1: return traits.es ? GL_TEXTURE_2D : GL_TEXTURE_1D;
        case rhi::ViewDimension::d1_array: return traits.es ? GL_TEXTURE_2D_ARRAY : GL_TEXTURE_1D_ARRAY;
        case rhi::ViewDimension::automatic:
        case rhi::ViewDimension::d2: return multisampled ? GL_TEXTURE_2D_MULTISAMPLE : GL_TEXTURE_2D;
        case rhi::ViewDimension::d2_array: return multisampled ? GL_TEXTURE_2D_MULTISAMPLE_ARRAY : GL_TEXTURE_2D_ARRAY;
        case rhi::ViewDimension::d3: return GL_TEXTURE_3D;
        case rhi::ViewDimension::cube: return GL_TEXTURE_CUBE_MAP;
        case rhi::ViewDimension::cube_array: return GL_TEXTURE_CUBE_MAP_ARRAY;
    }
    return GL_TEXTURE_2D;
}

GLenum gl_compare(rhi::CompareOperation operation) {
    constexpr std::array<GLenum, 8> names{GL_NEVER, GL_LESS, GL_EQUAL, GL_LEQUAL, GL_GREATER, GL_NOTEQUAL, GL_GEQUAL,
                                          GL_ALWAYS};
    return names[static_cast<std::size_t>(operation)];
}

GLenum gl_stencil_operation(rhi::StencilOperation operation) {
    constexpr std::array<GLenum, 8> names{GL_KEEP, GL_ZERO, GL_REPLACE, GL_INCR, GL_DECR, GL_INVERT, GL_INCR_WRAP,
                                          GL_DECR_WRAP};
    return names[static_cast<std::size_t>(operation)];
}

GLenum gl_blend_factor(rhi::BlendFactor factor) {
    switch (factor) {
        case rhi::BlendFactor::zero: return GL_ZERO;
        case rhi::BlendFactor::one: return GL_ONE;
        case rhi::BlendFactor::source_color: return GL_SRC_COLOR;
        case rhi::BlendFactor::one_minus_source_color: return GL_ONE_MINUS_SRC_COLOR;
        case rhi::BlendFactor::source_alpha: return GL_SRC_ALPHA;
        case rhi::BlendFactor::one_minus_source_alpha: return GL_ONE_MINUS_SRC_ALPHA;
        case rhi::BlendFactor::destination_color: return GL_DST_COLOR;
        case rhi::BlendFactor::one_minus_destination_color: return GL_ONE_MINUS_DST_COLOR;
        case rhi::BlendFactor::destination_alpha: return GL_DST_ALPHA;
        case rhi::BlendFactor::one_minus_destination_alpha: return GL_ONE_MINUS_DST_ALPHA;
        case rhi::BlendFactor::constant_color: return GL_CONSTANT_COLOR;
        case rhi::BlendFactor::one_minus_constant_color: return GL_ONE_MINUS_CONSTANT_COLOR;
        case rhi::BlendFactor::source_alpha_saturated: return GL_SRC_ALPHA_SATURATE;
        case rhi::BlendFactor::source1_color: return GL_SRC1_COLOR;
        case rhi::BlendFactor::one_minus_source1_color: return GL_ONE_MINUS_SRC1_COLOR;
        case rhi::BlendFactor::source1_alpha: return GL_SRC1_ALPHA;
        case rhi::BlendFactor::one_minus_source1_alpha: return GL_ONE_MINUS_SRC1_ALPHA;
    }
    return GL_ONE;
}

GLenum gl_blend_operation(rhi::BlendOperation operation) {
    constexpr std::array<GLenum, 5> names{GL_FUNC_ADD, GL_FUNC_SUBTRACT, GL_FUNC_REVERSE_SUBTRACT, GL_MIN, GL_MAX};
    return names[static_cast<std::size_t>(operation)];
}

GLenum gl_topology(rhi::Topology topology) {
    constexpr std::array<GLenum, 5> names{GL_POINTS, GL_LINES, GL_LINE_STRIP, GL_TRIANGLES, GL_TRIANGLE_STRIP};
    return names[static_cast<std::size_t>(topology)];
}

}  // namespace nacre::gl
