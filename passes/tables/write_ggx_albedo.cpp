// SPDX-License-Identifier: Apache-2.0
/// @file
/// Writes passes/tables/ggx_albedo_data.inc to standard output:
///
///     build/bin/write_ggx_albedo > passes/tables/ggx_albedo_data.inc

#include <cmath>
#include <cstdio>
#include <glm/gtc/packing.hpp>

#include "passes/tables/ggx_albedo.h"
#include "passes/tables/ggx_albedo_generator.h"

int main() {
    using namespace nacre::passes;
    std::puts("// SPDX-License-Identifier: Apache-2.0");
    std::puts("// Written by passes/tables/write_ggx_albedo.cpp.");
    for (std::uint32_t row = 0; row < ggx_albedo_size; ++row) {
        for (std::uint32_t column = 0; column < ggx_albedo_size; ++column) {
            const auto terms = directional_albedo_terms(std::pow(column / (ggx_albedo_size - 1.0), 2.0), row / (ggx_albedo_size - 1.0), 128);
            std::printf("0x%04x,0x%04x,%s", glm::packHalf1x16(static_cast<float>(terms[0])),
                        glm::packHalf1x16(static_cast<float>(terms[1])), column % 8 == 7 ? "\n" : "");
        }
    }
}
