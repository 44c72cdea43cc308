// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "backends/cpu/compiler/math/term.h"

// By integer operations, because half precision without instructions for it means calls that a compiled shader cannot
// count on. Conversions by instruction give the same bits.

namespace nacre::cpu {

namespace {

constexpr std::int64_t exponent_gap = 127 - 15;  ///< Between the biases of single and half.

/// i32 of the bits of a half in the low 16 bits, from bits of single precision.
Term round_to_half(const Term& single_bits) {
    const Term sign = shift_right_logical(single_bits, 16) & single_bits.integer(0x8000);
    const Term magnitude = single_bits & single_bits.integer(0x7fffffff);

    // Normal halves: adds just under half a unit, and one more where the last place is odd. What is larger than the
    // largest half is infinite; rounding reaches it by carry.
    const Term bounded = min(magnitude, magnitude.integer(0x47800000));
    const Term odd = shift_right_logical(bounded, 13) & bounded.integer(1);
    const Term normal = shift_right_logical(bounded + odd + (0xfff - static_cast<double>(exponent_gap << 23)), 13);

    // Denormal halves: the last place of 0.5 is the unit of denormal halves, so the addition rounds.
    const Term denormal = (magnitude.from_bits() + 0.5).to_bits() - magnitude.integer(0x3f000000);

    const Term is_nan = magnitude > magnitude.integer(0x7f800000);
    const Term nan = (shift_right_logical(magnitude, 13) & magnitude.integer(0x3ff)) | magnitude.integer(0x7e00);
    const Term is_denormal = magnitude < magnitude.integer((exponent_gap + 1) << 23);
    return sign | select(is_nan, nan, select(is_denormal, denormal, normal));
}

}  // namespace

Term half_to_single(const Term& half_bits) {
    llvm::IRBuilder<>& builder = half_bits.builder();
    if (half_bits.emission().options.half_instructions) {
        const Term bits = resize(half_bits, builder.getInt16Ty(), false);
        const Term half = bits.with(builder.CreateBitCast(bits.value(), bits.type_of(builder.getHalfTy())));
        return half.with(builder.CreateFPExt(half.value(), half.type_of(builder.getFloatTy())));
    }
    const Term bits = resize(half_bits, builder.getInt32Ty(), false);
    const Term sign = (bits & bits.integer(0x8000)) << 16;
    const Term magnitude = (bits & bits.integer(0x7fff)) << 13;
    const Term normal = magnitude + static_cast<double>(exponent_gap << 23);
    // With the exponent of the least normal half, whose leading one is then taken away again.
    const Term denormal = ((magnitude + static_cast<double>((exponent_gap + 1) << 23)).from_bits() - 0x1p-14).to_bits();
    const Term infinite_or_nan =
        select(magnitude > magnitude.integer(0x0f800000), magnitude.integer(0x7fc00000), magnitude.integer(0x7f800000));
    const Term finite = select(magnitude < magnitude.integer(1 << 23), denormal, normal);
    const Term result = select(magnitude < magnitude.integer(0x0f800000), finite, magnitude | infinite_or_nan);
    return (result | sign).from_bits();
}

Term single_to_half(const Term& x) {
    llvm::IRBuilder<>& builder = x.builder();
    if (x.emission().options.half_instructions) {
        const Term half = x.with(builder.CreateFPTrunc(x.value(), x.type_of(builder.getHalfTy())));
        return half.with(builder.CreateBitCast(half.value(), half.type_of(builder.getInt16Ty())));
    }
    return resize(round_to_half(x.to_bits()), builder.getInt16Ty(), false);
}

Term convert(const Term& x, llvm::Type* element) {
    llvm::IRBuilder<>& builder = x.builder();
    if (x.element() == element) return x;
    if (x.element()->isHalfTy()) {
        const Term bits = x.with(builder.CreateBitCast(x.value(), x.type_of(builder.getInt16Ty())));
        return convert(half_to_single(bits), element);
    }
    if (element->isHalfTy()) {
        const Term bits = single_to_half(convert(x, builder.getFloatTy()));
        return bits.with(builder.CreateBitCast(bits.value(), bits.type_of(element)));
    }
    return x.with(builder.CreateFPCast(x.value(), x.type_of(element)));
}

llvm::Value* Math::float_to_half(Value* x) {
    Emission emission(builder_, options_);
    const Term half = convert({emission, x}, builder_.getHalfTy());
    return emission.builder.CreateBitCast(half.value(), half.type_of(builder_.getInt16Ty()));
}

llvm::Value* Math::half_to_float(Value* bits) {
    Emission emission(builder_, options_);
    return half_to_single({emission, bits}).value();
}

llvm::Value* Math::convert_float(Value* x, llvm::Type* element) {
    Emission emission(builder_, options_);
    return convert({emission, x}, element).value();
}

llvm::Value* Math::quantize_to_f16(Value* x) {
    Emission emission(builder_, options_);
    const Term given(emission, x);
    const Term single = convert(given, builder_.getFloatTy());
    const Term rounded = half_to_single(single_to_half(single));
    const Term zero = copy_sign(single.number(0), single);
    return convert(select(abs(single) < 0x1p-14, zero, rounded), given.element()).value();
}

}  // namespace nacre::cpu
