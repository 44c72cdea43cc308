// SPDX-License-Identifier: Apache-2.0
#include "scene/shapes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace nacre::scene {

void update_bounds(Primitive& primitive) {
    primitive.bounds = {};
    for (const std::uint32_t index : primitive.indices) primitive.bounds.add(primitive.positions[index]);
}

Primitive sphere(float radius, std::uint32_t segments, std::uint32_t rings) {
    segments = std::max(segments, 3u);
    rings = std::max(rings, 2u);
    Primitive result;
    for (std::uint32_t ring = 0; ring <= rings; ++ring) {
        const float v = static_cast<float>(ring) / static_cast<float>(rings);
        const float theta = v * std::numbers::pi_v<float>;
        for (std::uint32_t segment = 0; segment <= segments; ++segment) {
            const float u = static_cast<float>(segment) / static_cast<float>(segments);
            const float phi = u * 2.0f * std::numbers::pi_v<float>;
            // The seam and the poles use exact values, so that no gap opens where rounding differs.
            const float sin_theta = ring == 0 || ring == rings ? 0.0f : std::sin(theta);
            const float sin_phi = segment == segments ? 0.0f : std::sin(phi);
            const float cos_phi = segment == segments ? 1.0f : std::cos(phi);
            const float cos_theta = ring == 0 ? 1.0f : ring == rings ? -1.0f : std::cos(theta);
            const glm::vec3 normal(sin_theta * sin_phi, cos_theta, sin_theta * cos_phi);
            result.positions.push_back(radius * normal);
            result.normals.push_back(glm::normalize(normal));
            result.uv0.emplace_back(u, v);
        }
    }
    const std::uint32_t stride = segments + 1;
    for (std::uint32_t ring = 0; ring < rings; ++ring) {
        for (std::uint32_t segment = 0; segment < segments; ++segment) {
            const std::uint32_t a = ring * stride + segment;
            const std::uint32_t b = a + stride;
            if (ring + 1 < rings) result.indices.insert(result.indices.end(), {a, b, b + 1});
            if (ring > 0) result.indices.insert(result.indices.end(), {a, b + 1, a + 1});
        }
    }
    update_bounds(result);
    return result;
}

namespace {

void append_parallelogram(Primitive& primitive, const glm::vec3& corner, const glm::vec3& edge_u,
                          const glm::vec3& edge_v) {
    const auto first = static_cast<std::uint32_t>(primitive.positions.size());
    const glm::vec3 normal = glm::normalize(glm::cross(edge_u, edge_v));
    for (const glm::vec2 at : {glm::vec2(0, 0), glm::vec2(1, 0), glm::vec2(1, 1), glm::vec2(0, 1)}) {
        primitive.positions.push_back(corner + at.x * edge_u + at.y * edge_v);
        primitive.normals.push_back(normal);
        primitive.uv0.emplace_back(at.x, 1.0f - at.y);
    }
    primitive.indices.insert(primitive.indices.end(), {first, first + 1, first + 2, first, first + 2, first + 3});
}

}  // namespace

Primitive box(const glm::vec3& half_size) {
    Primitive result;
    const float x = half_size.x, y = half_size.y, z = half_size.z;
    append_parallelogram(result, {-x, -y, z}, {2 * x, 0, 0}, {0, 2 * y, 0});   // +Z
    append_parallelogram(result, {x, -y, -z}, {-2 * x, 0, 0}, {0, 2 * y, 0});  // -Z
    append_parallelogram(result, {x, -y, z}, {0, 0, -2 * z}, {0, 2 * y, 0});   // +X
    append_parallelogram(result, {-x, -y, -z}, {0, 0, 2 * z}, {0, 2 * y, 0});  // -X
    append_parallelogram(result, {-x, y, z}, {2 * x, 0, 0}, {0, 0, -2 * z});   // +Y
    append_parallelogram(result, {-x, -y, -z}, {2 * x, 0, 0}, {0, 0, 2 * z});  // -Y
    update_bounds(result);
    return result;
}

Primitive parallelogram(const glm::vec3& corner, const glm::vec3& edge_u, const glm::vec3& edge_v) {
    Primitive result;
    append_parallelogram(result, corner, edge_u, edge_v);
    update_bounds(result);
    return result;
}

}  // namespace nacre::scene
