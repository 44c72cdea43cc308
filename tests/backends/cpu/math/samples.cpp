// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/math/samples.h"

#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>

namespace nacre::cpu {

namespace {

std::vector<float> edges() {
    std::vector<float> result;
    const auto add = [&](float x) {
        for (const float sign : {1.0f, -1.0f}) {
            result.push_back(sign * x);
            result.push_back(sign * std::nextafter(x, std::numeric_limits<float>::infinity()));
            result.push_back(sign * std::nextafter(x, 0.0f));
        }
    };
    for (const float x :
         {0.0f,    0x1p-149f, 0x1p-126f, 0x1p-24f, 0x1p-14f, 0.25f,      0.5f,           0.625f,  1.0f,    1.5f,
          2.0f,    2.5f,      3.0f,      10.0f,    64.0f,    88.72284f,  89.416f,        104.0f,  127.0f,  128.0f,
          149.0f,  150.0f,    255.5f,    32767.5f, 65504.0f, 65519.996f, 65520.0f,       0x1p20f, 0x1p22f, 0x1p23f,
          0x1p24f, 0x1p31f,   0x1p32f,   0x1p63f,  0x1p64f,  1e30f,      0x1.fffffep127f})
        add(x);
    for (int i = 1; i < 40; ++i) add(static_cast<float>(i * std::numbers::pi / 4));
    for (const std::uint32_t bits :
         {0x7f800000u, 0xff800000u, 0x7fc00000u, 0xffc00000u, 0x7fc12345u, 0x7f800001u, 0xffffffffu, 0x7fbfffffu})
        result.push_back(std::bit_cast<float>(bits));
    return result;
}

void pad(std::vector<float>& floats) {
    while (floats.size() % 16 != 0) floats.push_back(1.0f);
}

}  // namespace

std::uint64_t noise(std::uint64_t index) {
    // SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014.
    std::uint64_t z = (index + 1) * 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

const std::vector<float>& many_floats() {
    static const std::vector<float> floats = [] {
        std::vector<float> result = edges();
        // One from each run of 8192 bit patterns.
        for (std::uint32_t i = 0; i < 1u << 19; ++i)
            result.push_back(std::bit_cast<float>((i << 13) | static_cast<std::uint32_t>(noise(i) & 0x1fff)));
        for (std::uint64_t i = 0; i < 1u << 18; ++i) {
            const double uniform = static_cast<double>(noise(i + (1u << 20)) >> 11) * 0x1p-52 - 1;  // [-1, 1)
            result.push_back(static_cast<float>(uniform * 100));
            result.push_back(static_cast<float>(1 + uniform * 0.5));
        }
        pad(result);
        return result;
    }();
    return floats;
}

const std::vector<float>& few_floats() {
    static const std::vector<float> floats = [] {
        std::vector<float> result = edges();
        for (std::uint64_t i = 0; i < 100; ++i)
            result.push_back(static_cast<float>(static_cast<double>(noise(i) % 20001) / 1000 - 10));
        pad(result);
        return result;
    }();
    return floats;
}

double ulp_error(float result, double expected) {
    if (std::isnan(result) || std::isnan(expected))
        return std::isnan(result) && std::isnan(expected) ? 0 : std::numeric_limits<double>::infinity();
    // Half a unit beyond the largest float is where rounding to infinity begins.
    constexpr double overflow = 0x1.ffffffp127;
    if (std::isinf(result)) {
        const double magnitude = std::signbit(result) ? -expected : expected;
        if (magnitude >= overflow) return 0;
        // In units of the last place of the largest floats.
        return std::abs(magnitude - 0x1p128) / 0x1p104;
    }
    if (std::isinf(expected)) return std::numeric_limits<double>::infinity();
    const int exponent = expected == 0 ? -126 : std::max(-126, std::min(127, std::ilogb(expected)));
    return std::abs(static_cast<double>(result) - expected) / std::ldexp(1.0, exponent - 23);
}

bool test_all_floats() {
    const char* value = std::getenv("NACRE_TEST_ALL_FLOATS");
    return value && value[0] == '1';
}

}  // namespace nacre::cpu
