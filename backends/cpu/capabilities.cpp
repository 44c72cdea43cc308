// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/capabilities.h"

#include "backends/cpu/host_memory.h"
#include "backends/cpu/shader_interface.h"

namespace nacre::cpu {
namespace {

using rhi::Format;
using rhi::FormatSupport;

bool has_image_atomics(Format format) {
    return format == Format::r32_uint || format == Format::r32_sint || format == Format::r32_float;
}

bool is_vertex_format(Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    return !facts.is_compressed() && !facts.is_depth_stencil() && facts.kind != rhi::FormatKind::srgb &&
           format != Format::rg11b10_float && format != Format::rgb9e5_float;
}

FormatSupport format_support(Format format) {
    using enum FormatSupport;
    const rhi::FormatInfo& facts = rhi::info(format);
    FormatSupport support = is_vertex_format(format) ? vertex : none;
    if (facts.block_bytes == 12) return support;
    support |= sampled;
    if (facts.is_compressed()) return support | filtered;
    if (facts.is_depth_stencil()) return support | filtered | depth_target | multisampled;
    if (!facts.is_integer()) support |= filtered;
    if (has_image_atomics(format)) support |= storage_atomic | storage_texel_buffer_atomic;
    if (facts.kind != rhi::FormatKind::srgb) support |= uniform_texel_buffer;
    // A shared exponent leaves no channel that could be masked or blended by itself.
    if (format == Format::rgb9e5_float) return support;
    support |= color_target | multisampled;
    if (!facts.is_integer()) support |= blended;
    if (facts.kind != rhi::FormatKind::srgb) support |= storage_image | storage_texel_buffer;
    return support;
}

}  // namespace

rhi::Capabilities find_capabilities(std::uint32_t subgroup_size) {
    rhi::Capabilities result;
    result.storage_in_vertex = result.storage_in_fragment = true;
    result.dual_source_blending = result.independent_blend = true;
    result.descriptor_indexing = true;
    result.anisotropic_filtering = result.border_color = result.sampler_mip_bias = true;
    result.depth_clamp = result.depth_bias_clamp = result.wireframe = true;
    result.cube_arrays = true;
    result.multi_draw_indirect = result.indirect_first_instance = result.base_instance = true;
    result.timestamps = result.precise_occlusion = true;
    result.subgroup_operations = true;
    result.shader_float64 = result.shader_int64 = result.shader_int16 = result.shader_int8 = true;
    result.variable_pointers = result.float_atomics = result.integer_dot_product = result.subgroup_rotate = true;
    result.sample_rate_shading = true;
    result.block_compression = true;
    result.float_color_targets = true;
    result.ray_query = true;
    result.texture_views = result.texture_view_formats = true;
    result.fill_storage_without_format = true;
    result.texel_buffers = true;

    result.max_texture_1d = result.max_texture_2d = result.max_texture_cube = 16384;
    result.max_texture_3d = 2048;
    result.max_texture_layers = 2048;
    result.max_color_targets = 8;
    result.max_dual_source_targets = 1;
    result.max_samples = result.max_integer_samples = 4;
    result.max_bind_groups = max_groups;
    result.max_push_constant_bytes = push_constant_capacity;
    // Compiled code counts bytes of a binding in 32 bits with a sign.
    constexpr std::uint64_t largest_range = (std::uint64_t{1} << 31) - 1;
    result.max_uniform_buffer_range = result.max_storage_buffer_range = largest_range;
    result.device_memory_bytes = machine_memory_bytes();
    result.max_buffer_size = result.device_memory_bytes;
    result.uniform_offset_alignment = result.storage_offset_alignment = result.texel_buffer_offset_alignment = 16;
    // What GPUs have. The largest elements reach 2 GiB then, which rows of images can be long.
    result.max_texel_buffer_elements = 1u << 27;
    result.max_vertex_attributes = result.max_vertex_buffers = 32;
    result.max_vertex_stride = 65536;
    constexpr std::uint32_t many = 1024;
    result.max_uniform_buffers = result.max_storage_buffers = result.max_storage_images = {many, many, many};
    result.max_sampled_textures = result.max_samplers = {many, many, many};
    result.max_workgroup_size = {1024, 1024, 1024};
    result.max_workgroup_invocations = 1024;
    result.max_workgroup_memory_bytes = most_workgroup_bytes;
    result.max_workgroup_count = most_workgroups;
    result.subgroup_size = subgroup_size;
    result.max_bindless_textures = 65536;
    result.max_anisotropy = 16.0f;
    result.max_line_width = 1.0f;
    result.max_point_size = 8192.0f;
    result.timestamp_period_ns = 1.0;
    for (std::uint32_t i = 1; i < rhi::format_count; ++i) result.formats[i] = format_support(static_cast<Format>(i));
    return result;
}

}  // namespace nacre::cpu
