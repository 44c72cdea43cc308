// SPDX-License-Identifier: Apache-2.0
#include "passes/render_pass.h"

#include <array>

/// @file
/// Lighting: for each list of tiles one indirect dispatch with the shader of that list, which reads the G-buffer and
/// writes the lit color. Lists that the scene cannot fill (unlit, mixed) have no shader and no dispatch.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

/// As in passes/tile_classification/tiles.glsl.
constexpr std::uint64_t tile_list_bytes = 16;
struct TileList {
    std::uint32_t index;
    bool slab, unlit;
    bool closures = false;
};
constexpr std::array<TileList, 4> lists = {
    {{0, true, false}, {1, false, true}, {2, true, true}, {4, true, true, true}}};

class Lighting final : public RenderPass {
  public:
    explicit Lighting(RenderContext& context)
        : resources_(context.resources), device_(context.device) {
        name = "lighting";
        const Decisions& decisions = context.decisions;
        for (const TileList& list : lists) {
            // Tiles with closures may hold anything else too.
            const bool is_possible = list.closures ? decisions.closures
                                                   : (!list.slab || decisions.slab) && (!list.unlit || decisions.unlit);
            if (!is_possible) continue;
            steps_.push_back({list, {}});
        }
        PassDeclaration pass = context.graph.add_pass(name);
        pass.uses(resources_.material_0, ResourceUse::sampled)
            .uses(resources_.tile_lists, ResourceUse::indirect_argument | ResourceUse::storage_read)
            .uses(resources_.tiles, ResourceUse::storage_read)
            .uses(resources_.emission, ResourceUse::sampled)
            .uses(resources_.lit, ResourceUse::storage_write);
        if (decisions.slab) {
            pass.uses(resources_.material_1, ResourceUse::sampled)
                .uses(resources_.top_layer, ResourceUse::sampled)
                .uses(resources_.depth, ResourceUse::sampled);
            uses_lighting(pass, resources_);
        }
        if (decisions.closures) {
            pass.uses(resources_.material_slices, ResourceUse::sampled);
            for (std::uint32_t table = 1; table < closure_table_count; ++table) {
                if (reads_table(context.closures.lighting().features, table)) {
                    pass.uses(resources_.material_textures[context.materials.table_place(table)], ResourceUse::sampled);
                }
            }
        }
        pass.records([this](PassContext& frame) {
            for (const Step& step : steps_) {
                step.compute.bind(frame.list);
                if (step.list.slab) frame.list.set_bind_group(0, group_);
                frame.list.dispatch_indirect(frame.buffer(resources_.tile_lists), tile_list_bytes * step.list.index);
            }
        });
    }
    ~Lighting() override {
        for (Step& step : steps_) step.compute.destroy(device_);
    }

    Expected<void> prepare(RenderContext& context) override {
        const FrameGraph& graph = context.graph;
        group_ = context.lighting_group;
        for (Step& step : steps_) {
            rhi::ShaderSource source{.path = "passes/lighting/lighting.comp"};
            source.defines = {lit_format_define(context.decisions), {"TILE_LIST", std::to_string(step.list.index)}};
            std::vector<rhi::BindGroupEntry> entries = {
                {.binding = 0, .texture = graph.texture(resources_.material_0), .sampler = context.nearest}};
            std::vector<rhi::BindingLayout> bindings = {
                {.binding = 0, .type = rhi::BindingType::combined_texture_sampler}};
            if (step.list.slab) {
                source.defines.push_back({"SLAB"});
                for (const rhi::ShaderDefine& define : lighting_defines(context.decisions))
                    source.defines.push_back(define);
                const TextureId textures[] = {resources_.material_1, resources_.top_layer, resources_.depth};
                for (std::uint32_t i = 0; i < 3; ++i) {
                    entries.push_back(
                        {.binding = i + 1, .texture = graph.texture(textures[i]), .sampler = context.nearest});
                    bindings.push_back({.binding = i + 1, .type = rhi::BindingType::combined_texture_sampler});
                }
            }
            if (step.list.unlit) source.defines.push_back({"UNLIT"});
            if (step.list.closures) {
                for (const rhi::ShaderDefine& define : context.closures.lighting_defines())
                    source.defines.push_back(define);
                const auto add = [&](std::uint32_t binding, rhi::Texture texture) {
                    entries.push_back({.binding = binding, .texture = texture, .sampler = context.nearest});
                    bindings.push_back({.binding = binding, .type = rhi::BindingType::combined_texture_sampler});
                };
                for (std::uint32_t table = 1; table < closure_table_count; ++table) {
                    if (reads_table(context.closures.lighting().features, table))
                        add(8 + table, context.materials.table(table));
                }
                if (resources_.material_slices) add(8 + closure_table_count, graph.texture(resources_.material_slices));
            }
            entries.push_back({.binding = 4, .buffer = graph.buffer(resources_.tile_lists)});
            bindings.push_back({.binding = 4, .type = rhi::BindingType::readonly_storage_buffer});
            entries.push_back({.binding = 5, .buffer = graph.buffer(resources_.tiles)});
            bindings.push_back({.binding = 5, .type = rhi::BindingType::readonly_storage_buffer});
            entries.push_back({.binding = 6, .texture = graph.texture(resources_.lit)});
            bindings.push_back({.binding = 6, .type = rhi::BindingType::writeonly_storage_image});
            if (resources_.emission) {
                source.defines.push_back({"EMISSION_TARGET"});
                entries.push_back(
                    {.binding = 7, .texture = graph.texture(resources_.emission), .sampler = context.nearest});
                bindings.push_back({.binding = 7, .type = rhi::BindingType::combined_texture_sampler});
            }
            for (rhi::BindingLayout& binding : bindings) binding.stages = rhi::ShaderStage::compute;
            NACRE_TRY(const rhi::BindGroupLayout layout,
                      context.device.create_bind_group_layout({.bindings = bindings, .name = "lighting"}));
            NACRE_CHECK(step.compute.prepare(context, name, source, 1, entries, {context.lighting_layout, layout}));
        }
        return {};
    }

  private:
    struct Step {
        TileList list;
        ComputeStep compute;
    };
    const FrameResources resources_;  // a copy: later passes change roles
    rhi::Device& device_;
    rhi::BindGroup group_;
    std::vector<Step> steps_;
};

}  // namespace

std::unique_ptr<RenderPass> make_lighting(RenderContext& context) { return std::make_unique<Lighting>(context); }

}  // namespace nacre::passes
