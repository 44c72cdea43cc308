// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "rhi/backend.h"
#include "rhi/objects.h"
#include "rhi/state_tracker.h"
#include "rhi/validation_rules.h"

/// @file
/// What a device is made of, for the front end's own files.
///
/// Two locks. `DeviceState::mutex` orders all calls of the backend and everything that changes state. The tables of
/// objects are changed under that lock and `DeviceShared::tables_mutex` together, so that whoever holds either may
/// look: a submission holds the first, the validation of a recording thread takes the second, shared, and never waits
/// for a pipeline that is being compiled. Locks are taken in this order; messages are given under neither of them where
/// that can be avoided, and the callback may not call the device.

namespace nacre::rhi {

/// Where messages go. Thread-safe.
class MessageSink {
  public:
    void set_callback(std::function<void(const Message&)> callback);
    void send(const Message& message);
    [[nodiscard]] std::uint64_t errors() const { return errors_.load(std::memory_order_relaxed); }

    /// Reports a broken rule as a message, and makes the error that the call returns.
    std::unexpected<Error> reject(Problem problem);

  private:
    std::mutex mutex_;
    std::function<void(const Message&)> callback_;
    std::atomic<std::uint64_t> errors_{0};
};

/// Keeps the memory of command lists that were submitted, for the next ones. Thread-safe.
class StreamPool {
  public:
    std::unique_ptr<CommandStream> take();
    void give_back(std::unique_ptr<CommandStream> stream);

  private:
    std::mutex mutex_;
    std::vector<std::unique_ptr<CommandStream>> free_;
};

/// All objects of a device by handle.
struct ObjectTables {
    explicit ObjectTables(std::uint16_t device)
        : buffers(device),
          textures(device),
          samplers(device),
          shaders(device),
          layouts(device),
          groups(device),
          graphics_pipelines(device),
          compute_pipelines(device),
          query_pools(device),
          acceleration_structures(device) {}
    SlotTable<Buffer, BufferObject> buffers;
    SlotTable<Texture, TextureObject> textures;
    SlotTable<Sampler, SamplerObject> samplers;
    SlotTable<Shader, ShaderObject> shaders;
    SlotTable<BindGroupLayout, BindGroupLayoutObject> layouts;
    SlotTable<BindGroup, BindGroupObject> groups;
    SlotTable<GraphicsPipeline, GraphicsPipelineObject> graphics_pipelines;
    SlotTable<ComputePipeline, ComputePipelineObject> compute_pipelines;
    SlotTable<QueryPool, QueryPoolObject> query_pools;
    SlotTable<AccelerationStructure, AccelerationStructureObject> acceleration_structures;

    /// Frees all objects, users of others before what they use.
    void clear() {
        const std::uint16_t device = buffers.device();
        graphics_pipelines = SlotTable<GraphicsPipeline, GraphicsPipelineObject>(device);
        compute_pipelines = SlotTable<ComputePipeline, ComputePipelineObject>(device);
        groups = SlotTable<BindGroup, BindGroupObject>(device);
        layouts = SlotTable<BindGroupLayout, BindGroupLayoutObject>(device);
        shaders = SlotTable<Shader, ShaderObject>(device);
        query_pools = SlotTable<QueryPool, QueryPoolObject>(device);
        samplers = SlotTable<Sampler, SamplerObject>(device);
        acceleration_structures = SlotTable<AccelerationStructure, AccelerationStructureObject>(device);
        textures = SlotTable<Texture, TextureObject>(device);
        buffers = SlotTable<Buffer, BufferObject>(device);
    }

    auto& table(Buffer) { return buffers; }
    auto& table(Texture) { return textures; }
    auto& table(Sampler) { return samplers; }
    auto& table(Shader) { return shaders; }
    auto& table(BindGroupLayout) { return layouts; }
    auto& table(BindGroup) { return groups; }
    auto& table(GraphicsPipeline) { return graphics_pipelines; }
    auto& table(ComputePipeline) { return compute_pipelines; }
    auto& table(QueryPool) { return query_pools; }
    auto& table(AccelerationStructure) { return acceleration_structures; }
};

/// The part of a device that command lists share, and that outlives it where they do.
struct DeviceShared {
    explicit DeviceShared(std::uint16_t number) : tables(number) {}
    Capabilities capabilities;
    DeviceDesc desc;
    MessageSink messages;
    std::shared_ptr<StreamPool> streams = std::make_shared<StreamPool>();
    std::shared_mutex tables_mutex;
    ObjectTables tables;
};

/// Host-visible memory that uploads and read-backs go through.
struct StagingChunk {
    std::unique_ptr<BackendBuffer> buffer;
    std::uint64_t used = 0;
    std::uint64_t serial = 0;  ///< Of the submission that reads it; 0 while it is being filled.
};

/// A write of content that waits for the next submission.
struct PendingWrite {
    BackendBuffer* staging = nullptr;
    std::uint64_t staging_offset = 0;
    std::uint64_t size = 0;
    Buffer buffer{};
    std::uint64_t offset = 0;
    Texture texture{};
    BufferTextureCopy region{};  ///< Complete but for `buffer_offset`.
};

/// An object that waits until the device no longer uses it.
struct RetiredObject {
    std::uint64_t serial = 0;
    std::unique_ptr<BackendObject> object;
};

/// All of a device but its name. Members below `mutex` are used under it.
struct DeviceState {
    std::shared_ptr<DeviceShared> shared;
    AdapterInfo adapter;
    std::atomic<bool> lost{false};
    std::uint16_t number = 0;
    std::unique_ptr<BackendDevice> backend;

    mutable std::mutex mutex;
    std::uint64_t submitted_serial = 0;
    std::uint64_t destructions = 1;  ///< Resources destroyed so far, for BindGroupObject::checked_epoch.
    std::deque<RetiredObject> retired;
    StateTracker tracker;
    std::unordered_map<std::string, BindGroupLayout> layouts_by_content;
    std::vector<StagingChunk> staging;
    std::vector<PendingWrite> pending_writes;
    std::uint64_t pending_bytes = 0;
    std::uint32_t mapped_buffers = 0;
    CommandStream upload_stream;

    ObjectTables& tables() { return shared->tables; }
    [[nodiscard]] const Capabilities& capabilities() const { return shared->capabilities; }
    std::unexpected<Error> reject(Problem problem) { return shared->messages.reject(std::move(problem)); }

    /// The error of every call on a lost device.
    [[nodiscard]] std::unexpected<Error> lost_error(std::string attempted, std::string subject = {}) const;
    /// Marks the device as lost if `error` says so; logs it the first time.
    void note_failure(const Error& error);

    /// Frees what the device no longer uses.
    void collect();
    void retire(std::unique_ptr<BackendObject> object);

    /// Space for an upload or read-back that starts at a multiple of 16 bytes.
    struct Staging {
        BackendBuffer* buffer = nullptr;
        std::uint64_t offset = 0;
    };
    Expected<Staging> stage_upload(std::uint64_t size);
    /// Hands lists to the device, behind the content writes that wait where `consume_writes` is set. Returns the
    /// serial.
    Expected<std::uint64_t> submit_streams(std::span<CommandStream* const> streams, bool consume_writes);
    /// The layout of this content; its bindings are checked and sorted.
    Expected<BindGroupLayout> layout_of(BindGroupLayoutDesc sorted);
    Expected<std::uint64_t> execute(std::span<CommandStream* const> streams, bool has_writes,
                                    std::span<const UnstatedUse> unstated = {});
    /// Submits one copy of a resource into staging memory, behind everything that waits.
    Expected<std::uint64_t> submit_read(CommandStream& stream, BufferObject* buffer, TextureObject* texture,
                                        const SubresourceRange& range, BackendBuffer& staging_buffer);
    /// Waits for that copy and takes its bytes. Called without the lock.
    Expected<std::vector<std::byte>> finish_read(std::unique_ptr<BackendBuffer> staging_buffer, std::uint64_t serial,
                                                 std::uint64_t size);
    Expected<void> wait_for(std::uint64_t serial, std::chrono::nanoseconds timeout);
};

/// Problem for a handle that `table` does not know. The lock that protects the table is held.
template <typename Table, typename HandleType>
Problem handle_problem(const Table& table, HandleType handle, std::string attempted, std::string_view kind) {
    Problem problem{Rule::empty_handle, ErrorCode::validation, std::move(attempted), std::string(kind), {}, {}};
    if (handle.device == 0) {
        problem.reason = "expected an object of this device, found an empty handle";
        problem.remedy = "Create the object first, and check the result of its creation.";
    } else if (handle.device != table.device()) {
        problem.rule = Rule::foreign_handle;
        problem.reason = "expected an object of device " + std::to_string(table.device()) + ", found one of device " +
                         std::to_string(handle.device);
        problem.remedy = "Objects cannot be shared between devices; create one for each.";
    } else {
        const std::string name = table.stale_name(handle);
        problem.rule = Rule::stale_handle;
        if (!name.empty()) problem.subject += " '" + name + "'";
        problem.reason = "expected a live object, found one that was destroyed";
        problem.remedy = "Destroy it after its last use; work that was submitted before is not affected.";
    }
    return problem;
}

}  // namespace nacre::rhi
