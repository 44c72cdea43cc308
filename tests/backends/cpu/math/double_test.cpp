// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>

#include "tests/backends/cpu/math/evaluate.h"
#include "tests/backends/cpu/math/samples.h"

// The reference mode: double precision against the C library's extended precision.

namespace nacre::cpu {
namespace {

std::vector<double> samples() {
    std::vector<double> result(few_floats().begin(), few_floats().end());
    for (std::uint64_t i = 0; i < 20000; ++i) {
        result.push_back(std::bit_cast<double>(noise(i)));
        const double uniform = static_cast<double>(noise(i + 50000) >> 11) * 0x1p-52 - 1;
        result.push_back(uniform);
        result.push_back(uniform * 700);
    }
    return result;
}

/// |result - expected| relative to the latter; 0 for equal infinities and for two NaN.
double relative_error(double result, long double expected) {
    if (std::isnan(result) || std::isnan(expected)) return std::isnan(result) && std::isnan(expected) ? 0 : INFINITY;
    const auto rounded = static_cast<double>(expected);
    if (result == rounded) return 0;
    if (std::isinf(result) || std::isinf(rounded)) return INFINITY;
    // Denormals have no more than their last place.
    return static_cast<double>(std::abs(result - expected) / std::max(std::abs(expected), 0x1p-1022L));
}

TEST(Double, is_accurate_to_thirteen_digits) {
    const struct {
        const char* name;
        llvm::Value* (Math::*function)(llvm::Value*);
        long double (*expected)(long double);
    } functions[] = {
        {"sin", &Math::sin, std::sin},       {"cos", &Math::cos, std::cos},       {"tan", &Math::tan, std::tan},
        {"asin", &Math::asin, std::asin},    {"acos", &Math::acos, std::acos},    {"atan", &Math::atan, std::atan},
        {"sinh", &Math::sinh, std::sinh},    {"cosh", &Math::cosh, std::cosh},    {"tanh", &Math::tanh, std::tanh},
        {"asinh", &Math::asinh, std::asinh}, {"acosh", &Math::acosh, std::acosh}, {"atanh", &Math::atanh, std::atanh},
        {"exp", &Math::exp, std::exp},       {"exp2", &Math::exp2, std::exp2},    {"log", &Math::log, std::log},
        {"log2", &Math::log2, std::log2},    {"sqrt", &Math::sqrt, std::sqrt},
    };
    const std::vector<double> x = samples();
    for (const auto& function : functions)
        for (const Variant& variant : exact_variants()) {
            const std::vector<double> result = evaluate_one<double>(variant, call(function.function), x);
            for (std::size_t i = 0; i < x.size(); ++i)
                ASSERT_LE(relative_error(result[i], function.expected(x[i])), 1e-15)
                    << function.name << "(" << x[i] << "); " << variant.name();
        }
}

TEST(Double, functions_of_two_are_accurate_to_thirteen_digits) {
    std::vector<double> few(few_floats().begin(), few_floats().end());
    for (std::uint64_t i = 0; i < 100; ++i) few.push_back(static_cast<double>(noise(i) >> 11) * 0x1p-50);
    const auto [x, y] = all_pairs(few);
    for (const Variant& variant : exact_variants()) {
        const std::vector<double> angle = evaluate_one<double>(variant, call(&Math::atan2), y, x);
        const std::vector<double> power = evaluate_one<double>(variant, call(&Math::pow), x, y);
        for (std::size_t i = 0; i < x.size(); ++i) {
            ASSERT_LE(
                relative_error(angle[i], std::atan2(static_cast<long double>(y[i]), static_cast<long double>(x[i]))),
                1e-15)
                << y[i] << " " << x[i];
            long double expected = std::pow(static_cast<long double>(x[i]), static_cast<long double>(y[i]));
            if (x[i] < 0 && y[i] != 0) expected = NAN;
            // pow(-0, y): the sign of zero is ignored as in single precision only if y is no odd integer.
            if (x[i] == 0 && std::signbit(x[i])) continue;
            ASSERT_LE(relative_error(power[i], expected), 1e-15)
                << x[i] << "^" << y[i] << " = " << power[i] << "; " << variant.name();
        }
    }
}

TEST(Double, of_a_function_of_single_precision_agrees_with_it) {
    std::vector<double> wide;
    std::vector<float> narrow;
    for (const float x : few_floats()) {
        if (!(std::abs(x) < 80)) continue;
        narrow.push_back(x);
        wide.push_back(x);
    }
    for (const auto function : {&Math::sin, &Math::tanh, &Math::exp2, &Math::log, &Math::inverse_sqrt, &Math::round,
                                &Math::fract, &Math::quantize_to_f16}) {
        const auto doubles = evaluate_one<double>({}, call(function), wide);
        const auto singles = evaluate_one<float>({}, call(function), narrow);
        for (std::size_t i = 0; i < wide.size(); ++i) ASSERT_LE(ulp_error(singles[i], doubles[i]), 2.5) << narrow[i];
    }
}

}  // namespace
}  // namespace nacre::cpu
