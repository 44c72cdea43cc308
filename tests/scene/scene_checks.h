// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "scene/scene.h"
#include "tests/scene/gltf_builder.h"

/// @file
/// What scene/scene.h promises about every scene, as one check.

namespace nacre::scene {

inline bool is_finite(const glm::vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

inline bool is_finite(const glm::mat4& m) {
    for (int column = 0; column < 4; ++column) {
        for (int row = 0; row < 4; ++row) {
            if (!std::isfinite(m[column][row])) return false;
        }
    }
    return true;
}

inline void expect_valid_primitive(const Scene& scene, const Primitive& primitive) {
    const std::size_t count = primitive.positions.size();
    EXPECT_FALSE(primitive.indices.empty());
    EXPECT_LT(primitive.material, scene.materials.size());
    const std::size_t multiple = primitive.topology == Topology::point_list  ? 1
                                 : primitive.topology == Topology::line_list ? 2
                                                                             : 3;
    EXPECT_EQ(primitive.indices.size() % multiple, 0u);
    for (const std::uint32_t index : primitive.indices) ASSERT_LT(index, count);
    for (const glm::vec3& position : primitive.positions) ASSERT_TRUE(is_finite(position));
    EXPECT_TRUE(primitive.normals.empty() || primitive.normals.size() == count);
    EXPECT_TRUE(primitive.tangents.empty() || primitive.tangents.size() == count);
    EXPECT_TRUE(primitive.uv0.empty() || primitive.uv0.size() == count);
    EXPECT_TRUE(primitive.uv1.empty() || primitive.uv1.size() == count);
    EXPECT_TRUE(primitive.colors.empty() || primitive.colors.size() == count);
    if (primitive.topology == Topology::triangle_list) {
        EXPECT_EQ(primitive.normals.size(), count);
        if (materials::needs_tangents(scene.materials[primitive.material])) {
            EXPECT_EQ(primitive.tangents.size(), count);
        }
    }
    for (const glm::vec3& normal : primitive.normals) ASSERT_NEAR(glm::length(normal), 1.0f, 1e-3f);
    for (const glm::vec4& tangent : primitive.tangents) {
        ASSERT_NEAR(glm::length(glm::vec3(tangent)), 1.0f, 1e-3f);
        ASSERT_EQ(std::abs(tangent.w), 1.0f);
    }
    for (const glm::vec2& uv : primitive.uv0) ASSERT_TRUE(std::isfinite(uv.x) && std::isfinite(uv.y));
    for (const glm::vec2& uv : primitive.uv1) ASSERT_TRUE(std::isfinite(uv.x) && std::isfinite(uv.y));
    for (const glm::vec4& color : primitive.colors) {
        ASSERT_TRUE(is_finite(glm::vec3(color)));
        ASSERT_GE(std::min({color.r, color.g, color.b, color.a}), 0.0f);
        ASSERT_LE(std::max({color.r, color.g, color.b, color.a}), 1.0f);
    }
    Bounds bounds;
    for (const std::uint32_t index : primitive.indices) bounds.add(primitive.positions[index]);
    EXPECT_EQ(bounds.minimum, primitive.bounds.minimum);
    EXPECT_EQ(bounds.maximum, primitive.bounds.maximum);
}

inline void expect_valid_scene(const Scene& scene) {
    ASSERT_FALSE(scene.cameras.empty());
    ASSERT_TRUE(scene.environment.present());
    ASSERT_EQ(scene.environment.texels.size(), std::size_t{scene.environment.width} * scene.environment.height);
    for (const Image& image : scene.images) {
        ASSERT_TRUE(image.pixels);
        ASSERT_EQ(image.pixels->size(), std::size_t{4} * image.width * image.height) << image.name;
    }
    for (const materials::MaterialDescription& material : scene.materials) {
        materials::for_each_texture(material, [&](const materials::TextureReference& texture, bool srgb) {
            ASSERT_LT(static_cast<std::size_t>(texture.image), scene.images.size());
            ASSERT_GE(texture.sampler, 0);
            ASSERT_LT(static_cast<std::size_t>(texture.sampler), scene.samplers.size());
            EXPECT_EQ(scene.images[texture.image].color_space, srgb ? ColorSpace::srgb : ColorSpace::linear);
            EXPECT_TRUE(texture.uv_set == 0 || texture.uv_set == 1);
        });
    }
    for (const Mesh& mesh : scene.meshes) {
        for (const Primitive& primitive : mesh.primitives) expect_valid_primitive(scene, primitive);
    }
    for (const Instance& instance : scene.instances) {
        ASSERT_LT(instance.mesh, scene.meshes.size());
        EXPECT_FALSE(instance.transforms.empty());
        for (const glm::mat4& transform : instance.transforms) ASSERT_TRUE(is_finite(transform));
    }
    for (const Camera& camera : scene.cameras) {
        EXPECT_TRUE(is_finite(camera.world));
        EXPECT_NEAR(glm::determinant(glm::mat3(camera.world)), 1.0f, 1e-3f) << camera.name;
        EXPECT_GT(camera.far_distance, camera.near_distance);
    }
    for (const Light& light : scene.lights) {
        EXPECT_TRUE(std::isfinite(light.intensity) && light.intensity >= 0.0f);
        EXPECT_TRUE(is_finite(light.position));
        EXPECT_NEAR(glm::length(light.direction), 1.0f, 1e-3f);
        EXPECT_LT(light.inner_cone_angle, light.outer_cone_angle);
    }
}

/// The scene of a file, which the test expects to load; empty where it does not.
inline Scene load_valid(const GltfBuilder& file, const LoadOptions& options = {}) {
    auto scene = file.load(options);
    if (!scene) {
        ADD_FAILURE() << scene.error().message();
        return {};
    }
    expect_valid_scene(*scene);
    return *std::move(scene);
}

}  // namespace nacre::scene
