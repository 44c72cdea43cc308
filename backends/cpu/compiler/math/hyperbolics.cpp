// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <numbers>

#include "backends/cpu/compiler/math/term.h"

// By exponentials and logarithms, with polynomials or corrected logarithms where those would cancel. Coefficients:
// minimax.py.

namespace nacre::cpu {

namespace {

constexpr float sinh_rest[] = {0x1.555556p-3f, 0x1.1110e0p-7f, 0x1.a022bcp-13f, 0x1.756c1ep-19f};
constexpr float tanh_rest[] = {-0x1.555532p-2f, 0x1.1106f6p-3f, -0x1.b835a4p-5f, 0x1.51fa38p-6f, -0x1.751e4ep-8f};

/// Above, 1 is nothing beside the square.
constexpr double large_argument = 0x1p20;

Term odd_polynomial(const Term& x, std::span<const float> coefficients) {
    const Term square = x * x;
    return multiply_add(x * square, polynomial(square, coefficients), x);
}

Term sine_hyperbolic(const Term& x) {
    const Term magnitude = abs(x);
    // Half the exponential is finite wherever the result is.
    const Term half_power = exponential(magnitude, -1);
    const Term large = half_power - 0.25 / half_power;
    return copy_sign(select(magnitude < 1.0, odd_polynomial(magnitude, sinh_rest), large), x);
}

Term cosine_hyperbolic(const Term& x) {
    const Term half_power = exponential(abs(x), -1);
    return half_power + 0.25 / half_power;
}

Term tangent_hyperbolic(const Term& x) {
    const Term magnitude = abs(x);
    const Term large = 1.0 - 2.0 / (exponential(magnitude + magnitude, 0) + 1.0);
    return copy_sign(select(magnitude < 0.625, odd_polynomial(magnitude, tanh_rest), large), x);
}

/// log(1 + u), or log(2 * x) where `is_large`.
Term log_of_one_and(const Term& u, const Term& is_large, const Term& x) {
    const Term w = u + 1.0;
    const Term correction = select(is_large, x.number(0), u - (w - 1.0));
    const Term result = logarithm(select(is_large, x, w), &correction);
    return result + select(is_large, x.number(std::numbers::ln2), x.number(0));
}

Term area_sine(const Term& x) {
    const Term magnitude = abs(x);
    const Term square = magnitude * magnitude;
    // a + sqrt(a^2 + 1) - 1, without cancellation.
    const Term u = magnitude + square / (intrinsic(llvm::Intrinsic::sqrt, square + 1.0) + 1.0);
    return copy_sign(log_of_one_and(u, magnitude > large_argument, magnitude), x);
}

Term area_cosine(const Term& x) {
    const Term above_one = x - 1.0;
    const Term u = above_one + intrinsic(llvm::Intrinsic::sqrt, above_one * (above_one + 2.0));
    const Term result = log_of_one_and(u, x > large_argument, x);
    return select(x < 1.0, x.number(std::numeric_limits<double>::quiet_NaN()), result);
}

Term area_tangent(const Term& x) {
    const Term magnitude = abs(x);
    const Term u = (magnitude + magnitude) / (1.0 - magnitude);
    const Term w = u + 1.0;
    const Term correction = u - (w - 1.0);
    return copy_sign(logarithm(w, &correction) * 0.5, x);
}

}  // namespace

llvm::Value* Math::sinh(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("sinh", sine_hyperbolic, Term(emission, x)).value();
}

llvm::Value* Math::cosh(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("cosh", cosine_hyperbolic, Term(emission, x)).value();
}

llvm::Value* Math::tanh(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("tanh", tangent_hyperbolic, Term(emission, x)).value();
}

llvm::Value* Math::asinh(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("asinh", area_sine, Term(emission, x)).value();
}

llvm::Value* Math::acosh(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("acosh", area_cosine, Term(emission, x)).value();
}

llvm::Value* Math::atanh(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("atanh", area_tangent, Term(emission, x)).value();
}

}  // namespace nacre::cpu
