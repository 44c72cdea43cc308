// SPDX-License-Identifier: Apache-2.0
// Pictures are made with the library's encoder and read through core/image.h.
#include <gmock/gmock.h>

#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "core/image.h"

// jpeglib.h does not include what it needs, so it comes after the others.
#include <jpeglib.h>

namespace nacre {
namespace {

using testing::HasSubstr;

struct Encoded {
    J_COLOR_SPACE color_space = JCS_RGB;
    bool is_progressive = false;
    int width = 16;
    int height = 16;
};

/// A picture of one color, `texel` holding one byte for each channel, at the best quality.
std::vector<std::byte> encode(const std::vector<unsigned char>& texel, const Encoded& options) {
    jpeg_compress_struct info{};
    jpeg_error_mgr errors{};
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    unsigned char* data = nullptr;
    unsigned long size = 0;
    jpeg_mem_dest(&info, &data, &size);
    info.image_width = static_cast<JDIMENSION>(options.width);
    info.image_height = static_cast<JDIMENSION>(options.height);
    info.input_components = static_cast<int>(texel.size());
    info.in_color_space = options.color_space;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, 100, TRUE);
    if (options.is_progressive) jpeg_simple_progression(&info);
    jpeg_start_compress(&info, TRUE);
    std::vector<unsigned char> row;
    for (int x = 0; x < options.width; ++x) row.insert(row.end(), texel.begin(), texel.end());
    for (int y = 0; y < options.height; ++y) {
        JSAMPROW start = row.data();
        jpeg_write_scanlines(&info, &start, 1);
    }
    jpeg_finish_compress(&info);
    const auto bytes = std::as_bytes(std::span(data, size));
    std::vector<std::byte> copy(bytes.begin(), bytes.end());
    jpeg_destroy_compress(&info);
    std::free(data);
    return copy;
}

/// Every texel of the decoded picture is `texel`, up to what the transform rounds.
void expect_color(const std::vector<std::byte>& file, const std::vector<int>& texel) {
    const auto image = read_image_bytes(file, "a.jpg", {.channels = 0});
    ASSERT_TRUE(image) << image.error().message();
    ASSERT_EQ(image->channels, texel.size());
    ASSERT_EQ(image->bytes.size(), image->texel_count() * texel.size());
    for (std::size_t i = 0; i < image->bytes.size(); ++i) ASSERT_NEAR(image->bytes[i], texel[i % texel.size()], 2) << i;
}

TEST(Jpeg, ColorsAndGraysAreRead) {
    expect_color(encode({200, 30, 90}, {}), {200, 30, 90});
    expect_color(encode({200, 30, 90}, {.is_progressive = true, .width = 37, .height = 5}), {200, 30, 90});
    expect_color(encode({77}, {.color_space = JCS_GRAYSCALE}), {77});
}

TEST(Jpeg, InksBecomeLight) {
    // The encoder writes Adobe's marker, which means that 255 is no ink.
    expect_color(encode({255, 255, 255, 255}, {.color_space = JCS_CMYK}), {255, 255, 255});
    expect_color(encode({255, 0, 0, 255}, {.color_space = JCS_CMYK}), {255, 0, 0});
    expect_color(encode({200, 100, 50, 128}, {.color_space = JCS_CMYK}), {100, 50, 25});
}

TEST(Jpeg, ATableWithMoreCodesThanSymbolsIsAnError) {
    std::vector<std::byte> file = encode({77}, {.color_space = JCS_GRAYSCALE});
    for (std::size_t i = 0; i + 20 < file.size(); ++i)
        if (file[i] == std::byte{0xff} && file[i + 1] == std::byte{0xc4})
            for (std::size_t length = 0; length < 16; ++length) file[i + 5 + length] = std::byte{0xff};
    const auto image = read_image(file, "table.jpg");
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().code, ErrorCode::parse);
    EXPECT_THAT(image.error().message(), HasSubstr("'table.jpg'"));
}

TEST(Jpeg, ThousandsOfScansAreRefused) {
    std::vector<std::byte> file = encode({77}, {.color_space = JCS_GRAYSCALE, .is_progressive = true});
    // Repeat the last scan, from its marker to the end of the picture.
    std::size_t scan = 0;
    for (std::size_t i = 0; i + 1 < file.size(); ++i)
        if (file[i] == std::byte{0xff} && file[i + 1] == std::byte{0xda}) scan = i;
    const std::vector<std::byte> last(file.begin() + static_cast<std::ptrdiff_t>(scan), file.end() - 2);
    for (int i = 0; i < 1000; ++i) file.insert(file.end() - 2, last.begin(), last.end());
    const auto image = read_image(file, "scans.jpg");
    ASSERT_FALSE(image);
    EXPECT_THAT(image.error().message(), HasSubstr("more than 100 scans"));
}

}  // namespace
}  // namespace nacre
