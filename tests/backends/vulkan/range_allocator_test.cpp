// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/range_allocator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

namespace nacre::vulkan {
namespace {

constexpr std::uint64_t granule = RangeAllocator::granule;

TEST(RangeAllocator, GivesTheWholeSpanAndTakesItBack) {
    RangeAllocator ranges(1 << 20);
    const auto all = ranges.allocate(1 << 20, 256);
    ASSERT_TRUE(all);
    EXPECT_EQ(all->offset, 0u);
    EXPECT_EQ(ranges.used(), 1u << 20);
    EXPECT_FALSE(ranges.allocate(1, 1));
    ranges.release(all->id);
    EXPECT_TRUE(ranges.is_empty());
    EXPECT_TRUE(ranges.is_consistent());
    EXPECT_TRUE(ranges.allocate(1 << 20, 1));
}

TEST(RangeAllocator, RefusesWhatCannotFit) {
    RangeAllocator ranges(1 << 20);
    EXPECT_FALSE(ranges.allocate(0, 1));
    EXPECT_FALSE(ranges.allocate((1 << 20) + 1, 1));
    EXPECT_FALSE(ranges.allocate(~std::uint64_t{0}, 256));
    EXPECT_FALSE(ranges.allocate(64, std::uint64_t{1} << 40));
    RangeAllocator nothing(granule - 1);
    EXPECT_EQ(nothing.capacity(), 0u);
    EXPECT_FALSE(nothing.allocate(1, 1));
    EXPECT_TRUE(nothing.is_consistent());
}

TEST(RangeAllocator, MergesNeighborsInAnyOrderOfRelease) {
    for (int order = 0; order < 6; ++order) {
        RangeAllocator ranges(3 * 1024);
        std::array<std::uint32_t, 3> ids{};
        for (auto& id : ids) id = ranges.allocate(1024, 64)->id;
        std::array<int, 3> permutation{0, 1, 2};
        for (int i = 0; i < order; ++i) std::next_permutation(permutation.begin(), permutation.end());
        for (const int i : permutation) {
            ranges.release(ids[i]);
            EXPECT_TRUE(ranges.is_consistent());
        }
        EXPECT_TRUE(ranges.allocate(3 * 1024, 64));
    }
}

/// Against a plain map of what is taken: no overlap, right alignment, and no refusal while a gap is certain to fit.
TEST(RangeAllocator, AgreesWithAReferenceOverRandomWork) {
    for (std::uint32_t seed = 1; seed <= 8; ++seed) {
        std::mt19937 random(seed);
        const std::uint64_t capacity = std::uint64_t{1} << (14 + seed);
        RangeAllocator ranges(capacity);
        struct Taken {
            std::uint64_t size;
            std::uint32_t id;
        };
        std::map<std::uint64_t, Taken> taken;
        const auto largest_gap = [&] {
            std::uint64_t at = 0, largest = 0;
            for (const auto& [offset, each] : taken) {
                largest = std::max(largest, offset - at);
                at = offset + each.size;
            }
            return std::max(largest, capacity - at);
        };
        int refused = 0, granted = 0;
        for (int step = 0; step < 4000; ++step) {
            if (random() % 5 < 3) {
                const std::uint64_t size = 1 + random() % (std::uint64_t{1} << (random() % (8 + seed)));
                const std::uint64_t alignment = std::uint64_t{1} << (random() % 13);
                const auto range = ranges.allocate(size, alignment);
                if (!range) {
                    ++refused;
                    // A size class is at most 1/32 wide, and alignment takes up to one alignment.
                    ASSERT_LT(largest_gap(), (size + alignment) * 33 / 32 + 2 * granule) << "seed " << seed;
                    continue;
                }
                ++granted;
                ASSERT_GE(range->size, size);
                ASSERT_EQ(range->offset % alignment, 0u);
                ASSERT_LE(range->offset + range->size, capacity);
                const auto next = taken.lower_bound(range->offset);
                if (next != taken.end()) {
                    ASSERT_LE(range->offset + range->size, next->first);
                }
                if (next != taken.begin()) {
                    const auto before = std::prev(next);
                    ASSERT_LE(before->first + before->second.size, range->offset);
                }
                taken[range->offset] = {range->size, range->id};
            } else if (!taken.empty()) {
                auto each = std::next(taken.begin(), random() % taken.size());
                ranges.release(each->second.id);
                taken.erase(each);
            }
            if (step % 64 == 0) {
                ASSERT_TRUE(ranges.is_consistent()) << "seed " << seed << ", step " << step;
            }
        }
        EXPECT_GT(granted, 500);
        std::uint64_t used = 0;
        for (const auto& [offset, each] : taken) used += each.size;
        EXPECT_EQ(ranges.used(), used);
        for (const auto& [offset, each] : taken) ranges.release(each.id);
        EXPECT_TRUE(ranges.is_empty());
        EXPECT_TRUE(ranges.is_consistent());
        EXPECT_TRUE(ranges.allocate(capacity, 1));
    }
}

}  // namespace
}  // namespace nacre::vulkan
