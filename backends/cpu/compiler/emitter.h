// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <llvm/IR/IRBuilder.h>
#include <llvm/IR/Module.h>

#include "backends/cpu/checks/check_interface.h"
#include "backends/cpu/compiler/compiler.h"
#include "backends/cpu/compiler/math/math.h"
#include "backends/cpu/compiler/module.h"
#include "backends/cpu/compiler/uniformity.h"
#include "rhi/validation.h"

/// @file
/// From SPIR-V to LLVM IR that runs `lanes` invocations at once.
///
/// One value is one or several *components* (its scalars, flattened in declaration order); a component is a scalar where all
/// lanes agree and a vector over the lanes where they can differ. Control flow becomes a sequence of blocks, each with a mask
/// of the lanes that run it and, where it pays, a branch that skips it when no lane does. Functions are emitted where they are
/// called. Everything that must survive from one block to another lies in stack slots, from which LLVM makes registers.
///
/// The files `emit_*.cpp` hold one group of instructions each.

namespace nacre::cpu {

/// One scalar of a value: an LLVM scalar (uniform) or a vector of `lanes` elements.
struct Component {
    llvm::Value* value = nullptr;
    /// Where the lanes rise evenly: value of lane i is linear_base + i * linear_stride (modulo 2^32).
    llvm::Value* linear_base = nullptr;
    std::int64_t linear_stride = 0;
    /// Lanes whose value depends on something that nothing has written: i1, or a vector of it. Null: none, or nobody asks.
    llvm::Value* undefined = nullptr;

    Component() = default;
    Component(llvm::Value* only) : value(only) {}  // NOLINT: a component is its value.
    [[nodiscard]] bool is_uniform() const { return !value->getType()->isVectorTy(); }
    explicit operator bool() const { return value != nullptr; }
};

/// A variable whose content lies in registers or on the stack: for each scalar one slot of `lanes` elements, or one element
/// where all lanes agree.
struct LaneVariable {
    Id type = 0;
    bool is_uniform = false;
    std::uint32_t slot_bytes = 4;        ///< Of one lane of one scalar.
    llvm::Value* memory = nullptr;       ///< Null for inputs that nothing indexes dynamically.
    std::vector<Component> components;   ///< Inputs: the values themselves.
    std::unique_ptr<LaneVariable> undefined;  ///< Booleans: which scalars nothing has written. Null: nobody asks.
};

/// What a pointer points to.
struct Pointer {
    enum class Kind : std::uint8_t { lanes, bytes, descriptor, texel } kind = Kind::bytes;
    spv::StorageClass storage = spv::StorageClass::Function;
    Id type = 0;                     ///< Of what it points to.
    /// False in lanes whose indices were out of range; null: always true.
    Component valid;

    // For checks alone.
    Id root = 0;                     ///< The variable that it leads into.
    std::string path;                ///< "lights.color"
    struct Index {
        Component index, bound;      ///< i32; inside where the index is below the bound.
    };
    std::vector<Index> indices;      ///< On the way from the variable.
    Component descriptor_address;    ///< Of a buffer.

    // Kind::lanes
    LaneVariable* variable = nullptr;
    Id variable_id = 0;
    std::uint32_t component = 0;     ///< Constant part of the number of the first scalar.
    Component dynamic_component;     ///< i32; null: 0.

    // Kind::bytes
    Component base;                  ///< ptr
    Component limit;                 ///< i64, bytes behind base; null: never exceeded.
    std::int64_t offset = 0;         ///< Constant part, bytes.
    Component dynamic_offset;        ///< i32 bytes; null: 0.
    bool needs_limit_check = false;  ///< dynamic_offset is not known to stay below limit.
    bool invariant = false;          ///< Nothing writes there while the shader runs.
    bool row_major = false;          ///< Of the matrix or column that it points to.
    std::uint32_t matrix_stride = 0;
    std::uint32_t component_stride = 0;  ///< Between the scalars of a vector; 0: tight.

    // Kind::descriptor: one element or an array of them.
    std::uint32_t set = 0, binding = 0;
    Component descriptor_index;      ///< i32; null: 0.

    // Kind::texel
    Component image_descriptor;
    std::vector<Component> coordinates;
    Component sample;
    Id image_type = 0;
};

/// What an id stands for.
struct Value {
    std::vector<Component> components;
    std::shared_ptr<const Pointer> pointer;
    Component image, sampler;        ///< Images, samplers, sampled images: ptr to Descriptor.
    Id image_type = 0;
    Id image_root = 0;               ///< The variable of the image.
};

/// What went wrong, thrown inside of the emitter only and turned into an Error at its surface.
struct EmitError {
    std::string reason;
    std::uint32_t offset = 0;
};

/// Layout of the descriptors of all groups.
class SlotTable {
  public:
    explicit SlotTable(std::span<const BindingSlots> slots) : slots_(slots) {}
    [[nodiscard]] const BindingSlots* find(std::uint32_t set, std::uint32_t binding) const {
        for (const BindingSlots& slot : slots_)
            if (slot.set == set && slot.binding == binding) return &slot;
        return nullptr;
    }

  private:
    std::span<const BindingSlots> slots_;
};

class Emitter {
  public:
    Emitter(llvm::Module& target, const Module& module, const CompilerOptions& options, std::span<const BindingSlots> slots);
    virtual ~Emitter() = default;
    Emitter(const Emitter&) = delete;
    Emitter& operator=(const Emitter&) = delete;

  protected:
    // ---- Types and small parts (emitter.cpp)
    [[nodiscard]] llvm::Type* scalar_type(const Type& type);
    [[nodiscard]] llvm::Type* vector_of(llvm::Type* scalar) { return llvm::FixedVectorType::get(scalar, lanes); }
    /// `scalar`, or a vector of it where `shape` is a vector.
    llvm::Type* like(llvm::Value* shape, llvm::Type* scalar);
    /// Makes the function `kernel(pointers..., count)` that runs `body` for each of `count` batches; the first pointer is the
    /// context, the last the batches.
    void emit_batches(std::uint32_t pointers, std::size_t batch_bytes, const std::function<void(llvm::Value* batch)>& body);
    /// Id of the scalar type of component `index` of a value of type `type`.
    [[nodiscard]] Id component_type(Id type, std::uint32_t index) const;
    void for_each_component_type(Id type, const std::function<void(const Type&)>& visit) const;
    llvm::Value* splat(llvm::Value* scalar);
    /// The component as a vector over the lanes.
    llvm::Value* widen(const Component& component);
    /// The component as a scalar: itself, or the value of the first lane of `mask`.
    llvm::Value* narrow(const Component& component, llvm::Value* mask);
    llvm::Constant* int32(std::int64_t value) { return llvm::ConstantInt::getSigned(builder.getInt32Ty(), static_cast<std::int32_t>(value)); }
    llvm::Constant* int64(std::int64_t value) { return llvm::ConstantInt::getSigned(builder.getInt64Ty(), value); }
    llvm::Value* lane_numbers();                         ///< <0, 1, 2, ...> as i32.
    llvm::Value* any(llvm::Value* mask);                 ///< i1: some lane is on.
    llvm::Value* mask_bits(llvm::Value* mask);           ///< i32 with one bit for each lane.
    llvm::Value* first_lane(llvm::Value* mask);          ///< i32: the lowest lane that is on (of an empty mask: the highest of all).
    llvm::Value* all_lanes();                            ///< The mask of all lanes.
    [[nodiscard]] static bool is_all(llvm::Value* mask);
    llvm::Value* both(llvm::Value* mask, llvm::Value* condition);  ///< Mask and condition (scalar or vector).
    llvm::Value* select(llvm::Value* condition, llvm::Value* yes, llvm::Value* no);
    llvm::AllocaInst* make_slot(llvm::Type* type, const char* slot_name);
    /// Applies a function to scalars where all are uniform, else to vectors.
    Component apply(std::initializer_list<Component> arguments,
                    const std::function<llvm::Value*(std::span<llvm::Value* const>)>& function);
    Component apply(std::span<const Component> arguments,
                    const std::function<llvm::Value*(std::span<llvm::Value* const>)>& function);
    Component add(const Component& a, const Component& b);
    Component multiply(const Component& a, std::int64_t factor);
    Component linear(llvm::Value* base, std::int64_t stride);
    Component logical_and(const Component& a, const Component& b);  ///< Null stands for true.
    [[noreturn]] void reject(std::string reason) const;
    llvm::FunctionCallee external(const char* symbol, llvm::Type* result, std::vector<llvm::Type*> arguments);
    llvm::Value* load_context(std::size_t offset, llvm::Type* type);    ///< Invariant member of ShaderContext.
    llvm::Value* invariant_load(llvm::Type* type, llvm::Value* address, unsigned alignment);
    llvm::Value* at_offset(llvm::Value* pointer, std::int64_t bytes);

    // ---- Values (emit_values.cpp)
    Value& define(Id id);
    Value get(Id id);
    Component get_scalar(Id id) { return get(id).components.at(0); }
    Value constant(Id id);
    Component zero(const Type& scalar);
    Component undefined_value(const Type& scalar);  ///< Of something that was never written.
    void set(const Instruction& at, std::vector<Component> components);
    void finish_definition(Id id);

    // ---- Control flow (emit_control_flow.cpp)
    /// Emits a function for the lanes of `mask`; returns its result.
    std::vector<Component> emit_function(const Function& function, const std::vector<Value>& arguments, llvm::Value* mask);

    // ---- Instructions
    void emit_instruction(const Instruction& at);                       // emit_instruction.cpp
    bool emit_arithmetic(const Instruction& at);                        // emit_arithmetic.cpp
    std::vector<Component> evaluate(spv::Op op, Id type, std::span<const std::uint32_t> operands, Id result);
    bool emit_composite(const Instruction& at);                         // emit_composite.cpp
    bool emit_extended(const Instruction& at);                          // emit_extended.cpp
    bool emit_memory(const Instruction& at);                            // emit_memory.cpp
    bool emit_atomic(const Instruction& at);                            // emit_atomics.cpp
    bool emit_image(const Instruction& at);                             // emit_images.cpp
    bool emit_image_query(const Instruction& at);
    /// Calls the image function for the lanes of the mask; returns four words (none for stores).
    std::vector<Component> image_call(const Component& image, const Component& sampler, Id image_type,
                                      const std::vector<Component>& coordinates, std::uint32_t flags,
                                      const std::vector<Component>& texel, const Component& sample);
    llvm::Value* bound_view(llvm::Value* descriptor_address);           ///< ptr to ImageView; to zeros where nothing is bound.
    std::vector<Component> fetch_words(const Component& image, Id image_type, const std::vector<Component>& coordinates,
                                       const Component& level, const std::function<std::vector<Component>()>& otherwise);
    void put_argument(std::size_t offset, const Component& value);
    llvm::Value* image_memory();                                        ///< An ImageArguments on the stack.
    void set_image_atomic(AtomicOperation operation, const Component& comparator);
    [[nodiscard]] std::uint32_t image_integer_flag(Id image_type) const;
    Component from_word(const Component& word, llvm::Type* kind);       ///< Bits of 32 as a value of a type.
    Component to_word(const Component& value);
    bool emit_ray(const Instruction& at);                               // emit_rays.cpp
    /// Whether a type is a ray query or an array of them.
    [[nodiscard]] bool is_ray_query(Id type) const;
    Pointer ray_query_pointer(Id variable);
    void clear_ray_query(Id variable);
    /// Runs `body` for each different query that the lanes mean.
    void for_each_query(Id pointer, const std::function<void(llvm::Value* query, llvm::Value* lanes_on)>& body);
    std::vector<Component> read_query(Id pointer, std::span<const std::size_t> offsets, llvm::Type* scalar);
    std::vector<Component> ray_property(Id pointer, std::uint32_t property, std::uint32_t words, llvm::Type* scalar);
    bool emit_subgroup(const Instruction& at);                          // emit_subgroups.cpp
    llvm::Value* permute(llvm::Value* values, llvm::Value* sources);    ///< Lane i gets the value of lane sources[i].
    virtual bool emit_stage(const Instruction&) { return false; }       // derivatives, barriers, interpolation

    // ---- Memory (emit_memory.cpp)
    void declare_variables();
    LaneVariable& make_lane_variable(Id variable_id, Id type, bool is_uniform);
    void fill(LaneVariable& variable, const std::vector<Component>& values);
    std::vector<Component> load(const Pointer& pointer);
    void store(const Pointer& pointer, const std::vector<Component>& values);
    Pointer pointer_to(Id variable);
    Pointer access(Pointer pointer, Id index);
    Component load_bytes(const Pointer& pointer, std::int64_t extra, const Type& scalar);
    void store_bytes(const Pointer& pointer, std::int64_t extra, const Type& scalar, const Component& value);
    /// Lanes in which an access of `bytes` at offset + extra is allowed; null: all.
    Component allowed(const Pointer& pointer, std::int64_t extra, std::uint32_t bytes);
    llvm::Value* addresses(const Pointer& pointer, std::int64_t extra);  ///< ptr or <N x ptr>
    Component load_lane_component(const Pointer& pointer, std::uint32_t index, const Type& scalar);
    void store_lane_component(const Pointer& pointer, std::uint32_t index, const Type& scalar, const Component& value);
    Component descriptor(const Pointer& pointer);        ///< ptr to Descriptor
    Pointer buffer_pointer(const Pointer& block);        ///< Kind::bytes from a descriptor of a buffer.
    void visit_layout(const Pointer& pointer, Id type, std::int64_t extra,
                      const std::function<void(const Pointer&, std::int64_t, const Type&)>& visit);
    llvm::Value* zeros();                                ///< Address of eight bytes of zero.
    /// Mask of the lanes whose stores and atomics count.
    llvm::Value* effect_mask();
    /// Runs `body` for each different address in the lanes of `mask`: once where it is uniform.
    void for_each_different(const Component& address, llvm::Value* mask,
                            const std::function<void(llvm::Value*, llvm::Value*)>& body);
    /// Runs `body` for each lane of `mask` in turn.
    void for_each_lane(llvm::Value* mask, const std::function<void(llvm::Value* lane)>& body);

    // ---- Checks (emit_checks.cpp): nothing of this is emitted but where the options ask for it.
    [[nodiscard]] bool looks_for(std::uint32_t checks) const { return (options.checks & checks) != 0; }
    /// Whether undefined values are followed to where something depends on them.
    [[nodiscard]] bool follows_undefined() const { return looks_for(check_sanitize | check_hostile); }
    /// Where the invocations begin: what they are is kept for reports. `group_x` and `subgroup` may be null.
    void begin_checks(rhi::ShaderStage stage, llvm::Value* work, llvm::Value* group_x, llvm::Value* subgroup);
    void check_operands(const Instruction& at);
    void check_result(const Instruction& at);
    /// Indices on the way of a pointer, and the whole value that it leads to.
    void check_range(const Pointer& pointer);
    void check_index(const Component& index, const Component& bound, const std::string& object, const Pointer* pointer = nullptr);
    void check_undefined(std::span<const Component> components, const std::string& object);
    /// Every quad in which some but not all lanes run.
    void check_quads();
    /// Takes note of an access to a scalar, by MemoryAccess; returns the lanes that read what is undefined, null: none can.
    llvm::Value* check_memory(const Pointer& pointer, std::int64_t extra, const Type& scalar, std::uint32_t access,
                              llvm::Value* undefined);
    /// The same for the image operation whose arguments are in place.
    llvm::Value* check_image(llvm::Value* image, llvm::Value* sampler, std::uint32_t flags, llvm::Value* lanes_on);
    void check_barrier();
    /// A workgroup begins: nothing has written its memory.
    void check_workgroup(llvm::Value* kernel_context, llvm::Value* memory);
    void check_outputs(const Variable& variable, std::span<const Component> values);
    /// Components of one value are undefined where an argument is.
    void spread_undefined(Component& result, std::span<const Component> arguments);
    /// The same for operations whose result may not depend on all of their arguments.
    void refine_undefined(spv::Op op, std::span<const std::uint32_t> operands, std::vector<Component>& result);
    void mark_undefined(LaneVariable& variable, bool is_undefined = true);
    [[nodiscard]] static Pointer undefined_of(const Pointer& pointer);  ///< To the variable's `undefined`.
    [[nodiscard]] static const Type& boolean_type();
    [[nodiscard]] std::string member_path(const Pointer& structure, std::uint32_t member);
    void note_store(const Pointer& pointer);
    void note_read(const Pointer& pointer, std::int64_t extra, const Type& scalar, Component& value);
    void note_write(const Pointer& pointer, std::int64_t extra, const Type& scalar, const Component& value);
    [[nodiscard]] std::string name_of(Id variable) const;
    /// The variable that a value was read from, as far as that can be told.
    [[nodiscard]] std::string origin_of(Id value) const;
    struct CheckNotes;
    CheckNotes& notes();
    llvm::Value* check_site(const std::string& object, std::int32_t set, std::int32_t binding);
    void check_fault(rhi::ShaderFault kind, llvm::Value* bad, const std::string& object, const Component& found = {},
                     const Component& limit = {}, const Pointer* pointer = nullptr);
    std::shared_ptr<CheckNotes> check_notes;

    // ---- Elements of neighboring lanes side by side (emit_rows.cpp)
    /// How the elements that a pointer means lie in memory, in words of 32 bits.
    struct RowLayout {
        std::uint32_t stride = 0;          ///< From lane to lane.
        std::int64_t first = 0;            ///< Bytes from the pointer to the first word that counts.
        std::uint32_t span = 0;            ///< From there to behind the last.
        std::vector<std::uint32_t> words;  ///< Of each scalar, from `first` on.
    };
    /// Nothing where the lanes' elements do not lie side by side, or are not made of words.
    std::optional<RowLayout> row_layout(const Pointer& pointer);
    std::optional<std::vector<Component>> load_rows(const Pointer& pointer);
    /// False: nothing was stored, for there are no rows.
    bool store_rows(const Pointer& pointer, const std::vector<Component>& values);
    /// Loads of several scalars by addresses that may differ from lane to lane, but mostly do not.
    std::optional<std::vector<Component>> load_where_equal(const Pointer& pointer);
    llvm::Value* row_start(const Pointer& pointer, const RowLayout& rows);
    /// Where a value of `load_rows` comes from: word `word` of the stream that begins with `stream`.
    struct RowOrigin {
        std::shared_ptr<const std::vector<llvm::Value*>> stream;
        std::uint32_t word = 0;
    };
    std::unordered_map<llvm::Value*, RowOrigin> row_origins;
    std::vector<llvm::Value*> split_rows(const std::vector<llvm::Value*>& stream);
    std::vector<llvm::Value*> join_rows(const std::vector<llvm::Value*>& words);
    llvm::Value* pick(const std::vector<llvm::Value*>& vectors,
                      const std::function<std::pair<std::size_t, std::size_t>(std::uint32_t)>& from);
    llvm::Value* all(const Component& condition);  ///< i1: it holds in all lanes (null: it does).

    // ---- Stages: what only they know.
    virtual std::vector<Component> input_components(const Variable& variable) = 0;
    /// Base pointer and size of the workgroup's memory.
    virtual llvm::Value* workgroup_memory() { reject("workgroup memory outside of a compute shader"); }
    void store_live(llvm::Value* lanes_on) { builder.CreateStore(lanes_on, live_slot); }
    llvm::Value* live() { return builder.CreateLoad(mask_type, live_slot); }

    llvm::Module& target;
    llvm::LLVMContext& context;
    const Module& module;
    const CompilerOptions& options;
    SlotTable slots;
    const std::uint32_t lanes;
    llvm::IRBuilder<> builder;
    Math math;
    Uniformity uniformity;
    llvm::FixedVectorType* mask_type;
    llvm::PointerType* pointer_type;
    llvm::Value* shader_context = nullptr;     ///< ptr to ShaderContext
    llvm::Function* function_ = nullptr;       ///< That is being made.
    llvm::BasicBlock* slot_block = nullptr;    ///< Where stack slots are made.
    llvm::AllocaInst* live_slot = nullptr;     ///< Lanes that are neither helpers nor discarded.
    llvm::AllocaInst* nowhere_slot = nullptr;  ///< Where stores go that must vanish.
    llvm::AllocaInst* image_arguments = nullptr;
    Id image_root = 0;                         ///< Variable of the image that `image_call` is called for.
    std::unordered_map<Id, std::unique_ptr<LaneVariable>> lane_variables;
    std::unordered_map<Id, std::uint64_t> workgroup_offsets;
    std::unordered_map<Id, llvm::AllocaInst*> ray_queries;
    std::uint64_t workgroup_variable_bytes = 0;
    bool has_side_effects = false;             ///< Some store, atomic or image store was emitted.

    /// One activation of a function.
    struct Frame {
        const Function* function = nullptr;
        struct BlockState {
            llvm::AllocaInst* reached = nullptr;
            llvm::AllocaInst* mask = nullptr;
            llvm::AllocaInst* back_reached = nullptr;  ///< Loop headers.
            llvm::AllocaInst* back_mask = nullptr;
            std::vector<std::vector<llvm::AllocaInst*>> phi_slots;
            std::vector<bool> phi_uniform;
            bool reconverges = false;     ///< Header: all lanes meet again at the merge block.
            bool is_reconverged = false;  ///< Merge block of such a header.
            std::uint32_t divergent_loop = ~0u;  ///< Innermost loop around it that lanes leave one by one: header's index.
        };
        std::vector<BlockState> blocks;
        llvm::Value* entry_mask = nullptr;
        std::unordered_set<Id> crossing;               ///< Ids used in other blocks than their own.
        std::unordered_set<Id> leaving;                ///< Ids used behind a loop that lanes leave one by one, defined inside.
        std::vector<llvm::AllocaInst*> return_slots;
        struct Definition {
            std::uint32_t block = 0;
            std::uint64_t chain = 0;
            std::vector<llvm::AllocaInst*> slots, outside_slots;
            std::vector<llvm::AllocaInst*> undefined_slots;  ///< Null where nothing is undefined.
            std::vector<llvm::AllocaInst*> linear_slots;  ///< Of `linear_base`, where there is one; empty: nowhere.
        };
        std::unordered_map<Id, Definition> definitions;
        std::unordered_map<Id, Value> values;
        std::uint32_t block = 0;                       ///< That is being emitted.
        std::vector<std::uint64_t> chains;             ///< That are open.
    };
    Frame* frame = nullptr;
    llvm::Value* mask = nullptr;                       ///< Of the block that is being emitted.
    const Instruction* current = nullptr;
    std::uint64_t chain_count = 0;
    std::uint32_t call_depth = 0;
    bool runs_without_lanes = false;                   ///< The block is cheap: it runs even where its mask is empty.

  private:
    void analyze_frame(Frame& made);
    void emit_range(std::uint32_t begin, std::uint32_t end);
    std::uint32_t emit_chain(std::uint32_t first, std::uint32_t end);
    void emit_block(std::uint32_t index, llvm::Value* block_mask);
    void emit_loop_body(std::uint32_t header, std::uint32_t end, llvm::Value* entry_mask);
    void emit_terminator(std::uint32_t index);
    /// condition: null (always), i1 or a vector of i1.
    void emit_edge(std::uint32_t from, Id to, llvm::Value* condition);
    bool is_cheap(std::uint32_t index) const;
    std::unordered_map<Id, Value> constants_;
    std::unordered_map<std::string, llvm::Value*> shared_;
};

}  // namespace nacre::cpu
