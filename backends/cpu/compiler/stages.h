// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "backends/cpu/compiler/emitter.h"
#include "backends/cpu/compiler/stage_interface.h"

/// @file
/// The three stages: each makes the function that the rest of the backend calls, fills the shader's inputs and takes
/// its outputs. The result is in the LLVM module; `emit` throws EmitError.

namespace nacre::cpu {

class ComputeEmitter final : public Emitter {
  public:
    using Emitter::Emitter;
    void emit();
    std::uint64_t workgroup_bytes = 0;  ///< Of workgroup variables; suspended subgroups come behind.
    std::uint32_t subgroups = 1;        ///< In a workgroup.
    bool has_barriers = false;          ///< And more than one subgroup: the code suspends.

  private:
    bool emit_stage(const Instruction& at) override;
    std::vector<Component> input_components(const Variable& variable) override;
    llvm::Value* workgroup_memory() override { return memory; }
    void add_stage_values(std::vector<llvm::Value**>& places) override;
    llvm::Value* large_memory(std::uint64_t bytes) override;
    [[nodiscard]] bool is_on_heap() const override { return function_->isPresplitCoroutine(); }
    [[nodiscard]] bool waits_for_workgroup(const Instruction& barrier) const;
    void emit_subgroup_body(llvm::Value* subgroup);
    void emit_plain_kernel();
    void emit_suspending_kernel();
    llvm::Value *range = nullptr, *memory = nullptr, *group_x = nullptr, *subgroup_index = nullptr;
    std::array<Component, 3> local_id;
    llvm::BasicBlock *suspend_block = nullptr, *cleanup_block = nullptr;
};

class VertexEmitter final : public Emitter {
  public:
    VertexEmitter(llvm::Module& into, const Module& from, const CompilerOptions& how, const MathOptions& how_math,
                  std::span<const BindingSlots> layout, const VertexInput& input)
        : Emitter(into, from, how, how_math, layout), input_(input) {}
    void emit();
    VertexProgram program;  ///< Everything but `run`, `name` and `code`.
    using Emitter::has_side_effects;

  private:
    std::vector<Component> input_components(const Variable& variable) override;
    Component fetch(const std::string& name, const rhi::VertexAttribute& attribute, std::uint32_t component,
                    const Type& scalar);
    void emit_batch();
    void store_outputs();
    void add_stage_values(std::vector<llvm::Value**>& places) override;
    const VertexInput& input_;
    llvm::Value *draw = nullptr, *batch = nullptr, *indices = nullptr, *instance = nullptr;
};

class FragmentEmitter final : public Emitter {
  public:
    using Emitter::Emitter;
    void emit();
    FragmentProgram program;  ///< Everything but `run`, `name` and `code`.
    using Emitter::has_side_effects;

  private:
    bool emit_stage(const Instruction& at) override;
    std::vector<Component> input_components(const Variable& variable) override;
    /// Position inside of the pixel at which planes are evaluated.
    struct Place {
        llvm::Value *x = nullptr, *y = nullptr;  ///< Window coordinates of each lane.
    };
    Component evaluate_plane(std::size_t offset,
                             const Place& place);  ///< Of the plane at a byte offset in PrimitiveData.
    Component evaluate_input(std::uint32_t index, const Place& place, const Type& scalar);
    Component primitive_word(std::size_t offset, llvm::Type* type);
    Component primitive_double(std::size_t offset);  ///< Of DoublePrimitive.
    std::vector<llvm::Value*> evaluate_inputs();
    /// `evaluate` for batches of one primitive and for others, whichever the batch is.
    std::vector<llvm::Value*> for_one_or_several(const std::function<std::vector<llvm::Value*>()>& evaluate);
    Place place_at(llvm::Value* inside_x, llvm::Value* inside_y);
    /// Lanes in which a word of program.inputs is undefined: some vertex of the primitive that has a share in it has
    /// not written it.
    llvm::Value* undefined_input(std::uint32_t index);
    Component difference(const Component& value, bool vertical, bool is_fine);
    void emit_batch();
    void store_outputs();
    void declare_inputs();
    void add_stage_values(std::vector<llvm::Value**>& places) override;
    llvm::Value* batch = nullptr;
    std::array<llvm::Value*, max_quads> primitives{};
    bool is_one_primitive =
        false;  ///< While code is emitted for batches whose quads all have the first one's primitive.
    llvm::Value *pixel_x = nullptr, *pixel_y = nullptr;  ///< Float, left upper corner of each lane's pixel.
    Place center, centroid;
    /// Four words of each quad's primitive, by their offset, while `keeps_joined_words`: in code without branches.
    std::unordered_map<std::size_t, llvm::Value*> joined_words_;
    bool keeps_joined_words = false;
    std::unordered_map<Id, std::vector<std::uint32_t>> input_numbers_;  ///< For each scalar of an input variable.
    /// For each of program.inputs but those that tell, where values are followed, which of the others are undefined.
    std::vector<InterfaceScalar> input_scalars_;
    /// Their values, where they are undefined if somebody asks, and behind them gl_FragCoord.z and .w.
    std::vector<llvm::Value*> inputs_;
};

}  // namespace nacre::cpu
