// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "core/error.h"
#include "scene/scene.h"

/// @file
/// From a name to a scene: a glTF 2.0 file (.gltf or .glb) or one of the built-in scenes (scene/builtin.h).
///
///     Expected<Scene> scene = load_scene("ToyCar.gltf", {.time = 0.5f});
///     if (!scene) return report(scene.error().message());
///     for (const std::string& warning : scene->warnings) print(warning);
///
/// Nothing in a file is trusted: sizes are checked against the bytes that exist and against `LoadLimits` before
/// anything is allocated, files beside the scene are found only in its own folder and below, and nothing is ever
/// fetched from a network. docs/scenes.md says what is read and what is done about what is wrong.
/// All functions are thread-safe.

namespace nacre::scene {

/// What a file may ask for. A file that asks for more is refused with an error that names the limit.
struct LoadLimits {
    std::uint64_t file_bytes = std::uint64_t{4} << 30;       ///< Of any one file that is read.
    std::uint64_t json_bytes = std::uint64_t{256} << 20;     ///< Of the JSON part.
    std::uint32_t json_depth = 64;                           ///< Nesting of JSON objects and arrays.
    std::uint64_t geometry_bytes = std::uint64_t{16} << 30;  ///< Of all vertices, indices and placements. A scene is
                                                             ///< also held to 256 MiB + 1024 times its own size.
    std::uint64_t image_bytes = std::uint64_t{8} << 30;      ///< Of all decoded pictures together.
    std::uint32_t image_side = 16384;                        ///< Texels along one side of a picture.
};

struct LoadOptions {
    std::optional<float> time;    ///< Seconds into the animation, clamped to its range; nothing: the pose at rest.
    std::uint32_t animation = 0;  ///< Which animation of the file moves the scene, where `time` is given.
    bool load_images = true;      ///< false: pictures are not decoded but 1 x 1 white (geometry tools, tests).
    LoadLimits limits;
};

/// Loads `path_or_name`: "builtin:NAME" or a path of a .gltf or .glb file.
/// Errors: file missing, damaged, unsafe or beyond the limits; an unknown required extension; an unknown built-in
/// name (the error lists the names there are).
[[nodiscard]] Expected<Scene> load_scene(const std::string& path_or_name, const LoadOptions& options = {});

/// Loads glTF from memory, as `load_scene` does from a file. `name` appears in messages; `folder` is where files named
/// by relative URIs are looked for; empty: such URIs are an error. Binary (.glb) content is recognized by itself.
[[nodiscard]] Expected<Scene> load_gltf(std::span<const std::byte> bytes, const std::string& name,
                                        const std::string& folder, const LoadOptions& options = {});

}  // namespace nacre::scene
