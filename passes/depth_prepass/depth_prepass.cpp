// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Depth prepass: the depth of everything opaque that is not alpha-tested, without a fragment shader. Base pass, emission
/// and blending test against it, so that each pixel is shaded once. It clears depth (to 0, which is far) and stencil.

namespace nacre::passes {

using rhi::ResourceUse;

/// Depth state of the two depth prepasses: depth is reversed, nearer is larger.
rhi::DepthStencilState prepass_depth_state(const Decisions& decisions) {
    return {.format = decisions.depth_format,
            .depth_test = true,
            .depth_write = true,
            .depth_compare = rhi::CompareOperation::greater_or_equal};
}

namespace {

class DepthPrepass final : public RenderPass {
  public:
    explicit DepthPrepass(RenderContext& context) : depth_(context.resources.depth), visible_(context.visible) {
        name = "depth prepass";
        desc_ = {.name = name,
                 .vertex_shader = "passes/depth_prepass/depth_prepass.vert",
                 .depth_stencil = prepass_depth_state(context.decisions),
                 .frame_layout = context.camera_layout};
        selected_ = select_draws(context.geometry, [](const Draw& draw) {
            return draw.alpha_mode == materials::AlphaMode::opaque;
        });
        group_ = context.camera_group;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(depth_, ResourceUse::depth_stencil_write);
        const FrameUse camera[] = {{.buffer = context.resources.camera, .use = ResourceUse::uniform_buffer}};
        uses_geometry(pass, context, desc_, selected_, camera);
        pass.records([this](PassContext& frame) {
            frame.list.begin_render_pass({.depth_stencil = {.view = frame.texture(depth_),
                                                            .depth_load = rhi::LoadOperation::clear,
                                                            .clear_depth = 0.0f,
                                                            .stencil_load = rhi::LoadOperation::clear},
                                          .name = name});
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

std::unique_ptr<RenderPass> make_depth_prepass(RenderContext& context) { return std::make_unique<DepthPrepass>(context); }

}  // namespace nacre::passes
