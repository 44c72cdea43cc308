// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/format.h"

namespace nacre::rhi {

/// Everything that a device can and cannot do, as data. All limits count what one shader stage or one
/// pipeline may use at once. A profile decides by these values alone, never by the backend's name.
struct Capabilities {
    // Features.
    bool storage_in_vertex = false;     ///< Storage buffers and images in vertex shaders.
    bool storage_in_fragment = false;   ///< Storage buffers and images in fragment shaders.
    bool dual_source_blending = false;  ///< BlendFactor::source1_*.
    bool independent_blend = false;     ///< Different blend state and write masks for each color target.
    bool descriptor_indexing = false;   ///< Unbounded texture arrays with non-uniform indices.
    bool anisotropic_filtering = false;
    bool border_color = false;          ///< AddressMode::clamp_to_border.
    bool depth_clamp = false;
    bool depth_bias_clamp = false;
    bool wireframe = false;             ///< FillMode::line.
    bool cube_arrays = false;
    bool multi_draw_indirect = false;   ///< A draw count above 1 without emulation.
    bool indirect_first_instance = false;
    bool timestamps = false;
    bool precise_occlusion = false;     ///< Occlusion queries count samples; otherwise 0 or non-zero.
    bool subgroup_operations = false;   ///< GL_KHR_shader_subgroup_* in compute shaders.
    bool shader_float64 = false;
    bool shader_int64 = false;
    bool shader_int16 = false;
    bool shader_int8 = false;
    bool variable_pointers = false;     ///< SPIR-V VariablePointers and VariablePointersStorageBuffer.
    bool float_atomics = false;         ///< Sums, minima and maxima of 32 and 64 bits in buffers and workgroup memory.
    bool integer_dot_product = false;   ///< SPIR-V DotProduct.
    bool subgroup_rotate = false;       ///< SPIR-V GroupNonUniformRotateKHR.
    bool sample_rate_shading = false;
    bool block_compression = false;     ///< BC1 to BC7.
    bool float_color_targets = false;   ///< 16-bit float formats as color targets, with blending.
    bool ray_query = false;             ///< GL_EXT_ray_query.
    bool base_instance = false;         ///< DrawArguments::first_instance other than 0 in direct draws.
    bool texture_views = false;         ///< A sampled view may show some layers, or another dimension, of its texture.
    bool texture_view_formats = false;  ///< A view may reinterpret its texture's format (same size).
    bool fill_storage_without_format = false;  ///< imageStore to images declared without a format.
    bool sampler_mip_bias = false;      ///< SamplerDesc::mip_bias other than 0 (a bias in the shader always works).
    bool texel_buffers = false;         ///< BindingType::uniform_texel_buffer and *storage_texel_buffer.

    // Limits.
    std::uint32_t max_texture_1d = 0;
    std::uint32_t max_texture_2d = 0;
    std::uint32_t max_texture_3d = 0;
    std::uint32_t max_texture_cube = 0;
    std::uint32_t max_texture_layers = 0;
    std::uint32_t max_color_targets = 0;
    std::uint32_t max_dual_source_targets = 0;
    std::uint32_t max_samples = 1;            ///< 1 or 4 for color and depth targets.
    std::uint32_t max_integer_samples = 1;    ///< 1 or 4 for integer color targets.
    std::uint32_t max_bind_groups = 4;
    std::uint32_t max_push_constant_bytes = 128;
    std::uint64_t max_uniform_buffer_range = 0;
    std::uint64_t max_storage_buffer_range = 0;
    std::uint64_t max_buffer_size = 0;
    std::uint32_t uniform_offset_alignment = 256;
    std::uint32_t storage_offset_alignment = 256;
    std::uint32_t texel_buffer_offset_alignment = 256;  ///< Bytes.
    std::uint32_t max_texel_buffer_elements = 0;        ///< In the range of one texel buffer; 0 without texel_buffers.
    std::uint32_t max_vertex_attributes = 0;
    std::uint32_t max_vertex_buffers = 0;
    std::uint32_t max_vertex_stride = 0;
    /// Per-stage limits in the order vertex, fragment, compute.
    std::array<std::uint32_t, 3> max_uniform_buffers{};
    std::array<std::uint32_t, 3> max_storage_buffers{};
    std::array<std::uint32_t, 3> max_sampled_textures{};  ///< With uniform texel buffers.
    std::array<std::uint32_t, 3> max_samplers{};
    std::array<std::uint32_t, 3> max_storage_images{};    ///< With storage texel buffers.
    std::array<std::uint32_t, 3> max_workgroup_size{};   ///< x, y, z.
    std::array<std::uint32_t, 3> max_workgroup_count{};  ///< x, y, z.
    std::uint32_t max_workgroup_invocations = 0;
    std::uint32_t max_workgroup_memory_bytes = 0;
    std::uint32_t subgroup_size = 0;          ///< 0 where subgroup operations are missing.
    std::uint32_t max_bindless_textures = 0;  ///< With descriptor indexing.
    std::uint32_t float_bits = 24;            ///< Significant bits of a GLSL float: 53 on devices in double precision.
    float max_anisotropy = 1.0f;
    float max_line_width = 1.0f;
    float max_point_size = 1.0f;
    double timestamp_period_ns = 0.0;
    std::uint64_t device_memory_bytes = 0;    ///< Size of the largest heap; 0 where unknown.

    std::array<FormatSupport, format_count> formats{};

    [[nodiscard]] FormatSupport format_support(Format format) const {
        return formats[static_cast<std::uint32_t>(format)];
    }
    [[nodiscard]] bool supports(Format format, FormatSupport what) const {
        return has_all(format_support(format), what);
    }
};

/// One value of `Capabilities` by name, for printing and comparing: ("max_texture_2d", "16384").
struct CapabilityEntry {
    std::string name;
    std::string value;
};

/// All features and limits as text, in the order of the structure, then one entry for each format.
std::vector<CapabilityEntry> list_capabilities(const Capabilities& capabilities);

/// Smaller capabilities that a device can be held to, so that a weak device is tested on a strong one.
/// Known names: "none", and "gles31-minimum": what the OpenGL ES 3.1 specification guarantees (no storage
/// in vertex and fragment stages, 4 storage buffers and images in compute, 4 color targets, no dual
/// source, no independent blend, no float color targets; OpenGL ES 3.1, tables 20.31 to 20.49).
/// @return the element-wise minimum, or an error that lists the known names.
Expected<Capabilities> restrict_capabilities(const Capabilities& capabilities, std::string_view restriction);

/// Names accepted by `restrict_capabilities`.
std::vector<std::string> restriction_names();

}  // namespace nacre::rhi
