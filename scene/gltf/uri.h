// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// @file
/// The URIs of a glTF file: data in the URI itself, or a file in the scene's own folder; nothing else is followed.
/// Internal to scene/gltf/; functions may throw `Rejected`.

namespace nacre::scene::gltf {

/// Bytes of standard base64 with or without padding; nullopt where a character or the length is wrong.
[[nodiscard]] std::optional<std::vector<std::byte>> decode_base64(std::string_view text);

struct DataUri {
    std::string mime_type;
    std::string_view payload;  ///< Base64 text inside the URI; valid while the URI lives.
};

/// The parts of "data:MIME;base64,PAYLOAD"; nullopt where `uri` is no data URI. Rejected where it is one, but not in
/// base64. `element` begins the message.
[[nodiscard]] std::optional<DataUri> parse_data_uri(std::string_view uri, std::string_view element);

/// The path of a relative URI below `folder`, percent-decoded. Rejected: other schemes, absolute paths, "..",
/// backslashes, zero bytes, and any URI where `folder` is empty.
[[nodiscard]] std::filesystem::path path_of_uri(std::string_view uri, const std::filesystem::path& folder,
                                                std::string_view element);

}  // namespace nacre::scene::gltf
