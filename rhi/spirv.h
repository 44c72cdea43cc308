// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "core/error.h"

/// @file
/// SPIR-V modules as words: checks that make any input safe, and a walk over the instructions. Used by reflection and
/// by backends; programs use `reflect` (rhi/reflection.h).
///
///     NACRE_CHECK(spirv::validate(words, "post.frag"));
///     for (const spirv::Instruction& instruction : spirv::instructions(words))
///         if (instruction.opcode() == spv::Op::OpCapability) ...

namespace nacre::rhi::spirv {

/// Ids that a module may use; the limit of the SPIR-V specification (table "Universal Limits").
inline constexpr std::uint32_t max_id_bound = 0x3fffff;

/// One instruction. Valid as long as the words it was made from.
struct Instruction {
    std::span<const std::uint32_t> words;  ///< With the word that holds opcode and count.
    std::size_t offset = 0;                ///< Of the first word in the module.

    [[nodiscard]] std::uint32_t opcode() const { return words[0] & 0xffff; }
    /// Operand word `index` from 0 (the first after the opcode); 0 where the instruction is shorter.
    [[nodiscard]] std::uint32_t operand(std::size_t index) const {
        return index + 1 < words.size() ? words[index + 1] : 0;
    }
    [[nodiscard]] std::size_t operand_count() const { return words.size() - 1; }
    /// The literal string that starts at an operand; stops at the end of the instruction.
    [[nodiscard]] std::string text(std::size_t index) const;
    /// Number of the operand that follows such a string.
    [[nodiscard]] std::size_t after_text(std::size_t index) const;
};

/// Walks over the instructions of a module that passed `check_structure`.
class InstructionRange {
  public:
    class Iterator {
      public:
        Iterator(std::span<const std::uint32_t> words, std::size_t offset) : words_(words), offset_(offset) {}
        Instruction operator*() const { return {words_.subspan(offset_, words_[offset_] >> 16), offset_}; }
        Iterator& operator++() {
            offset_ += words_[offset_] >> 16;
            return *this;
        }
        bool operator!=(const Iterator& other) const { return offset_ != other.offset_; }

      private:
        std::span<const std::uint32_t> words_;
        std::size_t offset_;
    };
    explicit InstructionRange(std::span<const std::uint32_t> words) : words_(words) {}
    [[nodiscard]] Iterator begin() const { return {words_, words_.size() < 5 ? words_.size() : 5}; }
    [[nodiscard]] Iterator end() const { return {words_, words_.size()}; }

  private:
    std::span<const std::uint32_t> words_;
};
inline InstructionRange instructions(std::span<const std::uint32_t> words) { return InstructionRange(words); }

/// Bytes of a file as words. Errors: shader_compile where the size is not a multiple of 4 or nothing is there.
Expected<std::span<const std::uint32_t>> words_of(std::span<const std::byte> bytes, std::string_view name);

/// Header (size, magic number, byte order, version, id bound) and the word count of every instruction.
Expected<void> check_structure(std::span<const std::uint32_t> words, std::string_view name);

/// All rules: `check_structure`, the capabilities that Nacre's shaders may use, then the validator of SPIRV-Tools with
/// the rules of Vulkan 1.1 (or later, as the module's version demands). Modules found valid are remembered by their
/// hash for the life of the process. Errors: shader_compile with the word offset, and the GLSL line where the module
/// has line tables; unsupported for capabilities. Thread-safe.
Expected<void> validate(std::span<const std::uint32_t> words, std::string_view name);

/// "Shader", "Int64", ...; "capability 6089" for one that has no name here.
std::string capability_name(std::uint32_t capability);

/// Where an instruction comes from, by the line table of the module: "passes/lighting/lighting.comp:31"; empty
/// where there is none.
std::string source_line(std::span<const std::uint32_t> words, std::size_t word_offset);

}  // namespace nacre::rhi::spirv
