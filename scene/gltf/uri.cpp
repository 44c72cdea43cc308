// SPDX-License-Identifier: Apache-2.0
#include "scene/gltf/uri.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>

#include "scene/gltf/failure.h"

namespace nacre::scene::gltf {
namespace {

constexpr std::array<std::int8_t, 256> make_base64_values() {
    std::array<std::int8_t, 256> values{};
    values.fill(-1);
    constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (std::size_t i = 0; i < digits.size(); ++i) {
        values[static_cast<unsigned char>(digits[i])] = static_cast<std::int8_t>(i);
    }
    return values;
}

constexpr std::array<std::int8_t, 256> base64_values = make_base64_values();

int hex_value(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

bool starts_with_ignoring_case(std::string_view text, std::string_view prefix) {
    return text.size() >= prefix.size() && std::equal(prefix.begin(), prefix.end(), text.begin(), [](char a, char b) {
               return a == static_cast<char>(std::tolower(static_cast<unsigned char>(b)));
           });
}

/// "http" of "http://..."; empty where there is no scheme.
std::string_view scheme_of(std::string_view uri) {
    const std::size_t colon = uri.find(':');
    if (colon == uri.npos || colon == 0 || !std::isalpha(static_cast<unsigned char>(uri[0]))) return {};
    for (const char c : uri.substr(0, colon)) {
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '+' && c != '-' && c != '.') return {};
    }
    return uri.substr(0, colon);
}

}  // namespace

std::optional<std::vector<std::byte>> decode_base64(std::string_view text) {
    std::size_t padding = 0;
    while (padding < 2 && !text.empty() && text.back() == '=') {
        text.remove_suffix(1);
        ++padding;
    }
    if (text.size() % 4 == 1 || (padding != 0 && (text.size() + padding) % 4 != 0)) return std::nullopt;

    std::vector<std::byte> bytes;
    bytes.reserve(text.size() / 4 * 3 + 2);
    std::uint32_t bits = 0;
    int bit_count = 0;
    for (const char c : text) {
        const std::int8_t value = base64_values[static_cast<unsigned char>(c)];
        if (value < 0) return std::nullopt;
        bits = (bits << 6) | static_cast<std::uint32_t>(value);
        bit_count += 6;
        if (bit_count >= 8) {
            bit_count -= 8;
            bytes.push_back(static_cast<std::byte>((bits >> bit_count) & 0xffu));
        }
    }
    return bytes;
}

std::optional<DataUri> parse_data_uri(std::string_view uri, std::string_view element) {
    if (!starts_with_ignoring_case(uri, "data:")) return std::nullopt;
    const std::size_t comma = uri.find(',');
    const std::string_view header = uri.substr(5, comma == uri.npos ? uri.npos : comma - 5);
    if (comma == uri.npos || !header.ends_with(";base64")) {
        reject(fmt::format("{}: its data URI is not in base64 ('{}')", element, printable(uri, 40)),
               "Write it as data:MIME-TYPE;base64,DATA.");
    }
    return DataUri{std::string(header.substr(0, header.find(';'))), uri.substr(comma + 1)};
}

std::filesystem::path path_of_uri(std::string_view uri, const std::filesystem::path& folder, std::string_view element) {
    const auto refuse = [&](std::string_view why, std::string_view remedy) {
        reject(fmt::format("{}: the URI '{}' {}", element, printable(uri), why), std::string(remedy),
               ErrorCode::invalid_argument);
    };
    if (const std::string_view scheme = scheme_of(uri); !scheme.empty()) {
        refuse(fmt::format("has the scheme '{}', and only files beside the scene are read", printable(scheme)),
               "Put the file into the scene's folder and refer to it by a relative path.");
    }

    std::string decoded;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        if (uri[i] != '%') {
            decoded += uri[i];
            continue;
        }
        const int high = i + 1 < uri.size() ? hex_value(uri[i + 1]) : -1;
        const int low = i + 2 < uri.size() ? hex_value(uri[i + 2]) : -1;
        if (high < 0 || low < 0) refuse("has a '%' that two hexadecimal digits do not follow", "Write '%' as %25.");
        decoded += static_cast<char>(high * 16 + low);
        i += 2;
    }

    const std::string_view stays_inside = "Keep all files of a scene in its folder or below it.";
    if (decoded.empty()) refuse("is empty", "Name a file.");
    if (decoded.find('\0') != decoded.npos) refuse("contains a zero byte", stays_inside);
    if (decoded.find('\\') != decoded.npos) refuse("contains a backslash", "Separate folders by '/'.");
    const std::filesystem::path relative(decoded);
    if (relative.is_absolute() || decoded.front() == '/') refuse("is an absolute path", stays_inside);
    if (std::find(relative.begin(), relative.end(), "..") != relative.end()) {
        refuse("leaves the folder of the scene by '..'", stays_inside);
    }
    if (folder.empty()) {
        refuse("names a file, but the scene was not read from a folder",
               "Embed the data, or load the scene by its path.");
    }
    return folder / relative;
}

}  // namespace nacre::scene::gltf
