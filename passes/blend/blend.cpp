// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <fmt/format.h>
#include <glm/geometric.hpp>

#include "passes/geometry_draws.h"

/// @file
/// Blend: surfaces of alpha mode BLEND, lit in their fragment shader and laid over the picture from far to near (by the
/// middle of each placed primitive). Where a device cannot blend into float targets, surfaces are gathered into groups
/// that follow each other in depth; each group is drawn into integer targets (its nearest surface wins) and a compute
/// shader lays it over the picture. Left out where nothing blends.

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

class Blend final : public RenderPass {
  public:
    explicit Blend(RenderContext& context)
        : geometry_(context.geometry),
          visible_(context.visible),
          device_(context.device),
          packed_(context.decisions.packed_targets) {
        name = "blend";
        sorted_ = select_draws(context.geometry, [](const Draw& draw) {
            return draw.alpha_mode == materials::AlphaMode::blend;
        });
        desc_ = {.name = name,
                 .vertex_shader = "passes/blend/blend.vert",
                 .fragment_shader = "passes/blend/blend.frag",
                 .defines = lighting_defines(context.decisions),
                 .textures = all_textures,
                 .with_normals = true,
                 .with_colors = true,
                 .keeps_unlit = true,
                 .depth_stencil = {.format = context.decisions.depth_format,
                                   .depth_test = true,
                                   .depth_write = packed_,
                                   .depth_compare = rhi::CompareOperation::greater_or_equal},
                 .frame_layout = context.lighting_layout,
                 .closure_shader = "passes/closures/blend_"};
        desc_.defines.push_back({"HAS_POSITIONS"});
        FrameResources& resources = context.resources;
        if (packed_) {
            desc_.defines.push_back({"PACKED"});
            desc_.color_targets = {{.format = rhi::Format::r32_uint}, {.format = rhi::Format::r32_uint}};
            declare_packed(context);
        } else {
            desc_.color_targets = {{.format = context.decisions.lit_format,
                                    .blend = {.enabled = true,
                                              .source_color = rhi::BlendFactor::one,
                                              .destination_color = rhi::BlendFactor::one_minus_source_alpha,
                                              .source_alpha = rhi::BlendFactor::zero,
                                              .destination_alpha = rhi::BlendFactor::one}}};
            if (context.device.capabilities().dual_source_blending) {
                // What passes through a medium is colored.
                desc_.closure_color_targets = desc_.color_targets;
                desc_.closure_color_targets[0].blend.destination_color = rhi::BlendFactor::source1_color;
                desc_.closure_defines.push_back({"DUAL_SOURCE"});
            }
            PassDeclaration pass = context.graph.add_pass(name);
            pass.uses(resources.lit, ResourceUse::color_target).uses(resources.depth, ResourceUse::depth_stencil_read);
            uses_geometry(pass, context, desc_, sorted_, lighting_uses(resources));
            pass.records([this, lit = resources.lit, depth = resources.depth](PassContext& frame) {
                frame.list.begin_render_pass({.color = {{.view = frame.texture(lit)}},
                                              .depth_stencil = {.view = frame.texture(depth), .read_only = true},
                                              .name = name});
                draw_range(frame.list, 0, sorted_.size());
                frame.list.end_render_pass();
            });
        }
    }
    ~Blend() override {
        for (Group& group : groups_) group.composite.destroy(device_);
    }

    Expected<void> prepare(RenderContext& context) override {
        group_ = context.lighting_group;
        NACRE_CHECK(draws_.prepare(context, desc_, sorted_, true));
        const FrameGraph& graph = context.graph;
        for (Group& group : groups_) {
            NACRE_CHECK(group.composite.prepare(
                context, name,
                {.path = "passes/blend/composite.comp", .defines = {lit_format_define(context.decisions)}}, 0,
                {{.binding = 0, .texture = graph.texture(group.below), .sampler = context.nearest},
                 {.binding = 1, .texture = graph.texture(color_), .sampler = context.nearest},
                 {.binding = 2, .texture = graph.texture(coverage_), .sampler = context.nearest},
                 {.binding = 3, .texture = graph.texture(group.above)}}));
        }
        return {};
    }

    void update(const glm::vec3& viewer) override {
        const auto distance = [&](std::uint32_t draw) {
            const glm::vec3 offset = geometry_.draws()[draw].bounds.center() - viewer;
            return glm::dot(offset, offset);
        };
        std::ranges::stable_sort(sorted_, std::greater<>{}, distance);
        for (Group& group : groups_) {
            group.visible.assign(visible_.size(), false);
            for (std::size_t i = group.first; i < group.last; ++i) group.visible[sorted_[i]] = visible_[sorted_[i]];
        }
    }
    [[nodiscard]] std::uint64_t draw_count() const override { return draws_.size(); }

  private:
    struct Group {
        std::size_t first = 0, last = 0;
        TextureId below, above;
        ComputeStep composite;
        std::vector<bool> visible;  ///< Draws that are in this group and seen, in this frame.
    };

    void draw_range(rhi::CommandList& list, std::size_t first, std::size_t last) const {
        for (std::size_t i = first; i < last; ++i) {
            if (!visible_[sorted_[i]]) continue;
            draws_.record_one(list, group_, sorted_[i], true);
            draws_.record_one(list, group_, sorted_[i], false);
        }
    }

    void declare_packed(RenderContext& context) {
        FrameResources& resources = context.resources;
        rhi::TextureDesc desc{.format = rhi::Format::r32_uint, .width = context.width, .height = context.height};
        desc.name = "blend.color";
        color_ = context.graph.add_texture(desc);
        desc.name = "blend.coverage";
        coverage_ = context.graph.add_texture(desc);
        const std::size_t count = std::min<std::size_t>(sorted_.size(), std::max(context.profile.blend_groups, 1u));
        groups_.resize(count);
        // The picture goes back and forth between two textures.
        desc.format = context.decisions.lit_format;
        desc.name = "lit.2";
        TextureId other = context.graph.add_texture(desc);
        for (std::size_t i = 0; i < count; ++i) {
            Group& group = groups_[i];
            group.first = sorted_.size() * i / count;
            group.last = sorted_.size() * (i + 1) / count;
            group.below = resources.lit;
            group.above = other;
            const std::string suffix = count > 1 ? fmt::format(" {}", i) : "";
            PassDeclaration draw_pass = context.graph.add_pass(name + suffix);
            draw_pass.uses(color_, ResourceUse::color_target)
                .uses(coverage_, ResourceUse::color_target)
                .uses(resources.depth, ResourceUse::depth_stencil_write);
            uses_geometry(draw_pass, context, desc_, sorted_, lighting_uses(resources), {&group.visible, 1});
            draw_pass.records([this, i, depth = resources.depth](PassContext& frame) {
                rhi::ColorAttachment color{.view = frame.texture(color_), .load = rhi::LoadOperation::clear};
                color.clear.uint = {0, 0, 0, 0};
                rhi::ColorAttachment coverage{.view = frame.texture(coverage_), .load = rhi::LoadOperation::clear};
                coverage.clear.uint = {0, 0, 0, 0};
                frame.list.begin_render_pass(
                    {.color = {color, coverage}, .depth_stencil = {.view = frame.texture(depth)}, .name = name});
                draw_range(frame.list, groups_[i].first, groups_[i].last);
                frame.list.end_render_pass();
            });
            context.graph.add_pass("blend composite" + suffix)
                .uses(group.below, ResourceUse::sampled)
                .uses(color_, ResourceUse::sampled)
                .uses(coverage_, ResourceUse::sampled)
                .uses(group.above, ResourceUse::storage_write)
                .records([this, i, x = (context.width + 7) / 8, y = (context.height + 7) / 8](PassContext& frame) {
                    groups_[i].composite.bind(frame.list);
                    frame.list.dispatch({x, y, 1});
                });
            std::swap(resources.lit, other);
        }
    }

    const SceneGeometry& geometry_;
    const std::vector<bool>& visible_;
    rhi::Device& device_;
    bool packed_;
    rhi::BindGroup group_;
    TextureId color_, coverage_;
    GeometryPassDesc desc_;
    std::vector<std::uint32_t> sorted_;
    std::vector<Group> groups_;
    GeometryDraws draws_;
};

}  // namespace

std::unique_ptr<RenderPass> make_blend(RenderContext& context) { return std::make_unique<Blend>(context); }

}  // namespace nacre::passes
