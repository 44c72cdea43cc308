// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/hash.h"

/// @file
/// Results that are costly to make (compiled shaders, pipelines, tables), kept on disk between runs.
///
///     DiskCache cache;                                     // the user's cache folder
///     if (auto spirv = cache.load("spirv", key)) return *spirv;
///     ...compile...
///     cache.store("spirv", key, bytes);
///
/// A cache may be emptied at any time and never makes anything fail: an entry that is damaged, truncated, foreign or
/// of another format is removed and counts as missing; where the folder cannot be used, one warning is logged and
/// nothing is kept. A folder that has grown over the limit (NACRE_CACHE_LIMIT_MB in the environment, 2048 where it is
/// not set, 0 for none) is cut to half of it, least recently used entries first, once in each run. Any number of
/// threads and processes may use one folder. The key must name everything that the content depends on, the version of
/// the code that makes it included.

namespace nacre {

/// Totals of what a cache folder holds.
struct DiskCacheUsage {
    std::string category;
    std::uint64_t entries = 0;
    std::uint64_t bytes = 0;  ///< On disk, with headers.
};

class DiskCache {
  public:
    /// The folder of the user: environment variable NACRE_CACHE_DIR, else XDG_CACHE_HOME/nacre, else HOME/.cache/nacre.
    /// Empty where caching is off: NACRE_CACHE_DIR is `off` or empty, or none of the three variables is set.
    static std::filesystem::path default_directory();

    /// Uses `default_directory()`.
    DiskCache();
    /// Uses `directory`, which is made when first needed; an empty path means that nothing is kept.
    explicit DiskCache(std::filesystem::path directory);

    /// The content stored under this category (letters, digits, '-', '_') and key, if it is there and whole.
    [[nodiscard]] std::optional<std::vector<std::byte>> load(std::string_view category, const Hash128& key) const;
    /// As above; any text can be a key.
    [[nodiscard]] std::optional<std::vector<std::byte>> load(std::string_view category, std::string_view key) const;

    /// Keeps `content`; replaces what was there. Returns false where it could not (not an error for the caller).
    bool store(std::string_view category, const Hash128& key, std::span<const std::byte> content) const;
    bool store(std::string_view category, std::string_view key, std::span<const std::byte> content) const;

    /// Removes one entry, if it is there.
    void remove(std::string_view category, const Hash128& key) const;

    /// Whether anything is kept at all.
    [[nodiscard]] bool is_on() const { return !directory_.empty(); }
    /// Empty where nothing is kept.
    [[nodiscard]] const std::filesystem::path& directory() const { return directory_; }

    /// Bytes on disk over all entries.
    [[nodiscard]] std::uint64_t size() const;
    /// Number of entries.
    [[nodiscard]] std::uint64_t entries() const;
    /// Totals for each category, sorted by name.
    [[nodiscard]] std::vector<DiskCacheUsage> usage() const;

    /// Removes all entries and left-over temporary files, and nothing else that may lie in the folder.
    /// Returns the number of bytes freed.
    std::uint64_t purge() const;

    /// Removes the entries that were longest not used until at most `limit_bytes` are left. Returns the bytes freed.
    std::uint64_t shrink_to(std::uint64_t limit_bytes) const;

  private:
    [[nodiscard]] std::filesystem::path path_of(std::string_view category, const Hash128& key) const;

    std::filesystem::path directory_;
};

}  // namespace nacre
