// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Sky: the environment in the pixels where no surface is seen, for the tiles that have such pixels.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class Sky final : public RenderPass {
  public:
    explicit Sky(RenderContext& context)
        : resources_(context.resources), device_(context.device) {
        name = "sky";
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(resources_.material_0, ResourceUse::sampled)
            .uses(resources_.tile_lists, ResourceUse::indirect_argument | ResourceUse::storage_read)
            .uses(resources_.tiles, ResourceUse::storage_read)
            .uses(resources_.lit, ResourceUse::storage_write);
        uses_lighting(pass, resources_);
        pass.records([this](PassContext& frame) {
            step_.bind(frame.list);
            frame.list.set_bind_group(0, group_);
            frame.list.dispatch_indirect(frame.buffer(resources_.tile_lists), 3 * 16);
        });
    }
    ~Sky() override { step_.destroy(device_); }

    Expected<void> prepare(RenderContext& context) override {
        const FrameGraph& graph = context.graph;
        group_ = context.lighting_group;
        const auto compute = rhi::ShaderStage::compute;
        NACRE_TRY(const rhi::BindGroupLayout layout,
                  context.device.create_bind_group_layout(
                      {.bindings = {{0, rhi::BindingType::combined_texture_sampler, 1, compute},
                                    {4, rhi::BindingType::readonly_storage_buffer, 1, compute},
                                    {5, rhi::BindingType::readonly_storage_buffer, 1, compute},
                                    {6, rhi::BindingType::writeonly_storage_image, 1, compute}},
                       .name = "sky"}));
        return step_.prepare(
            context, name, {.path = "passes/sky/sky.comp", .defines = {lit_format_define(context.decisions)}}, 1,
            {{.binding = 0, .texture = graph.texture(resources_.material_0), .sampler = context.nearest},
             {.binding = 4, .buffer = graph.buffer(resources_.tile_lists)},
             {.binding = 5, .buffer = graph.buffer(resources_.tiles)},
             {.binding = 6, .texture = graph.texture(resources_.lit)}},
            {context.lighting_layout, layout});
    }

  private:
    const FrameResources resources_;  // a copy: later passes change roles
    rhi::Device& device_;
    rhi::BindGroup group_;
    ComputeStep step_;
};

}  // namespace

std::unique_ptr<RenderPass> make_sky(RenderContext& context) { return std::make_unique<Sky>(context); }

}  // namespace nacre::passes
