// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>
#include <llvm/IR/Intrinsics.h>

#include "backends/cpu/compiler/emitter.h"

namespace nacre::cpu {

using spv::Op;

void Emitter::for_each_lane(llvm::Value* lanes_on, const std::function<void(llvm::Value*)>& body) {
    // Peels off the lowest bit of the mask until none is left.
    llvm::BasicBlock* before = builder.GetInsertBlock();
    llvm::BasicBlock* loop = llvm::BasicBlock::Create(context, "each_lane", function_);
    llvm::BasicBlock* after = llvm::BasicBlock::Create(context, "all_lanes_done", function_);
    llvm::Value* bits = mask_bits(lanes_on);
    builder.CreateCondBr(builder.CreateICmpNE(bits, int32(0)), loop, after);
    builder.SetInsertPoint(loop);
    llvm::PHINode* rest = builder.CreatePHI(builder.getInt32Ty(), 2, "rest");
    rest->addIncoming(bits, before);
    llvm::Value* lane =
        builder.CreateIntrinsic(llvm::Intrinsic::cttz, {builder.getInt32Ty()}, {rest, builder.getTrue()});
    body(lane);
    llvm::Value* fewer = builder.CreateAnd(rest, builder.CreateSub(rest, int32(1)));
    rest->addIncoming(fewer, builder.GetInsertBlock());
    builder.CreateCondBr(builder.CreateICmpNE(fewer, int32(0)), loop, after);
    builder.SetInsertPoint(after);
}

void Emitter::for_each_different(const Component& address, llvm::Value* lanes_on,
                                 const std::function<void(llvm::Value*, llvm::Value*)>& body) {
    if (address.is_uniform()) return body(address.value, lanes_on);
    llvm::BasicBlock* before = builder.GetInsertBlock();
    llvm::BasicBlock* loop = llvm::BasicBlock::Create(context, "each_different", function_);
    llvm::BasicBlock* after = llvm::BasicBlock::Create(context, "all_different_done", function_);
    llvm::Type* bits_type = builder.getIntNTy(lanes);
    llvm::Value* start = builder.CreateBitCast(lanes_on, bits_type);
    builder.CreateCondBr(builder.CreateICmpNE(start, llvm::ConstantInt::get(bits_type, 0)), loop, after);
    builder.SetInsertPoint(loop);
    llvm::PHINode* rest = builder.CreatePHI(bits_type, 2, "rest");
    rest->addIncoming(start, before);
    llvm::Value* rest_mask = builder.CreateBitCast(rest, mask_type);
    llvm::Value* one = builder.CreateExtractElement(address.value, first_lane(rest_mask));
    llvm::Value* same = builder.CreateAnd(rest_mask, builder.CreateICmpEQ(address.value, splat(one)));
    body(one, same);
    llvm::Value* fewer = builder.CreateAnd(rest, builder.CreateNot(builder.CreateBitCast(same, bits_type)));
    rest->addIncoming(fewer, builder.GetInsertBlock());
    builder.CreateCondBr(builder.CreateICmpNE(fewer, llvm::ConstantInt::get(bits_type, 0)), loop, after);
    builder.SetInsertPoint(after);
}

namespace {

/// Whether the order of the lanes makes no difference to what an operation leaves behind.
bool can_combine(llvm::AtomicRMWInst::BinOp operation, llvm::Type* kind) {
    using Operation = llvm::AtomicRMWInst::BinOp;
    switch (operation) {
        case Operation::Add:
        case Operation::Sub:
        case Operation::And:
        case Operation::Or:
        case Operation::Xor:
        case Operation::Min:
        case Operation::Max:
        case Operation::UMin:
        case Operation::UMax: return kind->isIntegerTy();
        default: return false;
    }
}

}  // namespace

llvm::Value* Emitter::combine(llvm::AtomicRMWInst::BinOp operation, llvm::Value* old, llvm::Value* value) {
    using Operation = llvm::AtomicRMWInst::BinOp;
    const auto pick = [&](llvm::CmpInst::Predicate better) {
        return builder.CreateSelect(builder.CreateICmp(better, old, value), old, value);
    };
    switch (operation) {
        case Operation::Xchg: return value;
        case Operation::Add: return builder.CreateAdd(old, value);
        case Operation::Sub: return builder.CreateSub(old, value);
        case Operation::And: return builder.CreateAnd(old, value);
        case Operation::Or: return builder.CreateOr(old, value);
        case Operation::Xor: return builder.CreateXor(old, value);
        case Operation::Min: return pick(llvm::CmpInst::ICMP_SLT);
        case Operation::Max: return pick(llvm::CmpInst::ICMP_SGT);
        case Operation::UMin: return pick(llvm::CmpInst::ICMP_ULT);
        case Operation::UMax: return pick(llvm::CmpInst::ICMP_UGT);
        default: reject("an atomic operation on integers is expected and another one is found");
    }
}

llvm::Value* Emitter::combine_lanes(llvm::AtomicRMWInst::BinOp operation, const Component& value,
                                    llvm::Value* lanes_on) {
    using Operation = llvm::AtomicRMWInst::BinOp;
    llvm::Type* kind = value.value->getType()->getScalarType();
    const unsigned bits = kind->getIntegerBitWidth();
    if (value.is_uniform()) {
        llvm::Value* count = builder.CreateZExtOrTrunc(
            builder.CreateUnaryIntrinsic(llvm::Intrinsic::ctpop, mask_bits(lanes_on)), kind);
        switch (operation) {
            case Operation::Add:
            case Operation::Sub: return builder.CreateMul(count, value.value);
            case Operation::Xor: return builder.CreateMul(builder.CreateAnd(count, 1), value.value);
            case Operation::Or:
            case Operation::And:
            case Operation::Min:
            case Operation::Max:
            case Operation::UMin:
            case Operation::UMax: return value.value;
            default: break;
        }
    }
    // What changes nothing stands in lanes that are off.
    const auto reduce = [&](const llvm::APInt& neutral, llvm::Intrinsic::ID intrinsic) {
        llvm::Value* none = llvm::ConstantInt::get(vector_of(kind), neutral);
        return builder.CreateIntrinsic(kind, intrinsic, {select(lanes_on, widen(value), none)});
    };
    const llvm::APInt zero(bits, 0);
    switch (operation) {
        case Operation::Add:
        case Operation::Sub: return reduce(zero, llvm::Intrinsic::vector_reduce_add);
        case Operation::Or: return reduce(zero, llvm::Intrinsic::vector_reduce_or);
        case Operation::Xor: return reduce(zero, llvm::Intrinsic::vector_reduce_xor);
        case Operation::And: return reduce(llvm::APInt::getAllOnes(bits), llvm::Intrinsic::vector_reduce_and);
        case Operation::Min: return reduce(llvm::APInt::getSignedMaxValue(bits), llvm::Intrinsic::vector_reduce_smin);
        case Operation::Max: return reduce(llvm::APInt::getSignedMinValue(bits), llvm::Intrinsic::vector_reduce_smax);
        case Operation::UMin: return reduce(llvm::APInt::getMaxValue(bits), llvm::Intrinsic::vector_reduce_umin);
        case Operation::UMax: return reduce(zero, llvm::Intrinsic::vector_reduce_umax);
        default: reject("an atomic operation is expected in which the order of the lanes makes no difference");
    }
}

bool Emitter::emit_atomic(const Instruction& at) {
    using Operation = llvm::AtomicRMWInst::BinOp;
    std::optional<Operation> operation;
    AtomicOperation image_operation = AtomicOperation::add;
    bool is_load = false, is_store = false, is_exchange_if = false, is_constant_one = false, is_negated = false;
    switch (at.op) {
        case Op::OpAtomicLoad: is_load = true; break;
        case Op::OpAtomicStore: is_store = true; break;
        case Op::OpAtomicExchange: operation = Operation::Xchg, image_operation = AtomicOperation::exchange; break;
        case Op::OpAtomicCompareExchange:
            is_exchange_if = true, image_operation = AtomicOperation::compare_exchange;
            break;
        case Op::OpAtomicIIncrement: operation = Operation::Add, is_constant_one = true; break;
        case Op::OpAtomicIDecrement: operation = Operation::Sub, is_constant_one = is_negated = true; break;
        case Op::OpAtomicIAdd: operation = Operation::Add; break;
        case Op::OpAtomicISub: operation = Operation::Sub, is_negated = true; break;
        case Op::OpAtomicSMin: operation = Operation::Min, image_operation = AtomicOperation::minimum_signed; break;
        case Op::OpAtomicUMin: operation = Operation::UMin, image_operation = AtomicOperation::minimum_unsigned; break;
        case Op::OpAtomicSMax: operation = Operation::Max, image_operation = AtomicOperation::maximum_signed; break;
        case Op::OpAtomicUMax: operation = Operation::UMax, image_operation = AtomicOperation::maximum_unsigned; break;
        case Op::OpAtomicAnd: operation = Operation::And, image_operation = AtomicOperation::bit_and; break;
        case Op::OpAtomicOr: operation = Operation::Or, image_operation = AtomicOperation::bit_or; break;
        case Op::OpAtomicXor: operation = Operation::Xor, image_operation = AtomicOperation::bit_xor; break;
        case Op::OpAtomicFAddEXT: operation = Operation::FAdd, image_operation = AtomicOperation::add_float; break;
        case Op::OpAtomicFMinEXT: operation = Operation::FMin, image_operation = AtomicOperation::minimum_float; break;
        case Op::OpAtomicFMaxEXT: operation = Operation::FMax, image_operation = AtomicOperation::maximum_float; break;
        default: return false;
    }
    const Pointer pointer = get_pointer(at.operand(0));
    const Id value_type = is_store ? module.type_of(at.operand(3)) : at.type;
    const Type& scalar = module.type(value_type);
    const bool is_narrowed = in_double() && scalar.kind == TypeKind::floating && scalar.bits == 32;
    if (is_narrowed) note_narrowed("atomic operation");
    llvm::Type* kind = is_narrowed ? builder.getFloatTy() : scalar_type(scalar);
    const auto finish = [&](const Component& old) { set(at, {is_narrowed ? from_single(old) : old}); };
    Component value, comparator;
    if (is_store || (operation && !is_constant_one)) value = get_scalar(at.operand(3));
    if (is_constant_one) value = llvm::ConstantInt::get(kind, 1);
    if (is_exchange_if) value = get_scalar(at.operand(4)), comparator = get_scalar(at.operand(5));
    if (is_narrowed && value) value = to_single(value);

    if (pointer.kind == Pointer::Kind::texel) {
        image_root = pointer.root;
        if (is_negated) value = apply({value}, [&](auto v) { return builder.CreateNeg(v[0]); });
        if (is_load || is_store) {
            // Through the same path as a plain access: texels of atomics are 32 bits, which are read and written whole.
            std::vector<Component> texel;
            if (is_store) texel.push_back(value);
            texel = image_call(pointer.image_descriptor, Component(), pointer.image_type, pointer.coordinates,
                               static_cast<std::uint32_t>(is_load ? ImageOperation::load : ImageOperation::store) |
                                   image_integer_flag(pointer.image_type),
                               texel, pointer.sample);
            if (is_load) finish(from_word(texel.at(0), kind));
            return true;
        }
        set_image_atomic(image_operation, comparator);
        const std::vector<Component> old =
            image_call(pointer.image_descriptor, Component(), pointer.image_type, pointer.coordinates,
                       static_cast<std::uint32_t>(ImageOperation::atomic) | image_integer_flag(pointer.image_type),
                       {value}, pointer.sample);
        finish(from_word(old.at(0), kind));
        return true;
    }
    if (pointer.kind != Pointer::Kind::bytes) reject("an atomic operation on memory that is not shared");
    if (pointer.storage != spv::StorageClass::Workgroup && !is_load) has_side_effects = true;

    if (options.checks) check_range(pointer);
    if (follows_undefined())
        check_memory(
            pointer, 0, scalar,
            access_atomic | (is_load ? 0u : std::uint32_t{access_write}) | (is_store ? 0u : std::uint32_t{access_read}),
            nullptr);
    const Component ok = allowed(pointer, 0, scalar.bits / 8);
    llvm::Value* lanes_on = both(is_load ? mask : effect_mask(), ok ? ok.value : nullptr);
    llvm::Value* address = addresses(pointer, 0);
    const llvm::Align alignment(scalar.bits / 8);
    // All invocations of a workgroup run on one thread, one subgroup after another.
    const bool is_own =
        pointer.storage == spv::StorageClass::Workgroup && operation && scalar.kind == TypeKind::integer;
    const auto change = [&](llvm::Value* place, llvm::Value* by) -> llvm::Value* {
        if (!is_own)
            return builder.CreateAtomicRMW(*operation, place, by, alignment,
                                           llvm::AtomicOrdering::SequentiallyConsistent);
        llvm::Value* old = builder.CreateAlignedLoad(kind, place, alignment);
        builder.CreateAlignedStore(combine(*operation, old, by), place, alignment);
        return old;
    };
    const auto found_use = frame->shape->uses.find(at.result);
    const bool is_unused =
        at.result && !trace_table && found_use != frame->shape->uses.end() && !found_use->second.is_used;
    // Where nobody asks for the old values, lanes that mean one place change it once for all of them.
    if (is_unused && operation && can_combine(*operation, kind)) {
        const auto change_once = [&](llvm::Value* place, llvm::Value* of) {
            change(place, combine_lanes(*operation, value, of));
        };
        if (address->getType()->isVectorTy()) {
            for_each_different(Component(address), lanes_on, change_once);
        } else {
            llvm::BasicBlock* change_block = llvm::BasicBlock::Create(context, "change", function_);
            llvm::BasicBlock* after = llvm::BasicBlock::Create(context, "changed", function_);
            builder.CreateCondBr(any(lanes_on), change_block, after);
            builder.SetInsertPoint(change_block);
            change_once(address, lanes_on);
            builder.CreateBr(after);
            builder.SetInsertPoint(after);
        }
        finish(zero(scalar));
        return true;
    }
    // One lane after another, as a device with one invocation at a time would.
    llvm::AllocaInst* results = make_slot(vector_of(kind), "atomic");
    builder.CreateStore(llvm::Constant::getNullValue(vector_of(kind)), results);
    for_each_lane(lanes_on, [&](llvm::Value* lane) {
        const auto of_lane = [&](llvm::Value* x) {
            return x->getType()->isVectorTy() ? builder.CreateExtractElement(x, lane) : x;
        };
        llvm::Value* place = of_lane(address);
        llvm::Value* old = nullptr;
        if (is_load) {
            llvm::LoadInst* loaded = builder.CreateAlignedLoad(kind, place, alignment);
            loaded->setAtomic(llvm::AtomicOrdering::SequentiallyConsistent);
            old = loaded;
        } else if (is_store) {
            llvm::StoreInst* stored = builder.CreateAlignedStore(of_lane(value.value), place, alignment);
            stored->setAtomic(llvm::AtomicOrdering::SequentiallyConsistent);
        } else if (is_exchange_if) {
            llvm::Value* pair = builder.CreateAtomicCmpXchg(place, of_lane(comparator.value), of_lane(value.value),
                                                            alignment, llvm::AtomicOrdering::SequentiallyConsistent,
                                                            llvm::AtomicOrdering::SequentiallyConsistent);
            old = builder.CreateExtractValue(pair, 0);
        } else {
            old = change(place, of_lane(value.value));
        }
        if (old && !is_unused) {
            llvm::Value* all = builder.CreateLoad(vector_of(kind), results);
            builder.CreateStore(builder.CreateInsertElement(all, old, lane), results);
        }
    });
    if (at.result) finish(Component(builder.CreateLoad(vector_of(kind), results)));
    return true;
}

}  // namespace nacre::cpu
