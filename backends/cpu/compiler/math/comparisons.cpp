// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/compiler/math/term.h"

// Comparison and selection instead of llvm.minnum and its like: those leave the sign of zero open, so that a folded
// constant and the running code could differ.

namespace nacre::cpu {

namespace {

Term number_min(const Term& x, const Term& y) { return select(is_nan(x), y, min(y, x)); }

Term number_max(const Term& x, const Term& y) { return select(is_nan(x), y, max(y, x)); }

Term clamp(const Term& x, const Term& low, const Term& high) { return min(max(x, low), high); }

}  // namespace

llvm::Value* Math::f_abs(Value* x) {
    Emission emission(builder_, options_);
    return abs({emission, x}).value();
}

llvm::Value* Math::sign(Value* x) {
    Emission emission(builder_, options_);
    const auto sign_of = [](const Term& a) {
        return select(a > 0.0, a.number(1), select(a < 0.0, a.number(-1), a.number(0)));
    };
    return widen_half(sign_of, Term(emission, x)).value();
}

llvm::Value* Math::f_min(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return widen_half([](const Term& a, const Term& b) { return min(a, b); }, Term(emission, x), Term(emission, y))
        .value();
}

llvm::Value* Math::f_max(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return widen_half([](const Term& a, const Term& b) { return max(a, b); }, Term(emission, x), Term(emission, y))
        .value();
}

llvm::Value* Math::n_min(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return widen_half(number_min, Term(emission, x), Term(emission, y)).value();
}

llvm::Value* Math::n_max(Value* x, Value* y) {
    Emission emission(builder_, options_);
    return widen_half(number_max, Term(emission, x), Term(emission, y)).value();
}

llvm::Value* Math::f_clamp(Value* x, Value* low, Value* high) {
    Emission emission(builder_, options_);
    return widen_half(clamp, Term(emission, x), Term(emission, low), Term(emission, high)).value();
}

llvm::Value* Math::n_clamp(Value* x, Value* low, Value* high) {
    Emission emission(builder_, options_);
    const auto number_clamp = [](const Term& a, const Term& b, const Term& c) {
        return number_min(number_max(a, b), c);
    };
    return widen_half(number_clamp, Term(emission, x), Term(emission, low), Term(emission, high)).value();
}

llvm::Value* Math::step(Value* edge, Value* x) {
    Emission emission(builder_, options_);
    const auto step_of = [](const Term& e, const Term& a) { return select(a < e, a.number(0), a.number(1)); };
    return widen_half(step_of, Term(emission, edge), Term(emission, x)).value();
}

llvm::Value* Math::smooth_step(Value* edge0, Value* edge1, Value* x) {
    Emission emission(builder_, options_);
    const auto smooth = [](const Term& from, const Term& to, const Term& a) {
        const Term t = clamp((a - from) / (to - from), a.number(0), a.number(1));
        return t * t * multiply_add(t, -2.0, a.number(3));
    };
    return widen_half(smooth, Term(emission, edge0), Term(emission, edge1), Term(emission, x)).value();
}

llvm::Value* Math::mix(Value* x, Value* y, Value* a) {
    Emission emission(builder_, options_);
    const auto blend = [](const Term& from, const Term& to, const Term& t) {
        return multiply_add(to, t, from * (1.0 - t));
    };
    return widen_half(blend, Term(emission, x), Term(emission, y), Term(emission, a)).value();
}

llvm::Value* Math::f_rem(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const auto remainder = [](const Term& a, const Term& b) {
        return multiply_add(-b, intrinsic(llvm::Intrinsic::trunc, a / b), a);
    };
    return widen_half(remainder, Term(emission, x), Term(emission, y)).value();
}

llvm::Value* Math::f_mod(Value* x, Value* y) {
    Emission emission(builder_, options_);
    const auto modulus = [](const Term& a, const Term& b) {
        return multiply_add(-b, intrinsic(llvm::Intrinsic::floor, a / b), a);
    };
    return widen_half(modulus, Term(emission, x), Term(emission, y)).value();
}

}  // namespace nacre::cpu
