// SPDX-License-Identifier: Apache-2.0
#include "scene/scene.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>

namespace nacre::scene {

void Bounds::add(const glm::vec3& point) {
    minimum = glm::min(minimum, point);
    maximum = glm::max(maximum, point);
}

void Bounds::add(const Bounds& other) {
    minimum = glm::min(minimum, other.minimum);
    maximum = glm::max(maximum, other.maximum);
}

float Bounds::radius() const {
    if (empty()) return 0.0f;
    // In double precision: the squares of large coordinates are beyond float.
    const double radius = glm::length(0.5 * glm::dvec3(maximum) - 0.5 * glm::dvec3(minimum));
    return static_cast<float>(std::min(radius, static_cast<double>(std::numeric_limits<float>::max())));
}

Bounds Bounds::transformed(const glm::mat4& transform) const {
    Bounds result;
    if (empty()) return result;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::vec3 point(corner & 1 ? maximum.x : minimum.x, corner & 2 ? maximum.y : minimum.y,
                              corner & 4 ? maximum.z : minimum.z);
        result.add(glm::vec3(transform * glm::vec4(point, 1.0f)));
    }
    return result;
}

Bounds world_bounds(const Scene& scene) {
    Bounds result;
    for (const Instance& instance : scene.instances) {
        for (const Primitive& primitive : scene.meshes[instance.mesh].primitives) {
            for (const glm::mat4& transform : instance.transforms) {
                result.add(primitive.bounds.transformed(transform));
            }
        }
    }
    return result;
}

bool is_mirrored(const glm::mat4& transform) { return glm::determinant(glm::mat3(transform)) < 0.0f; }

Camera framing_camera(const Bounds& scene_bounds, float aspect_ratio) {
    Camera camera{.name = "default"};
    // Beyond a light year, products of distances would no longer be finite.
    Bounds bounds = scene_bounds;
    bounds.minimum = glm::clamp(bounds.minimum, -1e16f, 1e16f);
    bounds.maximum = glm::clamp(bounds.maximum, -1e16f, 1e16f);
    if (scene_bounds.empty()) bounds = {};
    const float radius = std::max(bounds.radius(), 1e-4f);
    const glm::vec3 center = bounds.empty() ? glm::vec3(0.0f) : bounds.center();
    const glm::vec3 backward = glm::normalize(glm::vec3(0.3f, 0.25f, 1.0f));
    const glm::vec3 right = glm::normalize(glm::cross(glm::vec3(0.0f, 1.0f, 0.0f), backward));
    const glm::vec3 up = glm::cross(backward, right);

    // The distance at which the farthest-out corner of the box touches the frame, for each of the eight corners:
    // the bounding sphere would waste most of the picture on flat scenes.
    const float tangent_v = std::tan(0.5f * camera.vertical_field_of_view);
    const float tangent_u = tangent_v * std::max(aspect_ratio, 0.01f);
    const glm::vec3 half = bounds.empty() ? glm::vec3(1.0f) : 0.5f * bounds.maximum - 0.5f * bounds.minimum;
    float distance = 0.0f;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::vec3 offset = half * glm::vec3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        const float beyond =
            std::max(std::abs(glm::dot(offset, right)) / tangent_u, std::abs(glm::dot(offset, up)) / tangent_v);
        distance = std::max(distance, beyond + glm::dot(offset, backward));
    }
    distance = std::max(distance * 1.08f, radius * 0.1f);  // a small margin around the picture

    camera.world = glm::mat4(glm::vec4(right, 0.0f), glm::vec4(up, 0.0f), glm::vec4(backward, 0.0f),
                             glm::vec4(center + distance * backward, 1.0f));
    camera.far_distance = distance + 2.0f * radius;
    camera.near_distance = std::max((distance - radius) * 0.5f, camera.far_distance * 1e-3f);
    return camera;
}

const Camera* find_camera(const Scene& scene, const std::string& name) {
    for (const Camera& camera : scene.cameras) {
        if (camera.name == name) return &camera;
    }
    std::size_t index = 0;
    const auto [end, code] = std::from_chars(name.data(), name.data() + name.size(), index);
    const bool is_number = code == std::errc() && end == name.data() + name.size();
    return is_number && index < scene.cameras.size() ? &scene.cameras[index] : nullptr;
}

std::uint64_t triangle_count(const Scene& scene) {
    std::uint64_t count = 0;
    for (const Instance& instance : scene.instances) {
        for (const Primitive& primitive : scene.meshes[instance.mesh].primitives) {
            if (primitive.topology != Topology::triangle_list) continue;
            count += primitive.indices.size() / 3 * instance.transforms.size();
        }
    }
    return count;
}

}  // namespace nacre::scene
