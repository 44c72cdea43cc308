// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>
#include <llvm/IR/Constants.h>
#include <llvm/IR/GlobalVariable.h>
#include <llvm/IR/Intrinsics.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;
using spv::StorageClass;

namespace {

/// Scalars of a variable up to which each load and store names its slots one by one.
constexpr std::uint32_t most_direct_components = 4096;
/// Of all variables together. Each thread has that much.
constexpr std::uint64_t most_variable_bytes = 64 << 20;
/// Threads of schedulers have a few MiB of stack.
constexpr std::uint64_t most_stack_bytes = 2 << 20, most_stack_bytes_of_one = 64 << 10;

}  // namespace

LaneVariable& Emitter::make_lane_variable(Id variable_id, Id type_id, bool is_uniform) {
    auto& made = lane_variables[variable_id];
    const Type& type = module.type(type_id);
    if (!made) {
        made = std::make_unique<LaneVariable>();
        made->type = type_id;
        made->is_uniform = is_uniform;
        if (const Id content = module.constant_content(variable_id)) {
            hold_constant(*made, content);
            return *made;
        }
        made->slot_bytes = slot_bytes_of(type);
        const std::uint64_t bytes = std::uint64_t{type.components} * made->slot_bytes * (is_uniform ? 1 : lanes);
        if (bytes > (1u << 24))
            reject(fmt::format("a variable of {} scalars takes {} bytes for {} lanes; 16 MiB is the most",
                               type.components, bytes, lanes));
        variable_bytes += bytes;
        if (variable_bytes > most_variable_bytes)
            reject(fmt::format("the variables take {} bytes for {} lanes; {} is the most", variable_bytes, lanes,
                               most_variable_bytes));
        if (bytes > most_stack_bytes_of_one || stack_bytes + bytes > most_stack_bytes)
            made->memory = large_memory(bytes);
        if (made->memory) return *made;
        stack_bytes += bytes;
        if (stack_bytes > most_stack_bytes && !is_on_heap())
            reject(fmt::format("the variables take {} bytes of stack for {} lanes; {} is the most", stack_bytes, lanes,
                               most_stack_bytes));
        made->memory =
            make_slot(llvm::ArrayType::get(builder.getInt8Ty(), std::max<std::uint64_t>(bytes, 1)), "variable");
        if (follows_undefined()) {
            made->undefined = std::make_unique<LaneVariable>();
            made->undefined->type = type_id;
            made->undefined->is_uniform = is_uniform;
            made->undefined->memory =
                make_slot(llvm::ArrayType::get(builder.getInt8Ty(),
                                               std::uint64_t{type.components} * 4 * (is_uniform ? 1 : lanes)),
                          "undefined");
        }
    }
    return *made;
}

void Emitter::hold_constant(LaneVariable& variable, Id content) {
    const Value value = constant(content);
    variable.is_uniform = true;
    variable.slot_bytes = slot_bytes_of(module.type(variable.type));
    std::vector<std::uint32_t> words;
    words.reserve(value.components.size() * variable.slot_bytes / 4);
    for (const Component& component : value.components) {
        // Undefined ones are zero as good as anything.
        llvm::APInt bits(64, 0);
        if (const auto* integer = llvm::dyn_cast<llvm::ConstantInt>(component.value))
            bits = integer->getValue().zextOrTrunc(64);
        if (const auto* number = llvm::dyn_cast<llvm::ConstantFP>(component.value))
            bits = number->getValueAPF().bitcastToAPInt().zextOrTrunc(64);
        words.push_back(static_cast<std::uint32_t>(bits.getZExtValue()));
        if (variable.slot_bytes == 8) words.push_back(static_cast<std::uint32_t>(bits.getZExtValue() >> 32));
    }
    llvm::Constant* data = llvm::ConstantDataArray::get(context, words);
    auto* global =
        new llvm::GlobalVariable(target, data->getType(), true, llvm::GlobalValue::InternalLinkage, data, "constant");
    global->setAlignment(llvm::Align(64));
    variable.memory = global;
}

void Emitter::fill(LaneVariable& variable, const std::vector<Component>& values) {
    std::uint32_t index = 0;
    for (const Component& component : values) {
        llvm::Value* value = component.value;
        if (value->getType()->getScalarType()->isIntegerTy(1))
            value = builder.CreateZExt(value, like(value, builder.getInt32Ty()));
        if (!variable.is_uniform) value = widen(Component(value));
        const std::uint64_t at = std::uint64_t{index++} * variable.slot_bytes * (variable.is_uniform ? 1 : lanes);
        builder.CreateAlignedStore(value, at_offset(variable.memory, static_cast<std::int64_t>(at)),
                                   llvm::Align(variable.slot_bytes));
    }
}

Pointer Emitter::pointer_to(Id id) {
    const Variable& variable = *module.variable(id);
    const Type& type = module.type(variable.type);
    Pointer pointer;
    pointer.storage = variable.storage;
    pointer.type = variable.type;
    pointer.root = id;
    if (options.checks) pointer.path = name_of(id);
    if (is_ray_query(variable.type)) return ray_query_pointer(id);
    switch (variable.storage) {
        case StorageClass::Function:
        case StorageClass::Private:
        case StorageClass::Output:
        case StorageClass::Input:
            pointer.kind = Pointer::Kind::lanes;
            pointer.variable_id = id;
            if (const auto found = lane_variables.find(id); found != lane_variables.end())
                pointer.variable = found->second.get();
            else if (variable.storage == StorageClass::Input) {
                auto made = std::make_unique<LaneVariable>();
                made->type = variable.type;
                made->components = input_components(variable);
                pointer.variable = made.get();
                lane_variables.emplace(id, std::move(made));
            } else {
                pointer.variable = &make_lane_variable(id, variable.type, !uniformity.has_divergent_content(id));
            }
            return pointer;
        case StorageClass::Workgroup: {
            pointer.kind = Pointer::Kind::bytes;
            const auto found = workgroup_offsets.find(id);
            if (found == workgroup_offsets.end()) reject("a workgroup variable was not declared");
            pointer.base = workgroup_memory();
            if (in_double()) {
                pointer.shadow = at_offset(pointer.base.value, workgroup_shadow_offset);
            }
            pointer.offset = static_cast<std::int64_t>(found->second);
            return pointer;
        }
        case StorageClass::PushConstant:
            pointer.kind = Pointer::Kind::bytes;
            pointer.base = load_context(offsetof(ShaderContext, push_constants), pointer_type);
            pointer.limit = int64(push_constant_capacity);
            pointer.needs_limit_check = true;
            pointer.invariant = true;
            return pointer;
        case StorageClass::Uniform:
        case StorageClass::StorageBuffer:
        case StorageClass::UniformConstant:
            pointer.kind = Pointer::Kind::descriptor;
            pointer.set = variable.set.value_or(0);
            pointer.binding = variable.binding.value_or(0);
            if (type.kind == TypeKind::structure) return buffer_pointer(pointer);
            return pointer;
        default: reject(fmt::format("storage class {} is not supported", static_cast<unsigned>(variable.storage)));
    }
}

Component Emitter::descriptor(const Pointer& pointer) {
    if (pointer.descriptor_address) return pointer.descriptor_address;
    const BindingSlots* slot = slots.find(pointer.set, pointer.binding);
    if (!slot) reject(fmt::format("set {} binding {} is not in the pipeline's layout", pointer.set, pointer.binding));
    const std::size_t group_offset = offsetof(ShaderContext, groups) + pointer.set * sizeof(void*);
    llvm::Value* group = load_context(group_offset, pointer_type);
    Component index = pointer.descriptor_index;
    if (index && pointer.valid)
        index = apply({pointer.valid, index},
                      [&](auto v) { return select(v[0], v[1], llvm::Constant::getAllOnesValue(v[1]->getType())); });
    if (!index)
        return Component(at_offset(group, std::int64_t{slot->first} * static_cast<std::int64_t>(sizeof(Descriptor))));
    // Indices out of range find a descriptor of nothing.
    auto*& nothing = shared_["nothing"];
    if (!nothing) {
        auto* type = llvm::ArrayType::get(builder.getInt64Ty(), sizeof(Descriptor) / 8);
        nothing = new llvm::GlobalVariable(target, type, true, llvm::GlobalValue::InternalLinkage,
                                           llvm::Constant::getNullValue(type), "no_descriptor");
    }
    llvm::Value* count = int32(slot->count);
    if (slot->count == 0) {
        llvm::Value* size = load_context(offsetof(ShaderContext, group_sizes) + pointer.set * 4, builder.getInt32Ty());
        count = builder.CreateSub(size, int32(slot->first));
    }
    if (options.checks) check_index(index, Component(count), pointer.path);
    llvm::Value* first = at_offset(group, std::int64_t{slot->first} * static_cast<std::int64_t>(sizeof(Descriptor)));
    if (index.is_uniform()) {
        llvm::Value* wide = builder.CreateZExt(index.value, builder.getInt64Ty());
        llvm::Value* address =
            builder.CreateGEP(builder.getInt8Ty(), first, builder.CreateMul(wide, int64(sizeof(Descriptor))));
        return Component(select(builder.CreateICmpULT(index.value, count), address, nothing));
    }
    llvm::Value* wide = builder.CreateZExt(index.value, vector_of(builder.getInt64Ty()));
    llvm::Value* address =
        builder.CreateGEP(builder.getInt8Ty(), first, builder.CreateMul(wide, splat(int64(sizeof(Descriptor)))));
    return Component(select(builder.CreateICmpULT(index.value, splat(count)), address, splat(nothing)));
}

Pointer Emitter::buffer_pointer(const Pointer& block) {
    Pointer pointer = block;
    pointer.kind = Pointer::Kind::bytes;
    const Component address = descriptor(block);
    pointer.descriptor_address = address;
    if (address.is_uniform()) {
        pointer.base = invariant_load(pointer_type, at_offset(address.value, offsetof(Descriptor, data)), 8);
        if (in_double())
            pointer.shadow = invariant_load(pointer_type, at_offset(address.value, offsetof(Descriptor, shadow)), 8);
        pointer.limit = invariant_load(builder.getInt64Ty(), at_offset(address.value, offsetof(Descriptor, size)), 8);
    } else {
        // A different buffer in each lane.
        const auto gather = [&](std::size_t offset, llvm::Type* kind) -> llvm::Value* {
            llvm::Value* places =
                builder.CreateGEP(builder.getInt8Ty(), address.value, int64(static_cast<std::int64_t>(offset)));
            return builder.CreateMaskedGather(vector_of(kind), places, llvm::Align(8), all_lanes(),
                                              llvm::Constant::getNullValue(vector_of(kind)));
        };
        pointer.base =
            builder.CreateIntToPtr(gather(offsetof(Descriptor, data), builder.getInt64Ty()), vector_of(pointer_type));
        if (in_double())
            pointer.shadow = builder.CreateIntToPtr(gather(offsetof(Descriptor, shadow), builder.getInt64Ty()),
                                                    vector_of(pointer_type));
        pointer.limit = gather(offsetof(Descriptor, size), builder.getInt64Ty());
    }
    pointer.needs_limit_check = true;
    const Type& type = module.type(block.type);
    pointer.invariant = block.storage == StorageClass::Uniform && type.is_block;
    // Old SPIR-V marks storage buffers as BufferBlock in the Uniform class: those are written.
    if (pointer.invariant && !module.is_uniform_block(block.type)) pointer.invariant = false;
    return pointer;
}

Pointer Emitter::access(Pointer pointer, Id index_id) {
    const Type& type = module.type(pointer.type);
    const std::optional<std::uint32_t> fixed = module.constant_word(index_id);
    if (pointer.kind == Pointer::Kind::descriptor) {
        // An element of an array of resources.
        if (type.kind == TypeKind::array || type.kind == TypeKind::runtime_array) {
            Component index = get_scalar(index_id);
            if (options.checks) check_undefined(std::span(&index, 1), origin_of(index_id));
            if (index.value->getType()->getScalarSizeInBits() != 32)
                index = apply({index}, [&](auto v) {
                    return builder.CreateZExtOrTrunc(v[0], like(v[0], builder.getInt32Ty()));
                });
            // Arrays of arrays: their elements lie one after another.
            std::int64_t inner = 1;
            bool is_innermost = true;
            for (const Type* element = &module.type(type.element); element->kind == TypeKind::array;
                 element = &module.type(element->element))
                inner *= element->count, is_innermost = false;
            if (!is_innermost || pointer.descriptor_index)
                if (type.kind == TypeKind::array)
                    pointer.valid = logical_and(pointer.valid, apply({index}, [&](auto v) {
                                                    return builder.CreateICmpULT(
                                                        v[0], llvm::ConstantInt::get(v[0]->getType(), type.count));
                                                }));
            pointer.descriptor_index = add(pointer.descriptor_index, multiply(index, inner));
            pointer.type = type.element;
            if (module.type(pointer.type).kind != TypeKind::structure) return pointer;
            pointer = buffer_pointer(pointer);
            pointer.valid = Component();  // Out of range there is a buffer of no bytes.
            return pointer;
        }
        reject("a resource is indexed that is no array");
    }
    if (type.kind == TypeKind::structure) {
        const std::uint32_t number = fixed.value_or(0);
        const Member& member = type.members.at(number);
        if (options.checks) pointer.path = member_path(pointer, number);
        if (pointer.kind == Pointer::Kind::lanes) {
            pointer.component += member.first_component;
        } else {
            pointer.offset += pointer.storage == StorageClass::Workgroup
                                  ? static_cast<std::int64_t>(module.tight_offset(pointer.type, number))
                                  : static_cast<std::int64_t>(member.offset);
            pointer.row_major = member.row_major, pointer.matrix_stride = member.matrix_stride;
        }
        pointer.type = member.type;
        return pointer;
    }

    const bool is_unbounded = type.kind == TypeKind::runtime_array;
    const std::uint32_t count = type.count;
    // What one step of the index is worth.
    std::int64_t step = 0;
    if (pointer.kind == Pointer::Kind::lanes) {
        step = module.type(type.element).components;
    } else if (type.kind == TypeKind::vector) {
        step = pointer.component_stride ? pointer.component_stride : module.type(type.element).bits / 8;
        if (module.type(type.element).kind == TypeKind::boolean) step = 4;
    } else if (type.kind == TypeKind::matrix) {
        const Type& column = module.type(type.element);
        const std::uint32_t scalar = module.type(column.element).bits / 8;
        std::uint32_t stride = pointer.matrix_stride;
        if (pointer.storage == StorageClass::Workgroup || stride == 0)
            stride = column.count * scalar, pointer.row_major = false;
        step = pointer.row_major ? scalar : stride;
        pointer.component_stride = pointer.row_major ? stride : 0;
    } else {
        step = pointer.storage == StorageClass::Workgroup || type.array_stride == 0
                   ? static_cast<std::int64_t>(module.tight_size(type.element))
                   : type.array_stride;
    }
    pointer.type = type.element;

    if (fixed && !is_unbounded) {
        if (*fixed >= count) {
            pointer.valid = builder.getFalse();
            if (options.checks) pointer.indices.push_back({int32(*fixed), int32(count)});
            return pointer;
        }
        if (pointer.kind == Pointer::Kind::lanes) pointer.component += static_cast<std::uint32_t>(*fixed * step);
        else pointer.offset += *fixed * step;
        return pointer;
    }
    Component index = get_scalar(index_id);
    const unsigned bits = index.value->getType()->getScalarSizeInBits();
    if (bits != 32) {
        // Wide indices that do not fit stay out of range.
        const bool is_signed = module.type(module.type_of(index_id)).is_signed;
        index = apply({index}, [&](auto v) {
            llvm::Type* kind = like(v[0], builder.getInt32Ty());
            if (bits < 32) return is_signed ? builder.CreateSExt(v[0], kind) : builder.CreateZExt(v[0], kind);
            llvm::Value* fits = builder.CreateICmpULE(v[0], llvm::ConstantInt::get(v[0]->getType(), 0x7fffffff));
            return builder.CreateSelect(fits, builder.CreateTrunc(v[0], kind),
                                        llvm::ConstantInt::get(kind, 0x7fffffff));
        });
    }
    Component bound = int32(count);
    if (is_unbounded) {
        // As many elements as fit behind the array's begin.
        bound = apply({pointer.limit}, [&](auto v) {
            llvm::Value* begin = llvm::ConstantInt::get(v[0]->getType(), static_cast<std::uint64_t>(pointer.offset));
            llvm::Value* room = builder.CreateSelect(builder.CreateICmpUGE(v[0], begin), builder.CreateSub(v[0], begin),
                                                     llvm::Constant::getNullValue(v[0]->getType()));
            llvm::Type* kind = like(v[0], builder.getInt32Ty());
            return builder.CreateTrunc(
                builder.CreateUDiv(room, llvm::ConstantInt::get(v[0]->getType(), static_cast<std::uint64_t>(
                                                                                     std::max<std::int64_t>(step, 1)))),
                kind);
        });
    }
    if (options.checks) {
        pointer.indices.push_back({index, bound});
        check_undefined(std::span(&index, 1), origin_of(index_id));
    }
    const Component in_range = apply({index, bound}, [&](auto v) { return builder.CreateICmpULT(v[0], v[1]); });
    pointer.valid = logical_and(pointer.valid, in_range);
    const Component scaled = multiply(index, step);
    if (pointer.kind == Pointer::Kind::lanes) {
        pointer.dynamic_component = add(pointer.dynamic_component, scaled);
    } else {
        pointer.dynamic_offset = add(pointer.dynamic_offset, scaled);
        // Below the bound, every byte of the element lies inside of the range.
        if (is_unbounded) pointer.needs_limit_check = false;
    }
    return pointer;
}

std::vector<Component> Emitter::components_of(const Pointer& pointer) {
    if (pointer.kind != Pointer::Kind::bytes) reject("only pointers into buffers and workgroup memory can be values");
    const Component base =
        apply({pointer.base}, [&](auto v) { return builder.CreatePtrToInt(v[0], like(v[0], builder.getInt64Ty())); });
    Component limit = pointer.limit;
    if (pointer.storage == StorageClass::Workgroup && !limit)
        limit = int64(static_cast<std::int64_t>(workgroup_variable_bytes));
    // Where an index was out of range the pointer leads to nothing.
    if (pointer.valid)
        limit = apply({pointer.valid, limit},
                      [&](auto v) { return select(v[0], v[1], llvm::Constant::getNullValue(v[1]->getType())); });
    return {base, limit, add(pointer.dynamic_offset, Component(int32(pointer.offset)))};
}

Pointer Emitter::step(Pointer pointer, const Type& kind, Id index_id) {
    if (pointer.kind != Pointer::Kind::bytes) reject("only pointers into buffers and workgroup memory can be moved");
    const bool is_tight = pointer.storage == StorageClass::Workgroup || kind.array_stride == 0;
    const std::int64_t stride =
        is_tight ? static_cast<std::int64_t>(module.tight_size(pointer.type)) : kind.array_stride;
    const bool is_signed = module.type(module.type_of(index_id)).is_signed;
    const Component steps = get_scalar(index_id);
    if (options.checks) check_undefined(std::span(&steps, 1), origin_of(index_id));
    const Component index = apply({steps}, [&](auto v) {
        llvm::Type* word = like(v[0], builder.getInt32Ty());
        return is_signed ? builder.CreateSExtOrTrunc(v[0], word) : builder.CreateZExtOrTrunc(v[0], word);
    });
    // Offsets may fall as well as rise: all of it counts against the limit.
    pointer.dynamic_offset =
        add(add(pointer.dynamic_offset, Component(int32(pointer.offset))), multiply(index, stride));
    pointer.offset = 0;
    if (pointer.storage == StorageClass::Workgroup && !pointer.limit)
        pointer.limit = int64(static_cast<std::int64_t>(workgroup_variable_bytes));
    pointer.needs_limit_check = true;
    return pointer;
}

Component Emitter::allowed(const Pointer& pointer, std::int64_t extra, std::uint32_t bytes) {
    Component ok = pointer.valid;
    if (!pointer.needs_limit_check) return ok;
    const std::int64_t end = pointer.offset + extra + bytes;
    const Component fits = apply({pointer.limit}, [&](auto v) {
        return builder.CreateICmpUGE(v[0], llvm::ConstantInt::get(v[0]->getType(), static_cast<std::uint64_t>(end)));
    });
    ok = logical_and(ok, fits);
    if (pointer.dynamic_offset) {
        const Component room = apply({pointer.limit}, [&](auto v) {
            return builder.CreateSub(v[0], llvm::ConstantInt::get(v[0]->getType(), static_cast<std::uint64_t>(end)));
        });
        ok = logical_and(ok, apply({pointer.dynamic_offset, room}, [&](auto v) {
                             return builder.CreateICmpULE(builder.CreateZExt(v[0], v[1]->getType()), v[1]);
                         }));
    }
    return ok;
}

llvm::Value* Emitter::addresses(const Pointer& pointer, std::int64_t extra) {
    const std::int64_t fixed = pointer.offset + extra;
    llvm::Value* base = pointer.base.value;
    if (fixed) base = builder.CreateGEP(builder.getInt8Ty(), base, int64(fixed));
    if (!pointer.dynamic_offset) return base;
    // 32-bit offsets are signed for the hardware's gathers; no range is longer than 2^31 - 1.
    llvm::Value* offset = pointer.dynamic_offset.value;
    if (!offset->getType()->isVectorTy()) offset = builder.CreateSExt(offset, builder.getInt64Ty());
    return builder.CreateGEP(builder.getInt8Ty(), base, offset);
}

Component Emitter::load_bytes(const Pointer& pointer, std::int64_t extra, const Type& scalar) {
    if (in_double() && scalar.kind == TypeKind::floating && scalar.bits < 64) return load_float(pointer, extra, scalar);
    const bool is_boolean = scalar.kind == TypeKind::boolean;
    llvm::Type* kind = is_boolean ? builder.getInt32Ty() : scalar_type(scalar);
    const std::uint32_t bytes = is_boolean ? 4 : scalar.bits / 8;
    const Component ok = allowed(pointer, extra, bytes);
    llvm::Value* address = addresses(pointer, extra);
    const llvm::Align alignment(bytes >= 4 ? 4 : bytes);
    const auto finish = [&](llvm::Value* value) -> Component {
        if (is_boolean) return builder.CreateICmpNE(value, llvm::Constant::getNullValue(value->getType()));
        return value;
    };
    if (!address->getType()->isVectorTy()) {
        if (ok && !ok.is_uniform()) {
            // One place, but not all lanes may see it.
            llvm::Value* seen = builder.CreateAlignedLoad(kind, select(any(ok.value), address, zeros()), alignment);
            return finish(select(ok.value, splat(seen), llvm::Constant::getNullValue(vector_of(kind))));
        }
        if (ok) address = select(ok.value, address, zeros());
        llvm::LoadInst* value = builder.CreateAlignedLoad(kind, address, alignment);
        if (pointer.invariant) value->setMetadata(llvm::LLVMContext::MD_invariant_load, llvm::MDNode::get(context, {}));
        return finish(value);
    }
    llvm::Value* lanes_on = ok ? both(mask, ok.value) : mask;
    llvm::Value* none = llvm::Constant::getNullValue(vector_of(kind));
    if (pointer.base.is_uniform() && pointer.dynamic_offset.linear_base &&
        pointer.dynamic_offset.linear_stride == std::int64_t{bytes}) {
        llvm::Value* start =
            builder.CreateGEP(builder.getInt8Ty(), at_offset(pointer.base.value, pointer.offset + extra),
                              builder.CreateSExt(pointer.dynamic_offset.linear_base, builder.getInt64Ty()));
        return finish(builder.CreateMaskedLoad(vector_of(kind), start, alignment, lanes_on, none));
    }
    return finish(builder.CreateMaskedGather(vector_of(kind), address, alignment, lanes_on, none));
}

void Emitter::store_bytes(const Pointer& pointer, std::int64_t extra, const Type& scalar, const Component& value) {
    if (in_double() && scalar.kind == TypeKind::floating && scalar.bits < 64)
        return store_float(pointer, extra, scalar, value);
    if (pointer.storage != StorageClass::Workgroup) has_side_effects = true;
    const bool is_boolean = scalar.kind == TypeKind::boolean;
    const std::uint32_t bytes = is_boolean ? 4 : scalar.bits / 8;
    const Component ok = allowed(pointer, extra, bytes);
    llvm::Value* address = addresses(pointer, extra);
    const llvm::Align alignment(bytes >= 4 ? 4 : bytes);
    Component stored = value;
    if (is_boolean)
        stored = apply({value}, [&](auto v) {
            return builder.CreateZExt(v[0], like(v[0], builder.getInt32Ty()));
        });
    llvm::Value* lanes_on = both(effect_mask(), ok ? ok.value : nullptr);
    if (!address->getType()->isVectorTy()) {
        // All lanes write to one place: the last of them wins.
        llvm::Value* last = stored.value;
        if (!stored.is_uniform()) {
            llvm::Value* leading =
                builder.CreateIntrinsic(llvm::Intrinsic::ctlz, {builder.getInt32Ty()},
                                        {builder.CreateOr(mask_bits(lanes_on), int32(1)), builder.getTrue()});
            last = builder.CreateExtractElement(stored.value, builder.CreateSub(int32(31), leading));
        }
        llvm::AllocaInst*& nowhere = nowhere_slot;
        if (!nowhere) nowhere = make_slot(builder.getInt64Ty(), "nowhere");
        builder.CreateAlignedStore(last, select(any(lanes_on), address, nowhere), alignment);
        return;
    }
    llvm::Value* values = widen(stored);
    if (pointer.base.is_uniform() && pointer.dynamic_offset.linear_base &&
        pointer.dynamic_offset.linear_stride == std::int64_t{bytes}) {
        llvm::Value* start =
            builder.CreateGEP(builder.getInt8Ty(), at_offset(pointer.base.value, pointer.offset + extra),
                              builder.CreateSExt(pointer.dynamic_offset.linear_base, builder.getInt64Ty()));
        builder.CreateMaskedStore(values, start, alignment, lanes_on);
        return;
    }
    builder.CreateMaskedScatter(values, address, alignment, lanes_on);
}

/// Where each lane's own scalar of a slot lies: the lanes of a slot lie without gaps, however wide the slot is.
llvm::Value* Emitter::lane_offsets(const LaneVariable& variable, llvm::Value* numbers, llvm::Type* kind) {
    if (variable.is_uniform) return builder.CreateMul(numbers, splat(int32(variable.slot_bytes)));
    llvm::Value* slots_before =
        builder.CreateMul(numbers, splat(int32(static_cast<std::int64_t>(variable.slot_bytes) * lanes)));
    return builder.CreateAdd(slots_before,
                             builder.CreateMul(lane_numbers(), splat(int32(kind->getScalarSizeInBits() / 8))));
}

Component Emitter::load_lane_component(const Pointer& pointer, std::uint32_t index, const Type& scalar) {
    LaneVariable& variable = *pointer.variable;
    const std::uint32_t number = pointer.component + index;
    const bool is_boolean = scalar.kind == TypeKind::boolean;
    llvm::Type* kind = is_boolean ? builder.getInt32Ty() : scalar_type(scalar);
    const auto finish = [&](llvm::Value* value) -> Component {
        if (is_boolean) return builder.CreateICmpNE(value, llvm::Constant::getNullValue(value->getType()));
        return value;
    };
    if (!pointer.dynamic_component) {
        if (pointer.valid) {
            // A constant index out of range.
            if (const auto* never = llvm::dyn_cast<llvm::Constant>(pointer.valid.value); never && never->isNullValue())
                return zero(scalar);
        }
        if (!variable.memory) return variable.components.at(number);
        const std::uint32_t per_lane = variable.is_uniform ? 1 : lanes;
        llvm::Value* address = at_offset(variable.memory, std::int64_t{number} * variable.slot_bytes * per_lane);
        Component loaded =
            finish(builder.CreateAlignedLoad(variable.is_uniform ? kind : static_cast<llvm::Type*>(vector_of(kind)),
                                             address, llvm::Align(variable.slot_bytes)));
        if (pointer.valid)
            loaded = apply({pointer.valid, loaded},
                           [&](auto v) { return select(v[0], v[1], llvm::Constant::getNullValue(v[1]->getType())); });
        return loaded;
    }
    if (!variable.memory) {
        // Inputs that are indexed dynamically get memory, once, where all of the function can see it.
        LaneVariable spilled;
        const Type& type = module.type(variable.type);
        spilled.slot_bytes = slot_bytes_of(type);
        spilled.memory = make_slot(
            llvm::ArrayType::get(builder.getInt8Ty(), std::uint64_t{type.components} * spilled.slot_bytes * lanes),
            "input");
        fill(spilled, variable.components);
        Pointer through = pointer;
        through.variable = &spilled;
        spilled.type = variable.type;
        Component loaded = load_lane_component(through, index, scalar);
        if (!std::ranges::any_of(variable.components, &Component::undefined)) return loaded;
        LaneVariable told;
        told.type = variable.type;
        told.memory = make_slot(llvm::ArrayType::get(builder.getInt8Ty(), std::uint64_t{type.components} * 4 * lanes),
                                "undefined");
        std::vector<Component> flags;
        for (const Component& component : variable.components)
            flags.emplace_back(component.undefined ? component.undefined : builder.getFalse());
        fill(told, flags);
        through.variable = &told;
        loaded.undefined = load_lane_component(through, index, boolean_type()).value;
        return loaded;
    }
    const Component element = pointer.dynamic_component;
    if (element.is_uniform() && (!pointer.valid || pointer.valid.is_uniform())) {
        llvm::Value* safe = pointer.valid ? select(pointer.valid.value, element.value, int32(0)) : element.value;
        const std::uint32_t per_lane = variable.is_uniform ? 1 : lanes;
        llvm::Value* offset =
            builder.CreateMul(builder.CreateAdd(safe, int32(number)), int32(variable.slot_bytes * per_lane));
        // With the index forced to 0 the address may lie before the element, never outside of the variable.
        llvm::Value* address =
            builder.CreateGEP(builder.getInt8Ty(), variable.memory, builder.CreateZExt(offset, builder.getInt64Ty()));
        llvm::Value* value =
            builder.CreateAlignedLoad(variable.is_uniform ? kind : static_cast<llvm::Type*>(vector_of(kind)), address,
                                      llvm::Align(variable.slot_bytes));
        if (pointer.valid) value = select(pointer.valid.value, value, llvm::Constant::getNullValue(value->getType()));
        return finish(value);
    }
    llvm::Value* numbers = builder.CreateAdd(widen(element), splat(int32(number)));
    llvm::Value* places =
        builder.CreateGEP(builder.getInt8Ty(), variable.memory, lane_offsets(variable, numbers, kind));
    llvm::Value* lanes_on = both(mask, pointer.valid ? pointer.valid.value : nullptr);
    return finish(builder.CreateMaskedGather(vector_of(kind), places,
                                             llvm::Align(std::min(4u, kind->getScalarSizeInBits() / 8)), lanes_on,
                                             llvm::Constant::getNullValue(vector_of(kind))));
}

void Emitter::store_lane_component(const Pointer& pointer, std::uint32_t index, const Type& scalar,
                                   const Component& value) {
    LaneVariable& variable = *pointer.variable;
    if (!variable.memory) reject("an input is written");
    const std::uint32_t number = pointer.component + index;
    const bool is_boolean = scalar.kind == TypeKind::boolean;
    llvm::Type* kind = is_boolean ? builder.getInt32Ty() : scalar_type(scalar);
    Component stored = value;
    if (is_boolean)
        stored = apply({value}, [&](auto v) {
            return builder.CreateZExt(v[0], like(v[0], kind));
        });
    const std::uint32_t per_lane = variable.is_uniform ? 1 : lanes;
    llvm::Type* held = variable.is_uniform ? kind : static_cast<llvm::Type*>(vector_of(kind));
    const auto put = [&](llvm::Value* address, llvm::Value* condition) {
        llvm::Value* values = variable.is_uniform ? narrow(stored, mask) : widen(stored);
        llvm::Value* lanes_on = variable.is_uniform ? condition : both(mask, condition);
        if (lanes_on && !is_all(lanes_on)) {
            llvm::Value* old = builder.CreateAlignedLoad(held, address, llvm::Align(variable.slot_bytes));
            values = select(lanes_on, values, old);
        }
        builder.CreateAlignedStore(values, address, llvm::Align(variable.slot_bytes));
    };
    if (!pointer.dynamic_component) {
        if (pointer.valid)
            if (const auto* never = llvm::dyn_cast<llvm::Constant>(pointer.valid.value); never && never->isNullValue())
                return;
        put(at_offset(variable.memory, std::int64_t{number} * variable.slot_bytes * per_lane),
            pointer.valid ? pointer.valid.value : nullptr);
        return;
    }
    const Component element = pointer.dynamic_component;
    if (element.is_uniform() && (!pointer.valid || pointer.valid.is_uniform())) {
        llvm::Value* safe = pointer.valid ? select(pointer.valid.value, element.value, int32(0)) : element.value;
        llvm::Value* offset =
            builder.CreateMul(builder.CreateAdd(safe, int32(number)), int32(variable.slot_bytes * per_lane));
        put(builder.CreateGEP(builder.getInt8Ty(), variable.memory, builder.CreateZExt(offset, builder.getInt64Ty())),
            pointer.valid ? pointer.valid.value : nullptr);
        return;
    }
    if (variable.is_uniform) reject("a variable held to be uniform is written at different places");
    llvm::Value* numbers = builder.CreateAdd(widen(element), splat(int32(number)));
    llvm::Value* places =
        builder.CreateGEP(builder.getInt8Ty(), variable.memory, lane_offsets(variable, numbers, kind));
    builder.CreateMaskedScatter(widen(stored), places, llvm::Align(std::min(4u, kind->getScalarSizeInBits() / 8)),
                                both(mask, pointer.valid ? pointer.valid.value : nullptr));
}

void Emitter::visit_layout(const Pointer& pointer, Id type_id, std::int64_t extra,
                           const std::function<void(const Pointer&, std::int64_t, const Type&)>& visit) {
    const Type& type = module.type(type_id);
    const bool is_tight = pointer.storage == StorageClass::Workgroup;
    switch (type.kind) {
        case TypeKind::boolean: case TypeKind::integer: case TypeKind::floating: visit(pointer, extra, type); return;
        case TypeKind::vector: {
            const Type& scalar = module.type(type.element);
            const std::int64_t step = pointer.component_stride           ? pointer.component_stride
                                      : scalar.kind == TypeKind::boolean ? 4
                                                                         : scalar.bits / 8;
            for (std::uint32_t i = 0; i < type.count; ++i) visit(pointer, extra + i * step, scalar);
            return;
        }
        case TypeKind::matrix: {
            const Type& column = module.type(type.element);
            const std::int64_t scalar = module.type(column.element).bits / 8;
            const bool has_stride = pointer.matrix_stride && !is_tight;
            const std::int64_t stride = has_stride ? pointer.matrix_stride : column.count * scalar;
            const bool by_rows = has_stride && pointer.row_major;
            Pointer inner = pointer;
            inner.component_stride = by_rows ? static_cast<std::uint32_t>(stride) : 0;
            for (std::uint32_t i = 0; i < type.count; ++i)
                visit_layout(inner, type.element, extra + i * (by_rows ? scalar : stride), visit);
            return;
        }
        case TypeKind::array: {
            const std::int64_t step = is_tight || type.array_stride == 0
                                          ? static_cast<std::int64_t>(module.tight_size(type.element))
                                          : type.array_stride;
            for (std::uint32_t i = 0; i < type.count; ++i) visit_layout(pointer, type.element, extra + i * step, visit);
            return;
        }
        case TypeKind::structure:
            for (std::uint32_t i = 0; i < type.members.size(); ++i) {
                const Member& member = type.members[i];
                Pointer inner = pointer;
                inner.row_major = member.row_major, inner.matrix_stride = member.matrix_stride,
                inner.component_stride = 0;
                visit_layout(
                    inner, member.type,
                    extra + (is_tight ? static_cast<std::int64_t>(module.tight_offset(type_id, i)) : member.offset),
                    visit);
            }
            return;
        default: reject("a value of a type without size lies in memory");
    }
}

std::vector<Component> Emitter::load(const Pointer& pointer) {
    std::vector<Component> values;
    if (options.checks) check_range(pointer);
    if (module.type(pointer.type).components > most_direct_components * 16)
        reject(fmt::format("a value of {} scalars is loaded at once", module.type(pointer.type).components));
    if (pointer.kind == Pointer::Kind::lanes) {
        std::uint32_t index = 0;
        for_each_component_type(pointer.type, [&](const Type& scalar) {
            values.push_back(load_lane_component(pointer, index, scalar));
            if (pointer.variable->undefined)
                values.back().undefined = load_lane_component(undefined_of(pointer), index, boolean_type()).value;
            ++index;
        });
        if (follows_undefined() && pointer.storage == StorageClass::Input) note_input(pointer, values);
    } else if (pointer.kind == Pointer::Kind::bytes) {
        // Each word has a shadow of doubles or of what is undefined, and speed does not matter.
        if (!in_double() && !follows_undefined()) {
            if (auto rows = load_rows(pointer)) return std::move(*rows);
            if (auto equal = load_where_equal(pointer)) return std::move(*equal);
        }
        visit_layout(pointer, pointer.type, 0, [&](const Pointer& at, std::int64_t extra, const Type& scalar) {
            values.push_back(load_bytes(at, extra, scalar));
            if (follows_undefined()) note_read(at, extra, scalar, values.back());
        });
    } else {
        reject("a resource is loaded as a value");
    }
    return values;
}

void Emitter::store(const Pointer& pointer, const std::vector<Component>& values) {
    std::size_t index = 0;
    if (options.checks) check_range(pointer), note_store(pointer);
    if (pointer.kind == Pointer::Kind::lanes) {
        for_each_component_type(pointer.type, [&](const Type& scalar) {
            const auto number = static_cast<std::uint32_t>(index);
            store_lane_component(pointer, number, scalar, values.at(index));
            if (llvm::Value* undefined = values[index].undefined; pointer.variable->undefined)
                store_lane_component(undefined_of(pointer), number, boolean_type(),
                                     Component(undefined ? undefined : builder.getFalse()));
            ++index;
        });
    } else if (pointer.kind == Pointer::Kind::bytes) {
        if (!in_double() && !follows_undefined() && store_rows(pointer, values)) return;
        visit_layout(pointer, pointer.type, 0, [&](const Pointer& at, std::int64_t extra, const Type& scalar) {
            if (follows_undefined()) note_write(at, extra, scalar, values.at(index));
            store_bytes(at, extra, scalar, values.at(index++));
        });
    } else {
        reject("a resource is written");
    }
}

llvm::Value* Emitter::effect_mask() {
    if (!live_slot) return mask;
    return both(mask, live());
}

llvm::Value* Emitter::zeros() {
    auto*& made = shared_["zeros"];
    if (!made) {
        auto* type = llvm::ArrayType::get(builder.getInt64Ty(), 1);
        made = new llvm::GlobalVariable(target, type, true, llvm::GlobalValue::InternalLinkage,
                                        llvm::Constant::getNullValue(type), "zeros");
    }
    return made;
}

void Emitter::declare_variables() {
    for (const auto& [id, variable] : module.variables())
        if (variable.storage == StorageClass::Workgroup) {
            workgroup_offsets[id] = workgroup_variable_bytes;
            workgroup_variable_bytes += (module.tight_size(variable.type) + 15) / 16 * 16;
        }
    if (workgroup_variable_bytes > most_workgroup_bytes)
        reject(fmt::format("the variables of a workgroup take {} bytes; {} are the most", workgroup_variable_bytes,
                           most_workgroup_bytes));
    if (in_double()) {
        workgroup_shadow_offset = static_cast<std::int64_t>(workgroup_variable_bytes);
        workgroup_variable_bytes *= 3;
    }
    // Inputs are made here, where everything that follows can see them.
    for (const Id id : module.interface())
        if (const Variable* variable = module.variable(id); variable && variable->storage == StorageClass::Input)
            pointer_to(id);
    // Content of variables starts as the initializer says, or as zero: undefined would do, but not in every lane alike.
    for (const auto& [id, variable] : module.variables()) {
        if (variable.storage != StorageClass::Private && variable.storage != StorageClass::Output) continue;
        if (variable.storage == StorageClass::Output &&
            std::ranges::find(module.interface(), id) == module.interface().end())
            continue;  // Of another entry point.
        if (is_ray_query(variable.type)) {
            clear_ray_query(id);
            continue;
        }
        LaneVariable& made = make_lane_variable(id, variable.type, !uniformity.has_divergent_content(id));
        if (module.constant_content(id)) continue;
        std::vector<Component> initial;
        if (variable.initializer) initial = get_components(variable.initializer);
        else if (module.type(variable.type).components <= most_direct_components)
            for_each_component_type(variable.type,
                                    [&](const Type& scalar) { initial.push_back(undefined_value(scalar)); });
        fill(made, initial);
        if (made.undefined) mark_undefined(made, !variable.initializer);
    }
    share_environment();
}

bool Emitter::emit_memory(const Instruction& at) {
    switch (at.op) {
        case Op::OpVariable: {
            if (is_ray_query(module.variable(at.result)->type)) {
                clear_ray_query(at.result);
                return true;
            }
            LaneVariable& variable = make_lane_variable(at.result, module.variable(at.result)->type,
                                                        !uniformity.has_divergent_content(at.result));
            if (module.constant_content(at.result)) return true;
            if (at.operand(1)) {
                Pointer pointer = pointer_to(at.result);
                store(pointer, get_components(at.operand(1)));
            } else if (const Type& type = module.type(variable.type); type.components <= 64) {
                // In loops and repeated calls: not what an earlier round left there.
                std::vector<Component> initial;
                for_each_component_type(variable.type,
                                        [&](const Type& scalar) { initial.push_back(undefined_value(scalar)); });
                if (!follows_undefined() || frame->function == &module.entry()) fill(variable, initial);
            }
            if (!at.operand(1) && variable.undefined) mark_undefined(variable);
            return true;
        }
        case Op::OpAccessChain:
        case Op::OpInBoundsAccessChain:
        case Op::OpPtrAccessChain:
        case Op::OpInBoundsPtrAccessChain: {
            Pointer pointer = get_pointer(at.operand(0));
            const bool steps = at.op == Op::OpPtrAccessChain || at.op == Op::OpInBoundsPtrAccessChain;
            if (steps) pointer = step(std::move(pointer), module.type(module.type_of(at.operand(0))), at.operand(1));
            for (const Id index : at.operands.subspan(steps ? 2 : 1)) pointer = access(std::move(pointer), index);
            define(at.result).pointer = std::make_shared<Pointer>(std::move(pointer));
            finish_definition(at.result);
            return true;
        }
        case Op::OpLoad: {
            const Pointer from = get_pointer(at.operand(0));
            const Type& type = module.type(at.type);
            if (type.is_opaque()) {
                const Component address = descriptor(from);
                Value& value = define(at.result);
                value.image = address, value.sampler = address;
                value.image_root = from.root;
                value.image_type = type.kind == TypeKind::sampled_image ? type.element : at.type;
                finish_definition(at.result);
                return true;
            }
            set(at, load(from));
            return true;
        }
        case Op::OpSelect:
            if (module.type(at.type).kind != TypeKind::pointer) return false;
            set_pointer(at, evaluate(at.op, at.type, at.operands, at.result), at.operand(1));
            return true;
        case Op::OpPtrEqual:
        case Op::OpPtrNotEqual:
        case Op::OpPtrDiff: {
            const auto address = [&](Id id) {
                const std::vector<Component> parts = get_components(id);
                return apply({parts.at(0), parts.at(2)}, [&](auto v) {
                    return builder.CreateAdd(v[0], builder.CreateSExt(v[1], v[0]->getType()));
                });
            };
            const Type& kind = module.type(module.type_of(at.operand(0)));
            const std::int64_t stride =
                std::max<std::int64_t>(1, kind.array_stride && kind.storage != StorageClass::Workgroup
                                              ? std::int64_t{kind.array_stride}
                                              : static_cast<std::int64_t>(module.tight_size(kind.element)));
            set(at, {apply({address(at.operand(0)), address(at.operand(1))}, [&](auto v) -> llvm::Value* {
                    if (at.op != Op::OpPtrDiff)
                        return builder.CreateICmp(
                            at.op == Op::OpPtrEqual ? llvm::CmpInst::ICMP_EQ : llvm::CmpInst::ICMP_NE, v[0], v[1]);
                    llvm::Value* elements = builder.CreateSDiv(builder.CreateSub(v[0], v[1]),
                                                               llvm::ConstantInt::getSigned(v[0]->getType(), stride));
                    return builder.CreateSExtOrTrunc(elements, like(v[0], scalar_type(module.type(at.type))));
                })});
            return true;
        }
        case Op::OpStore: {
            if (module.constant_content(at.operand(0))) return true;
            const std::vector<Component> values = get_components(at.operand(1));
            if (trace_table) trace(at, trace_root(at.operand(0)), {at.operand(1)}, values);
            store(get_pointer(at.operand(0)), values);
            return true;
        }
        case Op::OpCopyMemory: {
            const Pointer from = get_pointer(at.operand(1));
            if (module.type(from.type).components > Module::max_components)
                reject("a copy of too many scalars; copy a part");
            store(get_pointer(at.operand(0)), load(from));
            return true;
        }
        case Op::OpArrayLength: {
            // Of the last member of the block that the pointer leads to.
            Pointer block = get_pointer(at.operand(0));
            const Type& type = module.type(block.type);
            const Member& member = type.members.at(at.operand(1));
            const std::uint32_t stride = std::max(1u, module.type(member.type).array_stride);
            const std::int64_t begin = block.offset + member.offset;
            const Component moved = block.dynamic_offset ? block.dynamic_offset : Component(int32(0));
            set(at, {apply({block.limit, moved}, [&](auto v) {
                    llvm::Value* first =
                        builder.CreateAdd(builder.CreateZExt(v[1], v[0]->getType()),
                                          llvm::ConstantInt::get(v[0]->getType(), static_cast<std::uint64_t>(begin)));
                    llvm::Value* room =
                        builder.CreateSelect(builder.CreateICmpUGE(v[0], first), builder.CreateSub(v[0], first),
                                             llvm::Constant::getNullValue(v[0]->getType()));
                    llvm::Value* count = builder.CreateUDiv(room, llvm::ConstantInt::get(v[0]->getType(), stride));
                    return builder.CreateTrunc(count, like(v[0], builder.getInt32Ty()));
                })});
            return true;
        }
        default: return false;
    }
}

}  // namespace nacre::cpu
