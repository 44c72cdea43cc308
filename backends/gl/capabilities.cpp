// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/capabilities.h"

#include <algorithm>

#include "backends/gl/formats.h"

namespace nacre::gl {
namespace {

class Query {
  public:
    explicit Query(const Functions& gl) : gl_(gl) {}
    [[nodiscard]] std::uint32_t number(GLenum name) const {
        GLint value = 0;
        gl_.GetIntegerv(name, &value);
        return static_cast<std::uint32_t>(std::max(value, 0));
    }
    [[nodiscard]] std::uint64_t number64(GLenum name) const {
        GLint64 value = 0;
        gl_.GetInteger64v(name, &value);
        return static_cast<std::uint64_t>(std::max<GLint64>(value, 0));
    }
    [[nodiscard]] std::uint32_t indexed(GLenum name, GLuint index) const {
        GLint value = 0;
        gl_.GetIntegeri_v(name, index, &value);
        return static_cast<std::uint32_t>(std::max(value, 0));
    }
    [[nodiscard]] float second_float(GLenum name) const {
        GLfloat range[2]{1.0f, 1.0f};
        gl_.GetFloatv(name, range);
        return range[1];
    }

  private:
    const Functions& gl_;
};

/// RHI samples are 1 or 4.
std::uint32_t samples(std::uint32_t most) { return most >= 4 ? 4 : 1; }

}  // namespace

rhi::Capabilities find_capabilities(const Functions& gl, const Traits& traits) {
    const Query query(gl);
    rhi::Capabilities result;
    result.max_uniform_buffers = {query.number(GL_MAX_VERTEX_UNIFORM_BLOCKS),
                                  query.number(GL_MAX_FRAGMENT_UNIFORM_BLOCKS),
                                  query.number(GL_MAX_COMPUTE_UNIFORM_BLOCKS)};
    result.max_storage_buffers = {query.number(GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS),
                                  query.number(GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS),
                                  query.number(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS)};
    result.max_sampled_textures = {query.number(GL_MAX_VERTEX_TEXTURE_IMAGE_UNITS),
                                   query.number(GL_MAX_TEXTURE_IMAGE_UNITS),
                                   query.number(GL_MAX_COMPUTE_TEXTURE_IMAGE_UNITS)};
    // A sampler costs nothing by itself; each pair of a texture and a sampler takes one unit.
    result.max_samplers = result.max_sampled_textures;
    const std::uint32_t image_units = query.number(GL_MAX_IMAGE_UNITS);
    result.max_storage_images = {std::min(image_units, query.number(GL_MAX_VERTEX_IMAGE_UNIFORMS)),
                                 std::min(image_units, query.number(GL_MAX_FRAGMENT_IMAGE_UNIFORMS)),
                                 std::min(image_units, query.number(GL_MAX_COMPUTE_IMAGE_UNIFORMS))};

    result.storage_in_vertex = result.max_storage_buffers[0] > 0 && result.max_storage_images[0] > 0;
    result.storage_in_fragment = result.max_storage_buffers[1] > 0 && result.max_storage_images[1] > 0;
    result.dual_source_blending = traits.dual_source;
    result.independent_blend = traits.independent_blend;
    result.descriptor_indexing = false;
    result.anisotropic_filtering = traits.anisotropy;
    result.border_color = traits.border_clamp;
    result.depth_clamp = traits.depth_clamp;
    result.depth_bias_clamp = traits.depth_bias_clamp;
    result.wireframe = traits.polygon_mode;
    result.cube_arrays = traits.cube_arrays;
    result.multi_draw_indirect = traits.multi_draw_indirect;
    result.indirect_first_instance = traits.shader_base_instance;
    result.timestamps = traits.timer;
    result.precise_occlusion = traits.desktop;
    result.subgroup_operations = false;
    result.shader_float64 = traits.desktop;
    result.sample_rate_shading = traits.sample_shading;
    result.block_compression = traits.s3tc_srgb && traits.rgtc && traits.bptc;
    result.float_color_targets = traits.float_targets;
    result.base_instance = traits.base_instance;
    result.texture_views = traits.texture_view;
    result.texture_view_formats = traits.texture_view;
    result.fill_storage_without_format = traits.desktop;
    result.sampler_mip_bias = traits.desktop;
    result.texel_buffers = traits.buffer_textures;

    result.max_texture_2d = query.number(GL_MAX_TEXTURE_SIZE);
    result.max_texture_1d = result.max_texture_2d;
    result.max_texture_3d = query.number(GL_MAX_3D_TEXTURE_SIZE);
    result.max_texture_cube = query.number(GL_MAX_CUBE_MAP_TEXTURE_SIZE);
    result.max_texture_layers = query.number(GL_MAX_ARRAY_TEXTURE_LAYERS);
    // Framebuffers are looked up by at most 8 targets.
    result.max_color_targets =
        std::min({query.number(GL_MAX_DRAW_BUFFERS), query.number(GL_MAX_COLOR_ATTACHMENTS), 8u});
    result.max_dual_source_targets = traits.dual_source ? query.number(GL_MAX_DUAL_SOURCE_DRAW_BUFFERS) : 0;
    result.max_samples =
        samples(std::min(query.number(GL_MAX_COLOR_TEXTURE_SAMPLES), query.number(GL_MAX_DEPTH_TEXTURE_SAMPLES)));
    result.max_integer_samples = samples(query.number(GL_MAX_INTEGER_SAMPLES));
    result.max_bind_groups = 4;
    // Push constants are plain uniforms; the specification guarantees 4 KiB of them in each stage.
    result.max_push_constant_bytes = 256;
    result.max_uniform_buffer_range = query.number64(GL_MAX_UNIFORM_BLOCK_SIZE);
    result.max_storage_buffer_range = query.number64(GL_MAX_SHADER_STORAGE_BLOCK_SIZE);
    result.max_buffer_size = std::uint64_t{1} << 31;
    result.uniform_offset_alignment = query.number(GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT);
    result.storage_offset_alignment = query.number(GL_SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT);
    if (traits.buffer_textures) {
        result.texel_buffer_offset_alignment = query.number(GL_TEXTURE_BUFFER_OFFSET_ALIGNMENT);
        result.max_texel_buffer_elements = query.number(GL_MAX_TEXTURE_BUFFER_SIZE);
    }
    result.max_vertex_attributes = query.number(GL_MAX_VERTEX_ATTRIBS);
    result.max_vertex_buffers = std::min(query.number(GL_MAX_VERTEX_ATTRIB_BINDINGS), 32u);
    result.max_vertex_stride = query.number(GL_MAX_VERTEX_ATTRIB_STRIDE);
    for (GLuint axis = 0; axis < 3; ++axis) {
        result.max_workgroup_size[axis] = query.indexed(GL_MAX_COMPUTE_WORK_GROUP_SIZE, axis);
        result.max_workgroup_count[axis] = query.indexed(GL_MAX_COMPUTE_WORK_GROUP_COUNT, axis);
    }
    result.max_workgroup_invocations = query.number(GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS);
    result.max_workgroup_memory_bytes = query.number(GL_MAX_COMPUTE_SHARED_MEMORY_SIZE);
    if (traits.anisotropy) {
        GLfloat most = 1.0f;
        gl.GetFloatv(GL_MAX_TEXTURE_MAX_ANISOTROPY, &most);
        result.max_anisotropy = most;
    }
    result.max_line_width = query.second_float(GL_ALIASED_LINE_WIDTH_RANGE);
    // The point-size range has one name in desktop core and, with the same value, another in OpenGL ES.
    constexpr GLenum aliased_point_size_range = 0x846D;
    result.max_point_size = query.second_float(traits.es ? aliased_point_size_range : GL_POINT_SIZE_RANGE);
    result.timestamp_period_ns = traits.timer ? 1.0 : 0.0;
    for (std::uint32_t i = 1; i < rhi::format_count; ++i)
        result.formats[i] = format_support(gl, traits, static_cast<rhi::Format>(i));
    return result;
}

}  // namespace nacre::gl
