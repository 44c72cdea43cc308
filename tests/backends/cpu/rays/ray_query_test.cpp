// SPDX-License-Identifier: Apache-2.0
// Ray queries of compute shaders on the CPU backend, for every number of lanes, and on Vulkan where the driver has
// them, against every triangle in double precision.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"
#include "tests/backends/cpu/rays/reference_tracer.h"

namespace nacre::cpu {
namespace {

using namespace rhi;

/// As shaders write it.
struct Hit {
    std::uint32_t type = 0;
    float t = 0;
    std::uint32_t primitive = 0, geometry = 0;
    std::uint32_t instance = 0, custom_index = 0, table_offset = 0, front_face = 0;
    float u = 0, v = 0;
    std::uint32_t candidates = 0, bad_candidates = 0;
};
static_assert(sizeof(ReferenceRay) == 48 && sizeof(Hit) == 48);

const std::string declarations = R"(
#extension GL_EXT_ray_query : require
layout(local_size_x = 64) in;
struct Ray { vec3 origin; float t_min; vec3 direction; float t_max; uvec4 flags; };
struct Hit { uvec4 a; uvec4 b; uvec4 c; };
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1) readonly buffer Rays { Ray rays[]; };
layout(set = 0, binding = 2) writeonly buffer Hits { Hit hits[]; };
void store(uint i, rayQueryEXT query, uvec2 candidates) {
    Hit hit = Hit(uvec4(0), uvec4(0), uvec4(0, 0, candidates));
    hit.a.x = rayQueryGetIntersectionTypeEXT(query, true);
    if (hit.a.x != gl_RayQueryCommittedIntersectionNoneEXT) {
        hit.a.y = floatBitsToUint(rayQueryGetIntersectionTEXT(query, true));
        hit.a.z = rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
        hit.a.w = rayQueryGetIntersectionGeometryIndexEXT(query, true);
        hit.b.x = rayQueryGetIntersectionInstanceIdEXT(query, true);
        hit.b.y = rayQueryGetIntersectionInstanceCustomIndexEXT(query, true);
        hit.b.z = rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, true);
        hit.b.w = rayQueryGetIntersectionFrontFaceEXT(query, true) ? 1u : 0u;
        hit.c.xy = floatBitsToUint(rayQueryGetIntersectionBarycentricsEXT(query, true));
    }
    hits[i] = hit;
}
// Candidates of two in three triangles are confirmed. Those that lie outside of the ray or of their triangle are counted.
uvec2 walk(uint i, rayQueryEXT query) {
    uvec2 candidates = uvec2(0);
    while (rayQueryProceedEXT(query)) {
        ++candidates.x;
        float t = rayQueryGetIntersectionTEXT(query, false);
        vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, false);
        if (t < rays[i].t_min || t > rays[i].t_max || any(lessThan(uv, vec2(-0.001))) || uv.x + uv.y > 1.001 ||
            rayQueryGetIntersectionTypeEXT(query, false) != gl_RayQueryCandidateIntersectionTriangleEXT)
            ++candidates.y;
        uint number = rayQueryGetIntersectionPrimitiveIndexEXT(query, false) +
                      rayQueryGetIntersectionGeometryIndexEXT(query, false) + rayQueryGetIntersectionInstanceIdEXT(query, false);
        if ((number + i) % 3 != 0) rayQueryConfirmIntersectionEXT(query);
    }
    return candidates;
}
void trace(uint i) {
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, rays[i].flags.x, rays[i].flags.y, rays[i].origin, rays[i].t_min, rays[i].direction,
                          rays[i].t_max);
    uvec2 candidates = walk(i, query);
    store(i, query, candidates);
}
)";
const std::string each_ray = declarations + R"(
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < rays.length()) trace(i);
}
)";

bool accepts(std::size_t ray, const ReferenceHit& hit) {
    return (hit.primitive + hit.geometry + hit.instance + ray) % 3 != 0;
}

/// A device with a scene in it.
class World {
  public:
    explicit World(const std::string& spec) {
        static const Instance instance(all_backends());
        auto made = instance.create_device({.backend = spec, .driver_validation = true});
        if (!made) {
            absent_ = made.error().message();
            // A driver that is here and fails is a failure.
            if (made.error().code != ErrorCode::not_found) ADD_FAILURE() << absent_;
            return;
        }
        device_ = std::move(*made);
        device_->set_message_callback([](const Message& message) {
            if (message.severity != MessageSeverity::info) ADD_FAILURE() << message.code << ": " << message.text;
        });
        if (!device_->capabilities().ray_query) absent_ = spec + " has no ray queries on this machine";
    }

    /// Why nothing can be tested here; empty where it can.
    [[nodiscard]] const std::string& absent() const { return absent_; }
    rhi::Device& device() { return *device_; }

    template <typename T>
    static T ok(Expected<T> value) {
        if (!value) {
            ADD_FAILURE() << value.error().message();
            return T{};
        }
        return *std::move(value);
    }
    static void ok(const Expected<void>& value) {
        if (!value) ADD_FAILURE() << value.error().message();
    }

    template <typename T>
    Buffer buffer_of(const std::vector<T>& values, BufferUsage usage) {
        const Buffer made =
            ok(device_->create_buffer({.size = std::max<std::size_t>(values.size() * sizeof(T), 16), .usage = usage}));
        if (!values.empty()) ok(device_->write_buffer(made, std::as_bytes(std::span(values))));
        return made;
    }

    void build(const ReferenceScene& scene, bool allow_update = false,
               BuildPreference prefer = BuildPreference::fast_trace) {
        CommandList list = device_->create_command_list("build");
        meshes.clear();
        sources.clear();
        for (const auto& mesh : scene.meshes) {
            AccelerationStructureDesc desc{.allow_update = allow_update, .prefer = prefer};
            auto& of_mesh = sources.emplace_back();
            for (const ReferenceGeometry& geometry : mesh) {
                desc.geometries.push_back({.opaque = geometry.opaque,
                                           .primitive_count = static_cast<std::uint32_t>(geometry.triangles.size()),
                                           .vertex_count = static_cast<std::uint32_t>(geometry.vertices.size()),
                                           .index_type = IndexType::uint32});
                of_mesh.push_back(
                    {.vertices = buffer_of(geometry.vertices, BufferUsage::acceleration_structure_input),
                     .indices = buffer_of(geometry.triangles, BufferUsage::acceleration_structure_input)});
            }
            meshes.push_back(ok(device_->create_acceleration_structure(desc)));
            list.build_acceleration_structure(meshes.back(), of_mesh);
        }
        top = ok(device_->create_acceleration_structure(
            {.level = AccelerationStructureLevel::top,
             .max_instances = std::max<std::uint32_t>(1, static_cast<std::uint32_t>(scene.instances.size())),
             .allow_update = allow_update}));
        list.build_acceleration_structure(top, instances_of(scene));
        submit(std::move(list));
    }
    [[nodiscard]] std::vector<AccelerationStructureInstance> instances_of(const ReferenceScene& scene) const {
        std::vector<AccelerationStructureInstance> result;
        for (const ReferenceInstance& instance : scene.instances)
            result.push_back({.bottom_level = meshes[instance.mesh],
                              .transform = instance.transform,
                              .custom_index = instance.custom_index,
                              .table_offset = instance.table_offset,
                              .mask = instance.mask,
                              .flags = instance.flags});
        return result;
    }
    void update(const ReferenceScene& scene) {
        CommandList list = device_->create_command_list("update");
        for (std::size_t m = 0; m < meshes.size(); ++m) {
            for (std::size_t g = 0; g < sources[m].size(); ++g)
                ok(device_->write_buffer(sources[m][g].vertices,
                                         std::as_bytes(std::span(scene.meshes[m][g].vertices))));
            list.update_acceleration_structure(meshes[m], sources[m]);
        }
        list.update_acceleration_structure(top, instances_of(scene));
        submit(std::move(list));
    }
    void submit(CommandList list) {
        ok(list.status());
        const Fence fence = ok(device_->submit(std::move(list)));
        ok(device_->wait(fence));
    }
    std::vector<Hit> trace(const std::vector<ReferenceRay>& rays, const std::string& text = each_ray,
                           const std::vector<BindGroupEntry>& more = {}) {
        ShaderCompiler compiler({});
        const Shader shader =
            ok(device_->create_shader(ok(compiler.compile({.path = "rays.comp", .text = "#version 460\n" + text}))));
        const ComputePipeline pipeline = ok(device_->create_compute_pipeline({.shader = shader, .name = "rays"}));
        const Buffer input = buffer_of(rays, BufferUsage::storage);
        const Buffer output = buffer_of(std::vector<Hit>(rays.size()), BufferUsage::storage);
        std::vector<BindGroupEntry> entries = more;
        entries.push_back({.binding = 0, .acceleration_structure = top});
        entries.push_back({.binding = 1, .buffer = input});
        entries.push_back({.binding = 2, .buffer = output});
        const BindGroup group = ok(device_->create_bind_group(
            {.layout = ok(device_->bind_group_layout(pipeline, 0)), .entries = entries, .name = "rays"}));
        CommandList list = device_->create_command_list("trace");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group);
        list.dispatch({.x = static_cast<std::uint32_t>((rays.size() + 63) / 64)});
        submit(std::move(list));
        const std::vector<std::byte> bytes = ok(device_->read_buffer(output));
        std::vector<Hit> hits(rays.size());
        if (bytes.size() >= hits.size() * sizeof(Hit))
            std::memcpy(hits.data(), bytes.data(), hits.size() * sizeof(Hit));
        return hits;
    }

    std::vector<AccelerationStructure> meshes;
    std::vector<std::vector<GeometrySource>> sources;
    AccelerationStructure top;

  private:
    std::unique_ptr<rhi::Device> device_;
    std::string absent_;
};

/// Every ray that is clear of ties and edges must agree, and enough of them must be.
void expect_agreement(const ReferenceScene& scene, const std::vector<ReferenceRay>& rays,
                      const std::vector<Hit>& hits) {
    std::size_t compared = 0, hit_count = 0, unlike = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const ReferenceAnswer expected =
            trace(scene, rays[i], [&](const ReferenceHit& hit) { return accepts(i, hit); });
        ASSERT_EQ(hits[i].bad_candidates, 0u) << "ray " << i;
        if (expected.margin < 1e-4) continue;
        ++compared;
        const ReferenceHit* hit = expected.closest.exists() ? &expected.closest : nullptr;
        if (hit && (rays[i].flags & 4u)) {
            // Any of them will do.
            hit = nullptr;
            for (const ReferenceHit& each : expected.hits)
                if (each.instance == hits[i].instance && each.geometry == hits[i].geometry &&
                    each.primitive == hits[i].primitive)
                    hit = &each;
            ASSERT_TRUE(hit) << "ray " << i << " hit what it cannot";
        }
        ASSERT_EQ(hits[i].type, hit ? 1u : 0u) << "ray " << i << ", flags " << rays[i].flags;
        if (!hit) continue;
        ++hit_count;
        unlike += hit->t != expected.closest.t;
        const ReferenceInstance& instance = scene.instances[hit->instance];
        ASSERT_EQ(hits[i].instance, hit->instance) << "ray " << i;
        ASSERT_EQ(hits[i].geometry, hit->geometry) << "ray " << i;
        ASSERT_EQ(hits[i].primitive, hit->primitive) << "ray " << i;
        ASSERT_EQ(hits[i].custom_index, instance.custom_index) << "ray " << i;
        ASSERT_EQ(hits[i].table_offset, instance.table_offset) << "ray " << i;
        ASSERT_EQ(hits[i].front_face, hit->is_front ? 1u : 0u) << "ray " << i;
        ASSERT_NEAR(hits[i].t, hit->t, 1e-4 * (1 + hit->t)) << "ray " << i;
        ASSERT_NEAR(hits[i].u, hit->u, 2e-3) << "ray " << i;
        ASSERT_NEAR(hits[i].v, hit->v, 2e-3) << "ray " << i;
    }
    EXPECT_GT(compared, rays.size() / 2);
    EXPECT_GT(hit_count, rays.size() / 10);
}

class CpuRayQueries : public ::testing::TestWithParam<const char*> {
  public:
    CpuRayQueries() : world(GetParam()) {}
    void SetUp() override {
        if (!world.absent().empty()) GTEST_SKIP() << world.absent();
    }
    [[nodiscard]] bool is_cpu() const { return std::string(GetParam()).starts_with("cpu"); }
    World world;
};

INSTANTIATE_TEST_SUITE_P(Rays, CpuRayQueries,
                         ::testing::Values("cpu:fast:lanes=16", "cpu:fast:lanes=8", "cpu:fast:lanes=4",
                                           "cpu:consistent:lanes=16", "cpu:consistent:lanes=4", "vulkan"),
                         [](const auto& test) {
                             std::string name = test.param;
                             for (char& letter : name)
                                 if (!std::isalnum(static_cast<unsigned char>(letter))) letter = '_';
                             return name;
                         });

TEST_P(CpuRayQueries, InstancesFlagsMasksAndAlphaTestsAgreeWithEveryTriangle) {
    const ReferenceScene scene = random_scene(1, 24);
    world.build(scene);
    const std::vector<ReferenceRay> rays = random_rays(1500, 2, true);
    expect_agreement(scene, rays, world.trace(rays));
}

TEST_P(CpuRayQueries, AnInstanceAloneAgreesWithEveryTriangle) {
    // With a transform, and in place, where the CPU backend goes without the instance.
    for (const bool in_place : {false, true}) {
        ReferenceScene scene = random_scene(3, 1);
        scene.instances[0].mesh = 2;
        scene.instances[0].flags = InstanceFlags::none;
        scene.instances[0].transform = {1.5f, 0.2f, 0, 0.1f, -0.3f, 1.2f, 0, 0, 0, 0.4f, 2, -0.2f};
        if (in_place) scene.instances[0].transform = ReferenceInstance{}.transform;
        // One that is not hit stands before, so that the number of the other is not 0.
        scene.instances.insert(scene.instances.begin(), {.mask = 0});
        world.build(scene, false, in_place ? BuildPreference::fast_build : BuildPreference::fast_trace);
        const std::vector<ReferenceRay> rays = random_rays(800, 4, true);
        expect_agreement(scene, rays, world.trace(rays));
    }
}

TEST_P(CpuRayQueries, OpaqueScenesAgreeWithEveryTriangle) {
    ReferenceScene scene = random_scene(5, 9);
    for (auto& mesh : scene.meshes)
        for (ReferenceGeometry& geometry : mesh) geometry.opaque = true;
    for (ReferenceInstance& instance : scene.instances) instance.flags = InstanceFlags::none;
    world.build(scene);
    const std::vector<ReferenceRay> rays = random_rays(1000, 6, false);
    const std::vector<Hit> hits = world.trace(rays);
    expect_agreement(scene, rays, hits);
    for (const Hit& hit : hits) ASSERT_EQ(hit.candidates, 0u);
}

TEST_P(CpuRayQueries, RaysThatTerminateHitSomethingThatCounts) {
    const ReferenceScene scene = random_scene(7, 16);
    world.build(scene);
    std::vector<ReferenceRay> rays = random_rays(1000, 8, true);
    for (ReferenceRay& ray : rays) ray.flags |= 4;
    const std::vector<Hit> hits = world.trace(rays);
    expect_agreement(scene, rays, hits);
    // The same question without what would tell the hits apart, which lets the CPU backend look for occlusion only.
    const std::string whether = R"(
        void main() {
            uint i = gl_GlobalInvocationID.x;
            if (i >= rays.length()) return;
            rayQueryEXT query;
            rayQueryInitializeEXT(query, scene, gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsOpaqueEXT, rays[i].flags.y,
                                  rays[i].origin, rays[i].t_min, rays[i].direction, rays[i].t_max);
            rayQueryProceedEXT(query);
            hits[i] = Hit(uvec4(rayQueryGetIntersectionTypeEXT(query, true), 0, 0, 0), uvec4(0), uvec4(0));
        })";
    const std::vector<Hit> occluded =
        world.trace(rays, declarations.substr(0, declarations.find("void store")) + whether);
    std::size_t hit_count = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        ReferenceRay ray = rays[i];
        ray.flags = 1;
        const ReferenceAnswer expected = trace(scene, ray, [](const ReferenceHit&) { return true; });
        if (expected.margin < 1e-4) continue;
        ASSERT_EQ(occluded[i].type, expected.closest.exists() ? 1u : 0u) << "ray " << i;
        hit_count += occluded[i].type;
    }
    EXPECT_GT(hit_count, 100u);
}

TEST_P(CpuRayQueries, QueriesTellWhatTheyWereGivenAndEndWhenTold) {
    const ReferenceScene scene = random_scene(9, 16);
    world.build(scene);
    std::vector<ReferenceRay> rays = random_rays(1000, 10, true);
    // Without opaque triangles, so that each one is a candidate.
    for (ReferenceRay& ray : rays) ray.flags = 2;
    const std::string text = R"(
        void main() {
            uint i = gl_GlobalInvocationID.x;
            if (i >= rays.length()) return;
            rayQueryEXT query;
            rayQueryInitializeEXT(query, scene, rays[i].flags.x, rays[i].flags.y, rays[i].origin, rays[i].t_min,
                                  rays[i].direction, rays[i].t_max);
            uint steps = 0u;
            while (rayQueryProceedEXT(query)) {
                ++steps;
                rayQueryConfirmIntersectionEXT(query);
                rayQueryTerminateEXT(query);
            }
            uvec3 origin = floatBitsToUint(rayQueryGetWorldRayOriginEXT(query)),
                  direction = floatBitsToUint(rayQueryGetWorldRayDirectionEXT(query));
            hits[i] = Hit(uvec4(rayQueryGetRayFlagsEXT(query), floatBitsToUint(rayQueryGetRayTMinEXT(query)), origin.xy),
                          uvec4(origin.z, direction),
                          uvec4(steps, rayQueryGetIntersectionTypeEXT(query, true), rayQueryProceedEXT(query), 0));
        })";
    const std::vector<Hit> hits = world.trace(rays, declarations.substr(0, declarations.find("void store")) + text);
    std::size_t hit_count = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        std::array<std::uint32_t, 12> found;
        std::memcpy(found.data(), &hits[i], sizeof found);
        std::array<std::uint32_t, 8> given{2, std::bit_cast<std::uint32_t>(rays[i].t_min)};
        std::memcpy(&given[2], &rays[i].origin, 12);
        std::memcpy(&given[5], &rays[i].direction, 12);
        for (std::size_t word = 0; word < given.size(); ++word)
            ASSERT_EQ(found[word], given[word]) << "ray " << i << ", word " << word;
        ASSERT_LE(found[8], 1u) << "ray " << i << " went on after its end";
        ASSERT_EQ(found[9], found[8]) << "ray " << i;
        ASSERT_EQ(found[10], 0u) << "ray " << i;
        const ReferenceAnswer expected = trace(scene, rays[i], [](const ReferenceHit&) { return true; });
        if (expected.margin < 1e-4) continue;
        ASSERT_EQ(found[8], expected.closest.exists() ? 1u : 0u) << "ray " << i;
        hit_count += found[8];
    }
    EXPECT_GT(hit_count, 100u);
}

TEST_P(CpuRayQueries, LanesThatDivergeTraceTheirOwnRays) {
    const ReferenceScene scene = random_scene(9, 16);
    world.build(scene);
    const std::vector<ReferenceRay> rays = random_rays(64 * 24, 10, true);
    // Each invocation has 24 rays; how many of them it traces at once with others, in which branch, and in which order,
    // differs.
    expect_agreement(scene, rays, world.trace(rays, declarations + R"(
        void main() {
            if (gl_WorkGroupID.x > 0) return;
            uint mine = gl_LocalInvocationIndex, count = 24;
            uint k = 0;
            while (k < count) {
                uint step = mine % 5 + 1;
                for (uint n = 0; n < step && k < count; ++n, ++k) {
                    uint i = mine * count + k;
                    if (mine % 16 == 3) trace(i);
                    else if ((mine ^ k) % 3 == 0) {
                        rayQueryEXT query;
                        rayQueryInitializeEXT(query, scene, rays[i].flags.x, rays[i].flags.y, rays[i].origin, rays[i].t_min,
                                              rays[i].direction, rays[i].t_max);
                        uvec2 candidates = walk(i, query);
                        store(i, query, candidates);
                    } else {
                        switch (k % 4) {
                            case 0: trace(i); break;
                            case 1:
                            case 2: if (mine < 32) { trace(i); } else { trace(i); } break;
                            default: trace(i);
                        }
                    }
                }
            }
        })"));
}

TEST_P(CpuRayQueries, UpdatesAgreeWithEveryTriangle) {
    ReferenceScene scene = random_scene(11, 12);
    world.build(scene, true);
    std::uint32_t state = 1;
    for (int frame = 0; frame < 3; ++frame) {
        for (auto& mesh : scene.meshes)
            for (ReferenceGeometry& geometry : mesh)
                for (auto& vertex : geometry.vertices)
                    for (float& value : vertex) {
                        state = state * 1664525u + 1013904223u;
                        value += 0.2f * (static_cast<float>(state >> 8) * 0x1p-24f - 0.5f);
                    }
        for (ReferenceInstance& instance : scene.instances) instance.transform[3] += 0.05f;
        world.update(scene);
        const std::vector<ReferenceRay> rays = random_rays(500, 12, true);
        expect_agreement(scene, rays, world.trace(rays));
    }
}

TEST_P(CpuRayQueries, TrianglesWithoutAreaAreNeverHit) {
    if (!is_cpu()) GTEST_SKIP() << "lavapipe of Mesa 25.0 hits triangles that are a line";
    ReferenceScene scene;
    ReferenceGeometry& geometry = scene.meshes.emplace_back().emplace_back();
    geometry.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0.5f, 0, 0}, {0, 0, 0}};
    geometry.triangles = {{0, 0, 0}, {0, 1, 1}, {0, 1, 2}, {3, 1, 0}, {0, 4, 1}};
    scene.instances.emplace_back();
    world.build(scene);
    std::vector<ReferenceRay> rays = random_rays(256, 13, false);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        // Straight at the line that they have become.
        const float along = static_cast<float>(i) / 128.0f;
        for (std::size_t axis = 0; axis < 3; ++axis)
            rays[i].direction[axis] = (axis == 0 ? along : 0) - rays[i].origin[axis];
        rays[i].mask = 0xff;
    }
    for (const Hit& hit : world.trace(rays)) ASSERT_EQ(hit.type, 0u);
}

TEST_P(CpuRayQueries, MeshesThatAreBrokenAreHitWhereTheyAreSound) {
    if (!is_cpu()) GTEST_SKIP() << "Vulkan leaves open what becomes of such vertices and indices";
    const float infinity = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
    for (const float bad : {nan, infinity, -infinity, 1e30f, -3e38f}) {
        ReferenceScene scene = random_scene(14, 6), sound = scene;
        for (ReferenceInstance& instance : scene.instances) instance.flags = InstanceFlags::none;
        sound.instances = scene.instances;
        for (std::size_t m = 0; m < scene.meshes.size(); ++m)
            for (std::size_t g = 0; g < scene.meshes[m].size(); ++g) {
                ReferenceGeometry& geometry = scene.meshes[m][g];
                std::vector<bool> is_bad(geometry.vertices.size());
                for (std::size_t v = 0; v < geometry.vertices.size(); v += 5)
                    geometry.vertices[v][v % 3] = bad, is_bad[v] = true;
                // Indices beyond the vertices, too.
                geometry.triangles[2][1] = 24;
                geometry.triangles[5][0] = ~0u;
                for (std::size_t p = 0; p < geometry.triangles.size(); ++p)
                    for (const std::uint32_t corner : geometry.triangles[p])
                        if (corner >= is_bad.size() || is_bad[corner]) sound.meshes[m][g].triangles[p] = {1, 1, 1};
            }
        world.build(scene);
        const std::vector<ReferenceRay> rays = random_rays(300, 15, false);
        expect_agreement(sound, rays, world.trace(rays));
    }
}

TEST_P(CpuRayQueries, RaysThatAreNoRaysHitNothingAndHarmNone) {
    if (!is_cpu()) GTEST_SKIP() << "Vulkan leaves open what becomes of such rays";
    const ReferenceScene scene = random_scene(16, 12);
    world.build(scene);
    const float infinity = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
    std::vector<ReferenceRay> rays = random_rays(1000, 17, true);
    std::vector<bool> is_bad(rays.size());
    for (std::size_t i = 0; i < rays.size(); i += 2) {
        ReferenceRay& ray = rays[i];
        is_bad[i] = true;
        const float bad = i % 3 == 0 ? nan : i % 3 == 1 ? infinity : -2e10f;
        switch (i / 2 % 6) {
            case 0: ray.origin[i % 3] = bad; break;
            case 1: ray.direction[i % 3] = bad; break;
            case 2: ray.t_min = i % 3 == 0 ? nan : -0.5f; break;
            case 3: ray.t_max = i % 3 == 0 ? nan : -1.0f; break;
            case 4: ray.t_min = 2, ray.t_max = 1; break;
            default: ray.direction = {0, 0, 0};
        }
    }
    const std::vector<Hit> hits = world.trace(rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!is_bad[i]) continue;
        ASSERT_EQ(hits[i].type, 0u) << "ray " << i;
    }
    // The others are as they would be without them: every ray asks in its own name, so their numbers stay.
    std::vector<ReferenceRay> others = rays;
    for (std::size_t i = 0; i < rays.size(); ++i)
        if (is_bad[i]) others[i] = {.origin = {9, 9, 9}, .direction = {1, 1, 1}, .mask = 0};
    expect_agreement(scene, others, hits);
    // An interval without an end, and one that starts at a zero with a sign, are in order.
    std::vector<ReferenceRay> endless = random_rays(500, 18, false);
    for (ReferenceRay& ray : endless) ray.t_min = -0.0f, ray.t_max = infinity;
    const std::vector<Hit> endless_hits = world.trace(endless);
    for (ReferenceRay& ray : endless) ray.t_max = 1e9f;
    expect_agreement(scene, endless, endless_hits);
}

TEST_P(CpuRayQueries, CandidatesBeyondThoseThatAreKeptComeToo) {
    // Panes one behind the other, of which each ray wants one, or none.
    constexpr std::uint32_t panes = 50;
    ReferenceScene scene;
    ReferenceGeometry& geometry = scene.meshes.emplace_back().emplace_back();
    geometry.opaque = false;
    for (std::uint32_t i = 0; i < panes; ++i) {
        const auto z = static_cast<float>(i + 1);
        for (const auto& [x, y] : {std::pair(-9.0f, -9.0f), std::pair(20.0f, -9.0f), std::pair(-9.0f, 20.0f)})
            geometry.vertices.push_back({x, y, z});
        geometry.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    scene.instances.resize(1);
    for (const bool in_place : {true, false}) {
        if (!in_place) scene.instances[0].transform[11] = 1;
        for (const std::uint32_t flags : {0x0u, 0x2u}) {
            world.build(scene);
            std::vector<ReferenceRay> rays(panes + 14);
            for (std::size_t i = 0; i < rays.size(); ++i) {
                const float x = 0.01f * static_cast<float>(i);
                rays[i] = {.origin = {x, x, 0}, .direction = {0.1f, 0, 1}, .flags = flags};
            }
            const std::vector<Hit> hits =
                world.trace(rays, declarations.substr(0, declarations.find("// Candidates of")) + R"(
                void main() {
                    uint i = gl_GlobalInvocationID.x;
                    if (i >= rays.length()) return;
                    rayQueryEXT query;
                    rayQueryInitializeEXT(query, scene, rays[i].flags.x, 0xff, rays[i].origin, 0, rays[i].direction, 1000);
                    uvec2 candidates = uvec2(0);
                    while (rayQueryProceedEXT(query)) {
                        ++candidates.x;
                        if (rayQueryGetIntersectionPrimitiveIndexEXT(query, false) == i) rayQueryConfirmIntersectionEXT(query);
                    }
                    store(i, query, candidates);
                })");
            for (std::uint32_t i = 0; i < hits.size(); ++i) {
                ASSERT_EQ(hits[i].type, i < panes ? 1u : 0u) << "ray " << i << ", flags " << flags;
                if (i >= panes) {
                    ASSERT_EQ(hits[i].candidates, panes) << "ray " << i;
                    continue;
                }
                ASSERT_EQ(hits[i].primitive, i);
                ASSERT_FLOAT_EQ(hits[i].t, static_cast<float>(i + 1) + (in_place ? 0.0f : 1.0f));
                // On the CPU backend by rising distance: none twice, none behind the one that was confirmed.
                if (is_cpu()) {
                    ASSERT_EQ(hits[i].candidates, i + 1);
                }
            }
        }
    }
}

TEST_P(CpuRayQueries, SpheresInBoxesAgreeWithTheirEquation) {
    constexpr std::uint32_t count = 30;  // Of each of two geometries, the first of them opaque.
    struct Sphere {
        std::array<float, 3> center;
        float radius;
    };
    ReferenceScene scene = random_scene(40, 12);
    scene.meshes.emplace_back().emplace_back();  // Place of the boxes.
    for (std::size_t i = 0; i < scene.instances.size(); ++i) {
        scene.instances[i].flags = InstanceFlags::none;
        if (i % 2 == 0) scene.instances[i].mesh = 3;
    }
    std::vector<Sphere> spheres;
    std::uint32_t state = 5;
    const auto next = [&] {
        state = state * 1664525u + 1013904223u;
        return static_cast<float>(state >> 8) * 0x1p-24f;
    };
    world.build(scene, true);
    const AccelerationStructure boxes = World::ok(world.device().create_acceleration_structure(
        {.geometries = {{.type = GeometryType::boxes, .opaque = true, .primitive_count = count, .vertex_stride = 24},
                        {.type = GeometryType::boxes, .opaque = false, .primitive_count = count, .vertex_stride = 32}},
         .allow_update = true}));
    world.meshes[3] = boxes;
    const std::string text = declarations.substr(0, declarations.find("// Candidates of")) + R"(
        layout(set = 0, binding = 3) readonly buffer Spheres { vec4 spheres[]; };
        void main() {
            uint i = gl_GlobalInvocationID.x;
            if (i >= rays.length()) return;
            rayQueryEXT query;
            rayQueryInitializeEXT(query, scene, rays[i].flags.x, rays[i].flags.y, rays[i].origin, rays[i].t_min, rays[i].direction,
                                  rays[i].t_max);
            uvec2 candidates = uvec2(0);
            while (rayQueryProceedEXT(query)) {
                ++candidates.x;
                uint geometry = rayQueryGetIntersectionGeometryIndexEXT(query, false);
                uint primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, false);
                if (rayQueryGetIntersectionTypeEXT(query, false) != gl_RayQueryCandidateIntersectionAABBEXT) {
                    if ((primitive + geometry + rayQueryGetIntersectionInstanceIdEXT(query, false) + i) % 3 != 0)
                        rayQueryConfirmIntersectionEXT(query);
                    continue;
                }
                if ((rays[i].flags.x & 3u) == 0u && rayQueryGetIntersectionCandidateAABBOpaqueEXT(query) != (geometry == 0)) ++candidates.y;
                vec4 sphere = spheres[geometry * )" +
                             std::to_string(count) + R"( + primitive];
                vec3 o = rayQueryGetIntersectionObjectRayOriginEXT(query, false) - sphere.xyz;
                vec3 d = rayQueryGetIntersectionObjectRayDirectionEXT(query, false);
                float a = dot(d, d), b = dot(o, d);
                vec3 foot = o - d * (b / a);
                float below = sphere.w * sphere.w - dot(foot, foot);
                if (below < 0) continue;
                float half_chord = sqrt(below / a);
                float limit = rays[i].t_max;
                if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT)
                    limit = rayQueryGetIntersectionTEXT(query, true);
                float t = -b / a - half_chord;
                if (t < rays[i].t_min) t = -b / a + half_chord;
                if (t >= rays[i].t_min && t <= limit) rayQueryGenerateIntersectionEXT(query, t);
            }
            store(i, query, candidates);
        })";
    for (int frame = 0; frame < 2; ++frame) {
        spheres.clear();
        for (std::uint32_t i = 0; i < 2 * count; ++i)
            spheres.push_back({{2 * next() - 1, 2 * next() - 1, 2 * next() - 1}, 0.05f + 0.2f * next()});
        std::vector<float> first, second;
        const float nan = std::numeric_limits<float>::quiet_NaN();
        const auto is_broken = [&](std::uint32_t i) { return is_cpu() && i % 7 == 3; };
        for (std::uint32_t i = 0; i < 2 * count; ++i) {
            auto& to = i < count ? first : second;
            const float side = is_broken(i) ? (i % 2 ? nan : -1) : spheres[i].radius * 1.001f;
            for (const float sign : {-1.0f, 1.0f})
                for (const float value : spheres[i].center) to.push_back(value + sign * side);
            if (i >= count) to.insert(to.end(), 2, 77.0f);
        }
        const std::vector<GeometrySource> sources{
            {.vertices = world.buffer_of(first, BufferUsage::acceleration_structure_input)},
            {.vertices = world.buffer_of(second, BufferUsage::acceleration_structure_input)}};
        CommandList list = world.device().create_command_list("boxes");
        if (frame == 0)
            list.build_acceleration_structure(boxes, sources);
        else
            list.update_acceleration_structure(boxes, sources);
        list.build_acceleration_structure(world.top, world.instances_of(scene));
        world.submit(std::move(list));

        std::vector<ReferenceRay> rays = random_rays(1500, 41 + static_cast<std::uint32_t>(frame), false);
        constexpr std::uint32_t flags[] = {0, 0, 0x1, 0x2, 0x40, 0x80, 0x100, 0x200, 0x4, 0x201, 0x102};
        for (std::size_t i = 0; i < rays.size(); ++i) rays[i].flags = flags[i % std::size(flags)];
        const std::vector<Hit> hits =
            world.trace(rays, text, {{.binding = 3, .buffer = world.buffer_of(spheres, BufferUsage::storage)}});
        std::size_t compared = 0, of_spheres = 0, of_triangles = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const ReferenceRay& ray = rays[i];
            const ReferenceAnswer of_mesh = trace(scene, ray, [&](const ReferenceHit& hit) { return accepts(i, hit); });
            double margin = of_mesh.margin, second_t = std::numeric_limits<double>::infinity();
            ReferenceHit best = of_mesh.closest;
            std::vector<std::pair<ReferenceHit, bool>> all;
            for (const ReferenceHit& hit : of_mesh.hits) all.emplace_back(hit, false);
            bool is_sphere = false;
            for (std::size_t n = 0; n < scene.instances.size(); ++n) {
                const ReferenceInstance& instance = scene.instances[n];
                const auto inverse = inverse_of(instance.transform);
                if (instance.mesh != 3 || !inverse || (instance.mask & ray.mask) == 0 || (ray.flags & 0x200)) continue;
                double o[3], d[3];
                for (std::size_t row = 0; row < 3; ++row) {
                    const float* m = inverse->data() + row * 4;
                    o[row] = double{m[3]}, d[row] = 0;
                    for (std::size_t k = 0; k < 3; ++k)
                        o[row] += double{m[k]} * ray.origin[k], d[row] += double{m[k]} * ray.direction[k];
                }
                for (std::uint32_t s = 0; s < 2 * count; ++s) {
                    bool is_opaque = s < count;
                    if (ray.flags & 1) is_opaque = true;
                    if (ray.flags & 2) is_opaque = false;
                    if (is_broken(s) || (ray.flags & (is_opaque ? 0x40u : 0x80u))) continue;
                    double a = 0, b = 0, c = 0;
                    for (std::size_t k = 0; k < 3; ++k) {
                        const double from = o[k] - spheres[s].center[k];
                        a += d[k] * d[k], b += from * d[k], c += from * from;
                    }
                    const double radius2 = double{spheres[s].radius} * spheres[s].radius,
                                 below = radius2 - (c - b * b / a);
                    if (below > -0.2 * radius2) margin = std::min(margin, std::abs(below) / radius2 / 100);
                    if (below < 0) continue;
                    const double half_chord = std::sqrt(below / a);
                    double t = -b / a - half_chord;
                    for (const double root : {t, -b / a + half_chord}) {
                        margin = std::min(margin, std::abs(root - ray.t_min) / 10);
                        margin = std::min(margin, std::abs(root - ray.t_max) / 10);
                    }
                    if (t < ray.t_min) t = -b / a + half_chord;
                    if (t < ray.t_min || t > ray.t_max) continue;
                    ReferenceHit hit{.t = t,
                                     .instance = static_cast<std::uint32_t>(n),
                                     .geometry = s / count,
                                     .primitive = s % count};
                    all.emplace_back(hit, true);
                    second_t = std::min(second_t, std::max(t, best.t));
                    if (t < best.t) best = hit, is_sphere = true;
                }
            }
            ASSERT_EQ(hits[i].bad_candidates, 0u) << "ray " << i;
            if (best.exists()) margin = std::min(margin, (second_t - best.t) / (1 + best.t));
            if (margin < 1e-4) continue;
            ++compared;
            if (best.exists() && (ray.flags & 0x4)) {
                bool is_one = false;
                for (const auto& [hit, of_box] : all)
                    is_one = is_one || (hits[i].type == (of_box ? 2u : 1u) && hits[i].instance == hit.instance &&
                                        hits[i].geometry == hit.geometry && hits[i].primitive == hit.primitive);
                ASSERT_TRUE(is_one) << "ray " << i;
                continue;
            }
            ASSERT_EQ(hits[i].type, !best.exists() ? 0u
                                    : is_sphere    ? 2u
                                                   : 1u)
                << "ray " << i << ", flags " << ray.flags;
            if (!best.exists()) continue;
            ++(is_sphere ? of_spheres : of_triangles);
            ASSERT_NEAR(hits[i].t, best.t, 1e-3 * (1 + best.t)) << "ray " << i;
            ASSERT_EQ(hits[i].instance, best.instance) << "ray " << i;
            ASSERT_EQ(hits[i].geometry, best.geometry) << "ray " << i;
            ASSERT_EQ(hits[i].primitive, best.primitive) << "ray " << i;
        }
        EXPECT_GT(compared, rays.size() / 3);
        EXPECT_GT(of_spheres, 50u);
        EXPECT_GT(of_triangles, 20u);
    }
}

TEST_P(CpuRayQueries, NothingIsHitWhereNothingIs) {
    const std::vector<ReferenceRay> rays = random_rays(64, 19, false);
    ReferenceScene scene;
    const auto expect_nothing = [&] {
        for (const Hit& hit : world.trace(rays)) ASSERT_EQ(hit.type, 0u);
    };
    scene.meshes.emplace_back().emplace_back();  // A geometry without triangles,
    world.build(scene);                          // and no instance.
    expect_nothing();
    scene.instances.resize(3);
    world.build(scene);
    expect_nothing();
    CommandList list = world.device().create_command_list("nothing");
    list.build_acceleration_structure(world.top, std::vector<AccelerationStructureInstance>(2));
    world.submit(std::move(list));
    expect_nothing();
}

TEST(CpuRayQueryBits, AreTheSameForEveryNumberOfLanesAndThreads) {
    // Transforms, flags and alpha tests; and rays that all meet in the edges and corners of one mesh, where ties are.
    const ReferenceScene scene = random_scene(20, 20);
    const std::vector<ReferenceRay> scattered = random_rays(3000, 21, true);
    ReferenceScene sheet;
    ReferenceGeometry& geometry = sheet.meshes.emplace_back().emplace_back();
    for (std::uint32_t y = 0; y <= 8; ++y)
        for (std::uint32_t x = 0; x <= 8; ++x)
            geometry.vertices.push_back({static_cast<float>(x) - 4, static_cast<float>(y) - 4, 0});
    for (std::uint32_t y = 0; y < 8; ++y)
        for (std::uint32_t x = 0; x < 8; ++x) {
            const std::uint32_t a = y * 9 + x;
            // Twice, so that every hit is a tie.
            for (int twice = 0; twice < 2; ++twice) {
                geometry.triangles.push_back({a, a + 1, a + 9});
                geometry.triangles.push_back({a + 1, a + 10, a + 9});
            }
        }
    sheet.instances.resize(1);
    std::vector<ReferenceRay> grid;
    for (std::uint32_t i = 0; i < 33 * 33; ++i) {
        const float x = static_cast<float>(i % 33) / 4 - 4, y = static_cast<float>(i / 33) / 4 - 4;
        grid.push_back({.origin = {0.25f, 0.5f, -3}, .direction = {x - 0.25f, y - 0.5f, 3}});
    }
    std::map<std::string, std::vector<Hit>> first;
    for (const char* spec : {"cpu:consistent:lanes=16:threads=2", "cpu:consistent:lanes=8:threads=1",
                             "cpu:consistent:lanes=4:threads=2"}) {
        World world(spec);
        ASSERT_EQ(world.absent(), "");
        const auto expect_same = [&](const std::string& name, const std::vector<Hit>& hits) {
            const auto [at, is_new] = first.emplace(name, hits);
            if (is_new) return;
            for (std::size_t i = 0; i < hits.size(); ++i)
                ASSERT_EQ(std::memcmp(&hits[i], &at->second[i], sizeof(Hit)), 0)
                    << spec << ", " << name << ", ray " << i;
        };
        world.build(scene);
        expect_same("scattered", world.trace(scattered));
        world.build(sheet);
        expect_same("grid", world.trace(grid));
    }
}

}  // namespace
}  // namespace nacre::cpu
