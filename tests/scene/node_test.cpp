// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/scene/gltf_builder.h"
#include "tests/scene/scene_checks.h"

namespace nacre::scene {
namespace {

using testing::HasSubstr;

constexpr float pi = std::numbers::pi_v<float>;

void expect_near(const glm::vec3& actual, const glm::vec3& expected, float tolerance = 1e-5f) {
    EXPECT_LT(glm::length(actual - expected), tolerance)
        << "(" << actual.x << ", " << actual.y << ", " << actual.z << ") is not (" << expected.x << ", " << expected.y
        << ", " << expected.z << ")";
}

glm::vec3 moved(const Scene& scene, const glm::vec3& point, std::size_t instance = 0, std::size_t transform = 0) {
    return glm::vec3(scene.instances.at(instance).transforms.at(transform) * glm::vec4(point, 1.0f));
}

TEST(Nodes, TransformsOfParentsApplyInOrder) {
    GltfBuilder file;
    file.json["nodes"] = nlohmann::json::parse(R"([
        {"children": [1], "translation": [10, 0, 0]},
        {"children": [2], "rotation": [0, 0, 0.70710678, 0.70710678]},
        {"mesh": 0, "scale": [2, 3, 4], "translation": [1, 0, 0]}])");
    const Scene scene = load_valid(file);
    // (1,1,0) is scaled to (2,3,0), moved to (3,3,0), turned by 90 degrees to (-3,3,0), moved to (7,3,0).
    expect_near(moved(scene, {1, 1, 0}), {7, 3, 0});
}

TEST(Nodes, MatricesAreColumnMajor) {
    GltfBuilder file;
    file.json["nodes"][0]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 5, 6, 7, 1};
    const Scene scene = load_valid(file);
    expect_near(moved(scene, {0, 0, 1}), {5, 6, 6});
    EXPECT_TRUE(is_mirrored(scene.instances[0].transforms[0]));
}

TEST(Nodes, OnlyTheDefaultSceneIsPlacedAndSharedMeshesStayShared) {
    GltfBuilder file;
    file.json["nodes"] = nlohmann::json::parse(R"([{"mesh": 0}, {"mesh": 0, "translation": [1, 2, 3]}, {"mesh": 0}])");
    file.json["scenes"] = nlohmann::json::parse(R"([{"nodes": [2]}, {"nodes": [0, 1]}])");
    file.json["scene"] = 1;
    const Scene scene = load_valid(file);
    EXPECT_EQ(scene.instances.size(), 2u);
    EXPECT_EQ(scene.meshes.size(), 1u);
    expect_near(moved(scene, {0, 0, 0}, 1), {1, 2, 3});
}

TEST(Nodes, ATenThousandDeepTreeIsPlaced) {
    GltfBuilder file;
    file.json["nodes"] = nlohmann::json::array();
    for (int i = 0; i < 10'000; ++i)
        file.json["nodes"].push_back({{"children", {i + 1}}, {"translation", {0.001, 0, 0}}});
    file.json["nodes"].push_back({{"mesh", 0}});
    expect_near(moved(load_valid(file), {0, 0, 0}), {10, 0, 0}, 1e-4f);
}

TEST(Nodes, ATransformBeyondFloatDropsWhatItHolds) {
    GltfBuilder file;
    file.json["nodes"] =
        nlohmann::json::parse(R"([{"children": [1], "scale": [1e38, 1, 1]}, {"mesh": 0, "scale": [1e38, 1, 1]}])");
    const Scene scene = load_valid(file);
    EXPECT_TRUE(scene.instances.empty());
    ASSERT_EQ(scene.warnings.size(), 1u);
    EXPECT_THAT(scene.warnings[0], HasSubstr("node 1"));
}

/// A file whose node 0 is moved by one channel.
GltfBuilder animated(const char* path, const char* interpolation, const std::vector<float>& times,
                     const std::vector<float>& values, const std::string& type) {
    GltfBuilder file;
    const int input = file.add_accessor(times, "SCALAR");
    const int output = file.add_accessor(values, type);
    file.json["animations"] = {
        {{"samplers", {{{"input", input}, {"output", output}, {"interpolation", interpolation}}}},
         {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", path}}}}}}}};
    return file;
}

TEST(Animation, WithoutATimeTheSceneIsAtRest) {
    const GltfBuilder file = animated("translation", "LINEAR", {0, 1}, {5, 0, 0, 6, 0, 0}, "VEC3");
    expect_near(moved(load_valid(file), {0, 0, 0}), {0, 0, 0});
    expect_near(moved(load_valid(file, {.time = 0.0f}), {0, 0, 0}), {5, 0, 0});
}

TEST(Animation, LinearValuesAreInterpolatedAndClamped) {
    const GltfBuilder file = animated("translation", "LINEAR", {1, 2, 4}, {0, 0, 0, 4, 0, 0, 4, 8, 0}, "VEC3");
    const auto at = [&](float time) { return moved(load_valid(file, {.time = time}), {0, 0, 0}); };
    expect_near(at(0.0f), {0, 0, 0});
    expect_near(at(1.25f), {1, 0, 0});
    expect_near(at(2.0f), {4, 0, 0});
    expect_near(at(3.0f), {4, 4, 0});
    expect_near(at(99.0f), {4, 8, 0});
    EXPECT_EQ(load_valid(file, {.time = 3.0f}).time, 3.0f);
}

TEST(Animation, StepsHoldTheirValue) {
    const GltfBuilder file = animated("scale", "STEP", {0, 1}, {1, 1, 1, 3, 3, 3}, "VEC3");
    expect_near(moved(load_valid(file, {.time = 0.99f}), {1, 0, 0}), {1, 0, 0});
    expect_near(moved(load_valid(file, {.time = 1.0f}), {1, 0, 0}), {3, 0, 0});
}

TEST(Animation, RotationsTakeTheShortWay) {
    // From 0 to 90 degrees around z, the second written as -q: the same rotation.
    const GltfBuilder file =
        animated("rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, -0.70710678f, -0.70710678f}, "VEC4");
    const float third = pi / 6.0f;
    expect_near(moved(load_valid(file, {.time = 1.0f / 3.0f}), {1, 0, 0}), {std::cos(third), std::sin(third), 0});
}

TEST(Animation, CubicSplinesFollowTheirTangents) {
    // Keys: in-tangent, value, out-tangent, over two seconds. p(t) of the Hermite form at t = 1/2 is
    // (v0 + v1) / 2 + duration * (out0 - in1) / 8.
    const GltfBuilder file = animated("translation", "CUBICSPLINE", {0, 2},
                                      {9, 9, 9, 0, 0, 0, 4, 0, 0, /**/ 0, -8, 0, 2, 2, 2, 9, 9, 9}, "VEC3");
    expect_near(moved(load_valid(file, {.time = 1.0f}), {0, 0, 0}), {1 + 2 * 4.0f / 8, 1 + 2 * 8.0f / 8, 1});
    expect_near(moved(load_valid(file, {.time = 0.0f}), {0, 0, 0}), {0, 0, 0});
    expect_near(moved(load_valid(file, {.time = 2.0f}), {0, 0, 0}), {2, 2, 2});
}

TEST(Animation, ValuesMayBeNormalizedIntegers) {
    GltfBuilder file = animated("rotation", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, 0, 1}, "VEC4");
    file.json["animations"][0]["samplers"][0]["output"] =
        file.add_accessor<std::int16_t>({0, 0, 32767, 0, 0, 0, 32767, 0}, "VEC4", true);
    expect_near(moved(load_valid(file, {.time = 0.0f}), {1, 0, 0}), {-1, 0, 0}, 1e-4f);
}

GltfBuilder morphed() {
    GltfBuilder file;
    const int up = file.add_accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
    const int aside = file.add_accessor<float>({2, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3");
    file.primitive()["attributes"]["NORMAL"] = up;
    file.primitive()["targets"] = {{{"POSITION", up}}, {{"POSITION", aside}, {"NORMAL", aside}}};
    return file;
}

TEST(Morph, WeightsOfTheMeshTheNodeAndTheAnimationApplyInThatOrder) {
    GltfBuilder file = morphed();
    EXPECT_EQ(load_valid(file).meshes[0].primitives[0].positions[0], glm::vec3(0, 0, 0));
    file.json["meshes"][0]["weights"] = {0.5, 0};
    EXPECT_EQ(load_valid(file).meshes[0].primitives[0].positions[0], glm::vec3(0, 0, 0.5f));
    file.json["nodes"][0]["weights"] = {1, 0.25};
    EXPECT_EQ(load_valid(file).meshes[0].primitives[0].positions[0], glm::vec3(0.5f, 0, 1));

    const int input = file.add_accessor<float>({0, 1}, "SCALAR");
    const int output = file.add_accessor<float>({0, 0, 1, 1}, "SCALAR");
    file.json["animations"] = {{{"samplers", {{{"input", input}, {"output", output}}}},
                                {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "weights"}}}}}}}};
    EXPECT_EQ(load_valid(file, {.time = 0.5f}).meshes[0].primitives[0].positions[0], glm::vec3(1, 0, 0.5f));
}

TEST(Morph, NormalsMoveTooAndStayUnit) {
    GltfBuilder file = morphed();
    file.json["meshes"][0]["weights"] = {0, 0.5};
    expect_near(load_valid(file).meshes[0].primitives[0].normals[0], glm::normalize(glm::vec3(1, 0, 1)));
}

TEST(Morph, NodesWithDifferentWeightsHaveDifferentMeshes) {
    GltfBuilder file = morphed();
    file.json["nodes"] =
        nlohmann::json::parse(R"([{"mesh": 0}, {"mesh": 0, "weights": [1, 0]}, {"mesh": 0, "weights": [1, 0]}])");
    file.json["scenes"][0]["nodes"] = {0, 1, 2};
    const Scene scene = load_valid(file);
    EXPECT_EQ(scene.meshes.size(), 2u);
    EXPECT_NE(scene.instances[0].mesh, scene.instances[1].mesh);
    EXPECT_EQ(scene.instances[1].mesh, scene.instances[2].mesh);
}

GltfBuilder skinned() {
    GltfBuilder file;
    auto& attributes = file.primitive()["attributes"];
    attributes["NORMAL"] = file.add_accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
    attributes["JOINTS_0"] = file.add_accessor<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, "VEC4");
    attributes["WEIGHTS_0"] = file.add_accessor<float>({1, 0, 0, 0, 1, 0, 0, 0, 0.5f, 0.5f, 0, 0}, "VEC4");
    file.json["nodes"] = nlohmann::json::parse(R"([
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"translation": [0, 0, 0]},
        {"translation": [0, 4, 0], "rotation": [0, 1, 0, 0]}])");
    file.json["scenes"][0]["nodes"] = {0, 1, 2};
    file.json["skins"] = nlohmann::json::parse(R"([{"joints": [1, 2]}])");
    return file;
}

TEST(Skin, VerticesFollowTheirJointsAndNotTheNode) {
    const Scene scene = load_valid(skinned());
    const Primitive& p = scene.meshes[0].primitives[0];
    EXPECT_EQ(scene.instances[0].transforms[0], glm::mat4(1.0f));
    expect_near(p.positions[0], {0, 0, 0});
    expect_near(p.positions[1], {-1, 4, 0});  // turned by 180 degrees around y, moved up
    expect_near(p.positions[2], {0, 3, 0});   // the mean of (0,1,0) and (0,5,0)
    expect_near(p.normals[1], {0, 0, -1});
}

TEST(Skin, InverseBindMatricesApplyFirst) {
    GltfBuilder file = skinned();
    std::vector<float> matrices(32, 0.0f);
    for (int i = 0; i < 4; ++i) matrices[5 * i] = matrices[16 + 5 * i] = 1.0f;
    matrices[16 + 12] = -1.0f;  // the second moves by -1 along x
    file.json["skins"][0]["inverseBindMatrices"] = file.add_accessor(matrices, "MAT4");
    expect_near(load_valid(file).meshes[0].primitives[0].positions[1], {0, 4, 0});
}

TEST(Skin, WeightsNeedNotSumToOne) {
    GltfBuilder file = skinned();
    file.primitive()["attributes"]["WEIGHTS_0"] =
        file.add_accessor<std::uint8_t>({128, 0, 0, 0, 7, 0, 0, 0, 100, 100, 0, 0}, "VEC4", true);
    const Scene scene = load_valid(file);
    expect_near(scene.meshes[0].primitives[0].positions[1], {-1, 4, 0});
    expect_near(scene.meshes[0].primitives[0].positions[2], {0, 3, 0});
}

TEST(Instancing, EveryPlaceIsRelativeToTheNode) {
    GltfBuilder file;
    const int translations = file.add_accessor<float>({1, 0, 0, 0, 0, 0}, "VEC3");
    const int rotations = file.add_accessor<std::int8_t>({0, 0, 0, 127, 0, 0, 127, 0}, "VEC4", true);
    const int scales = file.add_accessor<float>({1, 1, 1, 2, 2, 2}, "VEC3");
    file.json["nodes"][0]["translation"] = {0, 0, 7};
    file.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
        {"TRANSLATION", translations}, {"ROTATION", rotations}, {"SCALE", scales}};
    const Scene scene = load_valid(file);
    ASSERT_EQ(scene.instances.at(0).transforms.size(), 2u);
    expect_near(moved(scene, {1, 0, 0}, 0, 0), {2, 0, 7});
    expect_near(moved(scene, {1, 0, 0}, 0, 1), {-2, 0, 7});
    EXPECT_EQ(triangle_count(scene), 2u);
}

TEST(Cameras, BothProjectionsAreReadAndScaleIsRemoved) {
    GltfBuilder file;
    file.json["cameras"] = nlohmann::json::parse(R"([
        {"name": "wide", "type": "perspective", "perspective": {"yfov": 0.9, "aspectRatio": 2, "znear": 0.5, "zfar": 50}},
        {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 10}},
        {"type": "perspective", "perspective": {"yfov": 0.9, "znear": 0.5}},
        {"name": "broken", "type": "perspective", "perspective": {"yfov": 9, "znear": 0.5}}])");
    file.json["nodes"] = nlohmann::json::parse(R"([{"camera": 0, "scale": [3, 3, 3], "translation": [1, 2, 3]},
        {"camera": 1, "name": "plan"}, {"camera": 2}, {"camera": 3}])");
    file.json["scenes"][0]["nodes"] = {0, 1, 2, 3};
    const Scene scene = load_valid(file);
    ASSERT_EQ(scene.cameras.size(), 3u);
    const Camera& wide = scene.cameras[0];
    EXPECT_EQ(wide.name, "wide");
    EXPECT_EQ(wide.vertical_field_of_view, 0.9f);
    EXPECT_EQ(wide.aspect_ratio, 2.0f);
    EXPECT_EQ(wide.near_distance, 0.5f);
    EXPECT_EQ(wide.far_distance, 50.0f);
    expect_near(glm::vec3(wide.world[3]), {1, 2, 3});
    expect_near(glm::vec3(wide.world[2]), {0, 0, 1});
    EXPECT_EQ(scene.cameras[1].name, "plan");
    EXPECT_EQ(scene.cameras[1].projection, Projection::orthographic);
    EXPECT_EQ(scene.cameras[1].half_width, 3.0f);
    EXPECT_TRUE(std::isinf(scene.cameras[2].far_distance));
    EXPECT_EQ(scene.cameras[2].name, "camera 2");
    ASSERT_EQ(scene.warnings.size(), 1u);
    EXPECT_THAT(scene.warnings[0], HasSubstr("broken"));
}

TEST(Lights, AllThreeKindsAreReadWithTheirUnitsAndPlaces) {
    GltfBuilder file;
    file.json["extensions"]["KHR_lights_punctual"]["lights"] = nlohmann::json::parse(R"([
        {"type": "directional", "name": "sun", "intensity": 1000, "color": [1, 0.5, 0.25]},
        {"type": "point", "intensity": 30, "range": 8},
        {"type": "spot", "intensity": 5, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}},
        {"type": "spot", "spot": {"innerConeAngle": 2, "outerConeAngle": 1}, "intensity": -1}])");
    file.json["nodes"] = nlohmann::json::array();
    for (int i = 0; i < 4; ++i) {
        nlohmann::json node = {
            {"translation", {i, 0, 0}}, {"rotation", {-0.70710678, 0, 0, 0.70710678}}, {"scale", {5, 5, 5}}};
        node["extensions"]["KHR_lights_punctual"]["light"] = i;
        file.json["nodes"].push_back(node);
    }
    file.json["scenes"][0]["nodes"] = {0, 1, 2, 3};
    const Scene scene = load_valid(file);
    ASSERT_EQ(scene.lights.size(), 4u);
    EXPECT_EQ(scene.lights[0].kind, LightKind::directional);
    EXPECT_EQ(scene.lights[0].intensity, 1000.0f);
    EXPECT_EQ(scene.lights[0].color, glm::vec3(1, 0.5f, 0.25f));
    expect_near(scene.lights[0].direction, {0, -1, 0});  // -Z turned by -90 degrees around x
    EXPECT_EQ(scene.lights[1].kind, LightKind::point);
    EXPECT_EQ(scene.lights[1].range, 8.0f);
    expect_near(scene.lights[1].position, {1, 0, 0});
    EXPECT_EQ(scene.lights[2].inner_cone_angle, 0.2f);
    EXPECT_EQ(scene.lights[2].outer_cone_angle, 0.4f);
    EXPECT_EQ(scene.lights[3].intensity, 0.0f);
    EXPECT_EQ(scene.warnings.size(), 2u);
}

}  // namespace
}  // namespace nacre::scene
