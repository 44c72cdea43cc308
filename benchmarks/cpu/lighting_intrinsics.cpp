// SPDX-License-Identifier: Apache-2.0
#include "benchmarks/cpu/lighting.h"

/// @file
/// benchmarks/cpu/lighting.comp written by hand with AVX-512 instructions, 16 pixels at once: what a compiler of
/// shaders is measured by. Lights are broadcast, pow(x, 5) is three multiplications, a light that none of the 16 pixels
/// faces is left out, divisions and square roots are those of IEEE 754.

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace nacre::bench {

#if defined(__x86_64__)

bool can_light_by_hand() { return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"); }

namespace {

#define NACRE_AVX512 __attribute__((target("avx512f,avx512dq,fma"))) inline

struct Vector {
    __m512 x, y, z;
};

NACRE_AVX512 __m512 all(float value) { return _mm512_set1_ps(value); }

NACRE_AVX512 __m512 dot(const Vector& a, const Vector& b) {
    return _mm512_fmadd_ps(a.z, b.z, _mm512_fmadd_ps(a.y, b.y, _mm512_mul_ps(a.x, b.x)));
}

NACRE_AVX512 Vector scaled(const Vector& a, __m512 by) {
    return {_mm512_mul_ps(a.x, by), _mm512_mul_ps(a.y, by), _mm512_mul_ps(a.z, by)};
}

NACRE_AVX512 __m512 inverse_root(__m512 a) { return _mm512_div_ps(all(1.0f), _mm512_sqrt_ps(a)); }

NACRE_AVX512 __m512 clamped(__m512 a) { return _mm512_min_ps(_mm512_max_ps(a, _mm512_setzero_ps()), all(1.0f)); }

NACRE_AVX512 __m512 byte_of(__m512i word, unsigned shift) {
    const __m512i value = _mm512_and_si512(_mm512_srli_epi32(word, shift), _mm512_set1_epi32(255));
    return _mm512_mul_ps(_mm512_cvtepi32_ps(value), all(1.0f / 255.0f));
}

/// Four vectors of 16 pixels with 4 components each, and back: rows become columns.
NACRE_AVX512 void transpose(__m512i (&v)[4]) {
    // Within each 128 bits: 4 pixels x 4 components.
    const __m512i a = _mm512_unpacklo_epi32(v[0], v[1]), b = _mm512_unpackhi_epi32(v[0], v[1]);
    const __m512i c = _mm512_unpacklo_epi32(v[2], v[3]), d = _mm512_unpackhi_epi32(v[2], v[3]);
    v[0] = _mm512_unpacklo_epi64(a, c);
    v[1] = _mm512_unpackhi_epi64(a, c);
    v[2] = _mm512_unpacklo_epi64(b, d);
    v[3] = _mm512_unpackhi_epi64(b, d);
}

}  // namespace

__attribute__((target("avx512f,avx512dq,fma"))) void light_rows_by_hand(const LightingBlock& block,
                                                                       const glm::uvec4* words, glm::vec4* lit,
                                                                       std::uint32_t first_row,
                                                                       std::uint32_t last_row) {
    const std::uint32_t width = block.size.x, light_count = block.size.z;
    const __m512 one = all(1.0f), zero = _mm512_setzero_ps();
    const float pi = 3.14159265358979f;
    // The transpose leaves lane 4 g + k as pixel g + 4 k.
    const __m512 lane_x = _mm512_set_ps(15, 11, 7, 3, 14, 10, 6, 2, 13, 9, 5, 1, 12, 8, 4, 0);
    for (std::uint32_t y = first_row; y < last_row; ++y) {
        const float ndc_y = (static_cast<float>(y) + 0.5f) / static_cast<float>(block.size.y) * 2.0f - 1.0f;
        for (std::uint32_t x = 0; x < width; x += 16) {
            const std::size_t index = std::size_t{y} * width + x;
            __m512i word[4];
            for (int i = 0; i < 4; ++i) word[i] = _mm512_load_si512(words + index + 4 * i);
            transpose(word);
            const Vector diffuse =
                scaled({byte_of(word[0], 0), byte_of(word[0], 8), byte_of(word[0], 16)}, all(1.0f / pi));
            const Vector f0 = {byte_of(word[1], 0), byte_of(word[1], 8), byte_of(word[1], 16)};
            const __m512 roughness = _mm512_max_ps(byte_of(word[1], 24), all(0.2f));

            Vector normal;
            normal.x = _mm512_fmsub_ps(_mm512_cvtepi32_ps(_mm512_and_si512(word[2], _mm512_set1_epi32(0xffff))),
                                       all(2.0f / 65535.0f), one);
            normal.y = _mm512_fmsub_ps(_mm512_cvtepi32_ps(_mm512_srli_epi32(word[2], 16)), all(2.0f / 65535.0f), one);
            normal.z = _mm512_sub_ps(_mm512_sub_ps(one, _mm512_abs_ps(normal.x)), _mm512_abs_ps(normal.y));
            const __m512 t = _mm512_max_ps(_mm512_sub_ps(zero, normal.z), zero);
            const __m512 sign = all(-0.0f);
            const auto fold = [&](__m512 v) __attribute__((target("avx512f,avx512dq,fma"))) {
                const __mmask16 positive = _mm512_cmp_ps_mask(v, zero, _CMP_GE_OQ);
                return _mm512_add_ps(v, _mm512_mask_xor_ps(t, positive, t, sign));
            };
            normal.x = fold(normal.x);
            normal.y = fold(normal.y);
            normal = scaled(normal, inverse_root(dot(normal, normal)));

            const __m512 ndc_x = _mm512_fmsub_ps(
                _mm512_div_ps(_mm512_add_ps(lane_x, all(static_cast<float>(x) + 0.5f)), all(static_cast<float>(width))),
                all(2.0f), one);
            const Vector ray = {_mm512_mul_ps(ndc_x, all(block.plane.x)), all(ndc_y * block.plane.y), all(-1.0f)};
            const Vector position = scaled(ray, _mm512_castsi512_ps(word[3]));
            const Vector to_viewer = scaled(ray, _mm512_sub_ps(zero, inverse_root(dot(ray, ray))));

            const __m512 alpha = _mm512_mul_ps(roughness, roughness), a2 = _mm512_mul_ps(alpha, alpha);
            const __m512 one_less_a2 = _mm512_sub_ps(one, a2);
            const __m512 cos_o = _mm512_max_ps(dot(normal, to_viewer), all(1e-4f));
            const __m512 masking_o = _mm512_sqrt_ps(_mm512_fmadd_ps(_mm512_mul_ps(cos_o, cos_o), one_less_a2, a2));
            const Vector rest = {_mm512_sub_ps(one, f0.x), _mm512_sub_ps(one, f0.y), _mm512_sub_ps(one, f0.z)};
            Vector sum = {zero, zero, zero};
            for (std::uint32_t i = 0; i < light_count; ++i) {
                const auto& light = block.lights[i];
                const Vector offset = {_mm512_sub_ps(all(light.position.x), position.x),
                                       _mm512_sub_ps(all(light.position.y), position.y),
                                       _mm512_sub_ps(all(light.position.z), position.z)};
                const __m512 distance_squared = _mm512_max_ps(dot(offset, offset), all(1e-8f));
                const Vector to_light = scaled(offset, inverse_root(distance_squared));
                const __m512 cos_i = dot(normal, to_light);
                const __mmask16 faces = _mm512_cmp_ps_mask(cos_i, zero, _CMP_GT_OQ);
                if (faces == 0) continue;
                const __m512 in_range = _mm512_mul_ps(distance_squared, all(light.position.w));
                const __m512 window = clamped(_mm512_fnmadd_ps(in_range, in_range, one));
                const __m512 attenuation = _mm512_mul_ps(_mm512_div_ps(window, distance_squared), cos_i);
                Vector half = {_mm512_add_ps(to_light.x, to_viewer.x), _mm512_add_ps(to_light.y, to_viewer.y),
                               _mm512_add_ps(to_light.z, to_viewer.z)};
                half = scaled(half, inverse_root(_mm512_max_ps(dot(half, half), all(1e-12f))));
                const __m512 cos_h = clamped(dot(normal, half)), cos_d = clamped(dot(to_viewer, half));
                const __m512 d = _mm512_fmadd_ps(_mm512_mul_ps(cos_h, cos_h), _mm512_sub_ps(a2, one), one);
                const __m512 masking_i = _mm512_sqrt_ps(_mm512_fmadd_ps(_mm512_mul_ps(cos_i, cos_i), one_less_a2, a2));
                const __m512 visibility =
                    _mm512_div_ps(all(0.5f), _mm512_fmadd_ps(cos_i, masking_o, _mm512_mul_ps(cos_o, masking_i)));
                const __m512 specular = _mm512_mul_ps(
                    _mm512_div_ps(a2, _mm512_mul_ps(_mm512_mul_ps(all(pi), d), d)), visibility);
                const __m512 m = _mm512_sub_ps(one, cos_d), m2 = _mm512_mul_ps(m, m);
                const __m512 fresnel = _mm512_mul_ps(_mm512_mul_ps(m2, m2), m);
                const auto add = [&](__m512 so_far, float color, __m512 base, __m512 reflected, __m512 remaining)
                    __attribute__((target("avx512f,avx512dq,fma"))) {
                    const __m512 value =
                        _mm512_fmadd_ps(_mm512_fmadd_ps(remaining, fresnel, reflected), specular, base);
                    return _mm512_mask3_fmadd_ps(_mm512_mul_ps(all(color), value), attenuation, so_far, faces);
                };
                sum.x = add(sum.x, light.color.x, diffuse.x, f0.x, rest.x);
                sum.y = add(sum.y, light.color.y, diffuse.y, f0.y, rest.y);
                sum.z = add(sum.z, light.color.z, diffuse.z, f0.z, rest.z);
            }
            sum = scaled(sum, byte_of(word[0], 24));
            __m512i result[4] = {_mm512_castps_si512(sum.x), _mm512_castps_si512(sum.y), _mm512_castps_si512(sum.z),
                                 _mm512_castps_si512(one)};
            transpose(result);
            for (int i = 0; i < 4; ++i) _mm512_store_si512(lit + index + 4 * i, result[i]);
        }
    }
}

#else

bool can_light_by_hand() { return false; }
void light_rows_by_hand(const LightingBlock&, const glm::uvec4*, glm::vec4*, std::uint32_t, std::uint32_t) {}

#endif

}  // namespace nacre::bench
