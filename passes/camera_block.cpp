// SPDX-License-Identifier: Apache-2.0
#include "passes/camera_block.h"

#include <algorithm>
#include <cmath>
#include <glm/matrix.hpp>

namespace nacre::passes {

CameraBlock camera_block(const scene::Camera& camera, std::uint32_t width, std::uint32_t height) {
    CameraBlock block;
    const float aspect = static_cast<float>(width) / static_cast<float>(height);
    glm::mat4 projection(0.0f);
    const bool orthographic = camera.projection == scene::Projection::orthographic;
    if (orthographic) {
        const float half_height = std::max(camera.half_height, 1e-6f), half_width = half_height * aspect;
        const float near_distance = camera.near_distance;
        float far_distance = camera.far_distance;
        if (!std::isfinite(far_distance) || far_distance <= near_distance) far_distance = near_distance + 1000.0f;
        const float range = far_distance - near_distance;
        projection[0][0] = 1.0f / half_width;
        projection[1][1] = -1.0f / half_height;
        projection[2][2] = 1.0f / range;
        projection[3][2] = far_distance / range;
        projection[3][3] = 1.0f;
        block.projection = {half_width, half_height, -1.0f / range, far_distance / range};
    } else {
        const float half_height = std::tan(0.5f * std::clamp(camera.vertical_field_of_view, 1e-3f, 3.1f));
        const float half_width = half_height * aspect;
        const float near_distance = camera.near_distance > 0.0f ? camera.near_distance : 0.01f;
        const float far_distance = camera.far_distance;
        const bool endless = !std::isfinite(far_distance) || far_distance <= near_distance;
        // depth = a + b / distance, 1 at the near plane, 0 at the far one.
        const float a = endless ? 0.0f : -near_distance / (far_distance - near_distance);
        const float b = endless ? near_distance : near_distance * (far_distance / (far_distance - near_distance));
        projection[0][0] = 1.0f / half_width;
        projection[1][1] = -1.0f / half_height;
        projection[2][2] = -a;
        projection[3][2] = b;
        projection[2][3] = -1.0f;
        block.projection = {half_width, half_height, a, b};
    }
    block.world = camera.world;
    block.view_projection = projection * glm::inverse(camera.world);
    block.position = glm::vec4(glm::vec3(camera.world[3]), orthographic ? 1.0f : 0.0f);
    const auto w = static_cast<float>(width), h = static_cast<float>(height);
    block.size = {w, h, 1.0f / w, 1.0f / h};
    return block;
}

CameraBlock matrix_block(const glm::mat4& view_projection) {
    CameraBlock block;
    block.view_projection = view_projection;
    return block;
}

}  // namespace nacre::passes
