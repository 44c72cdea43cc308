// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cfenv>
#include <limits>

#include "tests/backends/cpu/math/evaluate.h"
#include "tests/backends/cpu/math/samples.h"

// Functions whose every bit is defined, against plain C++, in single and double precision.

namespace nacre::cpu {
namespace {

template <typename T>
class Number : public testing::Test {
  public:
    /// Floats and, for double, what lies between and beyond them.
    static std::vector<T> samples() {
        std::vector<T> result(few_floats().begin(), few_floats().end());
        if constexpr (std::is_same_v<T, double>) {
            for (std::uint64_t i = 0; i < 200; ++i) result.push_back(std::bit_cast<double>(noise(i)));
            for (const double x : {0x1p-1074, 0x1p-1022, 0x1.fffffffffffffp1023, 0x1p52, 0x1p53, 0x1p51,
                                   4503599627370495.5, 0.49999999999999994})
                for (const double sign : {1.0, -1.0}) result.push_back(sign * x);
        } else {
            for (std::uint64_t i = 0; i < 200; ++i)
                result.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(noise(i))));
            result.insert(result.end(), {0.49999997f, -0.49999997f, 8388607.5f, 4194303.5f, -4194303.5f});
        }
        return result;
    }

    template <typename Expected>
    static void check_one(const char* name, const Emit& emit, Expected expected) {
        const std::vector<T> x = samples();
        for (const Variant& variant : exact_variants()) {
            const std::vector<T> result = evaluate_one<T>(variant, emit, x);
            for (std::size_t i = 0; i < x.size(); ++i)
                ASSERT_TRUE(same(result[i], T(expected(x[i]))))
                    << name << "(" << x[i] << ") = " << result[i] << " and not " << expected(x[i]) << "; "
                    << variant.name();
        }
    }

    template <typename Expected>
    static void check_two(const char* name, const Emit& emit, Expected expected) {
        const auto [x, y] = all_pairs(samples());
        for (const Variant& variant : exact_variants()) {
            const std::vector<T> result = evaluate_one<T>(variant, emit, x, y);
            for (std::size_t i = 0; i < x.size(); ++i)
                ASSERT_TRUE(same(result[i], T(expected(x[i], y[i]))))
                    << name << "(" << x[i] << ", " << y[i] << ") = " << result[i] << " and not " << expected(x[i], y[i])
                    << "; " << variant.name();
        }
    }

    /// The second and third arguments are drawn from few values.
    template <typename Expected>
    static void check_three(const char* name, const Emit& emit, Expected expected) {
        std::vector<T> x, y, z;
        for (const T a : samples())
            for (const T b : {T(0), T(-0.0), T(1), T(0.25), T(-3), T(1e20), std::numeric_limits<T>::quiet_NaN()})
                for (const T c : {T(1), T(0), T(4.5), T(-1e30), std::numeric_limits<T>::infinity()}) {
                    x.push_back(a);
                    y.push_back(b);
                    z.push_back(c);
                }
        for (const Variant& variant : exact_variants()) {
            const std::vector<T> result = evaluate_one<T>(variant, emit, x, y, z);
            for (std::size_t i = 0; i < x.size(); ++i)
                ASSERT_TRUE(same(result[i], T(expected(x[i], y[i], z[i]))))
                    << name << "(" << x[i] << ", " << y[i] << ", " << z[i] << ") = " << result[i] << " and not "
                    << expected(x[i], y[i], z[i]) << "; " << variant.name();
        }
    }
};

using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Number, Precisions);

TYPED_TEST(Number, is_rounded_to_whole) {
    using T = TypeParam;
    this->check_one("floor", call(&Math::floor), [](T x) { return std::floor(x); });
    this->check_one("ceil", call(&Math::ceil), [](T x) { return std::ceil(x); });
    this->check_one("trunc", call(&Math::trunc), [](T x) { return std::trunc(x); });
    this->check_one("round", call(&Math::round), [](T x) { return std::round(x); });
    ASSERT_EQ(std::fegetround(), FE_TONEAREST);
    this->check_one("round_even", call(&Math::round_even), [](T x) { return std::nearbyint(x); });
    this->check_one("fract", call(&Math::fract), [](T x) { return x - std::floor(x); });
}

TYPED_TEST(Number, has_a_sign_and_a_magnitude) {
    using T = TypeParam;
    this->check_one("abs", call(&Math::f_abs), [](T x) { return std::fabs(x); });
    this->check_one("sign", call(&Math::sign), [](T x) { return x > 0 ? T(1) : x < 0 ? T(-1) : T(0); });
    this->check_one("sqrt", call(&Math::sqrt), [](T x) { return std::sqrt(x); });
    this->check_one("inverse_sqrt", call(&Math::inverse_sqrt), [](T x) { return T(1) / std::sqrt(x); });
}

TYPED_TEST(Number, splits_into_fraction_and_whole) {
    using T = TypeParam;
    const std::vector<T> x = this->samples();
    const auto emit = [](Math& math, Values values) {
        const Math::Parts parts = math.modf(values[0]);
        return std::vector<llvm::Value*>{parts.fraction, parts.whole};
    };
    for (const Variant& variant : exact_variants()) {
        const auto [fraction, whole] = evaluate<T, T>(variant, emit, x);
        for (std::size_t i = 0; i < x.size(); ++i) {
            T expected_whole;
            const T expected = std::modf(x[i], &expected_whole);
            ASSERT_TRUE(same(fraction[i], expected) && same(whole[i], expected_whole))
                << x[i] << " = " << whole[i] << " + " << fraction[i] << "; " << variant.name();
        }
    }
}

TYPED_TEST(Number, splits_into_significand_and_exponent) {
    using T = TypeParam;
    const std::vector<T> x = this->samples();
    const auto emit = [](Math& math, Values values) {
        const Math::Scaled parts = math.frexp(values[0]);
        return std::vector<llvm::Value*>{parts.significand, parts.exponent};
    };
    for (const Variant& variant : exact_variants()) {
        const auto [significand, exponent] = evaluate<T, std::int32_t>(variant, emit, x);
        for (std::size_t i = 0; i < x.size(); ++i) {
            int expected_exponent = 0;
            const T expected = std::frexp(x[i], &expected_exponent);
            if (!std::isfinite(x[i])) expected_exponent = 0;
            ASSERT_TRUE(same(significand[i], expected)) << x[i] << ": " << significand[i] << "; " << variant.name();
            ASSERT_EQ(exponent[i], expected_exponent) << x[i] << "; " << variant.name();
        }
    }
}

template <typename T, typename Exponent>
void check_ldexp(const std::vector<T>& samples) {
    std::vector<T> x;
    std::vector<Exponent> exponents;
    constexpr std::int64_t least = std::numeric_limits<Exponent>::min();
    constexpr std::int64_t most = std::numeric_limits<Exponent>::max();
    for (const T a : samples)
        for (std::int64_t e : {std::int64_t{0},
                               std::int64_t{1},
                               std::int64_t{-1},
                               std::int64_t{23},
                               std::int64_t{-24},
                               std::int64_t{100},
                               std::int64_t{-101},
                               std::int64_t{-126},
                               std::int64_t{127},
                               std::int64_t{128},
                               std::int64_t{-149},
                               std::int64_t{-150},
                               std::int64_t{277},
                               std::int64_t{-278},
                               std::int64_t{1000},
                               std::int64_t{-1060},
                               std::int64_t{2098},
                               std::int64_t{-2099},
                               std::int64_t{70000},
                               std::int64_t{-70000},
                               std::int64_t{1} << 33,
                               least,
                               most}) {
            if (e < least || e > most) continue;
            x.push_back(a);
            exponents.push_back(static_cast<Exponent>(e));
        }
    for (const Variant& variant : exact_variants()) {
        const std::vector<T> result = evaluate_one<T>(variant, call(&Math::ldexp), x, exponents);
        for (std::size_t i = 0; i < x.size(); ++i) {
            const std::int64_t bounded = std::clamp<std::int64_t>(exponents[i], -10000, 10000);
            const T expected = std::ldexp(x[i], static_cast<int>(bounded));
            ASSERT_TRUE(same(result[i], expected)) << x[i] << " * 2^" << +exponents[i] << " = " << result[i]
                                                   << " and not " << expected << "; " << variant.name();
        }
    }
}

TYPED_TEST(Number, is_scaled_by_powers_of_two) {
    check_ldexp<TypeParam, std::int32_t>(this->samples());
    check_ldexp<TypeParam, std::int8_t>(this->samples());
    check_ldexp<TypeParam, std::int16_t>(this->samples());
    check_ldexp<TypeParam, std::int64_t>(this->samples());
}

TYPED_TEST(Number, is_compared) {
    using T = TypeParam;
    this->check_two("f_min", call(&Math::f_min), [](T x, T y) { return x < y ? x : y; });
    this->check_two("f_max", call(&Math::f_max), [](T x, T y) { return x > y ? x : y; });
    this->check_two("step", call(&Math::step), [](T edge, T x) { return x < edge ? T(0) : T(1); });
    const auto number_min = [](T x, T y) { return std::isnan(x) ? y : std::isnan(y) ? x : y < x ? y : x; };
    const auto number_max = [](T x, T y) { return std::isnan(x) ? y : std::isnan(y) ? x : y > x ? y : x; };
    this->check_two("n_min", call(&Math::n_min), number_min);
    this->check_two("n_max", call(&Math::n_max), number_max);
    this->check_three("f_clamp", call(&Math::f_clamp), [](T x, T low, T high) {
        const T raised = x > low ? x : low;
        return raised < high ? raised : high;
    });
    this->check_three("n_clamp", call(&Math::n_clamp),
                      [&](T x, T low, T high) { return number_min(number_max(x, low), high); });
}

TYPED_TEST(Number, is_interpolated) {
    using T = TypeParam;
    this->check_three("mix", call(&Math::mix), [](T x, T y, T a) { return x * (T(1) - a) + y * a; });
    this->check_three("smooth_step", call(&Math::smooth_step), [](T from, T to, T x) {
        const T ratio = (x - from) / (to - from);
        const T t = ratio > 0 ? (ratio < 1 ? ratio : T(1)) : T(0);
        return t * t * (T(3) - T(2) * t);
    });
    this->check_three("fma", call(&Math::fma), [](T x, T y, T z) { return std::fma(x, y, z); });
}

TYPED_TEST(Number, has_remainders) {
    using T = TypeParam;
    this->check_two("f_mod", call(&Math::f_mod), [](T x, T y) { return x - y * std::floor(x / y); });
    this->check_two("f_rem", call(&Math::f_rem), [](T x, T y) { return x - y * std::trunc(x / y); });
}

template <typename T, typename Integer>
void check_float_to_int(const std::vector<T>& samples) {
    std::vector<T> x = samples;
    for (const T edge :
         {static_cast<T>(std::numeric_limits<Integer>::min()), static_cast<T>(std::numeric_limits<Integer>::max())})
        for (const T near : {edge, std::nextafter(edge, T(0)), std::nextafter(edge, std::numeric_limits<T>::infinity()),
                             edge + T(0.5), edge - T(0.5)})
            x.push_back(near);
    const auto emit = [](Math& math, Values values) {
        return std::vector<llvm::Value*>{math.float_to_int(values[0], 8 * sizeof(Integer), std::is_signed_v<Integer>)};
    };
    const T above = std::ldexp(T(1), std::numeric_limits<Integer>::digits);
    for (const Variant& variant : exact_variants()) {
        const std::vector<Integer> result = evaluate_one<Integer>(variant, emit, x);
        for (std::size_t i = 0; i < x.size(); ++i) {
            const Integer expected = std::isnan(x[i]) ? Integer{0}
                                     : x[i] >= above  ? std::numeric_limits<Integer>::max()
                                     : x[i] <= static_cast<T>(std::numeric_limits<Integer>::min())
                                         ? std::numeric_limits<Integer>::min()
                                         : static_cast<Integer>(x[i]);
            ASSERT_EQ(+result[i], +expected) << x[i] << "; " << sizeof(Integer) << " bytes; " << variant.name();
        }
    }
}

TYPED_TEST(Number, saturates_to_integers) {
    const std::vector<TypeParam> x = this->samples();
    check_float_to_int<TypeParam, std::int8_t>(x);
    check_float_to_int<TypeParam, std::int16_t>(x);
    check_float_to_int<TypeParam, std::int32_t>(x);
    check_float_to_int<TypeParam, std::int64_t>(x);
    check_float_to_int<TypeParam, std::uint8_t>(x);
    check_float_to_int<TypeParam, std::uint16_t>(x);
    check_float_to_int<TypeParam, std::uint32_t>(x);
    check_float_to_int<TypeParam, std::uint64_t>(x);
}

template <typename T, typename Integer>
void check_int_to_float() {
    std::vector<Integer> x = {std::numeric_limits<Integer>::min(), std::numeric_limits<Integer>::max(), 0, 1, 2};
    for (std::uint64_t i = 0; i < 1000; ++i) x.push_back(static_cast<Integer>(noise(i) >> (i % 64)));
    const auto emit = [](Math& math, Values values) {
        llvm::LLVMContext& context = values[0]->getContext();
        llvm::Type* element = sizeof(T) == 8 ? llvm::Type::getDoubleTy(context) : llvm::Type::getFloatTy(context);
        return std::vector<llvm::Value*>{math.int_to_float(values[0], element, std::is_signed_v<Integer>)};
    };
    for (const Variant& variant : exact_variants()) {
        const std::vector<T> result = evaluate_one<T>(variant, emit, x);
        for (std::size_t i = 0; i < x.size(); ++i)
            ASSERT_EQ(result[i], static_cast<T>(x[i])) << +x[i] << "; " << variant.name();
    }
}

TYPED_TEST(Number, comes_from_integers) {
    check_int_to_float<TypeParam, std::int8_t>();
    check_int_to_float<TypeParam, std::uint16_t>();
    check_int_to_float<TypeParam, std::int32_t>();
    check_int_to_float<TypeParam, std::uint32_t>();
    check_int_to_float<TypeParam, std::int64_t>();
    check_int_to_float<TypeParam, std::uint64_t>();
}

}  // namespace
}  // namespace nacre::cpu
