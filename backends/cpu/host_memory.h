// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

/// @file
/// Memory of buffers and textures: what the host has, counted, and never more than the machine holds.

namespace nacre::cpu {

/// Bytes that may be read behind the end of every block, so that vectors may be loaded whole.
inline constexpr std::uint64_t readable_bytes_behind = 64;

/// Bytes of memory of this machine.
std::uint64_t machine_memory_bytes();

/// Counts the memory of one device. Thread-safe.
class HostMemory {
  public:
    /// @param capacity         bytes that may be taken at one time
    /// @param fail_allocation  the n-th allocation (from 1) fails; 0: none
    explicit HostMemory(std::uint64_t capacity, std::uint64_t fail_allocation = 0)
        : capacity_(capacity), fail_allocation_(fail_allocation) {}

    [[nodiscard]] std::uint64_t reserved_bytes() const { return reserved_; }
    [[nodiscard]] std::uint32_t allocations() const { return live_; }
    [[nodiscard]] std::uint64_t capacity() const { return capacity_; }

    /// Of devices in double precision: where buffers and textures take the memory of their shadows, the doubles of
    /// their floats. It is counted apart, and most of it is never touched. Else null.
    std::shared_ptr<HostMemory> shadows;

  private:
    friend class MemoryBlock;
    const std::uint64_t capacity_;
    const std::uint64_t fail_allocation_;
    std::atomic<std::uint64_t> reserved_{0};
    std::atomic<std::uint64_t> count_{0};
    std::atomic<std::uint32_t> live_{0};
};

/// Bytes that are zero at first, aligned to 64, with `readable_bytes_behind` more behind them.
class MemoryBlock {
  public:
    MemoryBlock() = default;
    /// Null data where memory ran out; never throws.
    MemoryBlock(std::shared_ptr<HostMemory> memory, std::uint64_t size);
    ~MemoryBlock();
    MemoryBlock(MemoryBlock&& other) noexcept;
    MemoryBlock& operator=(MemoryBlock&& other) noexcept;

    [[nodiscard]] std::byte* data() const { return data_; }
    [[nodiscard]] std::uint64_t size() const { return size_; }

  private:
    std::shared_ptr<HostMemory> memory_;
    std::byte* data_ = nullptr;
    std::uint64_t size_ = 0;
    std::uint64_t allocated_ = 0;
    bool is_mapped_ = false;
};

}  // namespace nacre::cpu
