// SPDX-License-Identifier: Apache-2.0
#include "scene/load.h"

#include "scene/builtin.h"

namespace nacre::scene {

Expected<Scene> load_scene(const std::string& path_or_name, const LoadOptions& options) {
    if (path_or_name.starts_with("builtin:")) {
        NACRE_TRY(Scene scene, make_builtin_scene(path_or_name));
        scene.time = options.time;
        return scene;
    }
    return fail(ErrorCode::unsupported, "load scene", "'" + path_or_name + "'", "files cannot be read yet");
}

}  // namespace nacre::scene
