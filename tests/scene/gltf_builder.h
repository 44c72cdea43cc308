// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "scene/load.h"

/// @file
/// Small glTF files made in memory, to be bent and broken by tests.
///
///     GltfBuilder file;                       // one triangle, one node, one scene
///     file.json["nodes"][0]["scale"] = {2, 2, 2};
///     Expected<Scene> scene = file.load();

namespace nacre::scene {

inline std::string encode_base64(const std::vector<std::byte>& bytes) {
    constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t bits = 0;
        const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
        for (std::size_t k = 0; k < 3; ++k) {
            bits = (bits << 8) | (k < count ? std::to_integer<std::uint32_t>(bytes[i + k]) : 0u);
        }
        for (std::size_t k = 0; k < 4; ++k) text += k <= count ? digits[(bits >> (18 - 6 * k)) & 63u] : '=';
    }
    return text;
}

inline std::span<const std::byte> as_bytes(std::string_view text) { return std::as_bytes(std::span(text)); }

inline Expected<Scene> load_text(std::string_view text, const LoadOptions& options = {}) {
    return load_gltf(as_bytes(text), "test.gltf", "", options);
}

class GltfBuilder {
  public:
    nlohmann::json json;
    std::vector<std::byte> data;

    /// A triangle (0,0,0), (1,0,0), (0,1,0) as mesh 0 "shape" with accessor 0, in node 0 "place".
    GltfBuilder() {
        json = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}};
        json["nodes"] = {{{"mesh", 0}, {"name", "place"}}};
        const int positions = add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
        json["meshes"] = {{{"name", "shape"}, {"primitives", {{{"attributes", {{"POSITION", positions}}}}}}}};
    }

    nlohmann::json& primitive() { return json["meshes"][0]["primitives"][0]; }

    /// Appends values as a bufferView and returns its index.
    template <typename T>
    int add_view(const std::vector<T>& values) {
        while (data.size() % 4 != 0) data.push_back(std::byte{0});
        const std::size_t offset = data.size();
        data.resize(offset + values.size() * sizeof(T));
        std::memcpy(data.data() + offset, values.data(), values.size() * sizeof(T));
        json["bufferViews"].push_back(
            {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", values.size() * sizeof(T)}});
        return static_cast<int>(json["bufferViews"].size() - 1);
    }

    /// Appends values as an accessor with a bufferView of its own and returns its index.
    template <typename T>
    int add_accessor(const std::vector<T>& values, const std::string& type, bool normalized = false) {
        const std::size_t components = type == "SCALAR" ? 1
                                       : type == "MAT4" ? 16
                                                        : static_cast<std::size_t>(type[3] - '0');
        nlohmann::json accessor = {{"bufferView", add_view(values)},
                                   {"componentType", component_type<T>()},
                                   {"count", values.size() / components},
                                   {"type", type}};
        if (normalized) accessor["normalized"] = true;
        json["accessors"].push_back(accessor);
        return static_cast<int>(json["accessors"].size() - 1);
    }

    template <typename T>
    static int component_type() {
        if constexpr (std::is_same_v<T, std::int8_t>) return 5120;
        if constexpr (std::is_same_v<T, std::uint8_t>) return 5121;
        if constexpr (std::is_same_v<T, std::int16_t>) return 5122;
        if constexpr (std::is_same_v<T, std::uint16_t>) return 5123;
        if constexpr (std::is_same_v<T, std::uint32_t>) return 5125;
        return 5126;
    }

    /// The file as JSON text, with its buffer as a data URI (unless a test has set "buffers" itself).
    [[nodiscard]] std::string text() const {
        nlohmann::json complete = json;
        if (!complete.contains("buffers")) {
            complete["buffers"] = {
                {{"byteLength", data.size()}, {"uri", "data:application/octet-stream;base64," + encode_base64(data)}}};
        }
        return complete.dump();
    }

    /// The file as .glb.
    [[nodiscard]] std::string binary() const {
        nlohmann::json complete = json;
        complete["buffers"] = {{{"byteLength", data.size()}}};
        std::string text = complete.dump();
        while (text.size() % 4 != 0) text += ' ';
        std::string chunk(reinterpret_cast<const char*>(data.data()), data.size());
        while (chunk.size() % 4 != 0) chunk += '\0';
        const auto word = [](std::size_t value) {
            std::string bytes;
            for (int i = 0; i < 4; ++i) bytes += static_cast<char>((value >> (8 * i)) & 0xff);
            return bytes;
        };
        return "glTF" + word(2) + word(12 + 8 + text.size() + 8 + chunk.size()) + word(text.size()) + "JSON" + text +
               word(chunk.size()) + std::string("BIN\0", 4) + chunk;
    }

    [[nodiscard]] Expected<Scene> load(const LoadOptions& options = {}) const { return load_text(text(), options); }
};

}  // namespace nacre::scene
