// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/memory.h"

#include <fmt/format.h>

#include <algorithm>

#include "backends/vulkan/result.h"

namespace nacre::vulkan {

struct MemoryBlock {
    MemoryBlock(std::uint64_t bytes, std::uint32_t memory_type) : ranges(bytes), size(bytes), type(memory_type) {}

    RangeAllocator ranges;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    std::byte* mapped = nullptr;
    std::uint64_t size;
    std::uint32_t type;
    bool is_coherent = true;
    bool is_dedicated = false;
    bool is_image = false;
};

namespace {

constexpr std::uint64_t mebibyte = 1024 * 1024;
constexpr std::uint64_t first_block_size = 4 * mebibyte;
constexpr std::uint64_t largest_block_size = 64 * mebibyte;

constexpr std::uint64_t round_up(std::uint64_t value, std::uint64_t alignment) {
    return (value + alignment - 1) / alignment * alignment;
}

}  // namespace

Memory& Memory::operator=(Memory&& other) noexcept {
    if (this == &other) return *this;
    reset();
    allocator_ = std::exchange(other.allocator_, nullptr);
    block_ = std::exchange(other.block_, nullptr);
    offset_ = other.offset_, size_ = other.size_, range_ = other.range_;
    return *this;
}

VkDeviceMemory Memory::handle() const { return block_ ? block_->memory : VK_NULL_HANDLE; }

std::byte* Memory::mapped() const { return block_ && block_->mapped ? block_->mapped + offset_ : nullptr; }

void Memory::reset() {
    if (allocator_) allocator_->release(*this);
    allocator_ = nullptr;
    block_ = nullptr;
}

VkMappedMemoryRange Memory::mapped_range() const {
    // Offset and size of host-visible allocations are multiples of the atom size, see `allocate`.
    VkMappedMemoryRange range{VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE};
    range.memory = block_->memory;
    range.offset = offset_;
    range.size = offset_ + size_ >= block_->size ? VK_WHOLE_SIZE : size_;
    return range;
}

Expected<void> Memory::flush() const {
    if (!block_ || block_->is_coherent) return {};
    Context& context = allocator_->context_;
    const VkMappedMemoryRange range = mapped_range();
    if (VkResult result = context.check(context.vk.FlushMappedMemoryRanges(context.device, 1, &range));
        result != VK_SUCCESS)
        return fail(result, "flush mapped memory", fmt::format("{} bytes", size_));
    return {};
}

Expected<void> Memory::invalidate() const {
    if (!block_ || block_->is_coherent) return {};
    Context& context = allocator_->context_;
    const VkMappedMemoryRange range = mapped_range();
    if (VkResult result = context.check(context.vk.InvalidateMappedMemoryRanges(context.device, 1, &range));
        result != VK_SUCCESS)
        return fail(result, "invalidate mapped memory", fmt::format("{} bytes", size_));
    return {};
}

MemoryAllocator::MemoryAllocator(Context& context)
    : context_(context),
      // One pool for each kind of resource keeps neighbors of different kinds apart without counting granules.
      separate_images_(context.physical->properties.limits.bufferImageGranularity > RangeAllocator::granule),
      pools_(std::size_t{2} * context.physical->memory.memoryTypeCount) {}

MemoryAllocator::~MemoryAllocator() {
    for (Pool& pool : pools_)
        for (auto& block : pool.blocks) destroy(*block);
    for (auto& block : dedicated_) destroy(*block);
}

MemoryAllocator::Pool& MemoryAllocator::pool_of(std::uint32_t type, bool is_image) {
    return pools_[std::size_t{2} * type + (is_image && separate_images_ ? 1 : 0)];
}

std::vector<std::uint32_t> MemoryAllocator::candidate_types(const MemoryRequest& request) const {
    VkMemoryPropertyFlags required = 0, wanted = 0, unwanted = 0;
    switch (request.kind) {
        case rhi::MemoryKind::device:
            wanted = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
            // The host-visible part of a graphics card's memory is small on many systems; leave it to others.
            unwanted = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
            break;
        case rhi::MemoryKind::upload:
            required = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
            wanted = VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
            // Written once and in order: write-combined memory is faster, and device memory too dear.
            unwanted = VK_MEMORY_PROPERTY_HOST_CACHED_BIT | VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
            break;
        case rhi::MemoryKind::readback:
            required = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
            wanted = VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
            unwanted = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
            break;
    }
    // Lazily allocated and protected memory are for purposes that Nacre does not have; vendor bits likewise.
    constexpr VkMemoryPropertyFlags known = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                                            VK_MEMORY_PROPERTY_HOST_COHERENT_BIT | VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
    const VkPhysicalDeviceMemoryProperties& memory = context_.physical->memory;
    std::vector<std::pair<int, std::uint32_t>> ranked;
    for (std::uint32_t type = 0; type < memory.memoryTypeCount; ++type) {
        const VkMemoryPropertyFlags flags = memory.memoryTypes[type].propertyFlags;
        if (!(request.requirements.memoryTypeBits & (1u << type)) || (flags & required) != required || (flags & ~known))
            continue;
        const int penalty = ((flags & wanted) == wanted ? 0 : 100) + std::popcount(flags & unwanted);
        ranked.emplace_back(penalty, type);
    }
    std::ranges::stable_sort(ranked, {}, &std::pair<int, std::uint32_t>::first);
    std::vector<std::uint32_t> types;
    for (const auto& [penalty, type] : ranked) types.push_back(type);
    return types;
}

Expected<Memory> MemoryAllocator::allocate(const MemoryRequest& request) {
    const std::vector<std::uint32_t> types = candidate_types(request);
    const VkPhysicalDeviceMemoryProperties& memory = context_.physical->memory;
    if (types.empty())
        return nacre::fail(ErrorCode::unsupported, "allocate memory", request.subject,
                           "no memory type of this device serves it", "Use another memory kind or format.");
    const std::uint32_t heap = memory.memoryTypes[types.front()].heapIndex;
    const auto out_of_memory = [&](std::string_view reason) {
        return nacre::fail(
            ErrorCode::out_of_memory, "allocate memory", request.subject,
            fmt::format("{} bytes do not fit into heap {} of {} bytes ({}; {} bytes are reserved)",
                        request.requirements.size, heap, memory.memoryHeaps[heap].size, reason, reserved_bytes_),
            "Destroy objects or use smaller ones.");
    };
    if (++allocation_count_ == context_.faults.fail_allocation) return out_of_memory("planted by fault injection");
    // Drivers differ in what they do with sizes beyond any heap; some only find out when the memory is touched.
    if (request.requirements.size > memory.memoryHeaps[heap].size) return out_of_memory("larger than the heap");
    Error last;
    for (const std::uint32_t type : types) {
        Expected<Memory> result = allocate_from(type, request);
        if (result || result.error().code != ErrorCode::out_of_memory) return result;
        last = std::move(result.error());
    }
    return out_of_memory(last.reason);
}

Expected<Memory> MemoryAllocator::allocate_from(std::uint32_t type, const MemoryRequest& request) {
    const VkPhysicalDeviceMemoryProperties& memory = context_.physical->memory;
    const bool is_visible = memory.memoryTypes[type].propertyFlags & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
    std::uint64_t size = request.requirements.size, alignment = request.requirements.alignment;
    if (is_visible) {
        const std::uint64_t atom = context_.physical->properties.limits.nonCoherentAtomSize;
        alignment = std::max(alignment, atom);
        size = round_up(size, atom);
    }
    const std::uint64_t heap_size = memory.memoryHeaps[memory.memoryTypes[type].heapIndex].size;
    const std::uint64_t block_limit = std::min(largest_block_size, heap_size / 8);
    Memory result;
    result.allocator_ = nullptr;
    if (request.prefers_dedicated || size > block_limit / 2) {
        NACRE_TRY(auto block, make_block(type, size, &request));
        block->is_dedicated = true;
        result.block_ = block.get();
        result.size_ = size;
        result.allocator_ = this;
        dedicated_.push_back(std::move(block));
        return result;
    }
    Pool& pool = pool_of(type, request.is_image);
    const auto take = [&](MemoryBlock& block) {
        const auto range = block.ranges.allocate(size, alignment);
        if (!range) return false;
        result.allocator_ = this;
        result.block_ = &block;
        result.offset_ = range->offset;
        result.size_ = is_visible ? round_up(size, RangeAllocator::granule) : range->size;
        result.range_ = range->id;
        return true;
    };
    for (auto& block : pool.blocks)
        if (take(*block)) return result;
    // Blocks grow, so that a small program holds little and a large one makes few calls.
    if (pool.next_block_size == 0) pool.next_block_size = std::min(first_block_size, block_limit);
    while (pool.next_block_size < size * 2 && pool.next_block_size < block_limit) pool.next_block_size *= 2;
    const std::uint64_t block_size = std::max(std::min(pool.next_block_size, block_limit), size);
    auto made = make_block(type, block_size, nullptr);
    if (!made) {
        // The heap may still hold this one object.
        made = make_block(type, round_up(size, RangeAllocator::granule), nullptr);
        if (!made) return std::unexpected(std::move(made).error());
    }
    pool.next_block_size = std::min(block_size * 2, block_limit);
    (*made)->is_image = request.is_image;
    pool.blocks.push_back(*std::move(made));
    if (!take(*pool.blocks.back()))
        return nacre::fail(ErrorCode::internal, "allocate memory", request.subject, "a new block does not hold it");
    return result;
}

Expected<std::unique_ptr<MemoryBlock>> MemoryAllocator::make_block(std::uint32_t type, std::uint64_t size,
                                                                   const MemoryRequest* dedicated) {
    const auto subject = [&] { return fmt::format("block of {} bytes", size); };
    if (driver_allocations_ >= context_.physical->properties.limits.maxMemoryAllocationCount)
        return nacre::fail(ErrorCode::out_of_memory, "allocate memory", subject(),
                           fmt::format("the driver allows {} allocations", driver_allocations_));
    VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
    VkMemoryDedicatedAllocateInfo owner{VK_STRUCTURE_TYPE_MEMORY_DEDICATED_ALLOCATE_INFO};
    if (dedicated && dedicated->prefers_dedicated) {
        owner.buffer = dedicated->dedicated_buffer;
        owner.image = dedicated->dedicated_image;
        info.pNext = &owner;
        size = dedicated->requirements.size;  // A dedicated allocation has exactly the size that its object needs.
    }
    // Any buffer may be one that builds of acceleration structures address.
    VkMemoryAllocateFlagsInfo addressed{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO, info.pNext};
    addressed.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    if (context_.capabilities.ray_query) info.pNext = &addressed;
    info.allocationSize = size;
    info.memoryTypeIndex = type;
    auto block = std::make_unique<MemoryBlock>(size, type);
    if (VkResult result = context_.vk.AllocateMemory(context_.device, &info, nullptr, &block->memory);
        result != VK_SUCCESS)
        return fail(context_.check(result), "allocate memory", subject());
    const VkMemoryPropertyFlags flags = context_.physical->memory.memoryTypes[type].propertyFlags;
    block->is_coherent = flags & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    // Kept mapped for the block's whole life: mapping is slow, and two maps of one block at once are not allowed.
    if (flags & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) {
        void* address = nullptr;
        if (VkResult result = context_.vk.MapMemory(context_.device, block->memory, 0, VK_WHOLE_SIZE, 0, &address);
            result != VK_SUCCESS) {
            context_.vk.FreeMemory(context_.device, block->memory, nullptr);
            return fail(context_.check(result), "map memory", subject());
        }
        block->mapped = static_cast<std::byte*>(address);
    }
    reserved_bytes_ += size;
    ++driver_allocations_;
    return block;
}

void MemoryAllocator::release(Memory& memory) {
    MemoryBlock& block = *memory.block_;
    if (block.is_dedicated) {
        destroy(block);
        std::erase_if(dedicated_, [&](const auto& each) { return each.get() == &block; });
        return;
    }
    block.ranges.release(memory.range_);
    if (!block.ranges.is_empty()) return;
    // One empty block of a pool is kept for the next object; more go back to the driver.
    Pool& pool = pool_of(block.type, block.is_image);
    const auto is_empty = [](const auto& each) { return each->ranges.is_empty(); };
    if (std::ranges::count_if(pool.blocks, is_empty) < 2) return;
    destroy(block);
    std::erase_if(pool.blocks, [&](const auto& each) { return each.get() == &block; });
}

void MemoryAllocator::destroy(MemoryBlock& block) {
    context_.vk.FreeMemory(context_.device, block.memory, nullptr);
    reserved_bytes_ -= block.size;
    --driver_allocations_;
}

}  // namespace nacre::vulkan
