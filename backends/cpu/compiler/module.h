// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <spirv/unified1/spirv.hpp11>

#include "core/error.h"

/// @file
/// A SPIR-V module, taken apart: types, constants, variables and functions by id. The input is valid (SPIRV-Tools has
/// seen it) and its specialization constants are frozen.

namespace nacre::cpu {

using Id = std::uint32_t;

/// Types of the components of pointers (64 and 32 bits without sign), which no module declares.
inline constexpr Id pointer_word_type = ~0u - 1, pointer_offset_type = ~0u - 2;

enum class TypeKind : std::uint8_t {
    void_type, boolean, integer, floating, vector, matrix, array, runtime_array, structure, pointer, image, sampler,
    sampled_image, function, acceleration_structure, ray_query,
};

/// What OpMemberDecorate says of a member of a structure.
struct Member {
    Id type = 0;
    std::uint32_t offset = 0;         ///< Bytes, in blocks.
    std::uint32_t matrix_stride = 0;  ///< Bytes between columns (rows where row_major).
    bool row_major = false;
    std::optional<spv::BuiltIn> builtin;
    std::optional<std::uint32_t> location;
    std::uint32_t component = 0;
    bool flat = false, no_perspective = false, centroid = false, sample = false;
    std::uint32_t first_component = 0;  ///< Scalars of all members before this one.
};

struct Type {
    Id id = 0;
    TypeKind kind = TypeKind::void_type;
    std::uint32_t bits = 0;         ///< integer, floating
    bool is_signed = false;
    Id element =
        0;  ///< vector: scalar; matrix: column; array; pointer: pointee; sampled_image: image; image: sampled type
    std::uint32_t count = 0;        ///< vector, matrix, array
    std::uint32_t array_stride = 0; ///< Bytes, of arrays and pointers; 0 where there is no explicit layout.
    spv::StorageClass storage = spv::StorageClass::Function;  ///< pointer
    std::vector<Member> members;
    bool is_block = false;          ///< Decorated Block or BufferBlock.
    bool is_buffer_block = false;   ///< Decorated BufferBlock: a storage buffer of old SPIR-V.
    // Images.
    spv::Dim dim = spv::Dim::Dim2D;
    bool arrayed = false, multisampled = false;
    std::uint32_t sampled = 0;      ///< 1: with a sampler, 2: storage
    /// Scalars in a value of this type; 0 for types without values (and for runtime arrays, samplers, images). Pointers
    /// into buffers and workgroup memory have three: address of the range, its bytes, offset in it.
    std::uint32_t components = 0;
    bool has_wide = false;          ///< Some scalar has 64 bits.
    [[nodiscard]] bool is_scalar() const {
        return kind == TypeKind::boolean || kind == TypeKind::integer || kind == TypeKind::floating;
    }
    [[nodiscard]] bool is_opaque() const {
        return kind == TypeKind::image || kind == TypeKind::sampler || kind == TypeKind::sampled_image ||
               kind == TypeKind::acceleration_structure;
    }
};

struct Instruction {
    spv::Op op = spv::Op::OpNop;
    Id type = 0;                               ///< 0 where there is no result type.
    Id result = 0;                             ///< 0 where there is no result.
    std::span<const std::uint32_t> operands;   ///< Behind result type and result.
    std::uint32_t offset = 0;                  ///< In words from the begin of the module.
    [[nodiscard]] std::uint32_t operand(std::size_t index) const {
        return index < operands.size() ? operands[index] : 0;
    }
};

struct Block {
    Id id = 0;
    std::vector<Instruction> phis;
    std::vector<Instruction> body;             ///< Without phis, merge instructions, lines and the terminator.
    Instruction terminator;
    Id merge = 0;                              ///< Of a selection or a loop.
    Id continue_target = 0;                    ///< Not 0: the block is the header of a loop.
    std::vector<Id> successors;                ///< Without duplicates.
    std::vector<std::uint32_t> predecessors;   ///< Indices into Function::blocks, without duplicates.
};

struct Function {
    Id id = 0;
    Id return_type = 0;
    bool is_kept = false;  ///< Becomes a function of the code that is made; others are emitted where they are called.
    std::vector<Instruction> parameters;
    /// In structured order: a block after all from which it is reached but over a back edge; the blocks of a construct
    /// together, merge blocks behind them, continue constructs behind loop bodies. Unreachable blocks are left out.
    std::vector<Block> blocks;
    std::unordered_map<Id, std::uint32_t> block_index;
    [[nodiscard]] std::optional<std::uint32_t> find_block(Id block) const {
        const auto found = block_index.find(block);
        return found == block_index.end() ? std::nullopt : std::optional(found->second);
    }
};

struct Variable {
    Instruction instruction;
    Id type = 0;     ///< Of what it holds.
    spv::StorageClass storage = spv::StorageClass::Function;
    Id initializer = 0;
    std::optional<spv::BuiltIn> builtin;
    std::optional<std::uint32_t> set, binding, location;
    std::uint32_t component = 0, index = 0;
    bool flat = false, no_perspective = false, centroid = false, sample = false;
    std::string name;
};

/// Everything about one entry point. Spans point into the words that it was parsed from, which must outlive it.
class Module {
  public:
    /// Scalars that one value may have; larger ones would exhaust memory as registers.
    static constexpr std::uint32_t max_components = 1u << 22;

    static Expected<Module> parse(std::span<const std::uint32_t> words, std::string_view entry_point,
                                  spv::ExecutionModel model, std::string_view name);

    [[nodiscard]] const Type& type(Id id) const { return types_.at(id); }
    [[nodiscard]] bool has_type(Id id) const { return types_.contains(id); }
    /// Instruction that makes a constant (OpConstant, OpConstantComposite, OpUndef, ...); null where the id is none.
    [[nodiscard]] const Instruction* constant(Id id) const {
        const auto found = constants_.find(id);
        return found == constants_.end() ? nullptr : &found->second;
    }
    /// Value of an integer constant of up to 32 bits; nothing where the id is no such constant.
    [[nodiscard]] std::optional<std::uint32_t> constant_word(Id id) const;
    [[nodiscard]] const std::unordered_map<Id, Variable>& variables() const { return variables_; }
    [[nodiscard]] const Variable* variable(Id id) const {
        const auto found = variables_.find(id);
        return found == variables_.end() ? nullptr : &found->second;
    }
    [[nodiscard]] const Function& function(Id id) const { return functions_.at(id); }
    [[nodiscard]] const std::unordered_map<Id, Function>& functions() const { return functions_; }
    [[nodiscard]] const Function& entry() const { return functions_.at(entry_); }
    [[nodiscard]] const std::vector<Id>& interface() const { return interface_; }
    [[nodiscard]] bool is_glsl_set(Id id) const { return id == glsl_set_; }
    /// Name of another set of extended instructions that compute values; null where the set says nothing about values.
    [[nodiscard]] const std::string* foreign_set(Id id) const {
        const auto found = foreign_sets_.find(id);
        return found == foreign_sets_.end() ? nullptr : &found->second;
    }
    /// The constant that a Function or Private variable holds all the time; 0 where it changes, or is small.
    [[nodiscard]] Id constant_content(Id variable) const {
        const auto found = constant_contents_.find(variable);
        return found == constant_contents_.end() ? 0 : found->second;
    }
    /// Result type of any id that has one; 0 otherwise.
    [[nodiscard]] Id type_of(Id id) const {
        const auto found = result_types_.find(id);
        return found == result_types_.end() ? 0 : found->second;
    }
    [[nodiscard]] bool is_no_contraction(Id id) const { return no_contraction_.contains(id); }
    /// A block of a uniform buffer: decorated Block and not BufferBlock.
    [[nodiscard]] bool is_uniform_block(Id type) const {
        return types_.at(type).is_block && !types_.at(type).is_buffer_block;
    }
    /// Bytes of a value in memory without explicit layout: scalars one after another, booleans as 32 bits.
    [[nodiscard]] std::uint64_t tight_size(Id type) const;
    [[nodiscard]] std::uint64_t tight_offset(Id structure, std::uint32_t member) const;
    [[nodiscard]] std::uint32_t id_bound() const { return words_.size() > 3 ? words_[3] : 0; }
    [[nodiscard]] std::span<const std::uint32_t> words() const { return words_; }

    std::string name;
    spv::ExecutionModel model{};
    std::array<std::uint32_t, 3> workgroup_size{1, 1, 1};
    bool early_fragment_tests = false;
    bool depth_replacing = false;
    bool has_float_controls_denorm_flush = false;

  private:
    std::span<const std::uint32_t> words_;
    std::unordered_map<Id, Type> types_;
    std::unordered_map<Id, Instruction> constants_;
    std::unordered_map<Id, Variable> variables_;
    std::unordered_map<Id, Function> functions_;
    std::unordered_map<Id, Id> result_types_;
    std::unordered_map<Id, char> no_contraction_;
    std::unordered_map<Id, Id> constant_contents_;
    std::unordered_map<Id, std::string> foreign_sets_;
    std::vector<Id> interface_;
    Id entry_ = 0;
    Id glsl_set_ = ~0u;

    void finish_type(Type& type);
    void order_blocks(Function& function, std::vector<Block> blocks);
    void find_constant_contents();
};

}  // namespace nacre::cpu
