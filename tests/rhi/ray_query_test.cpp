// SPDX-License-Identifier: Apache-2.0
// Acceleration structures and ray queries, against intersections worked out in double precision.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(RayQueries);

using Vector = std::array<double, 3>;
Vector operator-(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// As the shaders below read and write them.
struct Ray {
    std::array<float, 3> origin{};
    float t_min = 0;
    std::array<float, 3> direction{};
    float t_max = 1e9f;
    std::uint32_t flags = 0, mask = 0xff, reserved[2] = {};
};
struct Hit {
    std::uint32_t type = 0;
    float t = 0;
    std::uint32_t primitive = 0, geometry = 0;
    std::uint32_t instance = 0, custom_index = 0, table_offset = 0, front_face = 0;
    float u = 0, v = 0;
    std::uint32_t candidates = 0, reserved = 0;
};
static_assert(sizeof(Ray) == 48 && sizeof(Hit) == 48);

const std::string declarations = R"(
#extension GL_EXT_ray_query : require
layout(local_size_x = 32) in;
struct Ray { vec3 origin; float t_min; vec3 direction; float t_max; uvec4 flags; };
struct Hit { uvec4 a; uvec4 b; uvec4 c; };
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1) readonly buffer Rays { Ray rays[]; };
layout(set = 0, binding = 2) writeonly buffer Hits { Hit hits[]; };
void store(uint i, rayQueryEXT query, uint candidates) {
    Hit hit = Hit(uvec4(0), uvec4(0), uvec4(0, 0, candidates, 0));
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
)";
const std::string closest_hit = declarations + R"(
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= rays.length()) return;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, rays[i].flags.x, rays[i].flags.y, rays[i].origin, rays[i].t_min, rays[i].direction,
                          rays[i].t_max);
    uint candidates = 0;
    while (rayQueryProceedEXT(query)) ++candidates;
    store(i, query, candidates);
}
)";

/// Triangles without shared vertices.
struct Mesh {
    std::vector<float> positions;
    [[nodiscard]] std::uint32_t triangles() const { return static_cast<std::uint32_t>(positions.size() / 9); }
    [[nodiscard]] Vector corner(std::uint32_t triangle, std::uint32_t k) const {
        const float* p = positions.data() + (std::size_t{triangle} * 3 + k) * 3;
        return {p[0], p[1], p[2]};
    }
};

Mesh random_mesh(std::uint32_t triangles, std::uint32_t seed, float size = 0.3f) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(-1, 1), offset(-size, size);
    Mesh mesh;
    for (std::uint32_t i = 0; i < triangles; ++i) {
        const float center[3] = {place(random), place(random), place(random)};
        for (int k = 0; k < 9; ++k) mesh.positions.push_back(center[k % 3] + offset(random));
    }
    return mesh;
}

std::vector<Ray> random_rays(std::size_t count, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(-2, 2), aim(-1, 1);
    std::vector<Ray> rays(count);
    for (Ray& ray : rays) {
        for (float& value : ray.origin) value = place(random);
        for (std::size_t axis = 0; axis < 3; ++axis) ray.direction[axis] = aim(random) - ray.origin[axis];
    }
    return rays;
}

struct Reference {
    double t = std::numeric_limits<double>::infinity();
    std::uint32_t primitive = 0;
    double u = 0, v = 0;
    double margin = std::numeric_limits<double>::infinity();  ///< How near the ray came to an edge or to another hit.
    bool is_front = false;
};

/// Closest hit in double precision, by Cramer's rule, with the distance to all that could tip the balance.
template <typename Accept>
Reference trace(const Mesh& mesh, const Ray& ray, Accept&& accept) {
    Reference best;
    double second = std::numeric_limits<double>::infinity(), nearest_edge = second;
    const Vector origin{ray.origin[0], ray.origin[1], ray.origin[2]};
    const Vector direction{ray.direction[0], ray.direction[1], ray.direction[2]};
    for (std::uint32_t i = 0; i < mesh.triangles(); ++i) {
        const Vector e1 = mesh.corner(i, 1) - mesh.corner(i, 0), e2 = mesh.corner(i, 2) - mesh.corner(i, 0);
        const Vector normal = cross(e1, e2), to_origin = origin - mesh.corner(i, 0);
        const double determinant = -dot(direction, normal);
        if (determinant == 0) continue;
        const Vector q = cross(to_origin, direction);
        const double u = dot(e2, q) / determinant, v = -dot(e1, q) / determinant,
                     t = dot(to_origin, normal) / determinant;
        nearest_edge = std::min(nearest_edge, std::max({-u, -v, u + v - 1}) >= 0 ? std::max({-u, -v, u + v - 1})
                                                                                 : std::min({u, v, 1 - u - v}));
        if (u < 0 || v < 0 || u + v > 1 || t <= ray.t_min || t >= ray.t_max) continue;
        const bool is_front = dot(direction, normal) < 0;
        if (!accept(i, is_front)) continue;
        if (t < best.t)
            second = best.t, best.t = t, best.primitive = i, best.u = u, best.v = v, best.is_front = is_front;
        else second = std::min(second, t);
    }
    best.margin = std::min(nearest_edge, second - best.t);
    return best;
}

class Scene {
  public:
    Scene(BackendTest& test, const Mesh& mesh, bool opaque = true, bool allow_update = false) : test_(test) {
        vertices = test.buffer_of<float>(mesh.positions, BufferUsage::acceleration_structure_input, "vertices");
        bottom =
            test.ok(test.device().create_acceleration_structure({.level = AccelerationStructureLevel::bottom,
                                                                 .geometries = {{.opaque = opaque,
                                                                                 .primitive_count = mesh.triangles(),
                                                                                 .vertex_count = mesh.triangles() * 3}},
                                                                 .allow_update = allow_update,
                                                                 .name = "bottom"}));
        top = test.ok(test.device().create_acceleration_structure({.level = AccelerationStructureLevel::top,
                                                                   .max_instances = 8,
                                                                   .allow_update = allow_update,
                                                                   .name = "top"}));
    }
    void build(std::vector<AccelerationStructureInstance> instances = {}) {
        if (instances.empty()) instances.resize(1);
        for (AccelerationStructureInstance& instance : instances)
            if (!instance.bottom_level) instance.bottom_level = bottom;
        CommandList list = test_.device().create_command_list("build");
        list.build_acceleration_structure(bottom, std::array{GeometrySource{.vertices = vertices}});
        list.build_acceleration_structure(top, instances);
        test_.run(std::move(list));
    }
    std::vector<Hit> trace(const std::vector<Ray>& rays, const std::string& shader = closest_hit) {
        const ComputePipeline pipeline = test_.compute(shader);
        const Buffer input = test_.buffer_of<Ray>(rays, BufferUsage::storage, "rays");
        const Buffer output = test_.buffer(rays.size() * sizeof(Hit), BufferUsage::storage, "hits");
        test_.dispatch(pipeline,
                       {{.binding = 0, .acceleration_structure = top},
                        {.binding = 1, .buffer = input},
                        {.binding = 2, .buffer = output}},
                       {static_cast<std::uint32_t>((rays.size() + 31) / 32), 1, 1});
        return test_.read<Hit>(output);
    }
    Buffer vertices;
    AccelerationStructure bottom, top;

  private:
    BackendTest& test_;
};

/// Counts rays that are clear of ties and edges; each of them must agree.
void expect_agreement(const Mesh& mesh, const std::vector<Ray>& rays, const std::vector<Hit>& hits,
                      const std::function<bool(std::size_t, std::uint32_t, bool)>& accept) {
    std::size_t compared = 0, hit_count = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const Reference expected =
            trace(mesh, rays[i], [&](std::uint32_t p, bool front) { return accept(i, p, front); });
        if (expected.margin < 1e-4) continue;
        ++compared;
        const bool is_hit = std::isfinite(expected.t);
        ASSERT_EQ(hits[i].type, is_hit ? 1u : 0u) << "ray " << i;
        if (!is_hit) continue;
        ++hit_count;
        ASSERT_EQ(hits[i].primitive, expected.primitive) << "ray " << i;
        ASSERT_NEAR(hits[i].t, expected.t, 1e-4 * (1 + expected.t)) << "ray " << i;
        ASSERT_NEAR(hits[i].u, expected.u, 1e-3) << "ray " << i;
        ASSERT_NEAR(hits[i].v, expected.v, 1e-3) << "ray " << i;
        ASSERT_EQ(hits[i].front_face, expected.is_front ? 1u : 0u) << "ray " << i;
    }
    EXPECT_GT(compared, rays.size() / 3);
    EXPECT_GT(hit_count, rays.size() / 20);
}

TEST_P(RayQueries, ClosestHitsAgreeWithDoublePrecision) {
    SKIP_WITHOUT(capabilities().ray_query);
    const Mesh mesh = random_mesh(100, 1);
    Scene scene(*this, mesh);
    scene.build();
    const std::vector<Ray> rays = random_rays(1000, 2);
    const std::vector<Hit> hits = scene.trace(rays);
    expect_agreement(mesh, rays, hits, [](std::size_t, std::uint32_t, bool) { return true; });
    for (const Hit& hit : hits) ASSERT_EQ(hit.candidates, 0u);
}

TEST_P(RayQueries, LimitsAndCullingAgreeWithDoublePrecision) {
    SKIP_WITHOUT(capabilities().ray_query);
    const Mesh mesh = random_mesh(100, 3);
    Scene scene(*this, mesh);
    scene.build();
    std::vector<Ray> rays = random_rays(1000, 4);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        rays[i].t_min = 0.7f;
        rays[i].t_max = 1.3f;
        rays[i].flags = i % 3 == 0 ? 0u : i % 3 == 1 ? 0x10u : 0x20u;
    }
    const std::vector<Hit> hits = scene.trace(rays);
    expect_agreement(mesh, rays, hits,
                     [](std::size_t i, std::uint32_t, bool front) { return i % 3 == 0 || (i % 3 == 1) == front; });
}

TEST_P(RayQueries, RaysThatSkipOrCullEverythingHitNothing) {
    SKIP_WITHOUT(capabilities().ray_query);
    Scene opaque(*this, random_mesh(300, 5, 1.0f)), other(*this, random_mesh(300, 5, 1.0f), false);
    opaque.build();
    other.build();
    std::vector<Ray> rays = random_rays(128, 6);
    const auto hits_with = [&](Scene& scene, std::uint32_t flags, std::uint32_t mask) {
        for (Ray& ray : rays) ray.flags = flags, ray.mask = mask;
        std::size_t hits = 0, candidates = 0;
        for (const Hit& hit : scene.trace(rays)) hits += hit.type, candidates += hit.candidates;
        return std::pair(hits, candidates);
    };
    const std::size_t all = hits_with(opaque, 0, 0xff).first;
    EXPECT_GT(all, 60u);
    EXPECT_EQ(hits_with(opaque, 0x40, 0xff), std::pair(std::size_t{0}, std::size_t{0}));   // Cull opaque.
    EXPECT_EQ(hits_with(opaque, 0x80, 0xff).first, all);                                   // Cull what is not.
    EXPECT_EQ(hits_with(opaque, 0x100, 0xff), std::pair(std::size_t{0}, std::size_t{0}));  // Skip triangles.
    EXPECT_EQ(hits_with(opaque, 0x4, 0xff).first, all);  // Terminate on the first hit.
    EXPECT_EQ(hits_with(opaque, 0, 0).first, 0u);
    EXPECT_EQ(hits_with(opaque, 0x2, 0xff).first, 0u);  // No opaque: nobody confirms.
    EXPECT_GT(hits_with(opaque, 0x2, 0xff).second, all);
    EXPECT_EQ(hits_with(other, 0, 0xff).first, 0u);
    EXPECT_GT(hits_with(other, 0, 0xff).second, all);
    EXPECT_EQ(hits_with(other, 0x1, 0xff), std::pair(all, std::size_t{0}));                // Opaque.
    EXPECT_EQ(hits_with(other, 0x80, 0xff), std::pair(std::size_t{0}, std::size_t{0}));
}

TEST_P(RayQueries, CandidatesThatTheShaderConfirmsGiveTheClosestOfThem) {
    SKIP_WITHOUT(capabilities().ray_query);
    // Large triangles: rays meet far more of them than are kept at a time.
    const Mesh mesh = random_mesh(150, 7, 1.5f);
    Scene scene(*this, mesh, false);
    scene.build();
    const std::vector<Ray> rays = random_rays(500, 8);
    const std::vector<Hit> hits = scene.trace(rays, declarations + R"(
        void main() {
            uint i = gl_GlobalInvocationID.x;
            if (i >= rays.length()) return;
            rayQueryEXT query;
            rayQueryInitializeEXT(query, scene, rays[i].flags.x, 0xff, rays[i].origin, rays[i].t_min, rays[i].direction, rays[i].t_max);
            uint candidates = 0;
            while (rayQueryProceedEXT(query)) {
                ++candidates;
                uint primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, false);
                if (primitive % 16 == i % 16) rayQueryConfirmIntersectionEXT(query);
            }
            store(i, query, candidates);
        })");
    std::size_t many = 0;
    for (const Hit& hit : hits) many += hit.candidates > 10;
    EXPECT_GT(many, 20u);
    expect_agreement(mesh, rays, hits, [](std::size_t i, std::uint32_t p, bool) { return p % 16 == i % 16; });
}

TEST_P(RayQueries, InstancesHaveTransformsMasksAndNumbers) {
    SKIP_WITHOUT(capabilities().ray_query);
    // One triangle, twice: beside each other, one of them scaled by 2 and 3 along the ray.
    Scene scene(*this, Mesh{{-1, -1, 0, 1, -1, 0, 0, 1, 0}});
    scene.build({{.transform = {1, 0, 0, -5, 0, 1, 0, 0, 0, 0, 1, 4}, .custom_index = 77, .table_offset = 5, .mask = 1},
                 {},
                 {.transform = {2, 0, 0, 5, 0, 2, 0, 0, 0, 0, 3, 8}, .custom_index = 0xffffff, .mask = 0x82,
                  .flags = InstanceFlags::flip_facing}});
    const auto ray = [](float x, std::uint32_t mask) {
        return Ray{.origin = {x, 0, -2}, .direction = {0, 0, 2}, .mask = mask};
    };
    const std::vector<Hit> hits =
        scene.trace({ray(-5, 0xff), ray(5, 0xff), ray(-5, 2), ray(5, 2), ray(5, 1), ray(0, 4), ray(20, 0xff)});
    EXPECT_EQ(hits[0].type, 1u);
    EXPECT_FLOAT_EQ(hits[0].t, 3.0f);
    EXPECT_EQ(hits[0].instance, 0u);
    EXPECT_EQ(hits[0].custom_index, 77u);
    EXPECT_EQ(hits[0].table_offset, 5u);
    // The ray comes from -z, and the triangle's front is towards +z.
    EXPECT_EQ(hits[0].front_face, 0u);
    EXPECT_EQ(hits[1].type, 1u);
    EXPECT_FLOAT_EQ(hits[1].t, 5.0f);
    EXPECT_EQ(hits[1].instance, 2u);
    EXPECT_EQ(hits[1].custom_index, 0xffffffu);
    EXPECT_EQ(hits[1].front_face, 1u);
    EXPECT_EQ(hits[2].type, 0u);
    EXPECT_EQ(hits[3].type, 1u);
    EXPECT_EQ(hits[4].type, 0u);
    EXPECT_EQ(hits[5].type, 1u);
    EXPECT_EQ(hits[5].instance, 1u);
    EXPECT_EQ(hits[6].type, 0u);
}

TEST_P(RayQueries, UpdatesFollowTheVertices) {
    SKIP_WITHOUT(capabilities().ray_query);
    Mesh mesh = random_mesh(100, 9);
    Scene scene(*this, mesh, true, true);
    scene.build();
    for (float& value : mesh.positions) value = value * 0.8f + 0.1f;
    ok(device().write_buffer(scene.vertices, std::as_bytes(std::span(mesh.positions))));
    CommandList list = device().create_command_list("update");
    list.update_acceleration_structure(scene.bottom, std::array{GeometrySource{.vertices = scene.vertices}});
    list.update_acceleration_structure(scene.top,
                                       std::array{AccelerationStructureInstance{.bottom_level = scene.bottom}});
    run(std::move(list));
    const std::vector<Ray> rays = random_rays(1000, 10);
    expect_agreement(mesh, rays, scene.trace(rays), [](std::size_t, std::uint32_t, bool) { return true; });
}

TEST_P(RayQueries, StructuresWithoutContentAreNeverHit) {
    SKIP_WITHOUT(capabilities().ray_query);
    const std::vector<Ray> rays = random_rays(64, 11);
    Scene scene(*this, random_mesh(100, 12, 1.0f));
    scene.build({{.mask = 0}, {.transform = {}}});
    for (const Hit& hit : scene.trace(rays)) EXPECT_EQ(hit.type, 0u);
    CommandList list = device().create_command_list("empty");
    list.build_acceleration_structure(scene.top, std::vector<AccelerationStructureInstance>{});
    run(std::move(list));
    for (const Hit& hit : scene.trace(rays)) EXPECT_EQ(hit.type, 0u);
    const AccelerationStructure nothing = ok(device().create_acceleration_structure(
        {.level = AccelerationStructureLevel::bottom, .geometries = {{}}, .name = "nothing"}));
    list = device().create_command_list("nothing");
    list.build_acceleration_structure(nothing, std::array{GeometrySource{}});
    list.build_acceleration_structure(scene.top, std::array{AccelerationStructureInstance{.bottom_level = nothing}});
    run(std::move(list));
    for (const Hit& hit : scene.trace(rays)) EXPECT_EQ(hit.type, 0u);
}

TEST_P(RayQueries, VerticesAndRaysThatAreNoNumbersHitNothing) {
    SKIP_WITHOUT(capabilities().ray_query);
    Mesh mesh = random_mesh(100, 13);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    // Every fourth triangle has a bad first vertex: the one whose NaN makes a triangle inactive everywhere.
    for (std::size_t i = 0; i < mesh.positions.size(); i += 36) mesh.positions[i] = nan;
    Scene scene(*this, mesh);
    scene.build();
    std::vector<Ray> rays = random_rays(1000, 14);
    Mesh without = mesh;
    for (std::size_t i = 0; i < mesh.positions.size(); i += 36)
        std::fill_n(without.positions.begin() + static_cast<std::ptrdiff_t>(i), 9, 0.0f);
    expect_agreement(without, rays, scene.trace(rays), [](std::size_t, std::uint32_t p, bool) { return p % 4 != 0; });
    if (!device().adapter().backend.starts_with("cpu")) return;  // Other devices may do as they like with such rays.
    const float infinity = std::numeric_limits<float>::infinity();
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (i % 4 == 0) rays[i].origin[i % 3] = nan;
        if (i % 4 == 1) rays[i].direction[i % 3] = infinity;
        if (i % 4 == 2) rays[i].t_min = -1;
        if (i % 4 == 3) rays[i].t_max = nan;
    }
    for (const Hit& hit : scene.trace(rays)) ASSERT_EQ(hit.type, 0u);
}

TEST_P(RayQueries, NoRaySlipsThroughSharedEdges) {
    SKIP_WITHOUT(capabilities().ray_query);
    // An open sheet of random heights, far from the origin, hit along its inner edges.
    constexpr int cells = 24;
    std::mt19937 random(15);
    std::uniform_real_distribution<float> unit(0, 1);
    std::vector<std::array<float, 3>> points;
    for (int y = 0; y <= cells; ++y)
        for (int x = 0; x <= cells; ++x)
            points.push_back({100.3f + static_cast<float>(x) + 0.3f * unit(random),
                              70.7f + static_cast<float>(y) + 0.3f * unit(random), 50 + 0.5f * unit(random)});
    const auto point = [&](int x, int y) { return points[static_cast<std::size_t>(y * (cells + 1) + x)]; };
    Mesh mesh;
    for (int y = 0; y < cells; ++y)
        for (int x = 0; x < cells; ++x)
            for (const auto& corner :
                 {point(x, y), point(x + 1, y), point(x, y + 1), point(x, y + 1), point(x + 1, y), point(x + 1, y + 1)})
                mesh.positions.insert(mesh.positions.end(), corner.begin(), corner.end());
    Scene scene(*this, mesh);
    scene.build();
    std::vector<Ray> rays(20000);
    for (Ray& ray : rays) {
        const int x = 2 + static_cast<int>(random() % (cells - 4)), y = 2 + static_cast<int>(random() % (cells - 4));
        const auto from = point(x, y);
        const auto to = random() % 2 ? point(x + 1, y) : random() % 2 ? point(x, y + 1) : point(x + 1, y - 1);
        // Not at the vertices: Embree's promise ends at edges (docs/ray-tracing.md).
        const float along = 0.01f + 0.98f * unit(random);
        ray.origin = {112.0f + unit(random), 82.0f + unit(random), -3 - 10 * unit(random)};
        for (std::size_t axis = 0; axis < 3; ++axis)
            ray.direction[axis] = from[axis] + along * (to[axis] - from[axis]) - ray.origin[axis];
    }
    std::size_t missed = 0;
    for (const Hit& hit : scene.trace(rays)) missed += hit.type == 0;
    EXPECT_EQ(missed, 0u);
}

TEST_P(RayQueries, ArraysOfQueriesAndMatricesWork) {
    SKIP_WITHOUT(capabilities().ray_query);
    Scene scene(*this, Mesh{{-1, -1, 0, 1, -1, 0, 0, 1, 0}});
    scene.build({{.transform = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 4, 8}}});
    const std::vector<Hit> hits =
        scene.trace(std::vector<Ray>(32, Ray{.origin = {0, 0, -2}, .direction = {0, 0, 1}}), declarations + R"(
        void main() {
            uint i = gl_GlobalInvocationID.x;
            rayQueryEXT queries[2];
            for (uint k = 0; k < 2; ++k)
                rayQueryInitializeEXT(queries[k], scene, 0, 0xff, rays[i].origin + vec3(0, 0, k), 0, rays[i].direction, 100);
            uint mine = i & 1;
            while (rayQueryProceedEXT(queries[mine]));
            mat4x3 world = rayQueryGetIntersectionObjectToWorldEXT(queries[mine], true);
            mat4x3 object = rayQueryGetIntersectionWorldToObjectEXT(queries[mine], true);
            vec3 origin = rayQueryGetIntersectionObjectRayOriginEXT(queries[mine], true);
            hits[i].a = uvec4(rayQueryGetIntersectionTypeEXT(queries[mine], true),
                              floatBitsToUint(rayQueryGetIntersectionTEXT(queries[mine], true)),
                              uint(world[3].z), uint(world[0].x));
            hits[i].b = uvec4(uint(object[2].z * 100), uint(-object[3].z), uint(-origin.z * 100),
                              uint(rayQueryGetRayFlagsEXT(queries[mine])));
            hits[i].c = uvec4(0);
        })");
    for (std::uint32_t i = 0; i < 32; ++i) {
        EXPECT_EQ(hits[i].type, 1u);
        EXPECT_FLOAT_EQ(hits[i].t, i % 2 ? 9.0f : 10.0f);
        EXPECT_EQ(hits[i].primitive, 8u);
        EXPECT_EQ(hits[i].geometry, 2u);
        EXPECT_EQ(hits[i].instance, 25u);
        EXPECT_EQ(hits[i].custom_index, 2u);
        EXPECT_EQ(hits[i].table_offset, i % 2 ? 225u : 250u);
        EXPECT_EQ(hits[i].front_face, 0u);
    }
}

}  // namespace
}  // namespace nacre::test
