// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "passes/render_pass.h"

/// @file
/// How passes draw the scene's geometry: what a pass asks of it, pipelines for the kinds of draws that there are, and
/// what drawing them reads.

namespace nacre::passes {

/// How a pass draws geometry.
struct GeometryPassDesc {
    std::string name;
    std::string vertex_shader;
    std::string fragment_shader;            ///< Empty: depth only, without materials.
    std::vector<rhi::ShaderDefine> defines; ///< For both shaders.
    std::uint32_t textures = 0;             ///< Which textures the fragment shader reads (texture_bit).
    bool with_normals = false, with_colors = false;
    bool keeps_unlit = false;               ///< The fragment shader distinguishes UNLIT.
    rhi::DepthStencilState depth_stencil;
    std::vector<rhi::ColorTargetState> color_targets;
    rhi::BindGroupLayout frame_layout;      ///< Of set 0.
    /// Fragment shader of materials that are shaded by closures: "passes/closures/base_pass_" for base_pass_N.frag, N
    /// the topology. Empty: the pass draws them as plain slabs.
    std::string closure_shader;
    std::vector<rhi::ShaderDefine> closure_defines;           ///< For those shaders alone.
    std::vector<rhi::ColorTargetState> closure_color_targets; ///< Of those shaders; empty: as color_targets.
    rhi::BindGroupLayout closure_layout{};  ///< Of set 2 of those shaders, where they write slices of material words.
    bool culls = true;                      ///< Back faces of one-sided materials are not drawn.
};

/// The draws of one pass with their pipelines, in an order with few changes.
class GeometryDraws {
  public:
    GeometryDraws() = default;
    GeometryDraws(const GeometryDraws&) = delete;
    GeometryDraws& operator=(const GeometryDraws&) = delete;

    /// `draws`: indices into the geometry's draws; their order is kept when `keep_order`.
    Expected<void> prepare(RenderContext& context, const GeometryPassDesc& desc, std::vector<std::uint32_t> draws,
                           bool keep_order = false);
    /// Records the draws that are visible (by index of the geometry's draws). The groups are those of sets 0 and 2.
    void record(rhi::CommandList& list, rhi::BindGroup frame_group, const std::vector<bool>& visible,
                rhi::BindGroup closure_group = {}) const;
    void record_one(rhi::CommandList& list, rhi::BindGroup frame_group, std::uint32_t draw, bool back_faces) const;
    [[nodiscard]] std::uint64_t size() const { return items_.size(); }

  private:
    struct Item {
        std::uint32_t draw = 0;
        std::uint32_t pipeline = 0;
        std::uint32_t back_pipeline = ~0u;
        std::uint32_t attributes = 0;
        bool by_closures = false;
    };
    void record_item(rhi::CommandList& list, const Item& item, rhi::BindGroup frame_group, std::uint32_t pipeline,
                     std::uint32_t& bound_pipeline, std::uint32_t& bound_material,
                     rhi::BindGroup closure_group = {}) const;

    const ShaderLibrary* shaders_ = nullptr;
    const SceneGeometry* geometry_ = nullptr;
    const SceneMaterials* materials_ = nullptr;
    bool uses_materials_ = false;
    std::vector<rhi::ReloadableGraphicsPipeline> pipelines_;
    std::vector<bool> has_closure_group_;
    std::vector<Item> items_;
};

/// Indices of the draws for which `predicate` holds.
template <typename Predicate>
std::vector<std::uint32_t> select_draws(const SceneGeometry& geometry, Predicate&& predicate) {
    std::vector<std::uint32_t> result;
    for (std::uint32_t i = 0; i < geometry.draws().size(); ++i) {
        if (predicate(geometry.draws()[i])) result.push_back(i);
    }
    return result;
}

/// States what drawing these draws in a pass of this description reads, and `with_any` of them (the camera); in a frame
/// only as far as the camera, or one of `views` where there are some, sees the draws. The context and the views outlive
/// the graph's recording.
void uses_geometry(PassDeclaration& pass, const RenderContext& context, const GeometryPassDesc& desc,
                   std::span<const std::uint32_t> draws, std::span<const FrameUse> with_any,
                   std::span<const std::vector<bool>> views = {});

}  // namespace nacre::passes
