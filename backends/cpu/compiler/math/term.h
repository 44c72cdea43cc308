// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <llvm/IR/IRBuilder.h>

#include <span>

#include "backends/cpu/compiler/math/math.h"

/// @file
/// How the functions of Math write formulas: a Term is a value in the IR with the operators of C++.

namespace nacre::cpu {

/// Where the instructions of one call of Math go: a builder of its own, without the fast-math flags of the caller's.
struct Emission {
    Emission(llvm::IRBuilder<>& at, const MathOptions& choice);

    llvm::IRBuilder<> builder;
    MathOptions options;
};

/// A scalar or vector value of floating-point, integer or truth type. Operators need operands of one type; arithmetic
/// and comparison follow that type. Comparisons are ordered (false with NaN), those of integers are signed. `>>` keeps
/// the sign.
class Term {
  public:
    Term(Emission& emission, llvm::Value* value) : emission_(&emission), value_(value) {}

    llvm::Value* value() const { return value_; }
    llvm::Type* type() const { return value_->getType(); }
    llvm::Type* element() const { return value_->getType()->getScalarType(); }
    unsigned bits() const { return element()->getScalarSizeInBits(); }
    Emission& emission() const { return *emission_; }
    llvm::IRBuilder<>& builder() const { return emission_->builder; }
    /// A value beside this one.
    Term with(llvm::Value* value) const { return {*emission_, value}; }
    /// This type with other elements.
    llvm::Type* type_of(llvm::Type* element) const;

    /// A number in every lane, of this term's floating-point type; rounded to that type.
    Term number(double value) const;
    /// An integer in every lane, of this term's integer type, or of the integers as wide as its floating-point type.
    Term integer(std::int64_t value) const;

    /// The bits of floating-point numbers as integers, and back (to the floating-point type of that width; half is not
    /// meant).
    Term to_bits() const;
    Term from_bits() const;

  private:
    Emission* emission_;
    llvm::Value* value_;
};

Term operator+(const Term& a, const Term& b);
Term operator-(const Term& a, const Term& b);
Term operator*(const Term& a, const Term& b);
Term operator/(const Term& a, const Term& b);  ///< Floating point only.
Term operator-(const Term& a);
Term operator&(const Term& a, const Term& b);
Term operator|(const Term& a, const Term& b);
Term operator^(const Term& a, const Term& b);
Term operator<<(const Term& a, const Term& b);
Term operator>>(const Term& a, const Term& b);
Term shift_right_logical(const Term& a, const Term& b);

// With a constant, of the type of the other operand. Shifts take an amount.
Term operator+(const Term& a, double b);
Term operator-(const Term& a, double b);
Term operator-(double a, const Term& b);
Term operator*(const Term& a, double b);
Term operator/(double a, const Term& b);
Term operator<<(const Term& a, unsigned amount);
Term operator>>(const Term& a, unsigned amount);
Term shift_right_logical(const Term& a, unsigned amount);

Term operator<(const Term& a, const Term& b);
Term operator>(const Term& a, const Term& b);
Term operator<=(const Term& a, const Term& b);
Term operator>=(const Term& a, const Term& b);
Term operator==(const Term& a, const Term& b);
Term operator<(const Term& a, double b);
Term operator>(const Term& a, double b);
Term operator<=(const Term& a, double b);
Term operator>=(const Term& a, double b);
Term operator==(const Term& a, double b);
Term is_nan(const Term& x);
Term unsigned_less(const Term& a, const Term& b);

Term select(const Term& condition, const Term& yes, const Term& no);
/// a * b + c, fused where the options allow it and the target does it quickly.
Term multiply_add(const Term& a, const Term& b, const Term& c);
Term multiply_add(const Term& a, double b, const Term& c);
Term abs(const Term& x);
/// The magnitude of the first with the sign of the second.
Term copy_sign(const Term& magnitude, const Term& sign);
/// One instruction each on x86: the second operand where one is NaN, min(a, b) = a < b ? a : b.
Term min(const Term& a, const Term& b);
Term max(const Term& a, const Term& b);
/// A unary intrinsic that every target lowers for vectors: sqrt, floor, fabs, ctpop and the like.
Term intrinsic(llvm::Intrinsic::ID id, const Term& x);
/// coefficients[0] + x * (coefficients[1] + x * (...)), from the inside out (Horner).
Term polynomial(const Term& x, std::span<const float> coefficients);
/// An integer term of another width; signed or zero extended where that is wider.
Term resize(const Term& x, llvm::Type* element, bool is_signed);

/// Single precision numbers rounded to the nearest whole numbers by adding and subtracting 1.5 * 2^23: the SSE2
/// baseline has no instruction for that. Right for |x| < 2^22; a number close to x beyond.
struct Rounded {
    Term number;
    Term bits;  ///< Those of x + 1.5 * 2^23: the low bits are the integer.
};
Rounded round_to_whole(const Term& x);

/// A call of the C library's function for each lane.
Term call_per_lane(const char* function, std::span<const Term> arguments);

/// Half to single precision and back; see Math::half_to_float.
Term half_to_single(const Term& half_bits);
Term single_to_half(const Term& x);
Term convert(const Term& x, llvm::Type* element);

/// Whether MathOptions::exponent_instructions hold for x: single precision, and as many lanes as some register has.
bool has_exponent_instructions(const Term& x);
// By those instructions.
Term exponent_of(const Term& x);     ///< floor(log2(|x|)) as a number; infinite for zero and infinities.
/// x / 2^exponent_of(x): 1 for infinity and zero (-1 for the negative one), NaN for negative x.
Term significand_of(const Term& x);
/// x * 2^exponent with one rounding; the exponent is whole.
Term times_power_of_two(const Term& x, const Term& exponent);

/// Whether MathOptions::conversion_instructions hold for x: vectors of single precision that some register can hold.
bool has_conversion_instructions(const Term& x);
/// By that instruction; the largest integer where x is larger. x is not negative, nor NaN.
Term to_unsigned(const Term& x);

/// Evaluates a function that can only be written for float and double for half too: by way of float.
template <typename Function, typename... Terms>
Term widen_half(Function function, const Term& first, const Terms&... others) {
    if (!first.element()->isHalfTy()) return function(first, others...);
    llvm::Type* single = first.builder().getFloatTy();
    return convert(function(convert(first, single), convert(others, single)...), first.element());
}

/// Evaluates a transcendental function: by `function` in single precision and half, by the C library in double.
template <typename Function, typename... Terms>
Term transcendental(const char* library_name, Function function, const Term& first, const Terms&... others) {
    if (first.element()->isDoubleTy()) {
        const Term arguments[] = {first, others...};
        return call_per_lane(library_name, arguments);
    }
    return widen_half(function, first, others...);
}

// Kernels in single precision that several functions use.

/// exp(x) * 2^shift for a shift in [-1, 1], without overflow on the way. exponentials.cpp
Term exponential(const Term& x, int shift);
/// log(w + correction) for a correction far smaller than w. exponentials.cpp
Term logarithm(const Term& w, const Term* correction);

}  // namespace nacre::cpu
