// SPDX-License-Identifier: Apache-2.0
// Code that looks for faults while a shader runs: what it finds goes to the functions of checks/check_interface.h.
#include <fmt/format.h>
#include <llvm/IR/Constants.h>
#include <llvm/IR/GlobalVariable.h>

#include <algorithm>
#include <array>
#include <deque>

#include "backends/cpu/compiler/emitter.h"
#include "backends/cpu/compiler/source_names.h"

namespace nacre::cpu {

using rhi::ShaderFault;
using spv::Op;
using spv::StorageClass;

struct Emitter::CheckNotes {
    explicit CheckNotes(std::span<const std::uint32_t> words) : names(words) {}
    SourceNames names;
    /// Variables, and structures some member of which is.
    std::unordered_set<Id> read_only, coherent;
    std::unordered_map<Id, std::uint32_t> last_store;  ///< Offset of the last store to a variable.
    std::unordered_map<std::string, llvm::Constant*> sites;
    std::unordered_map<const Function*, std::unordered_map<Id, const Instruction*>> definitions;
    rhi::ShaderStage stage = rhi::ShaderStage::compute;
    llvm::AllocaInst *running = nullptr, *found = nullptr, *limit = nullptr, *descriptors = nullptr,
                     *addresses = nullptr;
};

Emitter::CheckNotes& Emitter::notes() {
    if (check_notes) return *check_notes;
    check_notes = std::make_shared<CheckNotes>(module.words());
    // Decorations that only checks ask for.
    const std::span<const std::uint32_t> words = module.words();
    for (std::size_t at = 5; at < words.size() && words[at] >> 16; at += words[at] >> 16) {
        const auto op = static_cast<Op>(words[at] & 0xffff);
        if (op != Op::OpDecorate && op != Op::OpMemberDecorate) continue;
        const auto decoration = static_cast<spv::Decoration>(words[at + (op == Op::OpDecorate ? 2 : 3)]);
        if (decoration == spv::Decoration::NonWritable) check_notes->read_only.insert(words[at + 1]);
        if (decoration == spv::Decoration::Coherent || decoration == spv::Decoration::Volatile)
            check_notes->coherent.insert(words[at + 1]);
    }
    return *check_notes;
}

// ---- Words for reports ------------------------------------------------------------------------------------------

std::string Emitter::name_of(Id variable_id) const {
    const SourceNames& names = const_cast<Emitter*>(this)->notes().names;
    if (const std::string& own = names.name(variable_id); !own.empty()) return own;
    const Variable* variable = module.variable(variable_id);
    if (!variable) return {};
    Id type = variable->type;
    while (module.type(type).kind == TypeKind::array || module.type(type).kind == TypeKind::runtime_array)
        type = module.type(type).element;
    return names.name(type);
}

std::string Emitter::member_path(const Pointer& structure, std::uint32_t member) {
    const std::string& name = notes().names.member_name(structure.type, member);
    if (name.empty()) return structure.path;
    // Members of a block without a name of its own go by theirs alone.
    const bool is_unnamed = structure.root != 0 && notes().names.name(structure.root).empty();
    if (structure.path.empty() || (is_unnamed && structure.path == name_of(structure.root))) return name;
    return structure.path + "." + name;
}

std::string Emitter::origin_of(Id value) const {
    if (!frame) return {};
    CheckNotes& all = const_cast<Emitter*>(this)->notes();
    auto& definitions = all.definitions[frame->function];
    if (definitions.empty())
        for (const Block& block : frame->function->blocks)
            for (const auto* list : {&block.phis, &block.body})
                for (const Instruction& at : *list)
                    if (at.result) definitions[at.result] = &at;
    // The first variable on the way back, in the order of the operands.
    constexpr std::size_t most_steps = 64;
    std::deque<Id> waiting{value};
    for (std::size_t step = 0; step < most_steps && !waiting.empty(); ++step) {
        const Id id = waiting.front();
        waiting.pop_front();
        if (const Variable* variable = module.variable(id)) {
            if (const std::string name = name_of(id); !name.empty() && variable->storage != StorageClass::Input)
                return name;
            continue;
        }
        const auto found = definitions.find(id);
        if (found == definitions.end()) continue;
        for (const Id operand : found->second->operands) waiting.push_back(operand);
    }
    return {};
}

llvm::Value* Emitter::check_site(const std::string& object, std::int32_t set, std::int32_t binding) {
    const std::string place = current ? notes().names.line(current->offset) : std::string();
    llvm::Constant*& site = notes().sites[fmt::format("{}\n{}\n{}\n{}", place, object, set, binding)];
    if (site) return site;
    const auto text = [&](const std::string& words) -> llvm::Constant* {
        if (words.empty()) return llvm::ConstantPointerNull::get(pointer_type);
        llvm::Constant* bytes = llvm::ConstantDataArray::getString(context, words);
        return new llvm::GlobalVariable(target, bytes->getType(), true, llvm::GlobalValue::InternalLinkage, bytes,
                                        "text");
    };
    auto* type = llvm::StructType::get(
        context, {pointer_type, pointer_type, pointer_type, builder.getInt32Ty(), builder.getInt32Ty()});
    static_assert(offsetof(CheckSite, place) == 8 && offsetof(CheckSite, object) == 16 &&
                  offsetof(CheckSite, set) == 24 && offsetof(CheckSite, binding) == 28);
    llvm::Constant* content =
        llvm::ConstantStruct::get(type, {text(module.name), text(place), text(object), int32(set), int32(binding)});
    site = new llvm::GlobalVariable(target, type, true, llvm::GlobalValue::InternalLinkage, content, "site");
    return site;
}

// ---- Invocations ------------------------------------------------------------------------------------------------

void Emitter::begin_checks(rhi::ShaderStage stage, llvm::Value* work, llvm::Value* group_x, llvm::Value* subgroup) {
    CheckNotes& all = notes();
    all.stage = stage;
    llvm::Type* word = builder.getInt32Ty();
    llvm::Type* wide = builder.getInt64Ty();
    if (!all.running) all.running = make_slot(llvm::ArrayType::get(wide, sizeof(RunningInvocations) / 8), "running");
    const auto put = [&](std::size_t offset, llvm::Value* value) {
        builder.CreateStore(value, at_offset(all.running, static_cast<std::int64_t>(offset)));
    };
    put(offsetof(RunningInvocations, context), shader_context);
    put(offsetof(RunningInvocations, work), work);
    put(offsetof(RunningInvocations, stage), int32(static_cast<std::int32_t>(stage)));
    put(offsetof(RunningInvocations, lanes), int32(lanes));
    put(offsetof(RunningInvocations, group_x), group_x ? group_x : int32(0));
    put(offsetof(RunningInvocations, subgroup), subgroup ? subgroup : int32(0));
    for (std::size_t i = 0; i < 3; ++i)
        put(offsetof(RunningInvocations, size) + i * 4, int32(module.workgroup_size[i]));
    put(offsetof(RunningInvocations, barriers), int32(0));
    put(offsetof(RunningInvocations, undefined_site), llvm::ConstantPointerNull::get(pointer_type));
    if (stage != rhi::ShaderStage::compute) {
        builder.CreateCall(external("nacre_cpu_check_begin", builder.getVoidTy(), {pointer_type}), {all.running});
        return;
    }
    const auto range_word = [&](std::size_t offset) {
        return builder.CreateZExt(invariant_load(word, at_offset(work, static_cast<std::int64_t>(offset)), 4), wide);
    };
    llvm::Value* row = builder.CreateAdd(
        builder.CreateMul(range_word(offsetof(WorkgroupRange, z)), range_word(offsetof(WorkgroupRange, count) + 4)),
        range_word(offsetof(WorkgroupRange, y)));
    put(offsetof(RunningInvocations, batch),
        builder.CreateAdd(builder.CreateMul(row, range_word(offsetof(WorkgroupRange, count))),
                          builder.CreateZExt(group_x, wide)));
}

void Emitter::check_workgroup(llvm::Value* kernel_context, llvm::Value* memory) {
    std::uint64_t bytes = 0;
    for (const auto& [id, variable] : module.variables())
        if (variable.storage == StorageClass::Workgroup) bytes += (module.tight_size(variable.type) + 15) / 16 * 16;
    if (bytes == 0) return;
    builder.CreateCall(
        external("nacre_cpu_check_workgroup", builder.getVoidTy(), {pointer_type, pointer_type, builder.getInt64Ty()}),
        {kernel_context, memory, int64(static_cast<std::int64_t>(bytes))});
}

void Emitter::check_barrier() {
    llvm::Value* count = at_offset(notes().running, offsetof(RunningInvocations, barriers));
    builder.CreateStore(builder.CreateAdd(builder.CreateLoad(builder.getInt32Ty(), count), int32(1)), count);
}

// ---- Faults -----------------------------------------------------------------------------------------------------

void Emitter::check_fault(ShaderFault kind, llvm::Value* bad, const std::string& object, const Component& found,
                          const Component& limit, const Pointer* pointer) {
    if (const auto* never = llvm::dyn_cast<llvm::Constant>(bad); never && never->isNullValue()) return;
    CheckNotes& all = notes();
    llvm::Value* bits = mask_bits(both(effect_mask(), bad));
    // Called for no lane too: branches around thousands of calls would cost LLVM more time than the calls do.
    const auto put = [&](const Component& value, llvm::AllocaInst*& slot) -> llvm::Value* {
        if (!value) return llvm::ConstantPointerNull::get(pointer_type);
        llvm::Type* wide = vector_of(builder.getInt64Ty());
        if (!slot) slot = make_slot(llvm::ArrayType::get(builder.getInt64Ty(), max_lanes), "reported");
        builder.CreateAlignedStore(builder.CreateSExtOrTrunc(widen(value), wide), slot, llvm::Align(8));
        return slot;
    };
    llvm::Value* found_values = put(found, all.found);
    llvm::Value* limit_values = put(limit, all.limit);
    llvm::Value* descriptor_at = llvm::ConstantPointerNull::get(pointer_type);
    std::int32_t set = -1, binding = -1;
    if (pointer && pointer->descriptor_address) {
        set = static_cast<std::int32_t>(pointer->set), binding = static_cast<std::int32_t>(pointer->binding);
        if (pointer->descriptor_address.is_uniform()) descriptor_at = pointer->descriptor_address.value;
    }
    builder.CreateCall(external("nacre_cpu_check_fault", builder.getVoidTy(),
                                {pointer_type, pointer_type, builder.getInt32Ty(), builder.getInt32Ty(), pointer_type,
                                 pointer_type, pointer_type}),
                       {all.running, check_site(object, set, binding), int32(static_cast<std::int32_t>(kind)), bits,
                        descriptor_at, found_values, limit_values});
}

void Emitter::check_operands(const Instruction& at) {
    if (follows_undefined()) {
        const auto look = [&](Id id) {
            const Value value = get(id);
            check_undefined(value.components, origin_of(id));
        };
        switch (at.op) {
            case Op::OpBranchConditional:
            case Op::OpSwitch: look(at.operand(0)); break;
            case Op::OpStore: {
                const StorageClass storage = module.type(module.type_of(at.operand(0))).storage;
                if (storage == StorageClass::StorageBuffer || storage == StorageClass::Uniform) look(at.operand(1));
                break;
            }
            case Op::OpImageWrite: look(at.operand(2)); [[fallthrough]];
            case Op::OpImageTexelPointer:
            case Op::OpImageSampleImplicitLod:
            case Op::OpImageSampleExplicitLod:
            case Op::OpImageSampleDrefImplicitLod:
            case Op::OpImageSampleDrefExplicitLod:
            case Op::OpImageSampleProjImplicitLod:
            case Op::OpImageSampleProjExplicitLod:
            case Op::OpImageFetch:
            case Op::OpImageRead:
            case Op::OpImageGather:
            case Op::OpImageDrefGather: look(at.operand(1)); break;
            case Op::OpAtomicStore:
            case Op::OpAtomicExchange:
            case Op::OpAtomicIAdd:
            case Op::OpAtomicISub:
            case Op::OpAtomicSMin:
            case Op::OpAtomicUMin:
            case Op::OpAtomicSMax:
            case Op::OpAtomicUMax:
            case Op::OpAtomicAnd:
            case Op::OpAtomicOr:
            case Op::OpAtomicXor:
            case Op::OpAtomicFAddEXT: look(at.operand(3)); break;
            default: break;
        }
    }
    if (!looks_for(check_traps)) return;
    switch (at.op) {
        case Op::OpUDiv:
        case Op::OpSDiv:
        case Op::OpUMod:
        case Op::OpSRem:
        case Op::OpSMod:
        case Op::OpFDiv:
        case Op::OpFRem:
        case Op::OpFMod: {
            llvm::Value* bad = nullptr;
            for (const Component& divisor : get(at.operand(1)).components) {
                llvm::Value* none = llvm::Constant::getNullValue(divisor.value->getType());
                llvm::Value* is_zero = none->getType()->isFPOrFPVectorTy() ? builder.CreateFCmpOEQ(divisor.value, none)
                                                                           : builder.CreateICmpEQ(divisor.value, none);
                if (!is_zero->getType()->isVectorTy()) is_zero = splat(is_zero);
                bad = bad ? builder.CreateOr(bad, is_zero) : is_zero;
            }
            if (bad) check_fault(ShaderFault::division_by_zero, bad, {});
            return;
        }
        default: return;
    }
}

void Emitter::check_result(const Instruction& at) {
    if (!looks_for(check_traps | check_sanitize) || !at.result || !at.type || !module.has_type(at.type)) return;
    switch (at.op) {
        case Op::OpFAdd:
        case Op::OpFSub:
        case Op::OpFMul:
        case Op::OpFDiv:
        case Op::OpFRem:
        case Op::OpFMod:
        case Op::OpFConvert:
        case Op::OpVectorTimesScalar:
        case Op::OpMatrixTimesScalar:
        case Op::OpVectorTimesMatrix:
        case Op::OpMatrixTimesVector:
        case Op::OpMatrixTimesMatrix:
        case Op::OpOuterProduct:
        case Op::OpDot:
        case Op::OpExtInst:
        case Op::OpDPdx:
        case Op::OpDPdy:
        case Op::OpFwidth:
        case Op::OpDPdxFine:
        case Op::OpDPdyFine:
        case Op::OpFwidthFine:
        case Op::OpDPdxCoarse:
        case Op::OpDPdyCoarse:
        case Op::OpFwidthCoarse: break;
        default: return;
    }
    const auto is_float = [](const Component& value) { return value.value->getType()->isFPOrFPVectorTy(); };
    if (module.type(at.type).components == 0 || !is_float(get(at.result).components.at(0))) return;
    struct Found {
        llvm::Value *nan = nullptr, *infinite = nullptr;
    };
    const bool wants_infinity = looks_for(check_traps);
    const auto add = [&](Found& into, const Component& value) {
        const auto join = [&](llvm::Value*& all, llvm::Value* more) {
            if (!more->getType()->isVectorTy()) more = splat(more);
            all = all ? builder.CreateOr(all, more) : more;
        };
        join(into.nan, builder.CreateFCmpUNO(value.value, value.value));
        if (wants_infinity)
            join(into.infinite,
                 builder.CreateFCmpOEQ(math.f_abs(value.value), llvm::ConstantFP::getInfinity(value.value->getType())));
    };
    Found operands, result;
    for (std::size_t i = at.op == Op::OpExtInst ? 2 : 0; i < at.operands.size(); ++i) {
        const Id type = module.type_of(at.operands[i]);
        if (!type || module.type(type).components == 0 || module.type(type).kind == TypeKind::pointer) continue;
        // Bits of another kind may be unpacked to any number.
        for (const Component& value : get(at.operands[i]).components) {
            if (!is_float(value)) return;
            add(operands, value);
        }
    }
    if (!operands.nan) return;
    for (const Component& value : get(at.result).components)
        if (is_float(value)) add(result, value);
    check_fault(ShaderFault::not_a_number, builder.CreateAnd(result.nan, builder.CreateNot(operands.nan)), {});
    if (!wants_infinity) return;
    llvm::Value* was_finite = builder.CreateNot(builder.CreateOr(operands.nan, operands.infinite));
    check_fault(ShaderFault::infinity, builder.CreateAnd(result.infinite, was_finite), {});
}

void Emitter::check_index(const Component& index, const Component& bound, const std::string& object,
                          const Pointer* pointer) {
    if (!looks_for(check_traps | check_sanitize)) return;
    llvm::Value *at = widen(index), *end = widen(bound);
    check_fault(ShaderFault::index_range, builder.CreateICmpUGE(at, end), object, index, bound, pointer);
}

void Emitter::check_range(const Pointer& pointer) {
    if (!looks_for(check_traps | check_sanitize)) return;
    for (const Pointer::Index& at : pointer.indices) check_index(at.index, at.bound, pointer.path, &pointer);
    if (pointer.kind != Pointer::Kind::bytes || !pointer.needs_limit_check) return;
    std::int64_t bytes = 0;
    visit_layout(pointer, pointer.type, 0, [&](const Pointer&, std::int64_t extra, const Type& scalar) {
        bytes = std::max<std::int64_t>(bytes, extra + (scalar.kind == TypeKind::boolean ? 4 : scalar.bits / 8));
    });
    Pointer whole = pointer;
    whole.valid = {};
    const Component fits = allowed(whole, 0, static_cast<std::uint32_t>(bytes));
    if (!fits) return;
    llvm::Value* bad = builder.CreateNot(widen(fits));
    if (pointer.valid) bad = builder.CreateAnd(bad, widen(pointer.valid));
    const Component last =
        pointer.dynamic_offset
            ? apply({pointer.dynamic_offset},
                    [&](auto v) {
                        return builder.CreateAdd(
                            v[0], llvm::ConstantInt::getSigned(v[0]->getType(), pointer.offset + bytes - 1));
                    })
            : Component(int64(pointer.offset + bytes - 1));
    const std::string object = (pointer.path.empty() ? "a buffer" : pointer.path) + ", counted in bytes";
    check_fault(ShaderFault::index_range, bad, object, last, pointer.limit, &pointer);
}

void Emitter::check_quads() {
    if (is_all(mask)) return;
    const auto quads = static_cast<std::int32_t>(0x1111 & ((1u << lanes) - 1));
    llvm::Value* bits = mask_bits(mask);
    llvm::Value* pairs = builder.CreateAnd(bits, builder.CreateLShr(bits, 1));
    llvm::Value* full = builder.CreateAnd(builder.CreateAnd(pairs, builder.CreateLShr(pairs, 2)), int32(quads));
    llvm::Value* whole = builder.CreateMul(full, int32(15));
    llvm::Value* bad = builder.CreateAnd(bits, builder.CreateNot(whole));
    check_fault(ShaderFault::nonuniform_derivative,
                builder.CreateBitCast(builder.CreateTrunc(bad, builder.getIntNTy(lanes)), mask_type), {});
}

// ---- What nothing has written -----------------------------------------------------------------------------------

llvm::Value* Emitter::undefined_in_any(std::span<const Component> components) {
    llvm::Value* undefined = nullptr;
    for (const Component& component : components) {
        if (!component.undefined) continue;
        llvm::Value* more =
            component.undefined->getType()->isVectorTy() ? component.undefined : splat(component.undefined);
        undefined = undefined ? builder.CreateOr(undefined, more) : more;
    }
    return undefined;
}

void Emitter::check_undefined(std::span<const Component> components, const std::string& object) {
    if (!follows_undefined()) return;
    if (llvm::Value* bad = undefined_in_any(components)) check_fault(ShaderFault::uninitialized_read, bad, object);
}

void Emitter::check_outputs(const Variable& variable, std::span<const Component> values) {
    if (!follows_undefined()) return;
    const auto last = notes().last_store.find(variable.instruction.result);
    Instruction place = variable.instruction;
    if (last != notes().last_store.end()) place.offset = last->second;
    const Instruction* const outer = current;
    current = &place;
    check_undefined(values, name_of(variable.instruction.result));
    current = outer;
}

void Emitter::note_store(const Pointer& pointer) {
    if (current && pointer.storage == StorageClass::Output) notes().last_store[pointer.root] = current->offset;
}

void Emitter::spread_undefined(Component& result, std::span<const Component> arguments) {
    llvm::Value* undefined = nullptr;
    for (const Component& argument : arguments) {
        if (!argument.undefined) continue;
        if (!undefined) {
            undefined = argument.undefined;
            continue;
        }
        llvm::Value* more = argument.undefined;
        if (undefined->getType() != more->getType()) {
            if (!undefined->getType()->isVectorTy()) undefined = splat(undefined);
            if (!more->getType()->isVectorTy()) more = splat(more);
        }
        undefined = builder.CreateOr(undefined, more);
    }
    result.undefined = undefined;
}

llvm::Value* Emitter::chosen_undefined(const Component& condition, const Component& yes, const Component& no) {
    if (!condition.undefined && !yes.undefined && !no.undefined) return nullptr;
    const bool is_uniform = condition.is_uniform() && yes.is_uniform() && no.is_uniform();
    const auto shaped = [&](llvm::Value* value) { return value->getType()->isVectorTy() ? value : splat(value); };
    const auto undefined_in = [&](const Component& value) {
        return value.undefined ? shaped(value.undefined) : llvm::Constant::getNullValue(mask_type);
    };
    llvm::Value* undefined =
        builder.CreateOr(undefined_in(condition),
                         builder.CreateSelect(shaped(condition.value), undefined_in(yes), undefined_in(no)));
    return is_uniform ? any(both(mask, undefined)) : undefined;
}

void Emitter::refine_undefined(Op op, std::span<const std::uint32_t> operands, std::vector<Component>& result) {
    if (op != Op::OpSelect && op != Op::OpLogicalAnd && op != Op::OpLogicalOr) return;
    const auto shaped = [&](llvm::Value* value) { return value->getType()->isVectorTy() ? value : splat(value); };
    const auto undefined_in = [&](const Component& value) {
        return value.undefined ? shaped(value.undefined) : llvm::Constant::getNullValue(mask_type);
    };
    const Value first = get(operands[0]), second = get(operands[1]);
    for (std::size_t i = 0; i < result.size(); ++i) {
        const Component& a = first.components.size() == 1 ? first.components[0] : first.components.at(i);
        const Component& b = second.components.at(i);
        if (op == Op::OpSelect) {
            result[i].undefined = chosen_undefined(a, b, get(operands[2]).components.at(i));
            continue;
        }
        if (!a.undefined && !b.undefined) continue;
        // One side alone may decide: false for "and", true for "or".
        const auto decides = [&](const Component& value) {
            llvm::Value* says = shaped(op == Op::OpLogicalAnd ? builder.CreateNot(value.value) : value.value);
            return builder.CreateAnd(says, builder.CreateNot(undefined_in(value)));
        };
        llvm::Value* undefined = builder.CreateAnd(builder.CreateOr(undefined_in(a), undefined_in(b)),
                                                   builder.CreateNot(builder.CreateOr(decides(a), decides(b))));
        result[i].undefined = result[i].is_uniform() ? any(both(mask, undefined)) : undefined;
    }
}

void Emitter::mark_undefined(LaneVariable& variable, bool is_undefined) {
    const std::uint64_t bytes =
        std::uint64_t{module.type(variable.type).components} * 4 * (variable.is_uniform ? 1 : lanes);
    builder.CreateMemSet(variable.undefined->memory, builder.getInt8(is_undefined ? 0xff : 0), bytes, llvm::Align(4));
}

Pointer Emitter::undefined_of(const Pointer& pointer) {
    Pointer to = pointer;
    to.variable = pointer.variable->undefined.get();
    return to;
}

const Type& Emitter::boolean_type() {
    static const Type type = [] {
        Type made;
        made.kind = TypeKind::boolean;
        made.components = 1;
        return made;
    }();
    return type;
}

void Emitter::note_read(const Pointer& pointer, std::int64_t extra, const Type& scalar, Component& value) {
    llvm::Value* undefined = check_memory(pointer, extra, scalar, access_read, nullptr);
    if (undefined) value.undefined = value.is_uniform() ? any(undefined) : undefined;
}

void Emitter::note_write(const Pointer& pointer, std::int64_t extra, const Type& scalar, const Component& value) {
    check_memory(pointer, extra, scalar, access_write, value.undefined);
}

llvm::Value* Emitter::check_memory(const Pointer& pointer, std::int64_t extra, const Type& scalar, std::uint32_t access,
                                   llvm::Value* undefined) {
    CheckNotes& all = notes();
    const Variable* variable = module.variable(pointer.root);
    if (!variable) return nullptr;
    std::int32_t set = -1, binding = -1;
    if (pointer.storage == StorageClass::Workgroup) {
        access |= access_workgroup | access_shared;
    } else if (pointer.storage == StorageClass::StorageBuffer || pointer.storage == StorageClass::Uniform) {
        set = static_cast<std::int32_t>(pointer.set), binding = static_cast<std::int32_t>(pointer.binding);
        Id block = variable->type;
        while (module.type(block).kind == TypeKind::array || module.type(block).kind == TypeKind::runtime_array)
            block = module.type(block).element;
        const auto is_either = [&](const std::unordered_set<Id>& marked) {
            return marked.contains(pointer.root) || marked.contains(block);
        };
        if (!pointer.invariant && !is_either(all.read_only) && !is_either(all.coherent)) access |= access_shared;
    } else {
        return nullptr;
    }
    const std::uint32_t bytes = scalar.kind == TypeKind::boolean ? 4 : scalar.bits / 8;
    const Component ok = allowed(pointer, extra, bytes);
    llvm::Value* lanes_on = both(effect_mask(), ok ? ok.value : nullptr);
    return call_check_memory(check_site(pointer.path, set, binding), pointer.descriptor_address.value,
                             addresses(pointer, extra), bytes, access, lanes_on, undefined);
}

llvm::Value* Emitter::check_vertex_memory(const std::string& object, std::uint32_t buffer, llvm::Value* addresses,
                                          std::uint32_t bytes, llvm::Value* lanes_on) {
    return call_check_memory(check_site(object, -1, static_cast<std::int32_t>(buffer)), nullptr, addresses, bytes,
                             access_read | access_vertex, lanes_on, nullptr);
}

void Emitter::note_input(const Pointer& pointer, std::span<const Component> values) {
    // Of vertex attributes their buffer is named.
    llvm::Value* undefined = notes().stage == rhi::ShaderStage::fragment ? undefined_in_any(values) : nullptr;
    if (!undefined) return;
    builder.CreateCall(external("nacre_cpu_check_input", builder.getVoidTy(),
                                {pointer_type, pointer_type, builder.getInt32Ty()}),
                       {notes().running, check_site(pointer.path, -1, -1), mask_bits(both(effect_mask(), undefined))});
}

llvm::Value* Emitter::call_check_memory(llvm::Value* site, llvm::Value* descriptors, llvm::Value* addresses,
                                        std::uint32_t bytes, std::uint32_t access, llvm::Value* lanes_on,
                                        llvm::Value* undefined) {
    CheckNotes& all = notes();
    const auto put = [&](llvm::Value* value, llvm::AllocaInst*& slot) -> llvm::Value* {
        if (!value) return llvm::ConstantPointerNull::get(pointer_type);
        if (!slot) slot = make_slot(llvm::ArrayType::get(pointer_type, max_lanes), "checked");
        builder.CreateAlignedStore(value->getType()->isVectorTy() ? value : splat(value), slot, llvm::Align(8));
        return slot;
    };
    llvm::Value* addresses_at = put(addresses, all.addresses);
    llvm::Value* descriptors_at = put(descriptors, all.descriptors);
    llvm::Value* undefined_bits = int32(0);
    if (undefined) undefined_bits = mask_bits(undefined->getType()->isVectorTy() ? undefined : splat(undefined));
    llvm::Type* word = builder.getInt32Ty();
    llvm::Value* bits =
        builder.CreateCall(external("nacre_cpu_check_memory", word,
                                    {pointer_type, pointer_type, pointer_type, pointer_type, word, word, word, word}),
                           {all.running, site, descriptors_at, addresses_at, int32(bytes),
                            int32(static_cast<std::int32_t>(access)), mask_bits(lanes_on), undefined_bits});
    return builder.CreateBitCast(builder.CreateTrunc(bits, builder.getIntNTy(lanes)), mask_type);
}

llvm::Value* Emitter::check_image(llvm::Value* image, llvm::Value* sampler, std::uint32_t flags,
                                  llvm::Value* lanes_on) {
    const Variable* variable = module.variable(image_root);
    const auto operation = static_cast<ImageOperation>(flags & image_operation_mask);
    if (!variable || operation == ImageOperation::query_lod) return nullptr;
    llvm::Type* word = builder.getInt32Ty();
    if (notes().coherent.contains(image_root) || notes().read_only.contains(image_root)) flags |= image_unshared;
    llvm::Value* counted = live_slot ? both(lanes_on, live()) : lanes_on;
    llvm::Value* bits = builder.CreateCall(
        external("nacre_cpu_check_image", word,
                 {pointer_type, pointer_type, pointer_type, pointer_type, pointer_type, word, word}),
        {notes().running,
         check_site(name_of(image_root), static_cast<std::int32_t>(variable->set.value_or(0)),
                    static_cast<std::int32_t>(variable->binding.value_or(0))),
         image, sampler, image_memory(), int32(static_cast<std::int32_t>(flags)), mask_bits(counted)});
    if (!follows_undefined() || operation == ImageOperation::store) return nullptr;
    return builder.CreateBitCast(builder.CreateTrunc(bits, builder.getIntNTy(lanes)), mask_type);
}

}  // namespace nacre::cpu
