// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/bind_group.h"

#include <fmt/format.h>

#include <algorithm>
#include <new>

#include "backends/cpu/acceleration_structure.h"
#include "backends/cpu/buffer.h"
#include "backends/cpu/sampler.h"
#include "backends/cpu/texture.h"
#include "rhi/binding_type.h"

namespace nacre::cpu {

CpuBindGroupLayout::CpuBindGroupLayout(const rhi::BindGroupLayoutDesc& layout_desc, std::uint32_t unbounded_capacity) {
    desc = layout_desc;
    std::ranges::sort(desc.bindings, {}, &rhi::BindingLayout::binding);
    std::uint32_t next = 0;
    for (const rhi::BindingLayout& binding : desc.bindings) {
        if (binding.count == 0) continue;
        slots_.push_back({.binding = binding.binding, .first = next, .count = binding.count});
        next += binding.count;
    }
    fixed_count_ = next;
    for (const rhi::BindingLayout& binding : desc.bindings) {
        if (binding.count != 0) continue;
        slots_.push_back({.binding = binding.binding, .first = next, .count = 0});
        fixed_count_ = next;
        // Only the last one can grow: those before it have all the room that they might need.
        next += unbounded_capacity;
    }
    std::ranges::sort(slots_, {}, &BindingSlots::binding);
}

const BindingSlots* CpuBindGroupLayout::find(std::uint32_t binding) const {
    const auto at = std::ranges::lower_bound(slots_, binding, {}, &BindingSlots::binding);
    return at != slots_.end() && at->binding == binding ? &*at : nullptr;
}

std::vector<BindingSlots> slots_of(std::span<rhi::BackendBindGroupLayout* const> layouts) {
    std::vector<BindingSlots> all;
    for (std::size_t set = 0; set < layouts.size(); ++set) {
        if (!layouts[set]) continue;
        for (BindingSlots slots : static_cast<const CpuBindGroupLayout*>(layouts[set])->slots()) {
            slots.set = static_cast<std::uint32_t>(set);
            all.push_back(slots);
        }
    }
    return all;
}

Expected<std::unique_ptr<rhi::BackendBindGroup>> CpuBindGroup::create(rhi::BackendBindGroupLayout& layout,
                                                                      std::span<const rhi::BackendBinding> bindings,
                                                                      const std::string& name) {
    const auto& own = static_cast<const CpuBindGroupLayout&>(layout);
    std::uint64_t count = own.fixed_count();
    for (const rhi::BackendBinding& binding : bindings)
        if (const BindingSlots* slots = own.find(binding.binding))
            count = std::max(count, std::uint64_t{slots->first} + binding.element + 1);
    auto group = std::make_unique<CpuBindGroup>();
    group->layout = &layout;
    try {
        group->descriptors.resize(count);
        for (const rhi::BackendBinding& binding : bindings) {
            const BindingSlots* slots = own.find(binding.binding);
            if (!slots || (slots->count != 0 && binding.element >= slots->count)) continue;
            Descriptor& descriptor = group->descriptors[slots->first + binding.element];
            const auto note = [&](const std::unique_ptr<CheckedMemory>& checked) {
                if (!checked) return;
                group->checked.resize(count);
                group->checked[slots->first + binding.element] = checked.get();
            };
            const auto* buffer = static_cast<const CpuBuffer*>(binding.buffer);
            if (buffer && rhi::is_texel_buffer(binding.type)) {
                group->texel_views.push_back(std::make_unique<const ImageView>(texel_view(*buffer, binding)));
                descriptor.image = group->texel_views.back().get();
                note(buffer->checked);
            } else if (buffer) {
                descriptor.data = buffer->data() + binding.offset;
                descriptor.size = std::min(binding.size, buffer->size_from(binding.offset));
                if (buffer->shadow()) descriptor.shadow = buffer->shadow() + 2 * binding.offset;
                note(buffer->checked);
            }
            const bool has_texture =
                binding.type != rhi::BindingType::sampler && !binding.buffer && !binding.acceleration_structure &&
                                     binding.view.texture.object;
            if (has_texture) {
                descriptor.image = texture_of(binding.view.texture).view(binding.view);
                note(texture_of(binding.view.texture).checked);
            }
            if (const auto* structure = static_cast<const CpuAccelerationStructure*>(binding.acceleration_structure))
                descriptor.data = reinterpret_cast<std::byte*>(structure->scene());
            if (binding.sampler) descriptor.sampler = &static_cast<const CpuSampler*>(binding.sampler)->state;
        }
    } catch (const std::bad_alloc&) {
        return fail(ErrorCode::out_of_memory, "create bind group", fmt::format("'{}'", name),
                    fmt::format("no memory for {} descriptors", count), "Free other resources.");
    }
    return group;
}

}  // namespace nacre::cpu
