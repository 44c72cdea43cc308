// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>

#include "scene/scene.h"

/// @file
/// A camera as shaders see it: CameraBlock of passes/shared/camera.glsl. Clip space as in docs/conventions.md (y down),
/// depth reversed: 1 at the near plane, 0 far away.
///
///     CameraBlock block = camera_block(camera, 1280, 720);

namespace nacre::passes {

struct CameraBlock {
    glm::mat4 view_projection{1.0f};
    glm::mat4 world{1.0f};
    glm::vec4 position{0.0f};    ///< w: 1 for an orthographic camera.
    glm::vec4 projection{1.0f};  ///< Half extents (at distance 1), then depth = z + w / distance or z * distance + w.
    glm::vec4 size{1.0f};        ///< Pixels and their inverse.
};

/// The vertical extent of the camera is kept, the horizontal one follows from the picture. Distances that make no sense
/// (near <= 0, far <= near) are replaced.
CameraBlock camera_block(const scene::Camera& camera, std::uint32_t width, std::uint32_t height);

/// The block of a view that only needs a matrix (shadow maps).
CameraBlock matrix_block(const glm::mat4& view_projection);

}  // namespace nacre::passes
