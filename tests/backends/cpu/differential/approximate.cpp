// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/differential/approximate.h"

#include <algorithm>
#include <cmath>

namespace nacre::differential {

namespace {

/// Distance of floats around a value: its unit in the last place.
double ulp(double value) { return std::ldexp(1.0, std::max(-126, std::ilogb(std::max(std::abs(value), 1e-37))) - 23); }
double ulps(double count, double value) { return count * ulp(value); }

}  // namespace

std::span<const ApproximateFunction> approximate_functions() {
    // Vulkan specification, "Precision and Operation of SPIR-V Instructions". Functions that it derives from others get
    // what follows from those.
    static constexpr double trigonometric = 0x1p-11;
    static const ApproximateFunction functions[] = {
        {"sin($)", -3.14, 3.14, [](double x) { return std::sin(x); }, [](double, double) { return trigonometric; }},
        {"cos($)", -3.14, 3.14, [](double x) { return std::cos(x); }, [](double, double) { return trigonometric; }},
        {"exp($)", -20, 20, [](double x) { return std::exp(x); },
         [](double x, double y) { return ulps(3 + 2 * std::abs(x), y); }},
        {"exp2($)", -30, 30, [](double x) { return std::exp2(x); },
         [](double x, double y) { return ulps(3 + 2 * std::abs(x), y); }},
        {"log($)", 0.0001, 900, [](double x) { return std::log(x); },
         [](double x, double y) { return x >= 0.5 && x <= 2.0 ? 0x1p-21 : ulps(3, y); }},
        {"log2($)", 0.0001, 900, [](double x) { return std::log2(x); },
         [](double x, double y) { return x >= 0.5 && x <= 2.0 ? 0x1p-21 : ulps(3, y); }},
        // By way of inversesqrt: 2 ulp, and a division: 2.5 ulp.
        {"sqrt($)", 0, 900, [](double x) { return std::sqrt(x); }, [](double, double y) { return ulps(5.5, y); }},
        {"inversesqrt($)", 0.001, 900, [](double x) { return 1 / std::sqrt(x); },
         [](double, double y) { return ulps(2, y); }},
        {"(1.0 / $)", 0.001, 900, [](double x) { return 1 / x; }, [](double, double y) { return ulps(2.5, y); }},
        {"($ / 7.3)", -900, 900, [](double x) { return x / double(7.3f); },
         [](double, double y) { return ulps(2.5, y); }},
        {"atan($)", -900, 900, [](double x) { return std::atan(x); }, [](double, double y) { return ulps(4096, y); }},
        {"atan($, 2.5)", -900, 900, [](double x) { return std::atan2(x, 2.5); },
         [](double, double y) { return ulps(4096, y); }},
        // exp2(y * log2(x)) with the errors of both.
        {"pow($, 1.75)", 0.01, 200, [](double x) { return std::pow(x, 1.75); },
         [](double x, double y) {
             const double power = 1.75 * std::log2(x);
             const double inner = 1.75 * (x >= 0.5 && x <= 2.0 ? 0x1p-21 : ulps(3, std::log2(x))) + ulp(power);
             return y * (std::exp2(inner) - 1) + ulps(3 + 2 * std::abs(power), y);
         }},
        {"mix($, 3.5, 0.375)", -900, 900, [](double x) { return x * 0.625 + 3.5 * 0.375; },
         [](double x, double) { return ulps(2, std::abs(x)) + ulps(2, 4.0); }},
        {"length(vec2($, 2.0))", -900, 900, [](double x) { return std::sqrt(x * x + 4); },
         [](double, double y) { return ulps(8, y); }},
        {"fract($)", -900, 900, [](double x) { return x - std::floor(x); }, [](double, double) { return 0.0; }},
    };
    return functions;
}

}  // namespace nacre::differential
