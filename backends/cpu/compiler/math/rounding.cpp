// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "backends/cpu/compiler/math/term.h"

namespace nacre::cpu {

namespace {

Term intrinsic_of_half_too(llvm::Intrinsic::ID id, const Term& x) {
    return widen_half([id](const Term& a) { return intrinsic(id, a); }, x);
}

/// The layout of single or double precision.
struct Layout {
    explicit Layout(const Term& x)
        : is_double(x.bits() == 64), fraction_bits(is_double ? 52 : 23), bias(is_double ? 1023 : 127) {}

    bool is_double;
    unsigned fraction_bits;
    int bias;
};

struct Normalized {
    Term bits;        ///< Of the number made normal where it was denormal.
    Term exponent;    ///< Unbiased exponent of the number itself, so that |x| is in [1, 2) * 2^exponent; an integer as
                      ///< wide as x.
    Term is_special;  ///< Zero, infinite or NaN: the rest means nothing.
};

Normalized normalize(const Term& x) {
    const Layout layout(x);
    const Term magnitude = abs(x);
    const Term denormal = magnitude < std::ldexp(1.0, 1 - layout.bias);
    const Term bits = select(denormal, x * std::ldexp(1.0, static_cast<int>(layout.fraction_bits)), x).to_bits();
    const Term field = shift_right_logical(bits, layout.fraction_bits) & bits.integer(2 * layout.bias + 1);
    const Term offset =
        select(denormal, bits.integer(layout.bias + static_cast<int>(layout.fraction_bits)), bits.integer(layout.bias));
    // True for NaN too.
    const Term infinite =
        x.with(x.builder().CreateFCmpUEQ(magnitude.value(), x.number(std::numeric_limits<double>::infinity()).value()));
    return {bits, field - offset, infinite | (x == 0.0)};
}

/// The number with the fraction and sign of `bits` and a magnitude in [1, 2) * 2^exponent.
Term with_exponent(const Term& bits, const Layout& layout, int exponent) {
    const std::int64_t field = std::int64_t{2 * layout.bias + 1} << layout.fraction_bits;
    return ((bits & bits.integer(~field)) | bits.integer(std::int64_t{layout.bias + exponent} << layout.fraction_bits))
        .from_bits();
}

/// As an integer as wide as x, bounded to what makes a difference.
Term bounded_exponent(const Term& exponent, const Term& x, int limit) {
    Term wide = exponent;
    if (exponent.bits() < 32) wide = resize(exponent, exponent.builder().getInt32Ty(), true);
    wide = min(wide.integer(limit), max(wide.integer(-limit), wide));
    return resize(wide, x.builder().getIntNTy(x.bits()), true);
}

Term scale_by_power(const Term& x, const Term& exponent) {
    const Layout layout(x);
    // From the least denormal to infinity and back, and a bit more.
    const int range = 2 * layout.bias + static_cast<int>(layout.fraction_bits) + 4;
    const Normalized parts = normalize(x);
    // The number is made anew in [1, 2) and scaled in two steps, so that only the second can round.
    const Term sum = parts.exponent + bounded_exponent(exponent, x, range);
    const Term total = min(sum.integer(layout.bias + 2),
                           max(sum.integer(-layout.bias - static_cast<int>(layout.fraction_bits) - 2), sum));
    const Term first = total >> 1;
    const Term second = total - first;
    const auto power = [&](const Term& e) { return ((e + layout.bias) << layout.fraction_bits).from_bits(); };
    const Term result = with_exponent(parts.bits, layout, 0) * power(first) * power(second);
    return select(parts.is_special, x, result);
}

}  // namespace

llvm::Value* Math::floor(Value* x) {
    Emission emission(builder_, options_);
    return intrinsic_of_half_too(llvm::Intrinsic::floor, {emission, x}).value();
}

llvm::Value* Math::ceil(Value* x) {
    Emission emission(builder_, options_);
    return intrinsic_of_half_too(llvm::Intrinsic::ceil, {emission, x}).value();
}

llvm::Value* Math::trunc(Value* x) {
    Emission emission(builder_, options_);
    return intrinsic_of_half_too(llvm::Intrinsic::trunc, {emission, x}).value();
}

llvm::Value* Math::round_even(Value* x) {
    Emission emission(builder_, options_);
    return intrinsic_of_half_too(llvm::Intrinsic::roundeven, {emission, x}).value();
}

llvm::Value* Math::round(Value* x) {
    Emission emission(builder_, options_);
    const auto half_away = [](const Term& a) {
        // The number just below one half: one half itself would take the number just below it to one.
        const double nearly_half = a.bits() == 64 ? std::nextafter(0.5, 0.0) : std::nextafter(0.5f, 0.0f);
        return intrinsic(llvm::Intrinsic::trunc, a + copy_sign(a.number(nearly_half), a));
    };
    return widen_half(half_away, Term(emission, x)).value();
}

llvm::Value* Math::fract(Value* x) {
    Emission emission(builder_, options_);
    return widen_half([](const Term& a) { return a - intrinsic(llvm::Intrinsic::floor, a); }, Term(emission, x))
        .value();
}

Math::Parts Math::modf(Value* x) {
    Emission emission(builder_, options_);
    const Term number(emission, x);
    const Term whole = intrinsic_of_half_too(llvm::Intrinsic::trunc, number);
    const auto fraction = [](const Term& a, const Term& b) {
        // Infinity minus infinity would be NaN.
        return copy_sign(select(a == b, a.number(0), a - b), a);
    };
    return {widen_half(fraction, number, whole).value(), whole.value()};
}

Math::Scaled Math::frexp(Value* x) {
    Emission emission(builder_, options_);
    const Term given(emission, x);
    const bool is_half = given.element()->isHalfTy();
    const Term number = is_half ? convert(given, builder_.getFloatTy()) : given;
    const Normalized parts = normalize(number);
    const Term significand = select(parts.is_special, number, with_exponent(parts.bits, Layout(number), -1));
    const Term exponent = select(parts.is_special, parts.exponent.integer(0), parts.exponent + 1.0);
    return {(is_half ? convert(significand, given.element()) : significand).value(),
            resize(exponent, builder_.getInt32Ty(), true).value()};
}

llvm::Value* Math::ldexp(Value* x, Value* exponent) {
    Emission emission(builder_, options_);
    const Term power(emission, exponent);
    const auto scaled = [&](const Term& a) { return scale_by_power(a, power); };
    return widen_half(scaled, Term(emission, x)).value();
}

}  // namespace nacre::cpu
