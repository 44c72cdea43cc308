// SPDX-License-Identifier: Apache-2.0
#include "passes/geometry_pass.h"

/// @file
/// Alpha-test depth prepass: the depth of surfaces with alpha mode MASK. Only here does a shader let go of pixels; the
/// base pass after it tests for equal depth, early. Left out where no material is masked.

namespace nacre::passes {

namespace {

class AlphaTestPrepass final : public GeometryPass {
  public:
    explicit AlphaTestPrepass(RenderContext& context)
        : GeometryPass(context,
                       {.name = "alpha test prepass",
                        .vertex_shader = "passes/alpha_test_prepass/alpha_test_prepass.vert",
                        .fragment_shader = "passes/alpha_test_prepass/alpha_test_prepass.frag",
                        .textures = texture_bit(TextureSlot::base_color),
                        .with_colors = true,
                        .depth_stencil = prepass_depth_state(context.decisions)},
                       select_draws(context.geometry, [](const Draw& draw) {
                           return draw.alpha_mode == materials::AlphaMode::mask;
                       })) {
        const TextureId depth = context.resources.depth;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(depth, rhi::ResourceUse::depth_stencil_write);
        draws_in(pass, context, [depth](const PassContext& frame) -> rhi::RenderPassDesc {
            return {.depth_stencil = {.view = frame.texture(depth)}};
        });
    }
};

}  // namespace

std::unique_ptr<RenderPass> make_alpha_test_prepass(RenderContext& context) {
    return std::make_unique<AlphaTestPrepass>(context);
}

}  // namespace nacre::passes
