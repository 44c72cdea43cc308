// SPDX-License-Identifier: Apache-2.0
// Builds of acceleration structures, and what has to hold where shaders read them.
#include <fmt/format.h>

#include <algorithm>

#include "rhi/command_validator.h"
#include "rhi/submission_walk.h"

namespace nacre::rhi {

SubmissionWalk::Step SubmissionWalk::check_structure(const AccelerationStructureObject& structure,
                                                     const char* attempted) const {
    const std::string subject = place() + ", acceleration structure '" + structure.desc.name + "'";
    if (structure.content.builds == 0)
        return Problem{Rule::structure_unbuilt, ErrorCode::validation, attempted, subject,
                       "expected an acceleration structure that was built, found one that was not",
                       "Call build_acceleration_structure before."};
    for (const AccelerationStructureObject::BottomLevel& bottom : structure.content.bottom_levels) {
        if (!bottom.slot->occupied || bottom.slot->generation != bottom.generation)
            return Problem{Rule::structure_bottom_destroyed, ErrorCode::validation, attempted, subject,
                           "expected its bottom levels to live, found one that was destroyed",
                           "Destroy bottom levels after the last use of the top levels that were built over them."};
        if (bottom.slot->object.content.builds != bottom.builds)
            return Problem{Rule::structure_outdated, ErrorCode::validation, attempted, subject,
                           "expected a top level that is newer than its bottom levels, found '" +
                               bottom.slot->object.desc.name + "' built or updated since",
                           "Build or update the top level again."};
    }
    return {};
}

SubmissionWalk::Step SubmissionWalk::build(CommandHeader& header, BuildAccelerationStructureCommand& command) {
    const char* attempted = command.is_update ? "update acceleration structure" : "build acceleration structure";
    // Builds are rare, and a driver does not check them: all of the checks are made again at the submission.
    CommandValidator validator(device_.shared, stream_->name);
    if (auto failed = validator.build_acceleration_structure(command)) return failed;
    if (pass_)
        return misuse(Rule::inside_render_pass, attempted, "expected no open render pass, found one",
                      "Move it before begin_render_pass or after end_render_pass.");
    AccelerationStructureObject* structure = look_up(command.structure.handle, attempted, "acceleration structure");
    if (!structure) return std::move(problem_);
    if (command.is_update && structure->content.builds == 0)
        return misuse(
            Rule::structure_update, attempted,
            fmt::format("expected '{}' to be built before it is updated, found no build", structure->desc.name),
            "Build it first.");
    if (command.is_update && structure->content.count != command.count)
        return misuse(Rule::structure_update, attempted,
                      fmt::format("expected the {} instances of the last build of '{}', found {}",
                                  structure->content.count, structure->desc.name, command.count),
                      "Build it anew where the number of instances changes.");
    command.structure.object = structure->backend.get();
    tracker_.begin_scope();
    if (auto failed = use(attempted, *structure, {ResourceUse::acceleration_structure_write, ShaderStage::none}))
        return failed;
    std::vector<AccelerationStructureObject::BottomLevel> bottom_levels;
    if (command.is_top) {
        for (std::uint32_t i = 0; i < command.count; ++i) {
            AccelerationStructureReference& reference = command.instances()[i].bottom_level;
            if (!reference.handle) {
                reference.object = nullptr;
                continue;
            }
            auto* slot = tables_.acceleration_structures.find_slot(reference.handle);
            AccelerationStructureObject& bottom = slot->object;
            if (bottom.content.builds == 0)
                return misuse(Rule::structure_unbuilt, attempted,
                              fmt::format("expected the bottom level '{}' of instance {} to be built, found no build",
                                          bottom.desc.name, i),
                              "Build bottom levels before top levels.");
            // Neighbors are often of one structure; a scope holds each once anyway.
            if (bottom.scope_epoch != tracker_.epoch())
                bottom_levels.push_back({slot, slot->generation, bottom.content.builds});
            if (auto failed = use(attempted, bottom, {ResourceUse::acceleration_structure_read, ShaderStage::none}))
                return failed;
            reference.object = bottom.backend.get();
        }
    } else {
        for (std::uint32_t i = 0; i < command.count; ++i) {
            GeometrySourceCommand& source = command.sources()[i];
            for (BufferReference* reference : {&source.vertices, &source.indices}) {
                if (!reference->handle) {
                    reference->object = nullptr;
                    continue;
                }
                BufferObject* buffer = look_up(reference->handle, attempted, "buffer");
                if (!buffer) return std::move(problem_);
                if (auto failed = use(attempted, *buffer, {ResourceUse::build_input, ShaderStage::none})) return failed;
                reference->object = buffer->backend.get();
            }
        }
    }
    tracker_.end_scope(&header);
    note_statement();
    ++structure->content.builds;
    structure->content.count = command.count;
    structure->content.bottom_levels = std::move(bottom_levels);
    return {};
}

}  // namespace nacre::rhi
