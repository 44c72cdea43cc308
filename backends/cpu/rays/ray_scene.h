// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/acceleration_structure.h"

/// @file
/// Acceleration structures as scenes of Embree. Positions are copied when a structure is built: what happens to the
/// buffers later does not matter, and what is not finite never reaches Embree.
///
///     NACRE_TRY(auto rays, RayDevice::create(threads));
///     auto mesh = std::make_shared<RayMesh>(rays, std::vector{rhi::GeometryDesc{...}}, false, prefer);
///     mesh->build(geometry, false);
///     RayScene scene(rays, false, prefer);
///     scene.build(instances, false);

// Embree's own names for its objects.
struct RTCDeviceTy;
struct RTCSceneTy;
struct RTCGeometryTy;

namespace nacre::cpu {

/// Embree, opened once for a device. Thread-safe.
class RayDevice {
  public:
    /// @param threads  most that a build uses
    /// @param options  more of Embree's own configuration, for tests ("isa=avx2")
    /// Errors: unsupported where Embree cannot be used (no ray masks, no filter functions).
    static Expected<std::shared_ptr<RayDevice>> create(std::uint32_t threads, const std::string& options = {});
    ~RayDevice();
    RayDevice(const RayDevice&) = delete;
    RayDevice& operator=(const RayDevice&) = delete;

    [[nodiscard]] RTCDeviceTy* handle() const { return device_; }
    /// Widest packets that the machine traces at once: 4, 8 or 16.
    [[nodiscard]] std::uint32_t packet_width() const { return packet_width_; }
    /// Throws std::bad_alloc where Embree has run out of memory since the last call.
    void check_memory() const;

  private:
    RayDevice() = default;
    RTCDeviceTy* device_ = nullptr;
    std::uint32_t packet_width_ = 4;
};

/// Vertices and indices of one geometry, valid during a build. Nothing is read beyond the sizes.
struct RayGeometrySource {
    const std::byte* vertices = nullptr;
    std::uint64_t vertex_bytes = 0;
    const std::byte* indices = nullptr;
    std::uint64_t index_bytes = 0;
};

/// Boxes of one geometry.
struct RayBoxes {
    struct Box {
        float lower[3], upper[3];
        /// Others are never hit, and take the place of a point.
        [[nodiscard]] bool is_usable() const { return lower[0] <= upper[0]; }
    };
    std::vector<Box> boxes;
    std::array<float, 3> stand_in{};  ///< That point.
};

/// A bottom level.
class RayMesh {
  public:
    RayMesh(std::shared_ptr<RayDevice> device, std::vector<rhi::GeometryDesc> geometries, bool allow_update,
            rhi::BuildPreference prefer);
    ~RayMesh();
    RayMesh(const RayMesh&) = delete;
    RayMesh& operator=(const RayMesh&) = delete;

    /// One source for each geometry. Throws std::bad_alloc.
    void build(std::span<const RayGeometrySource> sources, bool is_update);

    /// Null before the first build.
    [[nodiscard]] RTCSceneTy* scene() const { return scene_; }
    [[nodiscard]] bool has_primitives() const { return has_triangles_ || has_boxes_; }
    [[nodiscard]] bool has_boxes() const { return has_boxes_; }
    /// Of triangles.
    [[nodiscard]] bool has_opaque() const { return has_opaque_; }
    [[nodiscard]] bool has_non_opaque() const { return has_non_opaque_; }
    [[nodiscard]] bool is_opaque(std::uint32_t geometry) const {
        return geometry >= geometries_.size() || geometries_[geometry].opaque;
    }
    /// Of the copies of vertices and indices; Embree's own are not counted.
    [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

  private:
    void start();
    RTCGeometryTy* attach(std::size_t index);
    void fill(std::size_t index, const RayGeometrySource& source, bool is_update);
    void fill_triangles(std::size_t index, const RayGeometrySource& source, bool is_update);
    void fill_boxes(std::size_t index, const RayGeometrySource& source, bool is_update);

    std::shared_ptr<RayDevice> device_;
    std::vector<rhi::GeometryDesc> geometries_;
    std::vector<RTCGeometryTy*> attached_;  ///< Null where a geometry is empty.
    std::vector<RayBoxes> boxes_;           ///< One for each geometry, empty for triangles.
    RTCSceneTy* scene_ = nullptr;
    bool allow_update_, has_triangles_ = false, has_boxes_ = false, has_opaque_ = false, has_non_opaque_ = false;
    rhi::BuildPreference prefer_;
    std::uint64_t bytes_ = 0;
};

/// An instance as it is built, and as queries see it.
struct RayInstance {
    std::shared_ptr<const RayMesh> mesh;    ///< Null: never hit.
    std::array<float, 12> to_world{};       ///< Three rows of four.
    std::array<float, 12> to_object{};      ///< Filled in by the build.
    std::uint32_t custom_index = 0, table_offset = 0, mask = 0;
    rhi::InstanceFlags flags = rhi::InstanceFlags::none;
};

/// A top level: what compiled shaders trace rays in.
class RayScene {
  public:
    RayScene(std::shared_ptr<RayDevice> device, bool allow_update, rhi::BuildPreference prefer);
    ~RayScene();
    RayScene(const RayScene&) = delete;
    RayScene& operator=(const RayScene&) = delete;

    /// Throws std::bad_alloc.
    void build(std::vector<RayInstance> instances, bool is_update);

    /// Null before the first build.
    [[nodiscard]] RTCSceneTy* scene() const { return scene_; }
    /// What hits get as instance where `scene` is that of a mesh, without instances; else Embree's sign for none.
    [[nodiscard]] std::uint32_t only_instance() const { return only_instance_; }
    [[nodiscard]] const std::vector<RayInstance>& instances() const { return instances_; }
    [[nodiscard]] std::uint32_t packet_width() const { return packet_width_; }
    /// Rays whose origins are this near to each other (squared) and go the same way are better traced as coherent.
    [[nodiscard]] float coherent_spread2() const { return coherent_spread2_; }
    /// Some geometry gives candidates unless a ray says otherwise.
    [[nodiscard]] bool has_candidates() const { return has_candidates_; }
    /// Some instance overrules the opacity of its geometry.
    [[nodiscard]] bool has_overrides() const { return has_overrides_; }
    [[nodiscard]] bool has_boxes() const { return has_boxes_; }
    [[nodiscard]] std::uint64_t bytes() const { return instances_.size() * sizeof(RayInstance); }

  private:
    std::shared_ptr<RayDevice> device_;
    std::vector<RayInstance> instances_;
    RTCSceneTy* scene_ = nullptr;
    std::uint32_t only_instance_, packet_width_;
    float coherent_spread2_ = 0;
    bool allow_update_, has_candidates_ = false, has_overrides_ = false, has_boxes_ = false;
    rhi::BuildPreference prefer_;
};

/// Triangles and boxes with coordinates beyond this are never hit.
inline constexpr float largest_vertex_coordinate = 1e17f;

}  // namespace nacre::cpu
