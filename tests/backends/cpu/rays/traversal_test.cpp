// SPDX-License-Identifier: Apache-2.0
// Traversal as compiled code calls it, in packets of every width that Embree has.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>

#include "backends/cpu/rays/ray_query.h"
#include "backends/cpu/rays/ray_scene.h"
#include "tests/backends/cpu/rays/reference_tracer.h"

namespace nacre::cpu {
namespace {

struct Built {
    std::shared_ptr<RayDevice> device;
    std::vector<std::shared_ptr<RayMesh>> meshes;
    std::unique_ptr<RayScene> scene;
};

Built build(const ReferenceScene& from, const std::string& options) {
    Built result;
    auto device = RayDevice::create(1, options);
    if (!device) {
        ADD_FAILURE() << device.error().message();
        return result;
    }
    result.device = *device;
    for (const auto& mesh : from.meshes) {
        std::vector<rhi::GeometryDesc> geometries;
        std::vector<RayGeometrySource> sources;
        for (const ReferenceGeometry& geometry : mesh) {
            geometries.push_back({.opaque = geometry.opaque,
                                  .primitive_count = static_cast<std::uint32_t>(geometry.triangles.size()),
                                  .vertex_count = static_cast<std::uint32_t>(geometry.vertices.size()),
                                  .index_type = rhi::IndexType::uint32});
            sources.push_back(
                {reinterpret_cast<const std::byte*>(geometry.vertices.data()), geometry.vertices.size() * 12,
                 reinterpret_cast<const std::byte*>(geometry.triangles.data()), geometry.triangles.size() * 12});
        }
        result.meshes.push_back(
            std::make_shared<RayMesh>(result.device, geometries, false, rhi::BuildPreference::fast_trace));
        result.meshes.back()->build(sources, false);
    }
    result.scene = std::make_unique<RayScene>(result.device, false, rhi::BuildPreference::fast_trace);
    std::vector<RayInstance> instances;
    for (const ReferenceInstance& instance : from.instances)
        instances.push_back({.mesh = result.meshes[instance.mesh],
                             .to_world = instance.transform,
                             .custom_index = instance.custom_index,
                             .table_offset = instance.table_offset,
                             .mask = instance.mask,
                             .flags = instance.flags});
    result.scene->build(instances, false);
    return result;
}

/// What the compiled code of a query does, for some of the lanes; candidates are confirmed as `accepts` says.
void run_query(RayQueryLanes& query, std::uint32_t lanes, std::uint32_t hints,
               const std::function<bool(std::uint32_t lane, std::uint32_t number)>& accepts) {
    std::uint32_t fresh = lanes, waiting = 0;
    while (fresh != 0 || waiting != 0) {
        waiting = ray_proceed_function()(&query, fresh, waiting, hints, 0);
        fresh = 0;
        std::uint32_t accepted = 0, ended = 0;
        for (std::uint32_t lane = 0; lane < max_lanes; ++lane) {
            const bool waits = (waiting >> lane & 1) != 0;
            query.status[lane] = static_cast<std::uint32_t>(waits ? RayStatus::waiting : RayStatus::finished);
            if (waits && accepts(lane, query.candidate_primitive[lane] + query.candidate_geometry[lane] +
                                           query.candidate_instance[lane]))
                accepted |= 1u << lane;
        }
        ray_confirm_function()(&query, accepted);
        for (std::uint32_t lane = 0; lane < max_lanes; ++lane)
            if (query.status[lane] == static_cast<std::uint32_t>(RayStatus::finished)) ended |= 1u << lane;
        waiting &= ~ended;
    }
}

/// Embree's options for packets of 4, of 8 and of what the machine has.
class RayTraversal : public ::testing::TestWithParam<const char*> {
  public:
    void SetUp() override {
        const auto native = RayDevice::create(1);
        ASSERT_TRUE(native) << native.error().message();
        if (std::string(GetParam()) == "isa=avx2" && (*native)->packet_width() < 8)
            GTEST_SKIP() << "this machine has no AVX2";
    }
};
INSTANTIATE_TEST_SUITE_P(Widths, RayTraversal, ::testing::Values("isa=sse2", "isa=avx2", ""), [](const auto& test) {
    const std::string option = test.param;
    return option.empty() ? "native" : option.substr(4);
});

TEST_P(RayTraversal, PacketsWithSomeOfTheirLanesAgreeWithEveryTriangle) {
    for (const bool is_opaque : {true, false}) {
        ReferenceScene from = random_scene(31, 12);
        if (is_opaque) {
            for (auto& mesh : from.meshes)
                for (ReferenceGeometry& geometry : mesh) geometry.opaque = true;
            for (ReferenceInstance& instance : from.instances) instance.flags = rhi::InstanceFlags::none;
        }
        const Built built = build(from, GetParam());
        ASSERT_TRUE(built.scene);
        std::vector<ReferenceRay> rays = random_rays(1600, 32, !is_opaque);
        std::size_t compared = 0, hits = 0;
        auto query = std::make_unique<RayQueryLanes>();
        for (std::size_t first = 0; first < rays.size(); first += max_lanes) {
            std::memset(query.get(), 0xcd, sizeof *query);
            const auto packet = static_cast<std::uint32_t>(first / max_lanes);
            // All, one, and whatever lies between.
            const std::uint32_t lanes = packet % 4 == 0   ? 0xffffu
                                        : packet % 4 == 1 ? 1u << packet % 16
                                                          : (packet * 2654435761u) >> 16;
            std::uint32_t flags = 0;
            for (std::uint32_t lane = 0; lane < max_lanes; ++lane) {
                const ReferenceRay& ray = rays[first + lane];
                for (std::size_t axis = 0; axis < 3; ++axis)
                    query->origin[axis][lane] = ray.origin[axis], query->direction[axis][lane] = ray.direction[axis];
                query->t_min[lane] = ray.t_min, query->t[lane] = ray.t_max, query->time[lane] = 0;
                query->cull_mask[lane] = ray.mask, query->flags[lane] = ray.flags, query->id[lane] = lane;
                query->primitive[lane] = query->geometry[lane] = query->instance[lane] = no_hit;
                query->scene[lane] = built.scene.get();
                query->status[lane] = static_cast<std::uint32_t>(RayStatus::ready);
                query->kind[lane] = 1;
                if (lanes >> lane & 1) flags |= ray.flags;
            }
            const std::uint32_t similar = packet % 3 == 0 ? std::uint32_t{ray_similar_directions} : 0;
            const std::uint32_t one = packet % 5 == 0 ? std::uint32_t{ray_one_by_one} : 0;
            run_query(*query, lanes, similar | one | ray_one_scene | flags << ray_flags_shift,
                      [&](std::uint32_t lane, std::uint32_t number) { return (number + first + lane) % 3 != 0; });
            for (std::uint32_t lane = 0; lane < max_lanes; ++lane) {
                if ((lanes >> lane & 1) == 0) {
                    ASSERT_EQ(query->geometry[lane], no_hit) << "a lane that is off was traced";
                    continue;
                }
                const ReferenceAnswer expected = trace(from, rays[first + lane], [&](const ReferenceHit& hit) {
                    return (hit.primitive + hit.geometry + hit.instance + first + lane) % 3 != 0;
                });
                if (expected.margin < 1e-4) continue;
                ++compared;
                ASSERT_EQ(query->geometry[lane] != no_hit, expected.closest.exists()) << "ray " << first + lane;
                if (!expected.closest.exists()) continue;
                ++hits;
                ASSERT_EQ(query->instance[lane], expected.closest.instance) << "ray " << first + lane;
                ASSERT_EQ(query->geometry[lane], expected.closest.geometry) << "ray " << first + lane;
                ASSERT_EQ(query->primitive[lane], expected.closest.primitive) << "ray " << first + lane;
                ASSERT_NEAR(query->t[lane], expected.closest.t, 1e-4 * (1 + expected.closest.t))
                    << "ray " << first + lane;
            }
        }
        EXPECT_GT(compared, 300u);
        EXPECT_GT(hits, 100u);
    }
}

TEST_P(RayTraversal, LanesOfSeveralScenesAreTracedInTheirs) {
    const ReferenceScene from[2] = {random_scene(33, 9), random_scene(34, 12)};
    const Built built[2] = {build(from[0], GetParam()), build(from[1], GetParam())};
    const std::vector<ReferenceRay> rays = random_rays(800, 35, true);
    std::size_t hits = 0;
    auto query = std::make_unique<RayQueryLanes>();
    for (std::size_t first = 0; first < rays.size(); first += max_lanes) {
        std::uint32_t flags = 0;
        for (std::uint32_t lane = 0; lane < max_lanes; ++lane) {
            const ReferenceRay& ray = rays[first + lane];
            for (std::size_t axis = 0; axis < 3; ++axis)
                query->origin[axis][lane] = ray.origin[axis], query->direction[axis][lane] = ray.direction[axis];
            query->t_min[lane] = ray.t_min, query->t[lane] = ray.t_max;
            query->cull_mask[lane] = ray.mask, query->flags[lane] = ray.flags, query->id[lane] = lane;
            query->primitive[lane] = query->geometry[lane] = query->instance[lane] = no_hit;
            // Some have none.
            query->scene[lane] = lane % 5 == 4 ? nullptr : built[lane % 2].scene.get();
            query->status[lane] = static_cast<std::uint32_t>(RayStatus::ready);
            flags |= ray.flags;
        }
        run_query(*query, 0xffff, flags << ray_flags_shift, [](std::uint32_t, std::uint32_t) { return true; });
        for (std::uint32_t lane = 0; lane < max_lanes; ++lane) {
            if (lane % 5 == 4) {
                ASSERT_EQ(query->geometry[lane], no_hit);
                continue;
            }
            const ReferenceAnswer expected =
                trace(from[lane % 2], rays[first + lane], [](const ReferenceHit&) { return true; });
            if (expected.margin < 1e-4) continue;
            ASSERT_EQ(query->geometry[lane] != no_hit, expected.closest.exists()) << "ray " << first + lane;
            if (!expected.closest.exists()) continue;
            ++hits;
            ASSERT_EQ(query->instance[lane], expected.closest.instance) << "ray " << first + lane;
            ASSERT_EQ(query->primitive[lane], expected.closest.primitive) << "ray " << first + lane;
        }
    }
    EXPECT_GT(hits, 50u);
}

TEST_P(RayTraversal, EveryBoxOnTheWayIsACandidateOnce) {
    constexpr std::uint32_t count = 60;
    auto device = RayDevice::create(1, GetParam());
    ASSERT_TRUE(device) << device.error().message();
    const auto mesh = std::make_shared<RayMesh>(*device,
                                                std::vector{rhi::GeometryDesc{.type = rhi::GeometryType::boxes,
                                                                              .primitive_count = count,
                                                                              .vertex_stride = 24}},
                                                true, rhi::BuildPreference::fast_trace);
    std::mt19937 random(36);
    std::uniform_real_distribution<float> around(-1, 1);
    for (int frame = 0; frame < 3; ++frame) {
        // Some have no place, some overlap the rays' origins, and the last are beyond the end of the source.
        std::vector<std::array<float, 6>> boxes(count);
        for (std::uint32_t i = 0; i < count; ++i)
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const float center = 2 * around(random), half = 0.6f + 0.5f * around(random);
                boxes[i][axis] = center - half, boxes[i][axis + 3] = center + half;
            }
        const auto is_broken = [&](std::uint32_t i) { return i % 9 == 4 || i >= count - 2; };
        std::vector<std::array<float, 6>> given = boxes;
        given.resize(count - 2);
        for (std::uint32_t i = 4; i < given.size(); i += 9)
            given[i][i % 6] = i % 2 ? std::numeric_limits<float>::quiet_NaN() : (i % 6 < 3 ? 1e20f : -1e20f);
        const RayGeometrySource source{reinterpret_cast<const std::byte*>(given.data()), given.size() * 24, nullptr, 0};
        mesh->build(std::span(&source, 1), frame > 0);
        RayScene scene(*device, false, rhi::BuildPreference::fast_trace);
        std::vector<RayInstance> instances(1);
        instances[0] = {.mesh = mesh, .to_world = ReferenceInstance{}.transform, .mask = 0xff};
        // With the instance, and without.
        if (frame == 1) instances[0].to_world[3] = 0.5f;
        scene.build(instances, false);
        const std::vector<ReferenceRay> rays = random_rays(320, 37 + static_cast<std::uint32_t>(frame), false);
        std::size_t most = 0;
        auto query = std::make_unique<RayQueryLanes>();
        for (std::size_t first = 0; first < rays.size(); first += max_lanes) {
            std::memset(query.get(), 0xcd, sizeof *query);
            for (std::uint32_t lane = 0; lane < max_lanes; ++lane) {
                const ReferenceRay& ray = rays[first + lane];
                for (std::size_t axis = 0; axis < 3; ++axis)
                    query->origin[axis][lane] = ray.origin[axis], query->direction[axis][lane] = ray.direction[axis];
                query->t_min[lane] = ray.t_min, query->t[lane] = ray.t_max, query->time[lane] = 0;
                query->cull_mask[lane] = 0xff, query->flags[lane] = 0, query->id[lane] = lane;
                query->primitive[lane] = query->geometry[lane] = query->instance[lane] = no_hit;
                query->scene[lane] = &scene;
            }
            std::vector<std::uint32_t> seen[max_lanes];
            float last[max_lanes] = {};
            run_query(*query, 0xffff, ray_one_scene, [&](std::uint32_t lane, std::uint32_t) {
                EXPECT_EQ(query->candidate_kind[lane], ray_candidate_box | ray_candidate_opaque);
                EXPECT_GE(query->candidate_t[lane], last[lane]);
                last[lane] = query->candidate_t[lane];
                seen[lane].push_back(query->candidate_primitive[lane]);
                return true;  // Which is no answer to a box.
            });
            for (std::uint32_t lane = 0; lane < max_lanes; ++lane) {
                ASSERT_EQ(query->geometry[lane], no_hit) << "a box was confirmed like a triangle";
                const ReferenceRay& ray = rays[first + lane];
                most = std::max(most, seen[lane].size());
                for (std::uint32_t i = 0; i < count; ++i) {
                    double enters = ray.t_min, leaves = ray.t_max;
                    for (std::size_t axis = 0; axis < 3; ++axis) {
                        const double shift = axis == 0 ? double{instances[0].to_world[3]} : 0;
                        const double a = (boxes[i][axis] + shift - ray.origin[axis]) / ray.direction[axis];
                        const double b = (boxes[i][axis + 3] + shift - ray.origin[axis]) / ray.direction[axis];
                        enters = std::max(enters, std::min(a, b)), leaves = std::min(leaves, std::max(a, b));
                    }
                    if (std::abs(leaves - enters) < 1e-4) continue;
                    const auto times = std::ranges::count(seen[lane], i);
                    ASSERT_EQ(times, leaves > enters && !is_broken(i) ? 1 : 0)
                        << "ray " << first + lane << ", box " << i;
                }
            }
        }
        EXPECT_GT(most, std::size_t{kept_candidates});
    }
}

}  // namespace
}  // namespace nacre::cpu
