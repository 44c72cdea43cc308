// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/packing.hpp>

#include "passes/tables/ggx_albedo.h"
#include "passes/tables/ggx_albedo_generator.h"

namespace nacre::passes {
namespace {

double entry(std::uint32_t column, std::uint32_t row, std::uint32_t which) {
    return glm::unpackHalf1x16(ggx_albedo_table()[2 * (row * ggx_albedo_size + column) + which]);
}

// The committed table is what its generator makes.
TEST(GgxAlbedoTable, CanBeMadeAgain) {
    for (std::uint32_t row = 0; row < ggx_albedo_size; row += 7) {
        for (std::uint32_t column = 0; column < ggx_albedo_size; column += 7) {
            const auto terms = directional_albedo_terms(std::pow(column / 63.0, 2.0), row / 63.0, 128);
            EXPECT_EQ(ggx_albedo_table()[2 * (row * ggx_albedo_size + column)],
                      glm::packHalf1x16(static_cast<float>(terms[0])));
            EXPECT_EQ(ggx_albedo_table()[2 * (row * ggx_albedo_size + column) + 1],
                      glm::packHalf1x16(static_cast<float>(terms[1])));
        }
    }
}

// Single scattering loses light and never gains any.
TEST(GgxAlbedoTable, NeverExceedsOne) {
    for (std::uint32_t row = 0; row < ggx_albedo_size; ++row) {
        for (std::uint32_t column = 0; column < ggx_albedo_size; ++column) {
            const double sum = entry(column, row, 0) + entry(column, row, 1);
            EXPECT_LE(sum, 1.0015) << column << ", " << row;  // two halves
            EXPECT_GE(sum, 0.3) << column << ", " << row;
        }
    }
}

// Known values of the single-scattering albedo: 0.307 for alpha 1 along the normal.
TEST(GgxAlbedoTable, HasKnownValues) {
    EXPECT_NEAR(entry(63, 63, 0) + entry(63, 63, 1), 0.307, 2e-3);
    EXPECT_NEAR(entry(63, 0, 0), 1.0, 1e-6);
    EXPECT_NEAR(entry(0, 0, 1), 1.0, 1e-3);
}

/// What shaders read between entries.
double interpolated(double cos_theta, double roughness) {
    const double x = std::sqrt(cos_theta) * 63.0, y = roughness * 63.0;
    const auto x0 = static_cast<std::uint32_t>(std::min(std::floor(x), 62.0)), y0 = static_cast<std::uint32_t>(std::min(std::floor(y), 62.0));
    const auto sum = [](std::uint32_t c, std::uint32_t r) { return entry(c, r, 0) + entry(c, r, 1); };
    const double fx = x - x0, fy = y - y0;
    return (sum(x0, y0) * (1 - fx) + sum(x0 + 1, y0) * fx) * (1 - fy) + (sum(x0, y0 + 1) * (1 - fx) + sum(x0 + 1, y0 + 1) * fx) * fy;
}

// How far interpolation is off, away from grazing angles and at them.
TEST(GgxAlbedoTable, InterpolatesClosely) {
    double worst = 0.0, worst_grazing = 0.0;
    for (double roughness = 0.04; roughness < 1.0; roughness += 0.09) {
        for (double cos_theta = 0.02; cos_theta < 1.0; cos_theta += 0.031) {
            const auto terms = directional_albedo_terms(cos_theta, roughness, 64);
            const double error = std::abs(interpolated(cos_theta, roughness) - (terms[0] + terms[1]));
            double& which = cos_theta < 0.1 ? worst_grazing : worst;
            which = std::max(which, error);
        }
    }
    RecordProperty("worst", std::to_string(worst));
    RecordProperty("worst_grazing", std::to_string(worst_grazing));
    EXPECT_LT(worst, 1e-3);
    EXPECT_LT(worst_grazing, 2e-3);
}

}  // namespace
}  // namespace nacre::passes
