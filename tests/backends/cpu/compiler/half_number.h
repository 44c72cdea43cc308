// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

namespace nacre::cpu {

/// A number of 16 bits. Sums, products, quotients and square roots of such numbers, made in double precision and
/// rounded to one, are rounded as if only once.
struct Half {
    std::uint16_t bits = 0;
    Half() = default;
    explicit Half(double value) {
        const std::uint16_t sign = std::signbit(value) ? 0x8000 : 0;
        const double magnitude = std::abs(value);
        if (std::isnan(value))
            bits = 0x7e00;
        else if (magnitude >= 65520)
            bits = sign | 0x7c00;
        else if (magnitude < 0x1p-14)
            bits = static_cast<std::uint16_t>(sign | static_cast<int>(std::nearbyint(magnitude * 0x1p24)));
        else {
            const int exponent = std::ilogb(magnitude);
            const auto significand = static_cast<int>(std::nearbyint(std::ldexp(magnitude, 10 - exponent)));
            bits = static_cast<std::uint16_t>(sign | (((exponent + 14) << 10) + significand));
        }
    }
    operator double() const {
        const int exponent = bits >> 10 & 31, fraction = bits & 1023;
        const double magnitude = exponent == 0    ? fraction * 0x1p-24
                                 : exponent == 31 ? (fraction ? std::nan("") : HUGE_VAL)
                                                  : std::ldexp(1024 + fraction, exponent - 25);
        return bits & 0x8000 ? -magnitude : magnitude;
    }
};

}  // namespace nacre::cpu
