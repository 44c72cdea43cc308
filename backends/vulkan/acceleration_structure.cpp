// SPDX-License-Identifier: Apache-2.0
#include "backends/vulkan/acceleration_structure.h"

#include <algorithm>
#include <cstring>

#include "backends/vulkan/formats.h"
#include "backends/vulkan/result.h"

namespace nacre::vulkan {
namespace {

constexpr VkBufferUsageFlags addressed_input =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

// The flags of instances have the bits of Vulkan.
static_assert(static_cast<int>(rhi::InstanceFlags::disable_culling) ==
              VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR);
static_assert(static_cast<int>(rhi::InstanceFlags::flip_facing) == VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR);
static_assert(static_cast<int>(rhi::InstanceFlags::force_opaque) == VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR);
static_assert(static_cast<int>(rhi::InstanceFlags::force_no_opaque) == VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR);

VkIndexType index_type_of(const rhi::GeometryDesc& geometry) {
    if (!geometry.index_type) return VK_INDEX_TYPE_NONE_KHR;
    return *geometry.index_type == rhi::IndexType::uint16 ? VK_INDEX_TYPE_UINT16 : VK_INDEX_TYPE_UINT32;
}

}  // namespace

void AccelerationStructure::describe(const rhi::AccelerationStructureDesc& structure, Shape& shape) const {
    const bool is_top = structure.level == rhi::AccelerationStructureLevel::top;
    if (is_top) {
        VkAccelerationStructureGeometryKHR& instances = shape.geometries.emplace_back();
        instances = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
        instances.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
        instances.geometry.instances = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR};
        shape.counts.push_back(structure.max_instances);
    }
    for (const rhi::GeometryDesc& from : structure.geometries) {
        VkAccelerationStructureGeometryKHR& to = shape.geometries.emplace_back();
        to = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
        shape.counts.push_back(from.primitive_count);
        // Each hit is one candidate, as on the other backends.
        to.flags = from.opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR;
        if (from.type == rhi::GeometryType::boxes) {
            to.geometryType = VK_GEOMETRY_TYPE_AABBS_KHR;
            to.geometry.aabbs = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_AABBS_DATA_KHR};
            to.geometry.aabbs.stride = from.vertex_stride;
            continue;
        }
        to.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
        VkAccelerationStructureGeometryTrianglesDataKHR& triangles = to.geometry.triangles;
        triangles = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR};
        triangles.vertexFormat = to_vulkan(from.vertex_format);
        triangles.vertexStride = from.vertex_stride;
        triangles.maxVertex = std::max(from.vertex_count, 1u) - 1;
        triangles.indexType = index_type_of(from);
    }
    shape.info.type =
        is_top ? VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
    shape.info.flags = structure.prefer == rhi::BuildPreference::fast_build
                           ? VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR
                           : VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
    if (structure.allow_update) shape.info.flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
    shape.info.geometryCount = static_cast<std::uint32_t>(shape.geometries.size());
    shape.info.pGeometries = shape.geometries.data();
}

Expected<std::unique_ptr<rhi::BackendAccelerationStructure>> AccelerationStructure::create(
    Context& context, const rhi::AccelerationStructureDesc& desc) {
    std::unique_ptr<AccelerationStructure> made(new AccelerationStructure(context));
    const std::string subject = "acceleration structure " + in_quotes(desc.name);
    Shape shape;
    made->describe(desc, shape);
    VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    context.vk.GetAccelerationStructureBuildSizesKHR(context.device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                     &shape.info, shape.counts.data(), &sizes);
    made->build_scratch_bytes_ = sizes.buildScratchSize;
    made->update_scratch_bytes_ = sizes.updateScratchSize;
    const rhi::BufferDesc storage{.size = std::max<std::uint64_t>(sizes.accelerationStructureSize, 1),
                                  .name = desc.name};
    NACRE_TRY(made->storage_, Buffer::create(context, storage, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR));
    made->memory_bytes = made->storage_->memory_bytes;
    VkAccelerationStructureCreateInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    info.buffer = native(*made->storage_).handle;
    info.size = storage.size;
    info.type = shape.info.type;
    if (VkResult result = context.vk.CreateAccelerationStructureKHR(context.device, &info, nullptr, &made->handle);
        result != VK_SUCCESS)
        return fail(context.check(result), "create", subject);
    context.set_name(made->handle, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, desc.name);
    VkAccelerationStructureDeviceAddressInfoKHR which{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR};
    which.accelerationStructure = made->handle;
    made->address_ = context.vk.GetAccelerationStructureDeviceAddressKHR(context.device, &which);
    return made;
}

AccelerationStructure::~AccelerationStructure() {
    if (handle) context_.vk.DestroyAccelerationStructureKHR(context_.device, handle, nullptr);
}

Expected<Buffer*> AccelerationStructure::keep_buffer(const char* purpose, std::uint64_t bytes, rhi::MemoryKind kind,
                                                     VkBufferUsageFlags usage,
                                                     std::vector<std::unique_ptr<rhi::BackendBuffer>>& kept) const {
    NACRE_TRY(kept.emplace_back(),
              Buffer::create(context_, {.size = bytes, .memory = kind, .name = desc.name + ", " + purpose}, usage));
    return &native(*kept.back());
}

Expected<VkDeviceAddress> AccelerationStructure::write_instances(
    const rhi::BuildAccelerationStructureCommand& command,
    std::vector<std::unique_ptr<rhi::BackendBuffer>>& kept) const {
    std::vector<VkAccelerationStructureInstanceKHR> instances(command.count);
    for (std::uint32_t i = 0; i < command.count; ++i) {
        const rhi::InstanceCommand& from = command.instances()[i];
        VkAccelerationStructureInstanceKHR& to = instances[i];
        std::memcpy(to.transform.matrix, from.transform.data(), sizeof to.transform.matrix);
        to.instanceCustomIndex = from.custom_index & 0xffffff;
        to.mask = from.mask & 0xff;
        to.instanceShaderBindingTableRecordOffset = from.table_offset & 0xffffff;
        to.flags = static_cast<std::uint8_t>(from.flags);
        // Without a reference an instance is inactive.
        if (from.bottom_level.object && rhi::inverse_of(from.transform))
            to.accelerationStructureReference = native(*from.bottom_level.object).address_;
    }
    const std::size_t bytes = instances.size() * sizeof instances[0];
    NACRE_TRY(Buffer* const buffer, keep_buffer("instances", std::max<std::size_t>(bytes, sizeof instances[0]),
                                                rhi::MemoryKind::upload, addressed_input, kept));
    if (bytes != 0) std::memcpy(buffer->mapped, instances.data(), bytes);
    NACRE_CHECK(buffer->memory.flush());
    return buffer->address();
}

Expected<void> AccelerationStructure::record_build(VkCommandBuffer commands,
                                                   const rhi::BuildAccelerationStructureCommand& command,
                                                   std::vector<std::unique_ptr<rhi::BackendBuffer>>& kept) {
    // A top level is small, and which of its instances are active may change with each update, which Vulkan does not
    // allow.
    const bool is_update = command.is_update && !command.is_top;
    Shape shape;
    describe(desc, shape);
    const std::uint64_t alignment = std::max<std::uint64_t>(
        context_.physical->acceleration_structure.minAccelerationStructureScratchOffsetAlignment, 1);
    const std::uint64_t scratch_bytes = is_update ? update_scratch_bytes_ : build_scratch_bytes_;
    NACRE_TRY(Buffer* const scratch, keep_buffer("scratch", scratch_bytes + alignment, rhi::MemoryKind::device,
                                                 VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | addressed_input, kept));
    const VkDeviceAddress scratch_address = scratch->address();
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges(shape.geometries.size());
    if (command.is_top) {
        NACRE_TRY(shape.geometries[0].geometry.instances.data.deviceAddress, write_instances(command, kept));
        ranges[0].primitiveCount = command.count;
    } else {
        for (std::uint32_t i = 0; i < command.count; ++i) {
            const rhi::GeometrySourceCommand& source = command.sources()[i];
            ranges[i].primitiveCount = shape.counts[i];
            const auto address = [&](const rhi::BufferReference& buffer, std::uint64_t offset) {
                // An empty geometry needs an address, too; nothing is read there.
                return buffer.object ? native(*buffer.object).address() + offset : scratch_address;
            };
            if (shape.geometries[i].geometryType == VK_GEOMETRY_TYPE_AABBS_KHR) {
                shape.geometries[i].geometry.aabbs.data.deviceAddress = address(source.vertices, source.vertex_offset);
                continue;
            }
            VkAccelerationStructureGeometryTrianglesDataKHR& triangles = shape.geometries[i].geometry.triangles;
            triangles.vertexData.deviceAddress = address(source.vertices, source.vertex_offset);
            if (triangles.indexType != VK_INDEX_TYPE_NONE_KHR)
                triangles.indexData.deviceAddress = address(source.indices, source.index_offset);
        }
    }
    shape.info.mode =
        is_update ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    shape.info.srcAccelerationStructure = is_update ? handle : VK_NULL_HANDLE;
    shape.info.dstAccelerationStructure = handle;
    shape.info.scratchData.deviceAddress = (scratch_address + alignment - 1) / alignment * alignment;
    const VkAccelerationStructureBuildRangeInfoKHR* all_ranges = ranges.data();
    context_.vk.CmdBuildAccelerationStructuresKHR(commands, 1, &shape.info, &all_ranges);
    return {};
}

}  // namespace nacre::vulkan
