// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include <fmt/format.h>
#include <llvm/IR/Constants.h>

#include "backends/cpu/checks/check_functions.h"
#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;

Component Emitter::zero(const Type& scalar) { return llvm::Constant::getNullValue(scalar_type(scalar)); }

Component Emitter::undefined_value(const Type& scalar) {
    Component value = zero(scalar);
    if (looks_for(check_hostile) && scalar.kind != TypeKind::boolean) {
        const llvm::APInt bits(scalar.bits, poison_word(0) * 0x100000001ull);
        value = scalar.kind == TypeKind::floating
                    ? llvm::ConstantFP::get(context, llvm::APFloat(value.value->getType()->getFltSemantics(), bits))
                    : static_cast<llvm::Value*>(llvm::ConstantInt::get(context, bits));
    }
    if (follows_undefined()) value.undefined = builder.getTrue();
    return value;
}

Value Emitter::constant(Id id) {
    if (const auto found = constants_.find(id); found != constants_.end()) return found->second;
    const Instruction& at = *module.constant(id);
    Value value;
    const Type& type = module.type(at.type);
    switch (at.op) {
        case Op::OpConstantTrue:
        case Op::OpSpecConstantTrue: value.components = {builder.getTrue()}; break;
        case Op::OpConstantFalse:
        case Op::OpSpecConstantFalse: value.components = {builder.getFalse()}; break;
        case Op::OpConstant:
        case Op::OpSpecConstant: {
            std::uint64_t bits = at.operand(0);
            if (type.bits == 64) bits |= std::uint64_t{at.operand(1)} << 32;
            llvm::Type* integer = builder.getIntNTy(type.bits);
            llvm::Constant* word =
                llvm::ConstantInt::get(integer, type.bits < 64 ? bits & ((1ull << type.bits) - 1) : bits);
            value.components = {word};
            if (type.kind == TypeKind::floating) {
                llvm::APFloat number(type.bits == 16   ? llvm::APFloat::IEEEhalf()
                                     : type.bits == 32 ? llvm::APFloat::IEEEsingle()
                                                       : llvm::APFloat::IEEEdouble(),
                                     word->getUniqueInteger());
                bool is_inexact = false;
                if (in_double())
                    number.convert(llvm::APFloat::IEEEdouble(), llvm::APFloat::rmNearestTiesToEven, &is_inexact);
                value.components = {llvm::ConstantFP::get(context, number)};
            }
            break;
        }
        case Op::OpConstantComposite:
        case Op::OpSpecConstantComposite:
            for (const Id part : at.operands) {
                const Value inner = get(part);
                value.components.insert(value.components.end(), inner.components.begin(), inner.components.end());
            }
            break;
        case Op::OpSpecConstantOp:
            value.components = evaluate(static_cast<Op>(at.operand(0)), at.type, at.operands.subspan(1), id);
            if (value.components.empty())
                value.components = evaluate_composite(static_cast<Op>(at.operand(0)), at.type, at.operands.subspan(1));
            if (value.components.empty())
                reject(fmt::format("a specialization constant is made by opcode {}, which is not supported",
                                   at.operand(0)));
            // Instructions stand for it only here.
            for (const Component& component : value.components)
                if (!llvm::isa<llvm::Constant>(component.value)) return value;
            break;
        case Op::OpUndef:
        case Op::OpConstantNull:
        default:
            for_each_component_type(at.type, [&](const Type& scalar) {
                value.components.push_back(at.op == Op::OpUndef ? undefined_value(scalar) : zero(scalar));
            });
    }
    constants_.emplace(id, value);
    return value;
}

Value& Emitter::define(Id id) { return id == remade_ ? remade_value_ : frame->values[id]; }

Value Emitter::get(Id id) {
    if (module.constant(id)) return constant(id);
    if (module.variable(id)) {
        Value value;
        value.pointer = std::make_shared<Pointer>(pointer_to(id));
        return value;
    }
    const auto found = frame->values.find(id);
    if (found == frame->values.end()) reject("a value is used before it is defined");
    const auto use = frame->shape->uses.find(id);
    if (use == frame->shape->uses.end() || !use->second.is_leaving) return found->second;  // Or a parameter.
    const std::uint32_t loop = frame->shape->blocks[use->second.home].divergent_loop;
    if (frame->block >= loop && frame->block < frame->shape->blocks[loop].end) return found->second;
    Value value = found->second;
    if (!use->second.is_remade) {
        const std::vector<llvm::Value*>& outside = frame->values_outside.at(id);
        for (std::size_t i = 0; i < value.components.size(); ++i) value.components[i] = Component(outside.at(i));
        return value;
    }
    // Made again here, where its operands have the values that each lane left the loop with.
    for (const Instruction& at : frame->function->blocks[use->second.home].body) {
        if (at.result != id) continue;
        const Id outer = std::exchange(remade_, id);
        const Value outer_value = std::exchange(remade_value_, Value());
        const Instruction* const outer_instruction = current;
        emit_instruction(at);
        current = outer_instruction;
        remade_ = outer;
        return std::exchange(remade_value_, outer_value);
    }
    reject("a pointer is used where it cannot be made again");
}

Pointer Emitter::get_pointer(Id id) {
    const Value value = get(id);
    if (value.pointer) return *value.pointer;
    const Type& type = module.type(module.type_of(id));
    if (type.kind != TypeKind::pointer || value.components.size() != 3)
        reject("a pointer is expected and something else is found");
    Pointer pointer;
    pointer.storage = type.storage, pointer.type = type.element;
    pointer.base =
        apply({value.components[0]}, [&](auto v) { return builder.CreateIntToPtr(v[0], like(v[0], pointer_type)); });
    pointer.limit = value.components[1];
    pointer.dynamic_offset = value.components[2];
    pointer.needs_limit_check = true;
    if (value.origin) {
        pointer.row_major = value.origin->row_major, pointer.matrix_stride = value.origin->matrix_stride;
        pointer.component_stride = value.origin->component_stride;
    }
    return pointer;
}

std::vector<Component> Emitter::get_components(Id id) {
    Value value = get(id);
    return value.pointer ? components_of(*value.pointer) : std::move(value.components);
}

void Emitter::check_result(const Instruction& at, const std::vector<Component>& components) {
    if (!module.has_type(at.type)) return;
    const Type& type = module.type(at.type);
    if (!type.is_scalar() && type.kind != TypeKind::vector && type.kind != TypeKind::matrix) return;
    llvm::Type* expected = scalar_type(module.type(component_type(at.type, 0)));
    const auto is_other = [&](const Component& component) {
        return component.value && component.value->getType()->getScalarType() != expected;
    };
    if (components.size() != type.components || std::ranges::any_of(components, is_other))
        reject("the operands are not of the types that the result needs");
}

void Emitter::set(const Instruction& at, std::vector<Component> components) {
    check_result(at, components);
    // What the analysis holds for uniform is kept as a scalar, so that slots and branches can rely on it.
    if (!uniformity.is_divergent(at.result))
        for (Component& component : components)
            if (!component.is_uniform()) {
                llvm::Value* undefined = component.undefined;
                component = Component(narrow(component, mask));
                component.undefined = undefined ? any(both(mask, undefined)) : nullptr;
            }
    trace_result(at, components);
    define(at.result).components = std::move(components);
    finish_definition(at.result);
}

void Emitter::set_pointer(const Instruction& at, std::vector<Component> components, Id origin) {
    if (origin) {
        const Value from = get(origin);
        define(at.result).origin = from.pointer ? from.pointer : from.origin;
    }
    set(at, std::move(components));
}

void Emitter::finish_definition(Id id) {
    if (id == remade_) return;
    const auto use = frame->shape->uses.find(id);
    if (use == frame->shape->uses.end() || use->second.last == use->second.home) return;
    // Used in other blocks: code that may be skipped, and this block with it, gives place to a phi behind it.
    Value& value = frame->values[id];
    const auto keep = [&](Component& component) {
        for (llvm::Value** place : {&component.value, &component.linear_base})
            if (*place) frame->changes.push_back({place, nullptr, nullptr, use->second.last});
        if (component.undefined) {
            llvm::Value* nothing = llvm::Constant::getNullValue(component.undefined->getType());
            frame->changes.push_back({&component.undefined, nullptr, nothing, use->second.last});
        }
    };
    for (Component& component : value.components) keep(component);
    keep(value.image), keep(value.sampler);
    if (value.pointer) {
        auto own = std::make_shared<Pointer>(*value.pointer);
        for (Component* part :
             {&own->valid, &own->dynamic_component, &own->base, &own->shadow, &own->limit, &own->dynamic_offset,
              &own->descriptor_index, &own->descriptor_address, &own->image_descriptor, &own->sample})
            keep(*part);
        for (Pointer::Index& at : own->indices) keep(at.index), keep(at.bound);
        for (Component& coordinate : own->coordinates) keep(coordinate);
        value.pointer = std::move(own);
    }
    if (!use->second.is_leaving || use->second.is_remade) return;
    // Lanes that have left the loop keep what they had.
    std::vector<llvm::Value*>& outside = frame->values_outside[id];
    outside.resize(value.components.size());
    for (std::size_t i = 0; i < outside.size(); ++i) {
        llvm::Value* all = widen(value.components[i]);
        assign(outside[i], outside[i] ? select(mask, all, outside[i]) : all, nullptr, use->second.last);
    }
}

}  // namespace nacre::cpu
