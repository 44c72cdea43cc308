// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <set>

#include "tests/scene/gltf_builder.h"
#include "tests/scene/scene_checks.h"

namespace nacre::scene {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// The only primitive of a file that must load.
Primitive only_primitive(const GltfBuilder& file) {
    const Expected<Scene> scene = file.load();
    if (!scene) {
        ADD_FAILURE() << scene.error().message();
        return {};
    }
    expect_valid_scene(*scene);
    if (scene->meshes.size() != 1 || scene->meshes[0].primitives.size() != 1) {
        ADD_FAILURE() << "expected one primitive";
        return {};
    }
    return scene->meshes[0].primitives[0];
}

TEST(Geometry, ATriangleGetsFlatNormalsADefaultMaterialAndACamera) {
    const Expected<Scene> scene = GltfBuilder().load();
    ASSERT_TRUE(scene) << scene.error().message();
    expect_valid_scene(*scene);
    const Primitive& primitive = scene->meshes[0].primitives[0];
    EXPECT_THAT(primitive.indices, ElementsAre(0, 1, 2));
    EXPECT_THAT(primitive.normals, ElementsAre(glm::vec3(0, 0, 1), glm::vec3(0, 0, 1), glm::vec3(0, 0, 1)));
    EXPECT_EQ(scene->materials.size(), 1u);
    EXPECT_EQ(scene->cameras[0].name, "default");
    EXPECT_EQ(scene->instances[0].name, "place");
    EXPECT_THAT(scene->warnings, IsEmpty());
}

TEST(Geometry, TheBinaryContainerHoldsTheSameScene) {
    const GltfBuilder file;
    const std::string bytes = file.binary();
    const Expected<Scene> scene = load_gltf(as_bytes(bytes), "test.glb", "");
    ASSERT_TRUE(scene) << scene.error().message();
    expect_valid_scene(*scene);
    EXPECT_EQ(scene->meshes[0].primitives[0].positions, only_primitive(file).positions);
}

// Every component type that texture coordinates and quantized positions can have.
TEST(Geometry, ComponentTypesAreConverted) {
    GltfBuilder file;
    auto& attributes = file.primitive()["attributes"];
    attributes["POSITION"] = file.add_accessor<std::int16_t>({0, 0, -7, 0, 300, 0, 0, -7, 0, 300, -7, 0}, "VEC3");
    // VEC3 of 16-bit integers takes 6 bytes; the stride must be a multiple of 4, so 8 here.
    file.json["bufferViews"].back()["byteStride"] = 8;
    file.json["accessors"].back()["count"] = 3;
    attributes["TEXCOORD_0"] = file.add_accessor<std::uint8_t>({0, 255, 51, 0, 255, 102}, "VEC2", true);
    attributes["TEXCOORD_1"] = file.add_accessor<std::int16_t>({32767, -32767, -32768, 0, 0, 16384}, "VEC2", true);
    attributes["COLOR_0"] =
        file.add_accessor<std::uint16_t>({65535, 0, 0, 65535, 0, 65535, 0, 0, 13107, 0, 0, 65535}, "VEC4", true);
    const Primitive primitive = only_primitive(file);
    EXPECT_THAT(primitive.positions, ElementsAre(glm::vec3(0, 0, -7), glm::vec3(300, 0, 0), glm::vec3(0, 300, -7)));
    EXPECT_THAT(primitive.uv0, ElementsAre(glm::vec2(0, 1), glm::vec2(0.2f, 0), glm::vec2(1, 0.4f)));
    EXPECT_EQ(primitive.uv1[0], glm::vec2(1, -1));
    EXPECT_EQ(primitive.uv1[1], glm::vec2(-1, 0)) << "-32768 is clamped to -1";
    EXPECT_NEAR(primitive.uv1[2].y, 16384.0f / 32767.0f, 1e-6f);
    EXPECT_EQ(primitive.colors[2], glm::vec4(0.2f, 0, 0, 1));
}

TEST(Geometry, SignedBytesAreNormalized) {
    GltfBuilder file;
    file.primitive()["attributes"]["NORMAL"] =
        file.add_accessor<std::int8_t>({0, 0, 127, 0, 0, 0, -128, 0, 0, 127, 0, 0}, "VEC3", true);
    file.json["bufferViews"].back()["byteStride"] = 4;
    file.json["accessors"].back()["count"] = 3;
    const Primitive primitive = only_primitive(file);
    EXPECT_THAT(primitive.normals, ElementsAre(glm::vec3(0, 0, 1), glm::vec3(0, 0, -1), glm::vec3(0, 1, 0)));
}

TEST(Geometry, IndicesOfAllWidthsAreRead) {
    const auto indices_with = [](auto type) {
        using T = decltype(type);
        GltfBuilder file;
        file.primitive()["indices"] = file.add_accessor<T>({2, 0, 1}, "SCALAR");
        // Flat normals reorder vertices, so look at the positions.
        return only_primitive(file).positions;
    };
    const auto expected = ElementsAre(glm::vec3(0, 1, 0), glm::vec3(0, 0, 0), glm::vec3(1, 0, 0));
    EXPECT_THAT(indices_with(std::uint8_t{}), expected);
    EXPECT_THAT(indices_with(std::uint16_t{}), expected);
    EXPECT_THAT(indices_with(std::uint32_t{}), expected);
}

TEST(Geometry, InterleavedAttributesAreTakenApart) {
    GltfBuilder file;
    const int view = file.add_view<float>({0, 0, 0, 0.25f, 0.5f, /**/ 2, 0, 0, 0.75f, 1, /**/ 0, 2, 0, 0, 0});
    file.json["bufferViews"][view]["byteStride"] = 20;
    file.json["accessors"].push_back({{"bufferView", view}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}});
    file.json["accessors"].push_back(
        {{"bufferView", view}, {"byteOffset", 12}, {"componentType", 5126}, {"count", 3}, {"type", "VEC2"}});
    file.primitive()["attributes"] = {{"POSITION", 1}, {"TEXCOORD_0", 2}};
    const Primitive primitive = only_primitive(file);
    EXPECT_EQ(primitive.positions[1], glm::vec3(2, 0, 0));
    EXPECT_THAT(primitive.uv0, ElementsAre(glm::vec2(0.25f, 0.5f), glm::vec2(0.75f, 1), glm::vec2(0, 0)));
}

TEST(Geometry, SparseAccessorsReplaceValuesWithAndWithoutABufferView) {
    for (const bool dense : {true, false}) {
        GltfBuilder file;
        const int indices = file.add_view<std::uint16_t>({1, 2});
        const int values = file.add_view<float>({5, 0, 0, 0, 6, 0});
        nlohmann::json& accessor = file.json["accessors"][0];
        if (!dense) accessor.erase("bufferView");
        accessor["sparse"] = {{"count", 2},
                              {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
                              {"values", {{"bufferView", values}}}};
        EXPECT_THAT(only_primitive(file).positions, ElementsAre(glm::vec3(0), glm::vec3(5, 0, 0), glm::vec3(0, 6, 0)));
    }
}

TEST(Geometry, AccessorsWithoutABufferViewAreZero) {
    GltfBuilder file;
    file.json["accessors"].push_back({{"componentType", 5126}, {"count", 3}, {"type", "VEC2"}});
    file.primitive()["attributes"]["TEXCOORD_0"] = 1;
    EXPECT_THAT(only_primitive(file).uv0, ElementsAre(glm::vec2(0), glm::vec2(0), glm::vec2(0)));
}

struct ModeCase {
    int mode;
    Topology topology;
    std::vector<std::uint32_t> indices;
};

TEST(Geometry, EveryTopologyBecomesAListOfTheSameElements) {
    const ModeCase cases[] = {
        {0, Topology::point_list, {0, 1, 2, 3, 4, 5}},
        {1, Topology::line_list, {0, 1, 2, 3, 4, 5}},
        {2, Topology::line_list, {0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 0}},
        {3, Topology::line_list, {0, 1, 1, 2, 2, 3, 3, 4, 4, 5}},
        {4, Topology::triangle_list, {0, 1, 2, 3, 4, 5}},
        {5, Topology::triangle_list, {0, 1, 2, 1, 3, 2, 2, 3, 4, 3, 5, 4}},
        {6, Topology::triangle_list, {1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 5, 0}},
    };
    for (const ModeCase& c : cases) {
        SCOPED_TRACE(c.mode);
        GltfBuilder file;
        // Coordinates that name their vertex, and normals, so that nothing is reordered.
        std::vector<float> positions, normals;
        for (int i = 0; i < 6; ++i) {
            positions.insert(positions.end(), {static_cast<float>(i), static_cast<float>(i % 2), 0.0f});
            normals.insert(normals.end(), {0.0f, 0.0f, 1.0f});
        }
        file.primitive()["attributes"] = {{"POSITION", file.add_accessor(positions, "VEC3")},
                                          {"NORMAL", file.add_accessor(normals, "VEC3")}};
        file.primitive()["mode"] = c.mode;
        const Primitive primitive = only_primitive(file);
        EXPECT_EQ(primitive.topology, c.topology);
        EXPECT_EQ(primitive.indices, c.indices);
    }
}

TEST(Geometry, StripsDropTheTrianglesThatOnlySteerThem) {
    GltfBuilder file;
    file.primitive()["mode"] = 5;
    file.primitive()["indices"] = file.add_accessor<std::uint8_t>({0, 1, 2, 2, 1}, "SCALAR");
    EXPECT_EQ(only_primitive(file).indices.size(), 3u) << "of the triangles 012, 122, 221 only the first has area";
}

TEST(Geometry, VerticesThatNothingDrawsAreDropped) {
    GltfBuilder file;
    std::vector<float> positions(300, 0.0f), normals;
    for (int i = 0; i < 100; ++i) {
        positions[3 * i] = static_cast<float>(i);
        positions[3 * i + 1] = static_cast<float>(i * i);
        normals.insert(normals.end(), {0.0f, 0.0f, 1.0f});
    }
    file.primitive()["attributes"] = {{"POSITION", file.add_accessor(positions, "VEC3")},
                                      {"NORMAL", file.add_accessor(normals, "VEC3")}};
    file.primitive()["indices"] = file.add_accessor<std::uint16_t>({90, 92, 91}, "SCALAR");
    const Primitive primitive = only_primitive(file);
    EXPECT_THAT(primitive.positions,
                ElementsAre(glm::vec3(90, 8100, 0), glm::vec3(91, 8281, 0), glm::vec3(92, 8464, 0)));
    EXPECT_THAT(primitive.indices, ElementsAre(0, 2, 1));
    EXPECT_EQ(primitive.normals.size(), 3u);
}

TEST(Geometry, ColorsWithoutAlphaAreOpaque) {
    GltfBuilder file;
    file.primitive()["attributes"]["COLOR_0"] = file.add_accessor<float>({1, 0, 0, 0, 0.5f, 0, 0, 0, 2}, "VEC3");
    EXPECT_THAT(only_primitive(file).colors,
                ElementsAre(glm::vec4(1, 0, 0, 1), glm::vec4(0, 0.5f, 0, 1), glm::vec4(0, 0, 1, 1)));
}

TEST(Geometry, GivenTangentsAreKeptButIgnoredWithoutNormals) {
    GltfBuilder file;
    auto& attributes = file.primitive()["attributes"];
    attributes["TANGENT"] = file.add_accessor<float>({0, 2, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1}, "VEC4");
    EXPECT_TRUE(only_primitive(file).tangents.empty());
    attributes["NORMAL"] = file.add_accessor<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
    EXPECT_EQ(only_primitive(file).tangents[0], glm::vec4(0, 1, 0, -1));
}

TEST(Geometry, ElementsThatAreNotFiniteAreDroppedAndCounted) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float infinity = std::numeric_limits<float>::infinity();
    GltfBuilder file;
    file.primitive()["attributes"]["POSITION"] = file.add_accessor<float>(
        {0, 0, 0, 1, 0, 0, 0, 1, 0, /**/ nan, 0, 0, 1, 0, 0, 0, 1, 0, /**/ 0, 0, 0, infinity, 0, 0, 0, 1, 0}, "VEC3");
    const Expected<Scene> scene = file.load();
    ASSERT_TRUE(scene) << scene.error().message();
    expect_valid_scene(*scene);
    EXPECT_EQ(triangle_count(*scene), 1u);
    EXPECT_THAT(scene->warnings, ElementsAre(HasSubstr("(2 times)")));
}

TEST(Geometry, NothingButNotANumberGivesASceneWithoutInstances) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    GltfBuilder file;
    file.primitive()["attributes"]["POSITION"] = file.add_accessor<float>({nan, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
    const Expected<Scene> scene = file.load();
    ASSERT_TRUE(scene) << scene.error().message();
    expect_valid_scene(*scene);
    EXPECT_TRUE(scene->instances.empty());
    EXPECT_EQ(scene->warnings.size(), 1u);
}

TEST(Geometry, BrokenAttributesAreMendedAndCounted) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    GltfBuilder file;
    auto& attributes = file.primitive()["attributes"];
    attributes["NORMAL"] = file.add_accessor<float>({0, 0, 0, nan, 0, 1, 0, 0, -3}, "VEC3");
    attributes["TEXCOORD_0"] = file.add_accessor<float>({nan, 0, 0, 1, 1, 1}, "VEC2");
    attributes["COLOR_0"] = file.add_accessor<float>({nan, 0, 0, 0, 0, 0, 9, -4, 0}, "VEC3");
    const Expected<Scene> scene = file.load();
    ASSERT_TRUE(scene) << scene.error().message();
    expect_valid_scene(*scene);
    const Primitive& primitive = scene->meshes[0].primitives[0];
    EXPECT_THAT(primitive.normals, ElementsAre(glm::vec3(0, 0, 1), glm::vec3(0, 0, 1), glm::vec3(0, 0, -1)));
    EXPECT_EQ(primitive.uv0[0], glm::vec2(0));
    EXPECT_EQ(primitive.colors[0], glm::vec4(1));
    EXPECT_EQ(primitive.colors[2], glm::vec4(1, 0, 0, 1));
    EXPECT_EQ(scene->warnings.size(), 3u);
}

TEST(Geometry, TheLargestCoordinatesStayFinite) {
    GltfBuilder file;
    file.primitive()["attributes"]["POSITION"] =
        file.add_accessor<float>({-3e38f, 0, 0, 3e38f, 0, 0, 0, 3e38f, 0}, "VEC3");
    const Primitive primitive = only_primitive(file);  // checks normals and the camera
    EXPECT_EQ(primitive.normals[0], glm::vec3(0, 0, 1));
}

TEST(Geometry, EmptyScenesAreValid) {
    for (const char* text :
         {R"({"asset":{"version":"2.0"}})", R"({"asset":{"version":"2.0"},"scenes":[{}]})",
          R"({"asset":{"version":"2.0"},"nodes":[{}],"meshes":[]})",
          R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[]}]})",
          R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{}}]}]})"}) {
        const Expected<Scene> scene = load_text(text);
        ASSERT_TRUE(scene) << scene.error().message();
        expect_valid_scene(*scene);
        EXPECT_TRUE(scene->instances.empty());
    }
}

}  // namespace
}  // namespace nacre::scene
