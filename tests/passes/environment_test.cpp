// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include "passes/profiles.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(Environment);

/// As passes/shared/cube.glsl has it, in double precision.
glm::dvec3 cube_direction(int face, double s, double t) {
    switch (face) {
        case 0: return {1.0, -t, -s};
        case 1: return {-1.0, -t, s};
        case 2: return {s, 1.0, t};
        case 3: return {s, -1.0, -t};
        case 4: return {s, -t, 1.0};
        default: return {-s, -t, -1.0};
    }
}

double half(std::uint16_t bits) {
    const int exponent = bits >> 10 & 31;
    const double fraction = bits & 1023;
    return exponent == 0 ? std::ldexp(fraction, -24) : std::ldexp(1024.0 + fraction, exponent - 25);
}

// A picture that rises from row to row away from one of them: each texel of the cube tells the row that its direction
// looks at, to a few thousandths. Near the poles too, where the cosine has lost the angle.
TEST_P(Environment, LooksAtTheRowOfItsDirection) {
    // As many rows as the cube has room for.
    const std::uint32_t height = 2 * (*passes::find_profile(GetParam().profile))->environment_size;
    for (const double part : {1.0 / 64.0, 0.125, 0.375, 0.875}) {
        SCOPED_TRACE(part);
        const double row = part * height;
        scene::Scene scene = empty_scene();
        scene.environment = {.name = "ramp", .width = 2 * height, .height = height};
        for (std::uint32_t y = 0; y < height; ++y)
            scene.environment.texels.insert(scene.environment.texels.end(), 2 * height,
                                            glm::vec4(glm::vec3(static_cast<float>(std::abs(y + 0.5 - row))), 1.0f));
        const Shot shot = render(scene, {.width = 8, .height = 8});
        int compared = 0;
        double largest = 0.0;
        for (int face = 0; face < 6; ++face) {
            const auto texels = shot.intermediate<std::uint16_t>("environment", static_cast<std::uint32_t>(face));
            const double texel_count = static_cast<double>(texels.size()) / 4.0;
            const auto side = static_cast<std::uint32_t>(std::lround(std::sqrt(texel_count)));
            ASSERT_EQ(std::size_t{side} * side * 4, texels.size());
            for (std::uint32_t y = 0; y < side; ++y)
                for (std::uint32_t x = 0; x < side; ++x) {
                    const glm::dvec3 d =
                        cube_direction(face, (x + 0.5) / side * 2.0 - 1.0, (y + 0.5) / side * 2.0 - 1.0);
                    const double polar = std::atan2(std::hypot(d.x, d.z), d.y);
                    const double expected = std::abs(polar / std::numbers::pi * height - row);
                    // The kink is rounded off, and half precision has too few digits for what is farther away.
                    if (expected < 1.0 || expected > 4.0) continue;
                    largest = std::max(largest, std::abs(half(texels[(y * side + x) * 4]) - expected));
                    ++compared;
                }
        }
        EXPECT_GT(compared, 50);
        // Half a unit of the last place of half precision at 4 is 0.001.
        EXPECT_LT(largest, 0.003) << "rows of " << height;
    }
}

}  // namespace
}  // namespace nacre::test
