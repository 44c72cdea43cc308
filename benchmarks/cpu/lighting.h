// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>

/// @file
/// What benchmarks/cpu/lighting.comp reads, and the same work by hand.

namespace nacre::bench {

inline constexpr std::uint32_t most_lights = 32;

/// As the uniform block `Lights`.
struct LightingBlock {
    glm::uvec4 size;
    glm::vec4 plane;
    struct {
        glm::vec4 position, color;
    } lights[most_lights];
};

/// Whether this processor runs `light_rows_by_hand`.
bool can_light_by_hand();

/// Lights rows [first_row, last_row) of a picture whose width is a multiple of 16, with AVX-512 instructions. `words`
/// and `lit` as in the shader, aligned to 64 bytes.
void light_rows_by_hand(const LightingBlock& block, const glm::uvec4* words, glm::vec4* lit, std::uint32_t first_row,
                        std::uint32_t last_row);

}  // namespace nacre::bench
