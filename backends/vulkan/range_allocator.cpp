// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/range_allocator.h"

#include <bit>

namespace nacre::vulkan {
namespace {

constexpr std::uint64_t round_up(std::uint64_t value, std::uint64_t alignment) {
    return (value + alignment - 1) & ~(alignment - 1);
}

}  // namespace

RangeAllocator::RangeAllocator(std::uint64_t capacity) : capacity_(capacity / granule * granule) {
    for (auto& heads : heads_) heads.fill(none);
    if (capacity_ == 0) return;
    const std::uint32_t id = make_node();
    nodes_[id].size = capacity_;
    insert_free(id);
}

RangeAllocator::SizeClass RangeAllocator::class_of(std::uint64_t size) {
    const std::uint64_t granules = size / granule;
    if (granules < second_count) return {0, static_cast<std::uint32_t>(granules)};
    const auto log2 = static_cast<std::uint32_t>(std::bit_width(granules)) - 1;
    const auto second = static_cast<std::uint32_t>(granules >> (log2 - second_bits)) & (second_count - 1);
    return {log2 - second_bits + 1, second};
}

std::uint32_t RangeAllocator::find(std::uint64_t size, std::uint64_t alignment) const {
    const auto fits = [&](std::uint32_t id) {
        const Node& node = nodes_[id];
        return round_up(node.offset, alignment) - node.offset + size <= node.size;
    };
    // Every node of a class above that of the padded size fits; its own class and those between may hold one that does.
    const std::uint64_t padded = alignment > granule ? size + alignment - granule : size;
    const SizeClass own = class_of(size), certain = class_of(padded);
    std::uint32_t first = own.first, second = own.second;
    while (true) {
        std::uint32_t seconds = first < first_count ? second_bitmaps_[first] & (~0u << second) : 0;
        if (seconds == 0) {
            const std::uint64_t firsts = first + 1 < 64 ? first_bitmap_ & (~std::uint64_t{0} << (first + 1)) : 0;
            if (firsts == 0) return none;
            first = static_cast<std::uint32_t>(std::countr_zero(firsts));
            seconds = second_bitmaps_[first];
        }
        second = static_cast<std::uint32_t>(std::countr_zero(seconds));
        const bool is_certain = first > certain.first || (first == certain.first && second > certain.second);
        // Bounded, so that the time stays constant; what is missed here is found in a larger class.
        const int limit = is_certain ? 1 : 16;
        int looked_at = 0;
        for (std::uint32_t id = heads_[first][second]; id != none && looked_at < limit; id = nodes_[id].next_free) {
            if (fits(id)) return id;
            ++looked_at;
        }
        if (++second == second_count) ++first, second = 0;
    }
}

std::optional<RangeAllocator::Range> RangeAllocator::allocate(std::uint64_t size, std::uint64_t alignment) {
    if (size == 0 || size > capacity_ || alignment > capacity_ + granule) return std::nullopt;
    size = round_up(size, granule);
    std::uint32_t id = find(size, alignment);
    if (id == none) return std::nullopt;
    remove_free(id);
    if (const std::uint64_t gap = round_up(nodes_[id].offset, alignment) - nodes_[id].offset; gap > 0) {
        const std::uint32_t front = id;
        split(front, gap);
        id = nodes_[front].after;
        remove_free(id);
        insert_free(front);
    }
    if (nodes_[id].size > size) split(id, size);
    used_ += nodes_[id].size;
    return Range{nodes_[id].offset, nodes_[id].size, id};
}

void RangeAllocator::release(std::uint32_t id) {
    used_ -= nodes_[id].size;
    const auto absorb_next = [&](std::uint32_t into) {
        const std::uint32_t next = nodes_[into].after;
        nodes_[into].size += nodes_[next].size;
        nodes_[into].after = nodes_[next].after;
        if (nodes_[into].after != none) nodes_[nodes_[into].after].before = into;
        nodes_[next] = {};
        spare_nodes_.push_back(next);
    };
    if (const std::uint32_t next = nodes_[id].after; next != none && nodes_[next].is_free) {
        remove_free(next);
        absorb_next(id);
    }
    if (const std::uint32_t before = nodes_[id].before; before != none && nodes_[before].is_free) {
        remove_free(before);
        absorb_next(before);
        id = before;
    }
    insert_free(id);
}

std::uint32_t RangeAllocator::make_node() {
    if (!spare_nodes_.empty()) {
        const std::uint32_t id = spare_nodes_.back();
        spare_nodes_.pop_back();
        return id;
    }
    nodes_.emplace_back();
    return static_cast<std::uint32_t>(nodes_.size() - 1);
}

void RangeAllocator::insert_free(std::uint32_t id) {
    const auto [first, second] = class_of(nodes_[id].size);
    const std::uint32_t head = heads_[first][second];
    nodes_[id].is_free = true;
    nodes_[id].previous_free = none;
    nodes_[id].next_free = head;
    if (head != none) nodes_[head].previous_free = id;
    heads_[first][second] = id;
    second_bitmaps_[first] |= 1u << second;
    first_bitmap_ |= std::uint64_t{1} << first;
}

void RangeAllocator::remove_free(std::uint32_t id) {
    Node& node = nodes_[id];
    const auto [first, second] = class_of(node.size);
    if (node.previous_free != none) nodes_[node.previous_free].next_free = node.next_free;
    if (node.next_free != none) nodes_[node.next_free].previous_free = node.previous_free;
    if (heads_[first][second] == id) {
        heads_[first][second] = node.next_free;
        if (node.next_free == none) {
            second_bitmaps_[first] &= ~(1u << second);
            if (second_bitmaps_[first] == 0) first_bitmap_ &= ~(std::uint64_t{1} << first);
        }
    }
    node.is_free = false;
    node.previous_free = node.next_free = none;
}

void RangeAllocator::split(std::uint32_t id, std::uint64_t size) {
    const std::uint32_t rest = make_node();
    Node& node = nodes_[id];
    nodes_[rest].offset = node.offset + size;
    nodes_[rest].size = node.size - size;
    nodes_[rest].before = id;
    nodes_[rest].after = node.after;
    if (node.after != none) nodes_[node.after].before = rest;
    node.after = rest;
    node.size = size;
    insert_free(rest);
}

bool RangeAllocator::is_consistent() const {
    if (capacity_ == 0) return true;
    std::uint32_t start = none;
    std::uint64_t free_nodes = 0;
    for (std::uint32_t id = 0; id < nodes_.size(); ++id)
        if (nodes_[id].size > 0 && nodes_[id].before == none) {
            if (start != none) return false;
            start = id;
        }
    std::uint64_t at = 0, used = 0;
    bool last_free = false;
    for (std::uint32_t id = start, before = none; id != none; before = id, id = nodes_[id].after) {
        const Node& node = nodes_[id];
        if (node.offset != at || node.size == 0 || node.size % granule != 0 || node.before != before) return false;
        if (node.is_free && last_free) return false;
        last_free = node.is_free;
        at += node.size;
        if (node.is_free)
            ++free_nodes;
        else
            used += node.size;
    }
    if (at != capacity_ || used != used_) return false;
    for (std::uint32_t first = 0; first < first_count; ++first) {
        if (((first_bitmap_ >> first) & 1) != (second_bitmaps_[first] != 0)) return false;
        for (std::uint32_t second = 0; second < second_count; ++second) {
            if (((second_bitmaps_[first] >> second) & 1) != (heads_[first][second] != none)) return false;
            for (std::uint32_t id = heads_[first][second]; id != none; id = nodes_[id].next_free) {
                const SizeClass expected = class_of(nodes_[id].size);
                if (!nodes_[id].is_free || expected.first != first || expected.second != second) return false;
                --free_nodes;
            }
        }
    }
    return free_nodes == 0;
}

}  // namespace nacre::vulkan
