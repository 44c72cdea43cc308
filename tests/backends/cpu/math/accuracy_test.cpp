// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <mutex>
#include <string>
#include <thread>

#include "tests/backends/cpu/math/evaluate.h"
#include "tests/backends/cpu/math/samples.h"

// Single precision functions against the C library in double precision.

namespace nacre::cpu {
namespace {

struct Function {
    const char* name;
    llvm::Value* (Math::*emit)(llvm::Value*);
    double (*expected)(double);
    /// Largest error allowed, in units of the last place. At most what Vulkan allows.
    double ulps;
    /// Where the bound holds; beyond, results are only bounded in magnitude.
    double range = std::numeric_limits<double>::infinity();
    /// An error below this is fine whatever it is in units of the last place.
    double absolute = 0;
};

double inverse_sqrt(double x) {
    return 1 / std::sqrt(x);
}

const Function functions[] = {
    {"sin", &Math::sin, std::sin, 2.5, 1e5, 0x1p-32},
    {"cos", &Math::cos, std::cos, 2.5, 1e5, 0x1p-32},
    {"tan", &Math::tan, std::tan, 8, 1e5, 0x1p-32},
    {"asin", &Math::asin, std::asin, 3},
    {"acos", &Math::acos, std::acos, 3},
    {"atan", &Math::atan, std::atan, 3},
    {"sinh", &Math::sinh, std::sinh, 3},
    {"cosh", &Math::cosh, std::cosh, 3},
    {"tanh", &Math::tanh, std::tanh, 3},
    {"asinh", &Math::asinh, std::asinh, 3},
    {"acosh", &Math::acosh, std::acosh, 3},
    {"atanh", &Math::atanh, std::atanh, 3},
    {"exp", &Math::exp, std::exp, 2},
    {"exp2", &Math::exp2, std::exp2, 2},
    {"log", &Math::log, std::log, 2},
    {"log2", &Math::log2, std::log2, 2.25},
    {"sqrt", &Math::sqrt, std::sqrt, 0.5},
    {"inverse_sqrt", &Math::inverse_sqrt, inverse_sqrt, 1.5},
};

struct Worst {
    double ulps = 0;
    float x = 0;
    float result = 0;

    void take(const Function& function, float at, float value) {
        const double error = ulp_error(value, function.expected(at));
        if (std::abs(at) > function.range && std::isfinite(at)) {
            if (!(std::abs(value) <= 1) && function.expected != static_cast<double (*)(double)>(std::tan)) *this = {std::numeric_limits<double>::infinity(), at, value};
            return;
        }
        if (error > ulps && !(std::abs(static_cast<double>(value) - function.expected(at)) <= function.absolute)) *this = {error, at, value};
    }
};

class Accuracy : public testing::TestWithParam<Function> {};

TEST_P(Accuracy, of_single_precision_is_within_the_bound) {
    const Function& function = GetParam();
    const std::vector<float>& x = many_floats();
    for (const bool contract : {false, true}) {
        const Variant variant{.options = {.contract = contract}, .optimized = true};
        const std::vector<float> result = evaluate_one<float>(variant, call(function.emit), x);
        Worst worst;
        for (std::size_t i = 0; i < x.size(); ++i) worst.take(function, x[i], result[i]);
        EXPECT_LE(worst.ulps, function.ulps) << function.name << "(" << worst.x << ") = " << worst.result << " and not "
                                             << function.expected(worst.x) << "; " << variant.name();
        RecordProperty(contract ? "ulps_contracted" : "ulps", std::to_string(worst.ulps));
        std::printf("%s: %.3f ulp at %a (%s)\n", function.name, worst.ulps, worst.x, variant.name().c_str());
    }
}

TEST_P(Accuracy, does_not_depend_on_lanes_or_target) {
    const Function& function = GetParam();
    const std::vector<float>& x = many_floats();
    std::vector<float> first;
    for (const Variant& variant : exact_variants()) {
        const std::vector<float> result = evaluate_one<float>(variant, call(function.emit), x);
        if (first.empty()) first = result;
        std::size_t different = 0, at = 0;
        for (std::size_t i = 0; i < x.size(); ++i) {
            const bool both_nan = std::isnan(result[i]) && std::isnan(first[i]);
            if (both_nan || std::bit_cast<std::uint32_t>(result[i]) == std::bit_cast<std::uint32_t>(first[i])) continue;
            if (different++ == 0) at = i;
        }
        EXPECT_EQ(different, 0u) << function.name << "(" << x[at] << ") is " << result[at] << " and not " << first[at] << " with "
                                 << variant.name();
    }
}

INSTANTIATE_TEST_SUITE_P(Of, Accuracy, testing::ValuesIn(functions), [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace nacre::cpu
