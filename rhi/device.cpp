// SPDX-License-Identifier: Apache-2.0
#include "rhi/device.h"

#include <fmt/format.h>

#include "rhi/command_validator.h"
#include "rhi/device_access.h"

namespace nacre::rhi {

Device::Device(std::unique_ptr<State> state) : state_(std::move(state)) {}

Device::~Device() {
    DeviceState& device = *state_;
    // Errors while waiting cannot be told to anyone any more, and do not keep objects from being freed.
    std::uint64_t last = 0;
    {
        const std::lock_guard lock(device.mutex);
        last = device.submitted_serial;
    }
    if (last != 0) (void)device.backend->wait(last, std::chrono::nanoseconds::max());
    const std::lock_guard lock(device.mutex);
    {
        const std::unique_lock tables_lock(device.shared->tables_mutex);
        device.shared->tables.clear();
    }
    device.retired.clear();
    device.staging.clear();
    (void)device.backend->save_pipeline_cache();
    device.backend.reset();
}

const AdapterInfo& Device::adapter() const { return state_->adapter; }
const Capabilities& Device::capabilities() const { return state_->shared->capabilities; }
const DeviceDesc& Device::desc() const { return state_->shared->desc; }
bool Device::is_lost() const { return state_->lost; }

void Device::set_message_callback(std::function<void(const Message&)> callback) {
    state_->shared->messages.set_callback(std::move(callback));
}

std::uint64_t Device::error_message_count() const { return state_->shared->messages.errors(); }

CommandList Device::create_command_list(std::string_view name) {
    std::unique_ptr<CommandStream> stream = state_->shared->streams->take();
    stream->name = name;
    stream->device = state_->number;
    stream->pool = state_->shared->streams;
    if (state_->shared->desc.validation)
        stream->validator = std::make_shared<CommandValidator>(state_->shared, stream->name);
    return CommandList(std::move(stream));
}

Expected<Fence> Device::submit(CommandList list) { return submit(std::span(&list, 1)); }

Expected<Fence> Device::submit(std::span<CommandList> lists) {
    DeviceState& device = *state_;
    // The lists are used up whatever happens; their memory goes back to the pool at the end.
    std::vector<std::unique_ptr<CommandStream>> owned;
    std::vector<CommandStream*> streams;
    owned.reserve(lists.size());
    streams.reserve(lists.size());
    for (CommandList& list : lists) owned.push_back(std::move(list.stream_));
    const auto give_back = [&] {
        for (std::unique_ptr<CommandStream>& stream : owned)
            if (stream && stream->pool) {
                const std::shared_ptr<StreamPool> pool = stream->pool;
                pool->give_back(std::move(stream));
            }
    };
    for (const std::unique_ptr<CommandStream>& stream : owned) {
        if (!stream) {
            give_back();
            return device.reject({Rule::list_already_submitted, ErrorCode::validation, "submit", "command list",
                                  "expected a recorded list, found one that was submitted or moved from",
                                  "Record a new list for each submission."});
        }
        if (stream->device != device.number) {
            const std::string name = stream->name;
            give_back();
            return device.reject({Rule::list_of_other_device, ErrorCode::validation, "submit", "list '" + name + "'",
                                  "expected a list of this device, found one of another",
                                  "Record the list with create_command_list of the device that it is submitted to."});
        }
        if (stream->status && stream->validator)
            if (Check open = stream->validator->finish()) stream->status = stream->validator->reject(std::move(*open));
        if (!stream->status) {
            Error error = stream->status.error();
            give_back();
            return std::unexpected(std::move(error));
        }
        streams.push_back(stream.get());
    }
    Expected<std::uint64_t> serial = [&] {
        const std::lock_guard lock(device.mutex);
        return device.submit_streams(streams, true);
    }();
    give_back();
    if (!serial) return std::unexpected(std::move(serial).error());
    return Fence{*serial};
}

Expected<void> Device::wait(Fence fence, std::chrono::nanoseconds timeout) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("wait for fence");
    if (fence.serial == 0) return {};
    {
        const std::lock_guard lock(device.mutex);
        if (fence.serial > device.submitted_serial)
            return device.reject({Rule::fence_unknown, ErrorCode::validation, "wait for fence",
                                  "fence " + std::to_string(fence.serial),
                                  fmt::format("expected a fence of this device, at most {}, found {}",
                                              device.submitted_serial, fence.serial),
                                  "Wait for a fence with the device whose submit returned it."});
    }
    NACRE_CHECK(device.wait_for(fence.serial, timeout));
    const std::lock_guard lock(device.mutex);
    device.collect();
    return {};
}

Expected<void> Device::wait_idle() {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("wait for device");
    std::uint64_t last = 0;
    {
        const std::lock_guard lock(device.mutex);
        last = device.submitted_serial;
    }
    return wait(Fence{last});
}

bool Device::is_complete(Fence fence) {
    // Nothing of a lost device is waited for.
    if (state_->lost) return true;
    return state_->backend->completed_serial() >= fence.serial;
}

MemoryStatistics Device::memory_statistics() const {
    DeviceState& device = *state_;
    const std::lock_guard lock(device.mutex);
    MemoryStatistics statistics = device.backend->memory_statistics();
    statistics.buffer_bytes = statistics.texture_bytes = statistics.staging_bytes = 0;
    statistics.buffer_count = device.tables().buffers.size();
    statistics.texture_count = device.tables().textures.size();
    device.tables().buffers.for_each(
        [&](const BufferObject& buffer) { statistics.buffer_bytes += buffer.backend->memory_bytes; });
    device.tables().textures.for_each(
        [&](const TextureObject& texture) { statistics.texture_bytes += texture.backend->memory_bytes; });
    statistics.acceleration_structure_bytes = 0;
    statistics.acceleration_structure_count = device.tables().acceleration_structures.size();
    device.tables().acceleration_structures.for_each([&](const AccelerationStructureObject& structure) {
        statistics.acceleration_structure_bytes += structure.backend->memory_bytes;
    });
    for (const StagingChunk& chunk : device.staging) statistics.staging_bytes += chunk.buffer->desc.size;
    return statistics;
}

std::vector<NarrowedOperation> Device::narrowed_operations() const {
    const std::lock_guard lock(state_->mutex);
    return state_->backend->narrowed_operations();
}

Expected<void> Device::start_trace(const TraceRequest& request) {
    NACRE_CHECK(wait_idle());
    const std::lock_guard lock(state_->mutex);
    return state_->backend->start_trace(request);
}

Expected<Trace> Device::finish_trace() {
    NACRE_CHECK(wait_idle());
    const std::lock_guard lock(state_->mutex);
    return state_->backend->finish_trace();
}

Expected<void> Device::save_pipeline_cache() {
    if (state_->lost) return state_->lost_error("save pipeline cache");
    const std::lock_guard lock(state_->mutex);
    return state_->backend->save_pipeline_cache();
}

}  // namespace nacre::rhi
