// SPDX-License-Identifier: Apache-2.0
#include <llvm/IR/Constants.h>

#include <cmath>
#include <limits>
#include <optional>

#include "backends/cpu/compiler/math/term.h"

namespace nacre::cpu {

namespace {

Term square_root(const Term& x) {
    return widen_half([](const Term& a) { return intrinsic(llvm::Intrinsic::sqrt, a); }, x);
}

Term inverse_square_root(const Term& x) {
    return widen_half([](const Term& a) { return 1.0 / intrinsic(llvm::Intrinsic::sqrt, a); }, x);
}

/// The number that a constant has in every lane.
std::optional<double> constant_number(llvm::Value* value) {
    auto* constant = llvm::dyn_cast<llvm::Constant>(value);
    if (constant && constant->getType()->isVectorTy()) constant = constant->getSplatValue();
    auto* number = llvm::dyn_cast_or_null<llvm::ConstantFP>(constant);
    if (!number) return std::nullopt;
    llvm::APFloat wide = number->getValueAPF();
    bool inexact = false;
    wide.convert(llvm::APFloat::IEEEdouble(), llvm::APFloat::rmNearestTiesToEven, &inexact);
    return wide.convertToDouble();
}

/// x^exponent by squaring; the exponent is at least 1.
Term whole_power(const Term& x, unsigned exponent) {
    std::optional<Term> result;
    Term square = x;
    for (;; square = square * square) {
        if (exponent & 1) result = result ? *result * square : square;
        exponent >>= 1;
        if (exponent == 0) return *result;
    }
}

Term constant_power(const Term& x, double exponent) {
    if (exponent == 0) return x.number(1);
    if (exponent == 0.5) return square_root(x);
    if (exponent == -0.5) return inverse_square_root(x);
    const Term power = whole_power(x, static_cast<unsigned>(std::abs(exponent)));
    return exponent < 0 ? 1.0 / power : power;
}

bool is_simple(double exponent) {
    return std::abs(exponent) == 0.5 || (std::abs(exponent) <= 64 && exponent == std::trunc(exponent));
}

}  // namespace

llvm::Value* Math::sqrt(Value* x) {
    Emission emission(builder_, options_);
    return square_root({emission, x}).value();
}

llvm::Value* Math::inverse_sqrt(Value* x) {
    Emission emission(builder_, options_);
    return inverse_square_root({emission, x}).value();
}

llvm::Value* Math::fma(Value* a, Value* b, Value* c) {
    Emission emission(builder_, options_);
    const auto fused = [](const Term& x, const Term& y, const Term& z) {
        return x.with(x.builder().CreateIntrinsic(llvm::Intrinsic::fma, {x.type()}, {x.value(), y.value(), z.value()}));
    };
    return widen_half(fused, Term(emission, a), Term(emission, b), Term(emission, c)).value();
}

llvm::Value* Math::pow(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const std::optional<double> exponent = constant_number(y);
    if (exponent && is_simple(*exponent)) {
        return widen_half([&](const Term& a) { return constant_power(a, *exponent); }, Term(emission, x)).value();
    }
    const auto general = [](const Term& base, const Term& power) {
        Math math(base.builder(), base.emission().options);
        const Term product = power * base.with(math.log2(base.value()));
        return select(power == 0.0, base.number(1), base.with(math.exp2(product.value())));
    };
    const auto library = [](const Term& base, const Term& power) {
        // What single precision does: no meaning is given to negative bases.
        const Term arguments[] = {base, power};
        const Term defined =
            select(base < 0.0, base.number(std::numeric_limits<double>::quiet_NaN()), call_per_lane("pow", arguments));
        return select(power == 0.0, base.number(1), defined);
    };
    const Term base(emission, x);
    const Term power(emission, y);
    return (base.element()->isDoubleTy() ? library(base, power) : widen_half(general, base, power)).value();
}

}  // namespace nacre::cpu
