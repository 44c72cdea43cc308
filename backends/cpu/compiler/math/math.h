// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <llvm/IR/IRBuilder.h>

#include <array>

/// @file
/// Mathematical functions of shaders as LLVM IR.
///
///     Math math(builder, {.contract = false});
///     llvm::Value* falloff = math.exp2(math.f_min(depth, limit));  // float or <16 x float>
///
/// The instructions are emitted at the builder's insertion point, which stays where it is; fast-math flags of the
/// builder are not used, because the functions rely on the order of operations. All code is straight-line and the same
/// for a scalar and for every lane count: without `contract` each lane has the bits that a scalar call would give, on
/// every target. The code relies on round-to-nearest and on denormals being kept (the state in which the ABI starts
/// every thread).

namespace nacre::cpu {

struct MathOptions {
    /// Products may be fused with the sum that they go into where the target does so quickly. Results are as accurate
    /// or better, but depend on the target.
    bool contract = false;
    /// The target converts between half and single precision by instructions (F16C, AVX-512, NEON). Results are the
    /// same bits.
    bool half_instructions = false;
    /// The target takes numbers apart and scales them by powers of two by instructions (AVX-512 F and VL): less code
    /// for exponentials and logarithms, within the same bounds of error.
    bool exponent_instructions = false;
    /// The target converts single precision to unsigned 32-bit integers by an instruction that gives the largest one
    /// for what is larger (AVX-512 F and VL). Results are the same bits.
    bool conversion_instructions = false;
};

/// Emits functions of one or many values.
///
/// Every argument is a scalar or a vector of any length, all arguments of a call alike. Floating-point arguments are
/// float, double or half where nothing else is said, and results have the type of the arguments. Single precision is
/// polynomial code made here. Half goes through single precision. Double is the reference mode: transcendental
/// functions call the C library once for each lane (the code that results needs `sin`, `exp2`, ... at link time), which
/// is accurate to about 1 ulp.
///
/// Single precision: largest error in units of the last place, without contraction (over all floats: the tests in
/// tests/backends/cpu/math with NACRE_TEST_ALL_FLOATS=1; they take a million without), and AVX-512 instructions for
/// 16 lanes without and with contraction, and with `exponent_instructions` too.
///
///     function  error  instructions        function      error  instructions
///     sin       2.0      29, 22            exp           1.0      30, 24, 18
///     cos       2.3      32, 25            exp2          1.1      26, 21, 15
///     tan       4.3      37, 28            log           0.9      44, 35, 22
///     asin      2.4      22, 18            log2          2.3      38, 30, 16
///     acos      1.3      27, 23            pow           below    67, 54, 36
///     atan      2.0      27, 19            inverse_sqrt  1.5       3, 3
///     atan2     3        38, 30            asinh         1.8
///     sinh      1.6      45, 37, 32        acosh         2.4
///     tanh      1.3      49, 40, 34        atanh         2.0
///     cosh      1.4
///
/// atan2: bound, tested on pairs of some hundred floats. sin and cos: for |x| <= 1e5, where an absolute error of 2^-32
/// counts as none (near zeros of large arguments). tan: for |x| <= 1e3; up to 1e5, where numbers come as near to poles
/// as 2^-24, it is 40. pow: at most 1.5 + 3.9 * |y * log2(x)|, as Vulkan's table derives it from these log2 and exp2.
/// A NaN argument gives NaN unless said otherwise; an argument outside of a function's domain too.
class Math {
  public:
    using Value = llvm::Value;

    explicit Math(llvm::IRBuilder<>& builder, MathOptions options = {}) : builder_(builder), options_(options) {}
    Math(llvm::IRBuilder<>& builder, bool contract) : Math(builder, MathOptions{.contract = contract}) {}

    // ---- Trigonometry: trigonometry.cpp, inverse_trigonometry.cpp ----
    // Radians. Single precision sin, cos and tan: accurate up to |x| = 1e5; beyond, accuracy falls, but sin and cos
    // stay in [-1, 1] for every finite x. NaN for infinity.

    Value* sin(Value* x);
    Value* cos(Value* x);
    Value* tan(Value* x);
    Value* asin(Value* x);
    Value* acos(Value* x);
    Value* atan(Value* x);
    /// Angle of the point (x, y) in [-pi, pi]; signs of zeros count as in C, atan2(0, 0) = 0.
    Value* atan2(Value* y, Value* x);

    // ---- Hyperbolic functions: hyperbolics.cpp ----

    Value* sinh(Value* x);
    Value* cosh(Value* x);
    Value* tanh(Value* x);
    Value* asinh(Value* x);
    Value* acosh(Value* x);
    Value* atanh(Value* x);

    // ---- Exponentials and powers: exponentials.cpp, powers.cpp ----

    Value* exp(Value* x);
    Value* exp2(Value* x);
    Value* log(Value* x);   ///< -infinity at zero.
    Value* log2(Value* x);  ///< -infinity at zero.
    /// x to the power y: exp2(y * log2(x)), NaN where x < 0. pow(x, 0) = 1 for every x. Where y is a constant whole
    /// number up to 64 in magnitude, or one half more or less than zero, the result is made of products and square
    /// roots; negative x is then fine for whole exponents.
    Value* pow(Value* x, Value* y);
    Value* sqrt(Value* x);          ///< Correctly rounded.
    Value* inverse_sqrt(Value* x);  ///< 1 / sqrt(x), two roundings; infinity of x's sign at zero.
    /// a * b + c with one rounding, whatever the options. A call of `fma` or `fmaf` for each lane where the target has
    /// no instruction.
    Value* fma(Value* a, Value* b, Value* c);

    // ---- Rounding and parts of numbers: rounding.cpp ----

    Value* floor(Value* x);
    Value* ceil(Value* x);
    Value* trunc(Value* x);
    Value* round_even(Value* x);  ///< Halves go to the even neighbor.
    Value* round(Value* x);       ///< Halves go away from zero.
    Value* fract(Value* x);       ///< x - floor(x) as rounded: 1 for tiny negative x. NaN for infinities.

    struct Parts {
        Value* fraction;  ///< Has the sign of x; zero for infinities.
        Value* whole;
    };
    Parts modf(Value* x);

    struct Scaled {
        Value* significand;  ///< Magnitude in [0.5, 1), or x itself where x is zero, infinite or NaN.
        Value* exponent;     ///< i32 in each lane; 0 where x is zero, infinite or NaN.
    };
    Scaled frexp(Value* x);

    /// x * 2^exponent with one rounding, for an exponent of any integer type and any value.
    Value* ldexp(Value* x, Value* exponent);

    // ---- Comparisons and interpolation: comparisons.cpp ----

    Value* f_abs(Value* x);
    Value* sign(Value* x);                              ///< -1, 0 or 1; 0 for NaN.
    Value* f_min(Value* x, Value* y);                   ///< x < y ? x : y, so y where one is NaN.
    Value* f_max(Value* x, Value* y);                   ///< x > y ? x : y, so y where one is NaN.
    Value* n_min(Value* x, Value* y);                   ///< The one that is a number where the other is NaN.
    Value* n_max(Value* x, Value* y);                   ///< The one that is a number where the other is NaN.
    Value* f_clamp(Value* x, Value* low, Value* high);  ///< f_min(f_max(x, low), high), so low where x is NaN.
    Value* n_clamp(Value* x, Value* low, Value* high);  ///< n_min(n_max(x, low), high); low where x is NaN.
    Value* step(Value* edge, Value* x);                 ///< x < edge ? 0 : 1.
    Value* smooth_step(Value* edge0, Value* edge1, Value* x);
    Value* mix(Value* x, Value* y, Value* a);  ///< x * (1 - a) + y * a.
    Value* f_rem(Value* x, Value* y);          ///< x - y * trunc(x / y) in that order of roundings (OpFRem).
    Value* f_mod(Value* x, Value* y);          ///< x - y * floor(x / y) in that order of roundings (OpFMod, GLSL mod).

    // ---- Conversions: conversions.cpp, half.cpp ----

    /// Toward zero, to an integer of the given bits; saturates, and NaN gives 0.
    Value* float_to_int(Value* x, unsigned bits, bool is_signed);
    /// To `element` (half, float or double), rounded to nearest even.
    Value* int_to_float(Value* x, llvm::Type* element, bool is_signed);
    /// Bits of the nearest half (ties to even; denormals kept, overflow to infinity, NaN quieted and its payload cut
    /// off) as i16. Double is rounded to float first.
    Value* float_to_half(Value* x);
    /// The float of the bits of a half, given as i16 or as the low 16 bits of i32. NaN is quieted.
    Value* half_to_float(Value* bits);
    /// From one floating-point type to another, by the rules of the two calls above where half takes part.
    Value* convert_float(Value* x, llvm::Type* element);
    /// The value that half would hold, in x's type; what is below the normal halves becomes zero of the same sign
    /// (OpQuantizeToF16).
    Value* quantize_to_f16(Value* x);

    // ---- Packing: packing.cpp ----
    // Components come and go as separate values, first component in the lowest bits; the packed word is i32. Unpacked
    // components are float; packed ones are rounded to float first. NaN packs as 0 in the normalized formats, which
    // round halves to even.

    Value* pack_unorm4x8(const std::array<Value*, 4>& components);
    Value* pack_snorm4x8(const std::array<Value*, 4>& components);
    Value* pack_unorm2x16(const std::array<Value*, 2>& components);
    Value* pack_snorm2x16(const std::array<Value*, 2>& components);
    Value* pack_half2x16(const std::array<Value*, 2>& components);
    Value* pack_double2x32(const std::array<Value*, 2>& words);  ///< Low word first; result is double.
    std::array<Value*, 4> unpack_unorm4x8(Value* word);
    std::array<Value*, 4> unpack_snorm4x8(Value* word);
    std::array<Value*, 2> unpack_unorm2x16(Value* word);
    std::array<Value*, 2> unpack_snorm2x16(Value* word);
    std::array<Value*, 2> unpack_half2x16(Value* word);
    std::array<Value*, 2> unpack_double2x32(Value* number);  ///< Low word first; i32.

    // ---- Integers of 8 to 64 bits: division.cpp, integers.cpp ----
    // Nothing traps. The least integer divided by -1 is itself, with remainder 0.

    Value* s_div(Value* x, Value* y);  ///< Toward zero; x / 0 = 0.
    Value* s_rem(Value* x, Value* y);  ///< Sign of x; x rem 0 = -1.
    Value* s_mod(Value* x, Value* y);  ///< Sign of y; x mod 0 = -1.
    Value* u_div(Value* x, Value* y);  ///< x / 0 = all ones.
    Value* u_mod(Value* x, Value* y);  ///< x mod 0 = all ones.

    // The amount, of any integer type, counts modulo the width of x.
    Value* shift_left(Value* x, Value* amount);
    Value* shift_right_logical(Value* x, Value* amount);
    Value* shift_right_arithmetic(Value* x, Value* amount);

    Value* find_lsb(Value* x);    ///< Number of the lowest 1; -1 for zero.
    Value* find_s_msb(Value* x);  ///< Number of the highest bit that differs from the sign; -1 for 0 and -1.
    Value* find_u_msb(Value* x);  ///< Number of the highest 1; -1 for zero.
    Value* bit_reverse(Value* x);
    Value* bit_count(Value* x);
    // Offset and count are of any integer type and taken as unsigned. A field that reaches past the width is cut off
    // there; a count of 0 is fine (base itself, or 0).
    Value* bitfield_insert(Value* base, Value* insert, Value* offset, Value* count);
    Value* bitfield_s_extract(Value* base, Value* offset, Value* count);
    Value* bitfield_u_extract(Value* base, Value* offset, Value* count);

    Value* s_abs(Value* x);  ///< The least integer stays itself.
    Value* s_sign(Value* x);
    Value* s_min(Value* x, Value* y);
    Value* s_max(Value* x, Value* y);
    Value* u_min(Value* x, Value* y);
    Value* u_max(Value* x, Value* y);
    Value* s_clamp(Value* x, Value* low, Value* high);
    Value* u_clamp(Value* x, Value* low, Value* high);

    struct Carried {
        Value* result;
        Value* carry;  ///< 0 or 1, in the type of the result.
    };
    Carried uadd_carry(Value* x, Value* y);
    Carried usub_borrow(Value* x, Value* y);

    struct Product {
        Value* low;
        Value* high;
    };
    Product umul_extended(Value* x, Value* y);
    Product smul_extended(Value* x, Value* y);

  private:
    llvm::IRBuilder<>& builder_;
    MathOptions options_;
};

}  // namespace nacre::cpu
