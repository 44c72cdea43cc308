// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

/// @file
/// Where the sample scenes are: the folder named by NACRE_ASSETS, or shared/assets beside the source tree.

namespace nacre {

/// Nothing where the folder does not exist; tests that need it are then skipped.
inline std::optional<std::filesystem::path> asset_folder() {
    const char* named = std::getenv("NACRE_ASSETS");
    const std::filesystem::path folder =
        named ? std::filesystem::path(named) : std::filesystem::path(NACRE_SOURCE_DIR) / ".." / "shared" / "assets";
    if (!std::filesystem::is_directory(folder)) return std::nullopt;
    return folder;
}

/// All .gltf and .glb files in `folder` and below, sorted.
inline std::vector<std::filesystem::path> scene_files(const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
        const auto extension = entry.path().extension();
        if (extension == ".gltf" || extension == ".glb") files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    return files;
}

}  // namespace nacre
