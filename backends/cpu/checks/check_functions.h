// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <span>
#include <string>

#include "backends/cpu/checks/check_interface.h"
#include "backends/cpu/checks/checked_memory.h"
#include "backends/cpu/checks/fault_log.h"

namespace nacre::cpu {

/// What checked code is told of the dispatch or draw that it runs in. Read by all threads.
class CommandChecks {
  public:
    std::uint32_t flags = 0;  ///< CheckFlags
    std::uint32_t scope = 0;  ///< Of races: dispatches and render pass have numbers of their own, from 1.
    std::string command;      ///< "dispatch 2 of list 'frame', pass 'lighting'"
    std::array<const CheckedObjects*, max_groups> objects{};
    std::array<CheckedMemory*, max_vertex_buffers> vertex_buffers{};  ///< Null where nothing is bound.
    /// Color targets of the pass.
    struct Target {
        CheckedMemory* memory = nullptr;  ///< Null: nothing is known.
        ImageLevel level{};
        std::uint32_t texel_bytes = 0;
    };
    std::array<Target, 8> targets{};
    std::span<CheckedMemory* const> workgroup_memories;  ///< One for each thread; null entries are allowed.
    std::atomic<std::uint64_t>* batches = nullptr;       ///< Counts the batches of a scope.
    ExecutionState* state = nullptr;
    FaultLog* log = nullptr;
};

// See check_interface.h.
NacreCpuCheckBegin check_begin_function();
NacreCpuCheckWorkgroup check_workgroup_function();
NacreCpuCheckFault check_fault_function();
NacreCpuCheckMemory check_memory_function();
NacreCpuCheckImage check_image_function();
NacreCpuCheckInput check_input_function();
/// Reports texels that nothing has written, of formats of 32 bits and more: what is written to others may look like
/// them.
void check_blend(const CommandChecks* checks, const BlendedTexels& texels);

/// Fills memory with what does harm: signalling NaNs as floats, far out of range as integers, different in each word.
void poison(std::byte* data, std::uint64_t bytes);
/// The word of poison at a place.
std::uint32_t poison_word(std::uint64_t index);

}  // namespace nacre::cpu
