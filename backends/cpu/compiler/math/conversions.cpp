// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/math/term.h"

namespace nacre::cpu {

llvm::Value* Math::float_to_int(Value* x, unsigned bits, bool is_signed) {
    Emission emission(builder_, options_);
    Term number(emission, x);
    if (number.element()->isHalfTy()) number = convert(number, builder_.getFloatTy());
    llvm::Type* result = number.type_of(builder_.getIntNTy(bits));
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
