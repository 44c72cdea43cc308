// SPDX-License-Identifier: Apache-2.0
#include "passes/geometry_pass.h"

#include <array>

/// @file
/// Base pass: evaluates the materials of what is seen and packs them into the three words of the G-buffer
/// (passes/gbuffer_layout.h). Materials of several lobes may need more words, which go to slices of a storage image;
/// all else is color targets. Tests for the depth of the prepasses.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

GeometryPassDesc base_pass_desc(const RenderContext& context) {
    GeometryPassDesc desc = {.name = "base pass",
                             .vertex_shader = "passes/base_pass/base_pass.vert",
                             .fragment_shader = "passes/base_pass/base_pass.frag",
                             .textures = all_textures & ~texture_bit(TextureSlot::emission),
                             .with_normals = true,
                             .with_colors = true,
                             .keeps_unlit = true,
                             .depth_stencil = {.format = context.decisions.depth_format,
                                               .depth_test = true,
                                               .depth_compare = rhi::CompareOperation::equal},
                             .color_targets = {{.format = rhi::Format::r32_uint},
                                               {.format = rhi::Format::r32_uint},
                                               {.format = rhi::Format::r32_uint}},
                             .closure_shader = "passes/closures/base_pass_"};
    const std::uint32_t slices = context.closures.lighting().slices;
    if (slices > 0) desc.defines.push_back({"MATERIAL_SLICES", std::to_string(slices)});
    if (context.closures.lighting().has_subsurface) {
        desc.defines.push_back({"SUBSURFACE_SLICE", std::to_string(slices - 1)});
    }
    return desc;
}

class BasePass final : public GeometryPass {
  public:
    explicit BasePass(RenderContext& context)
        : GeometryPass(context, base_pass_desc(context), select_draws(context.geometry, [](const Draw& draw) {
              return draw.alpha_mode != materials::AlphaMode::blend;
          })),
          slices_(context.resources.material_slices), device_(context.device) {
        const FrameResources& resources = context.resources;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(resources.material_0, ResourceUse::color_target)
            .uses(resources.material_1, ResourceUse::color_target)
            .uses(resources.top_layer, ResourceUse::color_target)
            .uses(resources.material_slices, ResourceUse::storage_write)
            .uses(resources.depth, ResourceUse::depth_stencil_read);
        draws_in(pass, context,
                 [depth = resources.depth, words = std::array{resources.material_0, resources.material_1,
                                                              resources.top_layer}](const PassContext& frame) {
                     rhi::RenderPassDesc targets{.depth_stencil = {.view = frame.texture(depth), .read_only = true}};
                     for (const TextureId word : words) {
                         rhi::ColorAttachment attachment{.view = frame.texture(word),
                                                         .load = rhi::LoadOperation::clear};
                         attachment.clear.uint = {0, 0, 0, 0};
                         targets.color.push_back(attachment);
                     }
                     return targets;
                 });
    }

    ~BasePass() override {
        if (closure_group_) device_.destroy(closure_group_);
    }

    Expected<void> prepare(RenderContext& context) override {
        if (slices_) {
            NACRE_TRY(desc_.closure_layout, device_.create_bind_group_layout(
                                                {.bindings = {{.binding = 0,
                                                               .type = rhi::BindingType::writeonly_storage_image,
                                                               .stages = rhi::ShaderStage::fragment}},
                                                 .name = "material slices"}));
            NACRE_TRY(closure_group_, device_.create_bind_group(
                                          {.layout = desc_.closure_layout,
                                           .entries = {{.binding = 0, .texture = context.graph.texture(slices_)}},
                                           .name = "material slices"}));
        }
        return GeometryPass::prepare(context);
    }

  private:
    TextureId slices_;
    rhi::Device& device_;
};

}  // namespace

std::unique_ptr<RenderPass> make_base_pass(RenderContext& context) { return std::make_unique<BasePass>(context); }

}  // namespace nacre::passes
