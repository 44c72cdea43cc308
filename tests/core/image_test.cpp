// SPDX-License-Identifier: Apache-2.0
#include "core/image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>

#include <unistd.h>

#include "core/srgb.h"

namespace nacre {
namespace {

using testing::HasSubstr;

class ImageTest : public testing::Test {
  protected:
    ImageTest() : folder_(std::filesystem::temp_directory_path() / ("nacre_image_test." + std::to_string(::getpid()))) {
        std::filesystem::create_directories(folder_);
    }
    ~ImageTest() override { std::filesystem::remove_all(folder_); }
    [[nodiscard]] std::filesystem::path file(const char* name) const { return folder_ / name; }

  private:
    std::filesystem::path folder_;
};

// A pattern in which every texel and channel differs from its neighbors.
ImageBytes make_bytes(std::uint32_t width, std::uint32_t height, std::uint32_t channels, std::uint32_t size) {
    ImageBytes image{width, height, channels, size, {}};
    image.bytes.resize(image.texel_count() * channels * size);
    for (std::size_t i = 0; i < image.bytes.size(); ++i) image.bytes[i] = static_cast<std::uint8_t>(i * 37 + i / 251);
    return image;
}

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

std::string radiance_file(std::string_view pixels, int width, int height) {
    return "#?RADIANCE\n# made by a test\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(height) + " +X " +
           std::to_string(width) + "\n" + std::string(pixels);
}

TEST(SrgbTest, BytesSurviveTheRoundTrip) {
    for (int b = 0; b < 256; ++b) {
        EXPECT_EQ(srgb_byte_from_linear(linear_from_srgb_byte(static_cast<std::uint8_t>(b))), b);
    }
}

TEST(SrgbTest, FollowsTheStandard) {
    EXPECT_FLOAT_EQ(srgb_from_linear(0.003f), 12.92f * 0.003f);
    EXPECT_NEAR(srgb_from_linear(0.5f), 0.735357, 1e-6);  // 1.055 * 0.5^(1/2.4) - 0.055
    EXPECT_NEAR(linear_from_srgb(0.5f), 0.214041, 1e-6);  // ((0.5 + 0.055) / 1.055)^2.4
    EXPECT_EQ(srgb_from_linear(1.0f), 1.0f);
    EXPECT_EQ(linear_from_srgb(1.0f), 1.0f);
}

TEST(SrgbTest, ByteIsTheNearestForEveryFloatThatWasTried) {
    for (float linear = 0.0f; linear <= 1.0f; linear += 1.0f / 8191.0f) {
        const double encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(double(linear), 1 / 2.4) - 0.055;
        EXPECT_EQ(srgb_byte_from_linear(linear), static_cast<int>(std::floor(encoded * 255 + 0.5))) << linear;
    }
}

TEST(SrgbTest, ClampsAndTakesNanForBlack) {
    EXPECT_EQ(srgb_byte_from_linear(-3.0f), 0);
    EXPECT_EQ(srgb_byte_from_linear(7.0f), 255);
    EXPECT_EQ(srgb_byte_from_linear(std::nanf("")), 0);
    EXPECT_EQ(unorm_byte_from_float(std::nanf("")), 0);
    EXPECT_EQ(unorm_byte_from_float(INFINITY), 255);
}

TEST_F(ImageTest, PngKeepsEveryByteOfEveryKind) {
    for (std::uint32_t channels = 1; channels <= 4; ++channels) {
        for (std::uint32_t size = 1; size <= 2; ++size) {
            SCOPED_TRACE(testing::Message() << channels << " channels of " << size << " bytes");
            const ImageBytes image = make_bytes(23, 11, channels, size);
            ASSERT_TRUE(write_png(file("a.png"), image));
            const auto back = read_image_bytes(file("a.png"), {.channels = 0, .keep_16_bit = true});
            ASSERT_TRUE(back) << back.error().message();
            EXPECT_EQ(*back, image);
            const auto info = read_image_info(file("a.png"));
            ASSERT_TRUE(info);
            EXPECT_EQ(info->format, ImageFormat::png);
            EXPECT_EQ(info->width, 23u);
            EXPECT_EQ(info->height, 11u);
            EXPECT_EQ(info->channels, channels);
            EXPECT_EQ(info->bits_per_channel, size * 8);
        }
    }
}

TEST_F(ImageTest, ChannelsAreConverted) {
    const ImageBytes gray{1, 1, 1, 1, {70}};
    const auto data = encode_png(gray);
    ASSERT_TRUE(data);
    EXPECT_EQ(read_image_bytes(*data, "gray")->bytes, (std::vector<std::uint8_t>{70, 70, 70, 255}));
    EXPECT_EQ(read_image_bytes(*data, "gray", {.channels = 2})->bytes, (std::vector<std::uint8_t>{70, 255}));
    const auto color = encode_png(ImageBytes{1, 1, 3, 1, {255, 0, 0}});
    EXPECT_EQ(read_image_bytes(*color, "red", {.channels = 1})->bytes, (std::vector<std::uint8_t>{54}));
    const auto wide = encode_png(ImageBytes{1, 1, 1, 2, {0xff, 0xff}});
    EXPECT_EQ(read_image_bytes(*wide, "wide")->bytes, (std::vector<std::uint8_t>{255, 255, 255, 255}));
    const std::uint16_t bright = 0xff00;  // In the other byte order it would be almost black.
    ImageBytes machine_order{1, 1, 1, 2, {0, 0}};
    std::memcpy(machine_order.bytes.data(), &bright, 2);
    EXPECT_EQ(read_image_bytes(*encode_png(machine_order), "bright", {.channels = 1})->bytes[0], 254);
    EXPECT_FALSE(read_image_bytes(*wide, "wide", {.channels = 5}));
}

TEST_F(ImageTest, LinearPictureIsWrittenAsSrgb) {
    const Image image{2, 1, 4, {0.5f, 0.0f, 1.0f, 0.5f, -1.0f, 2.0f, std::nanf(""), 1.0f}};
    ASSERT_TRUE(write_png(file("new/folder/a.png"), image));
    const auto back = read_image_bytes(file("new/folder/a.png"));
    ASSERT_TRUE(back);
    EXPECT_EQ(back->bytes, (std::vector<std::uint8_t>{188, 0, 255, 128, 0, 255, 0, 255}));
    const auto linear = read_image(file("new/folder/a.png"));
    ASSERT_TRUE(linear);
    EXPECT_NEAR(linear->pixels[0], 0.5f, 0.004f);
    EXPECT_NEAR(linear->pixels[3], 128 / 255.0f, 1e-6f);
}

TEST_F(ImageTest, ExrKeepsEveryBit) {
    LayeredImage image{3, 2, {}};
    const float nan = std::bit_cast<float>(0x7fc12345u);
    image.layers.push_back(make_layer("", Image{3, 2, 3, std::vector<float>(18, 0.1f)}));
    image.layers.push_back({"depth", {{"Z", std::vector<float>{1e-42f, -0.0f, INFINITY, nan, 1e38f, 0.3f}}}});
    image.layers.push_back({"material.0", {{"word", std::vector<std::uint32_t>{0, 1, 0xffffffff, 0x80000000, 5, 6}}}});
    ASSERT_TRUE(write_exr(file("a.exr"), image));
    const auto back = read_exr_layers(file("a.exr"));
    ASSERT_TRUE(back) << back.error().message();
    ASSERT_EQ(back->layers.size(), 3u);
    for (const ImageLayer& expected : image.layers) {
        SCOPED_TRACE(expected.name);
        const auto found = std::ranges::find(back->layers, expected.name, &ImageLayer::name);
        ASSERT_NE(found, back->layers.end());
        ASSERT_EQ(found->channels.size(), expected.channels.size());
        for (std::size_t c = 0; c < expected.channels.size(); ++c) {
            EXPECT_EQ(found->channels[c].name, expected.channels[c].name);
            ASSERT_EQ(found->channels[c].values.index(), expected.channels[c].values.index());
            std::visit(
                [&](const auto& values) {
                    const auto& other = std::get<std::decay_t<decltype(values)>>(expected.channels[c].values);
                    ASSERT_EQ(values.size(), other.size());
                    EXPECT_EQ(std::memcmp(values.data(), other.data(), values.size() * 4), 0);
                },
                found->channels[c].values);
        }
    }
    const auto info = read_image_info(file("a.exr"));
    ASSERT_TRUE(info);
    EXPECT_EQ(info->width, 3u);
    EXPECT_EQ(info->height, 2u);
    EXPECT_EQ(info->channels, 5u);
    const auto color = read_image(file("a.exr"));
    ASSERT_TRUE(color);
    EXPECT_EQ(color->pixels, std::vector<float>(18, 0.1f));
}

TEST_F(ImageTest, ExrRefusesWhatCannotBeWritten) {
    const auto message = [&](LayeredImage image) {
        const auto written = write_exr(file("bad.exr"), image);
        EXPECT_FALSE(std::filesystem::exists(file("bad.exr")));
        return written ? std::string("written") : written.error().message();
    };
    EXPECT_THAT(message({0, 2, {}}), HasSubstr("0 x 2"));
    EXPECT_THAT(message({1, 1, {}}), HasSubstr("no channel"));
    EXPECT_THAT(message({2, 1, {{"a", {{"X", std::vector<float>{1}}}}}}), HasSubstr("'a.X' holds 1 values"));
    EXPECT_THAT(message({1, 1, {{"", {{"X", std::vector<float>{1}}, {"X", std::vector<float>{1}}}}}}),
                HasSubstr("occurs twice"));
}

TEST_F(ImageTest, RadianceIsDecoded) {
    // 1.0 is mantissa 128 with exponent 129: 128 * 2^(129 - 136).
    const std::string plain = radiance_file(std::string("\x80\x40\x00\x81\x00\x00\x00\x00", 8), 2, 1);
    const auto image = read_image(bytes_of(plain), "plain");
    ASSERT_TRUE(image) << image.error().message();
    EXPECT_EQ(image->pixels, (std::vector<float>{1.0f, 0.5f, 0.0f, 0.0f, 0.0f, 0.0f}));
}

TEST_F(ImageTest, RadianceRunsAreDecoded) {
    std::string pixels("\x02\x02\x00\x08", 4);
    pixels += std::string("\x88\x80", 2);                              // red: a run of 8
    pixels += std::string("\x08\x00\x10\x20\x30\x40\x50\x60\x70", 9);  // green: 8 plain bytes
    pixels += std::string("\x84\x01\x84\x02", 4);                      // blue: two runs of 4
    pixels += std::string("\x88\x81", 2);                              // exponent
    const std::string packed = radiance_file(pixels, 8, 1);
    const auto image = read_image(bytes_of(packed), "packed");
    ASSERT_TRUE(image) << image.error().message();
    EXPECT_EQ(image->pixels[0], 1.0f);
    EXPECT_EQ(image->pixels[7 * 3 + 1], 0x70 / 128.0f);
    EXPECT_EQ(image->pixels[3 * 3 + 2], 1 / 128.0f);
    EXPECT_EQ(image->pixels[4 * 3 + 2], 2 / 128.0f);
}

TEST_F(ImageTest, RadianceOldRunsAreDecoded) {
    const std::string old = radiance_file(std::string("\x80\x40\x20\x81\x01\x01\x01\x03", 8), 4, 1);
    const auto image = read_image(bytes_of(old), "old");
    ASSERT_TRUE(image) << image.error().message();
    for (std::uint32_t x = 0; x < 4; ++x) EXPECT_EQ(image->texel(x, 0)[1], 0.5f);
}

TEST_F(ImageTest, EnvironmentsOfTheAssetsAreRead) {
    const char* assets = std::getenv("NACRE_ASSETS");
    const std::filesystem::path path =
        std::filesystem::path(assets ? assets : NACRE_SOURCE_DIR "/../shared/assets") / "hdr/venice_sunset_1k.hdr";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
    const auto image = read_image(path);
    ASSERT_TRUE(image) << image.error().message();
    EXPECT_EQ(image->width, 1024u);
    EXPECT_EQ(image->height, 512u);
    double sum = 0;
    for (const float value : image->pixels) {
        ASSERT_TRUE(std::isfinite(value));
        ASSERT_GE(value, 0.0f);
        sum += value;
    }
    EXPECT_GT(sum / static_cast<double>(image->pixels.size()), 0.05);
}

TEST_F(ImageTest, WriteErrorsNameFileAndCause) {
    const ImageBytes image = make_bytes(4, 4, 3, 1);
    const auto into_file = write_png("/dev/null/x.png", image);
    ASSERT_FALSE(into_file);
    EXPECT_THAT(into_file.error().message(), HasSubstr("/dev/null"));
    std::filesystem::create_directories(file("taken.png"));
    EXPECT_FALSE(write_png(file("taken.png"), image));
    EXPECT_FALSE(write_png(file("empty.png"), ImageBytes{}));
    EXPECT_FALSE(write_png(file("short.png"), ImageBytes{4, 4, 3, 1, {1, 2, 3}}));
    // Nothing is left over beside the folder that was in the way.
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(file("")), std::filesystem::directory_iterator()), 1);
}

}  // namespace
}  // namespace nacre
