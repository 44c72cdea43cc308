// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "rhi/device_access.h"
#include "rhi/object_checks.h"

namespace nacre::rhi {
namespace {

/// Content that waits beyond this is handed to the device without waiting for a submission.
constexpr std::uint64_t most_pending_bytes = 64 * 1024 * 1024;

Problem range_problem(const char* attempted, const std::string& name, std::uint64_t offset, std::uint64_t size,
                      std::uint64_t bytes) {
    return {Rule::content_range,
            ErrorCode::invalid_argument,
            attempted,
            "buffer '" + name + "'",
            fmt::format("expected a range within {} bytes, found {} bytes from offset {}", bytes, size, offset),
            "Correct offset and size."};
}

Check check_part(const char* attempted, const TextureDesc& desc, std::uint32_t mip, std::uint32_t layer,
                 TextureUsage needed) {
    if (mip >= desc.mips || layer >= layers_of(desc))
        return Problem{Rule::content_range,
                       ErrorCode::invalid_argument,
                       attempted,
                       "texture '" + desc.name + "'",
                       fmt::format("expected a mip below {} and a layer below {}, found mip {} of layer {}", desc.mips,
                                   layers_of(desc), mip, layer),
                       "Name a part that the texture has."};
    if (!has_all(desc.usage, needed))
        return Problem{Rule::content_usage,
                       ErrorCode::invalid_argument,
                       attempted,
                       "texture '" + desc.name + "'",
                       fmt::format("expected usage {}, found {}", text_of(needed), text_of(desc.usage)),
                       "Add the usage where the texture is created."};
    return {};
}

Expected<void> flush_if_large(DeviceState& device) {
    if (device.pending_bytes < most_pending_bytes) return {};
    auto serial = device.submit_streams({}, true);
    if (!serial) return std::unexpected(std::move(serial).error());
    return {};
}

/// A readback buffer that lives for one call.
Expected<std::unique_ptr<BackendBuffer>> make_readback(DeviceState& device, std::uint64_t size) {
    BufferDesc desc;
    desc.size = size;
    desc.usage = BufferUsage::copy_destination | BufferUsage::copy_source;
    desc.memory = MemoryKind::readback;
    desc.name = "read-back staging";
    auto buffer = device.backend->create_buffer(desc);
    if (!buffer) {
        device.note_failure(buffer.error());
        return buffer;
    }
    (*buffer)->desc = desc;
    return buffer;
}

}  // namespace

Expected<void> Device::write_buffer(Buffer buffer, std::span<const std::byte> data, std::uint64_t offset) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("write buffer");
    const std::lock_guard lock(device.mutex);
    BufferObject* object = device.tables().buffers.find(buffer);
    if (!object) return device.reject(handle_problem(device.tables().buffers, buffer, "write buffer", "buffer"));
    if (offset > object->desc.size || data.size() > object->desc.size - offset)
        return device.reject(range_problem("write buffer", object->desc.name, offset, data.size(), object->desc.size));
    if (data.empty()) return {};
    NACRE_TRY(const DeviceState::Staging staging, device.stage_upload(data.size()));
    std::memcpy(staging.buffer->mapped + staging.offset, data.data(), data.size());
    PendingWrite write;
    write.staging = staging.buffer;
    write.staging_offset = staging.offset;
    write.size = data.size();
    write.buffer = buffer;
    write.offset = offset;
    device.pending_writes.push_back(write);
    device.pending_bytes += data.size();
    return flush_if_large(device);
}

Expected<void> Device::write_texture(Texture texture, std::span<const std::byte> data, std::uint32_t mip,
                                     std::uint32_t layer) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("write texture");
    const std::lock_guard lock(device.mutex);
    TextureObject* object = device.tables().textures.find(texture);
    if (!object) return device.reject(handle_problem(device.tables().textures, texture, "write texture", "texture"));
    const TextureDesc& desc = object->desc;
    if (Check failed = check_part("write texture", desc, mip, layer, TextureUsage::copy_destination))
        return device.reject(std::move(*failed));
    if (data.size() != mip_bytes(desc, mip))
        return device.reject(
            {Rule::content_size, ErrorCode::invalid_argument, "write texture", "'" + desc.name + "'",
             fmt::format("expected {} bytes for mip {}, found {}", mip_bytes(desc, mip), mip, data.size()),
             "Give the texels without padding; mip_bytes tells how many bytes these are."});
    NACRE_TRY(const DeviceState::Staging staging, device.stage_upload(data.size()));
    std::memcpy(staging.buffer->mapped + staging.offset, data.data(), data.size());
    PendingWrite write;
    write.staging = staging.buffer;
    write.staging_offset = staging.offset;
    write.size = data.size();
    write.texture = texture;
    BufferTextureCopy region;
    region.mip = mip;
    region.layer = layer;
    write.region = complete_region(region, desc);
    device.pending_writes.push_back(write);
    device.pending_bytes += data.size();
    return flush_if_large(device);
}

Expected<std::vector<std::byte>> Device::read_buffer(Buffer buffer, std::uint64_t offset, std::uint64_t size) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("read buffer");
    std::unique_ptr<BackendBuffer> staging;
    std::uint64_t serial = 0;
    {
        const std::lock_guard lock(device.mutex);
        BufferObject* object = device.tables().buffers.find(buffer);
        if (!object) return device.reject(handle_problem(device.tables().buffers, buffer, "read buffer", "buffer"));
        const std::uint64_t bytes = object->desc.size;
        if (offset > bytes || (size != ~0ull && size > bytes - offset))
            return device.reject(range_problem("read buffer", object->desc.name, offset, size, bytes));
        if (size == ~0ull) size = bytes - offset;
        if (size == 0) return std::vector<std::byte>{};
        NACRE_TRY(staging, make_readback(device, size));
        CommandStream stream;
        stream.name = "read buffer";
        auto& command = stream.append<CopyBufferCommand>();
        command.source.object = object->backend.get();
        command.destination.object = staging.get();
        command.source_offset = offset;
        command.destination_offset = 0;
        command.size = size;
        NACRE_TRY(serial, device.submit_read(stream, object, nullptr, {}, *staging));
    }
    return device.finish_read(std::move(staging), serial, size);
}

Expected<std::vector<std::byte>> Device::read_texture(Texture texture, std::uint32_t mip, std::uint32_t layer) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("read texture");
    std::unique_ptr<BackendBuffer> staging;
    std::uint64_t serial = 0;
    std::uint64_t size = 0;
    {
        const std::lock_guard lock(device.mutex);
        TextureObject* object = device.tables().textures.find(texture);
        if (!object) return device.reject(handle_problem(device.tables().textures, texture, "read texture", "texture"));
        if (Check failed = check_part("read texture", object->desc, mip, layer, TextureUsage::copy_source))
            return device.reject(std::move(*failed));
        size = mip_bytes(object->desc, mip);
        NACRE_TRY(staging, make_readback(device, size));
        CommandStream stream;
        stream.name = "read texture";
        auto& command = stream.append<CopyTextureToBufferCommand>();
        command.source.object = object->backend.get();
        command.destination.object = staging.get();
        BufferTextureCopy region;
        region.mip = mip;
        region.layer = layer;
        command.region = complete_region(region, object->desc);
        NACRE_TRY(serial, device.submit_read(stream, nullptr, object, {mip, 1, layer, 1}, *staging));
    }
    return device.finish_read(std::move(staging), serial, size);
}

Expected<std::vector<std::byte>> DeviceState::finish_read(std::unique_ptr<BackendBuffer> staging_buffer,
                                                          std::uint64_t serial, std::uint64_t size) {
    if (auto waited = wait_for(serial, std::chrono::nanoseconds::max()); !waited) {
        const std::lock_guard lock(mutex);
        retire(std::move(staging_buffer));
        return std::unexpected(std::move(waited).error());
    }
    const std::lock_guard lock(mutex);
    if (auto invalidated = backend->invalidate_mapped(*staging_buffer); !invalidated) {
        note_failure(invalidated.error());
        return std::unexpected(std::move(invalidated).error());
    }
    std::vector<std::byte> bytes(size);
    std::memcpy(bytes.data(), staging_buffer->mapped, size);
    staging_buffer.reset();
    collect();
    return bytes;
}

Expected<std::span<std::byte>> Device::map(Buffer buffer) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("map buffer");
    const std::lock_guard lock(device.mutex);
    BufferObject* object = device.tables().buffers.find(buffer);
    if (!object) return device.reject(handle_problem(device.tables().buffers, buffer, "map buffer", "buffer"));
    if (object->desc.memory == MemoryKind::device)
        return device.reject({Rule::map_memory, ErrorCode::invalid_argument, "map buffer",
                              "'" + object->desc.name + "'", "expected upload or readback memory, found device memory",
                              "Use write_buffer and read_buffer, or another MemoryKind."});
    if (object->is_mapped)
        return device.reject({Rule::map_state, ErrorCode::invalid_argument, "map buffer", "'" + object->desc.name + "'",
                              "expected a buffer that is not mapped, found it mapped", "Call unmap first."});
    if (object->desc.memory == MemoryKind::readback) {
        if (auto done = device.backend->invalidate_mapped(*object->backend); !done) {
            device.note_failure(done.error());
            return std::unexpected(std::move(done).error());
        }
    }
    object->is_mapped = true;
    ++device.mapped_buffers;
    return std::span(object->backend->mapped, object->desc.size);
}

Expected<void> Device::unmap(Buffer buffer) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("unmap buffer");
    const std::lock_guard lock(device.mutex);
    BufferObject* object = device.tables().buffers.find(buffer);
    if (!object) return device.reject(handle_problem(device.tables().buffers, buffer, "unmap buffer", "buffer"));
    if (!object->is_mapped)
        return device.reject({Rule::map_state, ErrorCode::invalid_argument, "unmap buffer",
                              "'" + object->desc.name + "'", "expected a buffer that is mapped, found it unmapped",
                              "Pair map and unmap."});
    object->is_mapped = false;
    --device.mapped_buffers;
    if (object->desc.memory == MemoryKind::readback) return {};
    auto flushed = device.backend->flush_mapped(*object->backend);
    if (!flushed) device.note_failure(flushed.error());
    return flushed;
}

Expected<std::vector<std::uint64_t>> Device::read_queries(QueryPool pool, std::uint32_t first, std::uint32_t count) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("read queries");
    std::uint64_t serial = 0;
    {
        const std::lock_guard lock(device.mutex);
        QueryPoolObject* object = device.tables().query_pools.find(pool);
        if (!object)
            return device.reject(handle_problem(device.tables().query_pools, pool, "read queries", "query pool"));
        if (first > object->desc.count || count > object->desc.count - first)
            return device.reject(
                {Rule::query_range, ErrorCode::invalid_argument, "read queries", "'" + object->desc.name + "'",
                 fmt::format("expected queries below {}, found {} from {}", object->desc.count, count, first),
                 "Correct first and count."});
        for (std::uint32_t i = first; i < first + count; ++i)
            if (!object->written[i])
                return device.reject(
                    {Rule::query_unwritten, ErrorCode::invalid_argument, "read queries", "'" + object->desc.name + "'",
                     fmt::format("expected a query that submitted work has written, found {} unwritten", i),
                     "Submit the commands that write it first."});
        if (count == 0) return std::vector<std::uint64_t>{};
        serial = object->last_serial;
    }
    NACRE_CHECK(device.wait_for(serial, std::chrono::nanoseconds::max()));
    const std::lock_guard lock(device.mutex);
    QueryPoolObject* object = device.tables().query_pools.find(pool);
    if (!object) return device.reject(handle_problem(device.tables().query_pools, pool, "read queries", "query pool"));
    auto results = device.backend->read_queries(*object->backend, first, count);
    if (!results) device.note_failure(results.error());
    return results;
}

}  // namespace nacre::rhi
