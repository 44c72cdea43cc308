// SPDX-License-Identifier: Apache-2.0
// Every subgroup operation of compute shaders with all lanes, with some and with one, on all types of numbers at their
// edges; against the same worked out over the invocations that take part.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tests/backends/cpu/compiler/compute_runner.h"
#include "tests/backends/cpu/compiler/half_number.h"

namespace nacre::cpu {
namespace {

using Word = std::uint32_t;

constexpr std::uint32_t invocations = 64;

/// Which invocations take part, and who stands together.
struct Group {
    std::uint64_t active;
    std::uint32_t size;

    [[nodiscard]] bool is_active(std::uint32_t invocation) const { return active >> invocation & 1; }
    [[nodiscard]] std::uint32_t first(std::uint32_t invocation) const { return invocation / size * size; }
    [[nodiscard]] std::uint32_t lane(std::uint32_t invocation) const { return invocation % size; }
    /// Those of the same subgroup that take part and of which `is_in` says so.
    [[nodiscard]] std::vector<std::uint32_t> others(std::uint32_t invocation,
                                                    const std::function<bool(std::uint32_t other)>& is_in = {}) const {
        std::vector<std::uint32_t> list;
        for (std::uint32_t i = first(invocation); i < first(invocation) + size; ++i)
            if (is_active(i) && (!is_in || is_in(i))) list.push_back(i);
        return list;
    }
    /// One bit for each lane of the subgroup of which `is_in` says so.
    [[nodiscard]] Word ballot(std::uint32_t invocation, const std::function<bool(std::uint32_t other)>& is_in) const {
        Word bits = 0;
        for (const std::uint32_t i : others(invocation, is_in)) bits |= 1u << lane(i);
        return bits;
    }
};

/// Two words that an expression gives.
struct Row {
    std::string glsl;  ///< A uvec2.
    /// Nothing where any result is fine.
    std::function<std::optional<std::uint64_t>(const Group&, std::uint32_t invocation)> expected;
    bool is_float = false;  ///< The words are a double; the sign of zero does not matter.
};

const std::uint64_t patterns[] = {~std::uint64_t{0}, 0x8f31'c4a7'19e5'5b2dull, 0x0010'8000'0400'0200ull,
                                  0xaaaa'5555'f00f'0ff0ull};

const char* const specs[] = {"cpu:consistent:lanes=4",
                             "cpu:consistent:lanes=8",
                             "cpu:consistent:lanes=16",
                             "cpu:fast:lanes=4",
                             "cpu:fast:lanes=8",
                             "cpu:fast:lanes=16",
                             "cpu:double",
                             "cpu:sanitize"};

const char* const head = R"(
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_shuffle_relative : require
#extension GL_KHR_shader_subgroup_clustered : require
#extension GL_KHR_shader_subgroup_quad : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_subgroup_extended_types_int8 : require
#extension GL_EXT_shader_subgroup_extended_types_int16 : require
#extension GL_EXT_shader_subgroup_extended_types_int64 : require
#extension GL_EXT_shader_subgroup_extended_types_float16 : require
#extension GL_ARB_shader_ballot : enable
#extension GL_ARB_shader_group_vote : enable
#extension GL_ARB_gpu_shader_int64 : enable
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer Result { uvec2 result[]; };
layout(set = 0, binding = 1) readonly buffer Input { uint numbers[]; };
uvec2 words(bool x) { return uvec2(x ? 1u : 0u, 0u); }
uvec2 words(uint x) { return uvec2(x, 0u); }
uvec2 words(uint64_t x) { return unpack32(x); }
uvec2 words(int64_t x) { return unpack32(uint64_t(x)); }
uvec2 words(double x) { return unpackDouble2x32(x); }
)";

/// Runs the rows with each pattern on each device. `declarations` come before main, `values` at its begin.
void check(const std::vector<Row>& rows, const std::string& declarations, const std::string& values,
           std::span<const std::uint64_t> active = patterns) {
    for (const std::uint64_t pattern : active) {
        std::string text =
            head + declarations +
            fmt::format("const uint pattern[2] = uint[]({:#x}u, {:#x}u);\n", static_cast<Word>(pattern),
                        static_cast<Word>(pattern >> 32)) +
            "void main() {\nuint id = numbers[gl_LocalInvocationIndex], lane = gl_SubgroupInvocationID;\n"
            "result[id] = uvec2(gl_SubgroupSize, lane | gl_SubgroupID << 16 | gl_NumSubgroups << 24);\n" +
            values + "if ((pattern[id >> 5] >> (id & 31u) & 1u) == 1u) {\n";
        for (std::size_t i = 0; i < rows.size(); ++i)
            text += fmt::format("result[id + {}u] = {};\n", (i + 1) * invocations, rows[i].glsl);
        text += "} }\n";
        for (const char* spec : specs) {
            const ComputeRunner runner{.spec = spec,
                                       .result_words = static_cast<Word>((rows.size() + 1) * invocations * 2)};
            const auto found = runner.run_glsl(text);
            ASSERT_TRUE(found) << spec << ": " << found.error().message();
            const Group group{pattern, (*found)[0]};
            ASSERT_TRUE(group.size == 4 || group.size == 8 || group.size == 16) << group.size;
            for (std::uint32_t i = 0; i < invocations; ++i)
                ASSERT_EQ((*found)[2 * i + 1], group.lane(i) | i / group.size << 16 | invocations / group.size << 24)
                    << spec << " " << i;
            for (std::size_t row = 0; row < rows.size(); ++row) {
                int wrong = 0;
                for (std::uint32_t i = 0; i < invocations && wrong < 2; ++i) {
                    const std::size_t at = 2 * ((row + 1) * invocations + i);
                    const std::uint64_t value = (*found)[at] | std::uint64_t{(*found)[at + 1]} << 32;
                    constexpr std::uint64_t untouched = 12345 | std::uint64_t{12345} << 32;
                    const auto expected = group.is_active(i) ? rows[row].expected(group, i) : std::optional(untouched);
                    if (!expected || value == *expected) continue;
                    constexpr std::uint64_t sign = std::uint64_t{1} << 63;
                    if (rows[row].is_float && (value & ~sign) == 0 && (*expected & ~sign) == 0) continue;
                    ++wrong;
                    ADD_FAILURE() << spec << ", size " << group.size << ", " << rows[row].glsl
                                  << fmt::format(", active {:#x}, invocation {}: {:#x}, not {:#x}", pattern, i, value,
                                                 *expected);
                }
            }
        }
    }
}

Word number_of(std::uint32_t invocation) { return (invocation * 2654435761u) >> 7; }

TEST(Subgroups, VotesAndBallots) {
    const auto is_odd = [](std::uint32_t i) { return (number_of(i) & 4) != 0; };
    const auto ballot = [=](const Group& g, std::uint32_t i) { return g.ballot(i, is_odd); };
    const auto below = [](std::uint32_t lane) { return (1u << lane) - 1; };
    std::vector<Row> rows{
        {"words(subgroupElect())", [](const Group& g, std::uint32_t i) { return g.others(i).front() == i; }},
        {"words(subgroupAll(odd))",
         [=](const Group& g, std::uint32_t i) { return std::ranges::all_of(g.others(i), is_odd); }},
        {"words(subgroupAll(id < 1000u))", [](const Group&, std::uint32_t) { return 1; }},
        {"words(subgroupAny(odd))",
         [=](const Group& g, std::uint32_t i) { return std::ranges::any_of(g.others(i), is_odd); }},
        {"words(subgroupAny(id == 37u))",
         [](const Group& g, std::uint32_t i) { return g.is_active(37) && g.first(37) == g.first(i); }},
        {"words(subgroupAllEqual(odd))",
         [=](const Group& g, std::uint32_t i) {
             const auto all = g.others(i);
             return std::ranges::all_of(all, [&](std::uint32_t k) { return is_odd(k) == is_odd(all[0]); });
         }},
        {"words(subgroupAllEqual(id / 8u))",
         [](const Group& g, std::uint32_t i) {
             const auto all = g.others(i);
             return all.front() / 8 == all.back() / 8;
         }},
        // A zero is equal to the other; two NaN are not, even of the same bits.
        {"words(subgroupAllEqual((id & 1u) == 0u ? 0.0 : -zero))", [](const Group&, std::uint32_t) { return 1; }},
        {"words(subgroupAllEqual(nan))", [](const Group&, std::uint32_t) { return 0; }},
        {"words(subgroupAllEqual(id < 1000u ? nan : zero))", [](const Group&, std::uint32_t) { return 0; }},
        {"words(subgroupAllEqual(vec2(1.0, float(id / 4u))))",
         [](const Group& g, std::uint32_t i) {
             const auto all = g.others(i);
             return all.front() / 4 == all.back() / 4;
         }},
        {"words(subgroupBroadcastFirst(number))",
         [](const Group& g, std::uint32_t i) { return number_of(g.others(i).front()); }},
        {"words(double(subgroupBroadcastFirst(-float(id))))",
         [](const Group& g, std::uint32_t i) {
             return std::bit_cast<std::uint64_t>(-static_cast<double>(g.others(i).front()));
         },
         true},
        {"subgroupBallot(odd).xy", [=](const Group& g, std::uint32_t i) { return ballot(g, i); }},
        {"subgroupBallot(odd).zw", [](const Group&, std::uint32_t) { return 0; }},
        {"subgroupBallot(true).xy",
         [](const Group& g, std::uint32_t i) { return g.ballot(i, [](std::uint32_t) { return true; }); }},
        {"words(subgroupInverseBallot(uvec4(0xa5c3u, 0u, 0u, 0u)))",
         [](const Group& g, std::uint32_t i) { return 0xa5c3u >> g.lane(i) & 1; }},
        {"words(subgroupBallotBitExtract(subgroupBallot(odd), (lane * 5u) % gl_SubgroupSize))",
         [=](const Group& g, std::uint32_t i) { return ballot(g, i) >> g.lane(i) * 5 % g.size & 1; }},
        {"words(subgroupBallotBitCount(subgroupBallot(odd)))",
         [=](const Group& g, std::uint32_t i) { return std::popcount(ballot(g, i)); }},
        {"words(subgroupBallotInclusiveBitCount(subgroupBallot(odd)))",
         [=](const Group& g, std::uint32_t i) { return std::popcount(ballot(g, i) & below(g.lane(i) + 1)); }},
        {"words(subgroupBallotExclusiveBitCount(subgroupBallot(odd)))",
         [=](const Group& g, std::uint32_t i) { return std::popcount(ballot(g, i) & below(g.lane(i))); }},
        {"words(subgroupBallotFindLSB(subgroupBallot(true)))",
         [](const Group& g, std::uint32_t i) { return g.lane(g.others(i).front()); }},
        {"words(subgroupBallotFindMSB(subgroupBallot(true)))",
         [](const Group& g, std::uint32_t i) { return g.lane(g.others(i).back()); }},
        {"gl_SubgroupEqMask.xy", [](const Group& g, std::uint32_t i) { return 1u << g.lane(i); }},
        {"gl_SubgroupLtMask.xy", [=](const Group& g, std::uint32_t i) { return below(g.lane(i)); }},
        {"gl_SubgroupLeMask.xy", [=](const Group& g, std::uint32_t i) { return below(g.lane(i) + 1); }},
        {"gl_SubgroupGtMask.xy",
         [=](const Group& g, std::uint32_t i) { return below(g.size) & ~below(g.lane(i) + 1); }},
        {"gl_SubgroupGeMask.xy", [=](const Group& g, std::uint32_t i) { return below(g.size) & ~below(g.lane(i)); }},
    };
    check(rows, "",
          "uint number = (id * 2654435761u) >> 7; bool odd = (number & 4u) != 0u; float zero = float(numbers[0]), nan "
          "= uintBitsToFloat(0x7fc00000u + numbers[0]);\n");
}

TEST(Subgroups, ValuesOfOtherLanes) {
    // What a lane that does not take part would give is open.
    const auto from = [](auto source) {
        return [source](const Group& g, std::uint32_t i) -> std::optional<std::uint64_t> {
            const std::int64_t lane = source(static_cast<std::int64_t>(g.lane(i)));
            if (lane < 0 || lane >= g.size || !g.is_active(g.first(i) + static_cast<std::uint32_t>(lane))) return {};
            return number_of(g.first(i) + static_cast<std::uint32_t>(lane));
        };
    };
    using Lane = std::int64_t;
    std::vector<Row> rows{
        {"words(subgroupBroadcast(number, 2u))", from([](Lane) { return 2; })},
        {"words(subgroupShuffle(number, (lane * 7u + 3u) & 3u | lane & ~3u))",
         from([](Lane x) { return ((x * 7 + 3) & 3) | (x & ~Lane{3}); })},
        {"words(subgroupShuffle(number, gl_SubgroupSize - 1u - lane))",
         [](const Group& g, std::uint32_t i) -> std::optional<std::uint64_t> {
             const std::uint32_t other = g.first(i) + g.size - 1 - g.lane(i);
             if (!g.is_active(other)) return {};
             return number_of(other);
         }},
        {"words(subgroupShuffleXor(number, 1u))", from([](Lane x) { return x ^ 1; })},
        {"words(subgroupShuffleXor(number, 3u))", from([](Lane x) { return x ^ 3; })},
        {"words(subgroupShuffleUp(number, 1u))", from([](Lane x) { return x - 1; })},
        {"words(subgroupShuffleUp(number, 3u))", from([](Lane x) { return x - 3; })},
        {"words(subgroupShuffleDown(number, 2u))", from([](Lane x) { return x + 2; })},
        {"words(subgroupShuffle(u64vec2(number, 1u), lane ^ 2u).x)", from([](Lane x) { return x ^ 2; })},
    };
    check(rows, "", "uint number = (id * 2654435761u) >> 7;\n");
    // Whole quads alone have defined results.
    rows.clear();
    for (int i = 0; i < 4; ++i)
        rows.push_back({fmt::format("words(subgroupQuadBroadcast(number, {}u))", i),
                        from([i](Lane x) { return (x & ~Lane{3}) + i; })});
    rows.push_back({"words(subgroupQuadSwapHorizontal(number))", from([](Lane x) { return x ^ 1; })});
    rows.push_back({"words(subgroupQuadSwapVertical(number))", from([](Lane x) { return x ^ 2; })});
    rows.push_back({"words(subgroupQuadSwapDiagonal(number))", from([](Lane x) { return x ^ 3; })});
    const std::uint64_t quads[] = {~std::uint64_t{0}, 0xf00f'0ff0'00f0'ff0full};
    check(rows, "", "uint number = (id * 2654435761u) >> 7;\n", quads);
}

// ---- Arithmetic

template <typename T>
constexpr bool is_float = std::is_same_v<T, Half> || std::floating_point<T>;

template <typename T>
std::string glsl_name() {
    if constexpr (std::is_same_v<T, Half>) return "float16_t";
    if constexpr (std::is_same_v<T, float>) return "float";
    if constexpr (std::is_same_v<T, double>) return "double";
    return fmt::format("{}int{}_t", std::is_signed_v<T> ? "" : "u", sizeof(T) * 8);
}

/// Folded in any order, which must not matter for the values that are given.
template <typename T, typename Fold>
Row fold_row(const std::string& call, const std::string& scope, const std::vector<T>& values, T identity, Fold fold) {
    Row row;
    const std::string kind = is_float<T> ? "double" : std::is_signed_v<T> ? "int64_t" : "uint64_t";
    const std::string arguments = scope.starts_with("Clustered") ? fmt::format("value, {}u", scope.substr(9)) : "value";
    row.glsl = fmt::format("words({}(subgroup{}{}({})))", kind, scope.starts_with("Clustered") ? "Clustered" : scope,
                           call, arguments);
    row.is_float = is_float<T>;
    row.expected = [=](const Group& g, std::uint32_t i) -> std::optional<std::uint64_t> {
        std::uint32_t cluster = g.size;
        if (scope.starts_with("Clustered")) cluster = static_cast<std::uint32_t>(std::stoi(scope.substr(9)));
        if (cluster > g.size) return {};
        T all = identity;
        for (const std::uint32_t k : g.others(i)) {
            if (scope == "Inclusive" && k > i) continue;
            if (scope == "Exclusive" && k >= i) continue;
            if (g.lane(k) / cluster != g.lane(i) / cluster) continue;
            all = fold(all, values[k % values.size()]);
        }
        if constexpr (is_float<T>)
            return std::bit_cast<std::uint64_t>(static_cast<double>(all));
        else
            return static_cast<std::uint64_t>(all);
    };
    return row;
}

template <typename T>
class SubgroupArithmetic : public testing::Test {};
using Numbers = testing::Types<std::int8_t, std::uint8_t, std::int16_t, std::uint16_t, std::int32_t, std::uint32_t,
                               std::int64_t, std::uint64_t, Half, float, double>;
struct Names {
    template <typename T>
    static std::string GetName(int) {
        return glsl_name<T>();
    }
};
TYPED_TEST_SUITE(SubgroupArithmetic, Numbers, Names);

TYPED_TEST(SubgroupArithmetic, ReducesAndScans) {
    using T = TypeParam;
    std::vector<T> values, edges;
    std::string text, edge_text;
    const auto list = [](const std::vector<T>& numbers) {
        std::string made;
        for (const T number : numbers) {
            made += made.empty() ? "" : ", ";
            if constexpr (!is_float<T>)
                // The bits, whatever the sign.
                made += fmt::format("{}({:#x}ul)", glsl_name<T>(),
                                    static_cast<std::uint64_t>(static_cast<std::make_unsigned_t<T>>(number)));
            else
                made += fmt::format("{}(packDouble2x32(uvec2({:#x}u, {:#x}u)))", glsl_name<T>(),
                                    static_cast<Word>(std::bit_cast<std::uint64_t>(static_cast<double>(number))),
                                    static_cast<Word>(std::bit_cast<std::uint64_t>(static_cast<double>(number)) >> 32));
        }
        return made;
    };
    if constexpr (is_float<T>) {
        // Sums and products of these are exact in any order.
        for (const double value : {1.0, -1.0, 2.0, 0.5, -2.0, 1.0, 3.0, 1.0}) values.push_back(T(value));
        const double greatest = std::is_same_v<T, Half>    ? 65504
                                : std::is_same_v<T, float> ? double{std::numeric_limits<float>::max()}
                                                           : std::numeric_limits<double>::max();
        for (const double value : {1.0, 0.0, -0.0, greatest, -greatest, -1.0, HUGE_VAL, 2.0, -HUGE_VAL})
            edges.push_back(T(value));
    } else {
        using Limits = std::numeric_limits<T>;
        values = {T(5), T(-1), Limits::max(), T(3), Limits::min(), T(Limits::min() + 1), T(7), T(Limits::max() - 1),
                  T(1)};
        edges = values;
    }
    text = fmt::format("{0} value = {0}[]({1})[id % {2}u];\n", glsl_name<T>(), list(values), values.size());
    std::vector<Row> rows, edge_rows;
    for (const std::string scope :
         {"", "Inclusive", "Exclusive", "Clustered1", "Clustered2", "Clustered4", "Clustered8"}) {
        const auto low = [] {
            if constexpr (is_float<T>)
                return T(-HUGE_VAL);
            else
                return std::numeric_limits<T>::min();
        }();
        const auto high = [] {
            if constexpr (is_float<T>)
                return T(HUGE_VAL);
            else
                return std::numeric_limits<T>::max();
        }();
        if constexpr (is_float<T>) {
            rows.push_back(fold_row<T>("Add", scope, values, T(0.0), [](T a, T b) { return T(a + b); }));
            rows.push_back(fold_row<T>("Mul", scope, values, T(1.0), [](T a, T b) { return T(a * b); }));
        } else {
            using U = std::make_unsigned_t<T>;
            const auto wide = [](T x) { return static_cast<std::uint64_t>(static_cast<U>(x)); };
            rows.push_back(
                fold_row<T>("Add", scope, values, T(0), [=](T a, T b) { return static_cast<T>(wide(a) + wide(b)); }));
            rows.push_back(
                fold_row<T>("Mul", scope, values, T(1), [=](T a, T b) { return static_cast<T>(wide(a) * wide(b)); }));
            rows.push_back(fold_row<T>("And", scope, values, T(-1), [](T a, T b) { return static_cast<T>(a & b); }));
            rows.push_back(fold_row<T>("Or", scope, values, T(0), [](T a, T b) { return static_cast<T>(a | b); }));
            rows.push_back(fold_row<T>("Xor", scope, values, T(0), [](T a, T b) { return static_cast<T>(a ^ b); }));
        }
        edge_rows.push_back(fold_row<T>("Min", scope, edges, high, [](T a, T b) { return b < a ? b : a; }));
        edge_rows.push_back(fold_row<T>("Max", scope, edges, low, [](T a, T b) { return b > a ? b : a; }));
    }
    check(rows, "", text);
    check(edge_rows, "",
          fmt::format("{0} value = {0}[]({1})[id % {2}u];\n", glsl_name<T>(), list(edges), edges.size()));
}

TEST(Subgroups, LogicOfConditions) {
    std::vector<Row> rows;
    const auto value = [](std::uint32_t i) { return i * 11 % 7 < 3; };
    const std::pair<const char*, std::function<bool(bool, bool)>> operations[] = {
        {"And", [](bool a, bool b) { return a && b; }},
        {"Or", [](bool a, bool b) { return a || b; }},
        {"Xor", [](bool a, bool b) { return a != b; }}};
    for (const auto& [name, fold] : operations)
        for (const std::string scope : {"", "Inclusive", "Exclusive", "Clustered"})
            rows.push_back({fmt::format("words(subgroup{}{}(id * 11u % 7u < 3u{}))", scope, name,
                                        scope == "Clustered" ? ", 4u" : ""),
                            [=](const Group& g, std::uint32_t i) {
                                bool all = name == std::string("And");
                                for (const std::uint32_t k : g.others(i)) {
                                    if (scope == "Inclusive" && k > i) continue;
                                    if (scope == "Exclusive" && k >= i) continue;
                                    if (scope == "Clustered" && k / 4 != i / 4) continue;
                                    all = fold(all, value(k));
                                }
                                return all;
                            }});
    check(rows, "", "");
}

// Those of before Vulkan 1.1: SPV_KHR_shader_ballot and SPV_KHR_subgroup_vote.
TEST(Subgroups, OlderVotesAndBallots) {
    const auto is_odd = [](std::uint32_t i) { return (number_of(i) & 4) != 0; };
    std::vector<Row> rows{
        {"words(allInvocationsARB(odd))",
         [=](const Group& g, std::uint32_t i) { return std::ranges::all_of(g.others(i), is_odd); }},
        {"words(anyInvocationARB(odd))",
         [=](const Group& g, std::uint32_t i) { return std::ranges::any_of(g.others(i), is_odd); }},
        {"words(allInvocationsEqualARB(odd))",
         [=](const Group& g, std::uint32_t i) {
             const auto all = g.others(i);
             return std::ranges::all_of(all, [&](std::uint32_t k) { return is_odd(k) == is_odd(all[0]); });
         }},
        {"words(ballotARB(odd))", [=](const Group& g, std::uint32_t i) { return g.ballot(i, is_odd); }},
        {"words(readFirstInvocationARB(number))",
         [](const Group& g, std::uint32_t i) { return number_of(g.others(i).front()); }},
        {"words(readInvocationARB(number, 1u))",
         [](const Group& g, std::uint32_t i) -> std::optional<std::uint64_t> {
             if (!g.is_active(g.first(i) + 1)) return {};
             return number_of(g.first(i) + 1);
         }},
    };
    check(rows, "", "uint number = (id * 2654435761u) >> 7; bool odd = (number & 4u) != 0u;\n");
}

}  // namespace
}  // namespace nacre::cpu
