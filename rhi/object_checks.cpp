// SPDX-License-Identifier: Apache-2.0
#include "rhi/object_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "rhi/binding_type.h"

namespace nacre::rhi {
namespace {

/// No device of today or of the next years holds more; sizes above are refused before any arithmetic on them.
constexpr std::uint64_t largest_resource_bytes = std::uint64_t{1} << 46;

std::string quoted(std::string_view kind, const std::string& name) { return fmt::format("{} '{}'", kind, name); }

}  // namespace

std::string text_of(BufferUsage usage) {
    static constexpr std::array<std::string_view, 10> names{
        "vertex", "index", "uniform", "storage", "indirect", "copy_source", "copy_destination",
        "acceleration_structure_input", "uniform_texel", "storage_texel"};
    std::string text;
    for (std::size_t i = 0; i < names.size(); ++i)
        if (static_cast<std::uint32_t>(usage) >> i & 1) text += (text.empty() ? "" : " | ") + std::string(names[i]);
    return text.empty() ? "none" : text;
}

std::string text_of(TextureUsage usage) {
    static constexpr std::array<std::string_view, 6> names{"sampled",      "storage",     "color_target",
                                                           "depth_target", "copy_source", "copy_destination"};
    std::string text;
    for (std::size_t i = 0; i < names.size(); ++i)
        if (static_cast<std::uint32_t>(usage) >> i & 1) text += (text.empty() ? "" : " | ") + std::string(names[i]);
    return text.empty() ? "none" : text;
}

std::string_view name_of(BindingType type) {
    switch (type) {
        case BindingType::uniform_buffer: return "uniform_buffer";
        case BindingType::storage_buffer: return "storage_buffer";
        case BindingType::readonly_storage_buffer: return "readonly_storage_buffer";
        case BindingType::sampled_texture: return "sampled_texture";
        case BindingType::sampler: return "sampler";
        case BindingType::combined_texture_sampler: return "combined_texture_sampler";
        case BindingType::storage_image: return "storage_image";
        case BindingType::readonly_storage_image: return "readonly_storage_image";
        case BindingType::writeonly_storage_image: return "writeonly_storage_image";
        case BindingType::acceleration_structure: return "acceleration_structure";
        case BindingType::uniform_texel_buffer: return "uniform_texel_buffer";
        case BindingType::storage_texel_buffer: return "storage_texel_buffer";
        case BindingType::readonly_storage_texel_buffer: return "readonly_storage_texel_buffer";
        case BindingType::writeonly_storage_texel_buffer: return "writeonly_storage_texel_buffer";
    }
    return "unknown";
}

std::string_view name_of(ViewDimension dimension) {
    switch (dimension) {
        case ViewDimension::automatic: return "automatic";
        case ViewDimension::d1: return "d1";
        case ViewDimension::d1_array: return "d1_array";
        case ViewDimension::d2: return "d2";
        case ViewDimension::d2_array: return "d2_array";
        case ViewDimension::d3: return "d3";
        case ViewDimension::cube: return "cube";
        case ViewDimension::cube_array: return "cube_array";
    }
    return "unknown";
}

Check check_buffer(const BufferDesc& desc, const Capabilities& capabilities) {
    const auto problem = [&](Rule rule, ErrorCode code, std::string reason, std::string remedy) {
        return Problem{rule, code, "create buffer", "'" + desc.name + "'", std::move(reason), std::move(remedy)};
    };
    if (desc.size == 0)
        return problem(Rule::buffer_size, ErrorCode::invalid_argument, "expected a size above 0 bytes, found 0",
                       "Leave the buffer out where there is nothing to hold.");
    const std::uint64_t limit = capabilities.max_buffer_size ? capabilities.max_buffer_size : largest_resource_bytes;
    if (desc.size > limit)
        return problem(Rule::buffer_size, ErrorCode::out_of_memory,
                       fmt::format("expected at most {} bytes (max_buffer_size; the largest heap has {}), found {}",
                                   limit, capabilities.device_memory_bytes, desc.size),
                       "Split the buffer.");
    if (desc.usage == BufferUsage::none)
        return problem(Rule::buffer_usage, ErrorCode::invalid_argument, "expected at least one usage, found none",
                       "State in BufferDesc::usage what the buffer is for.");
    if (has_any(desc.usage, BufferUsage::acceleration_structure_input) && !capabilities.ray_query)
        return problem(Rule::buffer_usage, ErrorCode::unsupported,
                       "expected no acceleration_structure_input on a device without ray_query, found it asked for",
                       "Ask Capabilities::ray_query first.");
    constexpr BufferUsage texel_usages = BufferUsage::uniform_texel | BufferUsage::storage_texel;
    if (has_any(desc.usage, texel_usages) && !capabilities.texel_buffers)
        return problem(Rule::buffer_usage, ErrorCode::unsupported,
                       "expected no uniform_texel or storage_texel on a device without texel_buffers, found " +
                           text_of(desc.usage & texel_usages),
                       "Ask Capabilities::texel_buffers first; read a storage buffer or a texture instead.");
    constexpr BufferUsage copies = BufferUsage::copy_source | BufferUsage::copy_destination;
    if (desc.memory == MemoryKind::readback && has_any(desc.usage, ~copies))
        return problem(Rule::buffer_usage, ErrorCode::invalid_argument,
                       "expected readback memory to be used by copies alone, found " + text_of(desc.usage),
                       "Use device memory, and copy what the host reads into a readback buffer.");
    if (desc.memory == MemoryKind::upload && has_any(desc.usage, BufferUsage::storage | BufferUsage::storage_texel))
        return problem(Rule::buffer_usage, ErrorCode::invalid_argument,
                       "expected upload memory not to be used by storage bindings, found " + text_of(desc.usage),
                       "Use device memory for storage buffers, and copy into them.");
    return {};
}

Check check_texture(const TextureDesc& desc, const Capabilities& capabilities) {
    const auto problem = [&](Rule rule, ErrorCode code, std::string reason, std::string remedy) {
        return Problem{rule, code, "create texture", "'" + desc.name + "'", std::move(reason), std::move(remedy)};
    };
    const auto invalid = ErrorCode::invalid_argument;
    const FormatInfo& format = info(desc.format);
    if (format.block_bytes == 0 || format.block_bytes == 12)
        return problem(Rule::texture_format, invalid,
                       fmt::format("expected a format that textures can have, found {}", format.name),
                       format.block_bytes == 12
                           ? "Three-channel 32-bit formats are for vertex attributes; use four channels."
                           : "Set TextureDesc::format.");
    if (desc.usage == TextureUsage::none)
        return problem(Rule::texture_usage, invalid, "expected at least one usage, found none",
                       "State in TextureDesc::usage what the texture is for.");

    // Size and shape.
    if (desc.width == 0 || desc.height == 0 || desc.depth == 0)
        return problem(
            Rule::texture_size, invalid,
            fmt::format("expected a size of at least 1x1x1, found {}x{}x{}", desc.width, desc.height, desc.depth),
            "Skip the work where a size is 0, as for a minimized window.");
    std::uint32_t limit = 0;
    const char* limit_name = "";
    switch (desc.dimension) {
        case TextureDimension::d1: limit = capabilities.max_texture_1d, limit_name = "max_texture_1d"; break;
        case TextureDimension::d2: limit = capabilities.max_texture_2d, limit_name = "max_texture_2d"; break;
        case TextureDimension::d3: limit = capabilities.max_texture_3d, limit_name = "max_texture_3d"; break;
        case TextureDimension::cube: limit = capabilities.max_texture_cube, limit_name = "max_texture_cube"; break;
    }
    if (desc.width > limit || desc.height > limit || desc.depth > limit)
        return problem(Rule::texture_size, invalid,
                       fmt::format("expected at most {} texels along each axis ({}), found {}x{}x{}", limit, limit_name,
                                   desc.width, desc.height, desc.depth),
                       "Use a smaller texture, or tile it.");
    const auto shape = [&](std::string_view expected) {
        return problem(Rule::texture_shape, invalid,
                       fmt::format("expected {}, found {}x{}x{} with {} layers", expected, desc.width, desc.height,
                                   desc.depth, desc.layers),
                       "Correct the size, or choose another TextureDesc::dimension.");
    };
    if (desc.layers == 0)
        return problem(Rule::texture_layers, invalid, "expected at least 1 layer, found 0", "Set TextureDesc::layers.");
    if (desc.dimension == TextureDimension::d1 && (desc.height != 1 || desc.depth != 1))
        return shape("height 1 and depth 1 for a d1 texture");
    if (desc.dimension == TextureDimension::d2 && desc.depth != 1) return shape("depth 1 for a d2 texture");
    if (desc.dimension == TextureDimension::d3 && desc.layers != 1) return shape("1 layer for a d3 texture");
    if (desc.dimension == TextureDimension::cube && (desc.width != desc.height || desc.depth != 1))
        return shape("a square for a cube texture");
    if (desc.dimension == TextureDimension::cube && desc.layers % 6 != 0)
        return shape("a multiple of 6 layers for a cube texture");
    if (desc.layers > std::max(capabilities.max_texture_layers, desc.dimension == TextureDimension::cube ? 6u : 1u))
        return problem(Rule::texture_layers, invalid,
                       fmt::format("expected at most {} layers (max_texture_layers), found {}",
                                   capabilities.max_texture_layers, desc.layers),
                       "Use several textures.");
    if (desc.dimension == TextureDimension::cube && desc.layers > 6 && !capabilities.cube_arrays)
        return problem(
            Rule::texture_layers, ErrorCode::unsupported,
            fmt::format("expected 6 layers, the device has no cube arrays (cube_arrays), found {}", desc.layers),
            "Use one texture for each cube.");
    if (format.is_compressed() && desc.dimension != TextureDimension::d2 && desc.dimension != TextureDimension::cube)
        return shape("a d2 or cube texture for a block-compressed format");
    const std::uint32_t full = full_mip_count(desc.width, desc.height, desc.depth);
    if (desc.mips == 0 || desc.mips > full)
        return problem(Rule::texture_mips, invalid,
                       fmt::format("expected 1 to {} mips for {}x{}x{} texels, found {}", full, desc.width, desc.height,
                                   desc.depth, desc.mips),
                       "Use full_mip_count.");

    // Samples.
    const auto samples_problem = [&](std::string expected) {
        return problem(Rule::texture_samples, ErrorCode::invalid_argument,
                       fmt::format("expected {}, found {} samples", expected, desc.samples), "Use 1 sample.");
    };
    if (desc.samples != 1 && desc.samples != 4) return samples_problem("1 or 4 samples");
    if (desc.samples > 1) {
        const std::uint32_t most = format.is_integer() ? capabilities.max_integer_samples : capabilities.max_samples;
        if (desc.samples > most || !capabilities.supports(desc.format, FormatSupport::multisampled))
            return samples_problem(
                fmt::format("at most {} samples for {} (max_samples, max_integer_samples, multisampled)",
                            capabilities.supports(desc.format, FormatSupport::multisampled) ? most : 1, format.name));
        if (desc.dimension != TextureDimension::d2 || desc.mips != 1 || desc.layers != 1)
            return samples_problem("1 sample for a texture with mips or layers, or that is not d2");
        if (has_any(desc.usage, TextureUsage::storage | TextureUsage::copy_source | TextureUsage::copy_destination))
            return samples_problem("1 sample for a texture that is copied or a storage image");
    }

    // What the device can do with the format.
    struct Need {
        TextureUsage usage;
        FormatSupport support;
        std::string_view name;
    };
    static constexpr std::array needs{
        Need{TextureUsage::sampled, FormatSupport::sampled, "sampled"},
        Need{TextureUsage::storage, FormatSupport::storage_image, "storage_image"},
        Need{TextureUsage::color_target, FormatSupport::color_target, "color_target"},
        Need{TextureUsage::depth_target, FormatSupport::depth_target, "depth_target"},
    };
    for (const Need& need : needs)
        if (has_any(desc.usage, need.usage) && !capabilities.supports(desc.format, need.support))
            return problem(
                Rule::texture_format_usage, ErrorCode::unsupported,
                fmt::format("expected a format that the device supports as {}, found {}", need.name, format.name),
                "Ask Capabilities::supports first and choose another format.");
    if (capabilities.format_support(desc.format) == FormatSupport::none)
        return problem(Rule::texture_format_usage, ErrorCode::unsupported,
                       fmt::format("expected a format that the device has, found {}", format.name),
                       "Ask Capabilities::supports first and choose another format.");

    // Limits bound each axis below 2^32, so no product here overflows 64 bits unnoticed.
    std::uint64_t bytes = 0;
    for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
        const std::uint64_t one = mip_bytes(desc, mip);
        if (one > largest_resource_bytes) {
            bytes = largest_resource_bytes + 1;
            break;
        }
        bytes += one;
    }
    const std::uint64_t most =
        capabilities.device_memory_bytes ? capabilities.device_memory_bytes : largest_resource_bytes;
    if (bytes > most / (std::uint64_t{desc.layers} * desc.samples))
        return problem(
            Rule::texture_bytes, ErrorCode::out_of_memory,
            fmt::format("expected at most {} bytes (the largest heap), found {} bytes in each of {} layers with "
                        "{} samples",
                        most, bytes, desc.layers, desc.samples),
            "Use a smaller texture.");
    return {};
}

Check check_sampler(const SamplerDesc& desc, const Capabilities& capabilities) {
    const auto problem = [&](Rule rule, ErrorCode code, std::string reason, std::string remedy) {
        return Problem{rule, code, "create sampler", "'" + desc.name + "'", std::move(reason), std::move(remedy)};
    };
    if (!(desc.max_anisotropy >= 1.0f) || desc.max_anisotropy > std::max(1.0f, capabilities.max_anisotropy) ||
        (desc.max_anisotropy > 1.0f && !capabilities.anisotropic_filtering))
        return problem(
            Rule::sampler_anisotropy, ErrorCode::invalid_argument,
            fmt::format("expected an anisotropy of 1 to {} (max_anisotropy), found {}",
                        capabilities.anisotropic_filtering ? capabilities.max_anisotropy : 1.0f, desc.max_anisotropy),
            "Clamp it to Capabilities::max_anisotropy.");
    const bool border = desc.address_u == AddressMode::clamp_to_border ||
                        desc.address_v == AddressMode::clamp_to_border ||
                        desc.address_w == AddressMode::clamp_to_border;
    if (border && !capabilities.border_color)
        return problem(Rule::sampler_border, ErrorCode::unsupported,
                       "expected no clamp_to_border on a device without border_color, found one",
                       "Use clamp_to_edge, and test the coordinates in the shader.");
    if (!std::isfinite(desc.mip_bias) || !std::isfinite(desc.min_lod) || !std::isfinite(desc.max_lod) ||
        desc.min_lod > desc.max_lod || desc.min_lod < 0.0f || std::abs(desc.mip_bias) > 15.0f)
        return problem(Rule::sampler_lod, ErrorCode::invalid_argument,
                       fmt::format("expected 0 <= min_lod <= max_lod and a mip_bias within 15, found {} to {} and {}",
                                   desc.min_lod, desc.max_lod, desc.mip_bias),
                       "Correct the values.");
    if (desc.mip_bias != 0.0f && !capabilities.sampler_mip_bias)
        return problem(
            Rule::sampler_lod, ErrorCode::unsupported,
            fmt::format("expected a mip_bias of 0 on a device without sampler_mip_bias, found {}", desc.mip_bias),
            "Pass the bias to texture() in the shader.");
    return {};
}

Check check_query_pool(const QueryPoolDesc& desc, const Capabilities& capabilities) {
    const auto problem = [&](Rule rule, ErrorCode code, std::string reason, std::string remedy) {
        return Problem{rule, code, "create query pool", "'" + desc.name + "'", std::move(reason), std::move(remedy)};
    };
    if (desc.count == 0 || desc.count > 65536)
        return problem(Rule::query_pool_count, ErrorCode::invalid_argument,
                       fmt::format("expected a count of 1 to 65536, found {}", desc.count), "Use several pools.");
    if (desc.type == QueryType::timestamp && !capabilities.timestamps)
        return problem(Rule::query_type, ErrorCode::unsupported,
                       "expected a query type that the device has, found timestamp on a device without (timestamps)",
                       "Ask Capabilities::timestamps first; measure on the host instead.");
    return {};
}

Check check_acceleration_structure(const AccelerationStructureDesc& desc, const Capabilities& capabilities) {
    const auto problem = [&](Rule rule, ErrorCode code, std::string reason, std::string remedy) {
        return Problem{rule, code, "create acceleration structure", "'" + desc.name + "'", std::move(reason),
                       std::move(remedy)};
    };
    if (!capabilities.ray_query)
        return problem(Rule::acceleration_structure_unsupported, ErrorCode::unsupported,
                       "expected a device with ray queries (ray_query), found one without",
                       "Ask Capabilities::ray_query first.");
    const bool is_top = desc.level == AccelerationStructureLevel::top;
    if (is_top != desc.geometries.empty() || is_top != (desc.max_instances > 0) ||
        desc.max_instances > max_structure_instances || desc.geometries.size() > max_structure_geometries)
        return problem(
            Rule::acceleration_structure_level, ErrorCode::invalid_argument,
            is_top ? fmt::format("expected a top level of 1 to {} instances and no geometry, found {} and {}",
                                 max_structure_instances, desc.max_instances, desc.geometries.size())
                   : fmt::format("expected a bottom level of 1 to {} geometries and no instances, found {} and {}",
                                 max_structure_geometries, desc.geometries.size(), desc.max_instances),
            "Put geometry into bottom levels, and instances of them into top levels.");
    std::uint64_t primitives = 0;
    for (std::size_t i = 0; i < desc.geometries.size(); ++i) {
        const GeometryDesc& geometry = desc.geometries[i];
        const auto wrong = [&](std::string reason, std::string remedy) {
            return problem(Rule::acceleration_structure_geometry, ErrorCode::invalid_argument,
                           fmt::format("geometry {}: {}", i, reason), std::move(remedy));
        };
        if (geometry.type == GeometryType::curves)
            return problem(Rule::acceleration_structure_unsupported, ErrorCode::unsupported,
                           fmt::format("geometry {}: expected triangles or boxes, found curves", i),
                           "Use triangles or boxes; no device has curves yet.");
        if (geometry.type != desc.geometries[0].type)
            return wrong("expected geometries of one type, found boxes and triangles",
                         "Put boxes into bottom levels of their own.");
        primitives += geometry.primitive_count;
        if (primitives > max_structure_primitives || geometry.vertex_count > max_structure_primitives)
            return wrong(
                fmt::format("expected at most {} primitives and vertices in all, found more", max_structure_primitives),
                "Split the geometry over several bottom levels.");
        if (geometry.type == GeometryType::boxes) {
            if (geometry.vertex_stride < 24 || geometry.vertex_stride > 65536 || geometry.vertex_stride % 8 != 0)
                return wrong(
                    fmt::format("expected boxes with a stride of 24 to 65536 bytes that is a multiple of 8, found {}",
                                geometry.vertex_stride),
                    "Set GeometryDesc::vertex_stride, 24 for boxes without a gap.");
            if (geometry.vertex_count != 0 || geometry.index_type)
                return wrong("expected boxes without vertices and indices, found some",
                             "Leave GeometryDesc::vertex_count and index_type as they are.");
            continue;
        }
        if (geometry.vertex_format != Format::rgb32_float)
            return wrong(fmt::format("expected vertices of format {}, found {}", info(Format::rgb32_float).name,
                                     info(geometry.vertex_format).name),
                         "Store positions as three floats.");
        if (geometry.vertex_stride < 12 || geometry.vertex_stride > 65536 || geometry.vertex_stride % 4 != 0)
            return wrong(fmt::format("expected a stride of 12 to 65536 bytes that is a multiple of 4, found {}",
                                     geometry.vertex_stride),
                         "Correct GeometryDesc::vertex_stride.");
        if (geometry.vertex_count == 0 && geometry.primitive_count != 0)
            return wrong(fmt::format("expected vertices for {} triangles, found none", geometry.primitive_count),
                         "Set GeometryDesc::vertex_count.");
        if (!geometry.index_type && geometry.vertex_count / 3 < geometry.primitive_count)
            return wrong(fmt::format("expected three vertices for each of {} triangles without indices, found {}",
                                     geometry.primitive_count, geometry.vertex_count),
                         "Correct the counts, or set GeometryDesc::index_type.");
    }
    return {};
}

Check check_view(const ViewReference& view, const TextureDesc& desc, const Capabilities& capabilities,
                 const char* attempted, const std::string& subject) {
    const auto problem = [&](Rule rule, std::string reason, std::string remedy) {
        return Problem{rule,
                       ErrorCode::invalid_argument,
                       attempted,
                       subject + ", " + quoted("texture", desc.name),
                       std::move(reason),
                       std::move(remedy)};
    };
    const std::uint32_t layers = layers_of(desc);
    if (view.mip_count == 0 || view.layer_count == 0 || view.base_mip >= desc.mips ||
        view.mip_count > desc.mips - view.base_mip || view.base_layer >= layers ||
        view.layer_count > layers - view.base_layer)
        return problem(
            Rule::view_range,
            fmt::format("expected mips below {} and layers below {}, found {} mips from {} and {} layers from {}",
                        desc.mips, layers, view.mip_count, view.base_mip, view.layer_count, view.base_layer),
            "View mips and layers that the texture has.");
    bool fits = false;
    switch (view.dimension) {
        case ViewDimension::automatic: break;
        case ViewDimension::d1: fits = desc.dimension == TextureDimension::d1 && view.layer_count == 1; break;
        case ViewDimension::d1_array: fits = desc.dimension == TextureDimension::d1; break;
        case ViewDimension::d2:
            fits = (desc.dimension == TextureDimension::d2 || desc.dimension == TextureDimension::cube) &&
                   view.layer_count == 1;
            break;
        case ViewDimension::d2_array:
            fits = desc.dimension == TextureDimension::d2 || desc.dimension == TextureDimension::cube;
            break;
        case ViewDimension::d3: fits = desc.dimension == TextureDimension::d3; break;
        case ViewDimension::cube:
            fits = desc.dimension == TextureDimension::cube && view.layer_count == 6 && view.base_layer % 6 == 0;
            break;
        case ViewDimension::cube_array:
            fits = desc.dimension == TextureDimension::cube && view.layer_count % 6 == 0 && view.base_layer % 6 == 0 &&
                   capabilities.cube_arrays;
            break;
    }
    if (!fits)
        return problem(Rule::view_dimension,
                       fmt::format("expected a dimension that fits the texture, found {} with {} layers",
                                   name_of(view.dimension), view.layer_count),
                       "Choose a dimension and layers that fit the texture's own dimension.");
    if (view.format != desc.format) {
        const FormatInfo& own = info(desc.format);
        const FormatInfo& seen = info(view.format);
        const bool possible = capabilities.texture_view_formats && !own.is_depth_stencil() &&
                              !seen.is_depth_stencil() && own.block_bytes == seen.block_bytes &&
                              own.block_width == seen.block_width;
        if (!possible)
            return problem(Rule::view_format,
                           fmt::format("expected format {}{}, found {}", own.name,
                                       capabilities.texture_view_formats
                                           ? " or one of the same block size"
                                           : " (the device cannot reinterpret: texture_view_formats)",
                                       seen.name),
                           "View the texture in its own format.");
    }
    return {};
}

Check check_layout(const BindGroupLayoutDesc& desc, const Capabilities& capabilities) {
    const auto problem = [&](Rule rule, ErrorCode code, const BindingLayout& binding, std::string reason,
                             std::string remedy) {
        return Problem{rule,
                       code,
                       "create bind group layout",
                       fmt::format("'{}', binding {}", desc.name, binding.binding),
                       std::move(reason),
                       std::move(remedy)};
    };
    for (std::size_t i = 0; i < desc.bindings.size(); ++i) {
        const BindingLayout& binding = desc.bindings[i];
        if (i > 0 && desc.bindings[i - 1].binding == binding.binding)
            return problem(Rule::layout_duplicate, ErrorCode::invalid_argument, binding,
                           "expected each binding once, found it twice", "Give each binding its own number.");
        if (binding.binding > 4095)
            return problem(Rule::layout_binding_limit, ErrorCode::invalid_argument, binding,
                           fmt::format("expected a number of at most 4095, found {}", binding.binding),
                           "Number bindings from 0.");
        if (binding.stages == ShaderStage::none)
            return problem(Rule::layout_stages, ErrorCode::invalid_argument, binding,
                           "expected at least one shader stage, found none", "Set BindingLayout::stages.");
        if (binding.count == 0) {
            const bool texture =
                binding.type == BindingType::sampled_texture || binding.type == BindingType::combined_texture_sampler;
            if (!texture || !capabilities.descriptor_indexing)
                return problem(
                    Rule::layout_unbounded, texture ? ErrorCode::unsupported : ErrorCode::invalid_argument, binding,
                    texture
                        ? "expected a fixed count on a device without descriptor_indexing, found 0 (unbounded)"
                        : fmt::format("expected a fixed count for a {}, found 0 (unbounded)", name_of(binding.type)),
                    "Use TextureTable, which works on every device, or give a count.");
        }
    }
    for (const BindingLayout& binding : desc.bindings) {
        if (binding.type == BindingType::acceleration_structure && !capabilities.ray_query)
            return problem(Rule::acceleration_structure_unsupported, ErrorCode::unsupported, binding,
                           "expected no acceleration structure on a device without ray_query, found one",
                           "Ask Capabilities::ray_query first.");
        if (is_texel_buffer(binding.type) && !capabilities.texel_buffers)
            return problem(
                Rule::layout_texel_buffer, ErrorCode::unsupported, binding,
                fmt::format("expected no texel buffer on a device without texel_buffers, found a {}",
                            name_of(binding.type)),
                "Ask Capabilities::texel_buffers first; read a storage buffer or a texture instead.");
    }
    const BindGroupLayoutDesc* one = &desc;
    return check_stage_limits(std::span(&one, 1), capabilities, "create bind group layout", "'" + desc.name + "'");
}

Check check_stage_limits(std::span<const BindGroupLayoutDesc* const> layouts, const Capabilities& capabilities,
                         const char* attempted, const std::string& subject) {
    static constexpr std::array<std::string_view, 3> stage_names{"vertex", "fragment", "compute"};
    for (std::uint32_t stage = 0; stage < 3; ++stage) {
        std::array<std::uint64_t, 5> counts{};
        for (const BindGroupLayoutDesc* layout : layouts)
            for (const BindingLayout& binding : layout->bindings) {
                if ((static_cast<std::uint32_t>(binding.stages) >> stage & 1) == 0 || binding.count == 0) continue;
                switch (binding.type) {
                    case BindingType::uniform_buffer: counts[0] += binding.count; break;
                    case BindingType::storage_buffer:
                    case BindingType::readonly_storage_buffer: counts[1] += binding.count; break;
                    case BindingType::uniform_texel_buffer:
                    case BindingType::sampled_texture: counts[2] += binding.count; break;
                    case BindingType::sampler: counts[3] += binding.count; break;
                    case BindingType::combined_texture_sampler:
                        counts[2] += binding.count;
                        counts[3] += binding.count;
                        break;
                    case BindingType::storage_image:
                    case BindingType::readonly_storage_image:
                    case BindingType::writeonly_storage_image:
                    case BindingType::storage_texel_buffer:
                    case BindingType::readonly_storage_texel_buffer:
                    case BindingType::writeonly_storage_texel_buffer: counts[4] += binding.count; break;
                    case BindingType::acceleration_structure: break;
                }
            }
        const std::array<std::pair<std::string_view, std::uint32_t>, 5> limits{{
            {"max_uniform_buffers", capabilities.max_uniform_buffers[stage]},
            {"max_storage_buffers", capabilities.max_storage_buffers[stage]},
            {"max_sampled_textures", capabilities.max_sampled_textures[stage]},
            {"max_samplers", capabilities.max_samplers[stage]},
            {"max_storage_images", capabilities.max_storage_images[stage]},
        }};
        for (std::size_t kind = 0; kind < limits.size(); ++kind)
            if (counts[kind] > limits[kind].second)
                return Problem{Rule::layout_limit,
                               ErrorCode::unsupported,
                               attempted,
                               subject,
                               fmt::format("expected at most {} in the {} stage ({}), found {}", limits[kind].second,
                                           stage_names[stage], limits[kind].first, counts[kind]),
                               "Use fewer resources of this kind, or narrow BindingLayout::stages."};
    }
    return {};
}

Check check_shader(const ShaderReflection& reflection, const std::string& name, const Capabilities& capabilities) {
    const auto problem = [&](Rule rule, std::string reason, std::string remedy) {
        return Problem{
            rule, ErrorCode::unsupported, "create shader", "'" + name + "'", std::move(reason), std::move(remedy)};
    };
    const auto lacks = [&](std::string_view what, std::string_view capability) {
        return problem(
            Rule::shader_capability,
            fmt::format("expected a shader without {} on a device without {}, found it used", what, capability),
            "Ask Capabilities first, and compile a variant of the shader without it.");
    };
    if (reflection.uses_ray_query && !capabilities.ray_query) return lacks("ray queries", "ray_query");
    if (reflection.uses_subgroups && !capabilities.subgroup_operations)
        return lacks("subgroup operations", "subgroup_operations");
    for (const std::string& used : reflection.capabilities) {
        if (used == "Float64" && !capabilities.shader_float64) return lacks("64-bit floats", "shader_float64");
        if (used == "Int64" && !capabilities.shader_int64) return lacks("64-bit integers", "shader_int64");
        if (used == "Int16" && !capabilities.shader_int16) return lacks("16-bit integers", "shader_int16");
        if (used == "Int8" && !capabilities.shader_int8) return lacks("8-bit integers", "shader_int8");
        if (used.starts_with("VariablePointers") && !capabilities.variable_pointers)
            return lacks("variable pointers (" + used + ")", "variable_pointers");
        if (used.starts_with("AtomicFloat") && !capabilities.float_atomics)
            return lacks("atomic operations on floats (" + used + ")", "float_atomics");
        if (used.starts_with("DotProduct") && !capabilities.integer_dot_product)
            return lacks("dot products of integers (" + used + ")", "integer_dot_product");
        if (used == "GroupNonUniformRotateKHR" && !capabilities.subgroup_rotate)
            return lacks("rotation in subgroups (" + used + ")", "subgroup_rotate");
        if (used == "SampleRateShading" && !capabilities.sample_rate_shading)
            return lacks("per-sample shading", "sample_rate_shading");
        if ((used == "ImageCubeArray" || used == "SampledCubeArray") && !capabilities.cube_arrays)
            return lacks("cube arrays", "cube_arrays");
        if ((used == "SampledBuffer" || used == "ImageBuffer") && !capabilities.texel_buffers)
            return lacks("texel buffers", "texel_buffers");
        if (used == "StorageImageWriteWithoutFormat" && !capabilities.fill_storage_without_format)
            return lacks("writes to images without a format", "fill_storage_without_format");
        if ((used == "RuntimeDescriptorArray" || used == "ShaderNonUniform") && !capabilities.descriptor_indexing)
            return lacks("unbounded or non-uniformly indexed arrays", "descriptor_indexing");
    }
    const bool vertex = reflection.stage == ShaderStage::vertex;
    if ((vertex && !capabilities.storage_in_vertex) ||
        (reflection.stage == ShaderStage::fragment && !capabilities.storage_in_fragment))
        for (const ReflectedBinding& binding : reflection.bindings)
            if (is_storage_buffer(binding.type) || is_storage_image(binding.type) ||
                is_storage_texel_buffer(binding.type))
                return problem(
                    Rule::shader_storage_stage,
                    fmt::format("expected no storage buffers or images in the {} stage on a device without "
                                "{}, found {} '{}' at set {}, binding {}",
                                vertex ? "vertex" : "fragment", vertex ? "storage_in_vertex" : "storage_in_fragment",
                                name_of(binding.type), binding.name, binding.set, binding.binding),
                    "Read through textures or uniform buffers, and write in a compute pass.");
    if (reflection.push_constant_bytes > capabilities.max_push_constant_bytes)
        return problem(Rule::push_constant_limit,
                       fmt::format("expected at most {} bytes of push constants (max_push_constant_bytes), found {}",
                                   capabilities.max_push_constant_bytes, reflection.push_constant_bytes),
                       "Move some of them into a uniform buffer.");
    for (const ReflectedBinding& binding : reflection.bindings)
        if (binding.set >= capabilities.max_bind_groups || binding.set >= most_bind_groups)
            return problem(Rule::pipeline_group_limit,
                           fmt::format("expected sets below {} (max_bind_groups), found '{}' at set {}",
                                       capabilities.max_bind_groups, binding.name, binding.set),
                           "Use fewer bind groups.");
    if (reflection.stage == ShaderStage::compute) {
        std::uint64_t invocations = 1;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            if (reflection.workgroup_size_ids[axis] != ~0u) continue;  // Checked with the pipeline's value.
            invocations *= std::max(1u, reflection.workgroup_size[axis]);
            if (reflection.workgroup_size[axis] > capabilities.max_workgroup_size[axis])
                return problem(
                    Rule::workgroup_limit,
                    fmt::format("expected a workgroup of at most {}x{}x{} (max_workgroup_size), found {}x{}x{}",
                                capabilities.max_workgroup_size[0], capabilities.max_workgroup_size[1],
                                capabilities.max_workgroup_size[2], reflection.workgroup_size[0],
                                reflection.workgroup_size[1], reflection.workgroup_size[2]),
                    "Use a smaller local_size.");
        }
        if (invocations > capabilities.max_workgroup_invocations)
            return problem(
                Rule::workgroup_limit,
                fmt::format("expected at most {} invocations in a workgroup (max_workgroup_invocations), found {}",
                            capabilities.max_workgroup_invocations, invocations),
                "Use a smaller local_size.");
    }
    return {};
}

}  // namespace nacre::rhi
