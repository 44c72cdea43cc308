// SPDX-License-Identifier: Apache-2.0
#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <numbers>
#include <random>

#include "backends/cpu/scheduler.h"
#include "benchmarks/cpu/bench.h"

/// @file
/// Ray queries of a compute shader, against a bare loop over the call of Embree that is fastest for the rays: packets
/// of 16 with the right hint of coherence, without instances. The loop has its rays in packets already, and both sides
/// write a distance and a triangle for each ray. "embree" traces a scene as Embree makes it by default, whose rays may
/// slip through shared edges; "embree_robust" one without that fault, as the backend's are.

namespace nacre::bench {
namespace {

constexpr std::uint32_t cells = 512;  ///< Along each side of the mesh: 524,288 triangles.
constexpr std::uint32_t packet = 16;

struct Ray {
    std::array<float, 3> origin;
    float t_min;
    std::array<float, 3> direction;
    float t_max;
};
struct Hit {
    float t;
    std::uint32_t primitive;
};

struct Mesh {
    std::vector<float> positions;
    std::vector<std::uint32_t> indices;
};

/// A sphere with bumps of several sizes.
Mesh make_mesh() {
    Mesh mesh;
    for (std::uint32_t y = 0; y <= cells; ++y)
        for (std::uint32_t x = 0; x <= cells; ++x) {
            const double u = 2 * std::numbers::pi * x / cells, v = std::numbers::pi * y / cells;
            const double radius =
                1 + 0.1 * std::sin(7 * u) * std::sin(5 * v) + 0.03 * std::sin(31 * u + 3) * std::sin(37 * v);
            mesh.positions.push_back(static_cast<float>(radius * std::sin(v) * std::cos(u)));
            mesh.positions.push_back(static_cast<float>(radius * std::cos(v)));
            mesh.positions.push_back(static_cast<float>(radius * std::sin(v) * std::sin(u)));
        }
    for (std::uint32_t y = 0; y < cells; ++y)
        for (std::uint32_t x = 0; x < cells; ++x) {
            const std::uint32_t corner = y * (cells + 1) + x;
            for (const std::uint32_t vertex :
                 {corner, corner + 1, corner + cells + 1, corner + 1, corner + cells + 2, corner + cells + 1})
                mesh.indices.push_back(vertex);
        }
    return mesh;
}

/// From anywhere about the mesh to anywhere.
std::vector<Ray> incoherent_rays() {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> unit(0, 1);
    std::vector<Ray> rays(1 << 20);
    for (Ray& ray : rays) {
        for (float& value : ray.origin) value = 2 * unit(random) - 1;
        const float z = 2 * unit(random) - 1, angle = 2 * std::numbers::pi_v<float> * unit(random),
                    r = std::sqrt(1 - z * z);
        ray = {ray.origin, 0, {r * std::cos(angle), r * std::sin(angle), z}, 1e9f};
    }
    return rays;
}

/// Through the pixels of a picture that the mesh fills from top to bottom; sixteen in a row are 4 x 4 pixels.
std::vector<Ray> primary_rays() {
    std::vector<Ray> rays;
    rays.reserve(std::size_t{picture_width} * picture_height);
    for (std::uint32_t y = 0; y < picture_height; y += 4)
        for (std::uint32_t x = 0; x < picture_width; x += 4)
            for (std::uint32_t i = 0; i < 16; ++i) {
                const auto px = static_cast<float>(x + i % 4) + 0.5f, py = static_cast<float>(y + i / 4) + 0.5f;
                rays.push_back({{0, 0, -3},
                                0,
                                {(px - picture_width / 2.0f) / picture_height,
                                 (picture_height / 2.0f - py) / picture_height, 1.3f},
                                1e9f});
            }
    return rays;
}

/// The mesh in the acceleration structures of a device.
struct Traced {
    rhi::Device* device;
    rhi::AccelerationStructure bottom, top;

    static Expected<Traced> make(rhi::Device& device, const Mesh& mesh) {
        Traced made{.device = &device};
        const auto upload = [&](const auto& values, const char* name) -> Expected<rhi::Buffer> {
            NACRE_TRY(const rhi::Buffer buffer,
                      device.create_buffer({.size = values.size() * 4,
                                            .usage = rhi::BufferUsage::acceleration_structure_input,
                                            .name = name}));
            NACRE_CHECK(device.write_buffer(buffer, std::as_bytes(std::span(values))));
            return buffer;
        };
        NACRE_TRY(const rhi::Buffer positions, upload(mesh.positions, "positions"));
        NACRE_TRY(const rhi::Buffer indices, upload(mesh.indices, "indices"));
        NACRE_TRY(made.bottom,
                  device.create_acceleration_structure(
                      {.level = rhi::AccelerationStructureLevel::bottom,
                       .geometries = {{.primitive_count = static_cast<std::uint32_t>(mesh.indices.size() / 3),
                                       .vertex_count = static_cast<std::uint32_t>(mesh.positions.size() / 3),
                                       .index_type = rhi::IndexType::uint32}},
                       .name = "mesh"}));
        NACRE_TRY(made.top, device.create_acceleration_structure(
                                {.level = rhi::AccelerationStructureLevel::top, .max_instances = 1, .name = "scene"}));
        NACRE_CHECK(time_submission(device, [&](rhi::CommandList& list) {
            list.build_acceleration_structure(
                made.bottom, std::array{rhi::GeometrySource{.vertices = positions, .indices = indices}});
            list.build_acceleration_structure(
                made.top, std::array{rhi::AccelerationStructureInstance{.bottom_level = made.bottom}});
        }));
        device.destroy(positions);
        device.destroy(indices);
        return made;
    }
};

/// A shader that traces a buffer of rays.
struct Query {
    rhi::Device* device;
    Kernel kernel;
    rhi::Buffer hits;
    std::uint32_t count;

    static Expected<Query> make(const Traced& traced, const std::string& shader, const std::vector<Ray>& rays) {
        Query made{.device = traced.device, .count = static_cast<std::uint32_t>(rays.size())};
        NACRE_TRY(const rhi::Buffer input,
                  made.device->create_buffer(
                      {.size = rays.size() * sizeof(Ray), .usage = rhi::BufferUsage::storage, .name = "rays"}));
        NACRE_CHECK(made.device->write_buffer(input, std::as_bytes(std::span(rays))));
        NACRE_TRY(made.hits,
                  made.device->create_buffer(
                      {.size = rays.size() * sizeof(Hit), .usage = rhi::BufferUsage::storage, .name = "hits"}));
        NACRE_TRY(made.kernel, make_kernel(*made.device, shader,
                                           {{.binding = 0, .acceleration_structure = traced.top},
                                            {.binding = 1, .buffer = input},
                                            {.binding = 2, .buffer = made.hits}}));
        return made;
    }
    [[nodiscard]] Expected<double> run() const {
        return time_submission(*device, [&](rhi::CommandList& list) {
            list.set_pipeline(kernel.pipeline);
            list.set_bind_group(0, kernel.group);
            list.dispatch({.x = (count + 63) / 64});
        });
    }
    [[nodiscard]] Expected<std::vector<Hit>> read() const {
        NACRE_TRY(const auto bytes, device->read_buffer(hits));
        std::vector<Hit> result(count);
        std::memcpy(result.data(), bytes.data(), bytes.size());
        return result;
    }
};

enum class Question : std::uint8_t { closest_hit, whether_hit };

/// Embree without anything around it.
class Bare {
  public:
    Bare(const Mesh& mesh, RTCSceneFlags flags) : scheduler_(cpu::Scheduler::create(0)) {
        RTCDevice device = rtcNewDevice(nullptr);
        scene_ = rtcNewScene(device);
        rtcSetSceneFlags(scene_, flags);
        RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        std::memcpy(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12,
                                            mesh.positions.size() / 3),
                    mesh.positions.data(), mesh.positions.size() * 4);
        std::memcpy(
            rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, mesh.indices.size() / 3),
            mesh.indices.data(), mesh.indices.size() * 4);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene_, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene_);
        rtcReleaseDevice(device);
    }
    ~Bare() { rtcReleaseScene(scene_); }
    Bare(const Bare&) = delete;
    Bare& operator=(const Bare&) = delete;

    void take(const std::vector<Ray>& rays) {
        packets_.assign(rays.size() / packet, {});
        hits_.resize(packets_.size() * packet);
        for (std::size_t i = 0; i < hits_.size(); ++i) {
            RTCRay16& to = packets_[i / packet];
            const std::size_t lane = i % packet;
            to.org_x[lane] = rays[i].origin[0], to.org_y[lane] = rays[i].origin[1], to.org_z[lane] = rays[i].origin[2];
            to.dir_x[lane] = rays[i].direction[0], to.dir_y[lane] = rays[i].direction[1],
            to.dir_z[lane] = rays[i].direction[2];
            to.tnear[lane] = rays[i].t_min, to.tfar[lane] = rays[i].t_max;
            to.mask[lane] = ~0u;
        }
    }
    double run(Question question, bool is_coherent) {
        return *time_ms([&]() -> Expected<void> {
            constexpr std::size_t share = 64;
            const auto tasks = static_cast<std::uint32_t>((packets_.size() + share - 1) / share);
            scheduler_->run(tasks, [&](std::uint32_t index, std::uint32_t) {
                RTCIntersectContext context;
                rtcInitIntersectContext(&context);
                context.flags =
                    is_coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
                alignas(64) int valid[packet];
                std::ranges::fill(valid, -1);
                const std::size_t end = std::min(packets_.size(), (index + 1) * share);
                for (std::size_t i = index * share; i < end; ++i) {
                    Hit* to = &hits_[i * packet];
                    RTCRayHit16 rays;
                    rays.ray = packets_[i];
                    if (question == Question::whether_hit) {
                        rtcOccluded16(valid, scene_, &context, &rays.ray);
                        for (std::size_t lane = 0; lane < packet; ++lane)
                            to[lane] = {0, rays.ray.tfar[lane] < 0 ? 0 : ~0u};
                        continue;
                    }
                    std::ranges::fill(rays.hit.geomID, RTC_INVALID_GEOMETRY_ID);
                    std::ranges::fill(rays.hit.primID, RTC_INVALID_GEOMETRY_ID);
                    rtcIntersect16(valid, scene_, &context, &rays);
                    for (std::size_t lane = 0; lane < packet; ++lane)
                        to[lane] = {rays.ray.tfar[lane], rays.hit.primID[lane]};
                }
            });
            return {};
        });
    }
    [[nodiscard]] const std::vector<Hit>& hits() const { return hits_; }

  private:
    std::unique_ptr<cpu::Scheduler> scheduler_;
    RTCScene scene_ = nullptr;
    std::vector<RTCRay16> packets_;
    std::vector<Hit> hits_;
};

Expected<void> run_case(Bench& bench, const std::string& name, double target, const Mesh& mesh,
                        const std::vector<Ray>& rays, Question question, bool is_coherent) {
    if (!bench.wants(name)) return {};
    Case work{.name = name, .target = target};
    std::vector<Query> queries;
    std::vector<Traced> traced;
    for (const std::uint32_t lanes : bench.lane_counts()) {
        NACRE_TRY(rhi::Device* const device, bench.device(cpu_spec(lanes)));
        NACRE_TRY(traced.emplace_back(), Traced::make(*device, mesh));
        NACRE_TRY(const Query query,
                  Query::make(traced.back(),
                              question == Question::whether_hit ? "benchmarks/cpu/rays_occlusion.comp"
                                                                : "benchmarks/cpu/rays.comp",
                              rays));
        queries.push_back(query);
        work.cpu.push_back({.name = "cpu", .lanes = lanes, .run = [query] { return query.run(); }});
    }
    const auto bare = std::make_shared<Bare>(mesh, RTC_SCENE_FLAG_NONE),
               robust = std::make_shared<Bare>(mesh, RTC_SCENE_FLAG_ROBUST);
    for (const auto& [reference, label] : {std::pair(bare, "embree"), std::pair(robust, "embree_robust")}) {
        reference->take(rays);
        work.references.push_back(
            {.name = label, .run = [=]() -> Expected<double> { return reference->run(question, is_coherent); }});
    }
    NACRE_CHECK(bench.measure(std::move(work)));
    for (const Query& query : queries) {
        NACRE_TRY(const std::vector<Hit> hits, query.read());
        std::size_t equal = 0;
        for (std::size_t i = 0; i < hits.size(); ++i) equal += hits[i].primitive == bare->hits()[i].primitive;
        if (equal < hits.size() - hits.size() / 1000)
            return fail(ErrorCode::internal, "compare", name, "the sides did not hit the same triangles",
                        "This is a fault of the backend; please report it.");
    }
    for (const Traced& one : traced) one.device->destroy(one.top), one.device->destroy(one.bottom);
    return {};
}

}  // namespace

Expected<void> run_rays(Bench& bench) {
    const Mesh mesh = make_mesh();
    const std::vector<Ray> scattered = incoherent_rays(), primary = primary_rays();
    NACRE_CHECK(run_case(bench, "rays_incoherent", 0.85, mesh, scattered, Question::closest_hit, false));
    NACRE_CHECK(run_case(bench, "rays_coherent", 0.6, mesh, primary, Question::closest_hit, true));
    NACRE_CHECK(run_case(bench, "rays_occlusion_incoherent", 0, mesh, scattered, Question::whether_hit, false));
    return run_case(bench, "rays_occlusion_coherent", 0, mesh, primary, Question::whether_hit, true);
}

}  // namespace nacre::bench
