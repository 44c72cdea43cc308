// SPDX-License-Identifier: Apache-2.0
#include "passes/geometry_draws.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <tuple>

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

/// What drawing a draw in a pass reads.
ShadingFeatures features_in(const GeometryPassDesc& desc, const Draw& draw) {
    if (draw.has_closures && !desc.closure_shader.empty()) return draw.closure_features;
    ShadingFeatures features = draw.features;
    // Depth alone is the same for all kinds.
    if (desc.fragment_shader.empty()) features.kind = features.kind_attributes = features.sideband = 0;
    return restricted(features, desc.textures, desc.with_normals, desc.with_colors);
}

}  // namespace

Expected<void> GeometryDraws::prepare(RenderContext& context, const GeometryPassDesc& desc,
                                      std::vector<std::uint32_t> draws, bool keep_order) {
    shaders_ = &context.shaders;
    geometry_ = &context.geometry;
    materials_ = &context.materials;
    uses_materials_ = !desc.fragment_shader.empty();

    // What a pipeline depends on. Materials whose sets of textures differ have different layouts.
    struct Key {
        ShadingFeatures features;
        rhi::CullMode cull;
        bool mirrored;
        std::uint32_t texture_mask;
        std::uint32_t topology;  // of closures; ~0: none
        auto operator<=>(const Key&) const = default;
    };
    std::map<Key, std::uint32_t> known;
    const auto pipeline_for = [&](const Key& key, const Draw& draw) -> Expected<std::uint32_t> {
        if (const auto found = known.find(key); found != known.end()) return found->second;
        rhi::GraphicsPipelineDesc pipeline;
        const bool by_closures = key.topology != ~0u;
        std::vector<rhi::ShaderDefine> defines = vertex_defines(key.features);
        const auto defined = std::ranges::find(desc.defines, "HAS_POSITIONS", &rhi::ShaderDefine::name);
        if (by_closures && defined == desc.defines.end()) {
            defines.push_back({"HAS_POSITIONS"});
        }
        defines.insert(defines.end(), desc.defines.begin(), desc.defines.end());
        const rhi::ShaderSource vertex{.path = desc.vertex_shader, .defines = std::move(defines)};
        std::optional<rhi::ShaderSource> fragment;
        pipeline.bind_group_layouts = {desc.frame_layout};
        if (uses_materials_) {
            defines = fragment_defines(key.features);
            defines.insert(defines.end(), desc.defines.begin(), desc.defines.end());
            if (by_closures) defines.insert(defines.end(), desc.closure_defines.begin(), desc.closure_defines.end());
            const std::string path =
                by_closures ? fmt::format("{}{}.frag", desc.closure_shader, key.topology) : desc.fragment_shader;
            fragment = rhi::ShaderSource{.path = path, .defines = std::move(defines)};
            pipeline.bind_group_layouts.push_back(by_closures ? context.materials.closure_layout(draw.material)
                                                              : context.materials.layout(draw.material));
            if (by_closures && desc.closure_layout && context.closures.find(draw.material)->writes_slices()) {
                pipeline.bind_group_layouts.push_back(desc.closure_layout);
            }
        }
        SceneGeometry::describe_vertices(key.features.attributes, pipeline);
        pipeline.cull = key.cull;
        pipeline.front_face = key.mirrored ? rhi::FrontFace::clockwise : rhi::FrontFace::counter_clockwise;
        pipeline.depth_stencil = desc.depth_stencil;
        pipeline.color_targets =
            by_closures && !desc.closure_color_targets.empty() ? desc.closure_color_targets : desc.color_targets;
        pipeline.name = desc.name;
        NACRE_TRY(const rhi::ReloadableGraphicsPipeline made,
                  context.shaders.graphics_pipeline(desc.name, pipeline, vertex, fragment));
        pipelines_.push_back(made);
        has_closure_group_.push_back(pipeline.bind_group_layouts.size() > 2);
        return known.emplace(key, static_cast<std::uint32_t>(pipelines_.size() - 1)).first->second;
    };

    for (const std::uint32_t index : draws) {
        const Draw& draw = geometry_->draws()[index];
        const bool by_closures = draw.has_closures && !desc.closure_shader.empty();
        ShadingFeatures features = features_in(desc, draw);
        if (!desc.keeps_unlit) features.unlit = false;
        const bool culls = desc.culls && !draw.two_faces;
        Key key{features, culls ? rhi::CullMode::back : rhi::CullMode::none,
                (culls || features.double_sided) && draw.mirrored,
                uses_materials_ && !by_closures ? context.materials.texture_mask(draw.material) : 0,
                by_closures ? context.closures.find(draw.material)->topology : ~0u};
        Item item{.draw = index, .attributes = features.attributes, .by_closures = by_closures};
        const bool sorted_faces = keep_order && draw.two_faces && draw.topology == scene::Topology::triangle_list;
        if (sorted_faces) {
            // Far faces of a closed transparent body first, then the near ones.
            key.mirrored = draw.mirrored;
            key.cull = rhi::CullMode::front;
            NACRE_TRY(item.back_pipeline, pipeline_for(key, draw));
            key.cull = rhi::CullMode::back;
        }
        NACRE_TRY(item.pipeline, pipeline_for(key, draw));
        items_.push_back(item);
    }
    if (!keep_order) {
        std::ranges::stable_sort(items_, {}, [&](const Item& item) {
            return std::tuple(item.pipeline, geometry_->draws()[item.draw].material);
        });
    }
    return {};
}

void GeometryDraws::record_item(rhi::CommandList& list, const Item& item, rhi::BindGroup frame_group,
                                std::uint32_t pipeline, std::uint32_t& bound_pipeline,
                                std::uint32_t& bound_material, rhi::BindGroup closure_group) const {
    const Draw& draw = geometry_->draws()[item.draw];
    if (pipeline != bound_pipeline) {
        list.set_pipeline(shaders_->get(pipelines_[pipeline]));
        list.set_bind_group(0, frame_group);
        if (has_closure_group_[pipeline]) list.set_bind_group(2, closure_group);
        bound_pipeline = pipeline;
        bound_material = ~0u;
    }
    if (uses_materials_ && draw.material != bound_material) {
        list.set_bind_group(1, item.by_closures ? materials_->closure_group(draw.material)
                                                : materials_->group(draw.material));
        bound_material = draw.material;
    }
    geometry_->record(list, draw, item.attributes);
}

void GeometryDraws::record(rhi::CommandList& list, rhi::BindGroup frame_group, const std::vector<bool>& visible,
                           rhi::BindGroup closure_group) const {
    std::uint32_t pipeline = ~0u, material = ~0u;
    for (const Item& item : items_) {
        if (visible[item.draw]) record_item(list, item, frame_group, item.pipeline, pipeline, material, closure_group);
    }
}

void GeometryDraws::record_one(rhi::CommandList& list, rhi::BindGroup frame_group, std::uint32_t draw,
                               bool back_faces) const {
    const auto item = std::ranges::find(items_, draw, &Item::draw);
    if (item == items_.end()) return;
    std::uint32_t pipeline = ~0u, material = ~0u;
    if (back_faces) {
        if (item->back_pipeline != ~0u) record_item(list, *item, frame_group, item->back_pipeline, pipeline, material);
    } else {
        record_item(list, *item, frame_group, item->pipeline, pipeline, material);
    }
}

void uses_geometry(PassDeclaration& pass, const RenderContext& context, const GeometryPassDesc& desc,
                   std::span<const std::uint32_t> draws, std::span<const FrameUse> with_any,
                   std::span<const std::vector<bool>> views) {
    const FrameResources& resources = context.resources;
    // Which draws read a resource: the pass reads it in frames in which one of them is seen.
    std::map<std::uint32_t, std::vector<std::uint32_t>> attribute_readers, texture_readers;
    for (const std::uint32_t index : draws) {
        const Draw& draw = context.geometry.draws()[index];
        const bool by_closures = draw.has_closures && !desc.closure_shader.empty();
        const std::uint32_t attributes = features_in(desc, draw).attributes;
        for (std::uint32_t a = 0; a < attribute_count; ++a) {
            if ((attributes & (1u << a)) != 0) attribute_readers[a].push_back(index);
        }
        if (desc.fragment_shader.empty()) continue;
        for (const std::uint32_t texture : by_closures ? context.materials.closure_textures_of(draw.material)
                                                       : context.materials.textures_of(draw.material)) {
            texture_readers[texture].push_back(index);
        }
    }
    const auto any_seen = [&context, views](std::vector<std::uint32_t> readers) {
        return [&context, views, seen = std::move(readers)] {
            const auto in = [&seen](const std::vector<bool>& visible) {
                return std::ranges::any_of(seen, [&](std::uint32_t draw) { return visible[draw]; });
            };
            return views.empty() ? in(context.visible) : std::ranges::any_of(views, in);
        };
    };
    const std::vector<std::uint32_t> all(draws.begin(), draws.end());
    if (all.empty()) return;
    for (const FrameUse& use : with_any) pass.uses(use.buffer, use.use).uses(use.texture, use.use);
    std::size_t added = 0;
    for (const FrameUse& use : with_any) added += (use.buffer ? 1u : 0u) + (use.texture ? 1u : 0u);
    pass.only_if(added, any_seen(all));
    for (std::size_t i = 0; i < resources.geometry.size(); ++i) {
        const SceneGeometry::NamedBuffer& buffer = context.geometry.buffers()[i];
        if (buffer.attribute == ~0u) {
            pass.uses(resources.geometry[i], buffer.use).only_if(1, any_seen(all));
        } else if (const auto readers = attribute_readers.find(buffer.attribute); readers != attribute_readers.end()) {
            pass.uses(resources.geometry[i], buffer.use).only_if(1, any_seen(readers->second));
        }
    }
    if (desc.fragment_shader.empty()) return;
    pass.uses(resources.materials, ResourceUse::uniform_buffer).only_if(1, any_seen(all));
    for (const auto& [texture, readers] : texture_readers) {
        pass.uses(resources.material_textures[texture], ResourceUse::sampled).only_if(1, any_seen(readers));
    }
}

}  // namespace nacre::passes
