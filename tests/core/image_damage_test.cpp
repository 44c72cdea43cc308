// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include <sys/resource.h>
#include <unistd.h>

#include "core/image.h"

// Damaged, truncated and boastful files: an error that names the file, never a crash, never the claimed memory.

namespace nacre {
namespace {

using testing::HasSubstr;

std::span<const std::byte> file_bytes(const std::string& text) { return std::as_bytes(std::span(text)); }

std::string text_of(std::span<const std::byte> data) {
    return {reinterpret_cast<const char*>(data.data()), data.size()};
}

std::string read_text(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

std::string sample_png() {
    ImageBytes image{64, 48, 3, 1, {}};
    for (std::size_t i = 0; i < image.texel_count() * 3; ++i)
        image.bytes.push_back(static_cast<std::uint8_t>(i * i / 7));
    return text_of(*encode_png(image));
}

std::string sample_exr() {
    const auto path = std::filesystem::temp_directory_path() / ("nacre_damage." + std::to_string(::getpid()) + ".exr");
    Image image{40, 30, 3, {}};
    for (std::size_t i = 0; i < image.texel_count() * 3; ++i) image.pixels.push_back(static_cast<float>(i % 97) / 9.0f);
    EXPECT_TRUE(write_exr(path, make_layered_image(image)));
    std::string text = read_text(path);
    std::filesystem::remove(path);
    return text;
}

// A baseline JPEG of 8 x 8 gray pixels with the shortest possible tables: one code for "no difference", one for "end".
std::string sample_jpeg() {
    std::string text("\xff\xd8", 2);
    text += std::string("\xff\xdb\x00\x43\x00", 5) + std::string(64, '\x01');
    text += std::string("\xff\xc0\x00\x0b\x08\x00\x08\x00\x08\x01\x01\x11\x00", 13);
    std::string counts(16, '\0');
    counts[0] = 1;
    text += std::string("\xff\xc4\x00\x14\x00", 5) + counts + std::string(1, '\0');
    text += std::string("\xff\xc4\x00\x14\x10", 5) + counts + std::string(1, '\0');
    text += std::string("\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00", 10);
    text += std::string("\x3f\xff\xd9", 3);
    return text;
}

std::string sample_radiance() {
    std::string text = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 16\n";
    for (int y = 0; y < 4; ++y) {
        text += std::string("\x02\x02\x00\x10", 4);
        for (int c = 0; c < 4; ++c) text += std::string("\x90\x81", 2);
    }
    return text;
}

std::vector<std::pair<std::string, std::string>> samples() {
    return {{"PNG", sample_png()}, {"JPEG", sample_jpeg()}, {"Radiance HDR", sample_radiance()},
            {"OpenEXR", sample_exr()}};
}

std::size_t peak_memory_bytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<std::size_t>(usage.ru_maxrss) * 1024;
}

TEST(ImageDamageTest, SamplesAreSound) {
    for (const auto& [name, text] : samples()) {
        const auto image = read_image(file_bytes(text), name);
        EXPECT_TRUE(image) << image.error().message();
    }
}

TEST(ImageDamageTest, EveryTruncationIsAnErrorThatNamesTheFile) {
    for (const auto& [name, text] : samples()) {
        for (std::size_t length = 0; length < text.size(); length += length < 200 ? 1 : 37) {
            const auto image = read_image(file_bytes(text.substr(0, length)), "cut.file");
            ASSERT_FALSE(image) << name << " cut to " << length << " of " << text.size() << " bytes was read";
            EXPECT_THAT(image.error().message(), HasSubstr("'cut.file'"));
            EXPECT_EQ(image.error().code, ErrorCode::parse) << image.error().message();
        }
    }
}

TEST(ImageDamageTest, RandomDamageNeverCrashes) {
    std::mt19937 random(1234);
    for (const auto& [name, text] : samples()) {
        for (int round = 0; round < 3000; ++round) {
            std::string damaged = text;
            const unsigned count = 1 + random() % 4;
            for (unsigned i = 0; i < count; ++i) damaged[random() % damaged.size()] = static_cast<char>(random());
            const auto image = read_image(file_bytes(damaged), "damaged", {.max_pixels = 1 << 22});
            if (image) EXPECT_EQ(image->pixels.size(), image->texel_count() * image->channels);
            else EXPECT_FALSE(image.error().message().empty());
        }
    }
}

TEST(ImageDamageTest, HugeClaimsAreRefusedBeforeMemoryIsTaken) {
    const std::size_t before = peak_memory_bytes();
    std::string png = sample_png();
    const auto set_big_endian = [](std::string& text, std::size_t at, std::uint32_t value, int bytes) {
        for (int i = 0; i < bytes; ++i) text[at + std::size_t(i)] = static_cast<char>(value >> (8 * (bytes - 1 - i)));
    };
    // IHDR with 16384 x 16384 and a correct checksum, so that only the size is wrong.
    set_big_endian(png, 16, 16384, 4);
    set_big_endian(png, 20, 16384, 4);
    std::uint32_t crc = 0xffffffff;
    for (std::size_t i = 12; i < 29; ++i) {
        crc ^= static_cast<std::uint8_t>(png[i]);
        for (int bit = 0; bit < 8; ++bit) crc = crc & 1 ? crc >> 1 ^ 0xedb88320 : crc >> 1;
    }
    set_big_endian(png, 29, ~crc, 4);
    const auto cannot_hold = read_image_bytes(file_bytes(png), "boast.png");
    ASSERT_FALSE(cannot_hold);
    EXPECT_THAT(cannot_hold.error().message(), HasSubstr("cannot hold 16384 x 16384"));

    std::string jpeg = sample_jpeg();
    set_big_endian(jpeg, jpeg.find("\xff\xc0") + 5, 0xffffffff, 4);
    std::string radiance = "#?RADIANCE\n\n-Y 2000000 +X 2000000\n";
    std::string exr = sample_exr();
    const std::size_t window = exr.find("dataWindow") + 11 + 6 + 4;
    std::memset(exr.data() + window + 8, 0x7e, 8);
    for (const auto& [name, text] : std::vector<std::pair<std::string, std::string>>{
             {"boast.jpg", jpeg}, {"boast.hdr", radiance}, {"boast.exr", exr}}) {
        const auto info = read_image_info(file_bytes(text), name);
        ASSERT_FALSE(info) << name;
        EXPECT_EQ(info.error().code, ErrorCode::out_of_memory) << info.error().message();
        EXPECT_THAT(info.error().message(), HasSubstr(name));
        EXPECT_FALSE(read_image(file_bytes(text), name));
    }
    EXPECT_LT(peak_memory_bytes() - before, std::size_t{100} << 20);
}

TEST(ImageDamageTest, AnExrHeaderThatSaysTwoThingsIsRefused) {
    for (const auto& [name, bytes] : {std::pair<std::string, std::size_t>{"dataWindow", 11 + 6 + 4 + 16},
                                      std::pair<std::string, std::size_t>{"channels", 9 + 7 + 4 + 3 * 18 + 1}}) {
        std::string exr = sample_exr();
        const std::size_t begin = exr.find(name);
        exr.insert(begin, exr.substr(begin, bytes));
        const auto image = read_image(file_bytes(exr), "twice.exr");
        ASSERT_FALSE(image);
        EXPECT_THAT(image.error().message(), HasSubstr("'" + name + "' occurs twice"));
    }
}

TEST(ImageDamageTest, LimitsOfTheCallerHold) {
    const std::string png = sample_png();
    for (const ImageLimits& limits :
         {ImageLimits{.max_width = 63}, ImageLimits{.max_height = 47}, ImageLimits{.max_pixels = 64 * 48 - 1}}) {
        const auto image = read_image_bytes(file_bytes(png), "large.png", {}, limits);
        ASSERT_FALSE(image);
        EXPECT_EQ(image.error().code, ErrorCode::out_of_memory);
        EXPECT_THAT(image.error().message(), HasSubstr("64 x 48"));
    }
}

TEST(ImageDamageTest, OtherFilesAreNamed) {
    const auto none = read_image("/nonexistent/a.png");
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().code, ErrorCode::not_found);
    EXPECT_THAT(none.error().message(), HasSubstr("'/nonexistent/a.png'"));
    const auto folder = read_image("/tmp");
    ASSERT_FALSE(folder);
    EXPECT_THAT(folder.error().message(), HasSubstr("folder"));
    const auto text = read_image(file_bytes("hello"), "a.txt");
    ASSERT_FALSE(text);
    EXPECT_THAT(text.error().message(), HasSubstr("no picture format"));
    const auto bytes = read_image_bytes(file_bytes(sample_radiance()), "sky.hdr");
    ASSERT_FALSE(bytes);
    EXPECT_EQ(bytes.error().code, ErrorCode::unsupported);
    EXPECT_FALSE(read_exr_layers(file_bytes(sample_png()), "a.png"));
}

}  // namespace
}  // namespace nacre
