// SPDX-License-Identifier: Apache-2.0
#include "passes/geometry_pass.h"

/// @file
/// Stencil prepass: marks the pixels whose visible surface emits light. The emission pass adds light where the mark is
/// and takes the mark away, so that a pixel gets it once, however many emitting faces coincide there (depth alone
/// cannot tell them apart). Left out, and with it the stencil part of the depth target, where nothing emits.

namespace nacre::passes {

namespace {

rhi::DepthStencilState marking_state(const Decisions& decisions) {
    rhi::DepthStencilState state{.format = decisions.depth_format,
                                 .depth_test = true,
                                 .depth_compare = rhi::CompareOperation::equal,
                                 .stencil_test = true};
    state.front.pass = state.back.pass = rhi::StencilOperation::replace;
    return state;
}

class StencilPrepass final : public GeometryPass {
  public:
    explicit StencilPrepass(RenderContext& context)
        : GeometryPass(context,
                       {.name = "stencil prepass",
                        .vertex_shader = "passes/stencil_prepass/stencil_prepass.vert",
                        .depth_stencil = marking_state(context.decisions)},
                       select_draws(context.geometry, [](const Draw& draw) {
                           return draw.alpha_mode != materials::AlphaMode::blend && draw.emits;
                       })) {
        const TextureId depth = context.resources.depth;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(depth, rhi::ResourceUse::depth_stencil_write);
        const auto target = [depth](const PassContext& frame) -> rhi::RenderPassDesc {
            return {.depth_stencil = {.view = frame.texture(depth)}};
        };
        draws_in(pass, context, target, 1);
    }
};

}  // namespace

std::unique_ptr<RenderPass> make_stencil_prepass(RenderContext& context) {
    return std::make_unique<StencilPrepass>(context);
}

}  // namespace nacre::passes
