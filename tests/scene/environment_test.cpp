// SPDX-License-Identifier: Apache-2.0
#include "scene/environment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "core/file.h"
#include "core/image.h"
#include "tests/scene/scene_checks.h"

namespace nacre::scene {
namespace {

using testing::HasSubstr;

class EnvironmentFile : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = std::filesystem::temp_directory_path() / ("nacre_environment_test_" + std::to_string(::getpid()));
        std::filesystem::create_directories(folder_);
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }
    [[nodiscard]] std::string path(const std::string& name) const { return (folder_ / name).string(); }

    std::filesystem::path folder_;
};

TEST_F(EnvironmentFile, OpenExrIsReadAndBrokenTexelsAreMended) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float infinity = std::numeric_limits<float>::infinity();
    const nacre::Image picture{
        .width = 2,
        .height = 2,
        .channels = 3,
        .pixels = {1.5f, 2.5f, 3.5f, nan, -1.0f, infinity, 1e30f, -infinity, 0.0f, 0.25f, 0.5f, 0.75f}};
    ASSERT_TRUE(write_exr(path("sky.exr"), make_layered_image(picture)));
    const Expected<Environment> environment = load_environment(path("sky.exr"));
    ASSERT_TRUE(environment) << environment.error().message();
    EXPECT_EQ(environment->width, 2u);
    EXPECT_EQ(environment->height, 2u);
    ASSERT_EQ(environment->texels.size(), 4u);
    EXPECT_EQ(environment->texels[0], glm::vec4(1.5f, 2.5f, 3.5f, 1.0f));
    EXPECT_EQ(environment->texels[1], glm::vec4(0.0f, 0.0f, 65504.0f, 1.0f));
    EXPECT_EQ(environment->texels[2], glm::vec4(65504.0f, 0.0f, 0.0f, 1.0f));
}

TEST_F(EnvironmentFile, WhatIsNoEnvironmentIsRefusedByName) {
    const ImageBytes picture{.width = 2, .height = 1, .channels = 3, .bytes = {1, 2, 3, 4, 5, 6}};
    ASSERT_TRUE(write_png(path("sky.png"), picture));
    const auto error = [&](const std::string& name) {
        const Expected<Environment> environment = load_environment(path(name));
        return environment ? std::string("accepted") : environment.error().message();
    };
    EXPECT_THAT(error("sky.png"),
                testing::AllOf(HasSubstr("load environment"), HasSubstr("sky.png"), HasSubstr("PNG")));
    EXPECT_THAT(error("missing.hdr"), HasSubstr("missing.hdr"));
    ASSERT_TRUE(write_file_atomically(path("cut.hdr"),
                                      std::string_view("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n\x02")));
    EXPECT_THAT(error("cut.hdr"), HasSubstr("cut.hdr"));
    ASSERT_TRUE(write_file_atomically(
        path("bomb.hdr"), std::string_view("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 1000000\n\x02")));
    EXPECT_THAT(error("bomb.hdr"), HasSubstr("16384"));
    ASSERT_TRUE(write_file_atomically(path("text.hdr"), std::string_view("hello")));
    EXPECT_THAT(error("text.hdr"), HasSubstr("text.hdr"));
}

TEST(Environment, DirectionsAndCoordinatesAreInverse) {
    EXPECT_NEAR(environment_direction({0.5f, 0.5f}).z, -1.0f, 1e-6f);
    EXPECT_NEAR(environment_direction({0.75f, 0.5f}).x, 1.0f, 1e-6f);
    EXPECT_NEAR(environment_direction({0.5f, 0.0f}).y, 1.0f, 1e-6f);
    for (float u = 0.05f; u < 1.0f; u += 0.1f) {
        for (float v = 0.05f; v < 1.0f; v += 0.1f) {
            const glm::vec2 back = environment_uv(3.0f * environment_direction({u, v}));
            EXPECT_NEAR(back.x, u, 1e-5f);
            EXPECT_NEAR(back.y, v, 1e-5f);
        }
    }
}

TEST(Environment, TheStudioHasItsDocumentedBrightnessAndNoLampsBehindTheScene) {
    const Environment studio = studio_environment();
    double sum = 0.0, weights = 0.0;
    for (std::uint32_t row = 0; row < studio.height; ++row) {
        const double v = (row + 0.5) / studio.height;
        const double weight = std::sin(v * 3.14159265358979);
        for (std::uint32_t column = 0; column < studio.width; ++column) {
            const glm::vec4& texel = studio.texels[std::size_t{row} * studio.width + column];
            ASSERT_TRUE(is_finite(glm::vec3(texel)));
            ASSERT_GT(std::min({texel.r, texel.g, texel.b}), 0.0f);
            const double luminance = 0.2126 * texel.r + 0.7152 * texel.g + 0.0722 * texel.b;
            sum += weight * luminance;
            weights += weight;
            // What a camera along -Z sees: 37 degrees to each side, 23 up and down.
            const double u = (column + 0.5) / studio.width;
            const bool is_in_view = std::abs(u - 0.5) < 37.0 / 360.0 && std::abs(v - 0.5) < 23.0 / 180.0;
            ASSERT_TRUE(!is_in_view || luminance < 1.0) << u << ", " << v << ": " << luminance;
        }
    }
    EXPECT_NEAR(sum / weights, 0.5, 1e-3);
}

}  // namespace
}  // namespace nacre::scene
