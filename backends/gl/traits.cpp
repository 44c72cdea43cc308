// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/traits.h"

#include <cctype>
#include <unordered_set>

namespace nacre::gl {
namespace {

std::string text_of(const Functions& gl, GLenum name) {
    const GLubyte* text = gl.GetString(name);
    return text ? reinterpret_cast<const char*>(text) : "";
}

}  // namespace

Traits find_traits(const Functions& gl, bool es, bool minimum, std::string origin) {
    Traits traits;
    traits.es = es;
    traits.desktop = !es;
    traits.minimum = minimum;
    traits.origin = std::move(origin);
    traits.renderer = text_of(gl, GL_RENDERER);
    traits.vendor = text_of(gl, GL_VENDOR);
    traits.version_text = text_of(gl, GL_VERSION);
    traits.quirks = find_quirks(traits.renderer, traits.version_text);
    GLint major = 0, minor = 0, binary_formats = 0;
    gl.GetIntegerv(GL_MAJOR_VERSION, &major);
    gl.GetIntegerv(GL_MINOR_VERSION, &minor);
    gl.GetIntegerv(GL_NUM_PROGRAM_BINARY_FORMATS, &binary_formats);
    traits.program_binary = binary_formats > 0;
    traits.version = major * 10 + minor;
    if (minimum) {
        traits.version = 31;
        return traits;
    }

    std::unordered_set<std::string> extensions;
    GLint count = 0;
    gl.GetIntegerv(GL_NUM_EXTENSIONS, &count);
    for (GLint i = 0; i < count; ++i)
        if (const GLubyte* name = gl.GetStringi(GL_EXTENSIONS, static_cast<GLuint>(i)))
            extensions.insert(reinterpret_cast<const char*>(name));
    const auto has = [&](const char* name) { return extensions.contains(name); };

    const bool es32 = es && traits.version >= 32;
    const bool desktop = traits.desktop;
    traits.clip_control = (desktop || has("GL_EXT_clip_control")) && gl.ClipControl;
    traits.buffer_storage = (desktop || has("GL_EXT_buffer_storage")) && gl.BufferStorage;
    traits.texture_view = (desktop || has("GL_OES_texture_view")) && gl.TextureView;
    traits.copy_image = (desktop || es32) && gl.CopyImageSubData;
    traits.clear_texture = (desktop || has("GL_EXT_clear_texture")) && gl.ClearTexSubImage;
    traits.multi_draw_indirect = (desktop || has("GL_EXT_multi_draw_indirect")) && gl.MultiDrawArraysIndirect;
    traits.base_instance = (desktop || has("GL_EXT_base_instance")) && gl.DrawArraysInstancedBaseInstance;
    traits.shader_base_instance = desktop && (traits.version >= 46 || has("GL_ARB_shader_draw_parameters"));
    traits.base_vertex = (desktop || es32) && gl.DrawElementsInstancedBaseVertex;
    traits.border_clamp = desktop || es32;
    traits.anisotropy = traits.version >= 46 || has("GL_EXT_texture_filter_anisotropic") ||
                        has("GL_ARB_texture_filter_anisotropic");
    traits.float_targets = desktop || has("GL_EXT_color_buffer_float") || es32;
    traits.half_float_targets = traits.float_targets || has("GL_EXT_color_buffer_half_float");
    traits.float_blend = desktop || has("GL_EXT_float_blend");
    traits.float_filter = desktop || has("GL_OES_texture_float_linear");
    traits.timer = (desktop || has("GL_EXT_disjoint_timer_query")) && gl.QueryCounter && gl.GetQueryObjectui64v;
    traits.dual_source = desktop || has("GL_EXT_blend_func_extended");
    traits.independent_blend = (desktop || es32) && gl.BlendFuncSeparatei;
    traits.cube_arrays = desktop || es32;
    traits.polygon_mode = (desktop || has("GL_NV_polygon_mode")) && gl.PolygonMode;
    traits.depth_bias_clamp = (traits.version >= 46 || has("GL_ARB_polygon_offset_clamp") ||
                               has("GL_EXT_polygon_offset_clamp")) && gl.PolygonOffsetClamp;
    traits.depth_clamp = desktop || has("GL_EXT_depth_clamp");
    traits.multisample_arrays = (desktop || es32) && gl.TexStorage3DMultisample;
    traits.sample_shading = desktop || es32;
    traits.debug_output = (desktop || has("GL_KHR_debug")) && gl.DebugMessageCallback;
    traits.reset_status = (desktop || es32) && gl.GetGraphicsResetStatus;
    traits.unorm16 = desktop || has("GL_EXT_texture_norm16");
    // Not GL_NV_image_formats in OpenGL ES: SPIRV-Cross refuses to write those formats there.
    traits.image_formats = desktop;
    traits.image_atomics = desktop || es32 || has("GL_OES_shader_image_atomic");
    traits.buffer_textures = (desktop || es32) && gl.TexBufferRange;
    traits.snorm_targets = desktop || has("GL_EXT_render_snorm");
    traits.s3tc = has("GL_EXT_texture_compression_s3tc");
    traits.s3tc_srgb = traits.s3tc && (desktop ? has("GL_EXT_texture_sRGB") || traits.version >= 21
                                               : has("GL_EXT_texture_compression_s3tc_srgb"));
    traits.rgtc = desktop || has("GL_EXT_texture_compression_rgtc");
    traits.bptc = desktop || has("GL_EXT_texture_compression_bptc");
    return traits;
}

}  // namespace nacre::gl
