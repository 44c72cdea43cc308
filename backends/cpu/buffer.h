// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "backends/cpu/checks/checked_memory.h"
#include "backends/cpu/host_memory.h"
#include "rhi/backend.h"

namespace nacre::cpu {

/// Of a buffer on a device in double precision: compiled code counts bytes of shadows in 32 bits with a sign.
inline constexpr std::uint64_t largest_shadowed_bytes = std::uint64_t{1} << 30;

/// Memory of the host, whatever the kind of memory that was asked for.
class CpuBuffer : public rhi::BackendBuffer {
  public:
    static Expected<std::unique_ptr<rhi::BackendBuffer>> create(const std::shared_ptr<HostMemory>& memory,
                                                                const rhi::BufferDesc& desc, std::uint32_t checks = 0);
    [[nodiscard]] std::byte* data() const { return block_.data(); }
    [[nodiscard]] std::uint64_t size() const { return block_.size(); }
    /// The double of each word, at twice its offset; null where the device is not in double precision.
    [[nodiscard]] std::byte* shadow() const { return shadow_.data(); }
    /// Bytes from `offset` to the end; 0 for offsets behind it.
    [[nodiscard]] std::uint64_t size_from(std::uint64_t offset) const { return offset < size() ? size() - offset : 0; }

    /// What is known of the content besides it; null on devices without checks.
    std::unique_ptr<CheckedMemory> checked;

  private:
    MemoryBlock block_, shadow_;
};

}  // namespace nacre::cpu
