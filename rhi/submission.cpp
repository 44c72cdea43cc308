// SPDX-License-Identifier: Apache-2.0
// From recorded lists to what a backend executes.
#include <type_traits>

#include "rhi/device_state.h"
#include "rhi/submission_walk.h"

namespace nacre::rhi {
namespace {

/// Turns the writes that wait into commands: as many copies as possible between two sets of barriers.
void record_writes(DeviceState& device, CommandStream& stream) {
    stream.clear();
    stream.name = "content writes";
    ObjectTables& tables = device.tables();
    StateTracker& tracker = device.tracker;
    CommandHeader* first = nullptr;      // Command that the barriers of the open scope stand before.
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
Expected<std::uint64_t> DeviceState::execute(std::span<CommandStream* const> streams, bool has_writes,
                                             std::span<const UnstatedUse> unstated) {
    // Once for each chunk, and only now: a device may read a chunk from the flush on, so nothing more is written into
    // it until the submission is complete.
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
    std::vector<BackendBuffer*> host_buffers;
    if (backend->wants_uses())
        for (const BufferObject* buffer : tracker.touched_buffers())
            if (buffer->desc.memory != MemoryKind::device) host_buffers.push_back(buffer->backend.get());
    plan.unstated = unstated;
    plan.host_buffers = host_buffers;
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
    NACRE_TRY(const std::uint64_t serial, execute(all, has_writes, walk.unstated_uses()));
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
