// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/buffer.h"

#include <fmt/format.h>

#include <cstring>
#include <limits>
#include <new>

namespace nacre::gl {
namespace {

std::unexpected<Error> out_of_memory(const rhi::BufferDesc& desc) {
    return fail(ErrorCode::out_of_memory, "create buffer", fmt::format("'{}'", desc.name),
                fmt::format("the driver could not allocate {} bytes", desc.size),
                "Free other resources or use a smaller buffer.");
}

}  // namespace

Expected<std::unique_ptr<rhi::BackendBuffer>> GlBuffer::create(const DriverPointer& driver,
                                                               const rhi::BufferDesc& desc) {
    if (driver->allocation_fails() || desc.size > static_cast<std::uint64_t>(std::numeric_limits<GLsizeiptr>::max()))
        return out_of_memory(desc);
    auto buffer = std::make_unique<GlBuffer>(driver);
    buffer->desc = desc;
    buffer->id = driver->next_id();
    const bool host = desc.memory != rhi::MemoryKind::device;
    const bool persistent = host && driver->traits.buffer_storage;
    if (host && !persistent) {
        buffer->shadow_.reset(new (std::nothrow) std::byte[desc.size]());
        if (!buffer->shadow_) return out_of_memory(desc);
        buffer->mapped = buffer->shadow_.get();
    }
    const bool made = driver->worker->run([&] {
        const Functions& gl = driver->gl;
        gl.GenBuffers(1, &buffer->name);
        // The copy target is never part of a pipeline's state.
        gl.BindBuffer(GL_COPY_WRITE_BUFFER, buffer->name);
        const auto size = static_cast<GLsizeiptr>(desc.size);
        const GLbitfield access = desc.memory == rhi::MemoryKind::upload ? GL_MAP_WRITE_BIT : GL_MAP_READ_BIT;
        const GLenum error = driver->error_of([&] {
            if (persistent) {
                const GLbitfield flags = access | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
                // Dynamic storage: read-backs that go through the host are written with glBufferSubData.
                gl.BufferStorage(GL_COPY_WRITE_BUFFER, size, nullptr, flags | GL_DYNAMIC_STORAGE_BIT);
                buffer->mapped = static_cast<std::byte*>(gl.MapBufferRange(GL_COPY_WRITE_BUFFER, 0, size, flags));
            } else {
                const GLenum usage = desc.memory == rhi::MemoryKind::upload     ? GL_STREAM_DRAW
                                     : desc.memory == rhi::MemoryKind::readback ? GL_STREAM_READ
                                                                                : GL_STATIC_DRAW;
                gl.BufferData(GL_COPY_WRITE_BUFFER, size, nullptr, usage);
            }
        });
        if (error != GL_NO_ERROR || (host && !buffer->mapped)) return false;
        driver->label(GL_BUFFER, buffer->name, desc.name);
        return true;
    });
    if (!made) return out_of_memory(desc);
    buffer->memory_bytes = desc.size;
    driver->reserved_bytes += desc.size;
    ++driver->allocations;
    return buffer;
}

GlBuffer::~GlBuffer() {
    if (memory_bytes) {
        driver_->reserved_bytes -= memory_bytes;
        --driver_->allocations;
    }
    if (name)
        driver_->worker->post([driver = driver_.get(), deleted = name] { driver->gl.DeleteBuffers(1, &deleted); });
}

void GlBuffer::flush() {
    if (!shadow_) return;
    driver_->worker->post([driver = driver_.get(), content = shadow_, size = desc.size, buffer = name] {
        driver->gl.BindBuffer(GL_COPY_WRITE_BUFFER, buffer);
        driver->gl.BufferSubData(GL_COPY_WRITE_BUFFER, 0, static_cast<GLsizeiptr>(size), content.get());
    });
}

void GlBuffer::invalidate() {
    if (!shadow_) return;
    driver_->worker->run([this] {
        const Functions& gl = driver_->gl;
        gl.BindBuffer(GL_COPY_WRITE_BUFFER, name);
        const auto size = static_cast<GLsizeiptr>(desc.size);
        if (const void* content = gl.MapBufferRange(GL_COPY_WRITE_BUFFER, 0, size, GL_MAP_READ_BIT))
            std::memcpy(shadow_.get(), content, desc.size);
        gl.UnmapBuffer(GL_COPY_WRITE_BUFFER);
    });
}

}  // namespace nacre::gl
