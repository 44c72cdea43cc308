// SPDX-License-Identifier: Apache-2.0
// Verify mode: what a pass says that it uses against what its commands do.
#include "rhi/submission_walk.h"

namespace nacre::rhi {

void SubmissionWalk::note_statement() {
    if (!in_statement_ || !follows_statements()) return;
    const auto note = [&](ResourceKey key, ResourceUse use, BackendObject* object) {
        actual_[key] |= use;
        used_objects_[key] = object;
    };
    for (const BufferObject* buffer : tracker_.scope_buffers())
        note({ResourceKind::buffer, buffer->handle.index}, buffer->scope_state.use, buffer->backend.get());
    for (const TextureObject* texture : tracker_.scope_textures()) {
        ResourceUse use = texture->scope_state.use;
        for (const ResourceState& part : texture->scope_states) use |= part.use;
        note({ResourceKind::texture, texture->handle.index}, use, texture->backend.get());
    }
    for (const AccelerationStructureObject* structure : tracker_.scope_structures())
        note({ResourceKind::acceleration_structure, structure->handle.index}, structure->scope_state.use,
             structure->backend.get());
}

void SubmissionWalk::end_statement() {
    if (!follows_statements()) return;
    std::map<ResourceKey, ResourceUse> stated;
    for (const StatedAccess& access : stated_) {
        if (access.buffer) stated[{ResourceKind::buffer, access.buffer.index}] |= access.use;
        if (access.texture) stated[{ResourceKind::texture, access.texture.index}] |= access.use;
        if (access.acceleration_structure)
            stated[{ResourceKind::acceleration_structure, access.acceleration_structure.index}] |= access.use;
    }
    for (const auto& [key, found] : actual_) {
        const auto at = stated.find(key);
        const ResourceUse expected = at == stated.end() ? ResourceUse::none : at->second;
        if (!has_any(found, ~expected)) continue;
        UnstatedUse& use = unstated_uses_.emplace_back();
        use.statement = statement_;
        use.stated = expected;
        use.found = found;
        BackendObject* object = used_objects_.at(key);
        if (key.first == ResourceKind::buffer) use.buffer = static_cast<BackendBuffer*>(object);
        if (key.first == ResourceKind::texture) use.texture = static_cast<BackendTexture*>(object);
        if (key.first == ResourceKind::acceleration_structure)
            use.acceleration_structure = static_cast<BackendAccelerationStructure*>(object);
    }
    if (!device_.shared->desc.verify_statements) return;
    const auto name_of_resource = [&](ResourceKey key) -> std::string {
        std::string name;
        if (key.first == ResourceKind::texture)
            tables_.textures.for_each([&](TextureObject& texture) {
                if (texture.handle.index == key.second) name = "texture '" + texture.desc.name + "'";
            });
        else if (key.first == ResourceKind::acceleration_structure)
            tables_.acceleration_structures.for_each([&](AccelerationStructureObject& structure) {
                if (structure.handle.index == key.second)
                    name = "acceleration structure '" + structure.desc.name + "'";
            });
        else
            tables_.buffers.for_each([&](BufferObject& buffer) {
                if (buffer.handle.index == key.second) name = "buffer '" + buffer.desc.name + "'";
            });
        return name.empty() ? "a destroyed resource" : name;
    };
    const auto tell = [&](Rule rule, ResourceKey key, ResourceUse expected, ResourceUse found,
                          std::string remedy) {
        statement_problems_.push_back(
            {rule, ErrorCode::validation, "verify statement", "'" + statement_name_ + "', " + name_of_resource(key),
             "the statement names " + text_of(expected) + ", the commands use " + text_of(found), std::move(remedy)});
    };
    for (const auto& [key, found] : actual_) {
        const auto at = stated.find(key);
        const ResourceUse expected = at == stated.end() ? ResourceUse::none : at->second;
        if (has_any(found, ~expected))
            tell(Rule::statement_missing, key, expected, found,
                 "Add " + text_of(found & ~expected) + " to the statement.");
    }
    for (const auto& [key, expected] : stated) {
        const auto at = actual_.find(key);
        const ResourceUse found = at == actual_.end() ? ResourceUse::none : at->second;
        if (has_any(expected, ~found))
            tell(Rule::statement_superfluous, key, expected, found,
                 "Remove " + text_of(expected & ~found) + " from the statement.");
    }
}

}  // namespace nacre::rhi
