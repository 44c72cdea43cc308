// SPDX-License-Identifier: Apache-2.0
// Builds of acceleration structures.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rhi/command_validator.h"

namespace nacre::rhi {

Check CommandValidator::check_geometry_source(const char* attempted, const AccelerationStructureDesc& structure,
                                              std::size_t index, const GeometrySourceCommand& source) {
    const GeometryDesc& geometry = structure.geometries[index];
    struct Part {
        const char* kind;
        Buffer buffer;
        std::uint64_t offset, bytes, alignment;
    };
    const std::uint64_t index_bytes = geometry.index_type == IndexType::uint16 ? 2 : 4;
    const bool is_boxes = geometry.type == GeometryType::boxes;
    const std::uint32_t element_count = is_boxes ? geometry.primitive_count : geometry.vertex_count;
    const std::uint64_t element_bytes = is_boxes ? 24 : 12;
    const Part parts[] = {
        {is_boxes ? "box buffer" : "vertex buffer", source.vertices.handle, source.vertex_offset,
         element_count == 0 ? 0 : std::uint64_t{element_count - 1} * geometry.vertex_stride + element_bytes,
         is_boxes ? 8u : 4u},
        {"index buffer", source.indices.handle, source.index_offset,
         geometry.index_type ? std::uint64_t{geometry.primitive_count} * 3 * index_bytes : 0, index_bytes}};
    for (const Part& part : parts) {
        const bool is_needed = part.bytes != 0 && geometry.primitive_count != 0;
        if (!is_needed && !part.buffer) continue;
        const std::string subject = fmt::format("acceleration structure '{}', geometry {}", structure.name, index);
        if (!is_needed && part.kind[0] == 'i' && !geometry.index_type)
            return problem(
                Rule::build_sources, attempted, "expected no index buffer for a geometry without indices, found one",
                "Set GeometryDesc::index_type where the structure is made, or leave the buffer out.", subject);
        Check failed;
        const BufferObject* buffer = look_up(part.buffer, attempted, part.kind, failed);
        if (!buffer) return failed;
        if (!has_all(buffer->desc.usage, BufferUsage::acceleration_structure_input))
            return problem(Rule::build_usage, attempted,
                           fmt::format("expected {} '{}' to have usage acceleration_structure_input, found {}",
                                       part.kind, buffer->desc.name, text_of(buffer->desc.usage)),
                           "Add the usage where the buffer is created.", subject);
        if (part.offset % part.alignment != 0)
            return problem(Rule::build_alignment, attempted,
                           fmt::format("expected an offset into {} '{}' that is a multiple of {}, found {}", part.kind,
                                       buffer->desc.name, part.alignment, part.offset),
                           "Align the offset.", subject);
        if (part.offset > buffer->desc.size || part.bytes > buffer->desc.size - part.offset)
            return problem(Rule::build_range, attempted,
                           fmt::format("expected a range within the {} bytes of {} '{}', found {} bytes from {}",
                                       buffer->desc.size, part.kind, buffer->desc.name, part.bytes, part.offset),
                           "Correct the offset, or the counts of the geometry.", subject);
    }
    return {};
}

Check CommandValidator::build_acceleration_structure(const BuildAccelerationStructureCommand& command) {
    const char* attempted = command.is_update ? "update acceleration structure" : "build acceleration structure";
    const std::shared_lock lock(device_->tables_mutex);
    if (auto failed = outside(attempted)) return failed;
    Check failed;
    const AccelerationStructureObject* structure =
        look_up(command.structure.handle, attempted, "acceleration structure", failed);
    if (!structure) return failed;
    const AccelerationStructureDesc& desc = structure->desc;
    const std::string subject = fmt::format("acceleration structure '{}'", desc.name);
    const bool is_top = desc.level == AccelerationStructureLevel::top;
    if (command.is_top != is_top)
        return problem(Rule::build_sources, attempted,
                       is_top ? "expected instances for a top level, found sources of geometry"
                              : "expected sources of geometry for a bottom level, found instances",
                       "Build the structure that the sources are for.", subject);
    if (command.is_update && !desc.allow_update)
        return problem(Rule::structure_update, attempted,
                       "expected a structure that may be updated (allow_update), found one that may not",
                       "Set AccelerationStructureDesc::allow_update, or build it anew.", subject);
    if (!is_top) {
        if (command.count != desc.geometries.size())
            return problem(Rule::build_sources, attempted,
                           fmt::format("expected one source for each of {} geometries, found {}",
                                       desc.geometries.size(), command.count),
                           "Give the sources of all geometries, in their order.", subject);
        for (std::size_t i = 0; i < command.count; ++i)
            if (auto wrong = check_geometry_source(attempted, desc, i, command.sources()[i])) return wrong;
        return {};
    }
    if (command.count > desc.max_instances)
        return problem(Rule::build_sources, attempted,
                       fmt::format("expected at most {} instances (max_instances), found {}", desc.max_instances,
                                   command.count),
                       "Make the structure larger.", subject);
    for (std::uint32_t i = 0; i < command.count; ++i) {
        const InstanceCommand& instance = command.instances()[i];
        const auto wrong = [&](std::string reason, std::string remedy) {
            return problem(Rule::build_instance, attempted, fmt::format("instance {}: {}", i, reason),
                           std::move(remedy), subject);
        };
        if (instance.bottom_level.handle) {
            const AccelerationStructureObject* bottom =
                look_up(instance.bottom_level.handle, attempted, "bottom level", failed);
            if (!bottom) return failed;
            if (bottom->desc.level != AccelerationStructureLevel::bottom)
                return wrong(fmt::format("expected a bottom level, found the top level '{}'", bottom->desc.name),
                             "Top levels hold instances of bottom levels alone.");
        }
        if (!std::ranges::all_of(instance.transform, [](float value) { return std::isfinite(value); }))
            return wrong("expected a finite transform, found one that is not", "Leave the instance out.");
        if (instance.custom_index >> 24 || instance.table_offset >> 24)
            return wrong(fmt::format("expected a custom index and a table offset below 2^24, found {} and {}",
                                     instance.custom_index, instance.table_offset),
                         "Use smaller numbers.");
        if (has_all(instance.flags, InstanceFlags::force_opaque | InstanceFlags::force_no_opaque))
            return wrong("expected one of force_opaque and force_no_opaque, found both", "Remove one of them.");
    }
    return {};
}

}  // namespace nacre::rhi
