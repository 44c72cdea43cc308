// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>

#include "backends/cpu/compiler/emitter.h"

/// @file
/// Floats as doubles (ExecutionMode::double_precision). In memory each word has a double beside it, its shadow: stores
/// write both, loads take the shadow where it rounds to the word. So a word that was written by another way (by the
/// host, as an integer, by an atomic) is never hidden by an older shadow that stands for something else.

namespace nacre::cpu {

Component Emitter::to_single(const Component& value) {
    if (!value.value->getType()->getScalarType()->isDoubleTy()) return value;
    return apply({value}, [&](auto v) { return builder.CreateFPTrunc(v[0], like(v[0], builder.getFloatTy())); });
}

Component Emitter::from_single(const Component& value) {
    if (!in_double()) return value;
    return apply({value}, [&](auto v) { return builder.CreateFPExt(v[0], like(v[0], builder.getDoubleTy())); });
}

Component Emitter::bits_of(const Component& value, const Type& scalar) {
    if (scalar.kind != TypeKind::floating) return value;
    llvm::Type* integer = builder.getIntNTy(scalar.bits);
    return apply({value}, [&](auto v) {
        llvm::Value* number = v[0];
        if (in_double() && scalar.bits == 16) return math.float_to_half(number);
        if (in_double() && scalar.bits == 32)
            number = builder.CreateFPTrunc(number, like(number, builder.getFloatTy()));
        return builder.CreateBitCast(number, like(number, integer));
    });
}

Component Emitter::of_bits(const Component& bits, const Type& scalar) {
    if (scalar.kind != TypeKind::floating) return bits;
    return apply({bits}, [&](auto v) {
        if (in_double() && scalar.bits == 16)
            return math.convert_float(math.half_to_float(v[0]), builder.getDoubleTy());
        llvm::Type* stored = scalar.bits == 16   ? builder.getHalfTy()
                             : scalar.bits == 64 ? builder.getDoubleTy()
                                                 : builder.getFloatTy();
        llvm::Value* number = builder.CreateBitCast(v[0], like(v[0], stored));
        return in_double() && scalar.bits == 32 ? builder.CreateFPExt(number, like(number, builder.getDoubleTy()))
                                                : number;
    });
}

void Emitter::note_missing_shadow(const Pointer& pointer, const Type& scalar) {
    // Pointers that are values do not carry it (see components_of). Push constants never have one.
    if (scalar.bits == 32 && !pointer.shadow && pointer.storage != spv::StorageClass::PushConstant)
        note_narrowed("variable pointer");
}

void Emitter::note_narrowed(const char* operation) {
    if (in_double() && current) narrowed_.emplace(current->offset, operation);
}

bool Emitter::has_shadow(const Pointer& pointer, const Type& scalar) const {
    return pointer.shadow && scalar.kind == TypeKind::floating && scalar.bits == 32;
}

Pointer Emitter::shadow_of(const Pointer& pointer) {
    // Offsets into the shadow are twice those into the words, so whatever is in range there is in range here.
    Pointer doubles = pointer;
    doubles.base = pointer.shadow;
    doubles.shadow = Component();
    doubles.offset *= 2;
    if (pointer.dynamic_offset) doubles.dynamic_offset = multiply(pointer.dynamic_offset, 2);
    if (pointer.limit)
        doubles.limit = apply({pointer.limit}, [&](auto v) {
            return builder.CreateShl(v[0], llvm::ConstantInt::get(v[0]->getType(), 1));
        });
    return doubles;
}

Component Emitter::load_float(const Pointer& pointer, std::int64_t extra, const Type& scalar) {
    Type bits;
    bits.kind = TypeKind::integer, bits.bits = scalar.bits;
    const Component word = load_bytes(pointer, extra, bits);
    const Component plain = of_bits(word, scalar);
    note_missing_shadow(pointer, scalar);
    if (!has_shadow(pointer, scalar)) return plain;
    bits.bits = 64;
    const Component shadow = load_bytes(shadow_of(pointer), extra * 2, bits);
    return apply({word, plain, shadow}, [&](auto v) {
        llvm::Value* precise = builder.CreateBitCast(v[2], like(v[2], builder.getDoubleTy()));
        const Component rounded = bits_of(Component(precise), scalar);
        return select(builder.CreateICmpEQ(rounded.value, v[0]), precise, v[1]);
    });
}

void Emitter::store_float(const Pointer& pointer, std::int64_t extra, const Type& scalar, const Component& value) {
    Type bits;
    bits.kind = TypeKind::integer, bits.bits = scalar.bits;
    if (scalar.bits == 16) note_narrowed("store of 16 bits");
    note_missing_shadow(pointer, scalar);
    store_bytes(pointer, extra, bits, bits_of(value, scalar));
    if (!has_shadow(pointer, scalar)) return;
    bits.bits = 64;
    const Component shadow =
        apply({value}, [&](auto v) { return builder.CreateBitCast(v[0], like(v[0], builder.getInt64Ty())); });
    store_bytes(shadow_of(pointer), extra * 2, bits, shadow);
}

}  // namespace nacre::cpu
