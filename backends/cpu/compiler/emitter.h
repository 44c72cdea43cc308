// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <llvm/IR/IRBuilder.h>
#include <llvm/IR/Module.h>

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "backends/cpu/checks/check_interface.h"
#include "backends/cpu/compiler/compiler.h"
#include "backends/cpu/compiler/math/math.h"
#include "backends/cpu/compiler/module.h"
#include "backends/cpu/compiler/uniformity.h"
#include "backends/cpu/trace.h"
#include "rhi/validation.h"

/// @file
/// From SPIR-V to LLVM IR that runs `lanes` invocations at once.
///
/// One value is one or several *components* (its scalars, flattened in declaration order); a component is a scalar
/// where all lanes agree and a vector over the lanes where they can differ. Control flow becomes a sequence of blocks,
/// each with a mask of the lanes that run it and, where it pays, a branch that skips it when no lane does. Functions
/// are emitted where they are called. Everything that must survive from one block to another lies in stack slots, from
/// which LLVM makes registers.
///
/// The files `emit_*.cpp` hold one group of instructions each.

namespace nacre::cpu {

enum class RayStatus : std::uint32_t;

/// One scalar of a value: an LLVM scalar (uniform) or a vector of `lanes` elements.
struct Component {
    llvm::Value* value = nullptr;
    /// Where the lanes rise evenly: value of lane i is linear_base + i * linear_stride (modulo 2^32).
    llvm::Value* linear_base = nullptr;
    std::int32_t linear_stride = 0;
    /// Lanes whose value depends on something that nothing has written: i1, or a vector of it. Null: none, or nobody
    /// asks.
    llvm::Value* undefined = nullptr;

    Component() = default;
    Component(llvm::Value* only) : value(only) {}  // NOLINT: a component is its value.
    /// A stride modulo 2^32.
    static std::int32_t wrapped(std::uint64_t stride) {
        return static_cast<std::int32_t>(static_cast<std::uint32_t>(stride));
    }
    [[nodiscard]] bool is_uniform() const { return !value->getType()->isVectorTy(); }
    explicit operator bool() const { return value != nullptr; }
};

/// A variable whose content lies in registers or on the stack: for each scalar one slot of `lanes` elements, or one
/// element where all lanes agree.
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

    // Kind::lanes
    LaneVariable* variable = nullptr;
    Id variable_id = 0;
    std::uint32_t component = 0;     ///< Constant part of the number of the first scalar.
    Component dynamic_component;     ///< i32; null: 0.

    // Kind::bytes
    Component base;                  ///< ptr
    Component shadow;                ///< ptr to the doubles of the words at base; null: none. See in_double().
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
    Component descriptor_address;    ///< ptr, instead of set, binding and index: what a function was given; of bytes:
                                     ///< that of their buffer.

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
    /// Pointers that depend on control flow: one of those that they may be, for the layout of matrices.
    std::shared_ptr<const Pointer> origin;
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
    Emitter(llvm::Module& target, const Module& module, const CompilerOptions& options, const MathOptions& math_options,
            std::span<const BindingSlots> slots);
    virtual ~Emitter() = default;
    /// Set before the emission of a program that tells what it computes, and filled by it.
    TraceTable* trace_table = nullptr;
    /// Instructions that went through single precision on a device in double precision: offset in the module and what
    /// they do.
    [[nodiscard]] const std::map<std::uint32_t, std::string>& narrowed() const { return narrowed_; }
    Emitter(const Emitter&) = delete;
    Emitter& operator=(const Emitter&) = delete;

  protected:
    // ---- Types and small parts (emitter.cpp)
    [[nodiscard]] llvm::Type* scalar_type(const Type& type);
    // Double precision (emit_double.cpp).
    /// Whether all floats are doubles in registers, whatever the width of their type. Types keep that width: it counts
    /// in memory, for bits, and wherever a value has to go through single precision.
    [[nodiscard]] bool in_double() const { return options.mode == ExecutionMode::double_precision; }
    /// What a float of 32 bits is in registers.
    [[nodiscard]] llvm::Type* real_type() { return in_double() ? builder.getDoubleTy() : builder.getFloatTy(); }
    /// LaneVariable::slot_bytes of variables of a type: room for its widest scalar as registers hold it.
    [[nodiscard]] std::uint32_t slot_bytes_of(const Type& type) const { return type.has_wide || in_double() ? 8 : 4; }
    /// Floats as single precision whatever they are in registers, and back.
    Component to_single(const Component& value);
    Component from_single(const Component& value);
    /// The bits of a scalar as an integer as wide as its type, and back. Floats are rounded to their type.
    Component bits_of(const Component& value, const Type& scalar);
    Component of_bits(const Component& bits, const Type& scalar);
    /// Lists the current instruction among those that go through single precision.
    void note_narrowed(const char* operation);
    /// Lists it where it reaches a float of 32 bits through a pointer that leads to words without doubles.
    void note_missing_shadow(const Pointer& pointer, const Type& scalar);
    // Traces (emit_trace.cpp); nothing without a trace_table.
    /// The invocation begins; `is_traced` has the lane of the traced one. `ids`: of each lane, for compute shaders.
    void begin_trace(llvm::Value* is_traced, std::vector<Component> ids);
    void trace(const Instruction& at, Id result, std::vector<Id> operands, const std::vector<Component>& values);
    void trace_result(const Instruction& at, const std::vector<Component>& values);
    void trace_image_write(const std::vector<Component>& coordinates);
    /// The variable behind a chain of accesses; the pointer itself where there is none.
    [[nodiscard]] Id trace_root(Id pointer) const;
    [[nodiscard]] bool has_shadow(const Pointer& pointer, const Type& scalar) const;
    /// The doubles of the words that a pointer leads to.
    Pointer shadow_of(const Pointer& pointer);
    Component load_float(const Pointer& pointer, std::int64_t extra, const Type& scalar);
    void store_float(const Pointer& pointer, std::int64_t extra, const Type& scalar, const Component& value);
    [[nodiscard]] llvm::Type* vector_of(llvm::Type* scalar) { return llvm::FixedVectorType::get(scalar, lanes); }
    /// `scalar`, or a vector of it where `shape` is a vector.
    llvm::Type* like(llvm::Value* shape, llvm::Type* scalar);
    /// Makes the function `kernel(pointers..., count)` that runs `body` for each of `count` batches; the first pointer
    /// is the context, the last the batches.
    void emit_batches(std::uint32_t pointers, std::size_t batch_bytes,
                      const std::function<void(llvm::Value* batch)>& body);
    /// Id of the scalar type of component `index` of a value of type `type`.
    [[nodiscard]] Id component_type(Id type, std::uint32_t index) const;
    void for_each_component_type(Id type, const std::function<void(const Type&)>& visit) const;
    llvm::Value* splat(llvm::Value* scalar);
    /// The component as a vector over the lanes.
    llvm::Value* widen(const Component& component);
    /// The component as a scalar: itself, or the value of the first lane of `mask`.
    llvm::Value* narrow(const Component& component, llvm::Value* mask);
    llvm::Constant* int32(std::int64_t value) {
        return llvm::ConstantInt::getSigned(builder.getInt32Ty(), static_cast<std::int32_t>(value));
    }
    llvm::Constant* int64(std::int64_t value) { return llvm::ConstantInt::getSigned(builder.getInt64Ty(), value); }
    llvm::Value* lane_numbers();                         ///< <0, 1, 2, ...> as i32.
    llvm::Value* any(llvm::Value* mask);                 ///< i1: some lane is on.
    llvm::Value* mask_bits(llvm::Value* mask);           ///< i32 with one bit for each lane.
    llvm::Value* first_lane(
        llvm::Value* mask);  ///< i32: the lowest lane that is on (of an empty mask: the highest of all).
    llvm::Value* all_lanes();                            ///< The mask of all lanes.
    [[nodiscard]] static bool is_all(llvm::Value* mask);  ///< A constant that is true in all lanes.
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
    /// Rejects operands that validators let pass where the result would not have the type that the module says.
    void check_result(const Instruction& at, const std::vector<Component>& components);
    [[noreturn]] void reject(std::string reason) const;
    llvm::FunctionCallee external(const char* symbol, llvm::Type* result, std::vector<llvm::Type*> arguments);
    llvm::Value* load_context(std::size_t offset, llvm::Type* type);    ///< Invariant member of ShaderContext.
    llvm::Value* invariant_load(llvm::Type* type, llvm::Value* address, unsigned alignment);
    llvm::Value* at_offset(llvm::Value* pointer, std::int64_t bytes);

    // ---- Values (emit_values.cpp)
    Value& define(Id id);
    Value get(Id id);
    Component get_scalar(Id id) { return get(id).components.at(0); }
    Pointer get_pointer(Id id);
    std::vector<Component> get_components(Id id);        ///< Of pointers too.
    Value constant(Id id);
    Component zero(const Type& scalar);
    Component undefined_value(const Type& scalar);  ///< Of something that was never written.
    void set(const Instruction& at, std::vector<Component> components);
    void finish_definition(Id id);

    // ---- Control flow (emit_control_flow.cpp)
    /// Emits a function for the lanes of `mask`; returns its result.
    std::vector<Component> emit_function(const Function& function, const std::vector<Value>& arguments,
                                         llvm::Value* mask);

    // ---- Functions that are called and not emitted in place (emit_calls.cpp)
    void emit_call(const Instruction& at);
    void share_environment();                            ///< When everything that functions may use has been made.
    virtual void add_stage_values(std::vector<llvm::Value**>&) {
    }  ///< What a stage keeps in members and functions may use.

    // ---- Instructions
    void emit_instruction(const Instruction& at);                       // emit_instruction.cpp
    bool emit_arithmetic(const Instruction& at);                        // emit_arithmetic.cpp
    std::vector<Component> evaluate(spv::Op op, Id type, std::span<const std::uint32_t> operands, Id result);
    bool emit_composite(const Instruction& at);                         // emit_composite.cpp
    std::vector<Component> evaluate_composite(spv::Op op, Id type, std::span<const std::uint32_t> operands);
    bool emit_extended(const Instruction& at);                          // emit_extended.cpp
    bool emit_memory(const Instruction& at);                            // emit_memory.cpp
    bool emit_atomic(const Instruction& at);                            // emit_atomics.cpp
    bool emit_image(const Instruction& at);                             // emit_images.cpp
    bool emit_image_query(const Instruction& at);
    /// Calls the image function for the lanes of the mask; returns four words (none for stores).
    std::vector<Component> image_call(const Component& image, const Component& sampler, Id image_type,
                                      const std::vector<Component>& coordinates, std::uint32_t flags,
                                      const std::vector<Component>& texel, const Component& sample);
    /// How an instruction reads or writes an image.
    struct ImageAccess {
        ImageOperation operation = ImageOperation::sample;
        bool is_projected = false, is_compared = false, is_implicit = false;
        std::size_t first_operand = 2;  ///< Of the image operands.
    };
    /// The instruction on doubles, for images of floats.
    void emit_double_image(const Instruction& at, const ImageAccess& access);
    llvm::Value* bound_view(llvm::Value* descriptor_address);  ///< ptr to ImageView; to zeros where nothing is bound.
    void put_argument(std::size_t offset, const Component& value);
    llvm::Value* image_memory();                                        ///< An ImageArguments on the stack.
    void set_image_atomic(AtomicOperation operation, const Component& comparator);
    [[nodiscard]] std::uint32_t image_integer_flag(Id image_type) const;
    /// Coordinates without the layer.
    [[nodiscard]] static std::uint32_t dimensions_of(spv::Dim dim);
    Component from_word(const Component& word, llvm::Type* kind);       ///< Bits of 32 as a value of a type.
    Component to_word(const Component& value);
    // Texels without a call (emit_texels.cpp); `otherwise` makes the call for what has another layout.
    std::vector<Component> fetch_directly(const Component& image, Id image_type,
                                          const std::vector<Component>& coordinates, const Component& level,
                                          const std::function<std::vector<Component>()>& otherwise);
    /// The texel that all lanes ask for, in fragment shaders: a value that LLVM may compute once for all batches.
    std::vector<Component> fetch_once(const Component& image, Id image_type, const std::vector<Component>& coordinates,
                                      const Component& level, std::uint32_t flags);
    /// False: nothing was emitted.
    bool store_directly(const Component& image, Id image_type, const std::vector<Component>& coordinates,
                        const std::vector<Component>& texel, const std::function<void()>& otherwise);
    /// What a value does from lane to lane inside of a row of `row_lanes` lanes.
    enum class RowShape : std::uint8_t { other, equal, rising };  ///< rising: by one.
    [[nodiscard]] RowShape row_shape(llvm::Value* value, std::uint32_t depth = 0) const;
    /// Whether the first `count` coordinates mean texels side by side in every row of lanes.
    [[nodiscard]] bool are_rows(const std::vector<Component>& coordinates, std::size_t count) const;
    [[nodiscard]] std::uint32_t row_lanes() const;
    struct TexelPlaces {
        llvm::Value *data = nullptr, *offset = nullptr;  ///< ptr; bytes from there.
        llvm::Value* inside = nullptr;                   ///< Lanes of the mask whose texel exists.
    };
    TexelPlaces texel_places(llvm::Value* view, const Type& image_type, const std::vector<Component>& coordinates,
                             llvm::Value* level, std::uint32_t texel_bytes);
    llvm::Value* row_address(const TexelPlaces& places, std::uint32_t first_lane_of_row);
    llvm::Value* load_texel_rows(const TexelPlaces& places, llvm::Type* element, std::uint32_t per_texel);
    std::unordered_map<const llvm::Value*, RowShape> row_shapes;  ///< Of what the stage brings.
    bool emit_ray(const Instruction& at);                               // emit_rays.cpp
    /// Whether a type is a ray query or an array of them.
    [[nodiscard]] bool is_ray_query(Id type) const;
    Pointer ray_query_pointer(Id variable);
    void clear_ray_query(Id variable);
    /// Runs `body` for each different query that the lanes mean.
    void for_each_query(Id pointer, const std::function<void(llvm::Value* query, llvm::Value* lanes_on)>& body);
    llvm::Value* status_row(RayStatus status);
    /// Mask of rays that Embree can be given.
    llvm::Value* traceable(const Value& origin, const Value& direction, const Component& t_min, const Component& t_max);
    void proceed_query(const Instruction& at);
    /// RayHints of the lanes of `fresh`, and what goes with them.
    llvm::Value* proceed_hints(llvm::Value* query, llvm::Value* fresh, llvm::Value*& spread2);
    std::vector<Component> read_query(Id pointer, std::span<const std::size_t> offsets, llvm::Type* scalar);
    std::vector<Component> ray_property(Id pointer, std::uint32_t property, std::uint32_t words, llvm::Type* scalar);
    bool emit_subgroup(const Instruction& at);                          // emit_subgroups.cpp
    llvm::Value* permute(llvm::Value* values, llvm::Value* sources);    ///< Lane i gets the value of lane sources[i].
    virtual bool emit_stage(const Instruction&) { return false; }       // derivatives, barriers, interpolation

    // ---- Memory (emit_memory.cpp)
    void declare_variables();
    LaneVariable& make_lane_variable(Id variable_id, Id type, bool is_uniform);
    void fill(LaneVariable& variable, const std::vector<Component>& values);
    void hold_constant(LaneVariable& variable, Id content);  ///< Memory of the module that nobody writes.
    std::vector<Component> load(const Pointer& pointer);
    void store(const Pointer& pointer, const std::vector<Component>& values);
    Pointer pointer_to(Id variable);
    std::vector<Component> components_of(const Pointer& pointer);
    void set_pointer(const Instruction& at, std::vector<Component> components, Id origin);
    Pointer step(Pointer pointer, const Type& pointer_kind, Id index);  ///< As many elements on as the index says.
    Pointer access(Pointer pointer, Id index);
    Component load_bytes(const Pointer& pointer, std::int64_t extra, const Type& scalar);
    void store_bytes(const Pointer& pointer, std::int64_t extra, const Type& scalar, const Component& value);
    /// Lanes in which an access of `bytes` at offset + extra is allowed; null: all.
    Component allowed(const Pointer& pointer, std::int64_t extra, std::uint32_t bytes);
    llvm::Value* addresses(const Pointer& pointer, std::int64_t extra);  ///< ptr or <N x ptr>
    Component load_lane_component(const Pointer& pointer, std::uint32_t index, const Type& scalar);
    void store_lane_component(const Pointer& pointer, std::uint32_t index, const Type& scalar, const Component& value);
    llvm::Value* lane_offsets(const LaneVariable& variable, llvm::Value* numbers, llvm::Type* kind);
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
    /// What an atomic operation on integers leaves behind.
    llvm::Value* combine(llvm::AtomicRMWInst::BinOp operation, llvm::Value* old, llvm::Value* value);
    /// The value that stands for those of all lanes of `lanes_on` (one at least), where their order makes no
    /// difference.
    llvm::Value* combine_lanes(llvm::AtomicRMWInst::BinOp operation, const Component& value, llvm::Value* lanes_on);
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
    void check_index(const Component& index, const Component& bound, const std::string& object,
                     const Pointer* pointer = nullptr);
    llvm::Value* undefined_in_any(std::span<const Component> components);  ///< Null: nowhere.
    void check_undefined(std::span<const Component> components, const std::string& object);
    /// Every quad in which some but not all lanes run.
    void check_quads();
    /// Takes note of an access to a scalar, by MemoryAccess; returns the lanes that read what is undefined, null: none
    /// can.
    llvm::Value* check_memory(const Pointer& pointer, std::int64_t extra, const Type& scalar, std::uint32_t access,
                              llvm::Value* undefined);
    llvm::Value* call_check_memory(llvm::Value* site, llvm::Value* descriptors, llvm::Value* addresses,
                                   std::uint32_t bytes, std::uint32_t access, llvm::Value* lanes_on,
                                   llvm::Value* undefined);
    /// The same for a read of bytes of a vertex buffer, of an address in each lane.
    llvm::Value* check_vertex_memory(const std::string& object, std::uint32_t buffer, llvm::Value* addresses,
                                     std::uint32_t bytes, llvm::Value* lanes_on);
    /// The same for the image operation whose arguments are in place.
    llvm::Value* check_image(llvm::Value* image, llvm::Value* sampler, std::uint32_t flags, llvm::Value* lanes_on);
    /// Takes note of a read of an input whose components may be undefined.
    void note_input(const Pointer& pointer, std::span<const Component> values);
    void check_barrier();
    /// A workgroup begins: nothing has written its memory.
    void check_workgroup(llvm::Value* kernel_context, llvm::Value* memory);
    void check_outputs(const Variable& variable, std::span<const Component> values);
    /// Components of one value are undefined where an argument is.
    void spread_undefined(Component& result, std::span<const Component> arguments);
    /// The same for operations whose result may not depend on all of their arguments.
    void refine_undefined(spv::Op op, std::span<const std::uint32_t> operands, std::vector<Component>& result);
    /// Where `condition ? yes : no` is undefined.
    llvm::Value* chosen_undefined(const Component& condition, const Component& yes, const Component& no);
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

    /// Of the built-in variables of subgroups that all stages have; nothing of others.
    std::optional<std::vector<Component>> subgroup_input(spv::BuiltIn builtin);
    // ---- Stages: what only they know.
    virtual std::vector<Component> input_components(const Variable& variable) = 0;
    /// Base pointer and size of the workgroup's memory.
    /// Memory for a large variable that is no stack; null: there is none.
    virtual llvm::Value* large_memory(std::uint64_t) { return nullptr; }
    /// Stack slots of the function that is being made lie in memory that was measured before.
    [[nodiscard]] virtual bool is_on_heap() const { return false; }
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
    llvm::Value* live_slot = nullptr;          ///< ptr to lanes that are neither helpers nor discarded.
    llvm::Value* killed_slot = nullptr;        ///< ptr to lanes that ended inside of functions; null: none can.
    llvm::AllocaInst* nowhere_slot = nullptr;  ///< Where stores go that must vanish.
    llvm::AllocaInst* image_arguments = nullptr;
    Id image_root = 0;                         ///< Variable of the image that `image_call` is called for.
    std::unordered_map<Id, std::unique_ptr<LaneVariable>> lane_variables;
    std::unordered_map<Id, std::uint64_t> workgroup_offsets;
    std::unordered_map<Id, llvm::Value*> ray_queries;
    std::uint64_t workgroup_variable_bytes = 0;
    std::uint64_t variable_bytes = 0;  ///< Of variables of each lane, on stack or heap.
    std::uint64_t stack_bytes = 0;             ///< Of variables, all together.
    bool has_side_effects = false;             ///< Some store, atomic or image store was emitted.
    llvm::AllocaInst* trace_lane = nullptr;
    std::vector<Component> invocation_ids;     ///< Compute shaders that are traced.
    std::int64_t workgroup_shadow_offset = 0;  ///< Of the doubles of workgroup variables, in their memory.

    /// What is known of a function before it is emitted.
    struct Shape {
        struct BlockShape {
            bool reconverges = false;            ///< Header: all lanes meet again at the merge block.
            bool is_reconverged = false;         ///< Merge block of such a header.
            std::uint32_t divergent_loop =
                ~0u;  ///< Innermost loop around it that lanes leave one by one: header's index.
            // Headers of loops:
            std::uint32_t end = 0;               ///< Index of the first block behind the loop.
            bool returns_values = false;         ///< Some block of the loop returns from the function.
            std::vector<std::uint32_t> targets;  ///< Loops that lanes leave one by one: blocks outside that they go to.
            std::vector<Id> leaving;             ///< The same: values made inside and used outside.
        };
        struct Use {
            std::uint32_t home = 0;              ///< Block that makes the value.
            std::uint32_t last = 0;              ///< Last block that uses it.
            bool is_leaving = false;             ///< Used behind a loop that lanes leave one by one, made inside.
            bool is_remade = false;  ///< A pointer or image: behind such loops made again from its operands.
            bool is_used = false;                ///< Somewhere at all.
        };
        std::vector<BlockShape> blocks;
        std::unordered_map<Id, Use> uses;
    };
    /// What lanes bring along to a block: single static assignment is made as code is emitted, see `merge`.
    struct Arrival {
        llvm::Value* reached = nullptr;          ///< i1: some lane comes; null: none can.
        llvm::Value* mask = nullptr;             ///< Those that come.
        std::vector<std::vector<llvm::Value*>> phis;  ///< Components of each phi; null: nothing came yet.
    };
    /// One activation of a function.
    struct Frame {
        const Function* function = nullptr;
        const Shape* shape = nullptr;
        struct BlockState {
            Arrival arrival, back;               ///< `back`: loop headers, from the end of the loop.
            std::vector<bool> phi_uniform;
        };
        std::vector<BlockState> blocks;
        llvm::Value* entry_mask = nullptr;
        std::vector<llvm::Value*> returned;      ///< Components of the result; null: nothing yet.
        std::unordered_map<Id, Value> values;
        /// Behind loops that lanes leave one by one: what each lane had when it left.
        std::unordered_map<Id, std::vector<llvm::Value*>> values_outside;
        /// Places that hold other values than at the begin of a part of the code that may be skipped.
        struct Change {
            llvm::Value** place;
            llvm::Value* before;                 ///< Null: nothing.
            llvm::Value* otherwise;              ///< What stands for nothing; null: undefined.
            std::uint32_t last_use;              ///< Block behind which nobody reads it.
        };
        std::vector<Change> changes;
        std::uint32_t block = 0;                 ///< That is being emitted.
    };
    Frame* frame = nullptr;
    llvm::Value* mask = nullptr;                       ///< Of the block that is being emitted.
    const Instruction* current = nullptr;
    std::uint32_t call_depth = 0;
    bool runs_without_lanes = false;                   ///< The block is cheap: it runs even where its mask is empty.

  private:
    const Shape& shape_of(const Function& function);
    void find_uses(const Function& function, Shape& shape) const;
    void emit_range(std::uint32_t begin, std::uint32_t end);
    std::uint32_t emit_chain(std::uint32_t first, std::uint32_t end);
    void emit_block(std::uint32_t index, llvm::Value* block_mask);
    void emit_loop_body(std::uint32_t header, std::uint32_t end, llvm::Value* entry_mask);
    void emit_terminator(std::uint32_t index);
    /// condition: null (always), i1 or a vector of i1.
    void emit_edge(std::uint32_t from, Id to, llvm::Value* condition);
    bool is_cheap(std::uint32_t index) const;
    /// Changes what a place holds from here on, up to and with block `last_use`.
    void assign(llvm::Value*& place, llvm::Value* value, llvm::Value* otherwise, std::uint32_t last_use);
    /// Behind code that may have been skipped: places that changed there get a phi. `next` is the block that follows.
    void merge(std::size_t first_change, llvm::BasicBlock* skipped, llvm::BasicBlock* ran, std::uint32_t next);
    std::unordered_map<Id, std::unique_ptr<Shape>> shapes_;
    Id remade_ = 0;                                    ///< Pointer that is being made again behind a loop,
    Value remade_value_;                               ///< and what it is there.
    std::unordered_map<Id, llvm::Function*> kept_;     ///< Functions that have been made.
    std::vector<llvm::Value**> shared_places_;         ///< What functions may use,
    llvm::StructType* environment_type_ = nullptr;     ///< in the order of this structure,
    llvm::Value* environment_ = nullptr;               ///< of which every function gets the address.
    struct Argument {
        std::vector<llvm::Value*> values;              ///< Of `argument_types`.
        bool fits = true;                              ///< Can be handed to a function.
    };
    std::vector<llvm::Type*> argument_types(const Instruction& parameter);
    Argument argument(const Instruction& parameter, Id id);
    Value parameter_value(const Instruction& parameter, std::span<llvm::Value* const> values);
    llvm::Function* kept_function(const Function& callee);
    std::unordered_map<Id, Value> constants_;
    std::unordered_map<std::string, llvm::Value*> shared_;
    std::map<std::uint32_t, std::string> narrowed_;
};

}  // namespace nacre::cpu
