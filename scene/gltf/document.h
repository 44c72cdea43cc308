// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/gltf/failure.h"
#include "scene/gltf/json.h"
#include "scene/load.h"

/// @file
/// A glTF file while it is imported: its JSON, its buffers (read when first used), its limits and its warnings.
/// Internal to scene/gltf/; functions may throw `Rejected`. Not thread-safe.

namespace nacre::scene::gltf {

/// Bytes of a bufferView.
struct ViewBytes {
    std::span<const std::byte> bytes;
    std::size_t stride = 0;         ///< 0: elements follow each other.
    std::size_t buffer_offset = 0;  ///< Of the first byte in its buffer, for alignment checks.
};

class Document {
  public:
    /// Splits a .glb, parses the JSON and checks the asset version and the required extensions. `bytes` must outlive
    /// the document.
    Document(std::span<const std::byte> bytes, std::filesystem::path folder, const LoadOptions& options);

    [[nodiscard]] JsonView root() const { return json_.root(); }
    [[nodiscard]] const LoadOptions& options() const { return options_; }
    [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
    Warnings& warnings() { return warnings_; }

    /// Elements of a top-level array ("meshes", "nodes", ...), empty where absent.
    [[nodiscard]] const std::vector<JsonView>& list(std::string_view name);

    /// An object of the file's top-level "extensions", if it is there.
    [[nodiscard]] std::optional<JsonView> extension(std::string_view name) const;

    /// Bytes of a bufferView; loads its buffer.
    ViewBytes view(std::size_t index);

    /// Reads a whole file named by a URI of the scene.
    [[nodiscard]] std::vector<std::byte> read_file(std::string_view uri, const std::string& element) const;

    /// States that `bytes` of memory are about to be used for geometry or animation; rejected, naming `element`, where
    /// the scene as a whole goes beyond what its size can justify.
    void charge_geometry(std::uint64_t bytes, std::string_view element);

    /// The same for decoded pictures.
    void charge_image(std::uint64_t bytes, std::string_view element);

  private:
    struct Buffer {
        bool loaded = false;
        std::vector<std::byte> owned;
        std::span<const std::byte> bytes;
    };

    void read_container(std::span<const std::byte> bytes);
    void check_asset() const;
    void check_extensions();
    const Buffer& buffer(std::size_t index);

    std::filesystem::path folder_;
    LoadOptions options_;
    Warnings warnings_;
    JsonDocument json_;
    std::span<const std::byte> binary_chunk_;
    bool has_binary_chunk_ = false;
    std::map<std::string, std::vector<JsonView>, std::less<>> lists_;
    std::vector<Buffer> buffers_;
    std::uint64_t source_bytes_ = 0;  ///< Of the file itself and all buffers so far.
    std::uint64_t geometry_bytes_ = 0;
    std::uint64_t image_bytes_ = 0;
};

/// Name of an element of the file, for messages: label("mesh", index, its "name").
std::string label(std::string_view kind, std::size_t index, const JsonView& element);

}  // namespace nacre::scene::gltf
