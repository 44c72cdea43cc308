// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/backends/cpu/math/evaluate.h"
#include "tests/backends/cpu/math/samples.h"

// Packed formats, by the definitions of GLSL 4.60, section 8.4, which leave open only how halves are rounded.

namespace nacre::cpu {
namespace {

/// Components where rounding changes, their neighbors, and everything else that there is.
std::vector<float> components() {
    std::vector<float> result = few_floats();
    for (const double steps : {255.0, 127.0, 65535.0, 32767.0})
        for (int i = -400; i < 400; ++i) {
            const auto x = static_cast<float>((i / 2.0) / steps);
            for (const float near : {x, std::nextafter(x, 2.0f), std::nextafter(x, -2.0f)}) result.push_back(near);
        }
    for (std::uint64_t i = 0; i < 20000; ++i)
        result.push_back(static_cast<float>(static_cast<double>(noise(i) % 4000001) / 1e6 - 2));
    return result;
}

/// As GLSL has it: clamp, scale in single precision, round.
std::uint32_t normalized(float x, unsigned bits, bool is_signed) {
    if (std::isnan(x)) return 0;
    const float scale = static_cast<float>((1u << (is_signed ? bits - 1 : bits)) - 1);
    const float whole = std::nearbyint(std::clamp(x, is_signed ? -1.0f : 0.0f, 1.0f) * scale);
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(whole)) & ((1u << bits) - 1);
}

template <std::size_t count>
Emit pack(llvm::Value* (Math::*function)(const std::array<llvm::Value*, count>&)) {
    return [function](Math& math, Values values) {
        std::array<llvm::Value*, count> array;
        std::copy_n(values.begin(), count, array.begin());
        return std::vector<llvm::Value*>{(math.*function)(array)};
    };
}

template <std::size_t count>
Emit unpack(std::array<llvm::Value*, count> (Math::*function)(llvm::Value*)) {
    return [function](Math& math, Values values) {
        const auto array = (math.*function)(values[0]);
        return std::vector<llvm::Value*>(array.begin(), array.end());
    };
}

/// The same values in another order, so that components differ.
template <typename T>
std::vector<T> shuffled(const std::vector<T>& values, std::size_t step) {
    std::vector<T> result;
    for (std::size_t i = 0; i < values.size(); ++i) result.push_back(values[(i + step) % values.size()]);
    return result;
}

TEST(Packing, of_four_normalized_bytes_follows_the_definition) {
    const std::vector<float> x = components();
    const std::vector<float> y = shuffled(x, 7), z = shuffled(x, 1001), w = shuffled(x, 5000);
    for (const Variant& variant : exact_variants())
        for (const bool is_signed : {false, true}) {
            const auto emit = pack<4>(is_signed ? &Math::pack_snorm4x8 : &Math::pack_unorm4x8);
            const auto result = evaluate_one<std::uint32_t>(variant, emit, x, y, z, w);
            for (std::size_t i = 0; i < x.size(); ++i) {
                const std::uint32_t expected = normalized(x[i], 8, is_signed) | normalized(y[i], 8, is_signed) << 8 |
                                               normalized(z[i], 8, is_signed) << 16 |
                                               normalized(w[i], 8, is_signed) << 24;
                ASSERT_EQ(result[i], expected)
                    << x[i] << " " << y[i] << " " << z[i] << " " << w[i] << "; " << variant.name();
            }
        }
}

TEST(Packing, of_two_normalized_words_follows_the_definition) {
    const std::vector<float> x = components();
    const std::vector<float> y = shuffled(x, 7);
    for (const Variant& variant : exact_variants())
        for (const bool is_signed : {false, true}) {
            const auto emit = pack<2>(is_signed ? &Math::pack_snorm2x16 : &Math::pack_unorm2x16);
            const auto result = evaluate_one<std::uint32_t>(variant, emit, x, y);
            for (std::size_t i = 0; i < x.size(); ++i)
                ASSERT_EQ(result[i], normalized(x[i], 16, is_signed) | normalized(y[i], 16, is_signed) << 16)
                    << x[i] << " " << y[i] << "; " << variant.name();
        }
}

TEST(Packing, of_doubles_and_halves_goes_through_single) {
    const std::vector<float> x = components();
    const std::vector<float> y = shuffled(x, 7);
    const std::vector<double> wide_x(x.begin(), x.end()), wide_y(y.begin(), y.end());
    for (const Variant& variant : exact_variants()) {
        EXPECT_EQ(evaluate_one<std::uint32_t>(variant, pack(&Math::pack_snorm2x16), wide_x, wide_y),
                  evaluate_one<std::uint32_t>(variant, pack(&Math::pack_snorm2x16), x, y));
        const auto halves = evaluate_one<std::uint32_t>(variant, pack(&Math::pack_half2x16), x, y);
        const auto low = evaluate_one<std::uint16_t>(variant, call(&Math::float_to_half), x);
        const auto high = evaluate_one<std::uint16_t>(variant, call(&Math::float_to_half), y);
        for (std::size_t i = 0; i < x.size(); ++i)
            ASSERT_EQ(halves[i], low[i] | static_cast<std::uint32_t>(high[i]) << 16);
    }
}

TEST(Packing, is_undone_as_division_rounds) {
    std::vector<std::uint32_t> words;
    for (std::uint32_t i = 0; i < 65536; ++i) words.push_back(i | static_cast<std::uint32_t>(noise(i) << 16));
    for (const Variant& variant : exact_variants()) {
        const auto [u0, u1] = evaluate<float, float>(variant, unpack(&Math::unpack_unorm2x16), words);
        const auto [s0, s1] = evaluate<float, float>(variant, unpack(&Math::unpack_snorm2x16), words);
        const auto [v0, v1, v2, v3] =
            evaluate<float, float, float, float>(variant, unpack(&Math::unpack_unorm4x8), words);
        const auto [t0, t1, t2, t3] =
            evaluate<float, float, float, float>(variant, unpack(&Math::unpack_snorm4x8), words);
        for (std::size_t i = 0; i < words.size(); ++i) {
            const std::uint32_t word = words[i];
            const auto u16 = [&](unsigned at) { return static_cast<float>(word >> at & 0xffff) / 65535.0f; };
            const auto s16 = [&](unsigned at) {
                return std::max(-1.0f, static_cast<float>(static_cast<std::int16_t>(word >> at)) / 32767.0f);
            };
            const auto u8 = [&](unsigned at) { return static_cast<float>(word >> at & 0xff) / 255.0f; };
            const auto s8 = [&](unsigned at) {
                return std::max(-1.0f, static_cast<float>(static_cast<std::int8_t>(word >> at)) / 127.0f);
            };
            ASSERT_EQ(u0[i], u16(0)) << variant.name() << std::hex << word;
            ASSERT_EQ(u1[i], u16(16)) << variant.name() << std::hex << word;
            ASSERT_EQ(s0[i], s16(0)) << variant.name() << std::hex << word;
            ASSERT_EQ(s1[i], s16(16)) << variant.name() << std::hex << word;
            ASSERT_EQ(v0[i], u8(0));
            ASSERT_EQ(v1[i], u8(8));
            ASSERT_EQ(v2[i], u8(16));
            ASSERT_EQ(v3[i], u8(24));
            ASSERT_EQ(t0[i], s8(0)) << variant.name() << std::hex << word;
            ASSERT_EQ(t1[i], s8(8));
            ASSERT_EQ(t2[i], s8(16));
            ASSERT_EQ(t3[i], s8(24));
        }
        const auto [h0, h1] = evaluate<float, float>(variant, unpack(&Math::unpack_half2x16), words);
        std::vector<std::uint16_t> high;
        for (const std::uint32_t word : words) high.push_back(static_cast<std::uint16_t>(word >> 16));
        const auto low_half = evaluate_one<float>(variant, call(&Math::half_to_float), words);
        const auto high_half = evaluate_one<float>(variant, call(&Math::half_to_float), high);
        for (std::size_t i = 0; i < words.size(); ++i)
            ASSERT_TRUE(same(h0[i], low_half[i]) && same(h1[i], high_half[i]));
    }
}

TEST(Packing, of_a_double_in_two_words_keeps_every_bit) {
    std::vector<std::uint32_t> low, high;
    std::vector<double> numbers;
    for (std::uint64_t i = 0; i < 1000; ++i) {
        // A NaN that signals may not pass through registers unchanged on every machine; its exponent is avoided.
        const std::uint64_t bits = noise(i) & 0xffefffffffffffffu;
        low.push_back(static_cast<std::uint32_t>(bits));
        high.push_back(static_cast<std::uint32_t>(bits >> 32));
        numbers.push_back(std::bit_cast<double>(bits));
    }
    for (const Variant& variant : exact_variants()) {
        EXPECT_EQ(evaluate_one<double>(variant, pack(&Math::pack_double2x32), low, high), numbers) << variant.name();
        const auto [first, second] =
            evaluate<std::uint32_t, std::uint32_t>(variant, unpack(&Math::unpack_double2x32), numbers);
        EXPECT_EQ(first, low) << variant.name();
        EXPECT_EQ(second, high) << variant.name();
    }
}

}  // namespace
}  // namespace nacre::cpu
