// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include "backends/cpu/compiler/math/term.h"

// Sine and cosine: x is taken to the nearest multiple of pi (for the cosine: the nearest odd multiple of pi / 2) and a
// rest in
// [-pi/2, pi/2], whose sine a single polynomial gives; nothing has to be selected. The multiple is subtracted in parts
// (Cody and Waite, "Software Manual for the Elementary Functions", 1980), the first three of so few bits that neither
// their products nor the differences round where the sine is steep; the last difference is the only one that does. They
// have one sign, so that -0 stays -0. Coefficients and parts: minimax.py.

namespace nacre::cpu {

namespace {

constexpr double pi_parts[] = {0x1.92p+1, 0x1.fap-11, 0x1.5p-19, 0x1.110b46p-25};
/// For the tangent, which near its poles shows every error of the rest.
constexpr double finer_pi_parts[] = {0x1.92p+1, 0x1.fap-11, 0x1.5p-19, 0x1.1p-25, 0x1.0b4612p-33};

constexpr float sine_half_turn[] = {-0x1.55554cp-3f, 0x1.110edap-7f, -0x1.9f70eep-13f, 0x1.5dc8c4p-19f};
constexpr float sine_quarter_turn[] = {-0x1.555546p-3f, 0x1.110778p-7f, -0x1.995408p-13f};
constexpr float cosine_quarter_turn[] = {0x1.55554ap-5f, -0x1.6c0c28p-10f, 0x1.99e80cp-16f};

/// x - multiple * pi * factor, for a factor that is a power of two.
Term subtract_pi(const Term& x, const Term& multiple, double factor, std::span<const double> parts) {
    Term rest = x;
    for (const double part : parts) rest = multiply_add(multiple, -part * factor, rest);
    return rest;
}

/// r + r * z * P(z) with z = r^2.
Term odd_polynomial(const Term& r, const Term& square, std::span<const float> coefficients) {
    return multiply_add(r * square, polynomial(square, coefficients), r);
}

/// The sign bit of x alone.
Term sign_bit(const Term& x) {
    const Term bits = x.to_bits();
    return bits & bits.integer(0x80000000);
}

/// Sine of x - multiple * pi, with its sign changed where the lowest bit of `flips` is one.
Term reduced_sine(const Term& x, const Term& multiple, const Term& flips) {
    const Term rest = subtract_pi(x, multiple, 1, pi_parts);
    // The magnitude and the sign go separate ways, because the polynomial would lose the sign of -0. The bound is a bit
    // above pi / 2, for what the rounding of x / pi does to large x; it matters only where the reduction has lost all
    // precision.
    const Term magnitude = min(x.number(1.59), abs(rest));
    const Term sine = odd_polynomial(magnitude, magnitude * magnitude, sine_half_turn);
    // Shaders take sqrt(1 - sin(x)^2): it must not become NaN for a last place.
    const Term bounded = min(x.number(1), sine);
    return (bounded.to_bits() ^ (flips << 31) ^ sign_bit(rest)).from_bits();
}

Term sine(const Term& x) {
    const Rounded half_turns = round_to_whole(x * std::numbers::inv_pi);
    return reduced_sine(x, half_turns.number, half_turns.bits);
}

Term cosine(const Term& x) {
    // cos((n + 1/2) * pi + r) = -(-1)^n * sin(r)
    const Rounded half_turns = round_to_whole(x * std::numbers::inv_pi - 0.5);
    return reduced_sine(x, half_turns.number + 0.5, half_turns.bits + 1.0);
}

Term tangent(const Term& x) {
    const Rounded quarter_turns = round_to_whole(x * (2 * std::numbers::inv_pi));
    const Term rest = subtract_pi(x, quarter_turns.number, 0.5, finer_pi_parts);
    const Term magnitude = abs(rest);
    const Term square = magnitude * magnitude;
    const Term sine = odd_polynomial(magnitude, square, sine_quarter_turn);
    const Term cosine =
        multiply_add(square * square, polynomial(square, cosine_quarter_turn), multiply_add(square, -0.5, x.number(1)));
    const Term is_odd = (quarter_turns.bits & quarter_turns.bits.integer(1)) == 1.0;
    const Term tangent = select(is_odd, -cosine, sine) / select(is_odd, sine, cosine);
    return (tangent.to_bits() ^ sign_bit(rest)).from_bits();
}

}  // namespace

llvm::Value* Math::sin(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("sin", sine, Term(emission, x)).value();
}

llvm::Value* Math::cos(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("cos", cosine, Term(emission, x)).value();
}

llvm::Value* Math::tan(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("tan", tangent, Term(emission, x)).value();
}

}  // namespace nacre::cpu
