// SPDX-License-Identifier: Apache-2.0
#include "passes/geometry_pass.h"

#include <utility>

namespace nacre::passes {

using rhi::ResourceUse;

GeometryPass::GeometryPass(const RenderContext& context, GeometryPassDesc desc, std::vector<std::uint32_t> selected)
    : desc_(std::move(desc)), selected_(std::move(selected)), visible_(context.visible),
      camera_group_(context.camera_group) {
    name = desc_.name;
    desc_.frame_layout = context.camera_layout;
}

void GeometryPass::draws_in(PassDeclaration& pass, const RenderContext& context,
                            std::function<rhi::RenderPassDesc(const PassContext&)> targets,
                            std::optional<std::uint32_t> stencil_reference) {
    const FrameUse camera[] = {{.buffer = context.resources.camera, .use = ResourceUse::uniform_buffer}};
    uses_geometry(pass, context, desc_, selected_, camera);
    pass.records([this, targets = std::move(targets), stencil_reference](PassContext& frame) {
        rhi::RenderPassDesc target = targets(frame);
        target.name = name;
        frame.list.begin_render_pass(target);
        if (stencil_reference) frame.list.set_stencil_reference(*stencil_reference);
        draws_.record(frame.list, camera_group_, visible_, closure_group_);
        frame.list.end_render_pass();
    });
}

rhi::DepthStencilState prepass_depth_state(const Decisions& decisions) {
    return {.format = decisions.depth_format,
            .depth_test = true,
            .depth_write = true,
            .depth_compare = rhi::CompareOperation::greater_or_equal};
}

}  // namespace nacre::passes
