// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

/// @file
/// Whole files, read and written in one call.
///
///     NACRE_TRY(std::string text, read_text_file("scene.gltf"));
///     NACRE_CHECK(write_file_atomically("out/report.json", report));
///
/// All functions are thread-safe.

namespace nacre {

/// The largest file that is read unless the caller says otherwise, in bytes.
inline constexpr std::uint64_t default_file_limit = std::uint64_t{4} << 30;

/// The bytes of a file. Errors: `not_found`; `input_output` with the system's reason; `out_of_memory` where it
/// holds more than `limit` bytes (found before anything is allocated where the system knows the size).
Expected<std::vector<std::byte>> read_binary_file(const std::filesystem::path& path,
                                                  std::uint64_t limit = default_file_limit);

/// As `read_binary_file`. The content is not checked to be UTF-8; a byte order mark of UTF-8 at the start is dropped.
Expected<std::string> read_text_file(const std::filesystem::path& path, std::uint64_t limit = default_file_limit);

/// Writes a file so that whoever opens `path`, in this or another process, sees the old content or the new
/// one, never a part: writes a temporary file beside it and renames that. Makes missing folders.
Expected<void> write_file_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
Expected<void> write_file_atomically(const std::filesystem::path& path, std::string_view text);

/// What the names of the temporary files of `write_file_atomically` begin with.
inline constexpr std::string_view temporary_file_prefix = ".nacre-temporary-";

}  // namespace nacre
