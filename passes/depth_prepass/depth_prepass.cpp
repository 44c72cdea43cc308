// SPDX-License-Identifier: Apache-2.0
#include "passes/geometry_pass.h"

/// @file
/// Depth prepass: the depth of everything opaque that is not alpha-tested, without a fragment shader. Base pass,
/// emission and blending test against it, so that each pixel is shaded once. It clears depth (to 0, which is far) and
/// stencil.

namespace nacre::passes {

namespace {

class DepthPrepass final : public GeometryPass {
  public:
    explicit DepthPrepass(RenderContext& context)
        : GeometryPass(context,
                       {.name = "depth prepass",
                        .vertex_shader = "passes/depth_prepass/depth_prepass.vert",
                        .depth_stencil = prepass_depth_state(context.decisions)},
                       select_draws(context.geometry, [](const Draw& draw) {
                           return draw.alpha_mode == materials::AlphaMode::opaque;
                       })) {
        const TextureId depth = context.resources.depth;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(depth, rhi::ResourceUse::depth_stencil_write);
        draws_in(pass, context, [depth](const PassContext& frame) -> rhi::RenderPassDesc {
            return {.depth_stencil = {.view = frame.texture(depth),
                                      .depth_load = rhi::LoadOperation::clear,
                                      .clear_depth = 0.0f,
                                      .stencil_load = rhi::LoadOperation::clear}};
        });
    }
};

}  // namespace

std::unique_ptr<RenderPass> make_depth_prepass(RenderContext& context) {
    return std::make_unique<DepthPrepass>(context);
}

}  // namespace nacre::passes
