// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

#include "core/error.h"
#include "scene/scene.h"

/// @file
/// Scenes made by code, so that everything can be tried without a file.
///
///     Expected<Scene> scene = make_builtin_scene("builtin:spheres");
///     for (std::string_view name : builtin_scene_names()) print(name);
///
/// The same call gives the same bytes every time, on every machine with the same floating-point library.

namespace nacre::scene {

/// All names, with their prefix: "builtin:triangle", "builtin:spheres", ...
[[nodiscard]] std::span<const std::string_view> builtin_scene_names();

/// One sentence about a built-in scene, for help texts; empty for an unknown name.
[[nodiscard]] std::string_view builtin_scene_description(std::string_view name);

/// Makes a built-in scene. Error: unknown name (lists the names there are).
[[nodiscard]] Expected<Scene> make_builtin_scene(std::string_view name);

}  // namespace nacre::scene
