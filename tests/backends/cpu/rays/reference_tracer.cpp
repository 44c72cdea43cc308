// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/rays/reference_tracer.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace nacre::cpu {
namespace {

using Vector = std::array<double, 3>;

Vector operator-(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double length(const Vector& a) { return std::sqrt(dot(a, a)); }

/// Into the world rather than the ray into the object: another way than that of any ray tracer.
Vector to_world(const std::array<float, 12>& m, const std::array<float, 3>& point) {
    Vector result;
    for (std::size_t row = 0; row < 3; ++row)
        result[row] = double{m[row * 4]} * point[0] + double{m[row * 4 + 1]} * point[1] +
                      double{m[row * 4 + 2]} * point[2] + double{m[row * 4 + 3]};
    return result;
}
double determinant(const std::array<float, 12>& m) {
    return dot({m[0], m[1], m[2]}, cross({m[4], m[5], m[6]}, {m[8], m[9], m[10]}));
}

enum RayFlag : std::uint32_t {
    opaque = 0x1,
    no_opaque = 0x2,
    terminate = 0x4,
    cull_back = 0x10,
    cull_front = 0x20,
    cull_opaque = 0x40,
    cull_no_opaque = 0x80,
    skip_triangles = 0x100,
};

bool counts_at_once(const ReferenceGeometry& geometry, const ReferenceInstance& instance, std::uint32_t flags) {
    bool result = geometry.opaque;
    if (has_any(instance.flags, rhi::InstanceFlags::force_opaque)) result = true;
    if (has_any(instance.flags, rhi::InstanceFlags::force_no_opaque)) result = false;
    if (flags & opaque) result = true;
    if (flags & no_opaque) result = false;
    return result;
}

}  // namespace

ReferenceAnswer trace(const ReferenceScene& scene, const ReferenceRay& ray,
                      const std::function<bool(const ReferenceHit&)>& accepts) {
    ReferenceAnswer answer;
    double second = std::numeric_limits<double>::infinity();
    const Vector origin{ray.origin[0], ray.origin[1], ray.origin[2]};
    const Vector direction{ray.direction[0], ray.direction[1], ray.direction[2]};
    const auto come_near = [&](double distance) { answer.margin = std::min(answer.margin, std::abs(distance)); };
    for (std::size_t i = 0; i < scene.instances.size(); ++i) {
        const ReferenceInstance& instance = scene.instances[i];
        const double scale = determinant(instance.transform);
        if ((instance.mask & ray.mask) == 0 || scale == 0 || (ray.flags & skip_triangles)) continue;
        const auto& geometries = scene.meshes[instance.mesh];
        for (std::size_t g = 0; g < geometries.size(); ++g) {
            for (std::size_t p = 0; p < geometries[g].triangles.size(); ++p) {
                std::array<Vector, 3> corners;
                for (std::size_t k = 0; k < 3; ++k)
                    corners[k] = to_world(instance.transform, geometries[g].vertices[geometries[g].triangles[p][k]]);
                const Vector e1 = corners[1] - corners[0], e2 = corners[2] - corners[0],
                             to_origin = origin - corners[0];
                const Vector normal = cross(e1, e2);
                const double along = -dot(direction, normal);
                if (along == 0) continue;
                const Vector q = cross(to_origin, direction);
                ReferenceHit hit{.t = dot(to_origin, normal) / along,
                                 .u = dot(e2, q) / along,
                                 .v = -dot(e1, q) / along,
                                 .instance = static_cast<std::uint32_t>(i),
                                 .geometry = static_cast<std::uint32_t>(g),
                                 .primitive = static_cast<std::uint32_t>(p),
                                 // A mirroring transform turns the normal round in the world, not in the object.
                                 .is_front = (along > 0) == (scale > 0)};
                if (has_any(instance.flags, rhi::InstanceFlags::flip_facing)) hit.is_front = !hit.is_front;
                const double outside = std::max({-hit.u, -hit.v, hit.u + hit.v - 1});
                if (outside > 1e-2 || hit.t < ray.t_min - 1e-2 || hit.t > ray.t_max + 1e-2) continue;
                come_near(outside);
                come_near(hit.t - ray.t_min);
                come_near(hit.t - ray.t_max);
                come_near(along / (length(direction) * length(normal)) / 10);
                if (outside > 0 || hit.t <= ray.t_min || hit.t >= ray.t_max) continue;
                const bool is_opaque = counts_at_once(geometries[g], instance, ray.flags);
                if (ray.flags & (is_opaque ? cull_opaque : cull_no_opaque)) continue;
                if (!has_any(instance.flags, rhi::InstanceFlags::disable_culling) &&
                    (ray.flags & (hit.is_front ? cull_front : cull_back)))
                    continue;
                if (!is_opaque && !accepts(hit)) continue;
                answer.hits.push_back(hit);
                if (hit.t < answer.closest.t)
                    second = answer.closest.t, answer.closest = hit;
                else
                    second = std::min(second, hit.t);
            }
        }
    }
    if (answer.closest.exists()) come_near((second - answer.closest.t) / (1 + answer.closest.t));
    return answer;
}

ReferenceScene random_scene(std::uint32_t seed, std::uint32_t instances) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> around(-1, 1);
    ReferenceScene scene;
    for (std::uint32_t m = 0; m < 3; ++m) {
        auto& geometries = scene.meshes.emplace_back();
        for (std::uint32_t g = 0; g <= m; ++g) {
            ReferenceGeometry& geometry = geometries.emplace_back();
            geometry.opaque = (m + g) % 2 == 0;
            for (std::uint32_t v = 0; v < 24; ++v)
                geometry.vertices.push_back({around(random), around(random), around(random)});
            for (std::uint32_t t = 0; t < 16 + 5 * m; ++t) {
                const std::uint32_t a = static_cast<std::uint32_t>(random() % 24);
                geometry.triangles.push_back({a, static_cast<std::uint32_t>(a + 1 + random() % 11) % 24,
                                              static_cast<std::uint32_t>(a + 12 + random() % 11) % 24});
            }
        }
    }
    using enum rhi::InstanceFlags;
    constexpr rhi::InstanceFlags flags[] = {
        none, disable_culling, flip_facing, force_opaque, force_no_opaque, flip_facing | force_opaque, none, none};
    for (std::uint32_t i = 0; i < instances; ++i) {
        ReferenceInstance& instance = scene.instances.emplace_back();
        instance.mesh = random() % scene.meshes.size();
        instance.custom_index = random() & 0xffffff;
        instance.table_offset = random() & 0xffffff;
        instance.mask = i % 3 == 0 ? 0xff : static_cast<std::uint8_t>(1u << random() % 8);
        instance.flags = flags[random() % std::size(flags)];
        for (std::size_t row = 0; row < 3; ++row)
            for (std::size_t column = 0; column < 4; ++column)
                instance.transform[row * 4 + column] =
                    column == 3 ? 2 * around(random) : 0.6f * around(random) + (row == column ? 0.5f : 0.0f);
        // Some flat ones: never hit, since their matrix has no inverse.
        if (i % 11 == 10) std::fill_n(instance.transform.begin() + 4, 3, 0.0f);
    }
    return scene;
}

std::vector<ReferenceRay> random_rays(std::size_t count, std::uint32_t seed, bool with_flags) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> around(-1, 1);
    constexpr std::uint32_t flags[] = {0,
                                       0,
                                       opaque,
                                       no_opaque,
                                       cull_back,
                                       cull_front,
                                       cull_opaque,
                                       cull_no_opaque,
                                       cull_back | opaque,
                                       cull_front | no_opaque,
                                       skip_triangles};
    std::vector<ReferenceRay> rays(count);
    for (ReferenceRay& ray : rays) {
        for (float& value : ray.origin) value = 4 * around(random);
        for (std::size_t axis = 0; axis < 3; ++axis) ray.direction[axis] = 1.5f * around(random) - ray.origin[axis];
        if (random() % 4 == 0) ray.t_min = 0.5f + 0.5f * around(random);
        if (random() % 4 == 0) ray.t_max = ray.t_min + 1 + around(random);
        if (random() % 3 == 0) ray.mask = random() & 0xff;
        if (with_flags) ray.flags = flags[random() % std::size(flags)];
    }
    return rays;
}

}  // namespace nacre::cpu
