// SPDX-License-Identifier: Apache-2.0
#include "passes/geometry_pass.h"

/// @file
/// Emission: draws what emits once more and adds its light to the lit color, where depth is equal and the stencil
/// prepass has left its mark. Where a device cannot blend into float targets, it draws into an integer target before
/// the lighting, which adds it. Left out where nothing emits.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

GeometryPassDesc emission_desc(const Decisions& decisions) {
    rhi::DepthStencilState state{.format = decisions.depth_format,
                                 .depth_test = true,
                                 .depth_compare = rhi::CompareOperation::equal,
                                 .stencil_test = true};
    state.front = {.pass = rhi::StencilOperation::zero, .compare = rhi::CompareOperation::equal};
    state.back = state.front;
    const bool packed = decisions.packed_targets;
    rhi::ColorTargetState target{.format = packed ? rhi::Format::r32_uint : decisions.lit_format};
    if (!packed) {
        // Adds color; keeps alpha.
        target.blend = {.enabled = true,
                        .source_color = rhi::BlendFactor::one,
                        .destination_color = rhi::BlendFactor::one,
                        .source_alpha = rhi::BlendFactor::zero,
                        .destination_alpha = rhi::BlendFactor::one};
    }
    GeometryPassDesc desc = {.name = "emission",
                             .vertex_shader = "passes/emission/emission.vert",
                             .fragment_shader = "passes/emission/emission.frag",
                             .textures = texture_bit(TextureSlot::emission),
                             .depth_stencil = state,
                             .color_targets = {target},
                             .closure_shader = "passes/closures/emission_"};
    if (packed) desc.defines.push_back({"PACKED"});
    return desc;
}

class Emission final : public GeometryPass {
  public:
    explicit Emission(RenderContext& context)
        : GeometryPass(context, emission_desc(context.decisions), select_draws(context.geometry, [](const Draw& draw) {
              return draw.alpha_mode != materials::AlphaMode::blend && draw.emits;
          })) {
        const bool packed = context.decisions.packed_targets;
        const TextureId color = packed ? context.resources.emission : context.resources.lit;
        const TextureId depth = context.resources.depth;
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(color, ResourceUse::color_target).uses(depth, ResourceUse::depth_stencil_write);
        const auto targets = [packed, color, depth](const PassContext& frame) -> rhi::RenderPassDesc {
            rhi::ColorAttachment attachment{.view = frame.texture(color),
                                            .load = packed ? rhi::LoadOperation::clear : rhi::LoadOperation::load};
            if (packed) attachment.clear.uint = {0, 0, 0, 0};
            return {.color = {attachment}, .depth_stencil = {.view = frame.texture(depth)}};
        };
        draws_in(pass, context, targets, 1);
    }
};

}  // namespace

std::unique_ptr<RenderPass> make_emission(RenderContext& context) { return std::make_unique<Emission>(context); }

}  // namespace nacre::passes
