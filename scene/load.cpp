// SPDX-License-Identifier: Apache-2.0
#include "scene/load.h"

#include <filesystem>

#include "core/file.h"
#include "scene/builtin.h"

namespace nacre::scene {

Expected<Scene> load_scene(const std::string& path_or_name, const LoadOptions& options) {
    if (path_or_name.starts_with("builtin:")) {
        NACRE_TRY(Scene scene, make_builtin_scene(path_or_name));
        scene.time = options.time.value_or(0.0f);
        return scene;
    }
    const std::filesystem::path path(path_or_name);
    auto bytes = read_binary_file(path, options.limits.file_bytes);
    if (!bytes) {
        return fail(bytes.error().code, "load scene", "'" + path_or_name + "'", bytes.error().reason,
                    "Name a .gltf or .glb file, or a built-in scene such as builtin:spheres.");
    }
    const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
    return load_gltf(*bytes, path_or_name, folder.string(), options);
}

}  // namespace nacre::scene
