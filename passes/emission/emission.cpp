// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Emission: draws what emits once more and adds its light to the lit color, where depth is equal and the stencil prepass
/// has left its mark. Where a device cannot blend into float targets, it draws into an integer target before the
/// lighting, which adds it. Left out where nothing emits.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class Emission final : public RenderPass {
  public:
    explicit Emission(RenderContext& context)
        : resources_(context.resources), packed_(context.decisions.packed_targets), visible_(context.visible) {
        name = "emission";
        rhi::DepthStencilState state{.format = context.decisions.depth_format,
                                     .depth_test = true,
                                     .depth_compare = rhi::CompareOperation::equal,
                                     .stencil_test = true};
        state.front = {.pass = rhi::StencilOperation::zero, .compare = rhi::CompareOperation::equal};
        state.back = state.front;
        rhi::ColorTargetState target{.format = packed_ ? rhi::Format::r32_uint : context.decisions.lit_format};
        if (!packed_) {
            // Adds color; keeps alpha.
            target.blend = {.enabled = true,
                            .source_color = rhi::BlendFactor::one,
                            .destination_color = rhi::BlendFactor::one,
                            .source_alpha = rhi::BlendFactor::zero,
                            .destination_alpha = rhi::BlendFactor::one};
        }
        desc_ = {.name = name,
                 .vertex_shader = "passes/emission/emission.vert",
                 .fragment_shader = "passes/emission/emission.frag",
                 .textures = texture_bit(TextureSlot::emission),
                 .depth_stencil = state,
                 .color_targets = {target},
                 .frame_layout = context.camera_layout,
                 .closure_shader = "passes/closures/emission_"};
        if (packed_) desc_.defines.push_back({"PACKED"});
        selected_ = select_draws(context.geometry, [](const Draw& draw) {
            return draw.alpha_mode != materials::AlphaMode::blend && draw.emits;
        });
        group_ = context.camera_group;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(packed_ ? resources_.emission : resources_.lit, ResourceUse::color_target)
            .uses(resources_.depth, ResourceUse::depth_stencil_write);
        const FrameUse camera[] = {{.buffer = context.resources.camera, .use = ResourceUse::uniform_buffer}};
        uses_geometry(pass, context, desc_, selected_, camera);
        pass.records([this](PassContext& frame) {
            rhi::ColorAttachment attachment{.view = frame.texture(packed_ ? resources_.emission : resources_.lit),
                                            .load = packed_ ? rhi::LoadOperation::clear : rhi::LoadOperation::load};
            if (packed_) attachment.clear.uint = {0, 0, 0, 0};
            frame.list.begin_render_pass(
                {.color = {attachment}, .depth_stencil = {.view = frame.texture(resources_.depth)}, .name = name});
            frame.list.set_stencil_reference(1);
            draws_.record(frame.list, group_, visible_);
            frame.list.end_render_pass();
        });
    }

    Expected<void> prepare(RenderContext& context) override { return draws_.prepare(context, desc_, selected_); }
    [[nodiscard]] std::uint64_t draw_count() const override { return draws_.size(); }

  private:
    const FrameResources resources_;  // a copy: later passes change roles
    bool packed_;
    GeometryPassDesc desc_;
    std::vector<std::uint32_t> selected_;
    rhi::BindGroup group_;
    const std::vector<bool>& visible_;
    GeometryDraws draws_;
};

}  // namespace

std::unique_ptr<RenderPass> make_emission(RenderContext& context) { return std::make_unique<Emission>(context); }

}  // namespace nacre::passes
