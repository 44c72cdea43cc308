// SPDX-License-Identifier: Apache-2.0
// The few things that GCC's vector types cannot say: gathers, masks as bits, square roots. Every one has a form without
// intrinsics that gives the same bits, which other machines use.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <immintrin.h>
#endif

#define NACRE_INLINE [[gnu::always_inline]] inline

namespace nacre::cpu::NACRE_KERNEL_NAMESPACE {
namespace {

template <int W>
struct Lanes {
    typedef float F __attribute__((vector_size(W * 4)));
    typedef std::int32_t I __attribute__((vector_size(W * 4)));
    typedef std::uint32_t U __attribute__((vector_size(W * 4)));
};
/// W floats; W integers, also as masks (all bits or none); W unsigned integers.
template <int W>
using Floats = typename Lanes<W>::F;
template <int W>
using Ints = typename Lanes<W>::I;
template <int W>
using Uints = typename Lanes<W>::U;

/// The even and the odd elements of two vectors that follow each other.
template <int W>
NACRE_INLINE void split_pairs(Ints<W> low, Ints<W> high, Ints<W>& even, Ints<W>& odd) {
    if constexpr (W == 4) {
        even = __builtin_shufflevector(low, high, 0, 2, 4, 6);
        odd = __builtin_shufflevector(low, high, 1, 3, 5, 7);
    } else if constexpr (W == 8) {
        even = __builtin_shufflevector(low, high, 0, 2, 4, 6, 8, 10, 12, 14);
        odd = __builtin_shufflevector(low, high, 1, 3, 5, 7, 9, 11, 13, 15);
    } else {
        even = __builtin_shufflevector(low, high, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
        odd = __builtin_shufflevector(low, high, 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
    }
}
/// The other way.
template <int W>
NACRE_INLINE void join_pairs(Ints<W> even, Ints<W> odd, Ints<W>& low, Ints<W>& high) {
    if constexpr (W == 4) {
        low = __builtin_shufflevector(even, odd, 0, 4, 1, 5);
        high = __builtin_shufflevector(even, odd, 2, 6, 3, 7);
    } else if constexpr (W == 8) {
        low = __builtin_shufflevector(even, odd, 0, 8, 1, 9, 2, 10, 3, 11);
        high = __builtin_shufflevector(even, odd, 4, 12, 5, 13, 6, 14, 7, 15);
    } else {
        low = __builtin_shufflevector(even, odd, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
        high = __builtin_shufflevector(even, odd, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
    }
}

/// The 32-bit words at base + offset[lane].
template <int W>
NACRE_INLINE Ints<W> gather_words(const std::byte* base, Ints<W> offset) {
#ifdef __AVX512F__
    // With a mask, for GCC 12 warns about its own header in the form without.
    if constexpr (W == 16)
        return (Ints<W>)_mm512_mask_i32gather_epi32(_mm512_setzero_si512(), 0xffff, (__m512i)offset, base, 1);
#endif
#ifdef __AVX2__
    if constexpr (W == 8)
        return (Ints<W>)_mm256_i32gather_epi32(reinterpret_cast<const int*>(base), (__m256i)offset, 1);
    if constexpr (W == 4) return (Ints<W>)_mm_i32gather_epi32(reinterpret_cast<const int*>(base), (__m128i)offset, 1);
#endif
    Ints<W> words;
    for (int lane = 0; lane < W; ++lane) {
        std::int32_t word;
        std::memcpy(&word, base + offset[lane], sizeof word);
        words[lane] = word;
    }
    return words;
}

/// The words at base + offset[lane] and the words behind them: one access of 64 bits for each lane, which costs as much
/// as one of 32.
template <int W>
NACRE_INLINE void gather_pairs(const std::byte* base, Ints<W> offset, Ints<W>& first, Ints<W>& second) {
#ifdef __AVX512F__
    if constexpr (W == 16) {
        const auto half = [&](Ints<8> at) {
            return (Ints<W>)_mm512_mask_i32gather_epi64(_mm512_setzero_si512(), 0xff, (__m256i)at, base, 1);
        };
        const Ints<W> low = half(__builtin_shufflevector(offset, offset, 0, 1, 2, 3, 4, 5, 6, 7));
        const Ints<W> high = half(__builtin_shufflevector(offset, offset, 8, 9, 10, 11, 12, 13, 14, 15));
        split_pairs<W>(low, high, first, second);
        return;
    }
#endif
#ifdef __AVX2__
    if constexpr (W == 8) {
        const auto at = (__m256i)offset;
        const auto* words = reinterpret_cast<const long long*>(base);
        const auto low = (Ints<W>)_mm256_i32gather_epi64(words, _mm256_castsi256_si128(at), 1);
        const auto high = (Ints<W>)_mm256_i32gather_epi64(words, _mm256_extracti128_si256(at, 1), 1);
        split_pairs<W>(low, high, first, second);
        return;
    }
    if constexpr (W == 4) {
        const auto both = (Ints<8>)_mm256_i32gather_epi64(reinterpret_cast<const long long*>(base), (__m128i)offset, 1);
        first = __builtin_shufflevector(both, both, 0, 2, 4, 6);
        second = __builtin_shufflevector(both, both, 1, 3, 5, 7);
        return;
    }
#endif
    first = gather_words<W>(base, offset);
    second = gather_words<W>(base + 4, offset);
}

/// The four words at base + offset[lane]. Whole loads that are sorted afterwards take half of the time of gathers.
template <int W>
NACRE_INLINE void gather_quads(const std::byte* base, Ints<W> offset, Ints<W>* words) {
#ifdef __AVX512F__
    if constexpr (W == 16) {
        // The fours of lane i lie where those of lanes i, i + 4, i + 8, i + 12 make one register.
        alignas(64) std::int32_t places[W];
        __builtin_memcpy(places, &offset, sizeof places);
        // In memory indeed: to take lanes out of registers is several times the work of loading them.
        asm("" : "+m"(places));
        const auto four = [&](int lane) {
            return _mm_loadu_si128(reinterpret_cast<const __m128i*>(base + places[lane]));
        };
        __m512i fours[4];
        for (int i = 0; i < 4; ++i) {
            const __m256i low = _mm256_inserti128_si256(_mm256_castsi128_si256(four(i)), four(i + 4), 1);
            const __m256i high = _mm256_inserti128_si256(_mm256_castsi128_si256(four(i + 8)), four(i + 12), 1);
            fours[i] = (__m512i)__builtin_shufflevector((Ints<8>)low, (Ints<8>)high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10,
                                                        11, 12, 13, 14, 15);
        }
        const auto low = [](__m512i a, __m512i b) { return _mm512_maskz_unpacklo_epi32(0xffff, a, b); };
        const auto high = [](__m512i a, __m512i b) { return _mm512_maskz_unpackhi_epi32(0xffff, a, b); };
        const __m512i low_01 = low(fours[0], fours[1]), low_23 = low(fours[2], fours[3]);
        const __m512i high_01 = high(fours[0], fours[1]), high_23 = high(fours[2], fours[3]);
        words[0] = (Ints<W>)_mm512_maskz_unpacklo_epi64(0xff, low_01, low_23);
        words[1] = (Ints<W>)_mm512_maskz_unpackhi_epi64(0xff, low_01, low_23);
        words[2] = (Ints<W>)_mm512_maskz_unpacklo_epi64(0xff, high_01, high_23);
        words[3] = (Ints<W>)_mm512_maskz_unpackhi_epi64(0xff, high_01, high_23);
        return;
    }
#endif
    gather_pairs<W>(base, offset, words[0], words[1]);
    gather_pairs<W>(base + 8, offset, words[2], words[3]);
}

/// Texels of 1 or 2 bytes at base + offset[lane], in the low bits; what is above does not matter. Gathers read aligned
/// words, so that nothing behind the last texel's own word is touched.
template <int W>
NACRE_INLINE Ints<W> gather_small_texels(const std::byte* base, Ints<W> offset, int bytes) {
#ifdef __AVX2__
    static_cast<void>(bytes);
    const auto address = reinterpret_cast<std::uintptr_t>(base);
    const Ints<W> moved = offset + static_cast<std::int32_t>(address & 3);
    const Ints<W> word = gather_words<W>(reinterpret_cast<const std::byte*>(address & ~std::uintptr_t{3}), moved & ~3);
    return (Ints<W>)((Uints<W>)word >> (Uints<W>)((moved & 3) << 3));
#else
    Ints<W> texels;
    for (int lane = 0; lane < W; ++lane) {
        std::uint32_t texel = static_cast<std::uint8_t>(base[offset[lane]]);
        if (bytes == 2) texel |= static_cast<std::uint32_t>(base[offset[lane] + 1]) << 8;
        texels[lane] = static_cast<std::int32_t>(texel);
    }
    return texels;
#endif
}

#ifdef __AVX512VBMI__
/// table[byte] for the three lower bytes of each lane, from a table of 256 floats that is kept by bytes: byte k of
/// entry i at 256 * k + i, aligned to 64. Permutations of registers look up all channels of all lanes at once, which
/// takes a fifth of the time of gathers.
template <int W>
NACRE_INLINE void look_up_three_bytes(const std::byte* table, Ints<W> word, Floats<W>* out) {
    __m512i codes;
    if constexpr (W == 16)
        codes = (__m512i)word;
    else if constexpr (W == 8)
        codes = (__m512i)__builtin_shufflevector(word, word, 0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7);
    else
        codes = (__m512i)__builtin_shufflevector(word, word, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
    // In each part of four lanes, the bytes of one channel side by side.
    const __m512i by_channel = _mm512_set4_epi32(0x0f0b0703, 0x0e0a0602, 0x0d090501, 0x0c080400);
    codes = _mm512_shuffle_epi8(codes, by_channel);
    const __mmask64 is_upper = _mm512_movepi8_mask(codes);
    __m512i bytes[4];
    for (int k = 0; k < 4; ++k) {
        const auto part = [&](int i) { return _mm512_load_si512(table + 256 * k + 64 * i); };
        const __m512i lower = _mm512_permutex2var_epi8(part(0), codes, part(1));
        const __m512i upper = _mm512_permutex2var_epi8(part(2), codes, part(3));
        bytes[k] = _mm512_mask_blend_epi8(is_upper, lower, upper);
    }
    const __m512i low_01 = _mm512_unpacklo_epi8(bytes[0], bytes[1]), low_23 = _mm512_unpacklo_epi8(bytes[2], bytes[3]);
    const __m512i high_01 = _mm512_unpackhi_epi8(bytes[0], bytes[1]),
                  high_23 = _mm512_unpackhi_epi8(bytes[2], bytes[3]);
    const __m512i channels[3] = {_mm512_unpacklo_epi16(low_01, low_23), _mm512_unpackhi_epi16(low_01, low_23),
                                 _mm512_unpacklo_epi16(high_01, high_23)};
    for (int c = 0; c < 3; ++c) {
        const auto all = (Floats<16>)channels[c];
        if constexpr (W == 16)
            out[c] = all;
        else if constexpr (W == 8)
            out[c] = __builtin_shufflevector(all, all, 0, 1, 2, 3, 4, 5, 6, 7);
        else
            out[c] = __builtin_shufflevector(all, all, 0, 1, 2, 3);
    }
}
#endif

/// One bit for each lane of a mask.
template <int W>
NACRE_INLINE std::uint32_t mask_bits(Ints<W> mask) {
#if defined(__AVX512DQ__)
    if constexpr (W == 16) return _mm512_movepi32_mask((__m512i)mask);
#endif
#ifdef __AVX__
    if constexpr (W == 8) return static_cast<std::uint32_t>(_mm256_movemask_ps((__m256)mask));
#endif
#ifdef __SSE2__
    if constexpr (W == 4) return static_cast<std::uint32_t>(_mm_movemask_ps((__m128)mask));
#endif
    std::uint32_t bits = 0;
    for (int lane = 0; lane < W; ++lane) bits |= static_cast<std::uint32_t>(mask[lane] < 0) << lane;
    return bits;
}

template <int W>
NACRE_INLINE Floats<W> square_root(Floats<W> x) {
#ifdef __AVX512F__
    if constexpr (W == 16) return (Floats<W>)_mm512_maskz_sqrt_ps(0xffff, (__m512)x);
#endif
#ifdef __AVX__
    if constexpr (W == 8) return (Floats<W>)_mm256_sqrt_ps((__m256)x);
#endif
#ifdef __SSE2__
    if constexpr (W == 4) return (Floats<W>)_mm_sqrt_ps((__m128)x);
#endif
    Floats<W> root;
    for (int lane = 0; lane < W; ++lane) root[lane] = __builtin_sqrtf(x[lane]);
    return root;
}

#ifdef __SSE4_1__
#define NACRE_NATIVE_FLOOR
/// The largest whole number that is not above x; infinities and NaN stay.
template <int W>
NACRE_INLINE Floats<W> floor_natively(Floats<W> x) {
#ifdef __AVX512F__
    if constexpr (W == 16)
        return (Floats<W>)_mm512_maskz_roundscale_ps(0xffff, (__m512)x, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
#endif
#ifdef __AVX__
    if constexpr (W == 8) return (Floats<W>)_mm256_floor_ps((__m256)x);
#endif
    if constexpr (W == 4) return (Floats<W>)_mm_floor_ps((__m128)x);
}
#endif

/// x / divisor as IEEE 754 rounds it; the divisor is a whole number below 2^24 and |x| is 0 or above 2^-60. By the
/// reciprocal and the exact remainder where there are fused operations: Markstein, "Computation of elementary functions
/// on the IBM RISC System/6000 processor", 1990, theorem 7. Zero comes out with the sign +.
template <int W>
NACRE_INLINE Floats<W> quotient(Floats<W> x, float divisor) {
#ifdef __FMA__
    const float reciprocal = 1.0f / divisor;
    const Floats<W> estimate = x * reciprocal;
    const auto fused = [](Floats<W> a, Floats<W> b, Floats<W> c) -> Floats<W> {
#ifdef __AVX512F__
        if constexpr (W == 16) return (Floats<W>)_mm512_maskz_fmadd_ps(0xffff, (__m512)a, (__m512)b, (__m512)c);
#endif
        if constexpr (W == 8) return (Floats<W>)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
        if constexpr (W == 4) return (Floats<W>)_mm_fmadd_ps((__m128)a, (__m128)b, (__m128)c);
    };
    const Floats<W> rest = fused(estimate, Floats<W>{} - divisor, x);
    return fused(rest, Floats<W>{} + reciprocal, estimate);
#else
    return x / divisor + 0.0f;
#endif
}

#ifdef __F16C__
// The processor's conversions of halves, whose bits are those of the arithmetic in lane_math.h: NaN are made quiet and
// keep what fits of their payload, and no mode of the processor flushes a subnormal half.
template <int W>
NACRE_INLINE Floats<W> halves_to_floats_natively(Ints<W> half) {
#ifdef __AVX512F__
    if constexpr (W == 16)
        return (Floats<W>)_mm512_maskz_cvtph_ps(0xffff, _mm512_maskz_cvtepi32_epi16(0xffff, (__m512i)half));
#endif
    if constexpr (W == 8) {
        const auto words = (__m256i)half;
        return (Floats<W>)_mm256_cvtph_ps(
            _mm_packus_epi32(_mm256_castsi256_si128(words), _mm256_extracti128_si256(words, 1)));
    }
    if constexpr (W == 4) return (Floats<W>)_mm_cvtph_ps(_mm_packus_epi32((__m128i)half, (__m128i)half));
}
template <int W>
NACRE_INLINE Ints<W> floats_to_halves_natively(Floats<W> value) {
#ifdef __AVX512F__
    if constexpr (W == 16)
        return (Ints<W>)_mm512_maskz_cvtepu16_epi32(
            0xffff, _mm512_maskz_cvtps_ph(0xffff, (__m512)value, _MM_FROUND_TO_NEAREST_INT));
#endif
    if constexpr (W == 8)
        return (Ints<W>)_mm256_cvtepu16_epi32(_mm256_cvtps_ph((__m256)value, _MM_FROUND_TO_NEAREST_INT));
    if constexpr (W == 4) return (Ints<W>)_mm_cvtepu16_epi32(_mm_cvtps_ph((__m128)value, _MM_FROUND_TO_NEAREST_INT));
}
#endif

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
