// SPDX-License-Identifier: Apache-2.0
#include "rhi/capabilities.h"

#include <fmt/format.h>

#include <algorithm>
#include <type_traits>

namespace nacre::rhi {
namespace {

// Every member once, in the order of the structure: features, limits of which less is less, alignments of which more is
// less, and measures that a restriction leaves alone.
#define NACRE_FEATURES(X)                                                                                            \
    X(storage_in_vertex)                                                                                             \
    X(storage_in_fragment) X(dual_source_blending) X(independent_blend) X(descriptor_indexing)                       \
        X(anisotropic_filtering) X(border_color) X(depth_clamp) X(depth_bias_clamp) X(wireframe) X(cube_arrays)      \
            X(multi_draw_indirect) X(indirect_first_instance) X(timestamps) X(precise_occlusion)                     \
                X(subgroup_operations) X(shader_float64) X(shader_int64) X(shader_int16) X(shader_int8)              \
                    X(variable_pointers) X(float_atomics) X(integer_dot_product) X(subgroup_rotate)                  \
                    X(sample_rate_shading) X(block_compression) X(float_color_targets) X(ray_query) X(base_instance) \
                        X(texture_views) X(texture_view_formats) X(fill_storage_without_format) X(sampler_mip_bias)  \
                        X(texel_buffers)
#define NACRE_LIMITS(X)                                                                                                \
    X(max_texture_1d)                                                                                                  \
    X(max_texture_2d) X(max_texture_3d) X(max_texture_cube) X(max_texture_layers) X(max_color_targets)                 \
        X(max_dual_source_targets) X(max_samples) X(max_integer_samples) X(max_bind_groups) X(max_push_constant_bytes) \
            X(max_uniform_buffer_range) X(max_storage_buffer_range) X(max_buffer_size) X(max_vertex_attributes)        \
                X(max_vertex_buffers) X(max_vertex_stride) X(max_uniform_buffers) X(max_storage_buffers)               \
                    X(max_sampled_textures) X(max_samplers) X(max_storage_images) X(max_workgroup_size)                \
                        X(max_workgroup_count) X(max_workgroup_invocations) X(max_workgroup_memory_bytes)              \
                            X(subgroup_size) X(max_bindless_textures) X(max_anisotropy) X(max_line_width)              \
                                X(max_point_size) X(float_bits) X(max_texel_buffer_elements)
#define NACRE_ALIGNMENTS(X) X(uniform_offset_alignment) X(storage_offset_alignment) X(texel_buffer_offset_alignment)
#define NACRE_MEASURES(X) X(timestamp_period_ns) X(device_memory_bytes)

template <typename T>
std::string text_of(const T& value) {
    if constexpr (std::is_same_v<T, bool>)
        return value ? "yes" : "no";
    else if constexpr (requires { value.size(); })
        return fmt::format("{}, {}, {}", value[0], value[1], value[2]);
    else
        return fmt::format("{}", value);
}

template <typename T>
T smaller(const T& a, const T& b) {
    if constexpr (requires { a.size(); }) {
        T result = a;
        for (std::size_t i = 0; i < a.size(); ++i) result[i] = std::min(a[i], b[i]);
        return result;
    } else {
        return std::min(a, b);
    }
}

constexpr FormatSupport sampled_only = FormatSupport::sampled;
constexpr FormatSupport texture = FormatSupport::sampled | FormatSupport::filtered;
constexpr FormatSupport target = FormatSupport::color_target | FormatSupport::blended | FormatSupport::multisampled;
constexpr FormatSupport integer_target = FormatSupport::color_target | FormatSupport::multisampled;
constexpr FormatSupport depth = FormatSupport::sampled | FormatSupport::depth_target | FormatSupport::multisampled;
constexpr FormatSupport image = FormatSupport::storage_image;
constexpr FormatSupport vertex = FormatSupport::vertex;

/// What OpenGL ES 3.1 guarantees. Sources: specification of November 3, 2016; for formats tables 8.10 (sized formats,
/// color-renderable and filterable), 8.11 (depth), 8.27 (image formats) and 10.3 (vertex types); for limits
/// tables 20.40 to 20.49. Where a value of ours has no counterpart there, the reason stands beside it.
Capabilities gles31_minimum() {
    Capabilities c;
    // All features are off (buffer textures among them): each needs an extension or OpenGL ES 3.2, but for these.
    c.precise_occlusion = false;    // ANY_SAMPLES_PASSED alone.
    c.float_color_targets = false;  // EXT_color_buffer_half_float and EXT_color_buffer_float are extensions.

    c.max_texture_1d = 2048;     // Emulated as 2D textures of height 1.
    c.max_texture_2d = 2048;     // MAX_TEXTURE_SIZE
    c.max_texture_3d = 256;      // MAX_3D_TEXTURE_SIZE
    c.max_texture_cube = 2048;   // MAX_CUBE_MAP_TEXTURE_SIZE
    c.max_texture_layers = 256;  // MAX_ARRAY_TEXTURE_LAYERS
    c.max_color_targets = 4;     // MAX_COLOR_ATTACHMENTS, MAX_DRAW_BUFFERS
    c.max_dual_source_targets = 0;
    c.max_samples = 4;                   // MAX_SAMPLES
    c.max_integer_samples = 1;           // MAX_INTEGER_SAMPLES
    c.max_bind_groups = 4;               // Bindings are flat there; this is what the interface promises everywhere.
    c.max_push_constant_bytes = 128;     // Emulated by uniforms; what the interface promises everywhere.
    c.max_uniform_buffer_range = 16384;  // MAX_UNIFORM_BLOCK_SIZE
    c.max_storage_buffer_range = std::uint64_t{1} << 27;  // MAX_SHADER_STORAGE_BLOCK_SIZE
    c.max_buffer_size = std::uint64_t{1} << 31;  // No limit is stated; sizes are signed 32-bit on small devices.
    c.uniform_offset_alignment = 256;            // UNIFORM_BUFFER_OFFSET_ALIGNMENT: at most 256
    c.storage_offset_alignment = 256;            // SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT: at most 256
    c.max_vertex_attributes = 16;                // MAX_VERTEX_ATTRIBS
    c.max_vertex_buffers = 16;                   // MAX_VERTEX_ATTRIB_BINDINGS
    c.max_vertex_stride = 2048;                  // MAX_VERTEX_ATTRIB_STRIDE
    c.max_uniform_buffers = {12, 12, 12};        // MAX_{VERTEX,FRAGMENT,COMPUTE}_UNIFORM_BLOCKS
    c.max_storage_buffers = {0, 0, 4};           // MAX_{VERTEX,FRAGMENT,COMPUTE}_SHADER_STORAGE_BLOCKS
    c.max_sampled_textures = {16, 16, 16};       // MAX_{VERTEX_,,COMPUTE_}TEXTURE_IMAGE_UNITS
    c.max_samplers = {16, 16, 16};
    c.max_storage_images = {0, 0, 4};               // MAX_{VERTEX,FRAGMENT,COMPUTE}_IMAGE_UNIFORMS
    c.max_workgroup_size = {128, 128, 64};          // MAX_COMPUTE_WORK_GROUP_SIZE
    c.max_workgroup_count = {65535, 65535, 65535};  // MAX_COMPUTE_WORK_GROUP_COUNT
    c.max_workgroup_invocations = 128;              // MAX_COMPUTE_WORK_GROUP_INVOCATIONS
    c.max_workgroup_memory_bytes = 16384;           // MAX_COMPUTE_SHARED_MEMORY_SIZE
    c.subgroup_size = 0;
    c.max_bindless_textures = 0;
    c.max_anisotropy = 1.0f;
    c.max_line_width = 1.0f;  // ALIASED_LINE_WIDTH_RANGE
    c.max_point_size = 1.0f;  // ALIASED_POINT_SIZE_RANGE

    const auto set = [&](std::initializer_list<Format> formats, FormatSupport support) {
        for (const Format format : formats) c.formats[static_cast<std::uint32_t>(format)] |= support;
    };
    using enum Format;
    set({r8_unorm, rg8_unorm, rgba8_unorm, rgba8_srgb, rgb10a2_unorm}, texture | target);
    set({r8_snorm, rg8_snorm, rgba8_snorm, r16_float, rg16_float, rgba16_float, rg11b10_float, rgb9e5_float}, texture);
    set({r32_float, rg32_float, rgba32_float}, sampled_only);
    set({r8_uint, r8_sint, rg8_uint, rg8_sint, rgba8_uint, rgba8_sint, r16_uint, r16_sint, rg16_uint, rg16_sint,
         rgba16_uint, rgba16_sint, r32_uint, r32_sint, rg32_uint, rg32_sint, rgba32_uint, rgba32_sint, rgb10a2_uint},
        sampled_only | integer_target);
    set({d16_unorm, d32_float, d24_unorm_s8_uint, d32_float_s8_uint}, depth);
    set({rgba32_uint, rgba16_uint, rgba8_uint, r32_uint, rgba32_sint, rgba16_sint, rgba8_sint, r32_sint, rgba32_float,
         rgba16_float, r32_float, rgba8_unorm, rgba8_snorm},
        image);
    // Image atomics are OES_shader_image_atomic; the interface reports them nowhere below it.
    set({r8_unorm,    r8_snorm,     r8_uint,      r8_sint,      rg8_unorm,     rg8_snorm,    rg8_uint,
         rg8_sint,    rgba8_unorm,  rgba8_snorm,  rgba8_uint,   rgba8_sint,    r16_unorm,    r16_snorm,
         r16_uint,    r16_sint,     r16_float,    rg16_unorm,   rg16_snorm,    rg16_uint,    rg16_sint,
         rg16_float,  rgba16_unorm, rgba16_snorm, rgba16_uint,  rgba16_sint,   rgba16_float, r32_uint,
         r32_sint,    r32_float,    rg32_uint,    rg32_sint,    rg32_float,    rgb32_uint,   rgb32_sint,
         rgb32_float, rgba32_uint,  rgba32_sint,  rgba32_float, rgb10a2_unorm, rgb10a2_uint},
        vertex);
    return c;
}

std::string text_of(FormatSupport support) {
    static constexpr std::array<std::string_view, 12> names{
        "sampled", "filtered",     "color_target",   "blended",              "depth_target",         "storage_image",
        "vertex",  "multisampled", "storage_atomic", "uniform_texel_buffer", "storage_texel_buffer",
        "storage_texel_buffer_atomic"};
    std::string text;
    for (std::size_t i = 0; i < names.size(); ++i)
        if (static_cast<std::uint32_t>(support) >> i & 1) text += (text.empty() ? "" : " ") + std::string(names[i]);
    return text.empty() ? "none" : text;
}

}  // namespace

std::vector<CapabilityEntry> list_capabilities(const Capabilities& capabilities) {
    std::vector<CapabilityEntry> entries;
#define NACRE_ENTRY(member) entries.push_back({#member, text_of(capabilities.member)});
    NACRE_FEATURES(NACRE_ENTRY)
    NACRE_LIMITS(NACRE_ENTRY)
    NACRE_ALIGNMENTS(NACRE_ENTRY)
    NACRE_MEASURES(NACRE_ENTRY)
#undef NACRE_ENTRY
    for (std::uint32_t i = 1; i < format_count; ++i) {
        const auto format = static_cast<Format>(i);
        entries.push_back({"format " + std::string(info(format).name), text_of(capabilities.format_support(format))});
    }
    return entries;
}

Expected<Capabilities> restrict_capabilities(const Capabilities& capabilities, std::string_view restriction) {
    if (restriction == "none" || restriction.empty()) return capabilities;
    if (restriction != "gles31-minimum") {
        std::string names;
        for (const std::string& name : restriction_names()) names += (names.empty() ? "'" : ", '") + name + "'";
        return fail(ErrorCode::invalid_argument, "restrict device", fmt::format("to '{}'", restriction),
                    fmt::format("expected one of {}", names),
                    "Leave the restriction out for all that the device can do.");
    }
    const Capabilities bound = gles31_minimum();
    Capabilities result = capabilities;
#define NACRE_FEATURE(member) result.member = capabilities.member && bound.member;
#define NACRE_LIMIT(member) result.member = smaller(capabilities.member, bound.member);
#define NACRE_ALIGNMENT(member) result.member = std::max(capabilities.member, bound.member);
    NACRE_FEATURES(NACRE_FEATURE)
    NACRE_LIMITS(NACRE_LIMIT)
    NACRE_ALIGNMENTS(NACRE_ALIGNMENT)
#undef NACRE_FEATURE
#undef NACRE_LIMIT
#undef NACRE_ALIGNMENT
    for (std::uint32_t i = 0; i < format_count; ++i)
        result.formats[i] = static_cast<FormatSupport>(static_cast<std::uint32_t>(capabilities.formats[i]) &
                                                       static_cast<std::uint32_t>(bound.formats[i]));
    return result;
}

std::vector<std::string> restriction_names() { return {"none", "gles31-minimum"}; }

}  // namespace nacre::rhi
