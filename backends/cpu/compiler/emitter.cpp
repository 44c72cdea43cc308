// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/emitter.h"

#include <llvm/IR/Constants.h>
#include <llvm/IR/Intrinsics.h>

namespace nacre::cpu {

Emitter::Emitter(llvm::Module& into, const Module& from, const CompilerOptions& how, const MathOptions& how_math,
                 std::span<const BindingSlots> layout)
    : target(into), context(into.getContext()), module(from), options(how), slots(layout), lanes(how.lanes),
      builder(into.getContext()), math(builder, how_math), uniformity(from),
      mask_type(llvm::FixedVectorType::get(llvm::Type::getInt1Ty(into.getContext()), how.lanes)),
      pointer_type(llvm::PointerType::getUnqual(into.getContext())) {}

void Emitter::reject(std::string reason) const { throw EmitError{std::move(reason), current ? current->offset : 0}; }

llvm::Type* Emitter::scalar_type(const Type& type) {
    switch (type.kind) {
        case TypeKind::boolean: return builder.getInt1Ty();
        case TypeKind::integer: return builder.getIntNTy(type.bits);
        case TypeKind::floating:
            if (type.bits == 64 || in_double()) return builder.getDoubleTy();
            return type.bits == 16 ? builder.getHalfTy() : builder.getFloatTy();
        default: reject("a type without a value is used as one");
    }
}

void Emitter::for_each_component_type(Id id, const std::function<void(const Type&)>& visit) const {
    const Type& type = module.type(id);
    switch (type.kind) {
        case TypeKind::boolean:
        case TypeKind::integer:
        case TypeKind::floating: visit(type); break;
        case TypeKind::vector:
        case TypeKind::matrix:
        case TypeKind::array:
            for (std::uint32_t i = 0; i < type.count; ++i) for_each_component_type(type.element, visit);
            break;
        case TypeKind::structure:
            for (const Member& member : type.members) for_each_component_type(member.type, visit);
            break;
        case TypeKind::pointer:
            if (!type.components) reject("a type without a value is used as one");
            visit(module.type(pointer_word_type)), visit(module.type(pointer_word_type)),
                visit(module.type(pointer_offset_type));
            break;
        default: reject("a type without a value is used as one");
    }
}

Id Emitter::component_type(Id id, std::uint32_t index) const {
    for (;;) {
        const Type& type = module.type(id);
        switch (type.kind) {
            case TypeKind::vector:
            case TypeKind::matrix:
            case TypeKind::array: {
                const std::uint32_t each = std::max(1u, module.type(type.element).components);
                id = type.element, index %= each;
                break;
            }
            case TypeKind::structure: {
                std::size_t member = type.members.size() - 1;
                while (member > 0 && (type.members[member].first_component > index ||
                                      module.type(type.members[member].type).components == 0))
                    --member;
                id = type.members[member].type, index -= type.members[member].first_component;
                break;
            }
            case TypeKind::pointer: return index < 2 ? pointer_word_type : pointer_offset_type;
            default: return id;
        }
    }
}

llvm::Value* Emitter::splat(llvm::Value* scalar) { return builder.CreateVectorSplat(lanes, scalar); }

llvm::Value* Emitter::widen(const Component& component) {
    return component.is_uniform() ? splat(component.value) : component.value;
}

llvm::Value* Emitter::narrow(const Component& component, llvm::Value* lanes_on) {
    if (component.is_uniform()) return component.value;
    if (is_all(lanes_on)) return builder.CreateExtractElement(component.value, std::uint64_t{0});
    return builder.CreateExtractElement(component.value, first_lane(lanes_on));
}

llvm::Value* Emitter::lane_numbers() {
    std::vector<std::uint32_t> numbers(lanes);
    for (std::uint32_t i = 0; i < lanes; ++i) numbers[i] = i;
    return llvm::ConstantDataVector::get(context, numbers);
}

llvm::Value* Emitter::any(llvm::Value* lanes_on) {
    if (is_all(lanes_on)) return builder.getTrue();
    llvm::Type* bits = builder.getIntNTy(lanes);
    return builder.CreateICmpNE(builder.CreateBitCast(lanes_on, bits), llvm::ConstantInt::get(bits, 0));
}

llvm::Value* Emitter::mask_bits(llvm::Value* lanes_on) {
    return builder.CreateZExtOrTrunc(builder.CreateBitCast(lanes_on, builder.getIntNTy(lanes)), builder.getInt32Ty());
}

llvm::Value* Emitter::first_lane(llvm::Value* lanes_on) {
    // A bit above the lanes keeps the result defined where no lane is on; the index stays inside of the vector.
    llvm::Value* bits = builder.CreateOr(mask_bits(lanes_on), int32(1u << (lanes - 1)));
    return builder.CreateIntrinsic(llvm::Intrinsic::cttz, {builder.getInt32Ty()}, {bits, builder.getTrue()});
}

llvm::Value* Emitter::all_lanes() { return llvm::ConstantInt::getTrue(mask_type); }

bool Emitter::is_all(llvm::Value* lanes_on) {
    const auto* constant_mask = llvm::dyn_cast<llvm::Constant>(lanes_on);
    return constant_mask && constant_mask->isAllOnesValue();
}

llvm::Value* Emitter::select(llvm::Value* condition, llvm::Value* yes, llvm::Value* no) {
    if (yes == no) return yes;
    return builder.CreateSelect(condition, yes, no);
}

llvm::Value* Emitter::both(llvm::Value* lanes_on, llvm::Value* condition) {
    if (!condition) return lanes_on;
    llvm::Value* none = llvm::Constant::getNullValue(mask_type);
    if (!condition->getType()->isVectorTy()) return builder.CreateSelect(condition, lanes_on, none);
    if (is_all(lanes_on)) return condition;
    // A select and no `and`: the condition may be poison in lanes that are off.
    return builder.CreateSelect(lanes_on, condition, none);
}

llvm::AllocaInst* Emitter::make_slot(llvm::Type* type, const char* slot_name) {
    llvm::IRBuilder<> at(slot_block, slot_block->begin());
    llvm::AllocaInst* slot = at.CreateAlloca(type, nullptr, slot_name);
    slot->setAlignment(llvm::Align(type->isVectorTy() || type->isAggregateType() ? 64 : 8));
    return slot;
}

Component Emitter::apply(std::initializer_list<Component> arguments,
                         const std::function<llvm::Value*(std::span<llvm::Value* const>)>& function) {
    return apply(std::span(arguments.begin(), arguments.size()), function);
}

Component Emitter::apply(std::span<const Component> arguments,
                         const std::function<llvm::Value*(std::span<llvm::Value* const>)>& function) {
    bool is_uniform = true;
    for (const Component& argument : arguments) is_uniform = is_uniform && argument.is_uniform();
    std::vector<llvm::Value*> values;
    values.reserve(arguments.size());
    for (const Component& argument : arguments) values.push_back(is_uniform ? argument.value : widen(argument));
    Component result = function(values);
    if (follows_undefined()) spread_undefined(result, arguments);
    return result;
}

Component Emitter::linear(llvm::Value* base, std::int64_t stride) {
    std::vector<std::uint32_t> steps(lanes);
    for (std::uint32_t i = 0; i < lanes; ++i) steps[i] = i * static_cast<std::uint32_t>(stride);
    Component result = builder.CreateAdd(splat(base), llvm::ConstantDataVector::get(context, steps));
    result.linear_base = base;
    result.linear_stride = Component::wrapped(static_cast<std::uint64_t>(stride));
    return result;
}

Component Emitter::add(const Component& a, const Component& b) {
    if (!a) return b;
    if (!b) return a;
    Component sum = apply({a, b}, [&](auto v) { return builder.CreateAdd(v[0], v[1]); });
    if (a.linear_base && b.is_uniform())
        sum.linear_base = builder.CreateAdd(a.linear_base, b.value), sum.linear_stride = a.linear_stride;
    else if (b.linear_base && a.is_uniform())
        sum.linear_base = builder.CreateAdd(b.linear_base, a.value), sum.linear_stride = b.linear_stride;
    else if (a.linear_base && b.linear_base)
        sum.linear_base = builder.CreateAdd(a.linear_base, b.linear_base),
        sum.linear_stride =
            Component::wrapped(static_cast<std::uint64_t>(std::int64_t{a.linear_stride} + b.linear_stride));
    return sum;
}

Component Emitter::multiply(const Component& a, std::int64_t factor) {
    if (!a || factor == 1) return a;
    Component product = apply({a}, [&](auto v) {
        return builder.CreateMul(v[0],
                                 llvm::ConstantInt::getSigned(v[0]->getType(), static_cast<std::int32_t>(factor)));
    });
    if (a.linear_base)
        product.linear_base = builder.CreateMul(a.linear_base, int32(factor)),
        product.linear_stride = Component::wrapped(a.linear_stride * static_cast<std::uint64_t>(factor));
    return product;
}

Component Emitter::logical_and(const Component& a, const Component& b) {
    if (!a) return b;
    if (!b) return a;
    return apply({a, b}, [&](auto v) { return builder.CreateAnd(v[0], v[1]); });
}

llvm::FunctionCallee Emitter::external(const char* symbol, llvm::Type* result, std::vector<llvm::Type*> arguments) {
    return target.getOrInsertFunction(symbol, llvm::FunctionType::get(result, arguments, false));
}

llvm::Value* Emitter::at_offset(llvm::Value* pointer, std::int64_t bytes) {
    return bytes == 0 ? pointer : builder.CreateGEP(builder.getInt8Ty(), pointer, int64(bytes));
}

llvm::Value* Emitter::invariant_load(llvm::Type* type, llvm::Value* address, unsigned alignment) {
    llvm::LoadInst* value = builder.CreateAlignedLoad(type, address, llvm::Align(alignment));
    value->setMetadata(llvm::LLVMContext::MD_invariant_load, llvm::MDNode::get(context, {}));
    return value;
}

llvm::Value* Emitter::load_context(std::size_t offset, llvm::Type* type) {
    return invariant_load(type, at_offset(shader_context, static_cast<std::int64_t>(offset)),
                          type->isPointerTy() ? 8 : 4);
}

llvm::Type* Emitter::like(llvm::Value* shape, llvm::Type* scalar) {
    return shape->getType()->isVectorTy() ? static_cast<llvm::Type*>(vector_of(scalar)) : scalar;
}

void Emitter::emit_batches(std::uint32_t pointers, std::size_t batch_bytes,
                           const std::function<void(llvm::Value* batch)>& body) {
    std::vector<llvm::Type*> arguments(pointers, pointer_type);
    arguments.push_back(builder.getInt32Ty());
    auto* type = llvm::FunctionType::get(builder.getVoidTy(), arguments, false);
    function_ = llvm::Function::Create(type, llvm::Function::ExternalLinkage, "kernel", target);
    shader_context = function_->getArg(0);
    llvm::Value *batches = function_->getArg(pointers - 1), *count = function_->getArg(pointers);
    slot_block = llvm::BasicBlock::Create(context, "slots", function_);
    llvm::BasicBlock* start = llvm::BasicBlock::Create(context, "start", function_);
    llvm::BasicBlock* loop = llvm::BasicBlock::Create(context, "batch", function_);
    llvm::BasicBlock* done = llvm::BasicBlock::Create(context, "done", function_);
    builder.SetInsertPoint(start);
    builder.CreateCondBr(builder.CreateICmpNE(count, int32(0)), loop, done);
    builder.SetInsertPoint(loop);
    llvm::PHINode* number = builder.CreatePHI(builder.getInt32Ty(), 2, "batch");
    number->addIncoming(int32(0), start);
    body(builder.CreateGEP(builder.getInt8Ty(), batches,
                           builder.CreateMul(builder.CreateZExt(number, builder.getInt64Ty()),
                                             int64(static_cast<std::int64_t>(batch_bytes)))));
    llvm::Value* next = builder.CreateAdd(number, int32(1));
    number->addIncoming(next, builder.GetInsertBlock());
    builder.CreateCondBr(builder.CreateICmpULT(next, count), loop, done);
    builder.SetInsertPoint(done);
    builder.CreateRetVoid();
    builder.SetInsertPoint(slot_block);
    builder.CreateBr(start);
}

}  // namespace nacre::cpu
