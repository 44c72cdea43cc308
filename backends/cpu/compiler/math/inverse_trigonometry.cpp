// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include "backends/cpu/compiler/math/term.h"

// Arcsine: a polynomial up to 1/2; above, asin(a) = pi/2 - 2 asin(sqrt((1 - a) / 2)) brings the argument below 1/2.
// Arctangent: a polynomial up to 1; above, atan(a) = pi/2 - atan(1 / a). Coefficients: minimax.py.

namespace nacre::cpu {

namespace {

using std::numbers::pi;

constexpr float arcsine_rest[] = {0x1.5555c8p-3f, 0x1.330204p-4f, 0x1.747bb8p-5f, 0x1.8c3e50p-6f, 0x1.595c60p-5f};
constexpr float arctangent_rest[] = {-0x1.55553ep-2f, 0x1.9991e4p-3f,  -0x1.242086p-3f,
                                     0x1.c08c46p-4f,  -0x1.5808d4p-4f, 0x1.da2824p-5f,
                                     -0x1.fd77dep-6f, 0x1.641b1ap-7f,  -0x1.d3427ep-10f};

struct ReducedArcsine {
    Term is_large;  ///< |x| > 1/2
    Term angle;     ///< Arcsine of |x|, or of sqrt((1 - |x|) / 2) where that is large.
};

ReducedArcsine reduced_arcsine(const Term& x) {
    const Term magnitude = abs(x);
    const Term is_large = magnitude > 0.5;
    // The square root of a negative number is NaN outside of the domain.
    const Term square = select(is_large, multiply_add(magnitude, -0.5, x.number(0.5)), magnitude * magnitude);
    const Term sine = select(is_large, intrinsic(llvm::Intrinsic::sqrt, square), magnitude);
    return {is_large, multiply_add(sine * square, polynomial(square, arcsine_rest), sine)};
}

Term arcsine(const Term& x) {
    const auto [is_large, angle] = reduced_arcsine(x);
    return copy_sign(select(is_large, pi / 2 - (angle + angle), angle), x);
}

Term arccosine(const Term& x) {
    const auto [is_large, angle] = reduced_arcsine(x);
    const Term twice = angle + angle;
    const Term near_one = select(x < 0.0, pi - twice, twice);
    return select(is_large, near_one, pi / 2 - copy_sign(angle, x));
}

/// Arctangent of t in [0, 1].
Term small_arctangent(const Term& t) {
    const Term square = t * t;
    return multiply_add(t * square, polynomial(square, arctangent_rest), t);
}

Term arctangent(const Term& x) {
    const Term magnitude = abs(x);
    const Term is_large = magnitude > 1.0;
    const Term angle = small_arctangent(select(is_large, 1.0 / magnitude, magnitude));
    return copy_sign(select(is_large, pi / 2 - angle, angle), x);
}

Term arctangent2(const Term& y, const Term& x) {
    const Term height = abs(y);
    const Term width = abs(x);
    const Term is_steep = height > width;
    const Term shorter = select(is_steep, width, height);
    const Term longer = select(is_steep, height, width);
    // Equal sides would divide zero by zero or infinity by infinity.
    const Term slope = select(shorter == longer, select(longer == 0.0, x.number(0), x.number(1)), shorter / longer);
    const Term angle = small_arctangent(slope);
    const Term in_half_plane = select(is_steep, pi / 2 - angle, angle);
    // By the sign bit, because -0 counts as negative.
    return copy_sign(select(x.to_bits() < 0.0, pi - in_half_plane, in_half_plane), y);
}

}  // namespace

llvm::Value* Math::asin(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("asin", arcsine, Term(emission, x)).value();
}

llvm::Value* Math::acos(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("acos", arccosine, Term(emission, x)).value();
}

llvm::Value* Math::atan(Value* x) {
    Emission emission(builder_, options_);
    return transcendental("atan", arctangent, Term(emission, x)).value();
}

llvm::Value* Math::atan2(Value* y, Value* x) {
    Emission emission(builder_, options_);
    return transcendental("atan2", arctangent2, Term(emission, y), Term(emission, x)).value();
}

}  // namespace nacre::cpu
