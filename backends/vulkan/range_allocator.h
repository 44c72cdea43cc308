// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

/// @file
/// Divides a span of numbers (the bytes of a memory block) into ranges.
///
///     RangeAllocator ranges(64 << 20);
///     auto range = ranges.allocate(1000, 256);   // range->offset is a multiple of 256
///     ranges.release(range->id);

namespace nacre::vulkan {

/// Two-level segregated fit: constant time, at most 1/32 lost to the search of a size class (M. Masmano et al., "TLSF:
/// a new dynamic memory allocator for real-time systems", 2004). It keeps its own nodes beside the span, since device
/// memory cannot hold them. Not thread-safe.
class RangeAllocator {
  public:
    struct Range {
        std::uint64_t offset = 0;
        std::uint64_t size = 0;  ///< At least what was asked for; a multiple of `granule`.
        std::uint32_t id = 0;    ///< For `release`.
    };

    /// Sizes and offsets are multiples of this many bytes.
    static constexpr std::uint64_t granule = 64;

    /// `capacity` is rounded down to a multiple of `granule`.
    explicit RangeAllocator(std::uint64_t capacity);

    /// A free range of `size` bytes (above 0) at a multiple of `alignment` (a power of two), or nothing.
    std::optional<Range> allocate(std::uint64_t size, std::uint64_t alignment);
    /// Gives a range back; `id` is one that `allocate` returned and that was not released since.
    void release(std::uint32_t id);

    [[nodiscard]] std::uint64_t capacity() const { return capacity_; }
    [[nodiscard]] std::uint64_t used() const { return used_; }
    [[nodiscard]] bool is_empty() const { return used_ == 0; }
    /// Whether all invariants hold (ranges tile the span, free neighbors are merged, lists are complete); for tests.
    [[nodiscard]] bool is_consistent() const;

  private:
    static constexpr std::uint32_t none = ~0u;
    static constexpr std::uint32_t second_bits = 5, second_count = 1u << second_bits;
    static constexpr std::uint32_t first_count = 60;

    struct Node {
        std::uint64_t offset = 0, size = 0;
        std::uint32_t before = none, after = none;  ///< Neighbors in the span.
        std::uint32_t previous_free = none, next_free = none;
        bool is_free = false;
    };
    struct SizeClass {
        std::uint32_t first, second;
    };
    static SizeClass class_of(std::uint64_t size);
    [[nodiscard]] std::uint32_t find(std::uint64_t size, std::uint64_t alignment) const;
    std::uint32_t make_node();
    void insert_free(std::uint32_t id);
    void remove_free(std::uint32_t id);
    /// Cuts `id` after `size` bytes; the rest becomes a free node.
    void split(std::uint32_t id, std::uint64_t size);

    std::uint64_t capacity_ = 0, used_ = 0;
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> spare_nodes_;
    std::uint64_t first_bitmap_ = 0;
    std::array<std::uint32_t, first_count> second_bitmaps_{};
    std::array<std::array<std::uint32_t, second_count>, first_count> heads_{};
};

}  // namespace nacre::vulkan
