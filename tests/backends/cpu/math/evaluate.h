// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "tests/backends/cpu/math/compiled_function.h"

namespace nacre::cpu {

using Values = std::span<llvm::Value* const>;

/// A half as its bits.
struct Half {
    std::uint16_t bits;
};

template <typename T>
constexpr Kind kind_of() {
    if constexpr (std::is_same_v<T, Half>)
        return Kind::half;
    else if constexpr (std::is_same_v<T, float>)
        return Kind::single;
    else if constexpr (std::is_same_v<T, double>)
        return Kind::number64;
    else if constexpr (sizeof(T) == 1)
        return Kind::int8;
    else if constexpr (sizeof(T) == 2)
        return Kind::int16;
    else if constexpr (sizeof(T) == 4)
        return Kind::int32;
    else
        return Kind::int64;
}

/// A call of one function of Math.
template <typename... Arguments>
requires(std::same_as<Arguments, llvm::Value*>&&...) Emit call(llvm::Value* (Math::*function)(Arguments...)) {
    return [function](Math& math, Values values) {
        const auto expand = [&]<std::size_t... i>(std::index_sequence<i...>) { return (math.*function)(values[i]...); };
        return std::vector<llvm::Value*>{expand(std::make_index_sequence<sizeof...(Arguments)>())};
    };
}

/// Results of a function of equally long arrays, one array for each type of `Results`.
template <typename... Results, typename... Inputs>
std::tuple<std::vector<Results>...> evaluate(const Variant& variant, const Emit& emit, std::vector<Inputs>... inputs) {
    const CompiledFunction compiled(variant, {kind_of<Inputs>()...}, emit);
    const std::size_t count = std::get<0>(std::tie(inputs...)).size();
    const std::size_t padded = (count + 15) / 16 * 16;
    (inputs.resize(padded), ...);
    std::tuple<std::vector<Results>...> results;
    const void* input_data[] = {inputs.data()...};
    std::apply(
        [&](auto&... result) {
            (result.resize(padded), ...);
            void* output_data[] = {result.data()...};
            compiled.run(input_data, output_data, padded);
            (result.resize(count), ...);
        },
        results);
    return results;
}

template <typename Result, typename... Inputs>
std::vector<Result> evaluate_one(const Variant& variant, const Emit& emit, const std::vector<Inputs>&... inputs) {
    return std::get<0>(evaluate<Result>(variant, emit, inputs...));
}

/// Equal in every bit, or both NaN.
template <typename T>
bool same(T a, T b) {
    if constexpr (std::is_floating_point_v<T>) {
        if (std::isnan(a) || std::isnan(b)) return std::isnan(a) && std::isnan(b);
        return a == b && std::signbit(a) == std::signbit(b);
    } else {
        return a == b;
    }
}

/// Every pair of values, as two arrays.
template <typename T>
std::pair<std::vector<T>, std::vector<T>> all_pairs(const std::vector<T>& values) {
    std::pair<std::vector<T>, std::vector<T>> pairs;
    for (const T a : values)
        for (const T b : values) {
            pairs.first.push_back(a);
            pairs.second.push_back(b);
        }
    return pairs;
}

/// Small integers as numbers, for printing and for arithmetic in wider types.
template <typename T>
auto printable(T value) {
    if constexpr (std::is_integral_v<T>)
        return +value;
    else
        return value;
}

}  // namespace nacre::cpu
