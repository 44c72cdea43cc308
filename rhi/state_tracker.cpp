// SPDX-License-Identifier: Apache-2.0
#include "rhi/state_tracker.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

namespace nacre::rhi {
namespace {

constexpr ResourceUse storage_uses = ResourceUse::storage_read | ResourceUse::storage_write;
constexpr ResourceUse depth_reads = ResourceUse::sampled | ResourceUse::depth_stencil_read;
constexpr ResourceUse copy_uses = ResourceUse::copy_source | ResourceUse::copy_destination;

bool contains(ResourceState outer, ResourceState inner) {
    return has_all(outer.use, inner.use) && has_all(outer.stages, inner.stages);
}
ResourceState merge(ResourceState a, ResourceState b) { return {a.use | b.use, a.stages | b.stages}; }
bool writes(ResourceState state) { return has_any(state.use, writing_uses); }

/// Whether two uses of one part of a texture may share a scope.
bool texture_uses_agree(ResourceUse a, ResourceUse b) {
    const ResourceUse both = a | b;
    return a == b || has_all(storage_uses, both) || has_all(depth_reads, both);
}

/// Whether two uses of one buffer may share a scope. Copies within one buffer go between ranges that do not overlap.
bool buffer_uses_agree(ResourceUse a, ResourceUse b) {
    const ResourceUse both = a | b;
    return !has_any(both, writing_uses) || has_all(storage_uses, both) || has_all(copy_uses, both);
}

/// Uses of a texture that share a layout in every API.
bool same_layout(ResourceUse a, ResourceUse b) {
    return a == b || has_all(depth_reads, a | b) || has_all(storage_uses, a | b);
}

/// The state after `needed`, and whether a barrier is due.
struct Step {
    bool barrier = false;
    ResourceState after;
};
Step step(ResourceState current, ResourceState needed, bool is_texture) {
    if (current.use == ResourceUse::none) return {is_texture, needed};
    if (!writes(current) && !writes(needed) && (!is_texture || same_layout(current.use, needed.use))) {
        if (contains(current, needed)) return {false, current};
        // A later write has to wait for all of these reads, so they are kept together.
        return {true, merge(current, needed)};
    }
    return {true, needed};
}

}  // namespace

void StateTracker::begin_submission() {
    submission_epoch_ = ++epoch_;
    touched_buffers_.clear();
    touched_textures_.clear();
    touched_structures_.clear();
    batches_.clear();
    barriers_.clear();
}

void StateTracker::rollback() {
    for (BufferObject* buffer : touched_buffers_) buffer->state = buffer->saved_state;
    for (TextureObject* texture : touched_textures_) {
        texture->state = texture->saved_state;
        texture->states = texture->saved_states;
    }
    for (AccelerationStructureObject* structure : touched_structures_) {
        structure->state = structure->saved_state;
        structure->content = structure->saved_content;
    }
    begin_submission();
}

void StateTracker::begin_scope() {
    ++epoch_;
    scope_buffers_.clear();
    scope_textures_.clear();
    scope_structures_.clear();
}

void StateTracker::save(BufferObject& buffer) {
    if (buffer.saved_epoch == submission_epoch_) return;
    buffer.saved_epoch = submission_epoch_;
    buffer.saved_state = buffer.state;
    touched_buffers_.push_back(&buffer);
}

void StateTracker::save(TextureObject& texture) {
    if (texture.saved_epoch == submission_epoch_) return;
    texture.saved_epoch = submission_epoch_;
    texture.saved_state = texture.state;
    texture.saved_states = texture.states;
    touched_textures_.push_back(&texture);
}

void StateTracker::save(AccelerationStructureObject& structure) {
    if (structure.saved_epoch == submission_epoch_) return;
    structure.saved_epoch = submission_epoch_;
    structure.saved_state = structure.state;
    structure.saved_content = structure.content;
    touched_structures_.push_back(&structure);
}

bool StateTracker::use(AccelerationStructureObject& structure, ResourceState state) {
    if (structure.scope_epoch != epoch_) {
        structure.scope_epoch = epoch_;
        structure.scope_state = state;
        scope_structures_.push_back(&structure);
        return true;
    }
    structure.scope_state = merge(structure.scope_state, state);
    // A build writes one structure and reads others; nothing else writes any.
    return !writes(structure.scope_state) || structure.scope_state.use == state.use;
}

bool StateTracker::use(BufferObject& buffer, ResourceState state) {
    if (buffer.scope_epoch != epoch_) {
        buffer.scope_epoch = epoch_;
        buffer.scope_state = state;
        scope_buffers_.push_back(&buffer);
        return true;
    }
    const bool agree = buffer_uses_agree(buffer.scope_state.use, state.use);
    buffer.scope_state = merge(buffer.scope_state, state);
    return agree;
}

bool StateTracker::use(TextureObject& texture, const SubresourceRange& range, ResourceState state, bool discard) {
    const TextureDesc& desc = texture.desc;
    const bool whole = is_whole(range, desc);
    if (texture.scope_epoch != epoch_) {
        texture.scope_epoch = epoch_;
        texture.scope_states.clear();
        texture.scope_discards.clear();
        texture.scope_state = {};
        texture.scope_discard = false;
        scope_textures_.push_back(&texture);
        if (whole) {
            texture.scope_state = state;
            texture.scope_discard = discard;
            return true;
        }
    } else if (whole && texture.scope_states.empty()) {
        const bool agree = texture_uses_agree(texture.scope_state.use, state.use);
        texture.scope_state = merge(texture.scope_state, state);
        texture.scope_discard = texture.scope_discard && discard;
        return agree;
    }
    // Parts differ: one state for each mip of each layer, layer by layer.
    if (texture.scope_states.empty()) {
        const std::size_t count = std::size_t{desc.mips} * layers_of(desc);
        texture.scope_states.assign(count, texture.scope_state);
        texture.scope_discards.assign(count, texture.scope_discard);
    }
    bool agree = true;
    for (std::uint32_t layer = range.base_layer; layer < range.base_layer + range.layer_count; ++layer)
        for (std::uint32_t mip = range.base_mip; mip < range.base_mip + range.mip_count; ++mip) {
            const std::size_t at = std::size_t{layer} * desc.mips + mip;
            ResourceState& part = texture.scope_states[at];
            if (part.use == ResourceUse::none) {
                part = state;
                texture.scope_discards[at] = discard;
            } else {
                agree &= texture_uses_agree(part.use, state.use);
                part = merge(part, state);
                texture.scope_discards[at] = texture.scope_discards[at] && discard;
            }
        }
    return agree;
}

void StateTracker::transition(BufferObject& buffer) {
    const Step next = step(buffer.state, buffer.scope_state, false);
    save(buffer);
    if (next.barrier) {
        Barrier barrier;
        barrier.buffer = buffer.backend.get();
        barrier.before = buffer.state;
        barrier.after = next.after;
        barriers_.push_back(barrier);
    }
    buffer.state = next.after;
}

void StateTracker::transition(AccelerationStructureObject& structure) {
    const Step next = step(structure.state, structure.scope_state, false);
    save(structure);
    if (next.barrier) {
        Barrier barrier;
        barrier.acceleration_structure = structure.backend.get();
        barrier.before = structure.state;
        barrier.after = next.after;
        barriers_.push_back(barrier);
    }
    structure.state = next.after;
}

void StateTracker::transition(TextureObject& texture) {
    const TextureDesc& desc = texture.desc;
    const std::uint32_t layers = layers_of(desc);
    save(texture);
    if (texture.states.empty() && texture.scope_states.empty()) {
        const Step next = step(texture.state, texture.scope_state, true);
        if (next.barrier) {
            Barrier barrier;
            barrier.texture = texture.backend.get();
            barrier.mip_count = desc.mips;
            barrier.layer_count = layers;
            barrier.before = texture.state;
            barrier.after = next.after;
            barrier.discard = texture.scope_discard || texture.state.use == ResourceUse::none;
            barriers_.push_back(barrier);
        }
        texture.state = next.after;
        return;
    }

    const std::size_t count = std::size_t{desc.mips} * layers;
    if (texture.states.empty()) texture.states.assign(count, texture.state);
    const auto scope_at = [&](std::size_t i) {
        return texture.scope_states.empty() ? texture.scope_state : texture.scope_states[i];
    };
    const auto discard_at = [&](std::size_t i) {
        return texture.scope_discards.empty() ? texture.scope_discard : static_cast<bool>(texture.scope_discards[i]);
    };
    // One barrier for each rectangle (mips x layers) of parts that make the same step.
    struct Wanted {
        bool barrier = false, discard = false;
        ResourceState before, after;
        bool operator==(const Wanted&) const = default;
    };
    std::vector<Wanted> wanted(count);
    for (std::size_t i = 0; i < count; ++i) {
        const ResourceState needed = scope_at(i);
        if (needed.use == ResourceUse::none) continue;
        const ResourceState before = texture.states[i];
        const Step next = step(before, needed, true);
        texture.states[i] = next.after;
        if (next.barrier) wanted[i] = {true, discard_at(i) || before.use == ResourceUse::none, before, next.after};
    }
    const auto index = [&](std::uint32_t layer, std::uint32_t mip) { return std::size_t{layer} * desc.mips + mip; };
    for (std::uint32_t layer = 0; layer < layers; ++layer)
        for (std::uint32_t mip = 0; mip < desc.mips; ++mip) {
            const Wanted first = wanted[index(layer, mip)];
            if (!first.barrier) continue;
            std::uint32_t mip_end = mip + 1;
            while (mip_end < desc.mips && wanted[index(layer, mip_end)] == first) ++mip_end;
            std::uint32_t layer_end = layer + 1;
            const auto row_matches = [&](std::uint32_t row) {
                for (std::uint32_t m = mip; m < mip_end; ++m)
                    if (!(wanted[index(row, m)] == first)) return false;
                return true;
            };
            while (layer_end < layers && row_matches(layer_end)) ++layer_end;
            for (std::uint32_t l = layer; l < layer_end; ++l)
                for (std::uint32_t m = mip; m < mip_end; ++m) wanted[index(l, m)] = {};
            Barrier barrier;
            barrier.texture = texture.backend.get();
            barrier.base_mip = mip;
            barrier.mip_count = mip_end - mip;
            barrier.base_layer = layer;
            barrier.layer_count = layer_end - layer;
            barrier.before = first.before;
            barrier.after = first.after;
            barrier.discard = first.discard;
            barriers_.push_back(barrier);
        }
    // Back to one state as soon as all parts agree, so that the next submission takes the short way.
    if (std::all_of(texture.states.begin(), texture.states.end(),
                    [&](const ResourceState& state) { return state == texture.states.front(); })) {
        texture.state = texture.states.front();
        texture.states.clear();
    }
}

void StateTracker::end_scope(const CommandHeader* before) {
    const std::size_t first = barriers_.size();
    for (BufferObject* buffer : scope_buffers_) transition(*buffer);
    for (TextureObject* texture : scope_textures_) transition(*texture);
    for (AccelerationStructureObject* structure : scope_structures_) transition(*structure);
    if (barriers_.size() == first) return;
    batches_.push_back(
        {before, static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(barriers_.size() - first)});
}

void StateTracker::add_barrier(const CommandHeader* before, BackendBuffer& buffer, ResourceState from,
                               ResourceState to) {
    Barrier barrier;
    barrier.buffer = &buffer;
    barrier.before = from;
    barrier.after = to;
    batches_.push_back({before, static_cast<std::uint32_t>(barriers_.size()), 1});
    barriers_.push_back(barrier);
}

std::string text_of(ResourceUse use) {
    static constexpr std::array<std::string_view, 18> names{
        "vertex_buffer", "index_buffer",     "indirect_argument", "uniform_buffer",      "sampled",
        "storage_read",  "storage_write",    "color_target",      "depth_stencil_write", "depth_stencil_read",
        "copy_source",   "copy_destination", "resolve_source",    "resolve_destination", "host_read",
        "build_input",   "acceleration_structure_read", "acceleration_structure_write"};
    std::string text;
    for (std::size_t i = 0; i < names.size(); ++i)
        if (static_cast<std::uint32_t>(use) >> i & 1) text += (text.empty() ? "" : " | ") + std::string(names[i]);
    return text.empty() ? "none" : text;
}

std::string text_of(ShaderStage stages) {
    std::string text;
    if (has_any(stages, ShaderStage::vertex)) text = "vertex";
    if (has_any(stages, ShaderStage::fragment)) text += text.empty() ? "fragment" : " | fragment";
    if (has_any(stages, ShaderStage::compute)) text += text.empty() ? "compute" : " | compute";
    return text.empty() ? "none" : text;
}

std::string text_of(ResourceState state) {
    return state.stages == ShaderStage::none ? text_of(state.use)
                                             : text_of(state.use) + " (" + text_of(state.stages) + ")";
}

}  // namespace nacre::rhi
