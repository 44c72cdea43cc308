// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Automatic exposure: the median luminance of the lit picture becomes middle gray. Left out where the exposure is
/// given.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class Exposure final : public RenderPass {
  public:
    explicit Exposure(RenderContext& context) : resources_(context.resources), device_(context.device) {
        name = "exposure";
        histogram_ = context.graph.add_buffer({.size = 1024, .name = "histogram"});
        groups_ = {(context.width + 31) / 32, (context.height + 15) / 16, 1};
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(resources_.lit, ResourceUse::sampled)
            .uses(histogram_, ResourceUse::copy_destination | ResourceUse::storage_read | ResourceUse::storage_write)
            .uses(resources_.exposure, ResourceUse::storage_read | ResourceUse::storage_write);
        pass.records([this](PassContext& frame) {
            frame.list.fill_buffer(frame.buffer(histogram_), 0);
            count_.bind(frame.list);
            frame.list.dispatch(groups_);
            choose_.bind(frame.list);
            frame.list.dispatch({1, 1, 1});
        });
    }
    ~Exposure() override {
        count_.destroy(device_);
        choose_.destroy(device_);
    }

    Expected<void> prepare(RenderContext& context) override {
        const FrameGraph& graph = context.graph;
        NACRE_CHECK(count_.prepare(
            context, name, {.path = "passes/exposure/histogram.comp"}, 0,
            {{.binding = 0, .texture = graph.texture(resources_.lit), .sampler = context.nearest},
             {.binding = 1, .buffer = graph.buffer(histogram_)}}));
        return choose_.prepare(context, name, {.path = "passes/exposure/exposure.comp"}, 0,
                               {{.binding = 0, .buffer = graph.buffer(histogram_)},
                                {.binding = 1, .buffer = graph.buffer(resources_.exposure)}});
    }

  private:
    const FrameResources resources_;  // a copy: later passes change roles
    rhi::Device& device_;
    BufferId histogram_;
    rhi::DispatchArguments groups_;
    ComputeStep count_, choose_;
};

}  // namespace

std::unique_ptr<RenderPass> make_exposure(RenderContext& context) { return std::make_unique<Exposure>(context); }

}  // namespace nacre::passes
