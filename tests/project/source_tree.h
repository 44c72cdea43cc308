// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/file.h"

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace nacre {

/// The root of the source tree that this test was built from.
inline const std::filesystem::path source_root = NACRE_SOURCE_DIR;

/// The folders that hold source code, in no order.
inline constexpr std::string_view source_folders[] = {
    "core", "rhi", "backends", "materials", "scene", "raytracing", "passes", "measure", "samples", "tests", "cmake"};

/// Paths below the root of all files of the source folders with one of these endings, sorted.
inline std::vector<std::string> source_files(std::initializer_list<std::string_view> endings) {
    std::vector<std::string> files;
    for (std::string_view folder : source_folders) {
        if (!std::filesystem::exists(source_root / folder)) continue;
        for (const auto& entry : std::filesystem::recursive_directory_iterator(source_root / folder)) {
            const std::string path = entry.path().lexically_relative(source_root).generic_string();
            if (std::ranges::any_of(endings, [&](std::string_view ending) { return path.ends_with(ending); }) &&
                entry.is_regular_file())
                files.push_back(path);
        }
    }
    std::ranges::sort(files);
    return files;
}

inline std::string text_of(const std::string& path) { return read_text_file(source_root / path).value_or(""); }

}  // namespace nacre
