// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

/// @file
/// Sixteen lanes of floats or integers in as many registers as the instruction set of the including file needs.
/// Everything has internal linkage: each file that includes this is compiled for another instruction set.
///
/// Every operation gives the same bits on every instruction set.

namespace nacre::cpu::raster {
namespace {

#define NACRE_LANES_INLINE [[gnu::always_inline]] inline

#if defined(__AVX512F__)
constexpr int register_lanes = 16;
#elif defined(__AVX2__)
constexpr int register_lanes = 8;
#else
constexpr int register_lanes = 4;
#endif
constexpr int registers = 16 / register_lanes;
using FloatRegister [[gnu::vector_size(register_lanes * 4)]] = float;
using IntRegister [[gnu::vector_size(register_lanes * 4)]] = std::int32_t;
using UintRegister [[gnu::vector_size(register_lanes * 4)]] = std::uint32_t;

struct Floats {
    FloatRegister part[registers];
};
struct Ints {
    IntRegister part[registers];
};
/// A truth value for each lane.
struct Lanes {
#if defined(__AVX512F__)
    __mmask16 bits;
#else
    IntRegister part[registers];  ///< All bits or none.
#endif
};

#define NACRE_EACH for (int i = 0; i < registers; ++i)

NACRE_LANES_INLINE Floats floats(float value) {
    Floats result;
    NACRE_EACH result.part[i] =
        value - FloatRegister{};  // Adding zero would not keep a negative zero, and takes an addition.
    return result;
}
NACRE_LANES_INLINE Ints ints(std::int32_t value) {
    Ints result;
    NACRE_EACH result.part[i] = IntRegister{} + value;
    return result;
}
NACRE_LANES_INLINE Floats load(const float* from) {
    Floats result;
    std::memcpy(&result, from, sizeof(result));
    return result;
}
NACRE_LANES_INLINE Ints load(const std::int32_t* from) {
    Ints result;
    std::memcpy(&result, from, sizeof(result));
    return result;
}
NACRE_LANES_INLINE Ints load(const std::uint32_t* from) {
    Ints result;
    std::memcpy(&result, from, sizeof(result));
    return result;
}
NACRE_LANES_INLINE void store(float* to, const Floats& value) { std::memcpy(to, &value, sizeof(value)); }
NACRE_LANES_INLINE void store(std::int32_t* to, const Ints& value) { std::memcpy(to, &value, sizeof(value)); }
NACRE_LANES_INLINE void store(std::uint32_t* to, const Ints& value) { std::memcpy(to, &value, sizeof(value)); }
NACRE_LANES_INLINE Ints bits_of(const Floats& value) { return __builtin_bit_cast(Ints, value); }
NACRE_LANES_INLINE Floats floats_of_bits(const Ints& value) { return __builtin_bit_cast(Floats, value); }

#define NACRE_BINARY(TYPE, OPERATOR)                                          \
    NACRE_LANES_INLINE TYPE operator OPERATOR(const TYPE& a, const TYPE& b) { \
        TYPE result;                                                          \
        NACRE_EACH result.part[i] = a.part[i] OPERATOR b.part[i];             \
        return result;                                                        \
    }
NACRE_BINARY(Floats, +)
NACRE_BINARY(Floats, -)
NACRE_BINARY(Floats, *)
NACRE_BINARY(Floats, /)
NACRE_BINARY(Ints, &)
NACRE_BINARY(Ints, |)
NACRE_BINARY(Ints, ^)
#undef NACRE_BINARY
/// a * b + c, rounded once.
NACRE_LANES_INLINE Floats fused(const Floats& a, const Floats& b, const Floats& c) {
    Floats result;
#if defined(__AVX512F__)
    result.part[0] = (FloatRegister)_mm512_fmadd_ps((__m512)a.part[0], (__m512)b.part[0], (__m512)c.part[0]);
#elif defined(__FMA__)
    NACRE_EACH result.part[i] = (FloatRegister)_mm256_fmadd_ps((__m256)a.part[i], (__m256)b.part[i], (__m256)c.part[i]);
#else
    NACRE_EACH for (int lane = 0; lane < register_lanes; ++lane) result.part[i][lane] =
        __builtin_fmaf(a.part[i][lane], b.part[i][lane], c.part[i][lane]);
#endif
    return result;
}
// Unsigned arithmetic underneath: integers wrap.
#define NACRE_WRAPPING(OPERATOR)                                                                             \
    NACRE_LANES_INLINE Ints operator OPERATOR(const Ints& a, const Ints& b) {                                \
        Ints result;                                                                                         \
        NACRE_EACH result.part[i] = (IntRegister)((UintRegister)a.part[i] OPERATOR(UintRegister) b.part[i]); \
        return result;                                                                                       \
    }
NACRE_WRAPPING(+)
NACRE_WRAPPING(-)
NACRE_WRAPPING(*)
#undef NACRE_WRAPPING
NACRE_LANES_INLINE Ints operator~(const Ints& a) { return a ^ ints(-1); }
template <int count>
NACRE_LANES_INLINE Ints shift_left(const Ints& a) {
    Ints result;
    NACRE_EACH result.part[i] = (IntRegister)((UintRegister)a.part[i] << count);
    return result;
}
/// Without sign.
template <int count>
NACRE_LANES_INLINE Ints shift_right(const Ints& a) {
    Ints result;
    NACRE_EACH result.part[i] = (IntRegister)((UintRegister)a.part[i] >> count);
    return result;
}
NACRE_LANES_INLINE Ints shift_left(const Ints& a, int count) {
    Ints result;
    NACRE_EACH result.part[i] =
        (IntRegister)((UintRegister)a.part[i] << (UintRegister{} + static_cast<std::uint32_t>(count)));
    return result;
}
NACRE_LANES_INLINE Ints shift_right(const Ints& a, int count) {
    Ints result;
    NACRE_EACH result.part[i] =
        (IntRegister)((UintRegister)a.part[i] >> (UintRegister{} + static_cast<std::uint32_t>(count)));
    return result;
}
template <int count>
NACRE_LANES_INLINE Ints shift_right_signed(const Ints& a) {
    Ints result;
    NACRE_EACH result.part[i] = a.part[i] >> count;
    return result;
}
alignas(64) constexpr std::int32_t lane_numbers[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
NACRE_LANES_INLINE Floats to_floats(const Ints& a) {
    Floats result;
    NACRE_EACH result.part[i] = __builtin_convertvector(a.part[i], FloatRegister);
    return result;
}
/// To the nearest integer, halves to the even one. |a| < 2^31.
NACRE_LANES_INLINE Ints round_to_ints(const Floats& a) {
    Ints result;
#if defined(__AVX512F__)
    NACRE_EACH result.part[i] = (IntRegister)_mm512_cvtps_epi32(a.part[i]);
#elif defined(__AVX2__)
    NACRE_EACH result.part[i] = (IntRegister)_mm256_cvtps_epi32(a.part[i]);
#elif defined(__x86_64__)
    NACRE_EACH result.part[i] = (IntRegister)_mm_cvtps_epi32(a.part[i]);
#elif defined(__aarch64__)
    NACRE_EACH result.part[i] = (IntRegister)vcvtnq_s32_f32((float32x4_t)a.part[i]);
#else
    NACRE_EACH for (int j = 0; j < register_lanes; ++j) result.part[i][j] =
        static_cast<std::int32_t>(__builtin_rintf(a.part[i][j]));
#endif
    return result;
}

// Comparisons of floats are false where one side is not a number.
#if defined(__AVX512F__)
NACRE_LANES_INLINE Lanes less(const Floats& a, const Floats& b) {
    return {_mm512_cmp_ps_mask(a.part[0], b.part[0], _CMP_LT_OQ)};
}
NACRE_LANES_INLINE Lanes less_or_equal(const Floats& a, const Floats& b) {
    return {_mm512_cmp_ps_mask(a.part[0], b.part[0], _CMP_LE_OQ)};
}
NACRE_LANES_INLINE Lanes less(const Ints& a, const Ints& b) {
    return {_mm512_cmplt_epi32_mask((__m512i)a.part[0], (__m512i)b.part[0])};
}
NACRE_LANES_INLINE Lanes equal(const Ints& a, const Ints& b) {
    return {_mm512_cmpeq_epi32_mask((__m512i)a.part[0], (__m512i)b.part[0])};
}
NACRE_LANES_INLINE Lanes not_negative(const Ints& a) {
    return {static_cast<__mmask16>(~_mm512_movepi32_mask((__m512i)a.part[0]))};
}
NACRE_LANES_INLINE Lanes operator&(const Lanes& a, const Lanes& b) { return {static_cast<__mmask16>(a.bits & b.bits)}; }
NACRE_LANES_INLINE Lanes operator|(const Lanes& a, const Lanes& b) { return {static_cast<__mmask16>(a.bits | b.bits)}; }
NACRE_LANES_INLINE Lanes operator~(const Lanes& a) { return {static_cast<__mmask16>(~a.bits)}; }
NACRE_LANES_INLINE std::uint32_t mask_of(const Lanes& a) { return a.bits; }
NACRE_LANES_INLINE Lanes lanes_of(std::uint32_t mask) { return {static_cast<__mmask16>(mask)}; }
NACRE_LANES_INLINE Ints select(const Lanes& which, const Ints& a, const Ints& b) {
    return {(IntRegister)_mm512_mask_blend_epi32(which.bits, (__m512i)b.part[0], (__m512i)a.part[0])};
}
NACRE_LANES_INLINE Floats select(const Lanes& which, const Floats& a, const Floats& b) {
    return {_mm512_mask_blend_ps(which.bits, b.part[0], a.part[0])};
}
#else
#define NACRE_COMPARISON(NAME, TYPE, OPERATOR)                                   \
    NACRE_LANES_INLINE Lanes NAME(const TYPE& a, const TYPE& b) {                \
        Lanes result;                                                            \
        NACRE_EACH result.part[i] = (IntRegister)(a.part[i] OPERATOR b.part[i]); \
        return result;                                                           \
    }
NACRE_COMPARISON(less, Floats, <)
NACRE_COMPARISON(less_or_equal, Floats, <=)
NACRE_COMPARISON(less, Ints, <)
NACRE_COMPARISON(equal, Ints, ==)
NACRE_COMPARISON(operator&, Lanes, &)
NACRE_COMPARISON(operator|, Lanes, |)
#undef NACRE_COMPARISON
NACRE_LANES_INLINE Lanes operator~(const Lanes& a) {
    Lanes result;
    NACRE_EACH result.part[i] = ~a.part[i];
    return result;
}
NACRE_LANES_INLINE Lanes not_negative(const Ints& a) {
    Lanes result;
    NACRE_EACH result.part[i] = (IntRegister)(a.part[i] >= IntRegister{});
    return result;
}
NACRE_LANES_INLINE std::uint32_t mask_of(const Lanes& a) {
    std::uint32_t mask = 0;
#if defined(__AVX2__)
    NACRE_EACH mask |= static_cast<std::uint32_t>(_mm256_movemask_ps((__m256)a.part[i])) << (8 * i);
#elif defined(__x86_64__)
    NACRE_EACH mask |= static_cast<std::uint32_t>(_mm_movemask_ps((__m128)a.part[i])) << (4 * i);
#else
    NACRE_EACH for (int j = 0; j < register_lanes; ++j) mask |= (a.part[i][j] & 1u) << (register_lanes * i + j);
#endif
    return mask;
}
alignas(64) constexpr std::int32_t lane_bits[16] = {1,       1 << 1,  1 << 2,  1 << 3, 1 << 4,  1 << 5,
                                                    1 << 6,  1 << 7,  1 << 8,  1 << 9, 1 << 10, 1 << 11,
                                                    1 << 12, 1 << 13, 1 << 14, 1 << 15};
NACRE_LANES_INLINE Lanes lanes_of(std::uint32_t mask) {
    const Ints own = load(lane_bits);
    return equal(ints(static_cast<std::int32_t>(mask)) & own, own);
}
NACRE_LANES_INLINE Ints select(const Lanes& which, const Ints& a, const Ints& b) {
    Ints result;
    NACRE_EACH result.part[i] = (a.part[i] & which.part[i]) | (b.part[i] & ~which.part[i]);
    return result;
}
NACRE_LANES_INLINE Floats select(const Lanes& which, const Floats& a, const Floats& b) {
    return floats_of_bits(select(which, bits_of(a), bits_of(b)));
}
#endif

NACRE_LANES_INLINE Lanes less(const Floats& a, float b) { return less(a, floats(b)); }
// `a` where it is below (above) `b`; `b` where one is not a number, and of two zeros. That is what the instructions of
// x86 do.
#if defined(__AVX512F__)
NACRE_LANES_INLINE Floats minimum(const Floats& a, const Floats& b) { return {_mm512_min_ps(a.part[0], b.part[0])}; }
NACRE_LANES_INLINE Floats maximum(const Floats& a, const Floats& b) { return {_mm512_max_ps(a.part[0], b.part[0])}; }
NACRE_LANES_INLINE Ints minimum(const Ints& a, const Ints& b) {
    return {(IntRegister)_mm512_min_epi32((__m512i)a.part[0], (__m512i)b.part[0])};
}
NACRE_LANES_INLINE Ints maximum(const Ints& a, const Ints& b) {
    return {(IntRegister)_mm512_max_epi32((__m512i)a.part[0], (__m512i)b.part[0])};
}
#else
#if defined(__AVX2__)
NACRE_LANES_INLINE FloatRegister minimum(FloatRegister a, FloatRegister b) { return _mm256_min_ps(a, b); }
NACRE_LANES_INLINE FloatRegister maximum(FloatRegister a, FloatRegister b) { return _mm256_max_ps(a, b); }
#elif defined(__x86_64__)
NACRE_LANES_INLINE FloatRegister minimum(FloatRegister a, FloatRegister b) { return _mm_min_ps(a, b); }
NACRE_LANES_INLINE FloatRegister maximum(FloatRegister a, FloatRegister b) { return _mm_max_ps(a, b); }
#else
NACRE_LANES_INLINE FloatRegister minimum(FloatRegister a, FloatRegister b) { return a < b ? a : b; }
NACRE_LANES_INLINE FloatRegister maximum(FloatRegister a, FloatRegister b) { return b < a ? a : b; }
#endif
NACRE_LANES_INLINE Floats minimum(const Floats& a, const Floats& b) {
    Floats result;
    NACRE_EACH result.part[i] = minimum(a.part[i], b.part[i]);
    return result;
}
NACRE_LANES_INLINE Floats maximum(const Floats& a, const Floats& b) {
    Floats result;
    NACRE_EACH result.part[i] = maximum(a.part[i], b.part[i]);
    return result;
}
NACRE_LANES_INLINE Ints minimum(const Ints& a, const Ints& b) { return select(less(a, b), a, b); }
NACRE_LANES_INLINE Ints maximum(const Ints& a, const Ints& b) { return select(less(b, a), a, b); }
#endif
/// In [low, high]; `low` where `a` is not a number.
NACRE_LANES_INLINE Floats clamp(const Floats& a, float low, float high) {
    return minimum(maximum(a, floats(low)), floats(high));
}
NACRE_LANES_INLINE Floats absolute(const Floats& a) { return floats_of_bits(bits_of(a) & ints(0x7fffffff)); }

#undef NACRE_EACH

/// A number as a type: `at` is a constant where it is used.
template <int number>
struct Index {
    static constexpr int at = number;
};
/// Calls `work` with Index<0>, Index<1>, ... one after the other: a loop that is unrolled for certain, so that arrays
/// over its index stay in registers.
template <int count, typename Work>
NACRE_LANES_INLINE void unrolled(const Work& work) {
    if constexpr (count > 1) unrolled<count - 1>(work);
    if constexpr (count > 0) work(Index<count - 1>{});
}

/// Four floats or integers, as the rows of a vertex or plane, or the pixels of a quad.
using Float4 [[gnu::vector_size(16)]] = float;
using Int4 [[gnu::vector_size(16)]] = std::int32_t;
using Long2 [[gnu::vector_size(16)]] = std::int64_t;

NACRE_LANES_INLINE Float4 load4(const float* from) {
    Float4 result;
    std::memcpy(&result, from, sizeof(result));
    return result;
}
NACRE_LANES_INLINE void store4(float* to, Float4 value) { std::memcpy(to, &value, sizeof(value)); }
NACRE_LANES_INLINE Int4 load4(const void* from) {
    Int4 result;
    std::memcpy(&result, from, sizeof(result));
    return result;
}
NACRE_LANES_INLINE void store4(void* to, Int4 value) { std::memcpy(to, &value, sizeof(value)); }
/// Writes the lanes whose bit is set.
NACRE_LANES_INLINE void store_some4(void* to, Int4 value, std::uint32_t mask) {
#if defined(__AVX512VL__)
    _mm_mask_storeu_epi32(to, static_cast<__mmask8>(mask), (__m128i)value);
#else
    const Int4 kept = ((static_cast<std::int32_t>(mask) & Int4{1, 2, 4, 8}) == 0), old = load4(to);
    store4(to, value ^ ((value ^ old) & kept));
#endif
}
/// Lane i of the result is lane order[i] of the value; the order has numbers from 0 to 3.
NACRE_LANES_INLINE Int4 shuffled(Int4 value, Int4 order) {
#if defined(__clang__)
    return Int4{value[order[0]], value[order[1]], value[order[2]], value[order[3]]};
#else
    return __builtin_shuffle(value, order);
#endif
}
/// Past the caches, which need not read the rest of the line then; seen by others after `end_streams`. Aligned to 16
/// bytes.
NACRE_LANES_INLINE void stream4(void* to, Int4 value) {
#if defined(__x86_64__)
    _mm_stream_si128(static_cast<__m128i*>(to), (__m128i)value);
#else
    store4(to, value);
#endif
}
NACRE_LANES_INLINE void end_streams() {
#if defined(__x86_64__)
    _mm_sfence();
#endif
}

/// Rows become columns.
template <typename Row>
NACRE_LANES_INLINE void transpose(Row& a, Row& b, Row& c, Row& d) {
    const Row ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5), ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    const Row cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5), cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
    a = __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5);
    b = __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7);
    c = __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5);
    d = __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7);
}

/// The sixteen groups of four bits of a number, the lowest first.
NACRE_LANES_INLINE Ints groups_of_four_bits(std::uint64_t bits) {
    Ints result;
#if defined(__AVX512F__)
    const __m512i words =
        _mm512_mask_set1_epi32(_mm512_set1_epi32(static_cast<int>(bits)), 0xff00, static_cast<int>(bits >> 32));
    const __m512i shifts = _mm512_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28, 0, 4, 8, 12, 16, 20, 24, 28);
    result.part[0] = (IntRegister)_mm512_and_epi32(_mm512_srlv_epi32(words, shifts), _mm512_set1_epi32(15));
#else
    alignas(64) constexpr std::int32_t shifts[8] = {0, 4, 8, 12, 16, 20, 24, 28};
    UintRegister shift;
    std::memcpy(&shift, shifts, sizeof(shift));
    for (int i = 0; i < registers; ++i) {
        const auto word = static_cast<std::uint32_t>(bits >> (4 * register_lanes * i));
        result.part[i] = (IntRegister)(((UintRegister{} + word) >> shift) & 15);
    }
#endif
    return result;
}

#if !defined(__AVX512F__)
/// The numbers of the lanes in a set of four, and behind them whatever.
alignas(16) constexpr std::int32_t lane_order[16][4] = {
    {0, 0, 0, 0}, {0, 0, 0, 0}, {1, 0, 0, 0}, {0, 1, 0, 0}, {2, 0, 0, 0}, {0, 2, 0, 0}, {1, 2, 0, 0}, {0, 1, 2, 0},
    {3, 0, 0, 0}, {0, 3, 0, 0}, {1, 3, 0, 0}, {0, 1, 3, 0}, {2, 3, 0, 0}, {0, 2, 3, 0}, {1, 2, 3, 0}, {0, 1, 2, 3}};
#endif
/// Writes the lanes whose bit is set, one behind the other, and whatever up to sixteen words behind `to`.
NACRE_LANES_INLINE void store_packed(std::uint32_t* to, std::uint32_t mask, const Ints& values) {
#if defined(__AVX512F__)
    _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(static_cast<__mmask16>(mask), (__m512i)values.part[0]));
#else
    alignas(64) std::int32_t lanes[16];
    store(lanes, values);
    for (int lane = 0; lane < 16; lane += 4) {
        const std::uint32_t four = mask >> lane & 15;
        store4(to, shuffled(load4(lanes + lane), load4(lane_order[four])));
        to += __builtin_popcount(four);
    }
#endif
}

/// Sixteen rows of four words, each from an address of its own, word by word: word w of row i is lane i of words[w].
/// @param address_of  gives the address of a row by its number
template <typename Address>
NACRE_LANES_INLINE void load_rows(const Address& address_of, Ints (&words)[4]) {
#if defined(__AVX512F__)
    // Rows 0, 4, 8 and 12 in one register, and so on: the words of a group of four come together without crossing the
    // parts of a register.
    __m512i rows[4];
    unrolled<4>([&](auto row) {
        const auto part = [&](int group) { return (__m128i)load4(address_of(4 * group + row.at)); };
        rows[row.at] = _mm512_inserti32x4(
            _mm512_inserti32x4(_mm512_inserti32x4(_mm512_castsi128_si512(part(0)), part(1), 1), part(2), 2), part(3),
            3);
    });
    const __m512i low01 = _mm512_unpacklo_epi32(rows[0], rows[1]), high01 = _mm512_unpackhi_epi32(rows[0], rows[1]);
    const __m512i low23 = _mm512_unpacklo_epi32(rows[2], rows[3]), high23 = _mm512_unpackhi_epi32(rows[2], rows[3]);
    words[0].part[0] = (IntRegister)_mm512_unpacklo_epi64(low01, low23);
    words[1].part[0] = (IntRegister)_mm512_unpackhi_epi64(low01, low23);
    words[2].part[0] = (IntRegister)_mm512_unpacklo_epi64(high01, high23);
    words[3].part[0] = (IntRegister)_mm512_unpackhi_epi64(high01, high23);
#else
    alignas(64) std::int32_t lanes[4][16];
    for (int lane = 0; lane < 16; lane += 4) {
        Int4 rows[4];
        for (int i = 0; i < 4; ++i) rows[i] = load4(address_of(lane + i));
        transpose(rows[0], rows[1], rows[2], rows[3]);
        for (int word = 0; word < 4; ++word) store4(lanes[word] + lane, rows[word]);
    }
    for (int word = 0; word < 4; ++word) words[word] = load(lanes[word]);
#endif
}
/// The other way round, for the first `count` rows.
template <typename Address>
NACRE_LANES_INLINE void store_rows(const Ints (&words)[4], std::uint32_t count, const Address& address_of) {
#if defined(__AVX512F__)
    const auto word = [&](int i) { return (__m512i)words[i].part[0]; };
    const __m512i low01 = _mm512_unpacklo_epi32(word(0), word(1)), high01 = _mm512_unpackhi_epi32(word(0), word(1));
    const __m512i low23 = _mm512_unpacklo_epi32(word(2), word(3)), high23 = _mm512_unpackhi_epi32(word(2), word(3));
    const __m512i rows[4] = {_mm512_unpacklo_epi64(low01, low23), _mm512_unpackhi_epi64(low01, low23),
                             _mm512_unpacklo_epi64(high01, high23), _mm512_unpackhi_epi64(high01, high23)};
    unrolled<16>([&](auto row) {
        if (static_cast<std::uint32_t>(row.at) < count)
            store4(address_of(row.at), (Int4)_mm512_extracti32x4_epi32(rows[row.at % 4], row.at / 4));
    });
#else
    alignas(64) std::int32_t lanes[4][16];
    for (int i = 0; i < 4; ++i) store(lanes[i], words[i]);
    for (std::uint32_t lane = 0; lane < count; lane += 4) {
        Int4 rows[4];
        for (int i = 0; i < 4; ++i) rows[i] = load4(lanes[i] + lane);
        transpose(rows[0], rows[1], rows[2], rows[3]);
        for (std::uint32_t i = 0; i < 4 && lane + i < count; ++i)
            store4(address_of(static_cast<int>(lane + i)), rows[i]);
    }
#endif
}

}  // namespace
}  // namespace nacre::cpu::raster
