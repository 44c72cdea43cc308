// SPDX-License-Identifier: Apache-2.0
// Arithmetic on all lanes at once. Nothing here depends on the lane count or the instruction set: every result is the
// same to the last bit everywhere.
#pragma once

#include "backends/cpu/images/kernels/simd_gather.h"

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

template <int W>
NACRE_INLINE Floats<W> load_floats(const void* from) {
    Floats<W> value;
    __builtin_memcpy(&value, from, sizeof value);
    return value;
}
template <int W>
NACRE_INLINE Ints<W> load_ints(const void* from) {
    Ints<W> value;
    __builtin_memcpy(&value, from, sizeof value);
    return value;
}
template <int W>
NACRE_INLINE void store_lanes(void* to, Ints<W> value) {
    __builtin_memcpy(to, &value, sizeof value);
}

template <int W>
NACRE_INLINE Floats<W> splat(float x) {
    return Floats<W>{} + x;
}
template <int W>
NACRE_INLINE Ints<W> splat(std::int32_t x) {
    return Ints<W>{} + x;
}

template <int W>
NACRE_INLINE Ints<W> lane_numbers() {
    if constexpr (W == 4)
        return Ints<W>{0, 1, 2, 3};
    else if constexpr (W == 8)
        return Ints<W>{0, 1, 2, 3, 4, 5, 6, 7};
    else
        return Ints<W>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
}
template <int W>
NACRE_INLINE Ints<W> mask_of_bits(std::uint32_t bits) {
    const Ints<W> one = splat<W>(1) << lane_numbers<W>();
    return (splat<W>(static_cast<std::int32_t>(bits)) & one) != 0;
}
template <int W>
inline constexpr std::uint32_t all_lanes = W == 32 ? ~0u : (1u << W) - 1;

template <int W>
NACRE_INLINE Floats<W> minimum(Floats<W> a, Floats<W> b) {
    return a < b ? a : b;
}
template <int W>
NACRE_INLINE Floats<W> maximum(Floats<W> a, Floats<W> b) {
    return a > b ? a : b;
}
template <int W>
NACRE_INLINE Ints<W> minimum(Ints<W> a, Ints<W> b) {
    return a < b ? a : b;
}
template <int W>
NACRE_INLINE Ints<W> maximum(Ints<W> a, Ints<W> b) {
    return a > b ? a : b;
}
/// NaN gives `low`.
template <int W>
NACRE_INLINE Floats<W> clamp(Floats<W> x, Floats<W> low, Floats<W> high) {
    const Floats<W> above = x > low ? x : low;
    return above < high ? above : high;
}
template <int W>
NACRE_INLINE Ints<W> clamp(Ints<W> x, std::int32_t low, std::int32_t high) {
    return minimum<W>(maximum<W>(x, splat<W>(low)), splat<W>(high));
}
template <int W>
NACRE_INLINE Floats<W> absolute(Floats<W> x) {
    return (Floats<W>)((Ints<W>)x & 0x7fffffff);
}

template <int W>
NACRE_INLINE Floats<W> to_floats(Ints<W> x) {
    return __builtin_convertvector(x, Floats<W>);
}
/// Towards zero; |x| < 2^31.
template <int W>
NACRE_INLINE Ints<W> truncate(Floats<W> x) {
    return __builtin_convertvector(x, Ints<W>);
}
/// |x| < 2^31; a zero has any sign.
template <int W>
NACRE_INLINE Floats<W> floor_small(Floats<W> x) {
#ifdef NACRE_NATIVE_FLOOR
    return floor_natively<W>(x);
#endif
    const Floats<W> whole = to_floats<W>(truncate<W>(x));
    return whole - (whole > x ? splat<W>(1.0f) : splat<W>(0.0f));
}
/// To nearest, ties to even; |x| < 2^22.
template <int W>
NACRE_INLINE Floats<W> round_small(Floats<W> x) {
    return (x + 12582912.0f) - 12582912.0f;
}
/// x - floor(x) in [0, 1]; 0 for infinities and NaN. 1 only where x is so little below a whole number that it rounds
/// up.
template <int W>
NACRE_INLINE Floats<W> fraction(Floats<W> x) {
#ifdef NACRE_NATIVE_FLOOR
    return maximum<W>(x - floor_natively<W>(x), splat<W>(0.0f));
#endif
    const Ints<W> has_fraction = absolute<W>(x) < 8388608.0f;
    const Floats<W> small = has_fraction ? x : splat<W>(0.0f);
    return small - floor_small<W>(small);
}

/// Logarithm to base 2, linear between the powers of two: too small by up to 0.0861. x >= 0; 0 and NaN (whose bits
/// differ between machines) give -127, infinity gives 128.
template <int W>
NACRE_INLINE Floats<W> linear_log2(Floats<W> x) {
    const Floats<W> result = to_floats<W>((Ints<W>)x - 0x3f800000) * 0x1p-23f;
    return x >= 1.17549435e-38f ? result : splat<W>(-127.0f);
}

/// Lane `which` of each quad in all four lanes of it.
template <int W, int which>
NACRE_INLINE Floats<W> spread_in_quads(Floats<W> v) {
    if constexpr (W == 4) {
        return __builtin_shufflevector(v, v, which, which, which, which);
    } else if constexpr (W == 8) {
        return __builtin_shufflevector(v, v, which, which, which, which, which + 4, which + 4, which + 4, which + 4);
    } else {
        return __builtin_shufflevector(v, v, which, which, which, which, which + 4, which + 4, which + 4, which + 4,
                                       which + 8, which + 8, which + 8, which + 8, which + 12, which + 12, which + 12,
                                       which + 12);
    }
}

/// Derivatives for the level of detail: one for each quad, from its upper left corner, as Mesa's software drivers take
/// them. Shaders' own derivatives are the compiler's.
template <int W>
NACRE_INLINE Floats<W> difference_x(Floats<W> v) {
    return spread_in_quads<W, 1>(v) - spread_in_quads<W, 0>(v);
}
template <int W>
NACRE_INLINE Floats<W> difference_y(Floats<W> v) {
    return spread_in_quads<W, 2>(v) - spread_in_quads<W, 0>(v);
}

/// 16-bit floats in the low half of each lane. Without arithmetic on denormals, which some code switches off.
template <int W>
NACRE_INLINE Floats<W> halves_to_floats(Ints<W> half) {
#ifdef __F16C__
    return halves_to_floats_natively<W>(half);
#else
    const Ints<W> sign = (half & 0x8000) << 16, magnitude = half & 0x7fff, moved = magnitude << 13;
    const Ints<W> tiny = (Ints<W>)(to_floats<W>(magnitude) * 0x1p-24f);
    const Ints<W> not_finite = moved | (magnitude > 0x7c00 ? splat<W>(0x7fc00000) : splat<W>(0x7f800000));
    Ints<W> result = moved + (112 << 23);
    result = magnitude < 0x400 ? tiny : result;
    result = magnitude >= 0x7c00 ? not_finite : result;
    return (Floats<W>)(result | sign);
#endif
}

/// The other way, for floats of a 5-bit exponent and `mantissa_bits` (10, 6 or 5): magnitude only, rounded to nearest
/// even. Overflow gives infinity, or the largest finite value where `saturates` (infinity stays infinity).
template <int W>
NACRE_INLINE Ints<W> floats_to_small(Floats<W> value, std::int32_t mantissa_bits, bool saturates) {
    const Ints<W> bits = (Ints<W>)value & 0x7fffffff;
    const std::int32_t dropped = 23 - mantissa_bits, infinity = 31 << mantissa_bits;
    const Uints<W> to_even = (Uints<W>)(((bits >> dropped) & 1) + ((1 << (dropped - 1)) - 1));
    Ints<W> result = (Ints<W>)(((Uints<W>)bits + to_even) >> static_cast<unsigned>(dropped)) - (112 << mantissa_bits);
    result = minimum<W>(result, splat<W>(saturates ? infinity - 1 : infinity));
    const float scale = mantissa_bits == 10 ? 0x1p24f : mantissa_bits == 6 ? 0x1p20f : 0x1p19f;
    const Ints<W> is_tiny = bits < 0x38800000;
    const Floats<W> tiny = is_tiny ? (Floats<W>)bits * scale : splat<W>(0.0f);
    result = is_tiny ? truncate<W>(round_small<W>(tiny)) : result;
    result = bits >= 0x7f800000 ? splat<W>(infinity) : result;
    const Ints<W> nan =
        splat<W>(infinity | (1 << (mantissa_bits - 1))) | ((bits >> dropped) & ((1 << mantissa_bits) - 1));
    return bits > 0x7f800000 ? nan : result;
}

/// 16-bit floats with their sign, rounded to nearest even; overflow gives infinity.
template <int W>
NACRE_INLINE Ints<W> floats_to_halves(Floats<W> value) {
#ifdef __F16C__
    return floats_to_halves_natively<W>(value);
#else
    return floats_to_small<W>(value, 10, false) | (Ints<W>)(((Uints<W>)value >> 16) & 0x8000u);
#endif
}

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
