// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/gl/driver.h"

/// @file
/// Buffers. Upload and readback buffers are mapped for their whole life where the driver can (GL_ARB_buffer_storage);
/// where not, the host sees a copy that `flush` and `invalidate` bring up to date.

namespace nacre::gl {

class GlBuffer : public rhi::BackendBuffer {
  public:
    explicit GlBuffer(DriverPointer driver) : driver_(std::move(driver)) {}
    ~GlBuffer() override;

    static Expected<std::unique_ptr<rhi::BackendBuffer>> create(const DriverPointer& driver,
                                                                const rhi::BufferDesc& desc);

    /// The host has written (upload) or is about to read (readback).
    void flush();
    void invalidate();

    GLuint name = 0;
    ObjectId id = 0;
    /// Kinds of access that have not been told of the last write by a shader (bits of glMemoryBarrier).
    GLbitfield stale_for = 0;

  private:
    DriverPointer driver_;
    /// Shared with queued uploads, which may outlive the buffer.
    std::shared_ptr<std::byte[]> shadow_;
};

}  // namespace nacre::gl
