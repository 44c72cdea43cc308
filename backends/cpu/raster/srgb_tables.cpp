// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/raster/srgb_tables.h"

#include <bit>
#include <cmath>

namespace nacre::cpu::raster {
namespace {

double to_linear(double code) { return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4); }

SrgbTables make_tables() {
    SrgbTables tables{};
    for (int code = 0; code < 256; ++code) {
        tables.linear[code] = static_cast<float>(to_linear(code / 255.0));
        tables.thresholds[code] = static_cast<float>(to_linear((code + 0.5) / 255.0));
    }
    for (std::uint32_t bucket = 0; bucket <= 13 * 64; ++bucket) {
        const float low = std::bit_cast<float>(SrgbTables::first_bits + (bucket << SrgbTables::bucket_shift));
        std::uint32_t code = 0;
        while (code < 255 && low >= tables.thresholds[code]) ++code;
        tables.starts[bucket] = static_cast<std::uint8_t>(code);
    }
    return tables;
}

}  // namespace

const SrgbTables& srgb_tables() {
    static const SrgbTables tables = make_tables();
    return tables;
}

}  // namespace nacre::cpu::raster
