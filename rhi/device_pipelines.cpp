// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "rhi/device_access.h"
#include "rhi/pipeline_checks.h"

namespace nacre::rhi {
namespace {

/// Layouts for every bind-group index up to the highest that is used or given.
Expected<std::vector<BindGroupLayout>> pipeline_layouts(DeviceState& device, const MergedInterface& merged,
                                                        std::span<const BindGroupLayout> given,
                                                        const std::string& name) {
    ObjectTables& tables = device.tables();
    std::uint32_t count = static_cast<std::uint32_t>(given.size());
    for (const MergedBinding& binding : merged.bindings) count = std::max(count, binding.declared.set + 1);
    if (count > device.capabilities().max_bind_groups || count > most_bind_groups)
        return device.reject({Rule::pipeline_group_limit, ErrorCode::unsupported, "create pipeline", "'" + name + "'",
                              fmt::format("expected at most {} bind groups (max_bind_groups), found {}",
                                          device.capabilities().max_bind_groups, count),
                              "Use fewer bind groups."});
    std::vector<BindGroupLayout> layouts;
    std::vector<const BindGroupLayoutDesc*> descs;
    for (std::uint32_t set = 0; set < count; ++set) {
        if (set < given.size() && given[set]) {
            const BindGroupLayoutObject* layout = tables.layouts.find(given[set]);
            if (!layout)
                return device.reject(
                    handle_problem(tables.layouts, given[set], "create pipeline '" + name + "'", "bind group layout"));
            if (Check failed = check_explicit_layout(layout->desc, set, merged, name))
                return device.reject(std::move(*failed));
            layouts.push_back(given[set]);
        } else {
            BindGroupLayoutDesc desc;
            desc.name = fmt::format("{}, set {}", name, set);
            for (const MergedBinding& binding : merged.bindings)
                if (binding.declared.set == set)
                    desc.bindings.push_back(
                        {binding.declared.binding, binding.declared.type, binding.declared.count, binding.stages});
            if (Check failed = check_layout(desc, device.capabilities())) return device.reject(std::move(*failed));
            NACRE_TRY(const BindGroupLayout layout, device.layout_of(std::move(desc)));
            layouts.push_back(layout);
        }
        descs.push_back(&tables.layouts.find(layouts.back())->desc);
    }
    if (Check failed = check_stage_limits(descs, device.capabilities(), "create pipeline", "'" + name + "'"))
        return device.reject(std::move(*failed));
    return layouts;
}

std::uint32_t mask_of(DeviceState& device, std::span<const BindGroupLayout> layouts, const MergedInterface& merged) {
    std::uint32_t mask = 0;
    for (const MergedBinding& binding : merged.bindings) mask |= 1u << binding.declared.set;
    // An explicit layout that the shaders do not use need not be bound.
    for (std::size_t set = 0; set < layouts.size(); ++set)
        if (device.tables().layouts.find(layouts[set])->desc.bindings.empty()) mask &= ~(1u << set);
    return mask;
}

std::vector<BackendBindGroupLayout*> backend_layouts(DeviceState& device, std::span<const BindGroupLayout> layouts) {
    std::vector<BackendBindGroupLayout*> result;
    for (const BindGroupLayout layout : layouts) result.push_back(device.tables().layouts.find(layout)->backend.get());
    return result;
}

PipelineCommon common_of(DeviceState& device, std::string name, std::vector<BindGroupLayout> layouts,
                         const MergedInterface& merged) {
    PipelineCommon common;
    common.name = std::move(name);
    common.group_mask = mask_of(device, layouts, merged);
    common.layouts = std::move(layouts);
    common.push_constant_bytes = merged.push_constant_bytes;
    for (const MergedBinding& binding : merged.bindings) common.bindings.push_back(binding.declared);
    return common;
}

template <typename HandleType>
Expected<BindGroupLayout> layout_at(const DeviceState& device, HandleType pipeline, std::uint32_t index) {
    const std::shared_lock lock(device.shared->tables_mutex);
    auto& table = device.shared->tables.table(pipeline);
    const auto* found = table.find(pipeline);
    if (!found)
        return device.shared->messages.reject(handle_problem(table, pipeline, "get bind group layout", "pipeline"));
    if (index >= found->common.layouts.size())
        return device.shared->messages.reject(
            {Rule::bind_group_index, ErrorCode::invalid_argument, "get bind group layout",
             "'" + found->common.name + "'",
             fmt::format("expected an index below {}, found {}", found->common.layouts.size(), index),
             "Ask for an index that the pipeline's shaders use."});
    return found->common.layouts[index];
}

}  // namespace

Expected<GraphicsPipeline> Device::create_graphics_pipeline(const GraphicsPipelineDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create graphics pipeline", "'" + desc.name + "'");
    const std::lock_guard lock(device.mutex);
    ObjectTables& tables = device.tables();
    const std::string attempted = "create graphics pipeline '" + desc.name + "'";
    const ShaderObject* vertex = tables.shaders.find(desc.vertex);
    if (!vertex) return device.reject(handle_problem(tables.shaders, desc.vertex, attempted, "vertex shader"));
    const ShaderObject* fragment = nullptr;
    if (desc.fragment) {
        fragment = tables.shaders.find(desc.fragment);
        if (!fragment)
            return device.reject(handle_problem(tables.shaders, desc.fragment, attempted, "fragment shader"));
    }
    if (Check failed =
            check_graphics(desc, *vertex->backend, fragment ? fragment->backend.get() : nullptr, device.capabilities()))
        return device.reject(std::move(*failed));
    std::vector<std::shared_ptr<BackendShader>> kept{vertex->backend};
    if (fragment) kept.push_back(fragment->backend);
    std::vector<const BackendShader*> shaders;
    for (const auto& shader : kept) shaders.push_back(shader.get());
    MergedInterface merged;
    if (Check failed = merge_stages(shaders, desc.name, merged)) return device.reject(std::move(*failed));
    if (Check failed = check_specialization(desc.specialization, shaders, desc.name))
        return device.reject(std::move(*failed));
    NACRE_TRY(std::vector<BindGroupLayout> layouts,
              pipeline_layouts(device, merged, desc.bind_group_layouts, desc.name));

    const std::vector<BackendBindGroupLayout*> backend_list = backend_layouts(device, layouts);
    BackendGraphicsPipelineDesc wanted;
    wanted.desc = &desc;
    wanted.vertex = vertex->backend.get();
    wanted.fragment = fragment ? fragment->backend.get() : nullptr;
    wanted.layouts = backend_list;
    wanted.push_constant_bytes = merged.push_constant_bytes;
    wanted.push_constant_stages = merged.push_constant_stages;
    auto made = device.backend->create_graphics_pipeline(wanted);
    if (!made) {
        device.note_failure(made.error());
        return std::unexpected(std::move(made).error());
    }
    GraphicsPipelineObject object;
    object.backend = std::move(*made);
    object.common = common_of(device, desc.name, std::move(layouts), merged);
    object.common.shaders = std::move(kept);
    object.desc = desc;
    for (const VertexAttribute& attribute : desc.vertex_attributes) object.vertex_buffer_mask |= 1u << attribute.buffer;
    const DepthStencilState& depth = desc.depth_stencil;
    const auto writes_stencil = [](const StencilFace& face) {
        return face.write_mask != 0 &&
               (face.fail != StencilOperation::keep || face.depth_fail != StencilOperation::keep ||
                face.pass != StencilOperation::keep);
    };
    object.writes_depth = (depth.depth_test && depth.depth_write) ||
                          (depth.stencil_test && (writes_stencil(depth.front) || writes_stencil(depth.back)));
    const std::unique_lock tables_lock(device.shared->tables_mutex);
    return tables.graphics_pipelines.insert(std::move(object));
}

Expected<ComputePipeline> Device::create_compute_pipeline(const ComputePipelineDesc& desc) {
    DeviceState& device = *state_;
    if (device.lost) return device.lost_error("create compute pipeline", "'" + desc.name + "'");
    const std::lock_guard lock(device.mutex);
    ObjectTables& tables = device.tables();
    const ShaderObject* shader = tables.shaders.find(desc.shader);
    if (!shader)
        return device.reject(handle_problem(tables.shaders, desc.shader, "create compute pipeline '" + desc.name + "'",
                                            "compute shader"));
    if (Check failed = check_compute(desc, *shader->backend, device.capabilities()))
        return device.reject(std::move(*failed));
    const std::shared_ptr<BackendShader> kept = shader->backend;
    const BackendShader* one = kept.get();
    MergedInterface merged;
    if (Check failed = merge_stages(std::span(&one, 1), desc.name, merged)) return device.reject(std::move(*failed));
    if (Check failed = check_specialization(desc.specialization, std::span(&one, 1), desc.name))
        return device.reject(std::move(*failed));
    NACRE_TRY(std::vector<BindGroupLayout> layouts,
              pipeline_layouts(device, merged, desc.bind_group_layouts, desc.name));

    const std::vector<BackendBindGroupLayout*> backend_list = backend_layouts(device, layouts);
    BackendComputePipelineDesc wanted;
    wanted.desc = &desc;
    wanted.shader = kept.get();
    wanted.layouts = backend_list;
    wanted.push_constant_bytes = merged.push_constant_bytes;
    auto made = device.backend->create_compute_pipeline(wanted);
    if (!made) {
        device.note_failure(made.error());
        return std::unexpected(std::move(made).error());
    }
    ComputePipelineObject object;
    object.backend = std::move(*made);
    object.common = common_of(device, desc.name, std::move(layouts), merged);
    object.common.shaders = {kept};
    const std::unique_lock tables_lock(device.shared->tables_mutex);
    return tables.compute_pipelines.insert(std::move(object));
}

Expected<BindGroupLayout> Device::bind_group_layout(GraphicsPipeline pipeline, std::uint32_t index) const {
    return layout_at(*state_, pipeline, index);
}

Expected<BindGroupLayout> Device::bind_group_layout(ComputePipeline pipeline, std::uint32_t index) const {
    return layout_at(*state_, pipeline, index);
}

}  // namespace nacre::rhi
