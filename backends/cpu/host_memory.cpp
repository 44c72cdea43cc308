// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/host_memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <utility>

namespace nacre::cpu {
namespace {

/// From here on pages come from the system, which zeroes them when they are first touched.
constexpr std::uint64_t mapping_threshold = 256 * 1024;
/// From here on a large page of the system (2 MiB on x86-64) fits in, whatever the alignment.
constexpr std::uint64_t large_page_threshold = 4 * 1024 * 1024;

}  // namespace

std::uint64_t machine_memory_bytes() {
    const long pages = sysconf(_SC_PHYS_PAGES), page_bytes = sysconf(_SC_PAGE_SIZE);
    if (pages <= 0 || page_bytes <= 0) return std::uint64_t{1} << 32;
    return static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page_bytes);
}

MemoryBlock::MemoryBlock(std::shared_ptr<HostMemory> memory, std::uint64_t size) {
    if (++memory->count_ == memory->fail_allocation_ || size > memory->capacity_) return;
    const std::uint64_t allocated = (size + readable_bytes_behind + 63) / 64 * 64;
    if (memory->reserved_.fetch_add(allocated) + allocated > memory->capacity_) {
        memory->reserved_ -= allocated;
        return;
    }
    is_mapped_ = allocated >= mapping_threshold;
    if (is_mapped_) {
        void* pages = mmap(nullptr, allocated, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        data_ = pages == MAP_FAILED ? nullptr : static_cast<std::byte*>(pages);
#ifdef MADV_HUGEPAGE
        // Accesses in two dimensions touch many pages. Only a hint: where the system knows no large pages nothing
        // changes.
        if (data_ && allocated >= large_page_threshold) madvise(pages, allocated, MADV_HUGEPAGE);
#endif
    } else {
        data_ = static_cast<std::byte*>(std::aligned_alloc(64, allocated));
        if (data_) std::memset(data_, 0, allocated);
    }
    if (!data_) {
        memory->reserved_ -= allocated;
        return;
    }
    size_ = size;
    allocated_ = allocated;
    ++memory->live_;
    memory_ = std::move(memory);
}

MemoryBlock::~MemoryBlock() {
    if (!data_) return;
    if (is_mapped_)
        munmap(data_, allocated_);
    else
        std::free(data_);
    memory_->reserved_ -= allocated_;
    --memory_->live_;
}

MemoryBlock::MemoryBlock(MemoryBlock&& other) noexcept
    : memory_(std::move(other.memory_)),
      data_(std::exchange(other.data_, nullptr)),
      size_(std::exchange(other.size_, 0)),
      allocated_(std::exchange(other.allocated_, 0)),
      is_mapped_(other.is_mapped_) {}

MemoryBlock& MemoryBlock::operator=(MemoryBlock&& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(allocated_, other.allocated_);
    std::swap(is_mapped_, other.is_mapped_);
    return *this;
}

}  // namespace nacre::cpu
