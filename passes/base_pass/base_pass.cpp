// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Base pass: evaluates the materials of what is seen and packs them into the three words of the G-buffer
/// (passes/gbuffer_layout.h). Materials of several lobes may need more words, which go to slices of a storage image; all
/// else is color targets. Tests for the depth of the prepasses.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class BasePass final : public RenderPass {
  public:
    explicit BasePass(RenderContext& context)
        : resources_(context.resources), device_(context.device), visible_(context.visible) {
        name = "base pass";
        desc_ = {.name = name,
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
                 .frame_layout = context.camera_layout,
                 .closure_shader = "passes/closures/base_pass_"};
        const std::uint32_t slices = context.closures.lighting().slices;
        if (slices > 0) desc_.defines.push_back({"MATERIAL_SLICES", std::to_string(slices)});
        if (context.closures.lighting().has_subsurface) {
            desc_.defines.push_back({"SUBSURFACE_SLICE", std::to_string(slices - 1)});
        }
        selected_ = select_draws(context.geometry, [](const Draw& draw) {
            return draw.alpha_mode != materials::AlphaMode::blend;
        });
        group_ = context.camera_group;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(resources_.material_0, ResourceUse::color_target)
            .uses(resources_.material_1, ResourceUse::color_target)
            .uses(resources_.top_layer, ResourceUse::color_target)
            .uses(resources_.material_slices, ResourceUse::storage_write)
            .uses(resources_.depth, ResourceUse::depth_stencil_read);
        const FrameUse camera[] = {{.buffer = context.resources.camera, .use = ResourceUse::uniform_buffer}};
        uses_geometry(pass, context, desc_, selected_, camera);
        pass.records([this](PassContext& frame) {
            rhi::RenderPassDesc target{.depth_stencil = {.view = frame.texture(resources_.depth), .read_only = true},
                                       .name = name};
            for (const TextureId word : {resources_.material_0, resources_.material_1, resources_.top_layer}) {
                rhi::ColorAttachment attachment{.view = frame.texture(word), .load = rhi::LoadOperation::clear};
                attachment.clear.uint = {0, 0, 0, 0};
                target.color.push_back(attachment);
            }
            frame.list.begin_render_pass(target);
            draws_.record(frame.list, group_, visible_, slices_group_);
            frame.list.end_render_pass();
        });
    }

    ~BasePass() override {
        if (slices_group_) device_.destroy(slices_group_);
    }

    Expected<void> prepare(RenderContext& context) override {
        if (resources_.material_slices) {
            NACRE_TRY(desc_.closure_layout, device_.create_bind_group_layout(
                                                {.bindings = {{.binding = 0,
                                                               .type = rhi::BindingType::writeonly_storage_image,
                                                               .stages = rhi::ShaderStage::fragment}},
                                                 .name = "material slices"}));
            NACRE_TRY(slices_group_, device_.create_bind_group(
                                         {.layout = desc_.closure_layout,
                                          .entries = {{.binding = 0,
                                                       .texture = context.graph.texture(resources_.material_slices)}},
                                          .name = "material slices"}));
        }
        return draws_.prepare(context, desc_, selected_);
    }
    [[nodiscard]] std::uint64_t draw_count() const override { return draws_.size(); }

  private:
    const FrameResources resources_;  // a copy: later passes change roles
    rhi::Device& device_;
    rhi::BindGroup slices_group_{};
    GeometryPassDesc desc_;
    std::vector<std::uint32_t> selected_;
    rhi::BindGroup group_;
    const std::vector<bool>& visible_;
    GeometryDraws draws_;
};

}  // namespace

std::unique_ptr<RenderPass> make_base_pass(RenderContext& context) { return std::make_unique<BasePass>(context); }

}  // namespace nacre::passes
