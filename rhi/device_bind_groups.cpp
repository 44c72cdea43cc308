// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "rhi/binding_type.h"
#include "rhi/device_access.h"
#include "rhi/object_checks.h"

namespace nacre::rhi {
namespace {

ResourceUse use_of(BindingType type) {
    switch (type) {
        case BindingType::uniform_buffer: return ResourceUse::uniform_buffer;
        case BindingType::storage_buffer:
        case BindingType::storage_texel_buffer:
        case BindingType::storage_image: return ResourceUse::storage_read | ResourceUse::storage_write;
        case BindingType::readonly_storage_buffer:
        case BindingType::readonly_storage_texel_buffer:
        case BindingType::readonly_storage_image: return ResourceUse::storage_read;
        case BindingType::writeonly_storage_texel_buffer:
        case BindingType::writeonly_storage_image: return ResourceUse::storage_write;
        case BindingType::uniform_texel_buffer:
        case BindingType::sampled_texture:
        case BindingType::combined_texture_sampler: return ResourceUse::sampled;
        case BindingType::acceleration_structure: return ResourceUse::acceleration_structure_read;
        case BindingType::sampler: break;
    }
    return ResourceUse::none;
}

/// Resolves the entries of one bind group.
class GroupBuilder {
  public:
    GroupBuilder(DeviceState& device, const BindGroupDesc& desc, const BindGroupLayoutObject& layout)
        : device_(device), tables_(device.tables()), desc_(desc), layout_(layout) {}

    Check add(const BindGroupEntry& entry);
    /// After all entries: sorts, and finds what is missing or given twice.
    Check finish();

    std::vector<BackendBinding> bindings;
    BindGroupObject object;

  private:
    Problem problem(Rule rule, std::uint32_t binding, std::string reason, std::string remedy) const {
        return {rule,
                ErrorCode::validation,
                "create bind group",
                fmt::format("'{}' of layout '{}', binding {}", desc_.name, layout_.desc.name, binding),
                std::move(reason),
                std::move(remedy)};
    }
    Check add_buffer(const BindGroupEntry& entry, const BindingLayout& binding, BackendBinding& resolved);
    /// The range of a texel buffer, of which `size` bytes are left or asked for; `size` becomes a whole number of
    /// elements.
    Check check_texels(const BindGroupEntry& entry, BindingType type, const BufferDesc& buffer, std::uint64_t& size);
    Check add_texture(const BindGroupEntry& entry, const BindingLayout& binding, BackendBinding& resolved,
                      const SamplerDesc* sampler);

    DeviceState& device_;
    ObjectTables& tables_;
    const BindGroupDesc& desc_;
    const BindGroupLayoutObject& layout_;
};

Check GroupBuilder::add(const BindGroupEntry& entry) {
    const auto& all = layout_.desc.bindings;
    const auto at =
        std::lower_bound(all.begin(), all.end(), entry.binding,
                         [](const BindingLayout& layout, std::uint32_t number) { return layout.binding < number; });
    if (at == all.end() || at->binding != entry.binding)
        return problem(Rule::group_unknown_binding, entry.binding,
                       "expected a binding of the layout, found one that it lacks",
                       "Remove the entry, or use the layout of the pipeline that needs it.");
    const BindingLayout& binding = *at;
    const std::uint32_t count = binding.count == 0 ? device_.capabilities().max_bindless_textures : binding.count;
    if (entry.element >= count)
        return problem(Rule::group_element, entry.binding,
                       fmt::format("expected an element below {}, found {}", count, entry.element),
                       "Correct BindGroupEntry::element.");
    const bool wrong = (static_cast<bool>(entry.buffer) != has_buffer(binding.type)) ||
                       (static_cast<bool>(entry.texture.texture) != has_texture(binding.type)) ||
                       (static_cast<bool>(entry.sampler) != has_sampler(binding.type)) ||
                       (static_cast<bool>(entry.acceleration_structure) !=
                        (binding.type == BindingType::acceleration_structure));
    if (wrong) {
        std::string found;
        if (entry.buffer) found += " buffer";
        if (entry.texture.texture) found += " texture";
        if (entry.sampler) found += " sampler";
        if (entry.acceleration_structure) found += " acceleration structure";
        return problem(
            Rule::group_wrong_resource, entry.binding,
            fmt::format("expected what a {} needs, found{}", name_of(binding.type), found.empty() ? " nothing" : found),
            "Set buffer, texture, sampler or acceleration structure of the entry as the binding's type needs them.");
    }
    BackendBinding resolved;
    resolved.binding = entry.binding;
    resolved.element = entry.element;
    resolved.type = binding.type;
    if (entry.buffer)
        if (Check failed = add_buffer(entry, binding, resolved)) return failed;
    const SamplerDesc* sampler_desc = nullptr;
    if (entry.sampler) {
        auto* slot = tables_.samplers.find_slot(entry.sampler);
        if (!slot) return handle_problem(tables_.samplers, entry.sampler, "create bind group", "sampler");
        resolved.sampler = slot->object.backend.get();
        sampler_desc = &slot->object.desc;
        object.samplers.push_back({slot, slot->generation, entry.binding});
    }
    if (entry.texture.texture)
        if (Check failed = add_texture(entry, binding, resolved, sampler_desc)) return failed;
    if (entry.acceleration_structure) {
        auto* slot = tables_.acceleration_structures.find_slot(entry.acceleration_structure);
        if (!slot)
            return handle_problem(tables_.acceleration_structures, entry.acceleration_structure, "create bind group",
                                  "acceleration structure");
        if (slot->object.desc.level != AccelerationStructureLevel::top)
            return problem(Rule::group_acceleration_structure_level, entry.binding,
                           fmt::format("expected a top level, found the bottom level '{}'", slot->object.desc.name),
                           "Build a top level with an instance of it, and bind that.");
        resolved.acceleration_structure = slot->object.backend.get();
        object.acceleration_structures.push_back(
            {slot, slot->generation, entry.binding, {use_of(binding.type), binding.stages}});
    }
    bindings.push_back(resolved);
    return {};
}

Check GroupBuilder::add_buffer(const BindGroupEntry& entry, const BindingLayout& binding, BackendBinding& resolved) {
    auto* slot = tables_.buffers.find_slot(entry.buffer);
    if (!slot) return handle_problem(tables_.buffers, entry.buffer, "create bind group", "buffer");
    const BufferDesc& buffer = slot->object.desc;
    const Capabilities& capabilities = device_.capabilities();
    const bool uniform = binding.type == BindingType::uniform_buffer, texels = is_texel_buffer(binding.type);
    const BufferUsage needed = uniform                                               ? BufferUsage::uniform
                               : binding.type == BindingType::uniform_texel_buffer ? BufferUsage::uniform_texel
                               : texels                                              ? BufferUsage::storage_texel
                                                                                     : BufferUsage::storage;
    if (!has_all(buffer.usage, needed))
        return problem(Rule::group_buffer_usage, entry.binding,
                       fmt::format("expected buffer '{}' to have usage {}, found {}", buffer.name, text_of(needed),
                                   text_of(buffer.usage)),
                       "Add the usage where the buffer is created.");
    const std::uint32_t alignment = uniform  ? capabilities.uniform_offset_alignment
                                    : texels ? capabilities.texel_buffer_offset_alignment
                                             : capabilities.storage_offset_alignment;
    if (alignment != 0 && entry.offset % alignment != 0)
        return problem(
            Rule::group_alignment, entry.binding,
            fmt::format("expected an offset into buffer '{}' that is a multiple of {} ({}), found {}", buffer.name,
                        alignment,
                        uniform  ? "uniform_offset_alignment"
                        : texels ? "texel_buffer_offset_alignment"
                                 : "storage_offset_alignment",
                        entry.offset),
            "Align the offset.");
    if (entry.offset >= buffer.size)
        return problem(Rule::group_range, entry.binding,
                       fmt::format("expected an offset below the {} bytes of buffer '{}', found {}", buffer.size,
                                   buffer.name, entry.offset),
                       "Correct the offset.");
    const std::uint64_t left = buffer.size - entry.offset;
    std::uint64_t size = entry.size == ~0ull ? left : entry.size;
    if (size == 0 || size > left)
        return problem(Rule::group_range, entry.binding,
                       fmt::format("expected 1 to {} bytes of buffer '{}' from offset {}, found {}", left, buffer.name,
                                   entry.offset, size),
                       "Correct offset and size.");
    if (texels) {
        if (Check failed = check_texels(entry, binding.type, buffer, size)) return failed;
        resolved.format = entry.format;
    }
    const std::uint64_t limit = uniform ? capabilities.max_uniform_buffer_range : capabilities.max_storage_buffer_range;
    if (!texels && size > limit)
        return problem(
            Rule::group_range_limit, entry.binding,
            fmt::format("expected at most {} bytes ({}), found {} of buffer '{}'", limit,
                        uniform ? "max_uniform_buffer_range" : "max_storage_buffer_range", size, buffer.name),
            "Bind a smaller range.");
    resolved.buffer = slot->object.backend.get();
    resolved.offset = entry.offset;
    resolved.size = size;
    object.buffers.push_back({slot,
                              slot->generation,
                              entry.binding,
                              {use_of(binding.type), binding.stages},
                              entry.offset,
                              size,
                              resolved.format});
    return {};
}

Check GroupBuilder::check_texels(const BindGroupEntry& entry, BindingType type, const BufferDesc& buffer,
                                 std::uint64_t& size) {
    const Capabilities& capabilities = device_.capabilities();
    const FormatInfo& format = info(entry.format);
    const FormatSupport needed = type == BindingType::uniform_texel_buffer ? FormatSupport::uniform_texel_buffer
                                                                           : FormatSupport::storage_texel_buffer;
    if (entry.format == Format::undefined || !capabilities.supports(entry.format, needed))
        return problem(Rule::group_texel_format, entry.binding,
                       fmt::format("expected a format that the device supports as {} for buffer '{}', found {}",
                                   type == BindingType::uniform_texel_buffer ? "uniform_texel_buffer"
                                                                             : "storage_texel_buffer",
                                   buffer.name, entry.format == Format::undefined ? "none" : format.name),
                       "Set BindGroupEntry::format to one for which Capabilities::supports says so.");
    const std::uint64_t elements = size / format.block_bytes;
    if (elements == 0 || (entry.size != ~0ull && size % format.block_bytes != 0))
        return problem(
            Rule::group_texel_range, entry.binding,
            fmt::format("expected a whole number of elements of {} bytes ({}) of buffer '{}', found {} bytes",
                        format.block_bytes, format.name, buffer.name, size),
            "Make BindGroupEntry::size a multiple of the bytes of an element.");
    if (elements > capabilities.max_texel_buffer_elements)
        return problem(Rule::group_range_limit, entry.binding,
                       fmt::format("expected at most {} elements (max_texel_buffer_elements), found {} of buffer '{}'",
                                   capabilities.max_texel_buffer_elements, elements, buffer.name),
                       "Bind a smaller range.");
    size = elements * format.block_bytes;
    return {};
}

Check GroupBuilder::add_texture(const BindGroupEntry& entry, const BindingLayout& binding, BackendBinding& resolved,
                                const SamplerDesc* sampler) {
    auto* slot = tables_.textures.find_slot(entry.texture.texture);
    if (!slot) return handle_problem(tables_.textures, entry.texture.texture, "create bind group", "texture");
    const TextureDesc& texture = slot->object.desc;
    const Capabilities& capabilities = device_.capabilities();
    const bool image = is_storage_image(binding.type);
    const TextureUsage needed = image ? TextureUsage::storage : TextureUsage::sampled;
    if (!has_all(texture.usage, needed))
        return problem(Rule::group_texture_usage, entry.binding,
                       fmt::format("expected texture '{}' to have usage {}, found {}", texture.name, text_of(needed),
                                   text_of(texture.usage)),
                       "Add the usage where the texture is created.");
    TextureView wanted = entry.texture;
    // A storage image is one mip; the whole of a texture stands for its first.
    if (image && wanted.mip_count == all_remaining) wanted.mip_count = 1;
    ViewReference view = complete_view(wanted, texture);
    if (Check failed = check_view(view, texture, capabilities, "create bind group",
                                  fmt::format("'{}', binding {}", desc_.name, entry.binding)))
        return failed;
    const ViewReference own = complete_view(TextureView(entry.texture.texture), texture);
    if (!image && !capabilities.texture_views &&
        (view.dimension != own.dimension || view.layer_count != own.layer_count))
        return problem(
            Rule::view_dimension, entry.binding,
            fmt::format("expected all {} layers of texture '{}' as {} on a device without texture_views, found {} "
                        "layers as {}",
                        own.layer_count, texture.name, name_of(own.dimension), view.layer_count,
                        name_of(view.dimension)),
            "Sample the whole texture, and choose the layer in the shader.");
    if (image && (view.mip_count != 1 || texture.samples != 1))
        return problem(Rule::group_storage_view, entry.binding,
                       fmt::format("expected one mip of a texture of 1 sample, found {} mips of '{}' with {} samples",
                                   view.mip_count, texture.name, texture.samples),
                       "Use TextureView::subresource.");
    if (sampler && texture.samples == 1 && !capabilities.supports(view.format, FormatSupport::filtered) &&
        (sampler->magnify == Filter::linear || sampler->minify == Filter::linear ||
         (sampler->mip == Filter::linear && view.mip_count > 1)))
        return problem(
            Rule::group_unfilterable, entry.binding,
            fmt::format("expected nearest filters for format {} of texture '{}', found linear in sampler '{}'",
                        info(view.format).name, texture.name, sampler->name),
            "Set magnify, minify and mip to Filter::nearest.");
    view.texture.object = slot->object.backend.get();
    resolved.view = view;
    object.textures.push_back({slot,
                               slot->generation,
                               entry.binding,
                               {use_of(binding.type), binding.stages},
                               {view.base_mip, view.mip_count, view.base_layer, view.layer_count},
                               view.dimension,
                               view.format});
    return {};
}

Check GroupBuilder::finish() {
    std::sort(bindings.begin(), bindings.end(), [](const BackendBinding& a, const BackendBinding& b) {
        return a.binding != b.binding ? a.binding < b.binding : a.element < b.element;
    });
    for (std::size_t i = 1; i < bindings.size(); ++i)
        if (bindings[i].binding == bindings[i - 1].binding && bindings[i].element == bindings[i - 1].element)
            return problem(Rule::group_duplicate_entry, bindings[i].binding,
                           fmt::format("expected one entry for element {}, found two", bindings[i].element),
                           "Remove one of them.");
    std::size_t at = 0;
    for (const BindingLayout& binding : layout_.desc.bindings) {
        std::uint32_t found = 0;
        for (; at < bindings.size() && bindings[at].binding == binding.binding; ++at) ++found;
        if (found < binding.count)
            return problem(Rule::group_missing_entry, binding.binding,
                           fmt::format("expected {} entr{} of type {}, found {}", binding.count,
                                       binding.count == 1 ? "y" : "ies", name_of(binding.type), found),
                           "Add an entry for each binding and each element of an array.");
    }
    return {};
}

}  // namespace

Expected<BindGroup> Device::create_bind_group(const BindGroupDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create bind group", "'" + desc.name + "'");
    const std::lock_guard lock(device.mutex);
    device.collect();
    ObjectTables& tables = device.tables();
    BindGroupLayoutObject* layout = tables.layouts.find(desc.layout);
    if (!layout)
        return device.reject(
            handle_problem(tables.layouts, desc.layout, "create bind group '" + desc.name + "'", "bind group layout"));
    GroupBuilder builder(device, desc, *layout);
    builder.bindings.reserve(desc.entries.size());
    for (const BindGroupEntry& entry : desc.entries)
        if (Check failed = builder.add(entry)) return device.reject(std::move(*failed));
    if (Check failed = builder.finish()) return device.reject(std::move(*failed));
    auto made = device.backend->create_bind_group(*layout->backend, builder.bindings, desc.name);
    if (!made) {
        device.note_failure(made.error());
        return std::unexpected(std::move(made).error());
    }
    BindGroupObject object = std::move(builder.object);
    object.backend = std::move(*made);
    object.backend->layout = layout->backend.get();
    object.layout = desc.layout;
    object.name = desc.name;
    object.checked_epoch = device.destructions;
    const std::unique_lock tables_lock(device.shared->tables_mutex);
    const BindGroup handle = tables.groups.insert(std::move(object));
    if (!handle)
        return fail(ErrorCode::out_of_memory, "create bind group", "'" + desc.name + "'",
                    "16 million bind groups exist", "Destroy bind groups that are no longer used.");
    return handle;
}

}  // namespace nacre::rhi
