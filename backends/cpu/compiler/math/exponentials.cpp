// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include "backends/cpu/compiler/math/term.h"

// Exponentials: x is split into a whole number n of octaves and a rest in half an octave around zero; a polynomial
// gives the power of the rest, and two multiplications by powers of two scale it, so that the one rounding of a
// denormal result is the last step. Logarithms: x = m * 2^e with m in [sqrt(1/2), sqrt(2)), a polynomial in m - 1 and e
// times the logarithm of two. Coefficients: minimax.py.

namespace nacre::cpu {

namespace {

constexpr float exp2_rest[] = {0x1.62e430p-1f, 0x1.ebfbdcp-3f,  0x1.c6af72p-5f,
                               0x1.3b2d46p-7f, 0x1.5f13fcp-10f, 0x1.428406p-13f};
constexpr float exp_rest[] = {0x1.fffffcp-2f, 0x1.555494p-3f, 0x1.555890p-5f, 0x1.1238c4p-7f, 0x1.6a7b3cp-10f};
constexpr float log2_rest[] = {0x1.715476p+0f,  -0x1.715470p-1f, 0x1.ec73d6p-2f,  -0x1.715c50p-2f, 0x1.26d388p-2f,
                               -0x1.e95bc4p-3f, 0x1.b9c8a2p-3f,  -0x1.a87dc6p-3f, 0x1.01b8f6p-3f};
constexpr float log_rest[] = {0x1.555554p-2f, -0x1.000226p-2f, 0x1.99a008p-3f, -0x1.547248p-3f,
                              0x1.22da2ep-3f, -0x1.0d8534p-3f, 0x1.055af0p-3f, -0x1.38b49ep-4f};

// ln 2 as a sum: products of the first part with the exponents of single precision are exact.
constexpr double ln2_high = 0x1.62e4p-1;
constexpr double ln2_low = 0x1.7f7d1cp-20;

/// power * 2^(n + shift) for a whole number n. NaN stays NaN whatever the bits of n.
Term scale(const Term& power, const Rounded& n, int shift) {
    if (has_exponent_instructions(power)) return times_power_of_two(power, shift == 0 ? n.number : n.number + shift);
    constexpr int shifter_bits = 0x4b400000;
    const Term twice_biased = n.bits + (254 + shift - shifter_bits);
    const Term first = twice_biased >> 1;
    const Term second = twice_biased - first;
    return power * (first << 23).from_bits() * (second << 23).from_bits();
}

Term exponential2(const Term& x) {
    // Where the result is zero or infinite in any case. The order of operands lets NaN through.
    const Term bounded = min(x.number(129), max(x.number(-151), x));
    const Rounded octaves = round_to_whole(bounded);
    const Term rest = bounded - octaves.number;
    const Term power = multiply_add(rest, polynomial(rest, exp2_rest), rest.number(1));
    return scale(power, octaves, 0);
}

struct Decomposed {
    Term rest;      ///< m - 1
    Term exponent;  ///< e as a floating-point number
};

Decomposed decompose(const Term& x) {
    if (has_exponent_instructions(x)) {
        const Term significand = significand_of(x), exponent = exponent_of(x);
        const Term is_high = significand >= 0x1.6a09e6p+0;
        return {select(is_high, significand * 0.5, significand) - 1.0, select(is_high, exponent + 1.0, exponent)};
    }
    const Term denormal = x < 0x1p-126;
    const Term bits = select(denormal, x * 0x1p23, x).to_bits();
    constexpr int root_half_bits = 0x3f3504f3;
    const Term exponent = (bits - root_half_bits) >> 23;
    const Term rest = (bits - (exponent << 23)).from_bits() - 1.0;
    const Term number = x.with(x.builder().CreateSIToFP(exponent.value(), x.type()));
    return {rest, number + select(denormal, x.number(-23), x.number(0))};
}

/// What a logarithm is where x is not a positive finite number.
Term logarithm_edges(const Term& x, const Term& result) {
    // There the parts of x lead to just that.
    if (has_exponent_instructions(x)) return result;
    const Term infinity = x.number(std::numeric_limits<double>::infinity());
    const Term not_positive = select(x == 0.0, -infinity, x.number(std::numeric_limits<double>::quiet_NaN()));
    const Term not_finite = x.with(x.builder().CreateFCmpUGE(x.value(), infinity.value()));
    return select(not_finite, x, select(x <= 0.0, not_positive, result));
}

Term logarithm2(const Term& x) {
    const auto [rest, exponent] = decompose(x);
    return logarithm_edges(x, multiply_add(rest, polynomial(rest, log2_rest), exponent));
}

}  // namespace

Term exponential(const Term& x, int shift) {
    const Term bounded = min(x.number(90), max(x.number(-105), x));
    const Rounded octaves = round_to_whole(bounded * std::numbers::log2e);
    const Term rest = multiply_add(octaves.number, -ln2_low, multiply_add(octaves.number, -ln2_high, bounded));
    const Term power = multiply_add(rest * rest, polynomial(rest, exp_rest), rest) + 1.0;
    return scale(power, octaves, shift);
}

Term logarithm(const Term& w, const Term* correction) {
    const auto [rest, exponent] = decompose(w);
    const Term square = rest * rest;
    // Small parts first.
    Term sum = multiply_add(square * rest, polynomial(rest, log_rest), exponent * ln2_low);
    if (correction) sum = sum + select(w < std::numeric_limits<double>::infinity(), *correction / w, w.number(0));
    sum = multiply_add(square, -0.5, sum) + rest;
    return logarithm_edges(w, multiply_add(exponent, ln2_high, sum));
}

llvm::Value* Math::exp(Value* x) {
    Emission emission(builder_, options_);
    return transcendental(
               "exp", [](const Term& a) { return exponential(a, 0); }, Term(emission, x))
        .value();
}

llvm::Value* Math::exp2(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("exp2", exponential2, Term(emission, x)).value();
}

llvm::Value* Math::log(Value* x) {
    Emission emission(builder_, options_);
    return transcendental(
               "log", [](const Term& a) { return logarithm(a, nullptr); }, Term(emission, x))
        .value();
}

llvm::Value* Math::log2(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("log2", logarithm2, Term(emission, x)).value();
}

}  // namespace nacre::cpu
