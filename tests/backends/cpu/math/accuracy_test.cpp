// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <string_view>

#include "tests/backends/cpu/math/evaluate.h"
#include "tests/backends/cpu/math/samples.h"

// Single precision functions against the C library in double precision.

namespace nacre::cpu {
namespace {

struct Function {
    const char* name;
    llvm::Value* (Math::*emit)(llvm::Value*);
    double (*expected)(double);
    /// Largest error allowed, in units of the last place: that over all floats, rounded up. Far less than Vulkan
    /// allows.
    double ulps;
    /// Where the bound holds; beyond, results are only bounded in magnitude.
    double range = std::numeric_limits<double>::infinity();
    /// An error below this is fine whatever it is in units of the last place.
    double absolute = 0;
    /// Results are at most 1 in magnitude also beyond the range.
    bool bounded = false;
};

double inverse_sqrt(double x) { return 1 / std::sqrt(x); }

const Function functions[] = {
    // Near the zeros of large arguments it is the absolute error that can be small.
    {"sin", &Math::sin, std::sin, 2, 1e5, 0x1p-32, true},
    {"cos", &Math::cos, std::cos, 2.3, 1e5, 0x1p-32, true},
    {"tan", &Math::tan, std::tan, 4.5, 1e3, 0x1p-32},
    // Single precision numbers come as near to its poles as 2^-24.
    {"tan_of_large_x", &Math::tan, std::tan, 40, 1e5, 0x1p-32},
    {"asin", &Math::asin, std::asin, 2.4},
    {"acos", &Math::acos, std::acos, 1.3},
    {"atan", &Math::atan, std::atan, 2},
    {"sinh", &Math::sinh, std::sinh, 1.65},
    {"cosh", &Math::cosh, std::cosh, 1.5},
    {"tanh", &Math::tanh, std::tanh, 1.35},
    {"asinh", &Math::asinh, std::asinh, 1.8},
    {"acosh", &Math::acosh, std::acosh, 2.45},
    {"atanh", &Math::atanh, std::atanh, 2.1},
    {"exp", &Math::exp, std::exp, 1.05},
    {"exp2", &Math::exp2, std::exp2, 1.1},
    {"log", &Math::log, std::log, 0.9},
    {"log2", &Math::log2, std::log2, 2.3},
    {"sqrt", &Math::sqrt, std::sqrt, 0.5},
    {"inverse_sqrt", &Math::inverse_sqrt, inverse_sqrt, 1.5},
};

struct Worst {
    double ulps = 0;
    float x = 0;
    float result = 0;

    void take(const Function& function, float at, float value) {
        if (std::isfinite(at) && std::abs(at) > function.range) {
            // Accurate no more, but still a sine.
            if (function.bounded && !(std::abs(value) <= 1))
                *this = {std::numeric_limits<double>::infinity(), at, value};
            return;
        }
        const double expected = function.expected(at);
        const double error = ulp_error(value, expected);
        if (error > ulps && !(std::abs(static_cast<double>(value) - expected) <= function.absolute))
            *this = {error, at, value};
    }
};

/// Calls `visit` with chunks of floats: many of them, or all.
template <typename Visit>
void for_floats(Visit visit) {
    if (!test_all_floats()) return visit(many_floats());
    constexpr std::uint32_t chunk = 1u << 20;
    std::vector<float> x(chunk);
    for (std::uint64_t first = 0; first < std::uint64_t{1} << 32; first += chunk) {
        for (std::uint32_t i = 0; i < chunk; ++i) x[i] = std::bit_cast<float>(static_cast<std::uint32_t>(first + i));
        visit(x);
    }
}

class Accuracy : public testing::TestWithParam<Function> {};

TEST_P(Accuracy, of_single_precision_is_within_the_bound) {
    const Function& function = GetParam();
    for (const Variant& variant : measured_variants()) {
        const CompiledFunction compiled(variant, {Kind::single}, call(function.emit));
        Worst worst;
        for_floats([&](const std::vector<float>& x) {
            std::vector<float> result(x.size());
            const void* inputs[] = {x.data()};
            void* outputs[] = {result.data()};
            compiled.run(inputs, outputs, x.size());
            for (std::size_t i = 0; i < x.size(); ++i) worst.take(function, x[i], result[i]);
        });
        EXPECT_LE(worst.ulps, function.ulps) << function.name << "(" << worst.x << ") = " << worst.result << " and not "
                                             << function.expected(worst.x) << "; " << variant.name();
        std::printf("%s: at most %.3f ulp, at %a; %s\n", function.name, worst.ulps, worst.x, variant.name().c_str());
    }
}

TEST_P(Accuracy, does_not_depend_on_lanes_or_target) {
    const Function& function = GetParam();
    const std::vector<float>& x = many_floats();
    std::vector<float> first;
    for (const Variant& variant : exact_variants()) {
        const std::vector<float> result = evaluate_one<float>(variant, call(function.emit), x);
        if (first.empty()) first = result;
        for (std::size_t i = 0; i < x.size(); ++i)
            ASSERT_TRUE(same(result[i], first[i])) << function.name << "(" << x[i] << ") is " << result[i]
                                                   << " and not " << first[i] << " with " << variant.name();
    }
}

TEST_P(Accuracy, does_not_depend_on_lanes_with_instructions_for_exponents) {
    const Function& function = GetParam();
    const std::vector<float>& x = many_floats();
    std::vector<float> first;
    for (const Variant& variant : measured_variants()) {
        if (!variant.options.exponent_instructions) continue;
        const std::vector<float> result = evaluate_one<float>(variant, call(function.emit), x);
        if (first.empty()) first = result;
        for (std::size_t i = 0; i < x.size(); ++i)
            ASSERT_TRUE(same(result[i], first[i])) << function.name << "(" << x[i] << ") is " << result[i]
                                                   << " and not " << first[i] << " with " << variant.name();
    }
    if (first.empty()) GTEST_SKIP() << "This processor has no instructions for exponents (AVX-512 F and VL).";
}

INSTANTIATE_TEST_SUITE_P(Of, Accuracy, testing::ValuesIn(functions), [](const auto& test) { return test.param.name; });

TEST(Sine, is_never_above_one) {
    for (const auto function : {&Math::sin, &Math::cos})
        for (const bool contract : {false, true}) {
            const std::vector<float>& x = many_floats();
            const std::vector<float> result =
                evaluate_one<float>({.options = {.contract = contract}}, call(function), x);
            for (std::size_t i = 0; i < x.size(); ++i) {
                if (std::isfinite(x[i])) {
                    ASSERT_LE(std::abs(result[i]), 1.0f) << x[i];
                } else {
                    ASSERT_TRUE(std::isnan(result[i])) << x[i];
                }
            }
        }
}

TEST(Exact, values_stay_exact) {
    const struct {
        const char* name;
        llvm::Value* (Math::*function)(llvm::Value*);
        std::vector<std::pair<float, float>> values;
    } cases[] = {
        {"sin", &Math::sin, {{0.0f, 0.0f}, {-0.0f, -0.0f}, {0x1p-149f, 0x1p-149f}}},
        {"cos", &Math::cos, {{0.0f, 1.0f}, {-0.0f, 1.0f}, {0x1p-20f, 1.0f}}},
        {"tan", &Math::tan, {{0.0f, 0.0f}, {-0.0f, -0.0f}, {0x1p-149f, 0x1p-149f}}},
        {"asin", &Math::asin, {{0.0f, 0.0f}, {-0.0f, -0.0f}}},
        {"acos", &Math::acos, {{1.0f, 0.0f}}},
        {"atan", &Math::atan, {{-0.0f, -0.0f}}},
        {"exp", &Math::exp, {{0.0f, 1.0f}, {-0.0f, 1.0f}}},
        {"exp2",
         &Math::exp2,
         {{0.0f, 1.0f}, {1.0f, 2.0f}, {-3.0f, 0.125f}, {127.0f, 0x1p127f}, {-149.0f, 0x1p-149f}, {-126.0f, 0x1p-126f}}},
        {"log", &Math::log, {{1.0f, 0.0f}}},
        {"log2", &Math::log2, {{1.0f, 0.0f}, {2.0f, 1.0f}, {0.125f, -3.0f}, {0x1p127f, 127.0f}, {0x1p-149f, -149.0f}}},
        {"tanh", &Math::tanh, {{-0.0f, -0.0f}, {100.0f, 1.0f}, {-100.0f, -1.0f}}},
        {"cosh", &Math::cosh, {{0.0f, 1.0f}}},
        {"asinh", &Math::asinh, {{-0.0f, -0.0f}}},
        {"acosh", &Math::acosh, {{1.0f, 0.0f}}},
    };
    std::vector<Variant> variants = exact_variants();
    for (const Variant& variant : measured_variants()) variants.push_back(variant);
    for (const auto& function : cases)
        for (const auto& [x, expected] : function.values)
            for (const Variant& variant : variants)
                EXPECT_TRUE(
                    same(evaluate_one<float>(variant, call(function.function), std::vector<float>{x})[0], expected))
                    << function.name << "(" << x << "); " << variant.name();
}

TEST(Arctangent2, is_accurate_in_every_quadrant) {
    const auto [y, x] = all_pairs(few_floats());
    std::vector<float> first;
    for (const Variant& variant : exact_variants()) {
        const std::vector<float> result = evaluate_one<float>(variant, call(&Math::atan2), y, x);
        if (first.empty()) first = result;
        for (std::size_t i = 0; i < x.size(); ++i) {
            const double expected = std::atan2(static_cast<double>(y[i]), static_cast<double>(x[i]));
            ASSERT_LE(ulp_error(result[i], expected), 3)
                << y[i] << " " << x[i] << " = " << result[i] << " and not " << expected;
            ASSERT_TRUE(std::isnan(expected) || std::signbit(result[i]) == std::signbit(expected))
                << y[i] << " " << x[i];
            ASSERT_TRUE(same(result[i], first[i])) << variant.name();
        }
    }
}

/// What Vulkan lets pow lose: the error of log2, multiplied by the exponent, and that of exp2. A logarithm p that is
/// wrong by a relative 2.75 * 2^-23 (log2 and the product) moves the result by ln 2 * |p| * 2.75 units of 2^-23, twice
/// that in units of the last place.
double power_bound(double x, double y) { return 1.5 + 2 * 2.75 * std::numbers::ln2 * std::abs(y * std::log2(x)); }

TEST(Power, is_accurate_and_has_edges) {
    const auto [x, y] = all_pairs(few_floats());
    std::vector<float> first;
    std::vector<Variant> variants = exact_variants();
    for (const Variant& variant : measured_variants()) variants.push_back(variant);
    for (const Variant& variant : variants) {
        const std::vector<float> result = evaluate_one<float>(variant, call(&Math::pow), x, y);
        if (first.empty()) first = result;
        for (std::size_t i = 0; i < x.size(); ++i) {
            ASSERT_TRUE(variant.options.contract || same(result[i], first[i])) << variant.name();
            const double wide_x = x[i], wide_y = y[i];
            double expected = std::pow(wide_x, wide_y);
            if (wide_y == 0) {
                expected = 1;
            } else if (std::isnan(wide_x) || wide_x < 0 || (wide_x == 1 && !std::isfinite(wide_y))) {
                expected = std::numeric_limits<double>::quiet_NaN();
            } else if (wide_x == 0) {
                expected = wide_y > 0 ? 0 : std::numeric_limits<double>::infinity();
            }
            if (std::isnan(wide_y)) expected = wide_y;
            const double error = ulp_error(result[i], expected);
            // Results at the ends of the range can fall to either side.
            if (std::abs(expected) > 0x1p127 && std::isinf(result[i])) continue;
            ASSERT_TRUE(error == 0 || error <= power_bound(wide_x, wide_y))
                << x[i] << "^" << y[i] << " = " << result[i] << " and not " << expected << ": " << error << "; "
                << variant.name();
        }
    }
}

TEST(Power, of_constant_whole_exponents_is_products) {
    std::vector<float> x;
    for (const float a : few_floats()) x.push_back(a);
    for (const double exponent : {0.0, 0.5, -0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 16.0, 64.0, -1.0, -2.0, -5.0, 2.5}) {
        const auto emit = [exponent](Math& math, Values values) {
            return std::vector<llvm::Value*>{
                math.pow(values[0], llvm::ConstantFP::get(values[0]->getType(), exponent))};
        };
        for (const Variant& variant : exact_variants()) {
            const std::vector<float> result = evaluate_one<float>(variant, emit, x);
            for (std::size_t i = 0; i < x.size(); ++i) {
                double expected = std::pow(static_cast<double>(x[i]), exponent);
                if (exponent == std::trunc(exponent)) {
                    // Below the range, what 1 / x^n would have to divide by has overflowed.
                    if (exponent < 0 && std::abs(expected) < 0x1p-126) continue;
                    // Each multiplication rounds once, and what it takes in is wrong by as much again.
                    ASSERT_LE(ulp_error(result[i], expected), 1 + std::abs(exponent))
                        << x[i] << "^" << exponent << " = " << result[i];
                } else if (std::abs(exponent) == 0.5) {
                    expected =
                        exponent < 0 ? 1 / std::sqrt(static_cast<double>(x[i])) : std::sqrt(static_cast<double>(x[i]));
                    ASSERT_LE(ulp_error(result[i], expected), 1.5) << x[i] << "^" << exponent << " = " << result[i];
                } else if (x[i] > 0 && std::isfinite(x[i]) && std::abs(expected) < 0x1p127) {
                    ASSERT_LE(ulp_error(result[i], expected), power_bound(x[i], exponent))
                        << x[i] << "^" << exponent << " = " << result[i];
                }
            }
        }
    }
    const auto code = assembly({}, {Kind::single}, [](Math& math, Values values) {
        return std::vector<llvm::Value*>{math.pow(values[0], llvm::ConstantFP::get(values[0]->getType(), 5.0))};
    });
    const auto count = [&](std::string_view word) {
        std::size_t found = 0;
        for (std::size_t at = code.find(word); at != std::string::npos; at = code.find(word, at + 1)) ++found;
        return found;
    };
    EXPECT_EQ(count("mulps"), 3u) << code;
    EXPECT_EQ(count("addps"), 0u) << code;
}

TEST(Math, ignores_fast_math_flags_of_the_caller) {
    const std::vector<float>& x = many_floats();
    for (const auto function : {&Math::sin, &Math::exp, &Math::log2, &Math::round, &Math::acosh}) {
        const auto fast = [function](Math&, Values values) {
            auto* instruction = llvm::cast<llvm::Instruction>(values[0]);
            llvm::IRBuilder<> builder(instruction->getParent());
            builder.setFastMathFlags(llvm::FastMathFlags::getFast());
            Math math(builder, false);
            return std::vector<llvm::Value*>{(math.*function)(values[0])};
        };
        const Variant variant{.optimized = true};
        const std::vector<float> expected = evaluate_one<float>(variant, call(function), x);
        const std::vector<float> result = evaluate_one<float>(variant, fast, x);
        for (std::size_t i = 0; i < x.size(); ++i) ASSERT_TRUE(same(result[i], expected[i])) << x[i];
    }
}

}  // namespace
}  // namespace nacre::cpu
