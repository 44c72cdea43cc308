// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "backends/cpu/host_memory.h"

namespace nacre::cpu {
namespace {

TEST(MemoryBlocks, AreZeroAlignedAndReadableBehindTheirEnd) {
    const auto memory = std::make_shared<HostMemory>(std::uint64_t{1} << 30);
    for (const std::uint64_t size : {1u, 63u, 64u, 4097u, 300'000u, 5'000'000u}) {
        const MemoryBlock block(memory, size);
        ASSERT_TRUE(block.data());
        EXPECT_EQ(block.size(), size);
        EXPECT_EQ(reinterpret_cast<std::uintptr_t>(block.data()) % 64, 0u);
        std::uint64_t set_bytes = 0;
        for (std::uint64_t i = 0; i < size + readable_bytes_behind; ++i) set_bytes += block.data()[i] != std::byte{0};
        EXPECT_EQ(set_bytes, 0u);
        EXPECT_GE(memory->reserved_bytes(), size);
        EXPECT_EQ(memory->allocations(), 1u);
        // Written to the last byte: a block that is too small would be seen by the address sanitizer.
        block.data()[size - 1] = std::byte{1};
    }
    EXPECT_EQ(memory->reserved_bytes(), 0u);
    EXPECT_EQ(memory->allocations(), 0u);
}

TEST(MemoryBlocks, AreCountedWhenTheyMove) {
    const auto memory = std::make_shared<HostMemory>(std::uint64_t{1} << 20);
    MemoryBlock first(memory, 1000);
    std::byte* const data = first.data();
    MemoryBlock second(std::move(first));
    EXPECT_EQ(second.data(), data);
    EXPECT_EQ(memory->allocations(), 1u);
    second = MemoryBlock(memory, 2000);
    EXPECT_EQ(memory->allocations(), 1u);
    second = {};
    EXPECT_EQ(memory->reserved_bytes(), 0u);
}

TEST(MemoryBlocks, HaveNoDataBeyondTheCapacity) {
    const auto memory = std::make_shared<HostMemory>(10'000);
    EXPECT_FALSE(MemoryBlock(memory, 20'000).data());
    EXPECT_FALSE(MemoryBlock(memory, ~std::uint64_t{0}).data());
    const MemoryBlock most(memory, 6'000);
    EXPECT_TRUE(most.data());
    EXPECT_FALSE(MemoryBlock(memory, 6'000).data());
    EXPECT_TRUE(MemoryBlock(memory, 1'000).data());
}

TEST(MemoryBlocks, FailWhereTheFaultIsPlanted) {
    const auto memory = std::make_shared<HostMemory>(10'000, 2);
    const MemoryBlock first(memory, 8), second(memory, 8), third(memory, 8);
    EXPECT_TRUE(first.data());
    EXPECT_FALSE(second.data());
    EXPECT_TRUE(third.data());
}

}  // namespace
}  // namespace nacre::cpu
