// SPDX-License-Identifier: Apache-2.0
#include "core/disk_cache.h"

#include <gmock/gmock.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <optional>
#include <thread>

#include "core/file.h"
#include "core/log.h"
#include "tests/core/temporary_folder.h"

namespace nacre {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::byte> bytes_of(std::string_view text) {
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}

/// The one file below a folder.
fs::path only_file(const fs::path& folder) {
    fs::path found;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (entry.is_regular_file()) {
            EXPECT_TRUE(found.empty());
            found = entry.path();
        }
    return found;
}

class DiskCacheTest : public testing::Test {
  protected:
    DiskCacheTest() {
        previous_ = set_log_callback([this](LogLevel level, std::string_view message) {
            if (level == LogLevel::warning) warnings_.emplace_back(message);
        });
    }
    ~DiskCacheTest() override { set_log_callback(previous_); }

    TemporaryFolder folder_;
    DiskCache cache_{folder_.path() / "cache"};
    std::vector<std::string> warnings_;
    LogCallback previous_;
};

TEST_F(DiskCacheTest, KeepsContentByCategoryAndKey) {
    EXPECT_FALSE(cache_.load("spirv", "key"));
    EXPECT_TRUE(cache_.store("spirv", "key", bytes_of("content")));
    EXPECT_TRUE(cache_.store("tables", "key", bytes_of("")));
    EXPECT_EQ(cache_.load("spirv", "key"), bytes_of("content"));
    EXPECT_EQ(cache_.load("tables", "key"), bytes_of(""));
    EXPECT_FALSE(cache_.load("spirv", "other key"));
    EXPECT_TRUE(cache_.store("spirv", "key", bytes_of("new")));
    EXPECT_EQ(cache_.load("spirv", "key"), bytes_of("new"));
    cache_.remove("spirv", hash128("key"));
    EXPECT_FALSE(cache_.load("spirv", "key"));
    EXPECT_THAT(warnings_, ElementsAre());
}

TEST_F(DiskCacheTest, ACategoryCannotLeaveTheFolder) {
    EXPECT_FALSE(cache_.store("../escape", "key", bytes_of("x")));
    EXPECT_FALSE(cache_.store("", "key", bytes_of("x")));
    EXPECT_FALSE(fs::exists(folder_.path() / "escape"));
}

TEST_F(DiskCacheTest, AnEntryWithAnyByteChangedIsMissingAndRemoved) {
    cache_.store("spirv", "key", bytes_of("content"));
    const fs::path path = only_file(cache_.directory());
    const std::vector<std::byte> whole = read_binary_file(path).value();
    for (std::size_t i = 0; i < whole.size(); ++i) {
        std::vector<std::byte> damaged = whole;
        damaged[i] ^= std::byte{0x10};
        ASSERT_TRUE(write_file_atomically(path, damaged));
        EXPECT_FALSE(cache_.load("spirv", "key")) << "byte " << i;
        EXPECT_FALSE(fs::exists(path)) << "byte " << i;
    }
    ASSERT_TRUE(write_file_atomically(path, whole));
    EXPECT_TRUE(cache_.load("spirv", "key"));
}

TEST_F(DiskCacheTest, ATruncatedOrLengthenedEntryIsMissingAndRemoved) {
    cache_.store("spirv", "key", bytes_of("content"));
    const fs::path path = only_file(cache_.directory());
    std::vector<std::byte> whole = read_binary_file(path).value();
    for (std::size_t length = 0; length < whole.size(); ++length) {
        ASSERT_TRUE(write_file_atomically(path, std::span(whole).first(length)));
        EXPECT_FALSE(cache_.load("spirv", "key")) << length << " bytes";
        EXPECT_FALSE(fs::exists(path));
    }
    whole.push_back(std::byte{0});
    ASSERT_TRUE(write_file_atomically(path, whole));
    EXPECT_FALSE(cache_.load("spirv", "key"));
}

TEST_F(DiskCacheTest, AnEntryOfAnotherKeyIsForeign) {
    cache_.store("spirv", "first", bytes_of("content of first"));
    const fs::path first = only_file(cache_.directory());
    const fs::path second = first.parent_path() / (hash128("second").to_string() + ".entry");
    fs::copy(first, second);
    EXPECT_FALSE(cache_.load("spirv", "second"));
    EXPECT_FALSE(fs::exists(second));
    EXPECT_TRUE(cache_.load("spirv", "first"));
}

TEST_F(DiskCacheTest, ProcessesThatWriteTheSameEntriesNeverReadDamage) {
    constexpr int process_count = 4;
    constexpr int rounds = 100;
    // Content depends on the key alone, but its length and writer vary: a torn entry cannot pass for a whole one.
    const auto content = [](int key, int process) {
        return bytes_of(
            std::string(static_cast<std::size_t>(20000 + key * 100 + process), static_cast<char>('a' + process)));
    };
    std::vector<pid_t> children;
    for (int process = 0; process < process_count; ++process) {
        const pid_t child = fork();
        if (child == 0) {
            int failures = 0;
            for (int round = 0; round < rounds; ++round) {
                const int key = round % 3;
                if (!cache_.store("shared", std::to_string(key), content(key, process))) ++failures;
                const auto loaded = cache_.load("shared", std::to_string(key));
                bool is_one_of_them = false;
                for (int writer = 0; loaded && writer < process_count; ++writer)
                    is_one_of_them |= *loaded == content(key, writer);
                if (!is_one_of_them) ++failures;
            }
            _exit(failures > 0 ? 1 : 0);
        }
        children.push_back(child);
    }
    for (const pid_t child : children) {
        int status = 0;
        ASSERT_EQ(waitpid(child, &status, 0), child);
        EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
    EXPECT_EQ(cache_.entries(), 3U);
}

TEST_F(DiskCacheTest, AFolderThatCannotBeMadeGivesOneWarningAndNoCache) {
    // Below an ordinary file nobody can make a folder, not even root.
    ASSERT_TRUE(write_file_atomically(folder_.path() / "file", "x"));
    const DiskCache cache(folder_.path() / "file" / "cache");
    const DiskCache same(folder_.path() / "file" / "cache");
    for (int i = 0; i < 3; ++i) {
        EXPECT_FALSE(cache.load("spirv", "key"));
        EXPECT_FALSE(cache.store("spirv", "key", bytes_of("x")));
        EXPECT_FALSE(same.store("spirv", "key", bytes_of("x")));
    }
    EXPECT_THAT(warnings_, ElementsAre(HasSubstr("file/cache' cannot be used: ")));
    EXPECT_EQ(cache.size(), 0U);
    EXPECT_EQ(cache.purge(), 0U);
}

TEST_F(DiskCacheTest, AReadOnlyFolderGivesOneWarningAndNoCache) {
    const DiskCache cache("/proc/self/nacre-cache");
    EXPECT_FALSE(cache.store("spirv", "key", bytes_of("x")));
    EXPECT_FALSE(cache.store("spirv", "key", bytes_of("x")));
    EXPECT_FALSE(cache.load("spirv", "key"));
    EXPECT_EQ(warnings_.size(), 1U);
}

TEST_F(DiskCacheTest, AFolderThatVanishesIsMadeAgain) {
    EXPECT_TRUE(cache_.store("spirv", "key", bytes_of("x")));
    fs::remove_all(cache_.directory());
    EXPECT_FALSE(cache_.load("spirv", "key"));
    EXPECT_TRUE(cache_.store("spirv", "key", bytes_of("y")));
    EXPECT_EQ(cache_.load("spirv", "key"), bytes_of("y"));
    EXPECT_THAT(warnings_, ElementsAre());
}

TEST_F(DiskCacheTest, ReportsAndPurgesItsOwnEntriesAlone) {
    cache_.store("spirv", "a", bytes_of("1"));
    cache_.store("spirv", "b", bytes_of("22"));
    cache_.store("tables", "a", bytes_of("333"));
    ASSERT_TRUE(write_file_atomically(cache_.directory() / "spirv" / "notes.txt", "mine"));
    ASSERT_TRUE(write_file_atomically(cache_.directory() / "other.txt", "mine"));
    const auto usage = cache_.usage();
    ASSERT_EQ(usage.size(), 2U);
    EXPECT_EQ(usage[0].category, "spirv");
    EXPECT_EQ(usage[0].entries, 2U);
    EXPECT_EQ(usage[1].bytes, 64U + 3U);
    EXPECT_EQ(cache_.entries(), 3U);
    EXPECT_EQ(cache_.size(), 3 * 64U + 6U);

    EXPECT_EQ(cache_.purge(), 3 * 64U + 6U);
    EXPECT_EQ(cache_.entries(), 0U);
    EXPECT_FALSE(cache_.load("spirv", "a"));
    EXPECT_TRUE(fs::exists(cache_.directory() / "spirv" / "notes.txt"));
    EXPECT_TRUE(fs::exists(cache_.directory() / "other.txt"));
    EXPECT_FALSE(fs::exists(cache_.directory() / "tables"));
}

TEST_F(DiskCacheTest, ShrinkingRemovesWhatWasLongestNotUsed) {
    for (const char* key : {"a", "b", "c"}) cache_.store("spirv", key, bytes_of(key));
    const auto age = [&](const char* key, int hours) {
        fs::last_write_time(cache_.directory() / "spirv" / (hash128(key).to_string() + ".entry"),
                            fs::file_time_type::clock::now() - std::chrono::hours(hours));
    };
    age("a", 3);
    age("b", 2);
    age("c", 1);
    EXPECT_TRUE(cache_.load("spirv", "a"));  // Now the one used last.
    EXPECT_EQ(cache_.shrink_to(2 * 65), 65U);
    EXPECT_TRUE(cache_.load("spirv", "a"));
    EXPECT_FALSE(cache_.load("spirv", "b"));
    EXPECT_TRUE(cache_.load("spirv", "c"));
}

TEST_F(DiskCacheTest, AFolderOverTheLimitIsCutToHalfOncePerRun) {
    setenv("NACRE_CACHE_LIMIT_MB", "1", 1);
    const std::string large(400 << 10, 'x');
    // Made as another process would: the first store of this process is the one that looks.
    const pid_t child = fork();
    if (child == 0) {
        setenv("NACRE_CACHE_LIMIT_MB", "0", 1);
        for (const char* key : {"a", "b", "c"}) cache_.store("spirv", key, bytes_of(large));
        _exit(0);
    }
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    EXPECT_EQ(cache_.entries(), 3U);
    const auto old = cache_.directory() / "spirv" / (hash128("c").to_string() + ".entry");
    fs::last_write_time(old, fs::file_time_type::clock::now() - std::chrono::hours(1));

    cache_.store("spirv", "d", bytes_of("small"));
    EXPECT_LE(cache_.size(), 512U << 10);
    EXPECT_TRUE(cache_.load("spirv", "d"));
    EXPECT_FALSE(cache_.load("spirv", "c"));
    unsetenv("NACRE_CACHE_LIMIT_MB");
}

TEST(DiskCacheDirectory, ComesFromTheEnvironment) {
    const char* const names[] = {"NACRE_CACHE_DIR", "XDG_CACHE_HOME", "HOME"};
    std::vector<std::optional<std::string>> saved;
    for (const char* name : names)
        saved.push_back(getenv(name) ? std::optional<std::string>(getenv(name)) : std::nullopt);

    for (const char* name : names) unsetenv(name);
    EXPECT_EQ(DiskCache::default_directory(), fs::path());
    EXPECT_FALSE(DiskCache().is_on());
    EXPECT_FALSE(DiskCache().store("spirv", "key", {}));
    setenv("HOME", "/home/somebody", 1);
    EXPECT_EQ(DiskCache::default_directory(), "/home/somebody/.cache/nacre");
    setenv("XDG_CACHE_HOME", "/caches", 1);
    EXPECT_EQ(DiskCache::default_directory(), "/caches/nacre");
    setenv("NACRE_CACHE_DIR", "here", 1);
    EXPECT_EQ(DiskCache::default_directory(), "here");
    setenv("NACRE_CACHE_DIR", "off", 1);
    EXPECT_FALSE(DiskCache().is_on());
    setenv("NACRE_CACHE_DIR", "", 1);
    EXPECT_FALSE(DiskCache().is_on());

    for (std::size_t i = 0; i < saved.size(); ++i)
        saved[i] ? setenv(names[i], saved[i]->c_str(), 1) : unsetenv(names[i]);
}

}  // namespace
}  // namespace nacre
