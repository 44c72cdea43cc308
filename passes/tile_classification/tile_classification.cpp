// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

/// @file
/// Tile classification: sorts tiles of 8x8 pixels into lists by what their pixels hold, so that lighting and sky run
/// only where they are needed, each list with a shader that knows no other case. The lists' lengths are arguments of
/// indirect dispatches; the host never sees them.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class TileClassification final : public RenderPass {
  public:
    explicit TileClassification(RenderContext& context)
        : resources_(context.resources), device_(context.device), write_classes_(context.write_tile_classes),
          closures_(context.decisions.closures) {
        name = "tile classification";
        groups_ = {(context.width + 7) / 8, (context.height + 7) / 8, 1};
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(resources_.material_0, ResourceUse::sampled)
            .uses(resources_.tile_lists_start, ResourceUse::copy_source)
            .uses(resources_.tile_lists,
                  ResourceUse::copy_destination | ResourceUse::storage_read | ResourceUse::storage_write)
            .uses(resources_.tiles, ResourceUse::storage_read | ResourceUse::storage_write);
        if (write_classes_) pass.uses(resources_.tile_classes, ResourceUse::storage_write);
        pass.records([this](PassContext& frame) {
            frame.list.copy_buffer(frame.buffer(resources_.tile_lists_start), 0, frame.buffer(resources_.tile_lists), 0,
                                   16 * tile_list_count(closures_));
            step_.bind(frame.list);
            frame.list.dispatch(groups_);
        });
    }
    ~TileClassification() override { step_.destroy(device_); }

    Expected<void> prepare(RenderContext& context) override {
        rhi::ShaderSource source{.path = "passes/tile_classification/tile_classification.comp"};
        const FrameGraph& graph = context.graph;
        std::vector<rhi::BindGroupEntry> entries = {
            {.binding = 0, .texture = graph.texture(resources_.material_0), .sampler = context.nearest},
            {.binding = 1, .buffer = graph.buffer(resources_.tile_lists)},
            {.binding = 2, .buffer = graph.buffer(resources_.tiles)}};
        if (closures_) source.defines.push_back({"CLOSURES"});
        if (write_classes_) {
            source.defines.push_back({"WRITE_CLASSES"});
            entries.push_back({.binding = 3, .texture = graph.texture(resources_.tile_classes)});
        }
        return step_.prepare(context, name, source, 0, entries);
    }

  private:
    const FrameResources resources_;  // a copy: later passes change roles
    rhi::Device& device_;
    bool write_classes_, closures_;
    rhi::DispatchArguments groups_;
    ComputeStep step_;
};

}  // namespace

std::unique_ptr<RenderPass> make_tile_classification(RenderContext& context) {
    return std::make_unique<TileClassification>(context);
}

}  // namespace nacre::passes
