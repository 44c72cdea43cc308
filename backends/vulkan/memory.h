// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "backends/vulkan/context.h"
#include "backends/vulkan/range_allocator.h"

/// @file
/// Device memory: large blocks from the driver, divided among buffers and textures.
///
///     NACRE_TRY(Memory memory, context.memory->allocate({.requirements = ..., .kind = MemoryKind::device}));
///     vk.BindBufferMemory(device, buffer, memory.handle(), memory.offset());

namespace nacre::vulkan {

struct MemoryBlock;
class MemoryAllocator;

/// A piece of device memory; gives itself back when destroyed.
class Memory {
  public:
    Memory() = default;
    Memory(Memory&& other) noexcept { *this = std::move(other); }
    Memory& operator=(Memory&& other) noexcept;
    ~Memory() { reset(); }

    [[nodiscard]] VkDeviceMemory handle() const;
    [[nodiscard]] std::uint64_t offset() const { return offset_; }
    [[nodiscard]] std::uint64_t size() const { return size_; }
    /// Address of the first byte; null where the host cannot see the memory.
    [[nodiscard]] std::byte* mapped() const;
    /// Makes host writes visible to the device, or device writes to the host. Nothing to do for coherent memory.
    Expected<void> flush() const;
    Expected<void> invalidate() const;
    void reset();

  private:
    friend class MemoryAllocator;
    [[nodiscard]] VkMappedMemoryRange mapped_range() const;

    MemoryAllocator* allocator_ = nullptr;
    MemoryBlock* block_ = nullptr;
    std::uint64_t offset_ = 0, size_ = 0;
    std::uint32_t range_ = 0;
};

struct MemoryRequest {
    VkMemoryRequirements requirements{};
    rhi::MemoryKind kind = rhi::MemoryKind::device;
    bool is_image = false;                       ///< With optimal tiling.
    bool prefers_dedicated = false;              ///< The driver wants memory of its own for this object,
    VkBuffer dedicated_buffer = VK_NULL_HANDLE;  ///< which is this
    VkImage dedicated_image = VK_NULL_HANDLE;    ///< or this.
    std::string subject;                         ///< For errors: "buffer 'vertices'".
};

class MemoryAllocator {
  public:
    explicit MemoryAllocator(Context& context);
    ~MemoryAllocator();

    /// Errors: out_of_memory, naming size and heap.
    Expected<Memory> allocate(const MemoryRequest& request);

    [[nodiscard]] std::uint64_t reserved_bytes() const { return reserved_bytes_; }
    [[nodiscard]] std::uint32_t driver_allocations() const { return driver_allocations_; }

  private:
    friend class Memory;
    struct Pool {
        std::vector<std::unique_ptr<MemoryBlock>> blocks;
        std::uint64_t next_block_size = 0;
    };

    /// Memory types that serve the request, best first.
    [[nodiscard]] std::vector<std::uint32_t> candidate_types(const MemoryRequest& request) const;
    Expected<std::unique_ptr<MemoryBlock>> make_block(std::uint32_t type, std::uint64_t size,
                                                      const MemoryRequest* dedicated);
    Expected<Memory> allocate_from(std::uint32_t type, const MemoryRequest& request);
    void release(Memory& memory);
    void destroy(MemoryBlock& block);
    [[nodiscard]] Pool& pool_of(std::uint32_t type, bool is_image);

    Context& context_;
    std::uint64_t allocation_count_ = 0;  ///< Calls of `allocate`, for fault injection.
    std::uint64_t reserved_bytes_ = 0;
    std::uint32_t driver_allocations_ = 0;
    bool separate_images_ = false;  ///< Images and buffers must not be neighbors.
    std::vector<Pool> pools_;       ///< Two for each memory type: for buffers and for images.
    std::vector<std::unique_ptr<MemoryBlock>> dedicated_;
};

}  // namespace nacre::vulkan
