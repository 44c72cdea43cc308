// SPDX-License-Identifier: Apache-2.0
#include "measure/flip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace nacre::measure {
namespace {

Image uniform(float r, float g, float b, std::uint32_t width = 40, std::uint32_t height = 30) {
    Image image{width, height, 3, {}};
    for (std::size_t p = 0; p < image.texel_count(); ++p) image.pixels.insert(image.pixels.end(), {r, g, b});
    return image;
}

Image noise(unsigned seed, float amplitude) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> value(0.5f - amplitude, 0.5f + amplitude);
    Image image = uniform(0, 0, 0, 64, 64);
    for (float& pixel : image.pixels) pixel = value(random);
    return image;
}

double mean_flip(const Image& a, const Image& b) {
    const auto result = compute_flip(a, b);
    EXPECT_TRUE(result) << result.error().message();
    return result ? result->mean : -1;
}

TEST(FlipTest, EqualPicturesHaveNoDifference) {
    const Image image = noise(1, 0.5f);
    const auto result = compute_flip(image, image);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->mean, 0.0);
    for (const float value : result->map.pixels) EXPECT_EQ(value, 0.0f);
}

// Worked by hand from the paper. Lab of black is 0, of white (100, 0, 0): HyAB = 100, to the power of 0.7 = 25.119.
// Lab of green (87.735, -86.183, 83.180) and blue (32.297, 79.188, -107.860) with the Hunt factors 0.87735 and 0.32297:
// HyAB = 55.438 + sqrt(101.188^2 + 107.814^2) = 203.30, to the power of 0.7 = 41.28, its 0.4 = 16.51.
// FLIP = 0.95 + (25.119 - 16.51) / (41.28 - 16.51) * 0.05 = 0.9674; uniform pictures have no features.
TEST(FlipTest, BlackAgainstWhiteIsAsDerivedByHand) {
    EXPECT_NEAR(mean_flip(uniform(0, 0, 0), uniform(1, 1, 1)), 0.9674, 2e-4);
}

TEST(FlipTest, GreenAgainstBlueIsTheLargestDifference) {
    EXPECT_NEAR(mean_flip(uniform(0, 1, 0), uniform(0, 0, 1)), 1.0, 1e-4);
}

// Grays of L* = 50 and 51: HyAB = 1, so FLIP = 1 * 0.95 / 16.51.
TEST(FlipTest, OneStepOfLightnessIsAsDerivedByHand) {
    const auto luminance = [](double lightness) { return static_cast<float>(std::pow((lightness + 16) / 116, 3.0)); };
    const float a = luminance(50), b = luminance(51);
    EXPECT_NEAR(mean_flip(uniform(a, a, a), uniform(b, b, b)), 0.95 / 16.51, 1e-4);
}

TEST(FlipTest, OrderDoesNotMatter) {
    const Image a = noise(1, 0.4f), b = noise(2, 0.4f);
    EXPECT_NEAR(mean_flip(a, b), mean_flip(b, a), 1e-9);
}

TEST(FlipTest, GrowsWithTheDifference) {
    const Image base = uniform(0.5f, 0.5f, 0.5f, 64, 64);
    double previous = 0;
    for (const float amplitude : {0.01f, 0.05f, 0.1f, 0.2f, 0.4f}) {
        const double flip = mean_flip(base, noise(3, amplitude));
        EXPECT_GT(flip, previous);
        EXPECT_LT(flip, 1.0);
        previous = flip;
    }
}

// A pattern finer than the eye resolves at this distance looks like its mean.
TEST(FlipTest, DistanceHidesFinePatterns) {
    Image checker = uniform(0.5f, 0.5f, 0.5f, 64, 64);
    for (std::uint32_t y = 0; y < 64; ++y) {
        for (std::uint32_t x = 0; x < 64; ++x) {
            for (int c = 0; c < 3; ++c) checker.texel(x, y)[c] = (x + y) % 2 ? 0.6f : 0.4f;
        }
    }
    const Image gray = uniform(0.5f, 0.5f, 0.5f, 64, 64);
    const double near = compute_flip(gray, checker, 8.0f)->mean;
    const double far = compute_flip(gray, checker, 400.0f)->mean;
    EXPECT_LT(far, 0.1 * near);
}

// A single bright pixel is a feature: it counts more than its blurred color alone, and only around itself.
TEST(FlipTest, PointsAreSeenWhereTheyAre) {
    const Image gray = uniform(0.2f, 0.2f, 0.2f, 81, 81);
    Image point = gray;
    for (int c = 0; c < 3; ++c) point.texel(40, 40)[c] = 1.0f;
    const auto result = compute_flip(gray, point);
    ASSERT_TRUE(result);
    EXPECT_GT(result->map.texel(40, 40)[0], 0.2f);
    EXPECT_EQ(result->map.texel(40, 60)[0], 0.0f);
    EXPECT_EQ(result->map.texel(5, 5)[0], 0.0f);
    // The filters are symmetric.
    EXPECT_NEAR(result->map.texel(36, 40)[0], result->map.texel(44, 40)[0], 1e-4f);
    EXPECT_NEAR(result->map.texel(40, 36)[0], result->map.texel(44, 40)[0], 1e-4f);
}

// Black against a picture that is white right of a vertical border, seen 5 pixels left of it: hardly any light of the
// border gets there, but the feature detectors reach that far. In one dimension the two parts are sums that can be
// written down (paper, sections 4.1 to 4.4; sigma in pixels, texel centers 5, 6, ... to the right are white).
TEST(FlipTest, FeaturesCountAsDerivedByHand) {
    constexpr double pi = 3.14159265358979, ppd = 67.0;
    double light = 0, all = 0;
    for (int x = -10; x <= 10; ++x) {
        const double weight = std::exp(-pi * pi * x * x / (ppd * ppd) / 0.0047);
        all += weight;
        if (x >= 5) light += weight;
    }
    light /= all;
    const double lightness = 116.0 * (light * 841.0 / 108.0 + 4.0 / 29.0) - 16.0;
    const double color = std::pow(lightness, 0.7) * 0.95 / 16.51;

    const double sigma = 0.5 * 0.082 * ppd;
    double edge = 0, edge_sum = 0, point = 0, point_sum = 0;
    for (int x = -9; x <= 9; ++x) {
        const double gaussian = std::exp(-x * x / (2 * sigma * sigma));
        const double first = x * gaussian, second = (x * x / (sigma * sigma) - 1) * gaussian;
        edge_sum += std::max(first, 0.0);
        point_sum += std::max(second, 0.0);
        if (x >= 5) edge += first, point += second;
    }
    const double feature = std::sqrt(std::max(edge / edge_sum, point / point_sum) / std::sqrt(2.0));

    Image half = uniform(0, 0, 0, 81, 41);
    for (std::uint32_t y = 0; y < 41; ++y) {
        for (std::uint32_t x = 40; x < 81; ++x) {
            for (int c = 0; c < 3; ++c) half.texel(x, y)[c] = 1.0f;
        }
    }
    const auto result = compute_flip(uniform(0, 0, 0, 81, 41), half);
    ASSERT_TRUE(result);
    const double expected = std::pow(color, 1.0 - feature);
    EXPECT_GT(expected, 5.0 * color);  // Most of it is the feature.
    EXPECT_NEAR(result->map.texel(35, 20)[0], expected, 0.02 * expected);
    EXPECT_NEAR(result->map.texel(75, 20)[0], 0.9674, 2e-4);  // Far on the white side: black against white.
}

TEST(FlipTest, OddValuesStayInRange) {
    Image odd = noise(4, 0.5f);
    odd.pixels[100] = std::nanf("");
    odd.pixels[200] = INFINITY;
    odd.pixels[300] = -5.0f;
    const auto result = compute_flip(noise(4, 0.5f), odd);
    ASSERT_TRUE(result);
    for (const float value : result->map.pixels) {
        EXPECT_GE(value, 0.0f);
        EXPECT_LE(value, 1.0f);
    }
    EXPECT_GT(result->mean, 0.0);
}

TEST(FlipTest, BadInputIsAnError) {
    EXPECT_FALSE(compute_flip(uniform(0, 0, 0), uniform(0, 0, 0, 41, 30)));
    EXPECT_FALSE(compute_flip(Image{}, Image{}));
    EXPECT_FALSE(compute_flip(Image{1, 1, 1, {0}}, Image{1, 1, 1, {0}}));
    EXPECT_FALSE(compute_flip(uniform(0, 0, 0), uniform(0, 0, 0), std::nanf("")));
    EXPECT_TRUE(compute_flip(uniform(0, 0, 0, 1, 1), uniform(1, 1, 1, 1, 1)));
}

}  // namespace
}  // namespace nacre::measure
