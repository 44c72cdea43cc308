// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

/// @file
/// Everything that a formula may give where Vulkan lets its precision be "inherited from" a formula: each operation
/// rounds, denormals may be flushed, products may be fused with sums and sums taken in any order.
///
///     const RangeArithmetic r(single_precision);
///     Range length = r.root(r.dot(x, x));
///     EXPECT_TRUE(r.contains(length, found));

namespace nacre::cpu {

struct Precision {
    int bits;            ///< Of the significand.
    int least_exponent;  ///< Of normal numbers.
    long double greatest;
};
inline const Precision half_precision{11, -14, 65504.0L};
inline const Precision single_precision{24, -126, std::numeric_limits<float>::max()};
inline const Precision twice_precision{53, -1022, std::numeric_limits<double>::max()};

/// Numbers from `low` to `high`, infinities included, and perhaps NaN. Ends may lie beyond the greatest number of a
/// format: a fused product may be that large.
struct Range {
    long double low = 0, high = 0;
    bool can_be_nan = false;
    bool has_numbers = true;
};

class RangeArithmetic {
  public:
    explicit RangeArithmetic(const Precision& precision)
        : precision_(precision),
          least_normal_(std::ldexp(1.0L, precision.least_exponent)),
          spacing_(std::ldexp(1.0L, precision.least_exponent - precision.bits + 1)) {}

    [[nodiscard]] Range value(long double x) const {
        if (std::isnan(x)) return nan();
        Range made{x, x};
        flush(made);
        return made;
    }
    static Range nan() { return {0, 0, true, false}; }
    static Range anything() {
        return {-std::numeric_limits<long double>::infinity(), std::numeric_limits<long double>::infinity(), true};
    }
    [[nodiscard]] static Range either(const Range& a, const Range& b) {
        if (!a.has_numbers || !b.has_numbers) {
            Range made = a.has_numbers ? a : b;
            made.can_be_nan = a.can_be_nan || b.can_be_nan;
            return made;
        }
        return {std::min(a.low, b.low), std::max(a.high, b.high), a.can_be_nan || b.can_be_nan};
    }

    [[nodiscard]] Range negate(const Range& a) const { return {-a.high, -a.low, a.can_be_nan, a.has_numbers}; }
    [[nodiscard]] Range add(const Range& a, const Range& b) const {
        if (!a.has_numbers || !b.has_numbers) return nan();
        Range made{a.low + b.low, a.high + b.high, a.can_be_nan || b.can_be_nan};
        const bool meet = (has_infinity(a, 1) && has_infinity(b, -1)) || (has_infinity(a, -1) && has_infinity(b, 1));
        made.can_be_nan |= meet;
        if (std::isnan(made.low) || std::isnan(made.high)) {
            // Infinities of both signs on one side: where both ranges are just that, there is no number at all.
            if (a.low == a.high && b.low == b.high) return nan();
            if (std::isnan(made.low)) made.low = -infinity();
            if (std::isnan(made.high)) made.high = infinity();
        }
        return rounded(made, 1);
    }
    [[nodiscard]] Range subtract(const Range& a, const Range& b) const { return add(a, negate(b)); }
    [[nodiscard]] Range multiply(const Range& a, const Range& b) const {
        if (!a.has_numbers || !b.has_numbers) return nan();
        Range made{infinity(), -infinity(), a.can_be_nan || b.can_be_nan, false};
        for (const long double x : {a.low, a.high})
            for (const long double y : {b.low, b.high}) {
                const long double product = x * y;
                if (std::isnan(product)) continue;
                made.low = std::min(made.low, product), made.high = std::max(made.high, product);
                made.has_numbers = true;
            }
        made.can_be_nan |= (has_any_infinity(a) && has_zero(b)) || (has_any_infinity(b) && has_zero(a));
        return made.has_numbers ? rounded(made, 1) : nan();
    }
    [[nodiscard]] Range divide(const Range& a, const Range& b) const {
        if (!a.has_numbers || !b.has_numbers) return nan();
        if (a.low == 0 && a.high == 0 && b.low == 0 && b.high == 0) return nan();
        if (has_zero(b)) return anything();
        Range made{infinity(), -infinity(), a.can_be_nan || b.can_be_nan, false};
        for (const long double x : {a.low, a.high})
            for (const long double y : {b.low, b.high}) {
                const long double quotient = x / y;
                if (std::isnan(quotient)) continue;
                made.low = std::min(made.low, quotient), made.high = std::max(made.high, quotient);
                made.has_numbers = true;
            }
        made.can_be_nan |= has_any_infinity(a) && has_any_infinity(b);
        return made.has_numbers ? rounded(made, 5) : nan();
    }
    /// By way of an inverse square root, 2 units, and a division.
    [[nodiscard]] Range root(const Range& a) const {
        if (!a.has_numbers || a.high < 0) return nan();
        return rounded({std::sqrt(std::max(a.low, 0.0L)), std::sqrt(a.high), a.can_be_nan || a.low < 0}, 9);
    }
    [[nodiscard]] Range inverse_root(const Range& a) const {
        if (!a.has_numbers || a.high < 0) return nan();
        return rounded(
            {1 / std::sqrt(a.high), a.low <= 0 ? infinity() : 1 / std::sqrt(a.low), a.can_be_nan || a.low < 0}, 4);
    }
    [[nodiscard]] static Range clamp(const Range& a, long double low, long double high) {
        // What becomes of NaN is open.
        if (!a.has_numbers) return {low, high, true};
        Range made{std::clamp(a.low, low, high), std::clamp(a.high, low, high), a.can_be_nan};
        if (a.can_be_nan) made.low = low, made.high = high;
        return made;
    }
    /// In any order.
    [[nodiscard]] Range sum(const std::vector<Range>& terms) const {
        std::vector<std::size_t> order(terms.size());
        std::iota(order.begin(), order.end(), std::size_t{0});
        Range all{0, 0, false, false};
        bool is_first = true;
        do {
            Range total = terms[order[0]];
            for (std::size_t i = 1; i < order.size(); ++i) total = add(total, terms[order[i]]);
            all = is_first ? total : either(all, total);
            is_first = false;
        } while (std::ranges::next_permutation(order).found);
        return all;
    }
    [[nodiscard]] Range dot(const std::vector<Range>& a, const std::vector<Range>& b) const {
        std::vector<Range> terms;
        for (std::size_t i = 0; i < a.size(); ++i) terms.push_back(multiply(a[i], b[i]));
        return sum(terms);
    }

    [[nodiscard]] bool contains(const Range& range, double found) const {
        if (std::isnan(found)) return range.can_be_nan;
        return range.has_numbers && range.low <= found && found <= range.high;
    }

  private:
    static long double infinity() { return std::numeric_limits<long double>::infinity(); }
    static bool has_infinity(const Range& a, int sign) {
        return sign > 0 ? a.high == infinity() : a.low == -infinity();
    }
    static bool has_any_infinity(const Range& a) { return has_infinity(a, 1) || has_infinity(a, -1); }
    static bool has_zero(const Range& a) { return a.low <= 0 && a.high >= 0; }
    void flush(Range& range) const {
        if (range.low < least_normal_ && range.high > -least_normal_)
            range.low = std::min(range.low, 0.0L), range.high = std::max(range.high, 0.0L);
    }
    /// @param half_units  largest error, in halves of a unit in the last place
    [[nodiscard]] Range rounded(Range range, int half_units) const {
        const auto error = [&](long double end) {
            if (std::isinf(end)) return 0.0L;
            return half_units * std::max(std::abs(end) * std::ldexp(1.0L, -precision_.bits), spacing_);
        };
        // What is zero exactly stays so.
        if (range.low != 0) range.low -= error(range.low);
        if (range.high != 0) range.high += error(range.high);
        if (range.high > precision_.greatest) range.high = infinity();
        if (range.low < -precision_.greatest) range.low = -infinity();
        flush(range);
        return range;
    }

    const Precision& precision_;
    const long double least_normal_, spacing_;
};

}  // namespace nacre::cpu
