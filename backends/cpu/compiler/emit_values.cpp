// SPDX-License-Identifier: Apache-2.0
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
            llvm::Constant* word = llvm::ConstantInt::get(integer, type.bits < 64 ? bits & ((1ull << type.bits) - 1) : bits);
            value.components = {type.kind == TypeKind::floating
                                    ? llvm::ConstantExpr::getBitCast(word, scalar_type(type))
                                    : word};
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
            break;
        case Op::OpUndef:
        case Op::OpConstantNull:
        default:
            if (type.kind == TypeKind::pointer) reject("null pointers are not supported");
            for_each_component_type(at.type, [&](const Type& scalar) {
                value.components.push_back(at.op == Op::OpUndef ? undefined_value(scalar) : zero(scalar));
            });
    }
    constants_.emplace(id, value);
    return value;
}

Value& Emitter::define(Id id) { return frame->values[id]; }

Value Emitter::get(Id id) {
    if (module.constant(id)) return constant(id);
    if (module.variable(id)) {
        Value value;
        value.pointer = std::make_shared<Pointer>(pointer_to(id));
        return value;
    }
    const auto found = frame->values.find(id);
    if (found == frame->values.end()) reject("a value is used before it is defined");
    const auto definition = frame->definitions.find(id);
    if (definition == frame->definitions.end()) return found->second;  // A parameter.
    const Frame::Definition& where = definition->second;
    const std::uint32_t loop = frame->blocks[where.block].divergent_loop;
    bool is_outside = false;
    if (loop != ~0u && !where.outside_slots.empty())
        is_outside = frame->block < loop || frame->block >= end_of_construct(*frame->function, loop);
    const bool is_open =
        std::ranges::find(frame->chains, where.chain) != frame->chains.end() || where.block == frame->block;
    if (is_open && !is_outside) return found->second;
    if (found->second.pointer || found->second.image || found->second.sampler) {
        // Made again here: what it was made from dominates nothing, but its operands can be had.
        const Block& block = frame->function->blocks[where.block];
        for (const Instruction& at : block.body) {
            if (at.result != id) continue;
            const Value saved = found->second;
            const Frame::Definition saved_definition = where;
            const Instruction* const outer = current;
            emit_instruction(at);
            current = outer;
            Value made = frame->values.at(id);
            frame->values[id] = saved;
            frame->definitions[id] = saved_definition;
            return made;
        }
        reject("a pointer is used where it cannot be made again");
    }
    Value value = found->second;
    const auto& slots_of = is_outside ? where.outside_slots : where.slots;
    for (std::size_t i = 0; i < value.components.size(); ++i)
        if (i < slots_of.size() && slots_of[i]) {
            Component loaded(builder.CreateLoad(slots_of[i]->getAllocatedType(), slots_of[i]));
            if (!is_outside && i < where.linear_slots.size() && where.linear_slots[i]) {
                loaded.linear_base = builder.CreateLoad(builder.getInt32Ty(), where.linear_slots[i]);
                loaded.linear_stride = value.components[i].linear_stride;
            }
            if (!is_outside && i < where.undefined_slots.size() && where.undefined_slots[i])
                loaded.undefined = builder.CreateLoad(where.undefined_slots[i]->getAllocatedType(), where.undefined_slots[i]);
            value.components[i] = loaded;
        }
    return value;
}

void Emitter::set(const Instruction& at, std::vector<Component> components) {
    // What the analysis holds for uniform is kept as a scalar, so that slots and branches can rely on it.
    if (!uniformity.is_divergent(at.result))
        for (Component& component : components)
            if (!component.is_uniform()) {
                llvm::Value* undefined = component.undefined;
                component = Component(narrow(component, mask));
                component.undefined = undefined ? any(both(mask, undefined)) : nullptr;
            }
    define(at.result).components = std::move(components);
    finish_definition(at.result);
}

void Emitter::finish_definition(Id id) {
    Frame::Definition definition;
    definition.block = frame->block;
    definition.chain = frame->chains.back();
    Value& value = frame->values[id];
    if (frame->crossing.contains(id) && !value.components.empty()) {
        definition.slots.reserve(value.components.size());
        const bool differs = frame->leaving.contains(id);
        for (const Component& component : value.components) {
            if (llvm::isa<llvm::Constant>(component.value)) {
                definition.slots.push_back(nullptr);
                definition.outside_slots.push_back(nullptr);
                continue;
            }
            llvm::AllocaInst* slot = make_slot(component.value->getType(), "value");
            builder.CreateStore(component.value, slot);
            definition.slots.push_back(slot);
            if (component.undefined) {
                definition.undefined_slots.resize(definition.slots.size());
                llvm::AllocaInst* undefined = make_slot(component.undefined->getType(), "undefined");
                builder.CreateStore(component.undefined, undefined);
                definition.undefined_slots.back() = undefined;
            }
            if (component.linear_base && component.linear_base->getType()->isIntegerTy(32)) {
                definition.linear_slots.resize(value.components.size());
                llvm::AllocaInst*& base = definition.linear_slots[definition.slots.size() - 1];
                base = make_slot(builder.getInt32Ty(), "linear");
                builder.CreateStore(component.linear_base, base);
            }
            if (!differs) continue;
            // Lanes that have left the loop keep what they had.
            llvm::Type* wide = component.is_uniform() ? vector_of(component.value->getType()) : component.value->getType();
            llvm::AllocaInst* outside = make_slot(wide, "left");
            llvm::Value* old = builder.CreateLoad(wide, outside);
            builder.CreateStore(select(mask, widen(component), old), outside);
            definition.outside_slots.push_back(outside);
        }
        if (!differs) definition.outside_slots.clear();
    }
    frame->definitions[id] = std::move(definition);
}

}  // namespace nacre::cpu
