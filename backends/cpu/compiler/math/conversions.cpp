// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "backends/cpu/compiler/math/term.h"

namespace nacre::cpu {

llvm::Value* Math::float_to_int(Value* x, unsigned bits, bool is_signed) {
    Emission emission(builder_, options_);
    Term number(emission, x);
    if (number.element()->isHalfTy()) number = convert(number, builder_.getFloatTy());
    llvm::Type* result = number.type_of(builder_.getIntNTy(bits));
    // The larger of two numbers is the second where the first is NaN.
    if (!is_signed && bits == 32 && has_conversion_instructions(number))
        return to_unsigned(max(number, number.number(0))).value();
    if (number.type()->isVectorTy()) {
        // The intrinsic becomes scalar code, lane by lane (LLVM 19). The instruction's result is poison out of range,
        // which is never chosen.
        const auto constant = [&](const llvm::APInt& value) {
            return number.with(llvm::ConstantInt::get(result, value));
        };
        const double limit = std::ldexp(1.0, static_cast<int>(is_signed ? bits - 1 : bits));
        const Term whole = number.with(is_signed ? emission.builder.CreateFPToSI(number.value(), result)
                                                 : emission.builder.CreateFPToUI(number.value(), result));
        const Term largest =
            constant(is_signed ? llvm::APInt::getSignedMaxValue(bits) : llvm::APInt::getMaxValue(bits));
        const Term low = constant(is_signed ? llvm::APInt::getSignedMinValue(bits) : llvm::APInt::getZero(bits));
        const Term bounded = select(number < limit, whole, largest);
        if (!is_signed) return select(number > 0.0, bounded, low).value();
        return select(is_nan(number), constant(llvm::APInt::getZero(bits)), select(number >= -limit, bounded, low))
            .value();
    }
    const llvm::Intrinsic::ID id = is_signed ? llvm::Intrinsic::fptosi_sat : llvm::Intrinsic::fptoui_sat;
    return emission.builder.CreateIntrinsic(id, {result, number.type()}, {number.value()});
}

llvm::Value* Math::int_to_float(Value* x, llvm::Type* element, bool is_signed) {
    Emission emission(builder_, options_);
    const Term integer(emission, x);
    // Integers that single precision rounds are infinite as halves: half is rounded once only.
    llvm::Type* direct = integer.type_of(element->isHalfTy() ? builder_.getFloatTy() : element);
    llvm::Value* number =
        is_signed ? emission.builder.CreateSIToFP(x, direct) : emission.builder.CreateUIToFP(x, direct);
    return convert(integer.with(number), element).value();
}

}  // namespace nacre::cpu
