// SPDX-License-Identifier: Apache-2.0
// Draws and dispatches.
#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "rhi/binding_type.h"
#include "rhi/command_validator.h"

namespace nacre::rhi {
namespace {

FormatKind shader_kind(const FormatInfo& format) { return format.is_integer() ? format.kind : FormatKind::floating; }

std::string_view name_of_kind(FormatKind kind) {
    return kind == FormatKind::uint ? "uint" : kind == FormatKind::sint ? "sint" : "float";
}

/// What a shader expects of the format at a binding; empty where this one is that.
std::string unmet_format(const ReflectedBinding& declared, Format format) {
    if (declared.image_format != Format::undefined && declared.image_format != format)
        return fmt::format("format {}", info(declared.image_format).name);
    if (shader_kind(info(format)) != declared.sampled_kind)
        return fmt::format("a format that gives {}", name_of_kind(declared.sampled_kind));
    return {};
}

}  // namespace

Check CommandValidator::check_group_content(const PipelineCommon& pipeline, const BindGroupObject& group,
                                            std::uint32_t index, const char* attempted) {
    const auto subject = [&](const ReflectedBinding& declared) {
        return fmt::format("pipeline '{}', bind group '{}' at index {}, binding {} '{}'", pipeline.name, group.name,
                           index, declared.binding, declared.name);
    };
    for (const ReflectedBinding& declared : pipeline.bindings) {
        if (declared.set != index) continue;
        for (const BufferUse& use : group.buffers) {
            if (use.binding != declared.binding) continue;
            if (use.size < declared.block_size)
                return problem(Rule::binding_size, attempted,
                               fmt::format("expected at least {} bytes, as the shader declares, found {}",
                                           declared.block_size, use.size),
                               "Make the buffer or the bound range larger.", subject(declared));
            if (!is_texel_buffer(declared.type)) continue;
            if (const std::string expected = unmet_format(declared, use.format); !expected.empty())
                return problem(Rule::binding_view, attempted,
                               fmt::format("expected {} as the shader declares, found {}", expected,
                                           info(use.format).name),
                               "Give the texel buffer the format that the shader declares, or change the shader.",
                               subject(declared));
        }
        for (const TextureUse& use : group.textures) {
            if (use.binding != declared.binding || !use.slot->occupied || use.slot->generation != use.generation)
                continue;
            const TextureDesc& desc = use.slot->object.desc;
            const auto wrong = [&](std::string expected, std::string found) {
                return problem(Rule::binding_view, attempted,
                               fmt::format("expected {} as the shader declares, found {} in texture '{}'", expected,
                                           found, desc.name),
                               "View the texture as the shader declares it, or change the shader.", subject(declared));
            };
            if (declared.dimension != ViewDimension::automatic && declared.dimension != use.dimension)
                return wrong(fmt::format("dimension {}", name_of(declared.dimension)),
                             std::string(name_of(use.dimension)));
            if (declared.multisampled != (desc.samples > 1))
                return wrong(declared.multisampled ? "several samples" : "1 sample",
                             fmt::format("{} samples", desc.samples));
            if (std::string expected = unmet_format(declared, use.format); !expected.empty())
                return wrong(std::move(expected), std::string(info(use.format).name));
        }
    }
    return {};
}

Check CommandValidator::check_groups(const PipelineCommon& pipeline, const char* attempted) {
    for (std::uint32_t left = pipeline.group_mask & ~checked_groups_; left != 0; left &= left - 1) {
        const auto index = static_cast<std::uint32_t>(std::countr_zero(left));
        if (!groups_[index])
            return problem(Rule::bind_group_missing, attempted,
                           fmt::format("expected a bind group at index {}, found none", index),
                           "Call set_bind_group before; the begin and the end of a render pass unset all of them.",
                           fmt::format("pipeline '{}'", pipeline.name));
        Check failed;
        const BindGroupObject* group = look_up(groups_[index], attempted, "bind group", failed);
        if (!group) return failed;
        if (!(group->layout == pipeline.layouts[index])) {
            const BindGroupLayoutObject* expected = device_->tables.layouts.find(pipeline.layouts[index]);
            const BindGroupLayoutObject* found = device_->tables.layouts.find(group->layout);
            return problem(
                Rule::bind_group_layout_mismatch, attempted,
                fmt::format("expected a bind group of layout '{}' at index {}, found '{}' of layout '{}'",
                            expected ? expected->desc.name : "", index, group->name, found ? found->desc.name : ""),
                "Make the group with Device::bind_group_layout(pipeline, index), or give both pipelines one "
                "explicit layout.",
                fmt::format("pipeline '{}'", pipeline.name));
        }
        if (auto wrong = check_group_content(pipeline, *group, index, attempted)) return wrong;
        checked_groups_ |= 1u << index;
    }
    return {};
}

Check CommandValidator::check_push_constants(const PipelineCommon& pipeline, const char* attempted) {
    const std::uint32_t words = std::min<std::uint32_t>((pipeline.push_constant_bytes + 3) / 4, 1024);
    for (std::uint32_t word = 0; word < words; ++word)
        if (!push_constants_[word])
            return problem(Rule::push_constants_unset, attempted,
                           fmt::format("expected {} bytes of push constants, found those from byte {} never set",
                                       pipeline.push_constant_bytes, word * 4),
                           "Call set_push_constants before; the begin and the end of a render pass unset them.",
                           fmt::format("pipeline '{}'", pipeline.name));
    return {};
}

Check CommandValidator::check_draw(const char* attempted, const GraphicsPipelineObject*& pipeline) {
    if (auto failed = inside(attempted)) return failed;
    if (!graphics_)
        return problem(Rule::no_pipeline, attempted, "expected a graphics pipeline, found none",
                       "Call set_pipeline in the render pass; the begin of a pass unsets it.");
    Check failed;
    pipeline = look_up(graphics_, attempted, "graphics pipeline", failed);
    if (!pipeline) return failed;
    if (auto wrong = check_groups(pipeline->common, attempted)) return wrong;
    return check_push_constants(pipeline->common, attempted);
}

Check CommandValidator::check_vertices(const GraphicsPipelineObject& pipeline, const char* attempted,
                                       const DrawArguments& arguments, bool per_vertex, bool per_instance) {
    const std::string subject = fmt::format("pipeline '{}'", pipeline.common.name);
    for (std::uint32_t left = pipeline.vertex_buffer_mask; left != 0; left &= left - 1) {
        const auto slot = static_cast<std::uint32_t>(std::countr_zero(left));
        if (!vertex_buffers_[slot].buffer)
            return problem(Rule::vertex_buffer_missing, attempted,
                           fmt::format("expected a vertex buffer at slot {}, found none", slot),
                           "Call set_vertex_buffer in the render pass.", subject);
    }
    for (const VertexAttribute& attribute : pipeline.desc.vertex_attributes) {
        const VertexBufferLayout& layout = pipeline.desc.vertex_buffers[attribute.buffer];
        if (layout.per_instance ? !per_instance : !per_vertex) continue;
        const std::uint64_t count = layout.per_instance
                                        ? std::uint64_t{arguments.first_instance} + arguments.instance_count
                                        : std::uint64_t{arguments.first_vertex} + arguments.vertex_count;
        if (arguments.vertex_count == 0 || arguments.instance_count == 0) continue;
        Check failed;
        const BoundBuffer& bound = vertex_buffers_[attribute.buffer];
        const BufferObject* buffer = look_up(bound.buffer, attempted, "vertex buffer", failed);
        if (!buffer) return failed;
        const std::uint64_t end = (count - 1) * layout.stride + attribute.offset + info(attribute.format).block_bytes;
        const std::uint64_t left = buffer->desc.size - bound.offset;
        if (end > left)
            return problem(
                Rule::vertex_range, attempted,
                fmt::format("expected {} {} of {} bytes with attribute {} within the {} bytes of buffer '{}' from "
                            "offset {}, found an end at byte {}",
                            count, layout.per_instance ? "instances" : "vertices", layout.stride, attribute.location,
                            left, buffer->desc.name, bound.offset, end),
                "Draw less, or make the buffer larger.", subject);
    }
    return {};
}

Check CommandValidator::check_index_buffer(const char* attempted, std::uint64_t& indices) {
    if (!index_buffer_.buffer)
        return problem(Rule::index_buffer_missing, attempted, "expected an index buffer, found none",
                       "Call set_index_buffer in the render pass.");
    Check failed;
    const BufferObject* buffer = look_up(index_buffer_.buffer, attempted, "index buffer", failed);
    if (!buffer) return failed;
    indices = (buffer->desc.size - index_buffer_.offset) / (index_type_ == IndexType::uint16 ? 2 : 4);
    return {};
}

Check CommandValidator::draw(const DrawArguments& arguments) {
    const char* attempted = "draw";
    const std::shared_lock lock(device_->tables_mutex);
    const GraphicsPipelineObject* pipeline = nullptr;
    if (auto failed = check_draw(attempted, pipeline)) return failed;
    if (arguments.first_instance != 0 && !capabilities().base_instance)
        return problem(Rule::first_instance, attempted,
                       fmt::format("expected first_instance 0 on a device without base_instance, found {}",
                                   arguments.first_instance),
                       "Add the number in the shader, from a push constant.");
    return check_vertices(*pipeline, attempted, arguments, true, true);
}

Check CommandValidator::draw_indexed(const DrawIndexedArguments& arguments) {
    const char* attempted = "draw indexed";
    const std::shared_lock lock(device_->tables_mutex);
    const GraphicsPipelineObject* pipeline = nullptr;
    if (auto failed = check_draw(attempted, pipeline)) return failed;
    if (arguments.first_instance != 0 && !capabilities().base_instance)
        return problem(Rule::first_instance, attempted,
                       fmt::format("expected first_instance 0 on a device without base_instance, found {}",
                                   arguments.first_instance),
                       "Add the number in the shader, from a push constant.");
    std::uint64_t indices = 0;
    if (auto failed = check_index_buffer(attempted, indices)) return failed;
    if (std::uint64_t{arguments.first_index} + arguments.index_count > indices)
        return problem(Rule::index_range, attempted,
                       fmt::format("expected indices below {}, found {} from {}", indices, arguments.index_count,
                                   arguments.first_index),
                       "Draw less, or make the index buffer larger.");
    // Which vertices are read is in the index buffer; instances are known.
    return check_vertices(*pipeline, attempted,
                          {arguments.index_count, arguments.instance_count, 0, arguments.first_instance}, false, true);
}

Check CommandValidator::check_indirect(const char* attempted, Buffer arguments, std::uint64_t offset,
                                       std::uint32_t count, std::uint32_t stride, std::uint32_t bytes) {
    Check failed;
    const BufferObject* buffer = look_up(arguments, attempted, "buffer", failed);
    if (!buffer) return failed;
    const std::string subject = fmt::format("buffer '{}'", buffer->desc.name);
    if (!has_all(buffer->desc.usage, BufferUsage::indirect))
        return problem(Rule::indirect_use, attempted,
                       fmt::format("expected usage indirect, found {}", text_of(buffer->desc.usage)),
                       "Add the usage where the buffer is created.", subject);
    if (offset % 4 != 0 || (count > 1 && (stride % 4 != 0 || stride < bytes)))
        return problem(
            Rule::indirect_use, attempted,
            fmt::format("expected an offset that is a multiple of 4 and a stride of at least {}, found {} and {}",
                        bytes, offset, stride),
            "Correct offset and stride.", subject);
    if (count == 0) return {};
    const std::uint64_t needed = std::uint64_t{count - 1} * stride + bytes;
    if (offset > buffer->desc.size || needed > buffer->desc.size - offset)
        return problem(
            Rule::indirect_range, attempted,
            fmt::format("expected {} bytes from offset {} within {}, found less", needed, offset, buffer->desc.size),
            "Correct offset and count, or make the buffer larger.", subject);
    return {};
}

Check CommandValidator::draw_indirect(Buffer arguments, std::uint64_t offset, std::uint32_t count, std::uint32_t stride,
                                      bool indexed) {
    const char* attempted = indexed ? "draw indexed indirect" : "draw indirect";
    const std::shared_lock lock(device_->tables_mutex);
    const GraphicsPipelineObject* pipeline = nullptr;
    if (auto failed = check_draw(attempted, pipeline)) return failed;
    if (auto failed = check_vertices(*pipeline, attempted, {}, false, false)) return failed;
    if (indexed) {
        std::uint64_t indices = 0;
        if (auto failed = check_index_buffer(attempted, indices)) return failed;
    }
    return check_indirect(attempted, arguments, offset, count, stride,
                          indexed ? sizeof(DrawIndexedArguments) : sizeof(DrawArguments));
}

Check CommandValidator::dispatch(const DispatchArguments& groups) {
    const char* attempted = "dispatch";
    if (auto failed = outside(attempted)) return failed;
    const auto& limit = capabilities().max_workgroup_count;
    if (groups.x > limit[0] || groups.y > limit[1] || groups.z > limit[2])
        return problem(Rule::dispatch_limit, attempted,
                       fmt::format("expected at most {}x{}x{} workgroups (max_workgroup_count), found {}x{}x{}",
                                   limit[0], limit[1], limit[2], groups.x, groups.y, groups.z),
                       "Dispatch several times, or do more in each invocation.");
    if (!compute_)
        return problem(Rule::no_pipeline, attempted, "expected a compute pipeline, found none",
                       "Call set_pipeline before; the begin and the end of a render pass unset it.");
    const std::shared_lock lock(device_->tables_mutex);
    Check failed;
    const ComputePipelineObject* pipeline = look_up(compute_, attempted, "compute pipeline", failed);
    if (!pipeline) return failed;
    if (auto wrong = check_groups(pipeline->common, attempted)) return wrong;
    return check_push_constants(pipeline->common, attempted);
}

Check CommandValidator::dispatch_indirect(Buffer arguments, std::uint64_t offset) {
    if (auto failed = dispatch({0, 0, 0})) {
        failed->attempted = "dispatch indirect";
        return failed;
    }
    const std::shared_lock lock(device_->tables_mutex);
    return check_indirect("dispatch indirect", arguments, offset, 1, 0, sizeof(DispatchArguments));
}

}  // namespace nacre::rhi
