// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "passes/geometry_draws.h"

/// @file
/// A pass that draws what the camera sees of some of the geometry, once: the prepasses, the base pass, emission.

namespace nacre::passes {

class GeometryPass : public RenderPass {
  public:
    Expected<void> prepare(RenderContext& context) override { return draws_.prepare(context, desc_, selected_); }
    [[nodiscard]] std::uint64_t draw_count() const override { return draws_.size(); }

  protected:
    /// The description's name is that of the pass; its `frame_layout` is set to the camera's. `selected`: indices of
    /// draws.
    GeometryPass(const RenderContext& context, GeometryPassDesc desc, std::vector<std::uint32_t> selected);

    /// Draws in this pass of the graph: states what the draws read, and records them with the targets that `targets`
    /// gives in each frame. Which targets the pass uses is stated by the caller.
    void draws_in(PassDeclaration& pass, const RenderContext& context,
                  std::function<rhi::RenderPassDesc(const PassContext&)> targets,
                  std::optional<std::uint32_t> stencil_reference = {});

    GeometryPassDesc desc_;
    rhi::BindGroup closure_group_{};  ///< Set 2 of shaders of closures, where the description has a layout for it.

  private:
    std::vector<std::uint32_t> selected_;
    const std::vector<bool>& visible_;
    rhi::BindGroup camera_group_;
    GeometryDraws draws_;
};

/// Depth state of the two depth prepasses: depth is reversed, nearer is larger.
rhi::DepthStencilState prepass_depth_state(const Decisions& decisions);

}  // namespace nacre::passes
