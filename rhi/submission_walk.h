// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rhi/device_state.h"

namespace nacre::rhi {

/// The part of a texture that a recorded view shows.
[[nodiscard]] inline SubresourceRange range_of(const ViewReference& view) {
    return {view.base_mip, view.mip_count, view.base_layer, view.layer_count};
}

/// Walks the lists of one submission: replaces handles by the backend's objects and tells the tracker what commands
/// use.
///
/// Checks here hold in every build and with validation off: handles, the order of passes, that what a draw needs is
/// bound, and that copies stay inside of their resources. Those of draws and dispatches cost a comparison each.
class SubmissionWalk {
  public:
    explicit SubmissionWalk(DeviceState& device)
        : device_(device), tables_(device.tables()), tracker_(device.tracker) {}

    Expected<void> walk(CommandStream& stream);
    /// Barriers after the last command: what the host is going to read.
    Expected<void> finish();

    [[nodiscard]] const std::vector<std::pair<QueryPoolObject*, std::uint32_t>>& written_queries() const {
        return written_queries_;
    }
    [[nodiscard]] std::vector<Problem>& statement_problems() { return statement_problems_; }
    [[nodiscard]] const std::vector<UnstatedUse>& unstated_uses() const { return unstated_uses_; }

  private:
    using GroupUses = std::array<BindGroupObject*, most_bind_groups>;
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
    Step build(CommandHeader& header, BuildAccelerationStructureCommand& command);
    Step check_structure(const AccelerationStructureObject& structure, const char* attempted) const;
    Step hazard(const char* attempted, std::string what, ResourceState state, bool is_texture) const;
    void unset_state();

    Step use(const char* attempted, BufferObject& buffer, ResourceState state) {
        if (tracker_.use(buffer, state)) return {};
        return hazard(attempted, "buffer '" + buffer.desc.name + "'", buffer.scope_state, false);
    }
    Step use(const char* attempted, AccelerationStructureObject& structure, ResourceState state) {
        if (tracker_.use(structure, state)) return {};
        return hazard(attempted, "acceleration structure '" + structure.desc.name + "'", structure.scope_state, false);
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
        if (!object) [[unlikely]]
            problem_ = handle_problem(table, handle, attempted, kind);
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

    [[nodiscard]] bool follows_statements() const {
        return device_.shared->desc.verify_statements || device_.backend->wants_uses();
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
    std::uint32_t bound_ = 0;  ///< Bit for each index with a group.
    std::uint32_t fresh_ = 0;  ///< Bit for each index whose group may not be merged into the pass yet.
    std::uint32_t vertex_buffers_ = 0;
    bool has_index_buffer_ = false;

    std::vector<std::pair<QueryPoolObject*, std::uint32_t>> written_queries_;

    // Verify mode.
    bool in_statement_ = false;
    std::string statement_name_;
    std::vector<StatedAccess> stated_;
    /// Kind of a resource and the index of its handle.
    enum class ResourceKind : std::uint8_t { buffer, texture, acceleration_structure };
    using ResourceKey = std::pair<ResourceKind, std::uint64_t>;
    std::map<ResourceKey, ResourceUse> actual_;
    std::map<ResourceKey, BackendObject*> used_objects_;
    const CommandHeader* statement_ = nullptr;
    std::vector<UnstatedUse> unstated_uses_;
    std::vector<Problem> statement_problems_;
};

}  // namespace nacre::rhi
