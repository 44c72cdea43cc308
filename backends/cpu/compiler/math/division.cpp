// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>
#include <llvm/IR/PatternMatch.h>

#include "backends/cpu/compiler/math/term.h"

// Hardware traps where a divisor is zero and where the least integer is divided by -1; such divisors are replaced
// before and the result after. Vectors of up to 32 bits are divided as floating-point numbers: no target has integer
// division of vectors, and one by one is several times slower. The quotient of b-bit integers differs from a whole
// number by a relative 2^-b at least, so that a format of more than b bits rounds it to the right side.

namespace nacre::cpu {

namespace {

Term all_ones(const Term& like) { return like.integer(-1); }

/// Constants that need no care; LLVM turns division by them into multiplication.
bool is_harmless_constant(const Term& divisor, bool is_signed) {
    auto* constant = llvm::dyn_cast<llvm::Constant>(divisor.value());
    if (constant && constant->getType()->isVectorTy()) constant = constant->getSplatValue();
    auto* integer = llvm::dyn_cast_or_null<llvm::ConstantInt>(constant);
    return integer && !integer->isZero() && !(is_signed && integer->isMinusOne());
}

Term divide_safely(const Term& x, const Term& y, bool is_signed) {
    llvm::IRBuilder<>& builder = x.builder();
    if (!x.type()->isVectorTy() || x.bits() > 32 || is_harmless_constant(y, is_signed)) {
        return x.with(is_signed ? builder.CreateSDiv(x.value(), y.value()) : builder.CreateUDiv(x.value(), y.value()));
    }
    llvm::Type* format = x.type_of(x.bits() > 16 ? builder.getDoubleTy() : builder.getFloatTy());
    const auto number = [&](const Term& a) {
        return a.with(is_signed ? builder.CreateSIToFP(a.value(), format) : builder.CreateUIToFP(a.value(), format));
    };
    const Term quotient = number(x) / number(y);
    return x.with(is_signed ? builder.CreateFPToSI(quotient.value(), x.type())
                            : builder.CreateFPToUI(quotient.value(), x.type()));
}

struct Quotient {
    Term quotient;
    Term divided_by;  ///< The divisor, with 1 where it would trap.
    Term by_zero;
};

Quotient signed_quotient(const Term& x, const Term& y) {
    const Term by_zero = y == 0.0;
    const Term least = x == x.integer(std::int64_t{1} << (x.bits() - 1));
    const Term overflows = least & (y == all_ones(y));
    const Term divisor = is_harmless_constant(y, true) ? y : select(by_zero | overflows, y.integer(1), y);
    return {divide_safely(x, divisor, true), divisor, by_zero};
}

Quotient unsigned_quotient(const Term& x, const Term& y) {
    const Term by_zero = y == 0.0;
    const Term divisor = is_harmless_constant(y, false) ? y : select(by_zero, y.integer(1), y);
    return {divide_safely(x, divisor, false), divisor, by_zero};
}

Term signed_remainder(const Term& x, const Term& y) {
    const auto [quotient, divisor, by_zero] = signed_quotient(x, y);
    return select(by_zero, all_ones(x), x - quotient * divisor);
}

}  // namespace

llvm::Value* Math::s_div(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const Quotient result = signed_quotient({emission, x}, {emission, y});
    return select(result.by_zero, result.quotient.integer(0), result.quotient).value();
}

llvm::Value* Math::s_rem(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return signed_remainder({emission, x}, {emission, y}).value();
}

llvm::Value* Math::s_mod(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const Term divisor(emission, y);
    const Term remainder = signed_remainder({emission, x}, divisor);
    // By zero, the sum leaves the remainder as it is.
    const Term other_sign = (remainder ^ divisor) < 0.0;
    const Term zero = remainder == 0.0;
    return select(zero, remainder, select(other_sign, remainder + divisor, remainder)).value();
}

llvm::Value* Math::u_div(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const Quotient result = unsigned_quotient({emission, x}, {emission, y});
    return select(result.by_zero, all_ones(result.quotient), result.quotient).value();
}

llvm::Value* Math::u_mod(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const Term dividend(emission, x);
    const auto [quotient, divisor, by_zero] = unsigned_quotient(dividend, {emission, y});
    return select(by_zero, all_ones(dividend), dividend - quotient * divisor).value();
}

}  // namespace nacre::cpu
