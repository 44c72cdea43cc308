// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Alpha-test depth prepass: the depth of surfaces with alpha mode MASK. Only here does a shader let go of pixels; the
/// base pass after it tests for equal depth, early. Left out where no material is masked.

namespace nacre::passes {

using rhi::ResourceUse;

rhi::DepthStencilState prepass_depth_state(const Decisions& decisions);

namespace {

class AlphaTestPrepass final : public RenderPass {
  public:
    explicit AlphaTestPrepass(RenderContext& context) : depth_(context.resources.depth), visible_(context.visible) {
        name = "alpha test prepass";
        desc_ = {.name = name,
                 .vertex_shader = "passes/alpha_test_prepass/alpha_test_prepass.vert",
                 .fragment_shader = "passes/alpha_test_prepass/alpha_test_prepass.frag",
                 .textures = texture_bit(TextureSlot::base_color),
                 .with_colors = true,
                 .depth_stencil = prepass_depth_state(context.decisions),
                 .frame_layout = context.camera_layout};
        selected_ = select_draws(context.geometry, [](const Draw& draw) {
            return draw.alpha_mode == materials::AlphaMode::mask;
        });
        group_ = context.camera_group;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(depth_, ResourceUse::depth_stencil_write);
        const FrameUse camera[] = {{.buffer = context.resources.camera, .use = ResourceUse::uniform_buffer}};
        uses_geometry(pass, context, desc_, selected_, camera);
        pass.records([this](PassContext& frame) {
            frame.list.begin_render_pass({.depth_stencil = {.view = frame.texture(depth_)}, .name = name});
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

std::unique_ptr<RenderPass> make_alpha_test_prepass(RenderContext& context) {
    return std::make_unique<AlphaTestPrepass>(context);
}

}  // namespace nacre::passes
