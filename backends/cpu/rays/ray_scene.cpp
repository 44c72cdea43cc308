// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/rays/ray_scene.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <new>

#include "backends/cpu/rays/embree.h"
#include "backends/cpu/rays/traversal.h"
#include "core/log.h"

namespace nacre::cpu {
namespace {

void report(void*, RTCError code, const char* text) {
    log_message(LogLevel::debug, fmt::format("Embree says ({}): {}", static_cast<int>(code), text ? text : ""));
}

/// Whether an instance is its mesh as it stands, for all rays.
bool is_in_place(const RayInstance& instance) {
    constexpr std::array<float, 12> identity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    return instance.to_world == identity && (instance.mask & 0xff) == 0xff;
}

/// Of the diagonal of a scene. Measured with triangles of 1/400 of it: at a spread of 1/20 both ways are as fast.
constexpr float coherent_share = 0.025f;

RTCBuildQuality quality_of(rhi::BuildPreference prefer) {
    return prefer == rhi::BuildPreference::fast_build ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_MEDIUM;
}

/// `is_dynamic` scenes keep what is needed to change them.
RTCScene new_scene(RTCDevice device, rhi::BuildPreference prefer, bool is_dynamic) {
    RTCScene scene = rtcNewScene(device);
    if (!scene) throw std::bad_alloc();
    // Without `robust` rays slip through the edges that triangles share.
    unsigned flags = RTC_SCENE_FLAG_ROBUST | embree::filtered_scene;
    if (is_dynamic) flags |= RTC_SCENE_FLAG_DYNAMIC;
    rtcSetSceneFlags(scene, static_cast<RTCSceneFlags>(flags));
    rtcSetSceneBuildQuality(scene, quality_of(prefer));
    return scene;
}

}  // namespace

Expected<std::shared_ptr<RayDevice>> RayDevice::create(std::uint32_t threads, const std::string& options) {
    std::shared_ptr<RayDevice> made(new RayDevice());
    // Threads of Embree's arena are those that builds use; queries run on the caller's.
    const std::string text = fmt::format("threads={},set_affinity=0{}{}", threads, options.empty() ? "" : ",", options);
    made->device_ = rtcNewDevice(text.c_str());
    if (!made->device_)
        return fail(ErrorCode::unsupported, "open Embree", text,
                    fmt::format("it says error {}", static_cast<int>(rtcGetDeviceError(nullptr))),
                    "Reinstall Embree 3.");
    const auto has = [&](RTCDeviceProperty property) { return rtcGetDeviceProperty(made->device_, property) != 0; };
    if (!has(RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) || !has(RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED))
        return fail(ErrorCode::unsupported, "open Embree", "libembree3",
                    "it was built without ray masks or filter functions",
                    "Use an Embree with EMBREE_RAY_MASK and EMBREE_FILTER_FUNCTION, as Debian's.");
    if (has(RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED)) made->packet_width_ = 8;
    if (has(RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) made->packet_width_ = 16;
    rtcSetDeviceErrorFunction(made->device_, report, nullptr);
    return made;
}

RayDevice::~RayDevice() {
    if (device_) rtcReleaseDevice(device_);
}

void RayDevice::check_memory() const {
    const RTCError error = rtcGetDeviceError(device_);
    if (error == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    // Anything else is a fault of this file; the debug log has its text.
}

RayMesh::RayMesh(std::shared_ptr<RayDevice> device, std::vector<rhi::GeometryDesc> geometries, bool allow_update,
                 rhi::BuildPreference prefer)
    : device_(std::move(device)),
      geometries_(std::move(geometries)),
      attached_(geometries_.size(), nullptr),
      boxes_(geometries_.size()),
      allow_update_(allow_update),
      prefer_(prefer) {}

RayMesh::~RayMesh() {
    if (scene_) rtcReleaseScene(scene_);
}

void RayMesh::start() {
    // Top levels that were built over the old scene hold on to it.
    if (scene_) rtcReleaseScene(scene_);
    scene_ = nullptr;
    scene_ = new_scene(device_->handle(), prefer_, allow_update_);
    has_triangles_ = has_boxes_ = has_opaque_ = has_non_opaque_ = false;
    bytes_ = 0;
    for (std::size_t i = 0; i < geometries_.size(); ++i) attached_[i] = attach(i);
}

RTCGeometry RayMesh::attach(std::size_t index) {
    const rhi::GeometryDesc& desc = geometries_[index];
    const bool is_boxes = desc.type == rhi::GeometryType::boxes;
    if (desc.primitive_count == 0 || (desc.vertex_count == 0 && !is_boxes)) return nullptr;
    RTCGeometry geometry =
        rtcNewGeometry(device_->handle(), is_boxes ? RTC_GEOMETRY_TYPE_USER : RTC_GEOMETRY_TYPE_TRIANGLE);
    if (!geometry) throw std::bad_alloc();
    // The scene keeps it.
    rtcAttachGeometryByID(scene_, geometry, static_cast<unsigned>(index));
    rtcReleaseGeometry(geometry);
    rtcSetGeometryBuildQuality(geometry, quality_of(prefer_));
    if (is_boxes) {
        boxes_[index].boxes.resize(desc.primitive_count);
        rtcSetGeometryUserPrimitiveCount(geometry, desc.primitive_count);
        set_boxes(geometry, boxes_[index]);
        bytes_ += sizeof(RayBoxes::Box) * std::uint64_t{desc.primitive_count};
        has_boxes_ = true;
        return geometry;
    }
    if (!rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, desc.vertex_count) ||
        !rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, desc.primitive_count))
        throw std::bad_alloc();
    if (!desc.opaque) set_candidate_filter(geometry);
    bytes_ += std::uint64_t{12} * desc.vertex_count + std::uint64_t{12} * desc.primitive_count;
    has_triangles_ = true;
    (desc.opaque ? has_opaque_ : has_non_opaque_) = true;
    return geometry;
}

void RayMesh::fill(std::size_t index, const RayGeometrySource& source, bool is_update) {
    if (geometries_[index].type == rhi::GeometryType::boxes)
        fill_boxes(index, source, is_update);
    else
        fill_triangles(index, source, is_update);
    rtcCommitGeometry(attached_[index]);
}

void RayMesh::fill_boxes(std::size_t index, const RayGeometrySource& source, bool is_update) {
    const rhi::GeometryDesc& desc = geometries_[index];
    RayBoxes& to = boxes_[index];
    bool has_stand_in = false;
    for (std::uint32_t i = 0; i < desc.primitive_count; ++i) {
        RayBoxes::Box& box = to.boxes[i];
        const std::uint64_t at = std::uint64_t{i} * desc.vertex_stride;
        bool is_good = at + sizeof box <= source.vertex_bytes;
        if (is_good) {
            std::memcpy(&box, source.vertices + at, sizeof box);
            for (int axis = 0; axis < 3; ++axis)
                is_good = is_good && box.lower[axis] <= box.upper[axis] &&
                          box.lower[axis] >= -largest_vertex_coordinate && box.upper[axis] <= largest_vertex_coordinate;
        }
        if (!is_good) {
            box = {{1, 1, 1}, {0, 0, 0}};
        } else if (!has_stand_in) {
            has_stand_in = true;
            to.stand_in = {box.lower[0], box.lower[1], box.lower[2]};
        }
    }
    if (is_update) rtcSetGeometryBuildQuality(attached_[index], RTC_BUILD_QUALITY_REFIT);
}

void RayMesh::fill_triangles(std::size_t index, const RayGeometrySource& source, bool is_update) {
    const rhi::GeometryDesc& desc = geometries_[index];
    RTCGeometry geometry = attached_[index];
    auto* positions = static_cast<float*>(rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_VERTEX, 0));
    auto* triangles = static_cast<std::uint32_t*>(rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_INDEX, 0));
    if (!positions || !triangles) throw std::bad_alloc();
    // Vertices that cannot be, become the first that can; triangles with one of them shrink to a point, which nothing
    // hits.
    std::vector<bool> is_bad;
    float stand_in[3] = {0, 0, 0};
    bool has_stand_in = false;
    for (std::uint32_t i = 0; i < desc.vertex_count; ++i) {
        const std::uint64_t at = std::uint64_t{i} * desc.vertex_stride;
        float* position = positions + std::size_t{i} * 3;
        bool is_good = at + 12 <= source.vertex_bytes;
        if (is_good) {
            std::memcpy(position, source.vertices + at, 12);
            for (int axis = 0; axis < 3; ++axis)
                is_good = is_good && std::abs(position[axis]) <= largest_vertex_coordinate;
        }
        if (!is_good) {
            if (is_bad.empty()) is_bad.resize(desc.vertex_count);
            is_bad[i] = true;
        } else if (!has_stand_in) {
            has_stand_in = true;
            std::memcpy(stand_in, position, 12);
        }
    }
    if (!is_bad.empty())
        for (std::uint32_t i = 0; i < desc.vertex_count; ++i)
            if (is_bad[i]) std::memcpy(positions + std::size_t{i} * 3, stand_in, 12);
    const auto is_usable = [&](std::uint32_t vertex) {
        return vertex < desc.vertex_count && (is_bad.empty() || !is_bad[vertex]);
    };
    bool indices_changed = false;
    for (std::uint32_t i = 0; i < desc.primitive_count; ++i) {
        std::uint32_t corners[3];
        for (std::uint32_t k = 0; k < 3; ++k) {
            const std::uint64_t number = std::uint64_t{i} * 3 + k;
            corners[k] = ~0u;
            if (!desc.index_type) {
                corners[k] = static_cast<std::uint32_t>(number);
            } else if (*desc.index_type == rhi::IndexType::uint16) {
                std::uint16_t value;
                if (number * 2 + 2 > source.index_bytes) continue;
                std::memcpy(&value, source.indices + number * 2, 2);
                corners[k] = value;
            } else if (number * 4 + 4 <= source.index_bytes) {
                std::memcpy(&corners[k], source.indices + number * 4, 4);
            }
        }
        std::uint32_t* triangle = triangles + std::size_t{i} * 3;
        if (!is_usable(corners[0]) || !is_usable(corners[1]) || !is_usable(corners[2])) {
            std::uint32_t point = 0;
            for (const std::uint32_t corner : corners)
                if (is_usable(corner)) point = corner;
            corners[0] = corners[1] = corners[2] = point;
        }
        indices_changed = indices_changed || std::memcmp(triangle, corners, 12) != 0;
        std::memcpy(triangle, corners, 12);
    }
    rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    if (is_update) {
        // Refitting keeps the tree, so it keeps who is whose neighbor.
        if (indices_changed) rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0);
        rtcSetGeometryBuildQuality(geometry, indices_changed ? quality_of(prefer_) : RTC_BUILD_QUALITY_REFIT);
    }
}

void RayMesh::build(std::span<const RayGeometrySource> sources, bool is_update) {
    is_update = is_update && scene_ && allow_update_;
    if (!is_update) start();
    for (std::size_t i = 0; i < geometries_.size() && i < sources.size(); ++i)
        if (attached_[i]) fill(i, sources[i], is_update);
    rtcCommitScene(scene_);
    device_->check_memory();
}

RayScene::RayScene(std::shared_ptr<RayDevice> device, bool allow_update, rhi::BuildPreference prefer)
    : device_(std::move(device)),
      only_instance_(RTC_INVALID_GEOMETRY_ID),
      packet_width_(device_->packet_width()),
      allow_update_(allow_update),
      prefer_(prefer) {}

RayScene::~RayScene() {
    if (scene_) rtcReleaseScene(scene_);
}

void RayScene::build(std::vector<RayInstance> instances, bool) {
    std::vector<std::size_t> usable;
    bool has_candidates = false, has_overrides = false, has_boxes = false;
    for (std::size_t i = 0; i < instances.size(); ++i) {
        RayInstance& instance = instances[i];
        if (!instance.mesh || !instance.mesh->scene() || !instance.mesh->has_primitives() ||
            (instance.mask & 0xff) == 0)
            continue;
        const auto to_object = rhi::inverse_of(instance.to_world);
        if (!to_object) continue;
        instance.to_object = *to_object;
        usable.push_back(i);
        has_boxes = has_boxes || instance.mesh->has_boxes();
        if (has_any(instance.flags, rhi::InstanceFlags::force_no_opaque)) {
            has_candidates = true;
            has_overrides = has_overrides || instance.mesh->has_opaque();
        } else if (has_any(instance.flags, rhi::InstanceFlags::force_opaque)) {
            has_overrides = has_overrides || instance.mesh->has_non_opaque();
        } else {
            has_candidates = has_candidates || instance.mesh->has_non_opaque();
        }
    }
    RTCScene scene = nullptr;
    std::uint32_t only_instance = RTC_INVALID_GEOMETRY_ID;
    if (usable.size() == 1 && is_in_place(instances[usable[0]])) {
        // Rays of a mesh alone need no way through an instance: coherent ones are a fifth faster.
        only_instance = static_cast<std::uint32_t>(usable[0]);
        scene = instances[usable[0]].mesh->scene();
        rtcRetainScene(scene);
    } else {
        // A tree over instances is small; it is always made anew.
        scene = new_scene(device_->handle(), prefer_, false);
        for (const std::size_t i : usable) {
            RTCGeometry geometry = rtcNewGeometry(device_->handle(), RTC_GEOMETRY_TYPE_INSTANCE);
            if (!geometry) {
                rtcReleaseScene(scene);
                throw std::bad_alloc();
            }
            rtcSetGeometryInstancedScene(geometry, instances[i].mesh->scene());
            rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, instances[i].to_world.data());
            rtcSetGeometryMask(geometry, instances[i].mask & 0xff);
            rtcCommitGeometry(geometry);
            rtcAttachGeometryByID(scene, geometry, static_cast<unsigned>(i));
            rtcReleaseGeometry(geometry);
        }
        rtcCommitScene(scene);
    }
    if (scene_) rtcReleaseScene(scene_);
    scene_ = scene;
    only_instance_ = only_instance;
    instances_ = std::move(instances);
    has_candidates_ = has_candidates;
    has_overrides_ = has_overrides;
    has_boxes_ = has_boxes;
    coherent_spread2_ = 0;
    if (!usable.empty()) {
        RTCBounds bounds;
        rtcGetSceneBounds(scene, &bounds);
        const float size[3] = {bounds.upper_x - bounds.lower_x, bounds.upper_y - bounds.lower_y,
                               bounds.upper_z - bounds.lower_z};
        coherent_spread2_ =
            (size[0] * size[0] + size[1] * size[1] + size[2] * size[2]) * coherent_share * coherent_share;
    }
    device_->check_memory();
}

}  // namespace nacre::cpu
