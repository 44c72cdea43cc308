// SPDX-License-Identifier: Apache-2.0
#include "rhi/pipeline_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>

#include "rhi/binding_type.h"
#include "rhi/state_tracker.h"

namespace nacre::rhi {
namespace {

std::string_view name_of(FormatKind kind) {
    switch (kind) {
        case FormatKind::unorm: return "unorm";
        case FormatKind::snorm: return "snorm";
        case FormatKind::uint: return "uint";
        case FormatKind::sint: return "sint";
        case FormatKind::floating: return "float";
        case FormatKind::srgb: return "srgb";
    }
    return "unknown";
}

/// How a shader sees values of a format: float, uint or sint.
FormatKind shader_kind(FormatKind kind) {
    return kind == FormatKind::uint || kind == FormatKind::sint ? kind : FormatKind::floating;
}

/// Whether a binding of type `layout` allows what a shader that declares `declared` does.
bool allows(BindingType layout, BindingType declared) {
    return is_same_resource(layout, declared) && union_of(layout, declared) == layout;
}

bool uses_source1(BlendFactor factor) { return factor >= BlendFactor::source1_color; }
bool uses_source1(const BlendState& blend) {
    return blend.enabled && (uses_source1(blend.source_color) || uses_source1(blend.destination_color) ||
                             uses_source1(blend.source_alpha) || uses_source1(blend.destination_alpha));
}

/// Makes the problems of one pipeline.
struct Reporter {
    const char* attempted;
    const std::string& name;
    Problem operator()(Rule rule, ErrorCode code, std::string reason, std::string remedy) const {
        return {rule, code, attempted, "'" + name + "'", std::move(reason), std::move(remedy)};
    }
};

Check check_vertex_input(const GraphicsPipelineDesc& desc, const BackendShader& vertex,
                         const Capabilities& capabilities, const Reporter& problem) {
    const auto invalid = ErrorCode::invalid_argument;
    if (desc.vertex_buffers.size() > std::min(capabilities.max_vertex_buffers, most_vertex_buffers))
        return problem(Rule::vertex_limit, invalid,
                       fmt::format("expected at most {} vertex buffers (max_vertex_buffers), found {}",
                                   capabilities.max_vertex_buffers, desc.vertex_buffers.size()),
                       "Interleave attributes in fewer buffers.");
    if (desc.vertex_attributes.size() > capabilities.max_vertex_attributes)
        return problem(Rule::vertex_limit, invalid,
                       fmt::format("expected at most {} attributes (max_vertex_attributes), found {}",
                                   capabilities.max_vertex_attributes, desc.vertex_attributes.size()),
                       "Pack attributes, or read them from a storage buffer.");
    for (std::size_t i = 0; i < desc.vertex_buffers.size(); ++i)
        if (desc.vertex_buffers[i].stride > capabilities.max_vertex_stride)
            return problem(
                Rule::vertex_limit, invalid,
                fmt::format("expected a stride of at most {} bytes (max_vertex_stride), found {} in buffer {}",
                            capabilities.max_vertex_stride, desc.vertex_buffers[i].stride, i),
                "Use smaller vertices.");
    std::uint64_t locations = 0;
    for (const VertexAttribute& attribute : desc.vertex_attributes) {
        const auto layout = [&](std::string reason) {
            return problem(Rule::vertex_attribute_layout, invalid,
                           fmt::format("attribute {}: {}", attribute.location, reason), "Correct the vertex layout.");
        };
        if (attribute.location >= std::min(capabilities.max_vertex_attributes, 64u))
            return problem(Rule::vertex_limit, invalid,
                           fmt::format("expected locations below {} (max_vertex_attributes), found {}",
                                       capabilities.max_vertex_attributes, attribute.location),
                           "Use lower locations.");
        if (locations >> attribute.location & 1) return layout("expected each location once, found it twice");
        locations |= std::uint64_t{1} << attribute.location;
        if (attribute.buffer >= desc.vertex_buffers.size())
            return layout(
                fmt::format("expected a buffer below {}, found {}", desc.vertex_buffers.size(), attribute.buffer));
        if (!capabilities.supports(attribute.format, FormatSupport::vertex))
            return problem(Rule::vertex_attribute_format, ErrorCode::unsupported,
                           fmt::format("attribute {}: expected a format that the device supports as vertex, found {}",
                                       attribute.location, info(attribute.format).name),
                           "Ask Capabilities::supports first and choose another format.");
        const std::uint32_t stride = desc.vertex_buffers[attribute.buffer].stride;
        const std::uint32_t bytes = info(attribute.format).block_bytes;
        if (attribute.offset % std::min(4u, bytes) != 0)
            return layout(fmt::format("expected an offset that is a multiple of {}, found {}", std::min(4u, bytes),
                                      attribute.offset));
        if (attribute.offset > 2047 || (stride != 0 && std::uint64_t{attribute.offset} + bytes > stride))
            return layout(fmt::format("expected it to end within the stride of {} bytes, found offset {} and {} bytes",
                                      stride, attribute.offset, bytes));
    }
    for (const ReflectedVariable& input : vertex.reflection.inputs)
        for (std::uint32_t i = 0; i < input.locations; ++i) {
            const auto at = std::find_if(
                desc.vertex_attributes.begin(), desc.vertex_attributes.end(),
                [&](const VertexAttribute& attribute) { return attribute.location == input.location + i; });
            if (at == desc.vertex_attributes.end())
                return problem(Rule::vertex_attribute_missing, invalid,
                               fmt::format("expected an attribute at location {} for '{}' of shader '{}', found none",
                                           input.location + i, input.name, vertex.name),
                               "Add it to vertex_attributes.");
            const FormatKind given = shader_kind(info(at->format).kind);
            if (given != input.kind)
                return problem(Rule::vertex_attribute_kind, invalid,
                               fmt::format("expected a format that gives {} at location {} for '{}', found {}",
                                           name_of(input.kind), at->location, input.name, info(at->format).name),
                               "Choose a format of the kind that the shader declares.");
        }
    return {};
}

Check check_interface(const BackendShader& vertex, const BackendShader& fragment, const Reporter& problem) {
    for (const ReflectedVariable& input : fragment.reflection.inputs) {
        const auto at = std::find_if(
            vertex.reflection.outputs.begin(), vertex.reflection.outputs.end(), [&](const ReflectedVariable& output) {
                return input.location >= output.location && input.location < output.location + output.locations;
            });
        if (at == vertex.reflection.outputs.end())
            return problem(
                Rule::pipeline_interface, ErrorCode::invalid_argument,
                fmt::format("expected shader '{}' to write location {} for '{}' of shader '{}', found nothing",
                            vertex.name, input.location, input.name, fragment.name),
                "Give both the same location.");
        if (at->kind != input.kind || at->components < input.components)
            return problem(
                Rule::pipeline_interface, ErrorCode::invalid_argument,
                fmt::format("expected {} with {} components at location {} for '{}' of shader '{}', found {} with "
                            "{} in shader '{}'",
                            name_of(input.kind), input.components, input.location, input.name, fragment.name,
                            name_of(at->kind), at->components, vertex.name),
                "Declare the same type in both.");
    }
    return {};
}

Check check_targets(const GraphicsPipelineDesc& desc, const BackendShader* fragment, const Capabilities& capabilities,
                    const Reporter& problem) {
    const auto invalid = ErrorCode::invalid_argument;
    const auto unsupported = ErrorCode::unsupported;
    const std::size_t count = desc.color_targets.size();
    if (count > std::min(capabilities.max_color_targets, most_color_targets))
        return problem(Rule::color_target_limit, unsupported,
                       fmt::format("expected at most {} color targets (max_color_targets), found {}",
                                   capabilities.max_color_targets, count),
                       "Draw in several passes, or pack into fewer targets.");
    if (count > 0 && !fragment)
        return problem(Rule::fragment_missing, invalid,
                       fmt::format("expected a fragment shader for {} color targets, found none", count),
                       "Give a fragment shader, or no color targets.");
    bool dual_source = false;
    for (std::size_t i = 0; i < count; ++i) {
        const ColorTargetState& target = desc.color_targets[i];
        const FormatInfo& format = info(target.format);
        if (!capabilities.supports(target.format, FormatSupport::color_target))
            return problem(
                Rule::color_target_format, unsupported,
                fmt::format("color target {}: expected a format that the device supports as color_target, found {}", i,
                            format.name),
                "Ask Capabilities::supports first and choose another format.");
        if (target.blend.enabled && !capabilities.supports(target.format, FormatSupport::blended))
            return problem(
                Rule::blend_format, unsupported,
                fmt::format("color target {}: expected a format that the device supports as blended, found {}", i,
                            format.name),
                "Turn blending off for this target, or choose another format.");
        if (i > 0 && !capabilities.independent_blend &&
            (!(target.blend == desc.color_targets[0].blend) || target.write_mask != desc.color_targets[0].write_mask))
            return problem(
                Rule::independent_blend, unsupported,
                fmt::format("expected color target {} to blend and mask as target 0 does on a device without "
                            "independent_blend, found a difference",
                            i),
                "Use one state for all targets, or draw in several passes.");
        dual_source |= uses_source1(target.blend);
        const auto output = std::find_if(fragment->reflection.outputs.begin(), fragment->reflection.outputs.end(),
                                         [&](const ReflectedVariable& variable) {
                                             return variable.index == 0 && i >= variable.location &&
                                                    i < variable.location + variable.locations;
                                         });
        if (output == fragment->reflection.outputs.end()) {
            if (target.write_mask != 0)
                return problem(
                    Rule::color_target_unwritten, invalid,
                    fmt::format("expected shader '{}' to write color target {}, found no output at that location",
                                fragment->name, i),
                    "Write the output, or set write_mask to 0 for the target.");
        } else if (output->kind != shader_kind(format.kind)) {
            return problem(
                Rule::color_target_kind, invalid,
                fmt::format("color target {}: expected an output of kind {} for {}, found {} in '{}' of shader '{}'", i,
                            name_of(shader_kind(format.kind)), format.name, name_of(output->kind), output->name,
                            fragment->name),
                "Declare the output as vec4, uvec4 or ivec4 to fit the format.");
        }
    }
    if (dual_source) {
        if (!capabilities.dual_source_blending || count > capabilities.max_dual_source_targets)
            return problem(
                Rule::dual_source, unsupported,
                fmt::format("expected at most {} color targets with dual-source blending "
                            "(dual_source_blending, max_dual_source_targets), found {}",
                            capabilities.dual_source_blending ? capabilities.max_dual_source_targets : 0, count),
                "Draw in two passes, or blend with one source.");
        const bool written = std::any_of(fragment->reflection.outputs.begin(), fragment->reflection.outputs.end(),
                                         [](const ReflectedVariable& variable) { return variable.index == 1; });
        if (!written)
            return problem(
                Rule::dual_source, invalid,
                fmt::format("expected shader '{}' to write an output with index 1, found none", fragment->name),
                "Declare layout(location = 0, index = 1) out.");
    }
    return {};
}

Check check_depth_and_raster(const GraphicsPipelineDesc& desc, const Capabilities& capabilities,
                             const Reporter& problem) {
    const DepthStencilState& depth = desc.depth_stencil;
    const FormatInfo& format = info(depth.format);
    if (depth.format != Format::undefined &&
        (!format.is_depth_stencil() || !capabilities.supports(depth.format, FormatSupport::depth_target)))
        return problem(
            Rule::depth_format, ErrorCode::unsupported,
            fmt::format("expected a depth format that the device supports as depth_target, found {}", format.name),
            "Ask Capabilities::supports first and choose another format.");
    if ((depth.depth_test || depth.depth_write) && !format.has_depth)
        return problem(Rule::depth_state, ErrorCode::invalid_argument,
                       fmt::format("expected a format with depth for depth_test or depth_write, found {}", format.name),
                       "Set DepthStencilState::format, or turn both off.");
    if (depth.stencil_test && !format.has_stencil)
        return problem(Rule::depth_state, ErrorCode::invalid_argument,
                       fmt::format("expected a format with stencil for stencil_test, found {}", format.name),
                       "Choose a format with stencil, or turn stencil_test off.");
    if (depth.depth_clamp && !capabilities.depth_clamp)
        return problem(Rule::pipeline_feature, ErrorCode::unsupported,
                       "expected no depth_clamp on a device without depth_clamp, found it on",
                       "Clamp in the vertex shader.");
    if (depth.depth_bias_clamp != 0.0f && !capabilities.depth_bias_clamp)
        return problem(Rule::pipeline_feature, ErrorCode::unsupported,
                       fmt::format("expected a depth_bias_clamp of 0 on a device without depth_bias_clamp, found {}",
                                   depth.depth_bias_clamp),
                       "Leave the bias unclamped.");
    if (desc.fill == FillMode::line && !capabilities.wireframe)
        return problem(Rule::pipeline_feature, ErrorCode::unsupported,
                       "expected FillMode::fill on a device without wireframe, found line",
                       "Draw lines as a line list.");
    if (desc.samples != 1 && (desc.samples != 4 || capabilities.max_samples < 4))
        return problem(Rule::pipeline_samples, ErrorCode::unsupported,
                       fmt::format("expected {} samples (max_samples), found {}",
                                   capabilities.max_samples >= 4 ? "1 or 4" : "1", desc.samples),
                       "Use 1 sample.");
    return {};
}

}  // namespace

Check merge_stages(std::span<const BackendShader* const> shaders, const std::string& name, MergedInterface& merged) {
    for (const BackendShader* shader : shaders) {
        const ShaderReflection& reflection = shader->reflection;
        if (reflection.push_constant_bytes > 0) {
            merged.push_constant_bytes = std::max(merged.push_constant_bytes, reflection.push_constant_bytes);
            merged.push_constant_stages |= reflection.stage;
        }
        for (const ReflectedBinding& binding : reflection.bindings) {
            const auto at =
                std::find_if(merged.bindings.begin(), merged.bindings.end(), [&](const MergedBinding& other) {
                    return other.declared.set == binding.set && other.declared.binding == binding.binding;
                });
            if (at == merged.bindings.end()) {
                merged.bindings.push_back({binding, reflection.stage});
                continue;
            }
            ReflectedBinding& known = at->declared;
            if (!is_same_resource(known.type, binding.type) || known.count != binding.count)
                return Problem{
                    Rule::pipeline_binding_conflict,
                    ErrorCode::invalid_argument,
                    "create pipeline",
                    fmt::format("'{}', set {}, binding {}", name, binding.set, binding.binding),
                    fmt::format("expected one declaration in all stages, found {} '{}' with {} elements and {} "
                                "'{}' with {} elements",
                                name_of(known.type), known.name, known.count, name_of(binding.type), binding.name,
                                binding.count),
                    "Give one of them another binding."};
            known.type = union_of(known.type, binding.type);
            known.block_size = std::max(known.block_size, binding.block_size);
            at->stages |= reflection.stage;
        }
    }
    std::sort(merged.bindings.begin(), merged.bindings.end(), [](const MergedBinding& a, const MergedBinding& b) {
        return a.declared.set != b.declared.set ? a.declared.set < b.declared.set
                                                : a.declared.binding < b.declared.binding;
    });
    return {};
}

Check check_explicit_layout(const BindGroupLayoutDesc& layout, std::uint32_t set, const MergedInterface& merged,
                            const std::string& name) {
    for (const MergedBinding& used : merged.bindings) {
        const ReflectedBinding& declared = used.declared;
        if (declared.set != set) continue;
        const auto problem = [&](std::string found) {
            return Problem{
                Rule::pipeline_layout,
                ErrorCode::invalid_argument,
                "create pipeline",
                fmt::format("'{}', set {}, binding {}", name, set, declared.binding),
                fmt::format("expected layout '{}' to hold {} '{}' with {} elements for the stages {}, found {}",
                            layout.name, name_of(declared.type), declared.name, declared.count, text_of(used.stages),
                            found),
                "Add what the shaders use to the layout, or leave the layout out."};
        };
        const auto at = std::find_if(layout.bindings.begin(), layout.bindings.end(),
                                     [&](const BindingLayout& binding) { return binding.binding == declared.binding; });
        if (at == layout.bindings.end()) return problem("no such binding");
        if (!allows(at->type, declared.type)) return problem(std::string(name_of(at->type)));
        if (at->count != 0 && (declared.count == 0 || at->count < declared.count))
            return problem(fmt::format("{} elements", at->count));
        if (!has_all(at->stages, used.stages)) return problem("the stages " + text_of(at->stages));
    }
    return {};
}

Check check_specialization(std::span<const SpecializationConstant> constants,
                           std::span<const BackendShader* const> shaders, const std::string& name) {
    for (std::size_t i = 0; i < constants.size(); ++i) {
        const bool declared = std::any_of(shaders.begin(), shaders.end(), [&](const BackendShader* shader) {
            return std::any_of(shader->reflection.specialization.begin(), shader->reflection.specialization.end(),
                               [&](const ReflectedSpecialization& known) { return known.id == constants[i].id; });
        });
        const bool twice =
            std::any_of(constants.begin(), constants.begin() + static_cast<std::ptrdiff_t>(i),
                        [&](const SpecializationConstant& other) { return other.id == constants[i].id; });
        if (!declared || twice)
            return Problem{Rule::specialization_id,
                           ErrorCode::invalid_argument,
                           "create pipeline",
                           "'" + name + "'",
                           fmt::format("expected each constant_id that the shaders declare at most once, found {} {}",
                                       constants[i].id, twice ? "twice" : "which none declares"),
                           "Remove the constant, or declare layout(constant_id = ...) in the shader."};
    }
    return {};
}

Check check_graphics(const GraphicsPipelineDesc& desc, const BackendShader& vertex, const BackendShader* fragment,
                     const Capabilities& capabilities) {
    const Reporter problem{"create graphics pipeline", desc.name};
    if (vertex.reflection.stage != ShaderStage::vertex ||
        (fragment && fragment->reflection.stage != ShaderStage::fragment))
        return problem(Rule::pipeline_stage, ErrorCode::invalid_argument,
                       fmt::format("expected a vertex and a fragment shader, found '{}' ({}) and '{}' ({})",
                                   vertex.name, text_of(vertex.reflection.stage), fragment ? fragment->name : "",
                                   fragment ? text_of(fragment->reflection.stage) : "none"),
                       "Put each shader into the member of its stage.");
    if (Check failed = check_vertex_input(desc, vertex, capabilities, problem)) return failed;
    if (fragment)
        if (Check failed = check_interface(vertex, *fragment, problem)) return failed;
    if (Check failed = check_targets(desc, fragment, capabilities, problem)) return failed;
    return check_depth_and_raster(desc, capabilities, problem);
}

Check check_compute(const ComputePipelineDesc& desc, const BackendShader& shader, const Capabilities& capabilities) {
    const Reporter problem{"create compute pipeline", desc.name};
    const ShaderReflection& reflection = shader.reflection;
    if (reflection.stage != ShaderStage::compute)
        return problem(
            Rule::pipeline_stage, ErrorCode::invalid_argument,
            fmt::format("expected a compute shader, found '{}' ({})", shader.name, text_of(reflection.stage)),
            "Compile the shader for the compute stage.");
    std::array<std::uint32_t, 3> size = reflection.workgroup_size;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const SpecializationConstant& constant : desc.specialization)
            if (constant.id == reflection.workgroup_size_ids[axis])
                size[axis] = std::visit([](auto value) { return static_cast<std::uint32_t>(value); }, constant.value);
    std::uint64_t invocations = 1;
    bool fits = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        fits &= size[axis] >= 1 && size[axis] <= capabilities.max_workgroup_size[axis];
        invocations *= size[axis];
        fits &= invocations <= capabilities.max_workgroup_invocations;
    }
    if (!fits)
        return problem(Rule::workgroup_limit, ErrorCode::unsupported,
                       fmt::format("expected a workgroup of at most {}x{}x{} (max_workgroup_size) and {} invocations "
                                   "(max_workgroup_invocations), found {}x{}x{}",
                                   capabilities.max_workgroup_size[0], capabilities.max_workgroup_size[1],
                                   capabilities.max_workgroup_size[2], capabilities.max_workgroup_invocations, size[0],
                                   size[1], size[2]),
                       "Use a smaller local_size.");
    return {};
}

}  // namespace nacre::rhi
