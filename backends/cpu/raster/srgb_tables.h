// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace nacre::cpu::raster {

/// The sRGB transfer function for 8 bits, exact: a value belongs to the code whose interval between the half codes it
/// lies in.
struct SrgbTables {
    static constexpr float first_value = 0x1p-13f;           ///< Below it the code is 0.
    static constexpr std::uint32_t first_bits = 114u << 23;  ///< Its bits.
    static constexpr int bucket_shift = 17;                  ///< 64 buckets for each octave.
    float linear[256];                                       ///< Of each code.
    float thresholds[256];                                   ///< From here on the code is above the index.
    std::uint8_t starts[13 * 64 + 1];                        ///< Code of the smallest value of each bucket.
};

const SrgbTables& srgb_tables();

}  // namespace nacre::cpu::raster
