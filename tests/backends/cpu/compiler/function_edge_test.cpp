// SPDX-License-Identifier: Apache-2.0
// Functions to which Vulkan gives a tolerance, in shaders, where their arguments are zero, denormal, huge, infinite or
// NaN; against double precision. And packing of numbers that the packed format cannot hold.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "tests/backends/cpu/compiler/compute_runner.h"
#include "tests/backends/cpu/compiler/half_number.h"

namespace nacre::cpu {
namespace {

using Word = std::uint32_t;

float as_float(Word bits) { return std::bit_cast<float>(bits); }
Word as_bits(float value) { return std::bit_cast<Word>(value); }

/// Distance of floats around a value.
double ulp(double value) { return std::ldexp(1.0, std::max(-126, std::ilogb(std::max(std::abs(value), 1e-38))) - 23); }

/// The same of halves.
double half_ulp(double value) {
    return std::ldexp(1.0, std::max(-14, std::ilogb(std::max(std::abs(value), 1e-38))) - 10);
}

constexpr double no_bound = HUGE_VAL;

const char* const specs[] = {"cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16", "cpu:fast"};

// Vulkan specification, "Precision and Operation of SPIR-V Instructions": the errors of what others are derived from.
// They hold for finite arguments.
double exponential_error(double x, double y) { return (3 + 2 * std::abs(x)) * ulp(y); }
double logarithm_error(double x, double y) { return x >= 0.5 && x <= 2.0 ? 0x1p-21 : 3 * ulp(y); }
double arctangent_error(double, double y) { return 4096 * ulp(y); }
/// Its table has the error within [-pi, pi]; backends/cpu/compiler/math/math.h promises more, and a result in [-1, 1]
/// beyond.
double sine_error(double x, double) { return std::abs(x) <= 1e5 ? 0x1p-11 : 2.0; }
/// (exp(x) - exp(-x)) / 2, or the sum.
double hyperbolic_error(double x, double y) {
    return (exponential_error(x, std::exp(x)) + exponential_error(x, std::exp(-x))) / 2 + ulp(y);
}
/// Of a logarithm whose argument, above 1, is a sum with a square root: a few units in its last place.
double inverse_hyperbolic_error(double argument) {
    return std::max(0x1p-21, 3 * ulp(std::log(argument))) + 16 * 0x1p-23;
}

struct Function {
    const char* glsl;  ///< Of float x.
    double (*exact)(double);
    double (*tolerance)(double x, double y);  ///< Of a finite argument and result.
    const char* half_glsl = nullptr;          ///< Where it is another for halves.
    /// Halves go through single precision (math.h) and are rounded then, but for these: error in units of halves.
    double half_units = 0;
};

const Function functions[] = {
    {"sin(x)", [](double x) { return std::sin(x); }, sine_error},
    {"cos(x)", [](double x) { return std::cos(x); }, sine_error},
    // Where the table says nothing of sine and cosine, their quotient may be anything.
    {"abs(x) <= 1e5 || isinf(x) ? tan(x) : x",
     [](double x) { return std::abs(x) <= 1e5 || std::isinf(x) ? std::tan(x) : x; },
     [](double x, double y) {
         const double sine = std::abs(std::sin(x)), cosine = std::abs(std::cos(x)), error = sine_error(x, 0);
         if (std::abs(x) > 1e5) return 0.0;
         return cosine <= error ? no_bound : (sine + error) / (cosine - error) - sine / cosine + 2.5 * ulp(y);
     },
     "tan(x)"},
    {"asin(x)", [](double x) { return std::asin(x); }, arctangent_error},
    {"acos(x)", [](double x) { return std::acos(x); }, arctangent_error},
    {"atan(x)", [](double x) { return std::atan(x); }, arctangent_error},
    {"sinh(x)", [](double x) { return std::sinh(x); }, hyperbolic_error},
    {"cosh(x)", [](double x) { return std::cosh(x); }, hyperbolic_error},
    {"tanh(x)", [](double x) { return std::tanh(x); },
     [](double x, double y) {
         const double s = std::sinh(x), c = std::cosh(x);
         // Where both overflow, the result is the limit.
         return std::abs(x) > 80 ? ulp(1.0)
                                 : (hyperbolic_error(x, s) + std::abs(y) * hyperbolic_error(x, c)) / c + 2.5 * ulp(y);
     }},
    {"asinh(x)", [](double x) { return std::asinh(x); },
     [](double x, double) { return inverse_hyperbolic_error(std::abs(x) + std::sqrt(x * x + 1)); }},
    {"acosh(x)", [](double x) { return std::acosh(x); },
     [](double x, double) { return inverse_hyperbolic_error(x + std::sqrt(x * x - 1)); }},
    {"atanh(x)", [](double x) { return std::atanh(x); },
     [](double x, double) { return inverse_hyperbolic_error((1 + std::abs(x)) / (1 - std::abs(x))) / 2; }},
    {"exp(x)", [](double x) { return std::exp(x); }, exponential_error},
    {"exp2(x)", [](double x) { return std::exp2(x); }, exponential_error},
    {"log(x)", [](double x) { return std::log(x); }, logarithm_error},
    {"log2(x)", [](double x) { return std::log2(x); }, logarithm_error},
    // By way of inversesqrt and a division: 2 and 2.5 units.
    {"sqrt(x)", [](double x) { return std::sqrt(x); }, [](double, double y) { return 4.5 * ulp(y); }, nullptr, 4},
    {"inversesqrt(x)", [](double x) { return 1 / std::sqrt(x); }, [](double, double y) { return 2 * ulp(y); }, nullptr,
     1.5},
    {"1.0 / x", [](double x) { return 1 / x; }, [](double, double y) { return 2.5 * ulp(y); }, "float16_t(1.0) / x", 2},
    {"radians(x)", [](double x) { return x * 3.14159265358979323846 / 180; },
     [](double, double y) { return 2 * ulp(y); }, nullptr, 1.5},
    {"degrees(x)", [](double x) { return x * 180 / 3.14159265358979323846; },
     [](double, double y) { return 2 * ulp(y); }, nullptr, 1.5},
};

struct FunctionOfTwo {
    const char* glsl;
    double (*exact)(double, double);
    double (*tolerance)(double x, double y, double result);
};

/// As Vulkan defines it; of y = 0 math.h promises more.
double power(double x, double y) { return y == 0 ? 1 : std::exp2(y * std::log2(x)); }
double power_error(double x, double y, double result) {
    const double exponent = y * std::log2(x);
    if (!std::isfinite(exponent)) return ulp(result);
    const double inner = std::abs(y) * logarithm_error(x, std::log2(x)) + ulp(exponent);
    return result * (std::exp2(inner) - 1) + exponential_error(exponent, result) * std::exp2(inner);
}

const FunctionOfTwo functions_of_two[] = {
    {"atan(x, y)", [](double x, double y) { return std::atan2(x, y); },
     [](double, double, double result) { return arctangent_error(0, result); }},
    {"pow(x, y)", power, power_error},
};

const std::vector<Word> edges{
    0x00000000, 0x80000000,                          // Zeros.
    0x00000001, 0x80000001, 0x007fffff, 0x807fffff,  // Denormals.
    0x00800000, 0x80800000, 0x2edbe6ff,              // The least normal; 1e-10.
    0x3f000000, 0xbf000000, 0x3f7fffff, 0x3f800000, 0xbf800000, 0x3f800001, 0x3fc00000, 0x40000000,
    0xc0000000, 0x3fc90fdb, 0x40490fdb, 0xc0490fdb,  // pi / 2, pi, -pi.
    0x42b17217, 0xc2b17217, 0x42b20000, 0xc2cff1b5,  // Around the ends of exp: 88.72, 89, -103.97.
    0x42ff0000, 0x43000000, 0xc2fc0000, 0xc3160000,  // And of exp2: 127.5, 128, -126, -150.
    0x47c35000, 0xc7c35000, 0x501502f9,              // 1e5, 1e10.
    0x7e967699, 0x7f7fffff, 0xff7fffff, 0x7f800000, 0xff800000, 0x7fc00000, 0xffc00001, 0x7f800001};

/// What is wrong with a result; nothing where it is fine.
std::string problem_of(double found, double exact, double tolerance,
                       double greatest = std::numeric_limits<float>::max(), double least_normal = 0x1p-126) {
    // NaN where mathematics has no answer, and only there.
    if (std::isnan(exact)) return std::isnan(found) ? "" : "not NaN";
    if (std::isnan(found)) return "NaN";
    if (std::isinf(exact)) return found == exact ? "" : "not infinite";
    if (std::isinf(found))
        return (found > 0) == (exact > 0) && std::abs(exact) + tolerance > greatest ? "" : "infinite";
    // Results that are denormal may be flushed to zero.
    if (std::abs(exact) < least_normal && found == 0) return "";
    return std::abs(found - exact) <= tolerance + std::abs(exact) * 0x1p-24 ? "" : "wrong";
}

std::string constants(const std::vector<Word>& words, const std::string& name) {
    std::string text;
    for (const Word word : words) text += fmt::format("{}{:#x}u", text.empty() ? "" : ", ", word);
    return fmt::format("const uint {}[{}] = uint[]({});\n", name, words.size(), text);
}

double half_of(Word bits) {
    Half half;
    half.bits = static_cast<std::uint16_t>(bits);
    return half;
}

TEST(FunctionEdges, FunctionsOfOneArgumentAreWithinTheTable) {
    const std::size_t count = edges.size();
    std::string text =
        fmt::format("layout(local_size_x = {}) in;\nlayout(set = 0, binding = 0) buffer Result {{ uint result[]; }};\n",
                    count) +
        constants(edges, "edges") +
        "void main() { uint at = gl_LocalInvocationIndex; float x = uintBitsToFloat(edges[at]);\n";
    for (std::size_t i = 0; i < std::size(functions); ++i)
        text += fmt::format("result[at + {}u] = floatBitsToUint({});\n", i * count, functions[i].glsl);
    for (const char* spec : specs) {
        const ComputeRunner runner{.spec = spec, .result_words = static_cast<Word>(count * std::size(functions))};
        const auto found = runner.run_glsl(text + "}\n");
        ASSERT_TRUE(found) << found.error().message();
        for (std::size_t i = 0; i < std::size(functions); ++i)
            for (std::size_t at = 0; at < count; ++at) {
                const float x = as_float(edges[at]), value = as_float((*found)[i * count + at]);
                const double exact = functions[i].exact(x);
                const std::string problem =
                    problem_of(value, exact, std::isfinite(x) ? functions[i].tolerance(x, exact) : ulp(exact));
                EXPECT_EQ(problem, "") << spec << ", " << functions[i].glsl
                                       << fmt::format(" of {:#x} ({:.9g}): {:.9g}, not {:.9g}", edges[at], x, value,
                                                      exact);
            }
    }
}

TEST(FunctionEdges, FunctionsOfTwoArgumentsAreWithinTheTable) {
    const std::size_t count = edges.size(), pairs = count * count;
    std::string text =
        fmt::format("layout(local_size_x = {}) in;\nlayout(set = 0, binding = 0) buffer Result {{ uint result[]; }};\n",
                    count) +
        constants(edges, "edges") +
        fmt::format(
            "void main() {{ for (uint i = 0u; i < {0}u; ++i) {{ float x = uintBitsToFloat(edges[i]), y = "
            "uintBitsToFloat(edges[gl_LocalInvocationIndex]); uint at = i * {0}u + gl_LocalInvocationIndex;\n",
            count);
    for (std::size_t i = 0; i < std::size(functions_of_two); ++i)
        text += fmt::format("result[at + {}u] = floatBitsToUint({});\n", i * pairs, functions_of_two[i].glsl);
    for (const char* spec : specs) {
        const ComputeRunner runner{.spec = spec,
                                   .result_words = static_cast<Word>(pairs * std::size(functions_of_two))};
        const auto found = runner.run_glsl(text + "} }\n");
        ASSERT_TRUE(found) << found.error().message();
        for (std::size_t i = 0; i < std::size(functions_of_two); ++i)
            for (std::size_t at = 0; at < pairs; ++at) {
                const Word a = edges[at / count], b = edges[at % count];
                const float x = as_float(a), y = as_float(b), value = as_float((*found)[i * pairs + at]);
                const double exact = functions_of_two[i].exact(x, y);
                const double tolerance = std::isfinite(x) && std::isfinite(y)
                                             ? functions_of_two[i].tolerance(x, y, exact)
                                             : 4096 * ulp(exact);
                const std::string problem = problem_of(value, exact, tolerance);
                EXPECT_EQ(problem, "") << spec << ", " << functions_of_two[i].glsl
                                       << fmt::format(" of {:#x} ({:.9g}), {:#x} ({:.9g}): {:.9g}, not {:.9g}", a, x, b,
                                                      y, value, exact);
            }
    }
}

// Every half. The results of single precision are rounded to one.
TEST(FunctionEdges, FunctionsOfHalvesAreThoseOfSinglePrecisionRounded) {
    constexpr std::size_t count = 65536;
    std::string text =
        "#extension GL_EXT_shader_explicit_arithmetic_types : require\nlayout(local_size_x = 256) in;\n"
        "layout(set = 0, binding = 0) buffer Result { uint result[]; };\n"
        "void main() { for (uint i = 0u; i < 256u; ++i) { uint at = i * 256u + gl_LocalInvocationIndex; float16_t x = "
        "unpackFloat2x16(at).x;\n";
    for (std::size_t i = 0; i < std::size(functions); ++i)
        text += fmt::format("result[at + {}u] = packFloat2x16(f16vec2({}, float16_t(0.0)));\n", i * count,
                            functions[i].half_glsl ? functions[i].half_glsl : functions[i].glsl);
    for (const char* spec : specs) {
        const ComputeRunner runner{.spec = spec, .result_words = static_cast<Word>(count * std::size(functions))};
        const auto found = runner.run_glsl(text + "} }\n");
        ASSERT_TRUE(found) << found.error().message();
        for (std::size_t i = 0; i < std::size(functions); ++i) {
            int wrong = 0;
            for (std::size_t at = 0; at < count && wrong < 3; ++at) {
                const double x = half_of(static_cast<Word>(at)), value = half_of((*found)[i * count + at]);
                const double exact = functions[i].exact(x);
                const double single = std::isfinite(x) ? functions[i].tolerance(x, exact) : ulp(exact);
                const double tolerance = single + (0.5 + functions[i].half_units) * half_ulp(exact);
                const std::string problem = problem_of(value, exact, tolerance, 65504, 0x1p-14);
                if (problem.empty()) continue;
                ++wrong;
                ADD_FAILURE() << problem << ": " << spec << ", " << functions[i].glsl
                              << fmt::format(" of {:#x} ({:.6g}): {:.6g}, not {:.6g}", at, x, value, exact);
            }
        }
    }
}

TEST(FunctionEdges, FunctionsOfTwoHalvesAreThoseOfSinglePrecisionRounded) {
    const std::vector<Word> halves{0x0000, 0x8000, 0x0001, 0x8001, 0x03ff, 0x83ff, 0x0400, 0x8400, 0x3800,
                                   0xb800, 0x3bff, 0x3c00, 0xbc00, 0x3c01, 0x4000, 0xc000, 0x4248, 0xc248,
                                   0x4900, 0x5640, 0xd640, 0x7bff, 0xfbff, 0x7c00, 0xfc00, 0x7e00, 0x7d01};
    const std::size_t count = halves.size(), pairs = count * count;
    std::string text =
        fmt::format(
            "#extension GL_EXT_shader_explicit_arithmetic_types : require\nlayout(local_size_x = {}) in;\n"
            "layout(set = 0, binding = 0) buffer Result {{ uint result[]; }};\n",
            count) +
        constants(halves, "halves") +
        fmt::format(
            "void main() {{ for (uint i = 0u; i < {0}u; ++i) {{ float16_t x = unpackFloat2x16(halves[i]).x, y = "
            "unpackFloat2x16(halves[gl_LocalInvocationIndex]).x; uint at = i * {0}u + gl_LocalInvocationIndex;\n",
            count);
    for (std::size_t i = 0; i < std::size(functions_of_two); ++i)
        text += fmt::format("result[at + {}u] = packFloat2x16(f16vec2({}, float16_t(0.0)));\n", i * pairs,
                            functions_of_two[i].glsl);
    for (const char* spec : specs) {
        const ComputeRunner runner{.spec = spec,
                                   .result_words = static_cast<Word>(pairs * std::size(functions_of_two))};
        const auto found = runner.run_glsl(text + "} }\n");
        ASSERT_TRUE(found) << found.error().message();
        for (std::size_t i = 0; i < std::size(functions_of_two); ++i)
            for (std::size_t at = 0; at < pairs; ++at) {
                const double x = half_of(halves[at / count]), y = half_of(halves[at % count]),
                             value = half_of((*found)[i * pairs + at]), exact = functions_of_two[i].exact(x, y);
                const double single = std::isfinite(x) && std::isfinite(y) ? functions_of_two[i].tolerance(x, y, exact)
                                                                           : 4096 * ulp(exact);
                EXPECT_EQ(problem_of(value, exact, single + 0.5 * half_ulp(exact), 65504, 0x1p-14), "")
                    << spec << ", " << functions_of_two[i].glsl
                    << fmt::format(" of {:.6g}, {:.6g}: {:.6g}, not {:.6g}", x, y, value, exact);
            }
    }
}

// ---- Packing

/// Clamped, multiplied, and rounded to the nearest, halves to even; NaN counts as zero.
Word normalized(float x, float low, float scale, Word mask) {
    const float clamped = std::isnan(x) ? 0.0f : std::clamp(x, low, 1.0f);
    return static_cast<Word>(static_cast<std::int32_t>(std::nearbyint(clamped * scale))) & mask;
}
float unpacked(Word bits, int width, bool is_signed) {
    const Word mask = (1u << width) - 1, field = bits & mask;
    if (!is_signed) return static_cast<float>(field) / static_cast<float>(mask);
    const auto value = static_cast<float>(static_cast<std::int32_t>(field << (32 - width)) >> (32 - width));
    return std::max(value / static_cast<float>(mask >> 1), -1.0f);
}

TEST(FunctionEdges, PackingHoldsWhatTheFormatCan) {
    // Beyond the range, at its ends, and between two values.
    const std::vector<float> numbers{0.0f,          -0.0f,  1.0f,         -1.0f,       1.5f,       -1.5f,
                                     0.5f,          -0.5f,  0.5f / 255,   1.5f / 255,  0.5f / 127, -0.5f / 127,
                                     2.5f / 65535,  1e-40f, 1e30f,        -1e30f,      HUGE_VALF,  -HUGE_VALF,
                                     std::nanf(""), 0.999f, 126.5f / 127, 254.5f / 255};
    const std::vector<Word> words{0u,          1u,          0x7fu,       0x80u,       0x81u,       0xffu,
                                  0x7fffu,     0x8000u,     0x8001u,     0xffffu,     0x7fff0000u, 0x80000000u,
                                  0x80ff7f01u, 0xffffffffu, 0x12345678u, 0xfedcba98u, 0x80808080u, 0x7f7f7f7fu,
                                  5u,          6u,          7u,          8u};
    ASSERT_EQ(numbers.size(), words.size());
    const std::size_t count = numbers.size();
    std::vector<Word> bits;
    for (const float number : numbers) bits.push_back(as_bits(number));
    std::string text =
        fmt::format("layout(local_size_x = {}) in;\nlayout(set = 0, binding = 0) buffer Result {{ uint result[]; }};\n",
                    count) +
        constants(bits, "numbers") + constants(words, "words") +
        fmt::format(
            "void main() {{ uint at = gl_LocalInvocationIndex; float x = uintBitsToFloat(numbers[at]), y = "
            "uintBitsToFloat(numbers[(at + 5u) % {0}u]); uint w = words[at]; vec4 v;\n",
            count);
    const char* const packed[] = {"packUnorm4x8(vec4(x, y, y, x))", "packSnorm4x8(vec4(x, y, y, x))",
                                  "packUnorm2x16(vec2(x, y))", "packSnorm2x16(vec2(x, y))"};
    std::size_t row = 0;
    for (const char* one : packed) text += fmt::format("result[at + {}u] = {};\n", row++ * count, one);
    const char* const opened[] = {"unpackUnorm4x8(w)", "unpackSnorm4x8(w)", "vec4(unpackUnorm2x16(w), 0.0, 0.0)",
                                  "vec4(unpackSnorm2x16(w), 0.0, 0.0)"};
    for (const char* one : opened) {
        text += fmt::format("v = {};\n", one);
        for (int i = 0; i < 4; ++i)
            text += fmt::format("result[at + {}u] = floatBitsToUint(v[{}]);\n", row++ * count, i);
    }
    for (const char* spec : specs) {
        SCOPED_TRACE(spec);
        const ComputeRunner runner{.spec = spec, .result_words = static_cast<Word>(count * row)};
        const auto found = runner.run_glsl(text + "}\n");
        ASSERT_TRUE(found) << found.error().message();
        for (std::size_t at = 0; at < count; ++at) {
            const float x = numbers[at], y = numbers[(at + 5) % count];
            const auto four = [&](float low, float scale) {
                const Word a = normalized(x, low, scale, 255), b = normalized(y, low, scale, 255);
                return a | b << 8 | b << 16 | a << 24;
            };
            const auto two = [&](float low, float scale) {
                return normalized(x, low, scale, 65535) | normalized(y, low, scale, 65535) << 16;
            };
            EXPECT_EQ((*found)[at], four(0, 255)) << packed[0] << " of " << x << ", " << y;
            EXPECT_EQ((*found)[count + at], four(-1, 127)) << packed[1] << " of " << x << ", " << y;
            EXPECT_EQ((*found)[2 * count + at], two(0, 65535)) << packed[2] << " of " << x << ", " << y;
            EXPECT_EQ((*found)[3 * count + at], two(-1, 32767)) << packed[3] << " of " << x << ", " << y;
            for (std::size_t kind = 0; kind < 4; ++kind)
                for (std::size_t i = 0; i < 4; ++i) {
                    const int width = kind < 2 ? 8 : 16;
                    const float expected = kind >= 2 && i >= 2 ? 0.0f
                                                               : unpacked(words[at] >> (width * static_cast<int>(i)),
                                                                          width, kind % 2 == 1);
                    EXPECT_EQ(as_float((*found)[(4 + kind * 4 + i) * count + at]), expected)
                        << opened[kind] << "[" << i << "] of " << std::hex << words[at];
                }
        }
    }
}

TEST(FunctionEdges, HalvesInAWordAreTheNearest) {
    // Every half, and floats half way between two.
    for (const char* spec : specs) {
        SCOPED_TRACE(spec);
        const ComputeRunner runner{.spec = spec, .result_words = 65536 * 3};
        const auto found = runner.run_glsl(R"(
        layout(local_size_x = 256) in;
        layout(set = 0, binding = 0) buffer Result { uint result[]; };
        void main() {
            for (uint i = 0u; i < 256u; ++i) {
                uint at = i * 256u + gl_LocalInvocationIndex;
                float value = unpackHalf2x16(at).x;
                result[at * 3u] = floatBitsToUint(value);
                result[at * 3u + 1u] = packHalf2x16(vec2(value, unpackHalf2x16(at << 16).y));
                float next = unpackHalf2x16(at + 1u).x;
                result[at * 3u + 2u] = packHalf2x16(vec2((value + next) * 0.5, 1e9));
            }
        })");
        ASSERT_TRUE(found) << found.error().message();
        const auto value_of = [](Word half) {
            const int exponent = static_cast<int>(half >> 10 & 31), fraction = static_cast<int>(half & 1023);
            const double magnitude = exponent == 0    ? fraction * 0x1p-24
                                     : exponent == 31 ? (fraction ? std::nan("") : HUGE_VAL)
                                                      : std::ldexp(1024 + fraction, exponent - 25);
            return half & 0x8000 ? -magnitude : magnitude;
        };
        for (Word half = 0; half < 65536; ++half) {
            const double value = value_of(half);
            const float opened = as_float((*found)[half * 3]);
            const Word packed = (*found)[half * 3 + 1], middle = (*found)[half * 3 + 2];
            if (std::isnan(value)) {
                ASSERT_TRUE(std::isnan(opened) && std::isnan(value_of(packed & 0xffff)) &&
                            std::isnan(value_of(packed >> 16)))
                    << half;
                continue;
            }
            ASSERT_EQ(as_bits(opened), as_bits(static_cast<float>(value))) << half;
            ASSERT_EQ(packed, half | half << 16);
            ASSERT_EQ(middle >> 16, 0x7c00u) << "what is too large becomes infinite";
            const bool has_middle = (half & 0x7fff) < 0x7bff;
            if (has_middle) {
                // The even one of the two.
                ASSERT_EQ(middle & 0xffff, half % 2 ? half + 1 : half) << half;
            }
        }
    }
}

}  // namespace
}  // namespace nacre::cpu
