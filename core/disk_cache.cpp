// SPDX-License-Identifier: Apache-2.0
#include "core/disk_cache.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <system_error>

#include "core/file.h"
#include "core/log.h"

namespace nacre {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view entry_extension = ".entry";

/// What stands before the content. All fields in the byte order of the machine: a folder shared with a
/// machine of the other order gives entries that do not match, which are rebuilt.
struct Header {
    char magic[8];               // "NACRECAC"
    std::uint32_t version;       // Of this header's layout.
    std::uint32_t header_bytes;  // sizeof(Header)
    Hash128 key;                 // An entry that was renamed or copied to another name is foreign.
    std::uint64_t length;        // Of the content, in bytes.
    std::uint64_t reserved;      // 0
    Hash128 checksum;            // Of the key, the length and the content.
};
static_assert(sizeof(Header) == 64);
static_assert(std::is_trivially_copyable_v<Header>);

constexpr char magic[9] = "NACRECAC";
constexpr std::uint32_t format_version = 1;

Header header_for(const Hash128& key, std::span<const std::byte> content) {
    Header header{};
    std::memcpy(header.magic, magic, sizeof(header.magic));
    header.version = format_version;
    header.header_bytes = sizeof(Header);
    header.key = key;
    header.length = content.size();
    header.checksum = Hasher().add(key).add(header.length).add_bytes(content).finish();
    return header;
}

/// One warning for each folder and process, however many caches use it: the work goes on as well without.
void warn_once(const fs::path& directory, const std::string& reason) {
    static std::mutex mutex;
    static std::set<fs::path> warned;
    {
        std::lock_guard lock(mutex);
        if (!warned.insert(directory).second) return;
    }
    log_message(LogLevel::warning,
                fmt::format("cache folder '{}' cannot be used: {} Going on without it; set NACRE_CACHE_DIR to another "
                            "folder, or to 'off'.",
                            directory.native(), reason));
}

/// True the first time that this process asks for this folder.
bool is_first_time(const fs::path& directory) {
    static std::mutex mutex;
    static std::set<fs::path> seen;
    std::lock_guard lock(mutex);
    return seen.insert(directory).second;
}

std::uint64_t limit_bytes() {
    constexpr std::uint64_t default_megabytes = 2048;
    std::uint64_t megabytes = default_megabytes;
    if (const char* wanted = std::getenv("NACRE_CACHE_LIMIT_MB")) {
        const char* end = wanted + std::strlen(wanted);
        if (const auto [stop, error] = std::from_chars(wanted, end, megabytes); error != std::errc() || stop != end) {
            log_message(LogLevel::warning,
                        fmt::format("NACRE_CACHE_LIMIT_MB is '{}', which is no number of megabytes; taking {}", wanted,
                                    default_megabytes));
            megabytes = default_megabytes;
        }
    }
    if (megabytes == 0 || megabytes > (std::numeric_limits<std::uint64_t>::max() >> 20))
        return std::numeric_limits<std::uint64_t>::max();
    return megabytes << 20;
}

bool is_valid_category(std::string_view category) {
    return !category.empty() && std::ranges::all_of(category, [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    });
}

bool is_entry_name(const std::string& name) {
    return name.size() == 32 + entry_extension.size() && name.ends_with(entry_extension) &&
           name.find_first_not_of("0123456789abcdef") == 32;
}

struct Entry {
    fs::path path;
    std::string category;
    std::uint64_t bytes = 0;
    fs::file_time_type last_used;
    bool is_temporary = false;
};

/// Every file below `directory` that this cache made. Files may vanish meanwhile: what cannot be read is skipped.
std::vector<Entry> list_entries(const fs::path& directory) {
    std::vector<Entry> found;
    if (directory.empty()) return found;
    std::error_code error;
    for (fs::directory_iterator folder(directory, error), end; !error && folder != end; folder.increment(error)) {
        std::error_code folder_error;
        const std::string category = folder->path().filename().native();
        if (!is_valid_category(category) || !folder->is_directory(folder_error) || folder->is_symlink(folder_error))
            continue;
        for (fs::directory_iterator file(folder->path(), folder_error); !folder_error && file != end;
             file.increment(folder_error)) {
            const std::string name = file->path().filename().native();
            const bool is_temporary = name.starts_with(temporary_file_prefix);
            std::error_code file_error;
            if ((!is_entry_name(name) && !is_temporary) || !file->is_regular_file(file_error)) continue;
            Entry entry{file->path(), category, file->file_size(file_error), file->last_write_time(file_error),
                        is_temporary};
            if (!file_error) found.push_back(std::move(entry));
        }
    }
    return found;
}

/// Removes the given entries and returns the bytes freed.
std::uint64_t remove_entries(std::span<const Entry> entries) {
    std::uint64_t freed = 0;
    for (const Entry& entry : entries) {
        std::error_code error;
        if (fs::remove(entry.path, error)) freed += entry.bytes;
    }
    return freed;
}

}  // namespace

fs::path DiskCache::default_directory() {
    if (const char* directory = std::getenv("NACRE_CACHE_DIR"))
        return std::string_view(directory) == "off" ? fs::path() : fs::path(directory);
    // The XDG specification: a relative path there is invalid and ignored.
    if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache == '/') return fs::path(cache) / "nacre";
    if (const char* home = std::getenv("HOME"); home && *home == '/') return fs::path(home) / ".cache" / "nacre";
    return {};
}

DiskCache::DiskCache() : DiskCache(default_directory()) {}

DiskCache::DiskCache(fs::path directory) : directory_(std::move(directory)) {}

fs::path DiskCache::path_of(std::string_view category, const Hash128& key) const {
    return directory_ / category / (key.to_string() + std::string(entry_extension));
}

std::optional<std::vector<std::byte>> DiskCache::load(std::string_view category, std::string_view key) const {
    return load(category, hash128(key));
}

bool DiskCache::store(std::string_view category, std::string_view key, std::span<const std::byte> content) const {
    return store(category, hash128(key), content);
}

std::optional<std::vector<std::byte>> DiskCache::load(std::string_view category, const Hash128& key) const {
    if (!is_on() || !is_valid_category(category)) return {};
    const fs::path path = path_of(category, key);
    auto bytes = read_binary_file(path);
    if (!bytes) {
        if (bytes.error().code != ErrorCode::not_found) warn_once(directory_, bytes.error().message());
        return {};
    }

    bool is_whole = bytes->size() >= sizeof(Header);
    if (is_whole) {
        Header found;
        std::memcpy(&found, bytes->data(), sizeof(Header));
        const Header expected = header_for(key, std::span(*bytes).subspan(sizeof(Header)));
        is_whole = std::memcmp(&found, &expected, sizeof(Header)) == 0;
    }
    std::error_code error;
    if (!is_whole) {
        log_message(LogLevel::debug, fmt::format("cache entry '{}' is damaged or foreign; removed", path.native()));
        fs::remove(path, error);
        return {};
    }
    // The time of the last use, for `shrink_to`.
    fs::last_write_time(path, fs::file_time_type::clock::now(), error);
    bytes->erase(bytes->begin(), bytes->begin() + sizeof(Header));
    return *std::move(bytes);
}

bool DiskCache::store(std::string_view category, const Hash128& key, std::span<const std::byte> content) const {
    if (!is_on() || !is_valid_category(category)) return false;
    const Header header = header_for(key, content);
    std::vector<std::byte> bytes(sizeof(Header) + content.size());
    std::memcpy(bytes.data(), &header, sizeof(Header));
    if (!content.empty()) std::memcpy(bytes.data() + sizeof(Header), content.data(), content.size());
    if (auto written = write_file_atomically(path_of(category, key), bytes); !written) {
        warn_once(directory_, written.error().message());
        return false;
    }
    // Who only reads does not make the folder grow, so this is the place to look.
    if (is_first_time(directory_))
        if (const std::uint64_t limit = limit_bytes(); size() > limit) shrink_to(limit / 2);
    return true;
}

void DiskCache::remove(std::string_view category, const Hash128& key) const {
    if (!is_on() || !is_valid_category(category)) return;
    std::error_code error;
    fs::remove(path_of(category, key), error);
}

std::uint64_t DiskCache::size() const {
    std::uint64_t bytes = 0;
    for (const DiskCacheUsage& category : usage()) bytes += category.bytes;
    return bytes;
}

std::uint64_t DiskCache::entries() const {
    std::uint64_t count = 0;
    for (const DiskCacheUsage& category : usage()) count += category.entries;
    return count;
}

std::vector<DiskCacheUsage> DiskCache::usage() const {
    std::map<std::string, DiskCacheUsage> totals;
    for (const Entry& entry : list_entries(directory_)) {
        if (entry.is_temporary) continue;
        DiskCacheUsage& total = totals[entry.category];
        total.category = entry.category;
        total.entries += 1;
        total.bytes += entry.bytes;
    }
    std::vector<DiskCacheUsage> sorted;
    for (auto& [category, total] : totals) sorted.push_back(std::move(total));
    return sorted;
}

std::uint64_t DiskCache::purge() const {
    const std::vector<Entry> all = list_entries(directory_);
    const std::uint64_t freed = remove_entries(all);
    std::set<fs::path> folders;
    for (const Entry& entry : all) folders.insert(entry.path.parent_path());
    // `remove` leaves a folder that holds something else.
    std::error_code error;
    for (const fs::path& folder : folders) fs::remove(folder, error);
    return freed;
}

std::uint64_t DiskCache::shrink_to(std::uint64_t limit_bytes) const {
    std::vector<Entry> all = list_entries(directory_);
    // A temporary file may be in use by a process that is writing; after an hour, that process is gone.
    const auto an_hour_ago = fs::file_time_type::clock::now() - std::chrono::hours(1);
    std::erase_if(all, [&](const Entry& entry) { return entry.is_temporary && entry.last_used > an_hour_ago; });
    std::ranges::sort(all, {}, &Entry::last_used);
    std::uint64_t total = 0;
    for (const Entry& entry : all) total += entry.bytes;
    std::size_t count = 0;
    while (count < all.size() && total > limit_bytes) total -= all[count++].bytes;
    return remove_entries(std::span(all).first(count));
}

}  // namespace nacre
