// SPDX-License-Identifier: Apache-2.0
#include "passes/camera_block.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

namespace nacre::passes {
namespace {

glm::vec3 projected(const CameraBlock& block, const glm::vec3& point) {
    const glm::vec4 clip = block.view_projection * glm::vec4(point, 1.0f);
    return glm::vec3(clip) / clip.w;
}

TEST(CameraBlock, DepthIsReversedAndInvertible) {
    scene::Camera camera;
    camera.near_distance = 0.5f;
    for (const float far_distance : {100.0f, std::numeric_limits<float>::infinity()}) {
        camera.far_distance = far_distance;
        const CameraBlock block = camera_block(camera, 200, 100);
        EXPECT_NEAR(projected(block, {0, 0, -0.5f}).z, 1.0f, 1e-6f);
        for (const float distance : {0.7f, 3.0f, 50.0f, 99.0f}) {
            const float depth = projected(block, {0.1f, 0.2f, -distance}).z;
            // As view_distance in passes/shared/camera.glsl.
            EXPECT_NEAR(block.projection.w / (depth - block.projection.z), distance, 1e-3f * distance);
        }
    }
    camera.far_distance = 100.0f;
    EXPECT_NEAR(projected(camera_block(camera, 200, 100), {0, 0, -100.0f}).z, 0.0f, 1e-6f);
}

TEST(CameraBlock, OrthographicDepthIsLinear) {
    scene::Camera camera{.projection = scene::Projection::orthographic};
    camera.near_distance = 1.0f;
    camera.far_distance = 5.0f;
    const CameraBlock block = camera_block(camera, 100, 100);
    EXPECT_NEAR(projected(block, {0, 0, -1.0f}).z, 1.0f, 1e-6f);
    EXPECT_NEAR(projected(block, {0, 0, -3.0f}).z, 0.5f, 1e-6f);
    EXPECT_NEAR(projected(block, {0, 0, -5.0f}).z, 0.0f, 1e-6f);
    EXPECT_EQ(block.position.w, 1.0f);
}

TEST(CameraBlock, UpIsUpOnThePicture) {
    const CameraBlock block = camera_block(scene::Camera{}, 100, 100);
    EXPECT_LT(projected(block, {0, 1, -5}).y, 0.0f);  // rows are counted from the top
    EXPECT_GT(projected(block, {1, 0, -5}).x, 0.0f);
}

TEST(CameraBlock, WidthFollowsThePicture) {
    scene::Camera camera;
    camera.vertical_field_of_view = 1.0f;
    const CameraBlock wide = camera_block(camera, 400, 100);
    EXPECT_NEAR(wide.projection.x, 4.0f * wide.projection.y, 1e-5f);
    EXPECT_NEAR(wide.projection.y, std::tan(0.5f), 1e-6f);
}

TEST(CameraBlock, SenselessCamerasGiveFiniteMatrices) {
    scene::Camera camera;
    camera.near_distance = 0.0f;
    camera.far_distance = -1.0f;
    camera.vertical_field_of_view = 0.0f;
    for (const auto projection : {scene::Projection::perspective, scene::Projection::orthographic}) {
        camera.projection = projection;
        camera.half_height = 0.0f;
        const CameraBlock block = camera_block(camera, 1, 1);
        for (int column = 0; column < 4; ++column) {
            for (int row = 0; row < 4; ++row) EXPECT_TRUE(std::isfinite(block.view_projection[column][row]));
        }
    }
}

}  // namespace
}  // namespace nacre::passes
