// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <optional>

#include "rhi/command_validator.h"
#include "rhi/device_state.h"

namespace nacre::rhi {
namespace {

using GroupUses = std::array<BindGroupObject*, most_bind_groups>;

ResourceState for_stages(ResourceState state, ShaderStage stages) { return {state.use, state.stages & stages}; }

SubresourceRange range_of(const ViewReference& view) {
    return {view.base_mip, view.mip_count, view.base_layer, view.layer_count};
}

/// Walks the lists of one submission: replaces handles by the backend's objects and tells the tracker what commands use.
///
/// Checks here hold in every build and with validation off: handles, the order of passes, that what a draw needs is bound,
/// and that copies stay inside of their resources. Those of draws and dispatches cost a comparison each.
class SubmissionWalk {
  public:
    explicit SubmissionWalk(DeviceState& device) : device_(device), tables_(device.tables()), tracker_(device.tracker) {}

    Expected<void> walk(CommandStream& stream);
    /// Barriers after the last command: what the host is going to read.
    Expected<void> finish();

    [[nodiscard]] const std::vector<std::pair<QueryPoolObject*, std::uint32_t>>& written_queries() const {
        return written_queries_;
    }
    [[nodiscard]] std::vector<Problem>& statement_problems() { return statement_problems_; }

  private:
    using Step = std::optional<Problem>;

    Step visit(CommandHeader& header, std::byte* payload);
    Step begin_pass(CommandHeader& header, BeginRenderPassCommand& command);
    Step end_pass();
    Step draw(const char* attempted, bool indexed);
    Step dispatch(CommandHeader& header, DispatchIndirectCommand* indirect);
    Step merge_group(BindGroupObject& group, ShaderStage stages, const char* attempted);
    Step check_group(BindGroupObject& group, const char* attempted);
    Step resolve_view(ViewReference& view, const char* attempted, TextureObject*& texture, bool single);
    Step check_copy(const CommandHeader& header, std::byte* payload);
    Step copy_scope(CommandHeader& header);
    Step hazard(const char* attempted, std::string what, ResourceState state, bool is_texture) const;
    void unset_state();

    Step use(const char* attempted, BufferObject& buffer, ResourceState state) {
        if (tracker_.use(buffer, state)) return {};
        return hazard(attempted, "buffer '" + buffer.desc.name + "'", buffer.scope_state, false);
    }
    Step use(const char* attempted, TextureObject& texture, const SubresourceRange& range, ResourceState state,
             bool discard = false) {
        if (tracker_.use(texture, range, state, discard)) return {};
        ResourceState all = texture.scope_state;
        for (const ResourceState& part : texture.scope_states) all = {all.use | part.use, all.stages | part.stages};
        return hazard(attempted, "texture '" + texture.desc.name + "'", all, true);
    }

    /// Looks an object up; on failure `problem_` is set and null is returned.
    template <typename HandleType>
    auto* look_up(HandleType handle, const char* attempted, const char* kind) {
        auto& table = tables_.table(handle);
        auto* object = table.find(handle);
        if (!object) [[unlikely]] problem_ = handle_problem(table, handle, attempted, kind);
        return object;
    }

    [[nodiscard]] Problem misuse(Rule rule, const char* attempted, std::string reason, std::string remedy) const {
        return {rule, ErrorCode::validation, attempted, place(), std::move(reason), std::move(remedy)};
    }
    [[nodiscard]] std::string place() const {
        std::string text = "list '" + stream_->name + "'";
        if (pass_) text += ", pass '" + stream_->strings[pass_->name] + "'";
        return text;
    }

    void note_statement();
    void end_statement();

    DeviceState& device_;
    ObjectTables& tables_;
    StateTracker& tracker_;
    CommandStream* stream_ = nullptr;
    std::optional<Problem> problem_;

    BeginRenderPassCommand* pass_ = nullptr;
    CommandHeader* pass_header_ = nullptr;
    GraphicsPipelineObject* graphics_ = nullptr;
    ComputePipelineObject* compute_ = nullptr;
    GroupUses groups_{};
    std::uint32_t bound_ = 0;   ///< Bit for each index with a group.
    std::uint32_t fresh_ = 0;   ///< Bit for each index whose group may not be merged into the pass yet.
    std::uint32_t vertex_buffers_ = 0;
    bool has_index_buffer_ = false;

    std::vector<std::pair<QueryPoolObject*, std::uint32_t>> written_queries_;

    // Verify mode.
    bool in_statement_ = false;
    std::string statement_name_;
    std::vector<StatedAccess> stated_;
    std::map<std::pair<bool, std::uint64_t>, ResourceUse> actual_;  ///< By (is texture, handle's index).
    std::vector<Problem> statement_problems_;
};

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
        if (!failed) [[likely]] failed = visit(header, payload);
    });
    if (!failed && pass_)
        failed = misuse(Rule::render_pass_open, "submit", "expected the render pass to be ended, found it open",
                        "Call end_render_pass before submitting.");
    if (!failed && in_statement_)
        failed = misuse(Rule::statement_unbalanced, "submit", "expected the statement '" + statement_name_ +
                        "' to be ended, found it open", "Call end_statement before submitting.");
    if (failed) return device_.reject(std::move(*failed));
    return {};
}

SubmissionWalk::Step SubmissionWalk::hazard(const char* attempted, std::string what, ResourceState state,
                                            bool is_texture) const {
    return Problem{is_texture ? Rule::texture_hazard : Rule::buffer_hazard, ErrorCode::validation, attempted,
                   place() + ", " + what,
                   "expected uses that can be had at the same time, found " + text_of(state) + " in one " +
                       (pass_ ? "render pass" : "command"),
                   pass_ ? "Split the render pass, or use another resource for one of the two."
                         : "Use another resource for one of the two, or split the work."};
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
        return Problem{Rule::view_range, ErrorCode::validation, attempted, place() + ", texture '" + desc.name + "'",
                       fmt::format("expected mips below {} and layers below {}, found {} mips from {} and {} layers from {}",
                                   desc.mips, layers_of(desc), view.mip_count, view.base_mip, view.layer_count,
                                   view.base_layer),
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
        const bool discard = command.depth_load != LoadOperation::load &&
                             (!has_stencil || command.stencil_load != LoadOperation::load);
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
                return Problem{Rule::destroyed_in_bind_group, ErrorCode::validation, attempted,
                               place() + ", bind group '" + group.name + "', binding " + std::to_string(use.binding),
                               std::string("expected a live ") + kind + ", found one that was destroyed" +
                                   (use.slot->generation == use.generation + 1 && !use.slot->last_name.empty()
                                        ? " ('" + use.slot->last_name + "')"
                                        : ""),
                               "Destroy it after the bind group's last use, or make a new bind group."};
        return {};
    };
    if (auto failed = stale(group.buffers, "buffer")) return failed;
    if (auto failed = stale(group.textures, "texture")) return failed;
    if (auto failed = stale(group.samplers, "sampler")) return failed;
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
        return misuse(Rule::vertex_buffer_missing, attempted,
                      fmt::format("expected a vertex buffer at slot {} for pipeline '{}', found none",
                                  std::countr_zero(graphics_->vertex_buffer_mask & ~vertex_buffers_),
                                  graphics_->common.name),
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
            return misuse(Rule::bind_group_layout_mismatch, attempted,
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
            return misuse(Rule::bind_group_layout_mismatch, attempted,
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

SubmissionWalk::Step SubmissionWalk::copy_scope(CommandHeader& header) {
    tracker_.end_scope(&header);
    note_statement();
    return {};
}

/// Copies that nobody has checked while they were recorded. They are few, and a driver does not check them either.
SubmissionWalk::Step SubmissionWalk::check_copy(const CommandHeader& header, std::byte* payload) {
    CommandValidator validator(device_.shared, stream_->name);
    switch (header.type) {
        case CommandType::copy_buffer: {
            const auto& copy = *reinterpret_cast<CopyBufferCommand*>(payload);
            return validator.copy_buffer(copy.source.handle, copy.source_offset, copy.destination.handle,
                                         copy.destination_offset, copy.size);
        }
        case CommandType::copy_buffer_to_texture: {
            const auto& copy = *reinterpret_cast<CopyBufferToTextureCommand*>(payload);
            return validator.copy_buffer_and_texture(copy.source.handle, copy.destination.handle, copy.region, true);
        }
        case CommandType::copy_texture_to_buffer: {
            const auto& copy = *reinterpret_cast<CopyTextureToBufferCommand*>(payload);
            return validator.copy_buffer_and_texture(copy.destination.handle, copy.source.handle, copy.region, false);
        }
        case CommandType::copy_texture: {
            const auto& copy = *reinterpret_cast<CopyTextureCommand*>(payload);
            return validator.copy_texture(copy.source.handle, copy.destination.handle, copy.region);
        }
        case CommandType::fill_buffer: {
            const auto& fill = *reinterpret_cast<FillBufferCommand*>(payload);
            return validator.fill_buffer(fill.buffer.handle, fill.offset, fill.size);
        }
        default: return {};
    }
}

SubmissionWalk::Step SubmissionWalk::visit(CommandHeader& header, std::byte* payload) {
    const auto as = [&]<typename T>(std::type_identity<T>) -> T& { return *reinterpret_cast<T*>(payload); };
    const auto outside = [&](const char* attempted) -> Step {
        if (!pass_) return {};
        return misuse(Rule::inside_render_pass, attempted, "expected no open render pass, found one",
                      "Move it before begin_render_pass or after end_render_pass.");
    };
    const auto buffer_of = [&](BufferReference& reference, const char* attempted) -> BufferObject* {
        BufferObject* buffer = look_up(reference.handle, attempted, "buffer");
        if (buffer) reference.object = buffer->backend.get();
        return buffer;
    };
    const auto texture_of = [&](TextureReference& reference, const char* attempted) -> TextureObject* {
        TextureObject* texture = look_up(reference.handle, attempted, "texture");
        if (texture) reference.object = texture->backend.get();
        return texture;
    };
    constexpr ResourceState source{ResourceUse::copy_source, ShaderStage::none};
    constexpr ResourceState destination{ResourceUse::copy_destination, ShaderStage::none};

    if (!stream_->validator && header.type >= CommandType::copy_buffer && header.type <= CommandType::fill_buffer)
        if (auto failed = check_copy(header, payload)) return failed;
    switch (header.type) {
        case CommandType::begin_render_pass:
            return begin_pass(header, as(std::type_identity<BeginRenderPassCommand>{}));
        case CommandType::end_render_pass: return end_pass();

        case CommandType::set_graphics_pipeline: {
            auto& command = as(std::type_identity<SetGraphicsPipelineCommand>{});
            GraphicsPipelineObject* pipeline = look_up(command.pipeline.handle, "set pipeline", "graphics pipeline");
            if (!pipeline) return std::move(problem_);
            if (!pass_)
                return misuse(Rule::outside_render_pass, "set pipeline",
                              "expected an open render pass for a graphics pipeline, found none",
                              "Set graphics pipelines after begin_render_pass.");
            command.pipeline.object = pipeline->backend.get();
            // Groups that were merged for another pipeline are checked against the layouts of this one.
            if (graphics_ != pipeline) fresh_ = bound_;
            graphics_ = pipeline;
            return {};
        }
        case CommandType::set_compute_pipeline: {
            auto& command = as(std::type_identity<SetComputePipelineCommand>{});
            ComputePipelineObject* pipeline = look_up(command.pipeline.handle, "set pipeline", "compute pipeline");
            if (!pipeline) return std::move(problem_);
            if (auto failed = outside("set pipeline")) return failed;
            command.pipeline.object = pipeline->backend.get();
            compute_ = pipeline;
            return {};
        }
        case CommandType::set_bind_group: {
            auto& command = as(std::type_identity<SetBindGroupCommand>{});
            BindGroupObject* group = look_up(command.group.handle, "set bind group", "bind group");
            if (!group) return std::move(problem_);
            if (command.index >= most_bind_groups || command.index >= device_.capabilities().max_bind_groups)
                return misuse(Rule::bind_group_index, "set bind group",
                              fmt::format("expected an index below {} (max_bind_groups), found {}",
                                          device_.capabilities().max_bind_groups, command.index),
                              "Use a lower bind-group index.");
            if (group->checked_epoch != device_.destructions)
                if (auto failed = check_group(*group, "set bind group")) return failed;
            command.group.object = group->backend.get();
            groups_[command.index] = group;
            bound_ |= 1u << command.index;
            fresh_ |= 1u << command.index;
            return {};
        }
        case CommandType::set_vertex_buffer: {
            auto& command = as(std::type_identity<SetVertexBufferCommand>{});
            BufferObject* buffer = buffer_of(command.buffer, "set vertex buffer");
            if (!buffer) return std::move(problem_);
            if (!pass_)
                return misuse(Rule::outside_render_pass, "set vertex buffer", "expected an open render pass, found none",
                              "Set vertex buffers after begin_render_pass.");
            if (command.slot >= most_vertex_buffers || command.slot >= device_.capabilities().max_vertex_buffers)
                return misuse(Rule::vertex_buffer_use, "set vertex buffer",
                              fmt::format("expected a slot below {} (max_vertex_buffers), found {}",
                                          device_.capabilities().max_vertex_buffers, command.slot),
                              "Use a lower slot.");
            vertex_buffers_ |= 1u << command.slot;
            return use("set vertex buffer", *buffer, {ResourceUse::vertex_buffer, ShaderStage::none});
        }
        case CommandType::set_index_buffer: {
            auto& command = as(std::type_identity<SetIndexBufferCommand>{});
            BufferObject* buffer = buffer_of(command.buffer, "set index buffer");
            if (!buffer) return std::move(problem_);
            if (!pass_)
                return misuse(Rule::outside_render_pass, "set index buffer", "expected an open render pass, found none",
                              "Set index buffers after begin_render_pass.");
            has_index_buffer_ = true;
            return use("set index buffer", *buffer, {ResourceUse::index_buffer, ShaderStage::none});
        }
        case CommandType::set_push_constants:
        case CommandType::push_debug_group:
        case CommandType::pop_debug_group: return {};
        case CommandType::set_viewport:
        case CommandType::set_scissor:
        case CommandType::set_stencil_reference:
        case CommandType::set_blend_constants:
            if (pass_) return {};
            return misuse(Rule::outside_render_pass, "set dynamic state", "expected an open render pass, found none",
                          "Set viewport, scissor, stencil reference and blend constants after begin_render_pass.");

        case CommandType::draw: return draw("draw", false);
        case CommandType::draw_indexed: return draw("draw indexed", true);
        case CommandType::draw_indirect: {
            auto& command = as(std::type_identity<DrawIndirectCommand>{});
            if (auto failed = draw("draw indirect", false)) return failed;
            BufferObject* buffer = buffer_of(command.arguments, "draw indirect");
            if (!buffer) return std::move(problem_);
            return use("draw indirect", *buffer, {ResourceUse::indirect_argument, ShaderStage::none});
        }
        case CommandType::draw_indexed_indirect: {
            auto& command = as(std::type_identity<DrawIndexedIndirectCommand>{});
            if (auto failed = draw("draw indexed indirect", true)) return failed;
            BufferObject* buffer = buffer_of(command.arguments, "draw indexed indirect");
            if (!buffer) return std::move(problem_);
            return use("draw indexed indirect", *buffer, {ResourceUse::indirect_argument, ShaderStage::none});
        }
        case CommandType::dispatch: return dispatch(header, nullptr);
        case CommandType::dispatch_indirect:
            return dispatch(header, &as(std::type_identity<DispatchIndirectCommand>{}));

        case CommandType::copy_buffer: {
            auto& command = as(std::type_identity<CopyBufferCommand>{});
            if (auto failed = outside("copy buffer")) return failed;
            BufferObject* from = buffer_of(command.source, "copy buffer");
            if (!from) return std::move(problem_);
            BufferObject* to = buffer_of(command.destination, "copy buffer");
            if (!to) return std::move(problem_);
            tracker_.begin_scope();
            if (auto failed = use("copy buffer", *from, source)) return failed;
            if (auto failed = use("copy buffer", *to, destination)) return failed;
            return copy_scope(header);
        }
        case CommandType::copy_buffer_to_texture: {
            auto& command = as(std::type_identity<CopyBufferToTextureCommand>{});
            if (auto failed = outside("copy buffer to texture")) return failed;
            BufferObject* from = buffer_of(command.source, "copy buffer to texture");
            if (!from) return std::move(problem_);
            TextureObject* to = texture_of(command.destination, "copy buffer to texture");
            if (!to) return std::move(problem_);
            command.region = complete_region(command.region, to->desc);
            const BufferTextureCopy& region = command.region;
            const bool whole = region.extent == mip_extent(to->desc, region.mip) && !info(to->desc.format).has_stencil;
            tracker_.begin_scope();
            if (auto failed = use("copy buffer to texture", *from, source)) return failed;
            if (auto failed = use("copy buffer to texture", *to, {region.mip, 1, region.layer, 1}, destination, whole))
                return failed;
            return copy_scope(header);
        }
        case CommandType::copy_texture_to_buffer: {
            auto& command = as(std::type_identity<CopyTextureToBufferCommand>{});
            if (auto failed = outside("copy texture to buffer")) return failed;
            TextureObject* from = texture_of(command.source, "copy texture to buffer");
            if (!from) return std::move(problem_);
            BufferObject* to = buffer_of(command.destination, "copy texture to buffer");
            if (!to) return std::move(problem_);
            command.region = complete_region(command.region, from->desc);
            tracker_.begin_scope();
            if (auto failed = use("copy texture to buffer", *from, {command.region.mip, 1, command.region.layer, 1}, source))
                return failed;
            if (auto failed = use("copy texture to buffer", *to, destination)) return failed;
            return copy_scope(header);
        }
        case CommandType::copy_texture: {
            auto& command = as(std::type_identity<CopyTextureCommand>{});
            if (auto failed = outside("copy texture")) return failed;
            TextureObject* from = texture_of(command.source, "copy texture");
            if (!from) return std::move(problem_);
            TextureObject* to = texture_of(command.destination, "copy texture");
            if (!to) return std::move(problem_);
            command.region = complete_region(command.region, from->desc);
            const TextureCopy& region = command.region;
            tracker_.begin_scope();
            if (auto failed = use("copy texture", *from,
                                  {region.source_mip, 1, region.source_layer, region.layer_count}, source))
                return failed;
            const bool whole = region.extent == mip_extent(to->desc, region.destination_mip);
            if (auto failed = use("copy texture", *to,
                                  {region.destination_mip, 1, region.destination_layer, region.layer_count}, destination,
                                  whole))
                return failed;
            return copy_scope(header);
        }
        case CommandType::fill_buffer: {
            auto& command = as(std::type_identity<FillBufferCommand>{});
            if (auto failed = outside("fill buffer")) return failed;
            BufferObject* buffer = buffer_of(command.buffer, "fill buffer");
            if (!buffer) return std::move(problem_);
            if (command.size == ~0ull)
                command.size = buffer->desc.size > command.offset ? (buffer->desc.size - command.offset) / 4 * 4 : 0;
            tracker_.begin_scope();
            if (auto failed = use("fill buffer", *buffer, destination)) return failed;
            return copy_scope(header);
        }
        case CommandType::clear_texture:
        case CommandType::clear_depth_stencil: {
            const bool depth = header.type == CommandType::clear_depth_stencil;
            const char* attempted = depth ? "clear depth and stencil" : "clear texture";
            if (auto failed = outside(attempted)) return failed;
            ViewReference& view = depth ? as(std::type_identity<ClearDepthStencilCommand>{}).view
                                        : as(std::type_identity<ClearTextureCommand>{}).view;
            TextureObject* texture = nullptr;
            if (auto failed = resolve_view(view, attempted, texture, false)) return failed;
            tracker_.begin_scope();
            if (auto failed = use(attempted, *texture, range_of(view), destination, true)) return failed;
            return copy_scope(header);
        }
        case CommandType::generate_mips: {
            auto& command = as(std::type_identity<GenerateMipsCommand>{});
            if (auto failed = outside("generate mips")) return failed;
            TextureObject* texture = texture_of(command.texture, "generate mips");
            if (!texture) return std::move(problem_);
            tracker_.begin_scope();
            if (auto failed = use("generate mips", *texture, {0, texture->desc.mips, 0, layers_of(texture->desc)},
                                  destination))
                return failed;
            return copy_scope(header);
        }

        case CommandType::write_timestamp:
        case CommandType::begin_occlusion_query:
        case CommandType::end_occlusion_query: {
            // The three commands have one layout.
            auto& command = as(std::type_identity<WriteTimestampCommand>{});
            const char* attempted = header.type == CommandType::write_timestamp         ? "write timestamp"
                                    : header.type == CommandType::begin_occlusion_query ? "begin occlusion query"
                                                                                        : "end occlusion query";
            QueryPoolObject* pool = look_up(command.pool.handle, attempted, "query pool");
            if (!pool) return std::move(problem_);
            if (command.index >= pool->desc.count)
                return misuse(Rule::query_range, attempted,
                              fmt::format("expected an index below {} for pool '{}', found {}", pool->desc.count,
                                          pool->desc.name, command.index),
                              "Make the pool larger or use a lower index.");
            if (header.type != CommandType::write_timestamp && !pass_)
                return misuse(Rule::outside_render_pass, attempted, "expected an open render pass, found none",
                              "Begin and end occlusion queries within one render pass.");
            command.pool.object = pool->backend.get();
            if (header.type != CommandType::begin_occlusion_query) written_queries_.emplace_back(pool, command.index);
            return {};
        }

        case CommandType::begin_statement: {
            auto& command = as(std::type_identity<BeginStatementCommand>{});
            if (pass_ || in_statement_)
                return misuse(Rule::statement_unbalanced, "begin statement",
                              pass_ ? "expected no open render pass, found one"
                                    : "expected no open statement, found '" + statement_name_ + "'",
                              "Statements stand around render passes and are not nested.");
            in_statement_ = true;
            statement_name_ = stream_->strings[command.name];
            stated_.assign(command.accesses(), command.accesses() + command.count);
            actual_.clear();
            return {};
        }
        case CommandType::end_statement:
            if (pass_ || !in_statement_)
                return misuse(Rule::statement_unbalanced, "end statement",
                              pass_ ? "expected no open render pass, found one" : "expected an open statement, found none",
                              "Pair begin_statement and end_statement outside of render passes.");
            end_statement();
            in_statement_ = false;
            return {};
    }
    return {};
}

void SubmissionWalk::note_statement() {
    if (!in_statement_ || !device_.shared->desc.verify_statements) return;
    for (const BufferObject* buffer : tracker_.scope_buffers())
        actual_[{false, buffer->handle.index}] |= buffer->scope_state.use;
    for (const TextureObject* texture : tracker_.scope_textures()) {
        ResourceUse use = texture->scope_state.use;
        for (const ResourceState& part : texture->scope_states) use |= part.use;
        actual_[{true, texture->handle.index}] |= use;
    }
}

void SubmissionWalk::end_statement() {
    if (!device_.shared->desc.verify_statements) return;
    std::map<std::pair<bool, std::uint64_t>, ResourceUse> stated;
    for (const StatedAccess& access : stated_) {
        if (access.buffer) stated[{false, access.buffer.index}] |= access.use;
        if (access.texture) stated[{true, access.texture.index}] |= access.use;
    }
    const auto name_of_resource = [&](std::pair<bool, std::uint64_t> key) -> std::string {
        std::string name;
        if (key.first)
            tables_.textures.for_each([&](TextureObject& texture) {
                if (texture.handle.index == key.second) name = "texture '" + texture.desc.name + "'";
            });
        else
            tables_.buffers.for_each([&](BufferObject& buffer) {
                if (buffer.handle.index == key.second) name = "buffer '" + buffer.desc.name + "'";
            });
        return name.empty() ? "a destroyed resource" : name;
    };
    const auto tell = [&](Rule rule, std::pair<bool, std::uint64_t> key, ResourceUse expected, ResourceUse found,
                          std::string remedy) {
        statement_problems_.push_back({rule, ErrorCode::validation, "verify statement",
                                       "'" + statement_name_ + "', " + name_of_resource(key),
                                       "the statement names " + text_of(expected) + ", the commands use " + text_of(found),
                                       std::move(remedy)});
    };
    for (const auto& [key, found] : actual_) {
        const auto at = stated.find(key);
        const ResourceUse expected = at == stated.end() ? ResourceUse::none : at->second;
        if (has_any(found, ~expected))
            tell(Rule::statement_missing, key, expected, found, "Add " + text_of(found & ~expected) + " to the statement.");
    }
    for (const auto& [key, expected] : stated) {
        const auto at = actual_.find(key);
        const ResourceUse found = at == actual_.end() ? ResourceUse::none : at->second;
        if (has_any(expected, ~found))
            tell(Rule::statement_superfluous, key, expected, found,
                 "Remove " + text_of(expected & ~found) + " from the statement.");
    }
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
                                   "buffer '" + buffer->desc.name + "'",
                                   "expected it to be unmapped, found it mapped", "Call unmap before submitting."});
    return {};
}

/// Turns the writes that wait into commands: as many copies as possible between two sets of barriers.
void record_writes(DeviceState& device, CommandStream& stream) {
    stream.clear();
    stream.name = "content writes";
    ObjectTables& tables = device.tables();
    StateTracker& tracker = device.tracker;
    CommandHeader* first = nullptr;  // Command that the barriers of the open scope stand before.
    std::vector<std::uint64_t> written;  // Buffers of the open scope.
    tracker.begin_scope();
    const auto header_of = [](auto& command) {
        return reinterpret_cast<CommandHeader*>(reinterpret_cast<std::byte*>(&command) - sizeof(CommandHeader));
    };
    constexpr ResourceState destination{ResourceUse::copy_destination, ShaderStage::none};
    for (const PendingWrite& write : device.pending_writes) {
        if (write.buffer) {
            BufferObject* buffer = tables.buffers.find(write.buffer);
            if (!buffer) continue;  // Destroyed since: nobody can see the write.
            auto& command = stream.append<CopyBufferCommand>();
            command.source.object = write.staging;
            command.destination.object = buffer->backend.get();
            command.source_offset = write.staging_offset;
            command.destination_offset = write.offset;
            command.size = write.size;
            if (buffer->scope_epoch == tracker.epoch()) {
                tracker.end_scope(first);
                tracker.begin_scope();
                first = nullptr;
            }
            if (!first) first = header_of(command);
            tracker.use(*buffer, destination);
        } else {
            TextureObject* texture = tables.textures.find(write.texture);
            if (!texture) continue;
            auto& command = stream.append<CopyBufferToTextureCommand>();
            command.source.object = write.staging;
            command.destination.object = texture->backend.get();
            command.region = write.region;
            command.region.buffer_offset = write.staging_offset;
            const std::size_t part = std::size_t{write.region.layer} * texture->desc.mips + write.region.mip;
            const bool touched = texture->scope_epoch == tracker.epoch();
            const ResourceUse in_scope = !touched                        ? ResourceUse::none
                                         : texture->scope_states.empty() ? texture->scope_state.use
                                                                         : texture->scope_states[part].use;
            if (in_scope != ResourceUse::none) {
                tracker.end_scope(first);
                tracker.begin_scope();
                first = nullptr;
            }
            if (!first) first = header_of(command);
            const bool whole = write.region.extent == mip_extent(texture->desc, write.region.mip) &&
                               !info(texture->desc.format).has_stencil;
            tracker.use(*texture, {write.region.mip, 1, write.region.layer, 1}, destination, whole);
        }
    }
    if (first) tracker.end_scope(first);
}

}  // namespace

/// Hands a planned submission to the backend and takes note of the result.
Expected<std::uint64_t> DeviceState::execute(std::span<CommandStream* const> streams, bool has_writes) {
    // Once for each chunk, and only now: a device may read a chunk from the flush on, so nothing more is written into it
    // until the submission is complete.
    for (const StagingChunk& chunk : staging)
        if (has_writes && chunk.serial == 0 && chunk.used > 0)
            if (auto flushed = backend->flush_mapped(*chunk.buffer); !flushed) {
                note_failure(flushed.error());
                tracker.rollback();
                return std::unexpected(std::move(flushed).error());
            }
    ExecutionPlan plan;
    plan.streams = streams;
    plan.batches = tracker.batches();
    plan.barriers = tracker.barriers();
    plan.serial = submitted_serial + 1;
    auto executed = backend->execute(plan);
    if (!executed) {
        note_failure(executed.error());
        tracker.rollback();
        return std::unexpected(std::move(executed).error());
    }
    submitted_serial = plan.serial;
    if (has_writes) {
        pending_writes.clear();
        pending_bytes = 0;
        for (StagingChunk& chunk : staging)
            if (chunk.serial == 0) chunk.serial = submitted_serial;
        upload_stream.clear();
    }
    return submitted_serial;
}

Expected<std::uint64_t> DeviceState::submit_streams(std::span<CommandStream* const> streams, bool consume_writes) {
    if (lost) return lost_error("submit");
    collect();
    tracker.begin_submission();
    std::vector<CommandStream*> all;
    all.reserve(streams.size() + 1);
    const bool has_writes = consume_writes && !pending_writes.empty();
    if (has_writes) {
        record_writes(*this, upload_stream);
        all.push_back(&upload_stream);
    }
    SubmissionWalk walk(*this);
    for (CommandStream* stream : streams) {
        auto walked = walk.walk(*stream);
        if (!walked) {
            tracker.rollback();
            return std::unexpected(std::move(walked).error());
        }
        all.push_back(stream);
    }
    if (auto finished = walk.finish(); !finished) {
        tracker.rollback();
        return std::unexpected(std::move(finished).error());
    }
    for (Problem& problem : walk.statement_problems()) (void)reject(std::move(problem));
    NACRE_TRY(const std::uint64_t serial, execute(all, has_writes));
    for (const auto& [pool, index] : walk.written_queries()) {
        pool->written[index] = true;
        pool->last_serial = serial;
    }
    return serial;
}

Expected<std::uint64_t> DeviceState::submit_read(CommandStream& stream, BufferObject* buffer, TextureObject* texture,
                                                 const SubresourceRange& range, BackendBuffer& staging_buffer) {
    if (lost) return lost_error("read content");
    tracker.begin_submission();
    std::vector<CommandStream*> all;
    const bool has_writes = !pending_writes.empty();
    if (has_writes) {
        record_writes(*this, upload_stream);
        all.push_back(&upload_stream);
    }
    all.push_back(&stream);
    const CommandHeader* header = nullptr;
    stream.for_each([&](CommandHeader& at, std::byte*) { header = &at; });
    tracker.begin_scope();
    if (buffer) tracker.use(*buffer, {ResourceUse::copy_source, ShaderStage::none});
    if (texture) tracker.use(*texture, range, {ResourceUse::copy_source, ShaderStage::none});
    tracker.end_scope(header);
    // The staging buffer is the backend's alone: it has no object whose state could be tracked.
    tracker.add_barrier(nullptr, staging_buffer, {ResourceUse::copy_destination, ShaderStage::none},
                        {ResourceUse::host_read, ShaderStage::none});
    return execute(all, has_writes);
}

}  // namespace nacre::rhi
