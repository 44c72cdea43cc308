// SPDX-License-Identifier: Apache-2.0
#include "scene/tangents.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <map>
#include <random>

#include "scene/load.h"
#include "scene/shapes.h"
#include "tests/scene/asset_folder.h"

namespace nacre::scene {
namespace {

glm::vec3 bitangent(const Primitive& p, std::size_t i) {
    return p.tangents[i].w * glm::cross(p.normals[i], glm::vec3(p.tangents[i]));
}

void expect_orthonormal(const Primitive& p) {
    ASSERT_EQ(p.tangents.size(), p.positions.size());
    for (std::size_t i = 0; i < p.tangents.size(); ++i) {
        ASSERT_NEAR(glm::length(glm::vec3(p.tangents[i])), 1.0f, 1e-5f);
        ASSERT_NEAR(glm::dot(glm::vec3(p.tangents[i]), p.normals[i]), 0.0f, 1e-5f);
        ASSERT_EQ(std::abs(p.tangents[i].w), 1.0f);
    }
}

/// A flat square in the xy plane, seen from +Z; uv as the caller says per corner (lower left, counter-clockwise).
Primitive square(const std::vector<glm::vec2>& uv) {
    Primitive p = parallelogram({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
    p.uv0 = uv;
    return p;
}

TEST(Tangents, UPointsRightAndTheBitangentUpOnAnUprightPicture) {
    Primitive p = square({{0, 1}, {1, 1}, {1, 0}, {0, 0}});
    add_tangents(p, p.uv0);
    expect_orthonormal(p);
    EXPECT_EQ(p.positions.size(), 4u) << "nothing needs splitting";
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_NEAR(p.tangents[i].x, 1.0f, 1e-6f);
        EXPECT_EQ(p.tangents[i].w, 1.0f);
        EXPECT_NEAR(bitangent(p, i).y, 1.0f, 1e-6f);
    }
}

TEST(Tangents, AMirroredPictureHasNegativeW) {
    Primitive p = square({{1, 1}, {0, 1}, {0, 0}, {1, 0}});
    add_tangents(p, p.uv0);
    expect_orthonormal(p);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_NEAR(p.tangents[i].x, -1.0f, 1e-6f);
        EXPECT_EQ(p.tangents[i].w, -1.0f);
        EXPECT_NEAR(bitangent(p, i).y, 1.0f, 1e-6f);
    }
}

TEST(Tangents, ARotatedPictureRotatesThem) {
    Primitive p = square({{0, 0}, {0, 1}, {1, 1}, {1, 0}});  // u grows upwards
    add_tangents(p, p.uv0);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_NEAR(p.tangents[i].y, 1.0f, 1e-6f);
        EXPECT_NEAR(bitangent(p, i).x, -1.0f, 1e-6f);
    }
}

TEST(Tangents, WhereMirroredHalvesMeetTheSharedVerticesAreSplit) {
    // Two squares side by side; the right one shows the picture of the left one mirrored at their common edge.
    Primitive p;
    p.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 1, 0}};
    p.normals.assign(6, {0, 0, 1});
    p.uv0 = {{0, 1}, {1, 1}, {0, 1}, {0, 0}, {1, 0}, {0, 0}};
    p.indices = {0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4};
    add_tangents(p, p.uv0);
    expect_orthonormal(p);
    EXPECT_EQ(p.positions.size(), 8u);
    for (std::size_t corner = 0; corner < p.indices.size(); ++corner) {
        const glm::vec4& tangent = p.tangents[p.indices[corner]];
        EXPECT_NEAR(tangent.x, corner < 6 ? 1.0f : -1.0f, 1e-6f);
        EXPECT_EQ(tangent.w, corner < 6 ? 1.0f : -1.0f);
    }
}

TEST(Tangents, AnglesWeighTheMeanNotAreasOrTriangleCounts) {
    // A vertex between a 90 degree corner of one direction and two 22.5 degree corners of another.
    const float s = std::sin(0.392699f), c = std::cos(0.392699f);
    Primitive p;
    p.positions = {{0, 0, 0}, {5, 0, 0}, {0, 5, 0}, {-s, c, 0}, {-std::sin(0.785398f), std::cos(0.785398f), 0}};
    p.normals.assign(5, {0, 0, 1});
    // Left of the y axis the u direction is turned by an angle that depends on v only through the shared edge.
    p.uv0 = {{0, 0}, {5, 0}, {0, -5}, {0, 0}, {0, 0}};
    const auto skewed = [](glm::vec3 at) { return glm::vec2(at.x + 0.0f, -at.y + 0.8f * at.x); };
    p.uv0[3] = skewed(p.positions[3]);
    p.uv0[4] = skewed(p.positions[4]);
    p.indices = {0, 1, 2, 0, 2, 3, 0, 3, 4};
    add_tangents(p, p.uv0);
    expect_orthonormal(p);
    // On the skewed part, u = x and v = -y + 0.8 x: the u direction, at constant v, is (1, 0.8) normalized.
    const glm::vec2 skew = glm::normalize(glm::vec2(1.0f, 0.8f));
    const glm::vec2 expected = glm::normalize(1.570796f * glm::vec2(1, 0) + 2 * 0.392699f * skew);
    const glm::vec4 actual = p.tangents[p.indices[0]];
    EXPECT_NEAR(actual.x, expected.x, 1e-4f);
    EXPECT_NEAR(actual.y, expected.y, 1e-4f);
}

TEST(Tangents, OnASphereTheyFollowTheParallels) {
    Primitive p = sphere(2.0f, 64, 32);
    add_tangents(p, p.uv0);
    expect_orthonormal(p);
    for (std::size_t i = 0; i < p.positions.size(); ++i) {
        if (std::abs(p.normals[i].y) > 0.97f) continue;  // at the poles u has no direction
        const glm::vec3 east = glm::normalize(glm::cross(glm::vec3(0, 1, 0), p.normals[i]));
        EXPECT_GT(glm::dot(east, glm::vec3(p.tangents[i])), 0.995f);
        EXPECT_EQ(p.tangents[i].w, 1.0f);
        EXPECT_GT(bitangent(p, i).y, 0.0f) << "v grows downwards, so the bitangent points up";
    }
}

/// Tangents keyed by what makes a corner, so that meshes with another order can be compared.
std::multimap<std::array<float, 8>, glm::vec4> tangents_by_corner(const Primitive& p) {
    std::multimap<std::array<float, 8>, glm::vec4> result;
    for (const std::uint32_t i : p.indices) {
        result.insert({{p.positions[i].x, p.positions[i].y, p.positions[i].z, p.normals[i].x, p.normals[i].y,
                        p.normals[i].z, p.uv0[i].x, p.uv0[i].y},
                       p.tangents[i]});
    }
    return result;
}

TEST(Tangents, DoNotDependOnTheOrderOfTrianglesNorOnSharedIndices) {
    Primitive p = sphere(1.0f, 24, 12);
    Primitive shuffled = p;
    std::vector<std::array<std::uint32_t, 3>> triangles;
    for (std::size_t i = 0; i < p.indices.size(); i += 3) {
        triangles.push_back({p.indices[i + 1], p.indices[i + 2], p.indices[i]});  // also starting at another corner
    }
    std::mt19937 random(7);
    std::shuffle(triangles.begin(), triangles.end(), random);
    std::vector<std::uint32_t> order;
    for (const auto& triangle : triangles) order.insert(order.end(), triangle.begin(), triangle.end());
    gather_vertices(shuffled, order);  // and no index is shared
    shuffled.indices.resize(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) shuffled.indices[i] = static_cast<std::uint32_t>(i);

    add_tangents(p, p.uv0);
    add_tangents(shuffled, shuffled.uv0);
    const auto expected = tangents_by_corner(p), actual = tangents_by_corner(shuffled);
    ASSERT_EQ(expected.size(), actual.size());
    for (auto a = expected.begin(), b = actual.begin(); a != expected.end(); ++a, ++b) {
        ASSERT_EQ(a->first, b->first);
        ASSERT_LT(glm::length(a->second - b->second), 1e-4f);
    }
}

TEST(Tangents, TrianglesWithoutTextureAreaTakeThoseOfTheirNeighbors) {
    Primitive p = square({{0, 1}, {1, 1}, {1, 0}, {0, 0}});
    // A third triangle above the square whose texture coordinates lie on a line.
    p.positions.push_back({0.5f, 2.0f, 0.0f});
    p.normals.push_back({0, 0, 1});
    p.uv0.push_back({0.5f, 0.0f});
    p.indices.insert(p.indices.end(), {3, 2, 4});
    add_tangents(p, p.uv0);
    expect_orthonormal(p);
    for (const std::size_t corner : {6u, 7u}) EXPECT_NEAR(p.tangents[p.indices[corner]].x, 1.0f, 1e-6f);
}

TEST(Tangents, GarbageGivesUnitVectors) {
    Primitive p;
    p.positions = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1e-30f, 0, 0}, {0, 1e30f, 0}, {1e38f, 0, -1e38f}};
    p.normals = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    p.uv0 = {{0, 0}, {0, 0}, {0, 0}, {1e38f, 0}, {-1e38f, 1e38f}, {0, 1e-38f}};
    p.indices = {0, 1, 2, 3, 4, 5, 0, 0, 0, 3, 3, 4};
    Primitive without_uv = p;
    add_tangents(p, p.uv0);
    expect_orthonormal(p);
    add_tangents(without_uv, {});
    expect_orthonormal(without_uv);
}

TEST(Tangents, AVertexInAHundredThousandGroupsTakesNoLongerThanOthers) {
    // Triangles that share one vertex and no edge, each with its own u direction. A search among all the tangents of a
    // vertex would take minutes.
    Primitive p;
    p.positions = {{0, 0, 0}};
    p.normals = {{0, 0, 1}};
    p.uv0 = {{0, 0}};
    for (std::uint32_t i = 0; i < 100'000; ++i) {
        const float angle = 6.2831853f * static_cast<float>(i) / 100'000.0f;
        for (const float offset : {0.0f, 2e-5f}) {
            p.positions.emplace_back(std::cos(angle + offset), std::sin(angle + offset), 0.0f);
            p.normals.emplace_back(0.0f, 0.0f, 1.0f);
        }
        p.uv0.insert(p.uv0.end(), {{1.0f, static_cast<float>(i)}, {1.0f, static_cast<float>(i) - 1e-2f}});
        p.indices.insert(p.indices.end(), {0, 2 * i + 1, 2 * i + 2});
    }
    add_tangents(p, p.uv0);
    EXPECT_GT(p.positions.size(), 250'000u) << "vertex 0 was split";
}

TEST(FlatNormals, GiveEachTriangleItsOwnVertices) {
    Primitive p = box({1, 2, 3});
    const Primitive reference = p;
    p.normals.clear();
    add_flat_normals(p);
    ASSERT_EQ(p.positions.size(), 36u);
    ASSERT_EQ(p.uv0.size(), 36u);
    for (std::size_t corner = 0; corner < 36; ++corner) {
        EXPECT_EQ(p.normals[p.indices[corner]], reference.normals[reference.indices[corner]]);
        EXPECT_EQ(p.positions[p.indices[corner]], reference.positions[reference.indices[corner]]);
    }
}

TEST(Tangents, OnNormalTangentTestTheyFollowTheTexture) {
    if (!asset_folder()) GTEST_SKIP() << "no sample scenes (NACRE_ASSETS or shared/assets beside the source tree)";
    const auto scene = load_scene((*asset_folder() / "NormalTangentTest/glTF/NormalTangentTest.gltf").string());
    ASSERT_TRUE(scene) << scene.error().message();
    const Primitive& p = scene->meshes.at(0).primitives.at(0);
    expect_orthonormal(p);
    // On every triangle with area, the tangent frame agrees with how the picture lies on it.
    std::size_t checked = 0, agreeing = 0;
    for (std::size_t i = 0; i < p.indices.size(); i += 3) {
        const std::uint32_t a = p.indices[i], b = p.indices[i + 1], c = p.indices[i + 2];
        const glm::dvec3 e1(p.positions[b] - p.positions[a]), e2(p.positions[c] - p.positions[a]);
        const glm::dvec2 t1(p.uv0[b] - p.uv0[a]), t2(p.uv0[c] - p.uv0[a]);
        const double area = t1.x * t2.y - t1.y * t2.x;
        if (std::abs(area) < 1e-12 || glm::length(glm::cross(e1, e2)) < 1e-12) continue;
        const glm::dvec3 along_u = glm::normalize((t2.y * e1 - t1.y * e2) / area);
        const glm::dvec3 along_v = glm::normalize((t1.x * e2 - t2.x * e1) / area);
        ++checked;
        bool agrees = true;
        for (const std::uint32_t corner : {a, b, c}) {
            agrees = agrees && glm::dot(along_u, glm::dvec3(p.tangents[corner])) > 0.5 &&
                     glm::dot(along_v, glm::dvec3(bitangent(p, corner))) < -0.5;
        }
        agreeing += agrees;
    }
    EXPECT_GT(checked, 5000u);
    EXPECT_GT(static_cast<double>(agreeing), 0.99 * static_cast<double>(checked));
}

}  // namespace
}  // namespace nacre::scene
