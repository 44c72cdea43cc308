// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

#include <string>
#include <utility>

namespace nacre::passes {

using rhi::ResourceUse;

std::vector<FrameUse> lighting_uses(const FrameResources& resources) {
    return {{.buffer = resources.camera, .use = ResourceUse::uniform_buffer},
            {.buffer = resources.lights, .use = ResourceUse::uniform_buffer},
            {.buffer = resources.irradiance, .use = ResourceUse::uniform_buffer},
            {.texture = resources.interface_table, .use = ResourceUse::sampled},
            {.texture = resources.environment, .use = ResourceUse::sampled},
            {.texture = resources.shadow_maps, .use = ResourceUse::sampled}};
}

void uses_lighting(PassDeclaration& pass, const FrameResources& resources) {
    for (const FrameUse& use : lighting_uses(resources)) pass.uses(use.buffer, use.use).uses(use.texture, use.use);
}

std::vector<rhi::ShaderDefine> lighting_defines(const Decisions& decisions) {
    std::vector<rhi::ShaderDefine> defines = {
        {"ENVIRONMENT_MIPS", std::to_string(decisions.environment_mips)},
        {"NACRE_DIFFUSE_MODEL", std::to_string(std::to_underlying(decisions.diffuse_model))}};
    if (decisions.light_capacity > 0) defines.push_back({"LIGHTS", std::to_string(decisions.light_capacity)});
    if (decisions.shadow_capacity > 0) {
        defines.push_back({"SHADOW_VIEWS", std::to_string(decisions.shadow_capacity)});
        if (decisions.shadow_view_count > 1) defines.push_back({"SHADOW_LAYERS"});
        defines.push_back({"SHADOW_FILTER_WIDTH", std::to_string(decisions.shadow_filter_width)});
    }
    return defines;
}

rhi::ShaderDefine lit_format_define(const Decisions& decisions) {
    return {"LIT_FORMAT", decisions.lit_format == rhi::Format::rgba32_float ? "rgba32f" : "rgba16f"};
}

Expected<void> ComputeStep::prepare(RenderContext& context, const std::string& pass, const rhi::ShaderSource& source,
                                    std::uint32_t set, std::vector<rhi::BindGroupEntry> entries,
                                    std::vector<rhi::BindGroupLayout> layouts) {
    shaders = &context.shaders;
    NACRE_TRY(pipeline, context.shaders.compute_pipeline(
                            pass, {.bind_group_layouts = std::move(layouts), .name = source.path}, source));
    NACRE_TRY(const rhi::BindGroupLayout layout, context.device.bind_group_layout(context.shaders.get(pipeline), set));
    group_index = set;
    NACRE_TRY(group, context.device.create_bind_group({.layout = layout, .entries = std::move(entries), .name = pass}));
    return {};
}

void ComputeStep::bind(rhi::CommandList& list) const {
    list.set_pipeline(shaders->get(pipeline));
    list.set_bind_group(group_index, group);
}

void ComputeStep::destroy(rhi::Device& device) {
    if (group) device.destroy(group);
}

}  // namespace nacre::passes
