// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/backends/cpu/math/evaluate.h"
#include "tests/backends/cpu/math/samples.h"

// Half precision, exhaustively: all halves, and all floats between which rounding changes.

namespace nacre::cpu {
namespace {

/// The number that the bits of a half stand for, by definition (IEEE 754, binary16). Infinities and NaN excluded.
double half_number(std::uint32_t bits) {
    const int exponent = static_cast<int>(bits >> 10 & 31);
    const double fraction = static_cast<double>(bits & 1023);
    const double magnitude = exponent == 0 ? std::ldexp(fraction, -24) : std::ldexp(1024 + fraction, exponent - 25);
    return bits & 0x8000 ? -magnitude : magnitude;
}

constexpr std::uint32_t half_infinity = 0x7c00;

/// The half nearest to a float, found among its neighbors by distance.
std::uint16_t nearest_half(float x) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(x);
    const std::uint32_t sign = bits >> 16 & 0x8000;
    if (std::isnan(x)) return static_cast<std::uint16_t>(sign | 0x7e00 | (bits >> 13 & 0x3ff));
    const double magnitude = std::abs(static_cast<double>(x));
    // Halves are in the order of their bits.
    std::uint32_t low = 0, high = half_infinity;
    while (high - low > 1) {
        const std::uint32_t middle = (low + high) / 2;
        (half_number(middle) <= magnitude ? low : high) = middle;
    }
    // Infinity counts as the number that would follow the largest half.
    const double below = magnitude - half_number(low);
    const double above = (high == half_infinity ? 65536.0 : half_number(high)) - magnitude;
    const bool takes_low = below < above || (below == above && low % 2 == 0);
    return static_cast<std::uint16_t>(sign | (takes_low ? low : high));
}

std::vector<std::uint16_t> all_halves() {
    std::vector<std::uint16_t> result(65536);
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = static_cast<std::uint16_t>(i);
    return result;
}

float expected_float(std::uint16_t half) {
    const std::uint32_t magnitude = half & 0x7fff;
    const std::uint32_t sign = static_cast<std::uint32_t>(half & 0x8000) << 16;
    if (magnitude == half_infinity) return std::bit_cast<float>(sign | 0x7f800000);
    if (magnitude > half_infinity) return std::bit_cast<float>(sign | 0x7fc00000 | (magnitude & 0x3ff) << 13);
    return static_cast<float>(half_number(half));
}

/// Those whose target has instructions for halves too.
std::vector<Variant> variants() {
    std::vector<Variant> result = exact_variants();
    for (const unsigned lanes : {1u, 4u, 8u, 16u})
        for (const bool optimized : {false, true})
            result.push_back({.lanes = lanes,
                              .processor = "x86-64-v3",
                              .options = {.half_instructions = true},
                              .optimized = optimized});
    return result;
}

TEST(Half, becomes_single) {
    const std::vector<std::uint16_t> halves = all_halves();
    for (const Variant& variant : variants()) {
        const std::vector<float> result = evaluate_one<float>(variant, call(&Math::half_to_float), halves);
        for (std::size_t i = 0; i < halves.size(); ++i)
            ASSERT_EQ(std::bit_cast<std::uint32_t>(result[i]), std::bit_cast<std::uint32_t>(expected_float(halves[i])))
                << std::hex << halves[i] << "; " << variant.name();
    }
}

TEST(Half, becomes_single_from_the_low_bits_of_words) {
    std::vector<std::uint32_t> words;
    for (const std::uint16_t half : all_halves()) words.push_back(0xabcd0000u | half);
    for (const Variant& variant : variants()) {
        const std::vector<float> result = evaluate_one<float>(variant, call(&Math::half_to_float), words);
        for (std::size_t i = 0; i < words.size(); ++i)
            ASSERT_EQ(std::bit_cast<std::uint32_t>(result[i]),
                      std::bit_cast<std::uint32_t>(expected_float(static_cast<std::uint16_t>(i))));
    }
}

/// Rounding is monotonic: with the floats around every middle between two halves right, and the halves themselves, all
/// are.
std::vector<float> floats_around_halves() {
    std::vector<float> result = few_floats();
    for (std::uint32_t bits = 0; bits < half_infinity; ++bits) {
        const double next = bits + 1 == half_infinity ? 65536.0 : half_number(bits + 1);
        const auto middle = static_cast<float>((half_number(bits) + next) / 2);
        for (const float x : {static_cast<float>(half_number(bits)), middle, std::nextafter(middle, 0.0f),
                              std::nextafter(middle, 1e9f)})
            for (const float sign : {1.0f, -1.0f}) result.push_back(sign * x);
    }
    for (std::uint64_t i = 0; i < 10000; ++i)
        result.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(noise(i))));
    return result;
}

TEST(Half, is_the_nearest_to_single) {
    const std::vector<float> x = floats_around_halves();
    std::vector<std::uint16_t> expected;
    for (const float a : x) expected.push_back(nearest_half(a));
    for (const Variant& variant : variants()) {
        const std::vector<std::uint16_t> result = evaluate_one<std::uint16_t>(variant, call(&Math::float_to_half), x);
        for (std::size_t i = 0; i < x.size(); ++i)
            ASSERT_EQ(result[i], expected[i])
                << x[i] << " " << std::hex << std::bit_cast<std::uint32_t>(x[i]) << "; " << variant.name();
    }
}

TEST(Half, is_rounded_to_by_way_of_single_from_double) {
    std::vector<double> x;
    for (const float a : floats_around_halves())
        x.push_back(std::isnan(a) ? 0.0 : std::nextafter(static_cast<double>(a), 1e9));
    for (const Variant& variant : exact_variants()) {
        const std::vector<std::uint16_t> result = evaluate_one<std::uint16_t>(variant, call(&Math::float_to_half), x);
        for (std::size_t i = 0; i < x.size(); ++i) ASSERT_EQ(result[i], nearest_half(static_cast<float>(x[i]))) << x[i];
    }
}

TEST(Half, quantizes_and_drops_denormals) {
    const std::vector<float> x = floats_around_halves();
    for (const Variant& variant : variants()) {
        const std::vector<float> result = evaluate_one<float>(variant, call(&Math::quantize_to_f16), x);
        for (std::size_t i = 0; i < x.size(); ++i) {
            const float rounded = expected_float(nearest_half(x[i]));
            const float expected = std::abs(x[i]) < 0x1p-14f ? std::copysign(0.0f, x[i]) : rounded;
            ASSERT_TRUE(same(result[i], expected)) << x[i] << ": " << result[i] << "; " << variant.name();
        }
    }
}

TEST(Half, functions_are_those_of_single_precision_rounded) {
    const std::vector<std::uint16_t> bits = all_halves();
    std::vector<Half> halves;
    std::vector<float> singles;
    for (const std::uint16_t b : bits) {
        halves.push_back({b});
        singles.push_back(expected_float(b));
    }
    const std::vector<Half> reversed(halves.rbegin(), halves.rend());
    const std::vector<float> reversed_singles(singles.rbegin(), singles.rend());
    const auto compare = [&](const char* name, const std::vector<Half>& result, const std::vector<float>& single,
                             const Variant& variant) {
        for (std::size_t i = 0; i < result.size(); ++i) {
            if (std::isnan(single[i])) {
                ASSERT_GT(result[i].bits & 0x7fff, half_infinity) << name;
            } else {
                ASSERT_EQ(result[i].bits, nearest_half(single[i]))
                    << name << " of " << singles[i] << "; " << variant.name();
            }
        }
    };
    const struct {
        const char* name;
        llvm::Value* (Math::*function)(llvm::Value*);
    } of_one[] = {{"sin", &Math::sin},
                  {"tan", &Math::tan},
                  {"acos", &Math::acos},
                  {"exp2", &Math::exp2},
                  {"log", &Math::log},
                  {"tanh", &Math::tanh},
                  {"sqrt", &Math::sqrt},
                  {"inverse_sqrt", &Math::inverse_sqrt},
                  {"floor", &Math::floor},
                  {"round", &Math::round},
                  {"round_even", &Math::round_even},
                  {"fract", &Math::fract},
                  {"sign", &Math::sign},
                  {"abs", &Math::f_abs}};
    const struct {
        const char* name;
        llvm::Value* (Math::*function)(llvm::Value*, llvm::Value*);
    } of_two[] = {{"pow", &Math::pow},     {"atan2", &Math::atan2}, {"f_min", &Math::f_min},
                  {"n_max", &Math::n_max}, {"f_mod", &Math::f_mod}, {"step", &Math::step}};
    for (const Variant& variant :
         {Variant{.lanes = 16, .optimized = true}, Variant{.lanes = 4, .processor = "x86-64"},
          Variant{.lanes = 1, .processor = "x86-64"},
          Variant{.lanes = 8, .processor = "x86-64-v3", .options = {.half_instructions = true}}}) {
        const Variant single{.lanes = 16};
        for (const auto& function : of_one)
            compare(function.name, evaluate_one<Half>(variant, call(function.function), halves),
                    evaluate_one<float>(single, call(function.function), singles), variant);
        for (const auto& function : of_two)
            compare(function.name, evaluate_one<Half>(variant, call(function.function), halves, reversed),
                    evaluate_one<float>(single, call(function.function), singles, reversed_singles), variant);
    }
}

TEST(Half, splits_and_scales) {
    std::vector<Half> halves;
    std::vector<std::int32_t> exponents;
    for (const std::uint16_t b : all_halves()) {
        halves.push_back({b});
        exponents.push_back(static_cast<std::int32_t>(noise(b) % 64) - 32);
    }
    const auto frexp = [](Math& math, Values values) {
        const Math::Scaled parts = math.frexp(values[0]);
        return std::vector<llvm::Value*>{parts.significand, parts.exponent};
    };
    const auto modf = [](Math& math, Values values) {
        const Math::Parts parts = math.modf(values[0]);
        return std::vector<llvm::Value*>{parts.fraction, parts.whole};
    };
    for (const Variant& variant : {Variant{.lanes = 16}, Variant{.lanes = 1, .processor = "x86-64"}}) {
        const auto [significand, exponent] = evaluate<Half, std::int32_t>(variant, frexp, halves);
        const auto [fraction, whole] = evaluate<Half, Half>(variant, modf, halves);
        const auto scaled = evaluate_one<Half>(variant, call(&Math::ldexp), halves, exponents);
        for (std::size_t i = 0; i < halves.size(); ++i) {
            const float x = expected_float(halves[i].bits);
            if (std::isnan(x)) continue;
            int expected_exponent = 0;
            const float expected = std::frexp(x, &expected_exponent);
            ASSERT_EQ(significand[i].bits, nearest_half(expected)) << x;
            ASSERT_EQ(exponent[i], std::isfinite(x) ? expected_exponent : 0) << x;
            float expected_whole;
            ASSERT_EQ(fraction[i].bits, nearest_half(std::modf(x, &expected_whole))) << x;
            ASSERT_EQ(whole[i].bits, nearest_half(expected_whole)) << x;
            ASSERT_EQ(scaled[i].bits, nearest_half(std::ldexp(x, exponents[i]))) << x << " " << exponents[i];
        }
    }
}

TEST(Half, becomes_integers_and_comes_from_them) {
    std::vector<Half> halves;
    std::vector<std::int32_t> integers;
    std::vector<std::uint64_t> wide;
    for (const std::uint16_t b : all_halves()) {
        halves.push_back({b});
        integers.push_back(static_cast<std::int32_t>(b) * 4 - 131072 + static_cast<std::int32_t>(noise(b) % 4));
        wide.push_back(noise(b) >> (b % 64));
    }
    const auto to_integer = [](Math& math, Values values) {
        return std::vector<llvm::Value*>{math.float_to_int(values[0], 16, true)};
    };
    const auto from_signed = [](Math& math, Values values) {
        return std::vector<llvm::Value*>{
            math.int_to_float(values[0], llvm::Type::getHalfTy(values[0]->getContext()), true)};
    };
    const auto from_unsigned = [](Math& math, Values values) {
        return std::vector<llvm::Value*>{
            math.int_to_float(values[0], llvm::Type::getHalfTy(values[0]->getContext()), false)};
    };
    for (const Variant& variant : {Variant{.lanes = 16}, Variant{.lanes = 1, .processor = "x86-64"}}) {
        const auto result = evaluate_one<std::int16_t>(variant, to_integer, halves);
        const auto rounded = evaluate_one<Half>(variant, from_signed, integers);
        const auto rounded_wide = evaluate_one<Half>(variant, from_unsigned, wide);
        for (std::size_t i = 0; i < halves.size(); ++i) {
            const float x = expected_float(halves[i].bits);
            const int expected = std::isnan(x) ? 0 : static_cast<int>(std::clamp(x, -32768.0f, 32767.0f));
            ASSERT_EQ(result[i], expected) << x;
            // Exact in single precision, or infinite as a half.
            ASSERT_EQ(rounded[i].bits, nearest_half(static_cast<float>(integers[i]))) << integers[i];
            ASSERT_EQ(rounded_wide[i].bits, nearest_half(static_cast<float>(wide[i]))) << wide[i];
        }
    }
}

}  // namespace
}  // namespace nacre::cpu
