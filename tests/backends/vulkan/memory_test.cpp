// SPDX-License-Identifier: Apache-2.0
// The allocator over a made-up driver, for what software drivers do not have: memory that the host cannot see, memory
// that is not coherent, heaps that are full, a granularity between buffers and images.
#include "backends/vulkan/memory.h"

#include <gtest/gtest.h>

#include <map>

namespace nacre::vulkan {
namespace {

constexpr std::uint64_t mebibyte = 1 << 20;

/// Stands in for the driver's functions; one at a time.
struct FakeDriver {
    std::map<std::uint64_t, VkMemoryAllocateInfo> live;
    std::map<std::uint32_t, std::uint64_t> free_in_heap;
    std::vector<VkMappedMemoryRange> flushed, invalidated;
    std::vector<VkMemoryType> types;
    std::vector<std::byte> storage = std::vector<std::byte>(1);
    std::uint64_t next = 1;
    static inline FakeDriver* current = nullptr;
};

VKAPI_ATTR VkResult VKAPI_CALL allocate(VkDevice, const VkMemoryAllocateInfo* info, const VkAllocationCallbacks*,
                                        VkDeviceMemory* memory) {
    FakeDriver& driver = *FakeDriver::current;
    std::uint64_t& left = driver.free_in_heap[driver.types[info->memoryTypeIndex].heapIndex];
    if (info->allocationSize > left) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    left -= info->allocationSize;
    const std::uint64_t id = driver.next++;
    driver.live[id] = *info;
    *memory = reinterpret_cast<VkDeviceMemory>(id);
    return VK_SUCCESS;
}
VKAPI_ATTR void VKAPI_CALL release(VkDevice, VkDeviceMemory memory, const VkAllocationCallbacks*) {
    FakeDriver& driver = *FakeDriver::current;
    const auto each = driver.live.find(reinterpret_cast<std::uint64_t>(memory));
    ASSERT_NE(each, driver.live.end()) << "freed twice";
    driver.free_in_heap[driver.types[each->second.memoryTypeIndex].heapIndex] += each->second.allocationSize;
    driver.live.erase(each);
}
VKAPI_ATTR VkResult VKAPI_CALL map(VkDevice, VkDeviceMemory, VkDeviceSize, VkDeviceSize, VkMemoryMapFlags,
                                   void** address) {
    *address = FakeDriver::current->storage.data();  // Never touched, only compared.
    return VK_SUCCESS;
}
VKAPI_ATTR VkResult VKAPI_CALL flush(VkDevice, std::uint32_t count, const VkMappedMemoryRange* ranges) {
    FakeDriver::current->flushed.assign(ranges, ranges + count);
    return VK_SUCCESS;
}
VKAPI_ATTR VkResult VKAPI_CALL invalidate(VkDevice, std::uint32_t count, const VkMappedMemoryRange* ranges) {
    FakeDriver::current->invalidated.assign(ranges, ranges + count);
    return VK_SUCCESS;
}

constexpr VkMemoryPropertyFlags local = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT,
                                visible = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT,
                                coherent = VK_MEMORY_PROPERTY_HOST_COHERENT_BIT,
                                cached = VK_MEMORY_PROPERTY_HOST_CACHED_BIT;

/// A graphics card: 1 GiB of its own, 2 GiB of the host's, and a small window of its own that the host sees.
class MemoryTest : public testing::Test {
  protected:
    void SetUp() override {
        FakeDriver::current = &driver;
        driver.types = {{local, 0}, {visible | coherent, 1}, {visible | cached, 1}, {local | visible | coherent, 2}};
        driver.free_in_heap = {{0, 1024 * mebibyte}, {1, 2048 * mebibyte}, {2, 256 * mebibyte}};
        context.physical = std::make_unique<PhysicalDevice>();
        VkPhysicalDeviceMemoryProperties& memory = context.physical->memory;
        memory.memoryHeapCount = 3;
        for (std::uint32_t i = 0; i < 3; ++i) memory.memoryHeaps[i].size = driver.free_in_heap[i];
        memory.memoryTypeCount = static_cast<std::uint32_t>(driver.types.size());
        std::ranges::copy(driver.types, memory.memoryTypes);
        VkPhysicalDeviceLimits& limits = context.physical->properties.limits;
        limits.nonCoherentAtomSize = 128;
        limits.bufferImageGranularity = 1024;
        limits.maxMemoryAllocationCount = 8;
        context.vk.AllocateMemory = allocate;
        context.vk.FreeMemory = release;
        context.vk.MapMemory = map;
        context.vk.FlushMappedMemoryRanges = flush;
        context.vk.InvalidateMappedMemoryRanges = invalidate;
        make_allocator();
    }
    void TearDown() override {
        context.memory.reset();
        EXPECT_TRUE(driver.live.empty()) << "memory is left behind";
        context.device = VK_NULL_HANDLE;
    }
    void make_allocator() { context.memory = std::make_unique<MemoryAllocator>(context); }

    static MemoryRequest request(std::uint64_t size, rhi::MemoryKind kind, bool is_image = false) {
        MemoryRequest result;
        result.requirements = {size, 256, 0xf};
        result.kind = kind;
        result.is_image = is_image;
        result.subject = "buffer 'test'";
        return result;
    }
    std::uint32_t type_of(const Memory& memory) {
        return driver.live.at(reinterpret_cast<std::uint64_t>(memory.handle())).memoryTypeIndex;
    }

    FakeDriver driver;
    Context context;
};

TEST_F(MemoryTest, TakesTheKindOfMemoryThatTheUseWants) {
    const Memory device = *context.memory->allocate(request(1000, rhi::MemoryKind::device));
    const Memory upload = *context.memory->allocate(request(1000, rhi::MemoryKind::upload));
    const Memory readback = *context.memory->allocate(request(1000, rhi::MemoryKind::readback));
    EXPECT_EQ(type_of(device), 0u);
    EXPECT_EQ(type_of(upload), 1u);
    EXPECT_EQ(type_of(readback), 2u);
    EXPECT_EQ(device.mapped(), nullptr);
    EXPECT_NE(upload.mapped(), nullptr);
    EXPECT_NE(readback.mapped(), nullptr);
}

TEST_F(MemoryTest, FlushesWholeAtomsAndOnlyWhereMemoryIsNotCoherent) {
    const Memory upload = *context.memory->allocate(request(1000, rhi::MemoryKind::upload));
    ASSERT_TRUE(upload.flush());
    EXPECT_TRUE(driver.flushed.empty());
    const Memory first = *context.memory->allocate(request(100, rhi::MemoryKind::readback));
    const Memory second = *context.memory->allocate(request(100, rhi::MemoryKind::readback));
    ASSERT_TRUE(second.invalidate());
    ASSERT_EQ(driver.invalidated.size(), 1u);
    EXPECT_EQ(driver.invalidated[0].memory, second.handle());
    EXPECT_EQ(driver.invalidated[0].offset, second.offset());
    EXPECT_EQ(driver.invalidated[0].offset % 128, 0u);
    EXPECT_EQ(driver.invalidated[0].size % 128, 0u);
    EXPECT_GE(second.offset(), first.offset() + 128);
    EXPECT_EQ(second.mapped() - first.mapped(), static_cast<std::ptrdiff_t>(second.offset() - first.offset()));
}

TEST_F(MemoryTest, KeepsImagesAndBuffersApart) {
    const Memory buffer = *context.memory->allocate(request(1000, rhi::MemoryKind::device));
    const Memory image = *context.memory->allocate(request(1000, rhi::MemoryKind::device, true));
    EXPECT_NE(buffer.handle(), image.handle());
    context.physical->properties.limits.bufferImageGranularity = 1;
    MemoryAllocator together(context);
    const Memory other_buffer = *together.allocate(request(1000, rhi::MemoryKind::device));
    const Memory other_image = *together.allocate(request(1000, rhi::MemoryKind::device, true));
    EXPECT_EQ(other_buffer.handle(), other_image.handle());
}

TEST_F(MemoryTest, SharesBlocksAndGivesLargeObjectsTheirOwn) {
    std::vector<Memory> small;
    for (int i = 0; i < 100; ++i) small.push_back(*context.memory->allocate(request(4096, rhi::MemoryKind::device)));
    EXPECT_EQ(context.memory->driver_allocations(), 1u);
    const std::uint64_t before = context.memory->reserved_bytes();
    {
        const Memory large = *context.memory->allocate(request(300 * mebibyte, rhi::MemoryKind::device));
        EXPECT_EQ(large.offset(), 0u);
        EXPECT_EQ(context.memory->driver_allocations(), 2u);
    }
    EXPECT_EQ(context.memory->reserved_bytes(), before);
    small.clear();
    EXPECT_LE(context.memory->driver_allocations(), 1u);
}

TEST_F(MemoryTest, GivesADedicatedAllocationItsExactSizeAndOwner) {
    MemoryRequest wanted = request(1000, rhi::MemoryKind::device, true);
    wanted.prefers_dedicated = true;
    wanted.dedicated_image = reinterpret_cast<VkImage>(std::uintptr_t{77});
    const Memory memory = *context.memory->allocate(wanted);
    const VkMemoryAllocateInfo& info = driver.live.at(reinterpret_cast<std::uint64_t>(memory.handle()));
    EXPECT_EQ(info.allocationSize, 1000u);
    EXPECT_NE(info.pNext, nullptr);
}

TEST_F(MemoryTest, TurnsToTheNextHeapAndThenNamesSizeAndHeap) {
    // 900 MiB fit into the card's own memory once; the second goes to the host's.
    const Memory first = *context.memory->allocate(request(900 * mebibyte, rhi::MemoryKind::device));
    const Memory second = *context.memory->allocate(request(900 * mebibyte, rhi::MemoryKind::device));
    EXPECT_EQ(type_of(first), 0u);
    EXPECT_NE(type_of(second), 0u);
    const Memory third = *context.memory->allocate(request(900 * mebibyte, rhi::MemoryKind::device));
    const auto fourth = context.memory->allocate(request(900 * mebibyte, rhi::MemoryKind::device));
    ASSERT_FALSE(fourth);
    EXPECT_EQ(fourth.error().code, ErrorCode::out_of_memory);
    EXPECT_NE(fourth.error().message().find(std::to_string(900 * mebibyte)), std::string::npos);
    EXPECT_NE(fourth.error().message().find("heap 0"), std::string::npos) << fourth.error().message();
    EXPECT_NE(fourth.error().message().find("buffer 'test'"), std::string::npos);
    // What fits still does.
    EXPECT_TRUE(context.memory->allocate(request(1000, rhi::MemoryKind::device)));
    const auto beyond = context.memory->allocate(request(std::uint64_t{1} << 62, rhi::MemoryKind::upload));
    ASSERT_FALSE(beyond);
    EXPECT_EQ(beyond.error().code, ErrorCode::out_of_memory);
}

TEST_F(MemoryTest, StopsAtTheDriversNumberOfAllocations) {
    std::vector<Memory> large;
    Expected<Memory> result;
    for (int i = 0; i < 20; ++i) {
        result = context.memory->allocate(request(40 * mebibyte, rhi::MemoryKind::device));
        if (!result) break;
        large.push_back(*std::move(result));
    }
    ASSERT_FALSE(result);
    EXPECT_EQ(large.size(), 8u);
    EXPECT_EQ(result.error().code, ErrorCode::out_of_memory);
    large.pop_back();
    EXPECT_TRUE(context.memory->allocate(request(40 * mebibyte, rhi::MemoryKind::device)));
}

TEST_F(MemoryTest, RefusesWhatNoTypeServes) {
    MemoryRequest wanted = request(1000, rhi::MemoryKind::upload);
    wanted.requirements.memoryTypeBits = 1;  // Only memory that the host cannot see.
    const auto result = context.memory->allocate(wanted);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::unsupported);
}

}  // namespace
}  // namespace nacre::vulkan
