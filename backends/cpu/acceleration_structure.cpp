// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/acceleration_structure.h"

#include <new>
#include <vector>

#include "backends/cpu/buffer.h"

namespace nacre::cpu {

Expected<std::unique_ptr<rhi::BackendAccelerationStructure>> CpuAccelerationStructure::create(
    const std::shared_ptr<RayDevice>& device, const rhi::AccelerationStructureDesc& desc) try {
    auto made = std::make_unique<CpuAccelerationStructure>();
    if (desc.level == rhi::AccelerationStructureLevel::top)
        made->scene_ = std::make_unique<RayScene>(device, desc.allow_update, desc.prefer);
    else
        made->mesh_ = std::make_shared<RayMesh>(device, desc.geometries, desc.allow_update, desc.prefer);
    return made;
} catch (const std::bad_alloc&) {
    return fail(ErrorCode::out_of_memory, "create acceleration structure", "'" + desc.name + "'",
                "there is no memory for it", "Free other resources.");
}

void CpuAccelerationStructure::build(const rhi::BuildAccelerationStructureCommand& command) {
    if (mesh_ && !command.is_top) {
        std::vector<RayGeometrySource> sources(command.count);
        for (std::uint32_t i = 0; i < command.count; ++i) {
            const rhi::GeometrySourceCommand& source = command.sources()[i];
            if (const auto* buffer = static_cast<const CpuBuffer*>(source.vertices.object)) {
                sources[i].vertices = buffer->data() + source.vertex_offset;
                sources[i].vertex_bytes = buffer->size_from(source.vertex_offset);
            }
            if (const auto* buffer = static_cast<const CpuBuffer*>(source.indices.object)) {
                sources[i].indices = buffer->data() + source.index_offset;
                sources[i].index_bytes = buffer->size_from(source.index_offset);
            }
        }
        mesh_->build(sources, command.is_update);
        memory_bytes = mesh_->bytes();
    } else if (scene_ && command.is_top) {
        std::vector<RayInstance> instances(command.count);
        for (std::uint32_t i = 0; i < command.count; ++i) {
            const rhi::InstanceCommand& from = command.instances()[i];
            RayInstance& instance = instances[i];
            if (from.bottom_level.object)
                instance.mesh = static_cast<const CpuAccelerationStructure*>(from.bottom_level.object)->mesh_;
            instance.to_world = from.transform;
            instance.custom_index = from.custom_index;
            instance.table_offset = from.table_offset;
            instance.mask = from.mask;
            instance.flags = from.flags;
        }
        scene_->build(std::move(instances), command.is_update);
        memory_bytes = scene_->bytes();
    }
}

}  // namespace nacre::cpu
