// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "passes/custom_kinds.h"
#include "passes/environment_preparation/environment_preparation.h"
#include "passes/hit_materials.h"
#include "passes/hit_shading/hit_shading.h"
#include "passes/lights.h"
#include "passes/profiles.h"
#include "passes/render_pass.h"
#include "passes/renderer.h"

/// @file
/// What a renderer holds, and the steps in which it is made.

namespace nacre::passes {

struct Renderer::State {
    explicit State(rhi::Device& d) : device(d) {}
    ~State() {
        if (!handles_made) return;
        for (const rhi::BindGroup group : shadow_groups) device.destroy(group);
        for (const rhi::BindGroup group : {camera_group, lighting_group}) {
            if (group) device.destroy(group);
        }
        for (const rhi::Buffer buffer : {camera, lights, shadow_cameras, exposure, tile_lists_start}) {
            if (buffer) device.destroy(buffer);
        }
        for (const rhi::Sampler sampler : {nearest, linear}) {
            if (sampler) device.destroy(sampler);
        }
        if (timestamps) device.destroy(timestamps);
    }

    // In this order, once.

    /// Resolves what is needed and possible (renderer_decisions.cpp).
    Expected<void> decide(const scene::Scene& scene);
    /// Makes what several passes read: camera, lights, tables, environment.
    Expected<void> make_shared_objects(const scene::Scene& scene);
    Expected<void> make_passes();
    void make_plan(const scene::Scene& scene);
    TextureId add_target(const char* name, rhi::Format format, std::uint32_t layers = 1, std::uint32_t size = 0);

    rhi::Device& device;
    RenderOptions options;
    const Profile* profile = nullptr;
    Decisions decisions;
    LightSetup light_setup;
    scene::Camera view;
    bool handles_made = false;

    std::unique_ptr<ShaderLibrary> shaders;
    CustomKinds kinds;
    SceneClosures closures;
    std::unique_ptr<SceneGeometry> geometry;
    std::unique_ptr<SceneMaterials> materials;
    std::unique_ptr<HitMaterials> hits;
    std::unique_ptr<PreparedEnvironment> environment;

    rhi::Buffer camera{}, lights{}, shadow_cameras{}, exposure{}, tile_lists_start{};
    rhi::BufferDesc exposure_desc;
    rhi::Sampler nearest{}, linear{};
    rhi::QueryPool timestamps{};
    rhi::BindGroupLayout camera_layout{}, lighting_layout{};
    rhi::BindGroup camera_group{}, lighting_group{};
    std::vector<rhi::BindGroup> shadow_groups;

    // The graph is destroyed after the passes that are recorded by it.
    FrameGraph graph;
    FrameResources resources;
    std::unique_ptr<RenderContext> context;
    std::vector<std::unique_ptr<RenderPass>> passes;
    std::unique_ptr<HitShading> hit_shading;

    Plan plan;
    std::vector<LeftOut> left_out;
    std::vector<std::string> warnings;
    bool has_frame = false;
    double exposure_ev = 0.0;
};

}  // namespace nacre::passes
