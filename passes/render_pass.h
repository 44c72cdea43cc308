// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "passes/frame_graph.h"
#include "passes/profiles.h"
#include "passes/scene_geometry.h"
#include "passes/scene_materials.h"
#include "passes/shader_library.h"

/// @file
/// What all passes share: how the picture is divided into passes for this scene and device (`Decisions`), the textures
/// that they hand on, and the two kinds of pass, drawing and computing.
///
///     class Sky : public RenderPass {
///         Sky(RenderContext& context) { context.graph.add_pass("sky").uses(...).records([this](auto& pass) { ... }); }
///         Expected<void> prepare(RenderContext& context) override { ... makes pipeline and bind group ... }
///     };

namespace nacre::passes {

/// What the scene, the profile and the device come to. Everything that is false here costs nothing.
struct Decisions {
    bool closures = false;               ///< Some deferred surface is stored as closures.
    bool draws_opaque = false, alpha_test = false, blend = false, unlit = false, slab = false;
    bool emission = false;               ///< Some deferred surface emits light.
    bool packed_targets = false;         ///< Emission and blending go through integer targets.
    bool automatic_exposure = false;
    bool filmic = true;
    std::uint32_t light_capacity = 0;    ///< Entries of the light list; 0: no lights.
    std::uint32_t shadow_capacity = 0;   ///< Entries of the list of shadow views; 0: no shadows.
    std::uint32_t shadow_view_count = 0; ///< Layers of the shadow map.
    std::uint32_t shadow_map_size = 0;
    std::uint32_t shadow_filter_width = 1;
    DiffuseModel diffuse_model = DiffuseModel::chan;
    std::uint32_t environment_size = 0, environment_mips = 1;
    rhi::Format lit_format = rhi::Format::rgba16_float;
    rhi::Format depth_format = rhi::Format::d32_float;
};

/// Textures and buffers by the role that they have; ids are empty where a role is not filled.
struct FrameResources {
    TextureId depth, material_0, material_1, top_layer, emission, shadow_maps, lit, tile_classes, final_color;
    BufferId tile_lists, tiles, tile_lists_start, exposure, camera, lights, shadow_cameras, materials, irradiance;
    TextureId environment, interface_table;
    TextureId material_slices;                   ///< Words of stored closures beyond the second.
    std::vector<BufferId> geometry;              ///< As SceneGeometry::buffers().
    std::vector<TextureId> material_textures;    ///< As SceneMaterials::textures().
};

struct RenderContext {
    rhi::Device& device;
    FrameGraph& graph;
    ShaderLibrary& shaders;
    const SceneGeometry& geometry;
    const SceneMaterials& materials;
    const SceneClosures& closures;
    const Profile& profile;
    const Decisions& decisions;
    FrameResources& resources;
    std::uint32_t width = 0, height = 0;
    rhi::BindGroupLayout camera_layout{};    ///< Set 0 with the camera alone.
    rhi::BindGroupLayout lighting_layout{};  ///< Set 0 with camera, lights and environment.
    rhi::BindGroup camera_group{};
    rhi::BindGroup lighting_group{};
    rhi::Sampler nearest{};                  ///< For texelFetch, where a sampler must be bound.
    rhi::Sampler linear{};                   ///< Clamps to the edge, with mips.
    bool write_tile_classes = false;
    std::vector<bool> visible{};             ///< Draws that the camera may see; made anew for each frame.
};

class RenderPass {
  public:
    virtual ~RenderPass() = default;
    /// Makes pipelines and bind groups; called once, after the graph has its textures and if one of the passes that it
    /// declared is live.
    virtual Expected<void> prepare(RenderContext& context) = 0;
    /// Called before each frame is recorded.
    virtual void update(const glm::vec3& viewer) { (void)viewer; }
    /// Draws in a frame, for the plan.
    [[nodiscard]] virtual std::uint64_t draw_count() const { return 0; }
    std::string name;
};

/// A use of a buffer or of a texture.
struct FrameUse {
    BufferId buffer{};
    TextureId texture{};
    rhi::ResourceUse use = rhi::ResourceUse::none;
};

/// What lighting reads.
std::vector<FrameUse> lighting_uses(const FrameResources& resources);
/// States that a pass reads lights, shadows and environment.
void uses_lighting(PassDeclaration& pass, const FrameResources& resources);
/// Defines of passes/shared/lighting.glsl.
std::vector<rhi::ShaderDefine> lighting_defines(const Decisions& decisions);
/// Lists of tiles (passes/tile_classification/tiles.glsl), 16 bytes of arguments each.
[[nodiscard]] constexpr std::uint32_t tile_list_count(bool closures) { return closures ? 5 : 4; }
/// LIT_FORMAT.
rhi::ShaderDefine lit_format_define(const Decisions& decisions);

/// A compute shader with its own bind group.
struct ComputeStep {
    const ShaderLibrary* shaders = nullptr;
    rhi::ReloadableComputePipeline pipeline{};
    rhi::BindGroup group{};
    std::uint32_t group_index = 0;
    /// Set 0 is `context.lighting_group` where `lit`.
    Expected<void> prepare(RenderContext& context, const std::string& pass, const rhi::ShaderSource& source,
                           std::uint32_t set, std::vector<rhi::BindGroupEntry> entries,
                           std::vector<rhi::BindGroupLayout> layouts = {});
    /// Sets the pipeline and the step's own group.
    void bind(rhi::CommandList& list) const;
    void destroy(rhi::Device& device);
};

// One function for each pass folder, in the order of the frame. Each declares its passes in the graph.
std::unique_ptr<RenderPass> make_shadow_maps(RenderContext& context, std::span<const rhi::BindGroup> view_groups,
                                             std::span<const glm::mat4> view_matrices);
std::unique_ptr<RenderPass> make_depth_prepass(RenderContext& context);
std::unique_ptr<RenderPass> make_alpha_test_prepass(RenderContext& context);
std::unique_ptr<RenderPass> make_stencil_prepass(RenderContext& context);
std::unique_ptr<RenderPass> make_base_pass(RenderContext& context);
std::unique_ptr<RenderPass> make_tile_classification(RenderContext& context);
std::unique_ptr<RenderPass> make_lighting(RenderContext& context);
std::unique_ptr<RenderPass> make_sky(RenderContext& context);
std::unique_ptr<RenderPass> make_emission(RenderContext& context);
std::unique_ptr<RenderPass> make_blend(RenderContext& context);
std::unique_ptr<RenderPass> make_exposure(RenderContext& context);
std::unique_ptr<RenderPass> make_tonemap(RenderContext& context);

}  // namespace nacre::passes
