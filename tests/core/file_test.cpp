// SPDX-License-Identifier: Apache-2.0
#include "core/file.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <atomic>
#include <fstream>
#include <thread>

#include "tests/core/temporary_folder.h"

namespace nacre {
namespace {

using testing::HasSubstr;

TEST(File, WhatWasWrittenIsRead) {
    const TemporaryFolder folder;
    const auto path = folder.path() / "made" / "on" / "the way" / "a.txt";
    const std::string text("zero \0 inside", 13);
    ASSERT_TRUE(write_file_atomically(path, text));
    EXPECT_EQ(read_text_file(path).value(), text);
    EXPECT_EQ(read_binary_file(path)->size(), text.size());
    ASSERT_TRUE(write_file_atomically(path, std::string_view()));
    EXPECT_EQ(read_text_file(path).value(), "");
    // Nothing but the file itself is left.
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(path.parent_path()), {}), 1);
}

TEST(File, ByteOrderMarkIsDropped) {
    const TemporaryFolder folder;
    ASSERT_TRUE(write_file_atomically(folder.path() / "a", "\xEF\xBB\xBFtext"));
    EXPECT_EQ(read_text_file(folder.path() / "a").value(), "text");
    EXPECT_EQ(read_binary_file(folder.path() / "a")->size(), 7U);
}

TEST(File, ErrorsNameTheFileAndTheReason) {
    const TemporaryFolder folder;
    auto missing = read_text_file(folder.path() / "missing.txt");
    ASSERT_FALSE(missing);
    EXPECT_EQ(missing.error().code, ErrorCode::not_found);
    EXPECT_THAT(missing.error().message(), HasSubstr("missing.txt': No such file or directory"));

    auto is_folder = read_text_file(folder.path());
    ASSERT_FALSE(is_folder);
    EXPECT_THAT(is_folder.error().message(), HasSubstr("it is a folder"));

    ASSERT_TRUE(write_file_atomically(folder.path() / "large", std::string(1001, 'x')));
    EXPECT_TRUE(read_text_file(folder.path() / "large", 1001));
    auto large = read_text_file(folder.path() / "large", 1000);
    ASSERT_FALSE(large);
    EXPECT_EQ(large.error().code, ErrorCode::out_of_memory);
    EXPECT_THAT(large.error().message(), HasSubstr("it holds 1001 bytes but at most 1000"));

    // The folder would have to be made below an ordinary file.
    auto below_file = write_file_atomically(folder.path() / "large" / "below" / "a", "x");
    ASSERT_FALSE(below_file);
    EXPECT_THAT(below_file.error().message(), HasSubstr("Not a directory"));
}

TEST(File, FilesWithoutAKnownSizeAreReadUpToTheLimit) {
    // A file of /proc tells a size of zero.
    EXPECT_THAT(read_text_file("/proc/self/status").value(), HasSubstr("Name:"));
    auto endless = read_text_file("/dev/zero", 100000);
    ASSERT_FALSE(endless);
    EXPECT_EQ(endless.error().code, ErrorCode::out_of_memory);
}

TEST(File, ASparseFileOverTheLimitIsRefusedWithoutReadingIt) {
    const TemporaryFolder folder;
    { std::ofstream(folder.path() / "huge") << "x"; }
    std::filesystem::resize_file(folder.path() / "huge", std::uint64_t{1} << 40);
    auto huge = read_binary_file(folder.path() / "huge");
    ASSERT_FALSE(huge);
    EXPECT_EQ(huge.error().code, ErrorCode::out_of_memory);
}

TEST(File, AFullDiskIsAnError) {
    auto written = write_file_atomically("/dev/full", "x");
    ASSERT_FALSE(written);
    EXPECT_THAT(written.error().message(), HasSubstr("No space left on device"));
    struct stat status {};
    ASSERT_EQ(stat("/dev/full", &status), 0);
    EXPECT_TRUE(S_ISCHR(status.st_mode)) << "a device was replaced by a file";
}

TEST(File, ReadersNeverSeeAPart) {
    const TemporaryFolder folder;
    const auto path = folder.path() / "shared";
    ASSERT_TRUE(write_file_atomically(path, std::string(100000, '0')));
    std::atomic<bool> is_over = false;
    std::vector<std::jthread> writers;
    for (char c : {'1', '2'})
        writers.emplace_back([&, c] {
            while (!is_over) EXPECT_TRUE(write_file_atomically(path, std::string(100000 + c, c)));
        });
    for (int i = 0; i < 200; ++i) {
        auto text = read_text_file(path);
        ASSERT_TRUE(text) << text.error().message();
        const std::size_t length = text->front() == '0' ? 100000 : 100000 + text->front();
        EXPECT_EQ(*text, std::string(length, text->front()));
    }
    is_over = true;
}

}  // namespace
}  // namespace nacre
