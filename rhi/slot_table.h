// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rhi/handle.h"

namespace nacre::rhi {

/// Objects by handle. Slots never move, so a pointer to one stays valid for the table's life, and a generation tells
/// whether it still holds the same object. A slot whose generations are used up is never used again.
///
/// Not thread-safe by itself: see `DeviceState` for who may look and who may change.
template <typename HandleType, typename Object>
class SlotTable {
  public:
    struct Slot {
        std::uint32_t generation = 1;  ///< Of the object in the slot, or of the next one where it is empty.
        bool occupied = false;
        Object object{};
        std::string last_name{};  ///< Of the object that was here before, for messages about stale handles.
    };

    explicit SlotTable(std::uint16_t device) : device_(device) {}

    /// Puts an object into a slot. The empty handle where all 16 million slots are taken.
    HandleType insert(Object object) {
        std::uint32_t index = 0;
        if (!free_.empty()) {
            index = free_.back();
            free_.pop_back();
        } else {
            if (count_ == max_slots) return {};
            index = count_++;
            if (index / chunk_size == chunks_.size()) chunks_.push_back(std::make_unique<Slot[]>(chunk_size));
        }
        Slot& slot = at(index);
        slot.object = std::move(object);
        slot.occupied = true;
        ++occupied_;
        HandleType handle;
        handle.index = index;
        handle.generation = slot.generation;
        handle.device = device_;
        return handle;
    }

    /// The slot of a live object; null for an empty handle, a stale one, or one of another device.
    Slot* find_slot(HandleType handle) {
        if (handle.device != device_ || handle.index >= count_) return nullptr;
        Slot& slot = at(handle.index);
        return slot.occupied && slot.generation == handle.generation ? &slot : nullptr;
    }
    Object* find(HandleType handle) {
        Slot* slot = find_slot(handle);
        return slot ? &slot->object : nullptr;
    }
    const Object* find(HandleType handle) const { return const_cast<SlotTable*>(this)->find(handle); }

    /// Takes an object out; its handles are stale from now on. The handle must be live.
    Object remove(HandleType handle, std::string name) {
        Slot& slot = at(handle.index);
        Object object = std::exchange(slot.object, Object{});
        slot.occupied = false;
        slot.last_name = std::move(name);
        --occupied_;
        if (++slot.generation < max_generation) free_.push_back(static_cast<std::uint32_t>(handle.index));
        return object;
    }

    /// Name of the object that a stale handle meant; empty where it is not known any more.
    std::string stale_name(HandleType handle) const {
        if (handle.device != device_ || handle.index >= count_) return {};
        const Slot& slot = const_cast<SlotTable*>(this)->at(handle.index);
        return slot.generation == std::uint64_t{handle.generation} + 1 ? slot.last_name : std::string{};
    }

    /// Calls `visit(Object&)` for all live objects.
    template <typename Visitor>
    void for_each(Visitor&& visit) {
        for (std::uint32_t i = 0; i < count_; ++i)
            if (Slot& slot = at(i); slot.occupied) visit(slot.object);
    }
    [[nodiscard]] std::uint32_t size() const { return occupied_; }
    [[nodiscard]] std::uint16_t device() const { return device_; }

  private:
    static constexpr std::uint32_t chunk_size = 256;
    static constexpr std::uint32_t max_slots = 0xffffff;
    static constexpr std::uint32_t max_generation = 0xffffff;

    Slot& at(std::uint64_t index) { return chunks_[index / chunk_size][index % chunk_size]; }

    std::vector<std::unique_ptr<Slot[]>> chunks_;
    std::vector<std::uint32_t> free_;
    std::uint32_t count_ = 0;
    std::uint32_t occupied_ = 0;
    std::uint16_t device_ = 0;
};

}  // namespace nacre::rhi
