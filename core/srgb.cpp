// SPDX-License-Identifier: Apache-2.0
#include "core/srgb.h"

#include <array>
#include <cmath>

namespace nacre {
namespace {

// The comparison is false for NaN, which therefore becomes 0.
double clamp_to_unit(float value) { return value > 0.0f ? (value < 1.0f ? value : 1.0) : 0.0; }

double encode(double linear) {
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
}

double decode(double encoded) {
    return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

std::array<float, 256> make_decode_table() {
    std::array<float, 256> table{};
    for (int i = 0; i < 256; ++i) table[static_cast<std::size_t>(i)] = static_cast<float>(decode(i / 255.0));
    return table;
}

// thresholds[b] is the smallest float that encodes to b + 1 or more: the exact rounding of srgb_byte_from_linear
// without a power function for each pixel.
std::array<float, 255> make_thresholds() {
    std::array<float, 255> table{};
    for (int i = 0; i < 255; ++i) {
        const double boundary = decode((i + 0.5) / 255.0);
        float candidate = static_cast<float>(boundary);
        while (std::floor(encode(candidate) * 255.0 + 0.5) > i) candidate = std::nextafter(candidate, 0.0f);
        while (std::floor(encode(candidate) * 255.0 + 0.5) <= i) candidate = std::nextafter(candidate, 2.0f);
        table[static_cast<std::size_t>(i)] = candidate;
    }
    return table;
}

}  // namespace

float srgb_from_linear(float linear) { return static_cast<float>(encode(clamp_to_unit(linear))); }

float linear_from_srgb(float encoded) { return static_cast<float>(decode(clamp_to_unit(encoded))); }

std::uint8_t srgb_byte_from_linear(float linear) {
    static const std::array<float, 255> thresholds = make_thresholds();
    // Branch-light binary search: 8 steps over 255 thresholds.
    unsigned byte = 0;
    for (unsigned step = 128; step != 0; step >>= 1) {
        if (linear >= thresholds[byte + step - 1]) byte += step;
    }
    return static_cast<std::uint8_t>(byte);
}

float linear_from_srgb_byte(std::uint8_t encoded) {
    static const std::array<float, 256> table = make_decode_table();
    return table[encoded];
}

std::uint8_t unorm_byte_from_float(float value) {
    return static_cast<std::uint8_t>(clamp_to_unit(value) * 255.0 + 0.5);
}

}  // namespace nacre
