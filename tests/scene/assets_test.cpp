// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <set>

#include "scene/environment.h"
#include "scene/load.h"
#include "tests/scene/asset_folder.h"
#include "tests/scene/scene_checks.h"

namespace nacre::scene {
namespace {

class Assets : public testing::Test {
  protected:
    void SetUp() override {
        if (!asset_folder()) GTEST_SKIP() << "no sample scenes (NACRE_ASSETS or shared/assets beside the source tree)";
    }

    static Scene load(const std::string& path, const LoadOptions& options = {}) {
        auto scene = load_scene((*asset_folder() / path).string(), options);
        if (!scene) {
            ADD_FAILURE() << scene.error().message();
            return {};
        }
        return *std::move(scene);
    }
};

TEST_F(Assets, EverySceneLoadsAndIsValid) {
    int count = 0;
    for (const auto& file : scene_files(*asset_folder())) {
        SCOPED_TRACE(file);
        const Expected<Scene> scene = load_scene(file.string());
        ASSERT_TRUE(scene) << scene.error().message();
        expect_valid_scene(*scene);
        EXPECT_FALSE(scene->instances.empty());
        EXPECT_GT(world_bounds(*scene).radius(), 0.0f);
        ++count;
    }
    EXPECT_GE(count, 20);
}

TEST_F(Assets, AllSevenTopologiesBecomeLists) {
    const Scene scene = load("MeshPrimitiveModes/glTF/MeshPrimitiveModes.gltf");
    std::set<Topology> seen;
    for (const Mesh& mesh : scene.meshes) {
        for (const Primitive& primitive : mesh.primitives) seen.insert(primitive.topology);
    }
    EXPECT_EQ(seen.size(), 3u);
}

TEST_F(Assets, InstancingKeepsOneMeshAndManyTransforms) {
    const Scene scene = load("SimpleInstancing/glTF/SimpleInstancing.gltf");
    ASSERT_EQ(scene.instances.size(), 1u);
    EXPECT_EQ(scene.instances[0].transforms.size(), 125u);
}

TEST_F(Assets, SparseAccessorMovesItsVertices) {
    const Scene scene = load("SimpleSparseAccessor/glTF/SimpleSparseAccessor.gltf");
    // The dense part is a strip with y up to 1; three vertices are lifted above it.
    ASSERT_FALSE(scene.meshes.empty());
    EXPECT_GT(scene.meshes[0].primitives[0].bounds.maximum.y, 1.5f);
}

TEST_F(Assets, EnvironmentsAreRead) {
    for (const char* name : {"studio_small_03_1k.hdr", "venice_sunset_1k.hdr"}) {
        const Expected<Environment> environment = load_environment((*asset_folder() / "hdr" / name).string());
        ASSERT_TRUE(environment) << environment.error().message();
        EXPECT_EQ(environment->width, 1024u);
        EXPECT_EQ(environment->height, 512u);
        EXPECT_EQ(environment->texels.size(), 1024u * 512u);
    }
}

}  // namespace
}  // namespace nacre::scene
