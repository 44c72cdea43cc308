// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "passes/geometry_draws.h"

/// @file
/// Shadow maps: one depth texture with a layer for each view (one for directional and spot lights, six around a point
/// light), reversed depth. Alpha-tested surfaces let light through where they are not; blended ones cast no shadow.
/// Left out where no light casts shadows.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class ShadowMaps final : public RenderPass {
  public:
    ShadowMaps(RenderContext& context, std::span<const rhi::BindGroup> views, std::span<const glm::mat4> matrices)
        : shadow_maps_(context.resources.shadow_maps), views_(views.begin(), views.end()) {
        // Neither lights nor geometry move: what a view sees is known.
        for (const glm::mat4& matrix : matrices) visible_.push_back(context.geometry.visible_in(matrix));
        name = "shadow maps";
        const rhi::DepthStencilState state{.format = rhi::Format::d32_float,
                                           .depth_test = true,
                                           .depth_write = true,
                                           .depth_compare = rhi::CompareOperation::greater_or_equal};
        // Both faces cast shadows: thin walls would leak otherwise.
        opaque_desc_ = {.name = name,
                        .vertex_shader = "passes/shadow_maps/shadow_maps.vert",
                        .depth_stencil = state,
                        .frame_layout = context.camera_layout,
                        .culls = false};
        masked_desc_ = opaque_desc_;
        masked_desc_.fragment_shader = "passes/alpha_test_prepass/alpha_test_prepass.frag";
        masked_desc_.textures = texture_bit(TextureSlot::base_color);
        masked_desc_.with_colors = true;
        const auto of_mode = [&](materials::AlphaMode mode) {
            return select_draws(context.geometry, [mode](const Draw& draw) {
                return draw.alpha_mode == mode && draw.topology == scene::Topology::triangle_list;
            });
        };
        opaque_ = of_mode(materials::AlphaMode::opaque);
        masked_ = of_mode(materials::AlphaMode::mask);
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(shadow_maps_, ResourceUse::depth_stencil_write);
        const FrameUse cameras[] = {{.buffer = context.resources.shadow_cameras, .use = ResourceUse::uniform_buffer}};
        uses_geometry(pass, context, opaque_desc_, opaque_, cameras, visible_);
        uses_geometry(pass, context, masked_desc_, masked_, cameras, visible_);
        pass.records([this](PassContext& frame) {
            for (std::uint32_t view = 0; view < views_.size(); ++view) {
                frame.list.begin_render_pass(
                    {.depth_stencil = {.view = rhi::TextureView::subresource(frame.texture(shadow_maps_), 0, view),
                                       .depth_load = rhi::LoadOperation::clear,
                                       .clear_depth = 0.0f},
                     .name = name});
                opaque_draws_.record(frame.list, views_[view], visible_[view]);
                masked_draws_.record(frame.list, views_[view], visible_[view]);
                frame.list.end_render_pass();
            }
        });
    }

    Expected<void> prepare(RenderContext& context) override {
        NACRE_CHECK(opaque_draws_.prepare(context, opaque_desc_, opaque_));
        return masked_draws_.prepare(context, masked_desc_, masked_);
    }
    [[nodiscard]] std::uint64_t draw_count() const override {
        return views_.size() * (opaque_draws_.size() + masked_draws_.size());
    }

  private:
    TextureId shadow_maps_;
    std::vector<rhi::BindGroup> views_;
    std::vector<std::vector<bool>> visible_;
    GeometryPassDesc opaque_desc_, masked_desc_;
    std::vector<std::uint32_t> opaque_, masked_;
    GeometryDraws opaque_draws_, masked_draws_;
};

}  // namespace

std::unique_ptr<RenderPass> make_shadow_maps(RenderContext& context, std::span<const rhi::BindGroup> view_groups,
                                             std::span<const glm::mat4> view_matrices) {
    return std::make_unique<ShadowMaps>(context, view_groups, view_matrices);
}

}  // namespace nacre::passes
