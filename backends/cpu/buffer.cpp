// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/buffer.h"

#include <fmt/format.h>

#include "backends/cpu/checks/check_functions.h"

namespace nacre::cpu {

Expected<std::unique_ptr<rhi::BackendBuffer>> CpuBuffer::create(const std::shared_ptr<HostMemory>& memory,
                                                                const rhi::BufferDesc& desc, std::uint32_t checks) {
    auto buffer = std::make_unique<CpuBuffer>();
    buffer->block_ = MemoryBlock(memory, desc.size);
    if (!buffer->block_.data())
        return fail(ErrorCode::out_of_memory, "create buffer", fmt::format("'{}'", desc.name),
                    fmt::format("{} bytes could not be had: the device holds {} of the {} bytes of this machine",
                                desc.size, memory->reserved_bytes(), memory->capacity()),
                    "Free other resources or use a smaller buffer.");
    if (memory->shadows) {
        if (desc.size > largest_shadowed_bytes)
            return fail(ErrorCode::unsupported, "create buffer", fmt::format("'{}'", desc.name),
                        fmt::format("expected at most {} bytes on a device in double precision, found {}",
                                    largest_shadowed_bytes, desc.size),
                        "Use a smaller buffer, or another mode of the backend.");
        buffer->shadow_ = MemoryBlock(memory->shadows, (desc.size + 3) / 4 * 8);
        if (!buffer->shadow_.data())
            return fail(ErrorCode::out_of_memory, "create buffer", fmt::format("'{}'", desc.name),
                        "there is no memory for its values in double precision",
                        "Free other resources or use a smaller buffer.");
    }
    buffer->desc = desc;
    if (desc.memory != rhi::MemoryKind::device) buffer->mapped = buffer->block_.data();
    buffer->memory_bytes = desc.size;
    if (checks & (check_sanitize | check_hostile)) {
        const bool is_device = desc.memory == rhi::MemoryKind::device;
        // What the host writes into mapped memory is not seen: all of it counts as written.
        buffer->checked = std::make_unique<CheckedMemory>(fmt::format("buffer '{}'", desc.name), buffer->data(),
                                                          desc.size, !is_device);
        if (is_device || checks & check_hostile) poison(buffer->data(), desc.size);
    } else if (checks) {
        buffer->checked =
            std::make_unique<CheckedMemory>(fmt::format("buffer '{}'", desc.name), buffer->data(), desc.size, true);
    }
    return buffer;
}

}  // namespace nacre::cpu
