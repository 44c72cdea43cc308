// SPDX-License-Identifier: Apache-2.0
#include "scene/builtin.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene/load.h"
#include "tests/scene/scene_checks.h"

namespace nacre::scene {
namespace {

TEST(Builtin, EveryNameMakesAValidScene) {
    ASSERT_GE(builtin_scene_names().size(), 6u);
    for (const std::string_view name : builtin_scene_names()) {
        SCOPED_TRACE(name);
        const Expected<Scene> scene = load_scene(std::string(name));
        ASSERT_TRUE(scene) << scene.error().message();
        expect_valid_scene(*scene);
        EXPECT_FALSE(scene->instances.empty());
        EXPECT_FALSE(builtin_scene_description(name).empty());
        EXPECT_TRUE(scene->warnings.empty());
    }
}

TEST(Builtin, AnUnknownNameIsAnErrorThatListsTheNames) {
    const Expected<Scene> scene = load_scene("builtin:teapot");
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().code, ErrorCode::not_found);
    EXPECT_THAT(scene.error().message(), testing::HasSubstr("builtin:spheres"));
    EXPECT_THAT(scene.error().message(), testing::HasSubstr("builtin:teapot"));
}

TEST(Builtin, FacesWindCounterClockwiseAgainstTheirNormals) {
    for (const std::string_view name : builtin_scene_names()) {
        SCOPED_TRACE(name);
        const Expected<Scene> scene = make_builtin_scene(name);
        ASSERT_TRUE(scene);
        for (const Mesh& mesh : scene->meshes) {
            for (const Primitive& p : mesh.primitives) {
                if (p.topology != Topology::triangle_list) continue;
                for (std::size_t i = 0; i < p.indices.size(); i += 3) {
                    const std::uint32_t a = p.indices[i], b = p.indices[i + 1], c = p.indices[i + 2];
                    const glm::vec3 face = glm::cross(p.positions[b] - p.positions[a], p.positions[c] - p.positions[a]);
                    ASSERT_GT(glm::dot(face, p.normals[a] + p.normals[b] + p.normals[c]), 0.0f) << mesh.name;
                }
            }
        }
    }
}

TEST(Builtin, SpheresCoverTheGridAndHaveAllLightKinds) {
    const Expected<Scene> scene = make_builtin_scene("builtin:spheres");
    ASSERT_TRUE(scene);
    float least_rough = 1, most_rough = 0, least_metal = 1, most_metal = 0;
    for (const auto& material : scene->materials) {
        least_rough = std::min(least_rough, material.roughness);
        most_rough = std::max(most_rough, material.roughness);
        least_metal = std::min(least_metal, material.metallic);
        most_metal = std::max(most_metal, material.metallic);
    }
    EXPECT_EQ(least_rough, 0.0f);
    EXPECT_EQ(most_rough, 1.0f);
    EXPECT_EQ(least_metal, 0.0f);
    EXPECT_EQ(most_metal, 1.0f);
    ASSERT_EQ(scene->lights.size(), 3u);
    EXPECT_NE(scene->lights[0].kind, scene->lights[1].kind);
    EXPECT_NE(scene->lights[1].kind, scene->lights[2].kind);
}

TEST(Builtin, TheGridHasAboutAQuarterOfAMillionTriangles) {
    const Expected<Scene> scene = make_builtin_scene("builtin:grid250k");
    ASSERT_TRUE(scene);
    EXPECT_NEAR(static_cast<double>(triangle_count(*scene)), 250'000.0, 1'000.0);
}

TEST(Builtin, TheAlphaSceneHasBothAlphaModesAndATexture) {
    const Expected<Scene> scene = make_builtin_scene("builtin:alpha");
    ASSERT_TRUE(scene);
    int masked = 0, blended = 0;
    for (const auto& material : scene->materials) {
        masked += material.alpha_mode == materials::AlphaMode::mask;
        blended += material.alpha_mode == materials::AlphaMode::blend;
    }
    EXPECT_GE(masked, 1);
    EXPECT_GE(blended, 3);
    ASSERT_FALSE(scene->images.empty());
    EXPECT_TRUE(scene->images[0].has_alpha);
}

TEST(Camera, FramingSeesEveryCornerAndIsNotFarAway) {
    Bounds bounds;
    bounds.add({-3.0f, 1.0f, 2.0f});
    bounds.add({5.0f, 1.5f, 9.0f});
    const Camera camera = framing_camera(bounds, 1.5f);
    const glm::mat4 view = glm::inverse(camera.world);
    const float tangent = std::tan(0.5f * camera.vertical_field_of_view);
    float largest = 0.0f;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::vec3 point(corner & 1 ? 5.0f : -3.0f, corner & 2 ? 1.5f : 1.0f, corner & 4 ? 9.0f : 2.0f);
        const glm::vec3 seen = glm::vec3(view * glm::vec4(point, 1.0f));
        EXPECT_LT(seen.z, -camera.near_distance);
        EXPECT_GT(seen.z, -camera.far_distance);
        largest =
            std::max({largest, std::abs(seen.x) / (-seen.z * tangent * 1.5f), std::abs(seen.y) / (-seen.z * tangent)});
    }
    EXPECT_LT(largest, 1.0f);
    EXPECT_GT(largest, 0.8f);
}

TEST(Camera, IsFoundByNameAndByIndex) {
    const Expected<Scene> scene = make_builtin_scene("builtin:triangle");
    ASSERT_TRUE(scene);
    EXPECT_EQ(find_camera(*scene, "main"), &scene->cameras[0]);
    EXPECT_EQ(find_camera(*scene, "0"), &scene->cameras[0]);
    EXPECT_EQ(find_camera(*scene, "1"), nullptr);
    EXPECT_EQ(find_camera(*scene, ""), nullptr);
    EXPECT_EQ(find_camera(*scene, "0x"), nullptr);
}

TEST(Bounds, EmptySceneHasEmptyBounds) {
    EXPECT_TRUE(world_bounds(Scene{}).empty());
    EXPECT_TRUE(is_finite(framing_camera(Bounds{}).world));
}

}  // namespace
}  // namespace nacre::scene
