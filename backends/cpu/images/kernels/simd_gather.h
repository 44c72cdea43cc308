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

}  // namespace
}  // namespace nacre::cpu::NACRE_KERNEL_NAMESPACE
