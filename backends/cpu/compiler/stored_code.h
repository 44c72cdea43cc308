// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "backends/cpu/program.h"

/// @file
/// What the disk cache keeps of a compiled shader: its code, and all that the rest of the backend knows of it. With it
/// a shader that is known is neither legalized nor translated again.

namespace nacre::cpu {

/// What is known of a compute shader besides its code.
struct ComputeFacts {
    std::array<std::uint32_t, 3> workgroup_size{1, 1, 1};
    std::uint64_t workgroup_bytes = 0;  ///< Of the variables of a workgroup.
    std::uint32_t subgroups = 1;        ///< In a workgroup.
    bool has_barriers = false;          ///< The code suspends, and has a function that tells the size of its frame.
    std::vector<NarrowedOperation> narrowed;
};

/// What the code generator made, or why it is of no use.
struct StoredCode {
    std::uint64_t stack_bytes = 0;  ///< Of the frames of all functions.
    std::vector<std::byte> object;  ///< Empty where that is too much.
};

// An entry of the cache. Of programs everything is kept but `run`, `name`, `code` and `in_double`, which the options
// say. Entries are of this version of the compiler (the cache's key says so); whatever else `from_entry` may find in
// one, it returns false and leaves no part of it that could do harm.

std::vector<std::byte> to_entry(const ComputeFacts& facts, const StoredCode& code);
std::vector<std::byte> to_entry(const VertexProgram& facts, const StoredCode& code);
std::vector<std::byte> to_entry(const FragmentProgram& facts, const StoredCode& code);

bool from_entry(std::span<const std::byte> entry, ComputeFacts& facts, StoredCode& code);
bool from_entry(std::span<const std::byte> entry, VertexProgram& facts, StoredCode& code);
bool from_entry(std::span<const std::byte> entry, FragmentProgram& facts, StoredCode& code);

}  // namespace nacre::cpu
