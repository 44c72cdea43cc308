// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "rhi/objects.h"

namespace nacre::rhi {

/// Works out the barriers of one submission.
///
/// Work is cut into scopes: a dispatch, a copy, a clear, or a whole render pass (which cannot hold barriers, so its
/// barriers come before it). All uses of a scope are collected first; then each resource that it touches moves from
/// the state that the work before left it in to the union of its uses.
///
///     tracker.begin_scope();
///     tracker.use(buffer, {ResourceUse::storage_write, ShaderStage::compute});
///     tracker.end_scope(header_of_the_dispatch);
///
/// States are kept in the objects and carry over to the next submission; `rollback` takes back everything since
/// `begin_submission`. Used under the device's lock.
class StateTracker {
  public:
    void begin_submission();
    void rollback();

    void begin_scope();
    /// Adds a use to the current scope. False where it contradicts another use of the scope.
    bool use(BufferObject& buffer, ResourceState state);
    bool use(AccelerationStructureObject& structure, ResourceState state);
    bool use(TextureObject& texture, const SubresourceRange& range, ResourceState state, bool discard = false);
    /// Ends the scope: emits the barriers that it needs before the given command (null: at the end of the submission).
    void end_scope(const CommandHeader* before);

    /// Emits a barrier for a buffer that has no tracked state.
    void add_barrier(const CommandHeader* before, BackendBuffer& buffer, ResourceState from, ResourceState to);

    /// Number of the current scope, never used before in this device.
    [[nodiscard]] std::uint64_t epoch() const { return epoch_; }
    /// What the current scope has touched so far.
    [[nodiscard]] const std::vector<BufferObject*>& scope_buffers() const { return scope_buffers_; }
    [[nodiscard]] const std::vector<TextureObject*>& scope_textures() const { return scope_textures_; }
    [[nodiscard]] const std::vector<AccelerationStructureObject*>& scope_structures() const {
        return scope_structures_;
    }
    /// All that the submission has changed the state of.
    [[nodiscard]] const std::vector<BufferObject*>& touched_buffers() const { return touched_buffers_; }
    [[nodiscard]] const std::vector<TextureObject*>& touched_textures() const { return touched_textures_; }

    [[nodiscard]] const std::vector<BarrierBatch>& batches() const { return batches_; }
    [[nodiscard]] const std::vector<Barrier>& barriers() const { return barriers_; }

  private:
    void save(BufferObject& buffer);
    void save(TextureObject& texture);
    void save(AccelerationStructureObject& structure);
    void transition(BufferObject& buffer);
    void transition(AccelerationStructureObject& structure);
    void transition(TextureObject& texture);

    std::uint64_t epoch_ = 1;
    std::uint64_t submission_epoch_ = 0;
    std::vector<BufferObject*> scope_buffers_, touched_buffers_;
    std::vector<TextureObject*> scope_textures_, touched_textures_;
    std::vector<AccelerationStructureObject*> scope_structures_, touched_structures_;
    std::vector<BarrierBatch> batches_;
    std::vector<Barrier> barriers_;
};

/// All uses of a scope on one resource, as text for messages: "storage_write (compute)".
std::string text_of(ResourceState state);
std::string text_of(ResourceUse use);
std::string text_of(ShaderStage stages);

}  // namespace nacre::rhi
