// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "core/image.h"
#include "scene/builtin.h"
#include "scene/environment.h"
#include "tests/scene/gltf_builder.h"
#include "tests/scene/scene_checks.h"

namespace nacre::scene {
namespace {

/// A triangle with `count` different pictures, which are decoded on several threads.
GltfBuilder file_with_pictures(int count) {
    GltfBuilder file;
    for (int i = 0; i < count; ++i) {
        const std::vector<std::uint8_t> texels(4 * 32 * 32, static_cast<std::uint8_t>(i));
        const auto png = encode_png({.width = 32, .height = 32, .channels = 4, .bytes = texels});
        EXPECT_TRUE(png);
        file.json["images"].push_back({{"uri", "data:image/png;base64," + encode_base64(*png)}});
        file.json["textures"].push_back({{"source", i}});
        file.json["materials"].push_back({{"emissiveTexture", {{"index", i}}}});
    }
    file.primitive()["material"] = 0;
    return file;
}

TEST(Threads, ScenesAreLoadedOnSeveralThreadsAtOnce) {
    const GltfBuilder file = file_with_pictures(12);
    std::vector<Expected<Scene>> scenes(4);
    {
        std::vector<std::jthread> threads;
        for (Expected<Scene>& scene : scenes) {
            threads.emplace_back([&] { scene = file.load(); });
        }
    }
    for (const Expected<Scene>& scene : scenes) {
        ASSERT_TRUE(scene) << scene.error().message();
        expect_valid_scene(*scene);
        ASSERT_EQ(scene->images.size(), 12u);
        for (std::size_t i = 0; i < 12; ++i)
            EXPECT_EQ(scene->images[i].pixels->front(), i) << "pictures keep their order";
    }
}

TEST(Threads, BuiltinScenesAndTheStudioAreTheSameOnEveryThread) {
    std::vector<Expected<Scene>> scenes(3);
    {
        std::vector<std::jthread> threads;
        for (Expected<Scene>& scene : scenes) {
            threads.emplace_back([&] { scene = make_builtin_scene("builtin:lights"); });
        }
    }
    for (const Expected<Scene>& scene : scenes) {
        ASSERT_TRUE(scene);
        EXPECT_EQ(scene->environment.texels, studio_environment().texels);
        EXPECT_EQ(scene->meshes.front().primitives.front().positions,
                  scenes.front()->meshes.front().primitives.front().positions);
    }
}

TEST(Threads, TheErrorIsThatOfTheFirstBrokenPictureWhateverThreadFindsIt) {
    GltfBuilder file = file_with_pictures(8);
    for (const int broken : {3, 6}) {
        std::string uri = file.json["images"][broken]["uri"];
        uri[uri.size() - 30] = uri[uri.size() - 30] == 'A' ? 'B' : 'A';
        file.json["images"][broken]["uri"] = uri;
    }
    for (int run = 0; run < 20; ++run) {
        const Expected<Scene> scene = file.load();
        ASSERT_FALSE(scene);
        EXPECT_NE(scene.error().message().find("image 3"), std::string::npos) << scene.error().message();
    }
}

}  // namespace
}  // namespace nacre::scene
