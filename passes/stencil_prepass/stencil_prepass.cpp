// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Stencil prepass: marks the pixels whose visible surface emits light. The emission pass adds light where the mark is
/// and takes the mark away, so that a pixel gets it once, however many emitting faces coincide there (depth alone
/// cannot tell them apart). Left out, and with it the stencil part of the depth target, where nothing emits.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class StencilPrepass final : public RenderPass {
  public:
    explicit StencilPrepass(RenderContext& context) : depth_(context.resources.depth), visible_(context.visible) {
        name = "stencil prepass";
        rhi::DepthStencilState state{.format = context.decisions.depth_format,
                                     .depth_test = true,
                                     .depth_compare = rhi::CompareOperation::equal,
                                     .stencil_test = true};
        state.front.pass = state.back.pass = rhi::StencilOperation::replace;
        desc_ = {.name = name,
                 .vertex_shader = "passes/stencil_prepass/stencil_prepass.vert",
                 .depth_stencil = state,
                 .frame_layout = context.camera_layout};
        selected_ = select_draws(context.geometry, [](const Draw& draw) {
            return draw.alpha_mode != materials::AlphaMode::blend && draw.emits;
        });
        group_ = context.camera_group;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(depth_, ResourceUse::depth_stencil_write);
        const FrameUse camera[] = {{.buffer = context.resources.camera, .use = ResourceUse::uniform_buffer}};
        uses_geometry(pass, context, desc_, selected_, camera);
        pass.records([this](PassContext& frame) {
            frame.list.begin_render_pass({.depth_stencil = {.view = frame.texture(depth_)}, .name = name});
            frame.list.set_stencil_reference(1);
            draws_.record(frame.list, group_, visible_);
            frame.list.end_render_pass();
        });
    }

    Expected<void> prepare(RenderContext& context) override { return draws_.prepare(context, desc_, selected_); }
    [[nodiscard]] std::uint64_t draw_count() const override { return draws_.size(); }

  private:
    TextureId depth_;
    GeometryPassDesc desc_;
    std::vector<std::uint32_t> selected_;
    rhi::BindGroup group_;
    const std::vector<bool>& visible_;
    GeometryDraws draws_;
};

}  // namespace

std::unique_ptr<RenderPass> make_stencil_prepass(RenderContext& context) {
    return std::make_unique<StencilPrepass>(context);
}

}  // namespace nacre::passes
