// SPDX-License-Identifier: Apache-2.0
// Instructions of numbers, one by one and in every width, where their arguments are the least, the largest, zero, NaN,
// infinite or denormal. Expected values are computed in C++; where SPIR-V leaves a result undefined, they are what
// backends/cpu/compiler/math/math.h promises.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "tests/backends/cpu/compiler/compute_runner.h"
#include "tests/backends/cpu/compiler/half_number.h"

namespace nacre::cpu {
namespace {

using Word = std::uint64_t;

template <typename T>
constexpr bool is_float = std::is_same_v<T, Half> || std::floating_point<T>;
template <typename T>
constexpr int width = static_cast<int>(sizeof(T) * 8);
/// Float in which results are computed: for halves, double.
template <typename T>
using Exact = std::conditional_t<std::is_same_v<T, Half>, double, T>;

/// Name of the type in the module.
template <typename T>
std::string name_of() {
    if constexpr (std::is_same_v<T, bool>)
        return "bool";
    else
        return fmt::format("{}{}", is_float<T> ? 'f' : std::is_signed_v<T> ? 's' : 'u', width<T>);
}

template <typename T>
T from_word(Word word) {
    T value;
    std::memcpy(static_cast<void*>(&value), &word, sizeof(T));
    return value;
}
template <typename T>
Word to_word(T value) {
    Word word = 0;
    std::memcpy(&word, &value, sizeof(T));
    return word;
}

/// One instruction with arguments %x, %y, %z of the row's type; %y_s32 has the low bits of y.
struct Row {
    std::string text;    ///< Without "%result = ".
    std::string result;  ///< Type of the result.
    std::function<Word(Word, Word, Word)> expected;
    bool either_zero = false;  ///< Of zeros, the sign is free.
    std::string member;        ///< Of a result that is a structure: the index of the value that is looked at.
    std::string structure;     ///< Its type.
};

template <typename Result, typename T, typename Function>
Row row(const std::string& instruction, Function function, const std::string& arguments) {
    return {
        .text = fmt::format("{} %{} {}", instruction, name_of<Result>(), arguments),
        .result = name_of<Result>(),
        .expected = [function](Word x, Word y, Word z) {
            return to_word<Result>(static_cast<Result>(function(from_word<T>(x), from_word<T>(y), from_word<T>(z))));
        }};
}
template <typename T, typename Result = T, typename Function>
Row unary(const std::string& instruction, Function function) {
    return row<Result, T>(
        instruction, [function](T x, T, T) { return function(x); }, "%x");
}
template <typename T, typename Result = T, typename Function>
Row binary(const std::string& instruction, Function function) {
    return row<Result, T>(
        instruction, [function](T x, T y, T) { return function(x, y); }, "%x %y");
}
/// Instructions of GLSL.std.450.
template <typename T, typename Result = T, typename Function>
Row extended(const std::string& name, int arguments, Function function) {
    Row made = row<Result, T>("OpExtInst", function, "");
    made.text += "%glsl " + name + std::string(" %x %y %z").substr(0, static_cast<std::size_t>(arguments) * 3);
    return made;
}

template <std::integral T>
std::vector<Row> integer_rows() {
    using S = std::make_signed_t<T>;
    using U = std::make_unsigned_t<T>;
    constexpr S least = std::numeric_limits<S>::min();
    const auto s = [](T x) { return static_cast<S>(x); };
    const auto u = [](T x) { return static_cast<U>(x); };
    const auto wrapped = [](auto x) { return static_cast<T>(static_cast<U>(x)); };
    // Nothing traps, and x / 0 is what math.h says.
    const auto divided = [](S x, S y) -> S {
        return y == 0 ? S{0} : y == -1 ? static_cast<S>(U{0} - static_cast<U>(x)) : static_cast<S>(x / y);
    };
    const auto remainder = [](S x, S y) -> S { return y == 0 ? S{-1} : y == -1 ? S{0} : static_cast<S>(x % y); };
    const auto amount = [u](T y) { return static_cast<int>(u(y) % static_cast<U>(width<T>)); };
    std::vector<Row> rows{
        binary<T>("OpIAdd", [=](T x, T y) { return wrapped(Word{u(x)} + u(y)); }),
        binary<T>("OpISub", [=](T x, T y) { return wrapped(Word{u(x)} - u(y)); }),
        binary<T>("OpIMul", [=](T x, T y) { return wrapped(Word{u(x)} * u(y)); }),
        unary<T>("OpSNegate", [=](T x) { return wrapped(Word{0} - u(x)); }),
        binary<T>("OpSDiv", [=](T x, T y) { return static_cast<T>(divided(s(x), s(y))); }),
        binary<T>("OpSRem", [=](T x, T y) { return static_cast<T>(remainder(s(x), s(y))); }),
        binary<T>("OpSMod",
                  [=](T x, T y) {
                      const S rest = remainder(s(x), s(y));
                      const bool turns = s(y) != 0 && rest != 0 && (rest < 0) != (s(y) < 0);
                      return static_cast<T>(turns ? static_cast<S>(rest + s(y)) : rest);
                  }),
        binary<T>("OpBitwiseAnd", [=](T x, T y) { return wrapped(u(x) & u(y)); }),
        binary<T>("OpBitwiseOr", [=](T x, T y) { return wrapped(u(x) | u(y)); }),
        binary<T>("OpBitwiseXor", [=](T x, T y) { return wrapped(u(x) ^ u(y)); }),
        unary<T>("OpNot", [=](T x) { return wrapped(~Word{u(x)}); }),
        binary<T>("OpShiftLeftLogical", [=](T x, T y) { return wrapped(Word{u(x)} << amount(y)); }),
        binary<T>("OpShiftRightLogical", [=](T x, T y) { return wrapped(Word{u(x)} >> amount(y)); }),
        binary<T>("OpShiftRightArithmetic", [=](T x, T y) { return static_cast<T>(std::int64_t{s(x)} >> amount(y)); }),
        binary<T, bool>("OpIEqual", [](T x, T y) { return x == y; }),
        binary<T, bool>("OpINotEqual", [](T x, T y) { return x != y; }),
        binary<T, bool>("OpULessThan", [=](T x, T y) { return u(x) < u(y); }),
        binary<T, bool>("OpULessThanEqual", [=](T x, T y) { return u(x) <= u(y); }),
        binary<T, bool>("OpUGreaterThan", [=](T x, T y) { return u(x) > u(y); }),
        binary<T, bool>("OpUGreaterThanEqual", [=](T x, T y) { return u(x) >= u(y); }),
        binary<T, bool>("OpSLessThan", [=](T x, T y) { return s(x) < s(y); }),
        binary<T, bool>("OpSLessThanEqual", [=](T x, T y) { return s(x) <= s(y); }),
        binary<T, bool>("OpSGreaterThan", [=](T x, T y) { return s(x) > s(y); }),
        binary<T, bool>("OpSGreaterThanEqual", [=](T x, T y) { return s(x) >= s(y); }),
        extended<T>(
            "SAbs", 1,
            [=](T x, T, T) { return static_cast<T>(s(x) == least ? least : static_cast<S>(s(x) < 0 ? -s(x) : s(x))); }),
        extended<T>("SSign", 1, [=](T x, T, T) { return static_cast<T>((s(x) > 0) - (s(x) < 0)); }),
        extended<T>("SMin", 2, [=](T x, T y, T) { return static_cast<T>(std::min(s(x), s(y))); }),
        extended<T>("SMax", 2, [=](T x, T y, T) { return static_cast<T>(std::max(s(x), s(y))); }),
        extended<T>("UMin", 2, [=](T x, T y, T) { return static_cast<T>(std::min(u(x), u(y))); }),
        extended<T>("UMax", 2, [=](T x, T y, T) { return static_cast<T>(std::max(u(x), u(y))); }),
        extended<T>("SClamp", 3,
                    [=](T x, T low, T high) { return static_cast<T>(std::min(std::max(s(x), s(low)), s(high))); }),
        extended<T>("UClamp", 3,
                    [=](T x, T low, T high) { return static_cast<T>(std::min(std::max(u(x), u(low)), u(high))); }),
        // To other widths: by the sign, by zeros, or cut off.
        unary<T, float>("OpConvertSToF", [=](T x) { return static_cast<float>(s(x)); }),
        unary<T, float>("OpConvertUToF", [=](T x) { return static_cast<float>(u(x)); }),
        unary<T, double>("OpConvertSToF", [=](T x) { return static_cast<double>(s(x)); }),
        unary<T, double>("OpConvertUToF", [=](T x) { return static_cast<double>(u(x)); }),
    };
    const auto convert = [&]<typename To>(To) {
        if constexpr (sizeof(To) != sizeof(T)) {
            rows.push_back(unary<T, To>("OpSConvert", [=](T x) { return static_cast<To>(s(x)); }));
            if constexpr (std::is_unsigned_v<To>)
                rows.push_back(unary<T, To>("OpUConvert", [=](T x) { return static_cast<To>(u(x)); }));
        }
    };
    convert(std::int8_t{}), convert(std::uint8_t{}), convert(std::int16_t{}), convert(std::uint16_t{});
    convert(std::int32_t{}), convert(std::uint32_t{}), convert(std::int64_t{}), convert(std::uint64_t{});
    if constexpr (std::is_unsigned_v<T>) {
        rows.push_back(
            binary<T>("OpUDiv", [](T x, T y) { return y == 0 ? static_cast<T>(~Word{0}) : static_cast<T>(x / y); }));
        rows.push_back(
            binary<T>("OpUMod", [](T x, T y) { return y == 0 ? static_cast<T>(~Word{0}) : static_cast<T>(x % y); }));
    }
    if constexpr (sizeof(T) == 4) {
        rows.push_back(unary<T>("OpBitCount", [=](T x) { return static_cast<T>(std::popcount(u(x))); }));
        // Beyond the width a field has zeros.
        const auto low_bits = [](U count) { return count >= 32 ? ~0u : (1u << count) - 1; };
        const auto cut = [](U offset, U count) { return offset >= 32 ? 0u : std::min<U>(count, 32 - offset); };
        rows.push_back(row<T, T>(
            "OpBitFieldUExtract",
            [=](T x, T offset, T count) {
                const U bits = cut(u(offset), u(count));
                return static_cast<T>(bits == 0 ? 0u : u(x) >> u(offset) & low_bits(bits));
            },
            "%x %y %z"));
        rows.push_back(row<T, T>(
            "OpBitFieldSExtract",
            [=](T x, T offset, T count) {
                const U bits = std::min<U>(u(count), 32);
                if (bits == 0 || u(offset) >= 32) return T{0};
                return static_cast<T>(static_cast<std::int32_t>(u(x) >> u(offset) << (32 - bits)) >> (32 - bits));
            },
            "%x %y %z"));
        rows.push_back(row<T, T>(
            "OpBitFieldInsert",
            [=](T x, T offset, T count) {
                const U bits = cut(u(offset), u(count));
                if (bits == 0) return x;
                const U mask = low_bits(bits) << u(offset);
                return static_cast<T>((u(x) & ~mask) | (0xa5a5a5a5u << u(offset) & mask));
            },
            fmt::format("%x %{}_pattern %y %z", name_of<T>())));
        rows.push_back(unary<T>("OpBitReverse", [=](T x) {
            U reversed = 0;
            for (int i = 0; i < 32; ++i) reversed |= (u(x) >> i & 1) << (31 - i);
            return static_cast<T>(reversed);
        }));
        rows.push_back(extended<T>("FindILsb", 1, [=](T x, T, T) {
            return x == 0 ? static_cast<T>(-1) : static_cast<T>(std::countr_zero(u(x)));
        }));
        rows.push_back(
            extended<T>("FindUMsb", 1, [=](T x, T, T) { return static_cast<T>(31 - std::countl_zero(u(x))); }));
        rows.push_back(extended<T>("FindSMsb", 1, [=](T x, T, T) {
            return static_cast<T>(31 - std::countl_zero(s(x) < 0 ? static_cast<U>(~u(x)) : u(x)));
        }));
    }
    if constexpr (std::is_same_v<T, std::uint32_t>) {
        const auto both = [&](const std::string& op, auto low, auto high) {
            for (const bool is_high : {false, true}) {
                Row made = is_high ? binary<T>(op, high) : binary<T>(op, low);
                made.member = is_high ? "1" : "0", made.structure = "u32_pair";
                rows.push_back(made);
            }
        };
        both(
            "OpIAddCarry", [](T x, T y) { return x + y; },
            [](T x, T y) { return static_cast<T>((Word{x} + y) >> 32); });
        both(
            "OpISubBorrow", [](T x, T y) { return x - y; }, [](T x, T y) { return T{x < y}; });
        both(
            "OpUMulExtended", [](T x, T y) { return x * y; },
            [](T x, T y) { return static_cast<T>(Word{x} * y >> 32); });
        both(
            "OpSMulExtended", [](T x, T y) { return x * y; },
            [s](T x, T y) { return static_cast<T>(std::int64_t{s(x)} * s(y) >> 32); });
    }
    return rows;
}

/// Toward zero; what is out of range becomes the nearest, NaN zero.
template <std::integral To>
To saturated(double x) {
    if (std::isnan(x)) return 0;
    const double end = std::ldexp(1.0, std::numeric_limits<To>::digits);
    if (x >= end) return std::numeric_limits<To>::max();
    if (x <= (std::is_signed_v<To> ? -end : 0.0)) return std::numeric_limits<To>::min();
    return static_cast<To>(x);
}

template <typename T>
std::vector<Row> float_rows() {
    using E = Exact<T>;
    std::vector<Row> rows{
        binary<T>("OpFAdd", [](E x, E y) { return T(x + y); }),
        binary<T>("OpFSub", [](E x, E y) { return T(x - y); }),
        binary<T>("OpFMul", [](E x, E y) { return T(x * y); }),
        binary<T>("OpFDiv", [](E x, E y) { return T(x / y); }),
        unary<T>("OpFNegate", [](E x) { return T(-x); }),
        binary<T, bool>("OpFOrdEqual", [](E x, E y) { return x == y; }),
        binary<T, bool>("OpFUnordEqual", [](E x, E y) { return !(x < y || x > y); }),
        binary<T, bool>("OpFOrdNotEqual", [](E x, E y) { return x < y || x > y; }),
        binary<T, bool>("OpFUnordNotEqual", [](E x, E y) { return x != y; }),
        binary<T, bool>("OpFOrdLessThan", [](E x, E y) { return x < y; }),
        binary<T, bool>("OpFUnordLessThan", [](E x, E y) { return !(x >= y); }),
        binary<T, bool>("OpFOrdGreaterThan", [](E x, E y) { return x > y; }),
        binary<T, bool>("OpFUnordGreaterThan", [](E x, E y) { return !(x <= y); }),
        binary<T, bool>("OpFOrdLessThanEqual", [](E x, E y) { return x <= y; }),
        binary<T, bool>("OpFUnordLessThanEqual", [](E x, E y) { return !(x > y); }),
        binary<T, bool>("OpFOrdGreaterThanEqual", [](E x, E y) { return x >= y; }),
        binary<T, bool>("OpFUnordGreaterThanEqual", [](E x, E y) { return !(x < y); }),
        unary<T, bool>("OpIsNan", [](E x) { return std::isnan(x); }),
        unary<T, bool>("OpIsInf", [](E x) { return std::isinf(x); }),
        extended<T>("FAbs", 1, [](E x, E, E) { return T(std::abs(x)); }),
        extended<T>("FSign", 1, [](E x, E, E) { return T(E(x > 0) - E(x < 0)); }),
        extended<T>("Floor", 1, [](E x, E, E) { return T(std::floor(x)); }),
        extended<T>("Ceil", 1, [](E x, E, E) { return T(std::ceil(x)); }),
        extended<T>("Trunc", 1, [](E x, E, E) { return T(std::trunc(x)); }),
        extended<T>("RoundEven", 1, [](E x, E, E) { return T(std::nearbyint(x)); }),
        extended<T>("Fract", 1, [](E x, E, E) { return T(x - std::floor(x)); }),
        extended<T>("Sqrt", 1, [](E x, E, E) { return T(std::sqrt(x)); }),
        extended<T>("FMin", 2, [](E x, E y, E) { return T(x < y ? x : y); }),
        extended<T>("FMax", 2, [](E x, E y, E) { return T(x > y ? x : y); }),
        extended<T>("NMin", 2, [](E x, E y, E) { return T(std::fmin(x, y)); }),
        extended<T>("NMax", 2, [](E x, E y, E) { return T(std::fmax(x, y)); }),
        extended<T>("NClamp", 3, [](E x, E low, E high) { return T(std::fmin(std::fmax(x, low), high)); }),
        extended<T>("FClamp", 3,
                    [](E x, E low, E high) {
                        const E above = x > low ? x : low;
                        return T(above < high ? above : high);
                    }),
        extended<T>("Step", 2, [](E edge, E x, E) { return T(x < edge ? E(0) : E(1)); }),
        unary<T, std::int8_t>("OpConvertFToS", [](E x) { return saturated<std::int8_t>(x); }),
        unary<T, std::int16_t>("OpConvertFToS", [](E x) { return saturated<std::int16_t>(x); }),
        unary<T, std::int32_t>("OpConvertFToS", [](E x) { return saturated<std::int32_t>(x); }),
        unary<T, std::int64_t>("OpConvertFToS", [](E x) { return saturated<std::int64_t>(x); }),
        unary<T, std::uint8_t>("OpConvertFToU", [](E x) { return saturated<std::uint8_t>(x); }),
        unary<T, std::uint16_t>("OpConvertFToU", [](E x) { return saturated<std::uint16_t>(x); }),
        unary<T, std::uint32_t>("OpConvertFToU", [](E x) { return saturated<std::uint32_t>(x); }),
        unary<T, std::uint64_t>("OpConvertFToU", [](E x) { return saturated<std::uint64_t>(x); }),
    };
    if constexpr (!std::is_same_v<T, Half>) {
        // The order of roundings in which Vulkan defines them.
        rows.push_back(binary<T>("OpFRem", [](T x, T y) {
            const T product = y * std::trunc(x / y);
            return x - product;
        }));
        rows.push_back(binary<T>("OpFMod", [](T x, T y) {
            const T product = y * std::floor(x / y);
            return x - product;
        }));
        if constexpr (std::is_same_v<T, float>)
            rows.push_back(unary<T>("OpQuantizeToF16", [](T x) {
                const Half half(x);
                // Denormal halves are none of the values that it gives.
                return std::abs(half) < 0x1p-14 ? std::copysign(T(0), x) : static_cast<T>(static_cast<double>(half));
            }));
        rows.push_back(extended<T>("InverseSqrt", 1, [](T x, T, T) {
            const T root = std::sqrt(x);
            return T(1) / root;
        }));
        rows.push_back(extended<T>("Fma", 3, [](T x, T y, T z) { return std::fma(x, y, z); }));
        rows.push_back(unary<T, Half>("OpFConvert", [](T x) { return Half(static_cast<float>(x)); }));
    }
    if constexpr (!std::is_same_v<T, float>)
        rows.push_back(unary<T, float>("OpFConvert", [](E x) { return static_cast<float>(x); }));
    if constexpr (!std::is_same_v<T, double>)
        rows.push_back(unary<T, double>("OpFConvert", [](E x) { return static_cast<double>(x); }));
    Row ldexp = row<T, T>(
        "OpExtInst", [](T, T, T) { return T(0); }, "%glsl Ldexp %x %y_s32");
    ldexp.expected = [](Word x, Word y, Word) {
        const std::int32_t exponent = std::clamp(from_word<std::int32_t>(y), -100'000, 100'000);
        return to_word<T>(T(std::ldexp(E(from_word<T>(x)), exponent)));
    };
    rows.push_back(ldexp);
    const auto part = [&](const std::string& name, const std::string& structure, const std::string& member, Row made) {
        made.text = fmt::format("OpExtInst %{} %glsl {} %x", structure, name);
        made.member = member, made.structure = structure;
        rows.push_back(made);
    };
    part("ModfStruct", name_of<T>() + "_modf", "0", unary<T>("", [](E x) {
             E whole;
             return T(std::modf(x, &whole));
         }));
    part("ModfStruct", name_of<T>() + "_modf", "1", unary<T>("", [](E x) { return T(std::trunc(x)); }));
    part("FrexpStruct", name_of<T>() + "_frexp", "0", unary<T>("", [](E x) {
             int exponent;
             return T(std::frexp(x, &exponent));
         }));
    part("FrexpStruct", name_of<T>() + "_frexp", "1", unary<T, std::int32_t>("", [](E x) {
             int exponent = 0;
             if (std::isfinite(x)) (void)std::frexp(x, &exponent);
             return exponent;
         }));
    for (Row& made : rows)
        for (const char* free : {"FMin", "FMax", "NMin", "NMax", "NClamp", "FClamp", "FSign"})
            made.either_zero |= made.text.find(free) != std::string::npos;
    return rows;
}

template <std::integral T>
std::vector<Word> integer_edges() {
    using U = std::make_unsigned_t<T>;
    const U least = U{1} << (width<T> - 1);
    std::vector<Word> list;
    for (const int value : {0, 1, 2, 3, 5, 7, width<T> / 2, width<T> - 1, width<T>, width<T> + 1, -1, -2, -7})
        list.push_back(to_word(static_cast<U>(value)));
    for (const U value : {least, static_cast<U>(least - 1), static_cast<U>(least + 1)}) list.push_back(to_word(value));
    return list;
}

template <typename T>
std::vector<Word> float_edges() {
    const T greatest = T(std::is_same_v<T, Half> ? 65504.0 : static_cast<double>(std::numeric_limits<Exact<T>>::max()));
    const T least_normal =
        T(std::is_same_v<T, Half> ? 0x1p-14 : static_cast<double>(std::numeric_limits<Exact<T>>::min()));
    const Word sign = Word{1} << (width<T> - 1);
    std::vector<Word> list{0,
                           sign,
                           1,
                           sign | 1,
                           to_word(least_normal) - 1,
                           to_word(least_normal),
                           to_word(greatest),
                           to_word(greatest) | sign};
    for (const double value : {1.0, -1.0, 0.5, -2.5, 3.0, HUGE_VAL, -HUGE_VAL}) list.push_back(to_word(T(value)));
    list.push_back(to_word(T(std::nan(""))));
    return list;
}

const char* const head = R"(
    OpCapability Shader
    OpCapability Int8
    OpCapability Int16
    OpCapability Int64
    OpCapability Float16
    OpCapability Float64
    %glsl = OpExtInstImport "GLSL.std.450"
    OpMemoryModel Logical GLSL450
    OpEntryPoint GLCompute %main "main" %index
    OpExecutionMode %main LocalSize 256 1 1
    OpDecorate %index BuiltIn LocalInvocationIndex
    OpDecorate %words ArrayStride 4
    OpMemberDecorate %block 0 Offset 0
    OpDecorate %block Block
    OpDecorate %result DescriptorSet 0
    OpDecorate %result Binding 0
    %void = OpTypeVoid
    %bool = OpTypeBool
    %procedure = OpTypeFunction %void
    %s8 = OpTypeInt 8 1
    %u8 = OpTypeInt 8 0
    %s16 = OpTypeInt 16 1
    %u16 = OpTypeInt 16 0
    %s32 = OpTypeInt 32 1
    %u32 = OpTypeInt 32 0
    %s64 = OpTypeInt 64 1
    %u64 = OpTypeInt 64 0
    %f16 = OpTypeFloat 16
    %f32 = OpTypeFloat 32
    %f64 = OpTypeFloat 64
    %two_words = OpTypeVector %u32 2
    %u32_pair = OpTypeStruct %u32 %u32
    %f16_modf = OpTypeStruct %f16 %f16
    %f32_modf = OpTypeStruct %f32 %f32
    %f64_modf = OpTypeStruct %f64 %f64
    %f16_frexp = OpTypeStruct %f16 %s32
    %f32_frexp = OpTypeStruct %f32 %s32
    %f64_frexp = OpTypeStruct %f64 %s32
    %u32_0 = OpConstant %u32 0
    %u32_1 = OpConstant %u32 1
    %u32_2 = OpConstant %u32 2
    %u32_16 = OpConstant %u32 16
    %u32_pattern = OpConstant %u32 0xa5a5a5a5
    %s32_pattern = OpConstant %s32 -1515870811
    %u64_0 = OpConstant %u64 0
    %u64_1 = OpConstant %u64 1
    %words = OpTypeRuntimeArray %u32
    %block = OpTypeStruct %words
    %block_pointer = OpTypePointer StorageBuffer %block
    %word_pointer = OpTypePointer StorageBuffer %u32
    %index_pointer = OpTypePointer Input %u32
    %edge_array = OpTypeArray %u64 %u32_16
    %edges_pointer = OpTypePointer Private %edge_array
    %edge_pointer = OpTypePointer Private %u64
    %result = OpVariable %block_pointer StorageBuffer
    %index = OpVariable %index_pointer Input
)";

/// A module in which invocation i takes for x, y and z the edges i / 16, i % 16 and (i / 16 + i % 16) % 16, and writes
/// two words for each row.
template <typename T>
std::string module_of(const std::vector<Row>& rows, const std::vector<Word>& edges) {
    std::string text = head, members;
    for (std::size_t i = 0; i < edges.size(); ++i) {
        text += fmt::format("%edge{} = OpConstant %u64 {}\n", i, edges[i]);
        members += fmt::format(" %edge{}", i);
    }
    for (std::size_t i = 0; i < rows.size() * 2; ++i) text += fmt::format("%at{} = OpConstant %u32 {}\n", i, i * 256);
    text += fmt::format(R"(%all_edges = OpConstantComposite %edge_array{}
        %edges = OpVariable %edges_pointer Private %all_edges
        %main = OpFunction %void None %procedure
        %entry = OpLabel
        %i = OpLoad %u32 %index
        %x_at = OpUDiv %u32 %i %u32_16
        %y_at = OpUMod %u32 %i %u32_16
        %xy_at = OpIAdd %u32 %x_at %y_at
        %z_at = OpUMod %u32 %xy_at %u32_16
        )",
                        members);
    const std::string type = name_of<T>(), unsigned_type = fmt::format("u{}", width<T>);
    for (const char letter : {'x', 'y', 'z'}) {
        text += fmt::format(
            "%{0}_place = OpAccessChain %edge_pointer %edges %{0}_at\n%{0}_word = OpLoad %u64 %{0}_place\n", letter);
        const std::string narrow = width<T> == 64 ? fmt::format("%{}_word", letter) : fmt::format("%{}_narrow", letter);
        if (width<T> != 64) text += fmt::format("{} = OpUConvert %{} %{}_word\n", narrow, unsigned_type, letter);
        text += fmt::format("%{} = {} %{} {}\n", letter, type == unsigned_type ? "OpCopyObject" : "OpBitcast", type,
                            narrow);
    }
    text += "%y_low = OpUConvert %u32 %y_word\n%y_s32 = OpBitcast %s32 %y_low\n";
    for (std::size_t i = 0; i < rows.size(); ++i) {
        std::string instruction = rows[i].text;
        if (!rows[i].structure.empty()) {
            // The structure's type instead of the member's.
            const std::size_t at = instruction.find('%');
            const std::size_t end = instruction.find(' ', at);
            instruction.replace(at, end - at, "%" + rows[i].structure);
            text += fmt::format("%whole{0} = {1}\n%made{0} = OpCompositeExtract %{2} %whole{0} {3}\n", i, instruction,
                                rows[i].result, rows[i].member);
        } else {
            text += fmt::format("%made{} = {}\n", i, instruction);
        }
        if (rows[i].result == "bool") {
            text += fmt::format("%wide{0} = OpSelect %u64 %made{0} %u64_1 %u64_0\n", i);
        } else {
            const std::string bits = rows[i].result.substr(1);
            text += fmt::format("%bits{0} = {1} %u{2} %made{0}\n", i,
                                rows[i].result[0] == 'u' ? "OpCopyObject" : "OpBitcast", bits);
            text += fmt::format("%wide{0} = {1} %u64 %bits{0}\n", i, bits == "64" ? "OpCopyObject" : "OpUConvert");
        }
        text += fmt::format("%pair{0} = OpBitcast %two_words %wide{0}\n", i);
        for (std::size_t half = 0; half < 2; ++half)
            text += fmt::format(
                "%word{0}_{1} = OpCompositeExtract %u32 %pair{0} {1}\n%at{0}_{1} = OpIAdd %u32 %at{2} %i\n"
                "%place{0}_{1} = OpAccessChain %word_pointer %result %u32_0 %at{0}_{1}\nOpStore %place{0}_{1} "
                "%word{0}_{1}\n",
                i, half, i * 2 + half);
    }
    return text + "OpReturn\nOpFunctionEnd\n";
}

bool is_nan(const std::string& type, Word word) {
    return type == "f16"   ? std::isnan(from_word<Half>(word))
           : type == "f32" ? std::isnan(from_word<float>(word))
                           : type == "f64" && std::isnan(from_word<double>(word));
}

template <typename T>
void check(const std::vector<Row>& rows, const std::vector<Word>& edges) {
    ASSERT_EQ(edges.size(), 16u);
    for (const char* spec : {"cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16"}) {
        const ComputeRunner runner{.spec = spec, .result_words = static_cast<std::uint32_t>(rows.size() * 512)};
        const auto found = runner.run_assembly(module_of<T>(rows, edges), 0x10300);
        ASSERT_TRUE(found) << found.error().message();
        for (std::size_t i = 0; i < rows.size(); ++i) {
            int wrong = 0;
            for (std::size_t at = 0; at < 256 && wrong < 3; ++at) {
                const Word x = edges[at / 16], y = edges[at % 16], z = edges[(at / 16 + at % 16) % 16];
                const Word value = (*found)[i * 512 + at] | Word{(*found)[i * 512 + 256 + at]} << 32,
                           expected = rows[i].expected(x, y, z);
                const std::string& type = rows[i].result;
                if (value == expected || (is_nan(type, value) && is_nan(type, expected))) continue;
                const Word sign = type[0] == 'f' ? Word{1} << (std::stoi(type.substr(1)) - 1) : 0;
                if (rows[i].either_zero && (value & ~sign) == 0 && (expected & ~sign) == 0) continue;
                ADD_FAILURE() << spec << ", " << rows[i].text
                              << fmt::format(" of {:#x}, {:#x}, {:#x}: {:#x}, not {:#x}", x, y, z, value, expected);
                ++wrong;
            }
        }
    }
}

template <typename T>
class InstructionEdges : public testing::Test {};

using Numbers = testing::Types<std::int8_t, std::uint8_t, std::int16_t, std::uint16_t, std::int32_t, std::uint32_t,
                               std::int64_t, std::uint64_t, Half, float, double>;
struct Names {
    template <typename T>
    static std::string GetName(int) {
        return name_of<T>();
    }
};
TYPED_TEST_SUITE(InstructionEdges, Numbers, Names);

TYPED_TEST(InstructionEdges, GiveWhatTheyPromise) {
    if constexpr (is_float<TypeParam>)
        check<TypeParam>(float_rows<TypeParam>(), float_edges<TypeParam>());
    else
        check<TypeParam>(integer_rows<TypeParam>(), integer_edges<TypeParam>());
}

}  // namespace
}  // namespace nacre::cpu
