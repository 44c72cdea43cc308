// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>

#include "core/srgb.h"
#include "scene/shapes.h"
#include "tests/passes/renderer_test.h"

namespace nacre::test {
namespace {

RENDERER_SUITE(ToneMap);

/// A room whose walls go from dark to bright.
scene::Scene gradient() {
    scene::Scene scene = empty_scene();
    scene.cameras[0].projection = scene::Projection::perspective;
    scene.cameras[0].vertical_field_of_view = 2.0f;
    for (std::size_t i = 0; i < scene.environment.texels.size(); ++i) {
        const float v = std::exp2(static_cast<float>(i % 64) / 4.0f - 10.0f);
        scene.environment.texels[i] = {v, 2.0f * v, 0.5f * v, 1.0f};
    }
    return scene;
}

/// The curve of passes/tonemap/filmic.glsl from the points that it was made for: x (a x + b) / (x^2 + d x + e).
double filmic(double x) {
    constexpr double a = 1.02;
    constexpr std::array<std::array<double, 2>, 3> points = {{{0.02, 0.012}, {0.18, 0.18}, {1.0, 0.74}}};
    // Linear equations for b, d and e, solved by Cramer's rule: -x b + f x d + f e = (a - f) x^2.
    const auto determinant = [](const std::array<std::array<double, 3>, 3>& m) {
        return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    };
    std::array<std::array<double, 3>, 3> m{};
    std::array<double, 3> right{};
    for (int i = 0; i < 3; ++i) {
        const auto [px, f] = points[i];
        m[i] = {-px, f * px, f};
        right[i] = (a - f) * px * px;
    }
    std::array<double, 3> solution{};
    for (int column = 0; column < 3; ++column) {
        auto replaced = m;
        for (int row = 0; row < 3; ++row) replaced[row][column] = right[row];
        solution[column] = determinant(replaced) / determinant(m);
    }
    const auto [b, d, e] = solution;
    return x * (a * x + b) / (x * x + d * x + e);
}

void expect_curve(const Shot& shot, double exposure, bool is_filmic) {
    const auto& picture = shot.picture;
    int distinct = 0, last = -1;
    for (std::uint32_t y = 0; y < picture.tone_mapped.height; y += 3) {
        for (std::uint32_t x = 0; x < picture.tone_mapped.width; ++x) {
            for (int c = 0; c < 3; ++c) {
                const double linear = shot.radiance_at(x, y)[c] * exposure;
                const double mapped = is_filmic ? filmic(linear) : linear;
                const int expected = srgb_byte_from_linear(static_cast<float>(mapped));
                ASSERT_NEAR(shot.bytes_at(x, y)[c], expected, 1) << linear;
                if (expected != last) ++distinct, last = expected;
            }
        }
    }
    EXPECT_GT(distinct, 100);
}

TEST_P(ToneMap, FilmicFollowsItsThreePoints) {
    expect_curve(render(gradient(), {.width = 96, .height = 64, .exposure_ev = 1.0f}), 2.0, true);
}

TEST_P(ToneMap, LinearOnlyClamps) {
    expect_curve(render(gradient(), {.width = 96, .height = 64, .exposure_ev = -2.0f,
                                     .tone_mapping = passes::ToneMapping::linear}),
                 0.25, false);
}

// Metered: the median becomes middle gray unless the brightest twentieth would burn out.
TEST_P(ToneMap, MeteringFollowsTheMedian) {
    const Shot shot = render(gradient(), {.width = 96, .height = 64});
    std::vector<float> luminances;
    for (std::uint32_t y = 0; y < 64; y += 2) {
        for (std::uint32_t x = 0; x < 96; x += 2) {
            luminances.push_back(glm::dot(shot.radiance_at(x, y), glm::vec3(0.2126f, 0.7152f, 0.0722f)));
        }
    }
    std::ranges::sort(luminances);
    const float median = luminances[luminances.size() / 2], bright = luminances[luminances.size() * 95 / 100];
    const float expected = std::max(std::min(0.18f / median, 1.0f / bright), 0.1f / median);
    // Bins are an eighth of a stop wide.
    EXPECT_NEAR(shot.statistics.exposure_ev, std::log2(expected), 0.15);
}

// A picture that is twice as bright is metered one stop darker and looks the same.
TEST_P(ToneMap, MeteringUndoesBrightness) {
    scene::Scene scene = gradient();
    const Shot once = render(scene, {.width = 96, .height = 64});
    scene.environment.intensity = 2.0f;
    const Shot twice = render(scene, {.width = 96, .height = 64});
    EXPECT_NEAR(once.statistics.exposure_ev - twice.statistics.exposure_ev, 1.0, 0.02);
    for (std::uint32_t x = 0; x < 96; ++x) {
        ASSERT_NEAR(once.bytes_at(x, 32).g, twice.bytes_at(x, 32).g, 2) << x;
    }
}

}  // namespace
}  // namespace nacre::test
