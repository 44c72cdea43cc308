// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Tone mapping: exposure, tone curve (passes/tonemap/filmic.glsl or none) and sRGB encoding into the final 8-bit
/// picture.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class ToneMap final : public RenderPass {
  public:
    explicit ToneMap(RenderContext& context) : resources_(context.resources), device_(context.device) {
        name = "tone mapping";
        groups_ = {(context.width + 7) / 8, (context.height + 7) / 8, 1};
        context.graph.add_pass(name)
            .uses(resources_.lit, ResourceUse::sampled)
            .uses(resources_.exposure, ResourceUse::uniform_buffer)
            .uses(resources_.final_color, ResourceUse::storage_write)
            .records([this](PassContext& frame) {
                step_.bind(frame.list);
                frame.list.dispatch(groups_);
            });
    }
    ~ToneMap() override { step_.destroy(device_); }

    Expected<void> prepare(RenderContext& context) override {
        rhi::ShaderSource source{.path = "passes/tonemap/tonemap.comp"};
        if (context.decisions.filmic) source.defines.push_back({"FILMIC"});
        return step_.prepare(
            context, name, source, 0,
            {{.binding = 0, .texture = context.graph.texture(resources_.lit), .sampler = context.nearest},
             {.binding = 1, .buffer = context.graph.buffer(resources_.exposure)},
             {.binding = 2, .texture = context.graph.texture(resources_.final_color)}});
    }

  private:
    const FrameResources resources_;  // a copy: later passes change roles
    rhi::Device& device_;
    rhi::DispatchArguments groups_;
    ComputeStep step_;
};

}  // namespace

std::unique_ptr<RenderPass> make_tonemap(RenderContext& context) { return std::make_unique<ToneMap>(context); }

}  // namespace nacre::passes
