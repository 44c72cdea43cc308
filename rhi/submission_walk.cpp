// SPDX-License-Identifier: Apache-2.0
// Passes, draws, dispatches and bind groups; the other commands are in submission_commands.cpp.
#include "rhi/submission_walk.h"

#include <fmt/format.h>

#include <bit>

namespace nacre::rhi {
namespace {

ResourceState for_stages(ResourceState state, ShaderStage stages) { return {state.use, state.stages & stages}; }

}  // namespace

void SubmissionWalk::unset_state() {
    graphics_ = nullptr;
    compute_ = nullptr;
    bound_ = fresh_ = vertex_buffers_ = 0;
    has_index_buffer_ = false;
}

Expected<void> SubmissionWalk::walk(CommandStream& stream) {
    stream_ = &stream;
    unset_state();
    pass_ = nullptr;
    problem_.reset();
    Step failed;
    stream.for_each([&](CommandHeader& header, std::byte* payload) {
        if (!failed) [[likely]]
            failed = visit(header, payload);
    });
    if (!failed && pass_)
        failed = misuse(Rule::render_pass_open, "submit", "expected the render pass to be ended, found it open",
                        "Call end_render_pass before submitting.");
    if (!failed && in_statement_)
        failed = misuse(Rule::statement_unbalanced, "submit",
                        "expected the statement '" + statement_name_ + "' to be ended, found it open",
                        "Call end_statement before submitting.");
    if (failed) return device_.reject(std::move(*failed));
    return {};
}

SubmissionWalk::Step SubmissionWalk::hazard(const char* attempted, std::string what, ResourceState state,
                                            bool is_texture) const {
    return Problem{
        is_texture ? Rule::texture_hazard : Rule::buffer_hazard,
        ErrorCode::validation,
        attempted,
        place() + ", " + what,
        "expected uses that can be had at the same time, found " + text_of(state) + " in one " +
            (pass_ ? "render pass" : "command"),
        pass_ ? "Declare it readonly in shaders that only read it, split the render pass, or use another resource for "
                "one of the two."
              : "Declare it readonly in shaders that only read it, or use another resource for one of the two."};
}

SubmissionWalk::Step SubmissionWalk::resolve_view(ViewReference& view, const char* attempted, TextureObject*& texture,
                                                  bool single) {
    texture = look_up(view.texture.handle, attempted, "texture");
    if (!texture) return std::move(problem_);
    TextureView wanted;
    wanted.dimension = view.dimension;
    wanted.format = view.format;
    wanted.base_mip = view.base_mip;
    wanted.mip_count = view.mip_count;
    wanted.base_layer = view.base_layer;
    wanted.layer_count = view.layer_count;
    if (single) wanted.mip_count = wanted.layer_count = 1;
    const TextureDesc& desc = texture->desc;
    view = complete_view(wanted, desc);
    if (view.mip_count == 0 || view.layer_count == 0 || view.base_mip >= desc.mips ||
        view.mip_count > desc.mips - view.base_mip || view.base_layer >= layers_of(desc) ||
        view.layer_count > layers_of(desc) - view.base_layer)
        return Problem{
            Rule::view_range,
            ErrorCode::validation,
            attempted,
            place() + ", texture '" + desc.name + "'",
            fmt::format("expected mips below {} and layers below {}, found {} mips from {} and {} layers from {}",
                        desc.mips, layers_of(desc), view.mip_count, view.base_mip, view.layer_count, view.base_layer),
            "View mips and layers that the texture has."};
    if (single && view.dimension != ViewDimension::d1 && view.dimension != ViewDimension::d3)
        view.dimension = ViewDimension::d2;
    view.texture.object = texture->backend.get();
    return {};
}

SubmissionWalk::Step SubmissionWalk::begin_pass(CommandHeader& header, BeginRenderPassCommand& command) {
    if (pass_)
        return misuse(Rule::inside_render_pass, "begin render pass", "expected no open render pass, found one",
                      "Call end_render_pass first.");
    pass_ = &command;
    pass_header_ = &header;
    unset_state();
    tracker_.begin_scope();
    command.width = command.height = command.samples = 0;
    const auto note_extent = [&](const TextureObject& texture, const ViewReference& view) {
        const Extent3D extent = mip_extent(texture.desc, view.base_mip);
        command.width = extent.width;
        command.height = extent.height;
        command.samples = texture.desc.samples;
    };
    for (std::uint32_t i = 0; i < command.color_count; ++i) {
        ColorAttachmentCommand& color = command.colors()[i];
        TextureObject* texture = nullptr;
        if (auto failed = resolve_view(color.view, "begin render pass", texture, true)) return failed;
        note_extent(*texture, color.view);
        if (auto failed = use("begin render pass", *texture, range_of(color.view), {ResourceUse::color_target, {}},
                              color.load != LoadOperation::load))
            return failed;
        if (!color.resolve.texture.handle) {
            color.resolve.texture.object = nullptr;
            continue;
        }
        if (auto failed = resolve_view(color.resolve, "begin render pass", texture, true)) return failed;
        if (auto failed = use("begin render pass", *texture, range_of(color.resolve),
                              {ResourceUse::resolve_destination, {}}, true))
            return failed;
    }
    if (command.has_depth_stencil) {
        TextureObject* texture = nullptr;
        if (auto failed = resolve_view(command.depth_stencil, "begin render pass", texture, true)) return failed;
        note_extent(*texture, command.depth_stencil);
        const bool has_stencil = info(texture->desc.format).has_stencil;
        const bool discard =
            command.depth_load != LoadOperation::load && (!has_stencil || command.stencil_load != LoadOperation::load);
        const ResourceUse depth_use =
            command.read_only ? ResourceUse::depth_stencil_read : ResourceUse::depth_stencil_write;
        if (auto failed = use("begin render pass", *texture, range_of(command.depth_stencil), {depth_use, {}},
                              discard && !command.read_only))
            return failed;
    }
    return {};
}

SubmissionWalk::Step SubmissionWalk::end_pass() {
    if (!pass_)
        return misuse(Rule::outside_render_pass, "end render pass", "expected an open render pass, found none",
                      "Call begin_render_pass first.");
    tracker_.end_scope(pass_header_);
    note_statement();
    pass_ = nullptr;
    unset_state();
    return {};
}

SubmissionWalk::Step SubmissionWalk::check_group(BindGroupObject& group, const char* attempted) {
    const auto stale = [&](const auto& uses, const char* kind) -> Step {
        for (const auto& use : uses)
            if (!use.slot->occupied || use.slot->generation != use.generation)
                return Problem{Rule::destroyed_in_bind_group,
                               ErrorCode::validation,
                               attempted,
                               place() + ", bind group '" + group.name + "', binding " + std::to_string(use.binding),
                               fmt::format("expected a live {}, found one that was destroyed{}", kind,
                                           use.slot->generation == use.generation + 1 && !use.slot->last_name.empty()
                                               ? fmt::format(" ('{}')", use.slot->last_name)
                                               : std::string()),
                               "Destroy it after the bind group's last use, or make a new bind group."};
        return {};
    };
    if (auto failed = stale(group.buffers, "buffer")) return failed;
    if (auto failed = stale(group.textures, "texture")) return failed;
    if (auto failed = stale(group.samplers, "sampler")) return failed;
    if (auto failed = stale(group.acceleration_structures, "acceleration structure")) return failed;
    group.checked_epoch = device_.destructions;
    return {};
}

SubmissionWalk::Step SubmissionWalk::merge_group(BindGroupObject& group, ShaderStage stages, const char* attempted) {
    if (group.checked_epoch != device_.destructions)
        if (auto failed = check_group(group, attempted)) return failed;
    for (const BufferUse& buffer : group.buffers) {
        const ResourceState state = for_stages(buffer.state, stages);
        if (state.stages == ShaderStage::none) continue;
        if (auto failed = use(attempted, buffer.slot->object, state)) return failed;
    }
    for (const TextureUse& texture : group.textures) {
        const ResourceState state = for_stages(texture.state, stages);
        if (state.stages == ShaderStage::none) continue;
        if (auto failed = use(attempted, texture.slot->object, texture.range, state)) return failed;
    }
    for (const AccelerationStructureUse& structure : group.acceleration_structures) {
        const ResourceState state = for_stages(structure.state, stages);
        if (state.stages == ShaderStage::none) continue;
        if (auto failed = check_structure(structure.slot->object, attempted)) return failed;
        if (auto failed = use(attempted, structure.slot->object, state)) return failed;
    }
    group.merged_epoch = tracker_.epoch();
    return {};
}

SubmissionWalk::Step SubmissionWalk::draw(const char* attempted, bool indexed) {
    if (!pass_) [[unlikely]]
        return misuse(Rule::outside_render_pass, attempted, "expected an open render pass, found none",
                      "Call begin_render_pass first.");
    if (!graphics_) [[unlikely]]
        return misuse(Rule::no_pipeline, attempted, "expected a graphics pipeline, found none",
                      "Call set_pipeline in the render pass; the begin of a pass unsets it.");
    if ((vertex_buffers_ & graphics_->vertex_buffer_mask) != graphics_->vertex_buffer_mask) [[unlikely]]
        return misuse(
            Rule::vertex_buffer_missing, attempted,
            fmt::format("expected a vertex buffer at slot {} for pipeline '{}', found none",
                        std::countr_zero(graphics_->vertex_buffer_mask & ~vertex_buffers_), graphics_->common.name),
            "Call set_vertex_buffer in the render pass.");
    if (indexed && !has_index_buffer_) [[unlikely]]
        return misuse(Rule::index_buffer_missing, attempted, "expected an index buffer, found none",
                      "Call set_index_buffer in the render pass.");
    const PipelineCommon& common = graphics_->common;
    if ((bound_ & common.group_mask) != common.group_mask) [[unlikely]]
        return misuse(Rule::bind_group_missing, attempted,
                      fmt::format("expected a bind group at index {} for pipeline '{}', found none",
                                  std::countr_zero(common.group_mask & ~bound_), common.name),
                      "Call set_bind_group in the render pass; the begin of a pass unsets all of them.");
    for (std::uint32_t left = fresh_ & common.group_mask; left != 0; left &= left - 1) {
        const auto index = static_cast<std::uint32_t>(std::countr_zero(left));
        BindGroupObject& group = *groups_[index];
        if (!(group.layout == common.layouts[index])) [[unlikely]]
            return misuse(
                Rule::bind_group_layout_mismatch, attempted,
                fmt::format("expected at index {} a bind group of the layout of pipeline '{}', found bind group "
                            "'{}' of another layout",
                            index, common.name, group.name),
                "Make the group with Device::bind_group_layout(pipeline, index).");
        if (group.merged_epoch == tracker_.epoch()) continue;
        if (auto failed = merge_group(group, ShaderStage::vertex | ShaderStage::fragment, attempted)) return failed;
    }
    fresh_ &= ~common.group_mask;
    return {};
}

SubmissionWalk::Step SubmissionWalk::dispatch(CommandHeader& header, DispatchIndirectCommand* indirect) {
    const char* attempted = indirect ? "dispatch indirect" : "dispatch";
    if (pass_)
        return misuse(Rule::inside_render_pass, attempted, "expected no open render pass, found one",
                      "Dispatch before begin_render_pass or after end_render_pass.");
    if (!compute_)
        return misuse(Rule::no_pipeline, attempted, "expected a compute pipeline, found none",
                      "Call set_pipeline before; the begin and the end of a render pass unset it.");
    const PipelineCommon& common = compute_->common;
    if ((bound_ & common.group_mask) != common.group_mask)
        return misuse(Rule::bind_group_missing, attempted,
                      fmt::format("expected a bind group at index {} for pipeline '{}', found none",
                                  std::countr_zero(common.group_mask & ~bound_), common.name),
                      "Call set_bind_group before; the begin and the end of a render pass unset all of them.");
    tracker_.begin_scope();
    for (std::uint32_t left = common.group_mask; left != 0; left &= left - 1) {
        const auto index = static_cast<std::uint32_t>(std::countr_zero(left));
        BindGroupObject& group = *groups_[index];
        if (!(group.layout == common.layouts[index]))
            return misuse(
                Rule::bind_group_layout_mismatch, attempted,
                fmt::format("expected at index {} a bind group of the layout of pipeline '{}', found bind group "
                            "'{}' of another layout",
                            index, common.name, group.name),
                "Make the group with Device::bind_group_layout(pipeline, index).");
        if (auto failed = merge_group(group, ShaderStage::compute, attempted)) return failed;
    }
    if (indirect) {
        BufferObject* arguments = look_up(indirect->arguments.handle, attempted, "buffer");
        if (!arguments) return std::move(problem_);
        indirect->arguments.object = arguments->backend.get();
        if (auto failed = use(attempted, *arguments, {ResourceUse::indirect_argument, {}})) return failed;
    }
    tracker_.end_scope(&header);
    note_statement();
    return {};
}

Expected<void> SubmissionWalk::finish() {
    tracker_.begin_scope();
    for (BufferObject* buffer : tracker_.touched_buffers())
        if (buffer->desc.memory == MemoryKind::readback && has_any(buffer->state.use, writing_uses))
            tracker_.use(*buffer, {ResourceUse::host_read, ShaderStage::none});
    tracker_.end_scope(nullptr);
    if (device_.mapped_buffers == 0) return {};
    for (const BufferObject* buffer : tracker_.touched_buffers())
        if (buffer->is_mapped)
            return device_.reject({Rule::mapped_in_submission, ErrorCode::validation, "submit",
                                   "buffer '" + buffer->desc.name + "'", "expected it to be unmapped, found it mapped",
                                   "Call unmap before submitting."});
    return {};
}

}  // namespace nacre::rhi
