// SPDX-License-Identifier: Apache-2.0
#include "measure/image_metrics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/srgb.h"

namespace nacre::measure {
namespace {

Image gray_bytes(std::uint32_t width, std::uint32_t height, std::uint8_t value) {
    Image image{width, height, 3, {}};
    image.pixels.assign(image.texel_count() * 3, linear_from_srgb_byte(value));
    return image;
}

TEST(ImageMetricsTest, EqualPicturesHaveTheLargestPsnr) {
    const auto result = compare_pictures(gray_bytes(8, 8, 99), gray_bytes(8, 8, 99));
    ASSERT_TRUE(result);
    EXPECT_EQ(result->psnr_db, 200.0);
    EXPECT_EQ(result->flip_mean, 0.0);
    EXPECT_EQ(result->max_abs_8bit, 0u);
    EXPECT_EQ(result->share_above_1, 0.0);
    EXPECT_EQ(result->max_abs_linear, 0.0);
}

// Every byte off by 5: the squared error is (5/255)^2, so the PSNR is 20 log10(51).
TEST(ImageMetricsTest, PsnrIsAsDerivedByHand) {
    const auto result = compare_pictures(gray_bytes(8, 8, 100), gray_bytes(8, 8, 105));
    ASSERT_TRUE(result);
    EXPECT_NEAR(result->psnr_db, 20.0 * std::log10(51.0), 1e-4);
    EXPECT_EQ(result->max_abs_8bit, 5u);
    EXPECT_EQ(result->share_above_1, 1.0);
}

TEST(ImageMetricsTest, ShareCountsPixelsAboveOneStep) {
    const Image a = gray_bytes(10, 10, 100);
    Image b = a;
    b.texel(0, 0)[0] = linear_from_srgb_byte(101);  // one step: not counted
    b.texel(1, 0)[1] = linear_from_srgb_byte(102);
    b.texel(2, 0)[0] = linear_from_srgb_byte(98);
    b.texel(2, 0)[2] = linear_from_srgb_byte(107);  // the same pixel: counted once
    const auto result = compare_pictures(a, b);
    ASSERT_TRUE(result);
    EXPECT_DOUBLE_EQ(result->share_above_1, 0.02);
    EXPECT_DOUBLE_EQ(result->share_differing, 0.03);
    EXPECT_EQ(result->max_abs_8bit, 7u);
}

TEST(ImageMetricsTest, LinearFiguresSeeBeyondOne) {
    Image a = gray_bytes(4, 4, 255), b = a;
    a.pixels[0] = 10.0f;
    b.pixels[0] = 8.0f;
    auto result = compare_pictures(a, b);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->psnr_db, 200.0);
    EXPECT_DOUBLE_EQ(result->max_abs_linear, 2.0);
    EXPECT_DOUBLE_EQ(result->max_rel_linear, 0.2);
    b.pixels[0] = std::nanf("");
    result = compare_pictures(a, b);
    EXPECT_TRUE(std::isinf(result->max_abs_linear));
    EXPECT_EQ(result->max_abs_8bit, 255u);
}

TEST(ImageMetricsTest, AlphaIsIgnoredAndGrayIsSpread) {
    const Image a{1, 1, 4, {0.5f, 0.5f, 0.5f, 0.0f}};
    const Image b{1, 1, 4, {0.5f, 0.5f, 0.5f, 1.0f}};
    const Image gray{1, 1, 1, {0.5f}};
    EXPECT_EQ(compare_pictures(a, b)->psnr_db, 200.0);
    EXPECT_EQ(compare_pictures(a, gray)->psnr_db, 200.0);
}

TEST(ImageMetricsTest, SizesMustAgree) {
    EXPECT_FALSE(compare_pictures(gray_bytes(8, 8, 0), gray_bytes(8, 9, 0)));
    EXPECT_FALSE(compare_pictures(Image{}, Image{}));
    EXPECT_FALSE(difference_image(gray_bytes(8, 8, 0), gray_bytes(9, 8, 0)));
    EXPECT_FALSE(difference_image(gray_bytes(8, 8, 0), gray_bytes(8, 8, 0), 0.0f));
    EXPECT_FALSE(difference_image(gray_bytes(8, 8, 0), gray_bytes(8, 8, 0), std::nanf("")));
}

TEST(ImageMetricsTest, DifferenceImageIsAmplified) {
    const auto image = difference_image(gray_bytes(2, 2, 100), gray_bytes(2, 2, 103), 10.0f);
    ASSERT_TRUE(image);
    EXPECT_EQ(srgb_byte_from_linear(image->pixels[0]), 30);
}

TEST(ImageMetricsTest, ScanFindsWhatShouldNotBe) {
    const Image image{3, 1, 2, {0.0f, -0.0f, std::nanf(""), INFINITY, -1.0f, -INFINITY}};
    const ValueScan scan = scan_values(image);
    EXPECT_EQ(scan.nan, 1u);
    EXPECT_EQ(scan.infinite, 2u);
    EXPECT_EQ(scan.negative, 1u);
    EXPECT_FALSE(scan.clean());
    EXPECT_TRUE(scan_values(gray_bytes(2, 2, 7)).clean());
}

TEST(ImageMetricsTest, MedianOfLuminance) {
    EXPECT_DOUBLE_EQ(median_luminance(Image{3, 1, 1, {5.0f, 1.0f, 2.0f}}), 2.0);
    EXPECT_DOUBLE_EQ(median_luminance(Image{4, 1, 1, {5.0f, 1.0f, 2.0f, 3.0f}}), 2.5);
    EXPECT_NEAR(median_luminance(Image{1, 1, 3, {1.0f, 0.0f, 0.0f}}), 0.2126, 1e-6);
    EXPECT_DOUBLE_EQ(median_luminance(Image{2, 1, 1, {std::nanf(""), 3.0f}}), 3.0);
    EXPECT_DOUBLE_EQ(median_luminance(Image{}), 0.0);
}

}  // namespace
}  // namespace nacre::measure
