// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rhi/pipeline.h"

/// @file
/// What rays are traced against: bottom levels hold geometry, a top level holds instances of bottom levels and is what
/// shaders see (`accelerationStructureEXT`). Needs `Capabilities::ray_query`; docs/ray-tracing.md tells the whole
/// story.
///
///     AccelerationStructure mesh = *device.create_acceleration_structure({
///         .level = AccelerationStructureLevel::bottom,
///         .geometries = {{.primitive_count = 12, .vertex_count = 8, .index_type = IndexType::uint32}}});
///     AccelerationStructure scene = *device.create_acceleration_structure({
///         .level = AccelerationStructureLevel::top, .max_instances = 1});
///     list.build_acceleration_structure(mesh, std::array{GeometrySource{.vertices = vertices, .indices = indices}});
///     list.build_acceleration_structure(scene, std::array{AccelerationStructureInstance{.bottom_level = mesh}});

namespace nacre::rhi {

enum class AccelerationStructureLevel : std::uint8_t { bottom, top };

/// Kinds of geometry. A box is a place where a ray may hit something of the shader's own: it is always a candidate,
/// which the shader answers with the distance of its hit (rayQueryGenerateIntersectionEXT). Curves have their place
/// here; no device offers them yet, and asking for them is an error of code unsupported.
enum class GeometryType : std::uint8_t { triangles, boxes, curves };

/// What a build spends its time for.
enum class BuildPreference : std::uint8_t { fast_trace, fast_build };

/// Shape of one geometry of a bottom level; where its data lies is told when it is built.
struct GeometryDesc {
    GeometryType type = GeometryType::triangles;
    /// Hits count at once. Otherwise they are candidates that the shader confirms (alpha test), unless an instance or a
    /// ray says otherwise. Of boxes: what rayQueryGetIntersectionCandidateAABBOpaqueEXT says.
    bool opaque = true;
    std::uint32_t primitive_count = 0;                ///< Triangles or boxes; 0 is an empty geometry.
    Format vertex_format = Format::rgb32_float;       ///< The only one.
    std::uint32_t vertex_count = 0;                   ///< Of boxes 0.
    /// Bytes from vertex to vertex: a multiple of 4, 12 to 65,536. Of boxes, which are six floats (least x, y, z, then
    /// largest), from box to box: a multiple of 8, 24 to 65,536.
    std::uint32_t vertex_stride = 12;
    std::optional<IndexType> index_type = {};         ///< Nothing: three vertices in a row make a triangle.
};

struct AccelerationStructureDesc {
    AccelerationStructureLevel level = AccelerationStructureLevel::bottom;
    /// Of bottom levels, all of one type; the index is what shaders read as geometry index.
    std::vector<GeometryDesc> geometries = {};
    std::uint32_t max_instances = 0;                  ///< Top levels.
    bool allow_update = false;                        ///< `CommandList::update_acceleration_structure` may be used.
    BuildPreference prefer = BuildPreference::fast_trace;
    std::string name = {};
};

/// Where the data of one geometry lies while it is built. The structure does not refer to it afterwards.
struct GeometrySource {
    Buffer vertices{};                 ///< Or boxes. With usage acceleration_structure_input.
    std::uint64_t vertex_offset = 0;   ///< Bytes; a multiple of 4, of boxes of 8.
    Buffer indices{};                  ///< The same, where the geometry has an index type.
    std::uint64_t index_offset = 0;    ///< Bytes; a multiple of the size of an index.
};

/// Ways in which an instance overrules its geometry.
enum class InstanceFlags : std::uint32_t {
    none = 0,
    disable_culling = 1,  ///< Rays that cull by facing see both sides.
    flip_facing = 2,  ///< Fronts become backs. The front of (a, b, c) is where cross(b - a, c - a) points to, in the
                      ///< object's space.
    force_opaque = 4,
    force_no_opaque = 8,
};
NACRE_FLAGS(InstanceFlags)

/// One bottom level, placed in a top level.
struct AccelerationStructureInstance {
    AccelerationStructure bottom_level{};   ///< Empty: the instance is never hit.
    /// Object to world, three rows of four; finite. An instance whose matrix has no inverse (or one beyond 1e7) is
    /// never hit.
    std::array<float, 12> transform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    std::uint32_t custom_index = 0;         ///< Below 2^24; what shaders read as instance custom index.
    std::uint32_t table_offset = 0;         ///< Below 2^24; shader binding table record offset.
    std::uint8_t mask = 0xff;               ///< Rays whose cull mask shares no bit with it pass through.
    InstanceFlags flags = InstanceFlags::none;
};

/// World to object of an instance with this transform, three rows of four. Nothing where the instance is never hit:
/// where its matrix has no inverse, or one with elements beyond `largest_inverse_element` or an offset beyond
/// `largest_inverse_offset`.
std::optional<std::array<float, 12>> inverse_of(const std::array<float, 12>& transform);

/// With rays up to 1e10 these keep every number in the space of an object far from the largest float.
inline constexpr float largest_inverse_element = 1e7f;
inline constexpr float largest_inverse_offset = 1e17f;

/// What all devices with ray queries can take.
inline constexpr std::uint32_t max_structure_primitives = (1u << 29) - 1;  ///< Of all geometries of a bottom level.
inline constexpr std::uint32_t max_structure_geometries = (1u << 16) - 1;
inline constexpr std::uint32_t max_structure_instances = (1u << 24) - 1;

}  // namespace nacre::rhi
