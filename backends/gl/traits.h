// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "backends/gl/loader.h"
#include "backends/gl/quirks.h"

/// @file
/// What the context may use beyond the common ground of OpenGL 4.5 and OpenGL ES 3.1. Every decision between two ways
/// of doing something in this backend is a member here, so that a restricted device takes the same paths as a weak one.

namespace nacre::gl {

struct Traits {
    bool es = false;
    /// Held to the OpenGL ES 3.1 specification without extensions, whatever the driver has.
    bool minimum = false;
    int version = 0;                 ///< 45, 31, 32.
    std::string renderer, vendor, version_text, origin;
    Quirks quirks;

    bool clip_control = false;       ///< Clip-space depth from 0 to 1.
    bool buffer_storage = false;     ///< Persistent mapping.
    bool texture_view = false;
    bool copy_image = false;
    bool clear_texture = false;
    bool multi_draw_indirect = false;
    bool base_instance = false;      ///< first_instance in draws.
    bool shader_base_instance = false; ///< gl_BaseInstance in shaders, also for indirect draws.
    bool base_vertex = false;
    bool border_clamp = false;
    bool anisotropy = false;
    bool half_float_targets = false;
    bool float_targets = false;      ///< All of 16- and 32-bit float.
    bool float_blend = false;        ///< Blending of 32-bit float.
    bool float_filter = false;       ///< Linear filtering of 32-bit float.
    bool timer = false;
    bool dual_source = false;
    bool independent_blend = false;
    bool cube_arrays = false;
    bool polygon_mode = false;
    bool depth_bias_clamp = false;
    bool depth_clamp = false;
    bool multisample_arrays = false;
    bool sample_shading = false;
    bool debug_output = false;
    bool reset_status = false;
    bool desktop = false;            ///< 1D textures, direct read-back, provoking vertex, LOD bias, ...
    bool unorm16 = false;            ///< 16-bit unorm and snorm formats.
    bool image_formats = false;      ///< Storage images of all formats of OpenGL 4.5.
    bool image_atomics = false;
    bool buffer_textures = false;    ///< Ranges of buffers as textures and images.
    bool snorm_targets = false;
    bool s3tc = false, s3tc_srgb = false, rgtc = false, bptc = false;
    bool program_binary = false;
};

/// Reads version, names and extensions of the current context. `minimum`: ignore everything beyond OpenGL ES 3.1.
Traits find_traits(const Functions& gl, bool es, bool minimum, std::string origin);

}  // namespace nacre::gl
