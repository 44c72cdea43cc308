// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include <spirv-tools/libspirv.h>
#include <spirv/unified1/spirv.hpp11>

#include "tests/backends/cpu/differential/random.h"

/// @file
/// Random changes of SPIR-V modules that know what instructions, types, blocks and functions are, so that many of the
/// results are valid. The same module and random numbers give the same result.

namespace nacre::hostile {

using differential::Random;
using Id = std::uint32_t;
using Words = std::vector<std::uint32_t>;

/// One module, taken apart. After a change it is put together again by `words`; what it knew of itself is stale then.
class MutableModule {
  public:
    /// Nothing where SPIRV-Tools cannot take the words apart.
    static std::optional<MutableModule> parse(std::span<const std::uint32_t> words);

    /// One random change; false where nothing was found that could be changed in the way that was drawn.
    bool mutate(Random& random);
    [[nodiscard]] Words words() const;

  private:
    struct Operand {
        std::uint16_t first = 0, count = 0;  ///< Words, behind the one that holds the opcode from 1.
        spv_operand_type_t kind = SPV_OPERAND_TYPE_NONE;
    };
    struct Instruction {
        spv::Op op = spv::Op::OpNop;
        Id type = 0, result = 0;
        Words words;
        std::vector<Operand> operands;
    };

    static spv_result_t add_parsed(void* module, const spv_parsed_instruction_t* instruction);
    static Instruction make(spv::Op op, Id type, Id result, std::initializer_list<Id> rest);
    void find_places();

    // What there is.
    [[nodiscard]] const Instruction* definition(Id id) const;
    [[nodiscard]] Id type_of(Id id) const;
    [[nodiscard]] const Instruction* type(Id id) const { return definition(id); }
    [[nodiscard]] bool is_numeric(Id type, spv::Op scalar) const;  ///< A scalar or vector of that.
    [[nodiscard]] bool is_integer(Id type) const { return is_numeric(type, spv::Op::OpTypeInt); }
    [[nodiscard]] bool is_floating(Id type) const { return is_numeric(type, spv::Op::OpTypeFloat); }
    /// Numbers, booleans and what consists of them, without runtime arrays and very deep types.
    [[nodiscard]] bool is_plain(Id type, int depth = 0) const;
    [[nodiscard]] std::size_t function_begin(std::size_t position) const;
    [[nodiscard]] std::size_t label_before(std::size_t position) const;
    [[nodiscard]] std::size_t terminator_behind(std::size_t position) const;
    /// Positions in a block before which instructions may be put: from first to last.
    [[nodiscard]] std::pair<std::size_t, std::size_t> insertion_range(std::size_t label) const;
    /// Values of a type that come before a position in its function, or are global; 0 where there is none.
    Id find_value(Id of_type, std::size_t before, Id other_than = 0);
    Id find_value(const std::function<bool(Id type)>& is_wanted, std::size_t before);
    std::optional<std::size_t> find_instruction(const std::function<bool(const Instruction&)>& is_wanted);
    std::optional<std::size_t> find_block(bool may_be_loop_header);
    Id find_type(spv::Op op, std::initializer_list<std::uint32_t> operands);

    // What is made.
    Id fresh() { return bound_++; }
    Id type_like(spv::Op op, std::initializer_list<std::uint32_t> operands);
    Id constant(Id type, std::uint64_t bits);
    Id null_of(Id type);
    Id interesting_constant(Id type);
    std::uint32_t interesting_word();
    /// An index: in range, out of range, or a number that is known only when the shader runs.
    Id index_value(std::size_t before, std::uint32_t count);
    void insert(std::size_t before, std::vector<Instruction> instructions);
    void use_later(Id value, std::size_t from);
    std::vector<Instruction> cloned(std::size_t first, std::size_t end, std::unordered_map<Id, Id>& renamed);
    /// The block's label is replaced by another in phis: its terminator moves into that.
    void rename_predecessor(Id from, Id to, std::size_t within);

    // Changes.
    bool replace_operand();
    bool change_constant();
    bool change_array_length();
    bool change_opcode();
    bool change_extended();
    bool change_literal();
    bool change_index();
    bool change_terminator();
    bool remove_instruction();
    bool duplicate_instruction();
    bool swap_instructions();
    bool insert_operation();
    bool insert_access();
    bool insert_selection();
    bool insert_switch();
    bool insert_loop();
    bool insert_jump();
    bool wrap_in_function();
    bool add_decoration();

    std::array<std::uint32_t, 5> header_{};
    std::vector<Instruction> instructions_;
    std::vector<Instruction> annotations_, globals_, functions_;  ///< New ones, put at their places by `words`.
    std::unordered_map<Id, std::size_t> definitions_;
    std::size_t first_type_ = 0, first_function_ = 0;
    Id bound_ = 0, glsl_set_ = 0;
    Random* random_ = nullptr;
};

/// Changes words without knowing what they mean, for modules that nothing can take apart any more.
void mutate_words(Words& words, Random& random);

}  // namespace nacre::hostile
