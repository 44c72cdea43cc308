// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>

#include "passes/camera_block.h"
#include "passes/renderer_state.h"

/// @file
/// Makes what the passes of a renderer share, the passes themselves, and the plan that tells of them.

namespace nacre::passes {

TextureId Renderer::State::add_target(const char* name, rhi::Format format, std::uint32_t layers, std::uint32_t size) {
    return graph.add_texture({.format = format,
                              .width = size > 0 ? size : options.width,
                              .height = size > 0 ? size : options.height,
                              .layers = layers,
                              .name = name});
}

Expected<void> Renderer::State::make_shared_objects(const scene::Scene& scene) {
    handles_made = true;
    std::vector<EmbeddedFile> made = closures.files();
    std::ranges::copy(kinds.files(), std::back_inserter(made));
    if (options.shade_hits) {
        NACRE_TRY(hits, HitMaterials::create(device, *materials, closures, kinds));
        made.push_back(hits->file());
    }
    shaders = std::make_unique<ShaderLibrary>(device, options.cache, options.shader_folder, std::move(made));
    const scene::Environment& sky = options.environment != nullptr ? *options.environment : scene.environment;
    NACRE_TRY(environment, PreparedEnvironment::create(device, *shaders, sky, profile->environment_size,
                                                       profile->environment_samples));
    decisions.environment_size = environment->cube_desc().width;
    decisions.environment_mips = environment->cube_desc().mips;

    NACRE_TRY(nearest, device.create_sampler({.magnify = rhi::Filter::nearest,
                                              .minify = rhi::Filter::nearest,
                                              .mip = rhi::Filter::nearest,
                                              .address_u = rhi::AddressMode::clamp_to_edge,
                                              .address_v = rhi::AddressMode::clamp_to_edge,
                                              .address_w = rhi::AddressMode::clamp_to_edge,
                                              .name = "nearest"}));
    NACRE_TRY(linear, device.create_sampler({.address_u = rhi::AddressMode::clamp_to_edge,
                                             .address_v = rhi::AddressMode::clamp_to_edge,
                                             .address_w = rhi::AddressMode::clamp_to_edge,
                                             .name = "linear"}));

    const auto uniform = rhi::BufferUsage::uniform | rhi::BufferUsage::copy_destination;
    const rhi::BufferDesc camera_desc{.size = sizeof(CameraBlock), .usage = uniform, .name = "camera"};
    NACRE_TRY(camera, device.create_buffer(camera_desc));
    rhi::BufferDesc lights_desc{.usage = uniform, .name = "lights"};
    if (decisions.light_capacity > 0) {
        const auto block = light_block(light_setup, decisions.light_capacity, decisions.shadow_capacity);
        lights_desc.size = block.size();
        NACRE_TRY(lights, device.create_buffer(lights_desc));
        NACRE_CHECK(device.write_buffer(lights, std::span<const std::byte>(block)));
    }
    const std::uint64_t alignment = std::max(device.capabilities().uniform_offset_alignment, 16u);
    const std::uint64_t stride = (sizeof(CameraBlock) + alignment - 1) / alignment * alignment;
    rhi::BufferDesc shadow_desc{.size = stride * decisions.shadow_view_count, .usage = uniform, .name = "shadow views"};
    if (decisions.shadow_view_count > 0) {
        std::vector<std::byte> blocks(shadow_desc.size);
        for (std::uint32_t i = 0; i < decisions.shadow_view_count; ++i) {
            const CameraBlock block = matrix_block(light_setup.shadow_views[i]);
            std::memcpy(blocks.data() + stride * i, &block, sizeof(block));
        }
        NACRE_TRY(shadow_cameras, device.create_buffer(shadow_desc));
        NACRE_CHECK(device.write_buffer(shadow_cameras, std::span<const std::byte>(blocks)));
    }
    exposure_desc = {.size = 16,
                     .usage = uniform | rhi::BufferUsage::copy_source,
                     .name = "exposure"};
    if (decisions.automatic_exposure) exposure_desc.usage |= rhi::BufferUsage::storage;
    NACRE_TRY(exposure, device.create_buffer(exposure_desc));
    const float multiplier = std::exp2(std::clamp(options.exposure_ev.value_or(0.0f), -32.0f, 32.0f));
    const float exposure_values[4] = {multiplier, 0.0f, 0.0f, 0.0f};
    NACRE_CHECK(device.write_buffer(exposure, std::as_bytes(std::span(exposure_values))));
    // Arguments of empty dispatches: 0 x 0 x 1 groups, and the length 0.
    const std::vector<glm::uvec4> no_groups(tile_list_count(decisions.closures), glm::uvec4(0, 0, 1, 0));
    const rhi::BufferDesc start_desc{.size = no_groups.size() * sizeof(glm::uvec4),
                                     .usage = rhi::BufferUsage::copy_source | rhi::BufferUsage::copy_destination,
                                     .name = "empty tile lists"};
    NACRE_TRY(tile_lists_start, device.create_buffer(start_desc));
    NACRE_CHECK(device.write_buffer(tile_lists_start, std::as_bytes(std::span(no_groups))));

    // Imports, in the order in which the graph's picture shows them.
    if (decisions.shadow_view_count > 0) resources.shadow_cameras = graph.import_buffer(shadow_cameras, shadow_desc);
    resources.camera = graph.import_buffer(camera, camera_desc);
    if (lights) resources.lights = graph.import_buffer(lights, lights_desc);
    resources.irradiance = graph.import_buffer(environment->irradiance(), environment->irradiance_desc());
    resources.exposure = graph.import_buffer(exposure, exposure_desc);
    resources.tile_lists_start = graph.import_buffer(tile_lists_start, start_desc, true);
    resources.environment = graph.import_texture(environment->cube(), environment->cube_desc());
    for (const SceneGeometry::NamedBuffer& buffer : geometry->buffers()) {
        resources.geometry.push_back(graph.import_buffer(buffer.buffer, buffer.desc, true));
    }
    if (materials->block())
        resources.materials = graph.import_buffer(materials->block(), {.size = 1, .name = "materials"}, true);
    for (const rhi::Texture texture : materials->textures()) {
        NACRE_TRY(const rhi::TextureDesc desc, device.describe(texture));
        resources.material_textures.push_back(graph.import_texture(texture, desc, true));
    }
    resources.interface_table = resources.material_textures[materials->table_place(0)];

    // Set 0: the camera alone, and everything that lighting reads.
    const auto vertex = rhi::ShaderStage::vertex, fragment = rhi::ShaderStage::fragment,
               compute = rhi::ShaderStage::compute;
    std::vector<rhi::BindingLayout> bindings = {{0, rhi::BindingType::uniform_buffer, 1, vertex | fragment | compute}};
    std::vector<rhi::BindGroupEntry> entries = {{.binding = 0, .buffer = camera}};
    NACRE_TRY(camera_layout, device.create_bind_group_layout({.bindings = bindings, .name = "camera"}));
    NACRE_TRY(camera_group, device.create_bind_group({.layout = camera_layout, .entries = entries, .name = "camera"}));
    for (std::uint32_t i = 0; i < decisions.shadow_view_count; ++i) {
        NACRE_TRY(shadow_groups.emplace_back(),
                  device.create_bind_group({.layout = camera_layout,
                                            .entries = {{.binding = 0,
                                                         .buffer = shadow_cameras,
                                                         .offset = stride * i,
                                                         .size = sizeof(CameraBlock)}},
                                            .name = fmt::format("shadow view {}", i)}));
    }
    if (lights) bindings.push_back({1, rhi::BindingType::uniform_buffer, 1, fragment | compute});
    bindings.push_back({2, rhi::BindingType::uniform_buffer, 1, fragment | compute});
    bindings.push_back({3, rhi::BindingType::combined_texture_sampler, 1, fragment | compute});
    bindings.push_back({4, rhi::BindingType::combined_texture_sampler, 1, fragment | compute});
    if (decisions.shadow_view_count > 0) {
        bindings.push_back({5, rhi::BindingType::combined_texture_sampler, 1, fragment | compute});
    }
    NACRE_TRY(lighting_layout, device.create_bind_group_layout({.bindings = bindings, .name = "light"}));
    return {};
}

Expected<void> Renderer::State::make_passes() {
    context = std::make_unique<RenderContext>(
        RenderContext{device, graph, *shaders, *geometry, *materials, closures, *profile, decisions, resources});
    context->width = options.width;
    context->height = options.height;
    context->camera_layout = camera_layout;
    context->lighting_layout = lighting_layout;
    context->camera_group = camera_group;
    context->nearest = nearest;
    context->linear = linear;
    const bool keeps_classes = options.keep_intermediates || std::ranges::count(options.keep, "tile_classes") > 0;
    context->write_tile_classes = keeps_classes;

    const std::uint32_t tiles_x = (options.width + 7) / 8, tiles_y = (options.height + 7) / 8;
    if (decisions.shadow_view_count > 0) {
        resources.shadow_maps = add_target("shadow_maps", rhi::Format::d32_float, decisions.shadow_view_count,
                                           decisions.shadow_map_size);
    }
    resources.depth = add_target("depth", decisions.depth_format);
    resources.material_0 = add_target("material.0", rhi::Format::r32_uint);
    resources.material_1 = add_target("material.1", rhi::Format::r32_uint);
    resources.top_layer = add_target("top_layer", rhi::Format::r32_uint);
    if (decisions.closures && closures.lighting().slices > 0) {
        resources.material_slices = add_target("material.slices", rhi::Format::r32_uint, closures.lighting().slices);
    }
    if (decisions.emission && decisions.packed_targets)
        resources.emission = add_target("emission", rhi::Format::r32_uint);
    if (keeps_classes) {
        resources.tile_classes = graph.add_texture(
            {.format = rhi::Format::r32_uint, .width = tiles_x, .height = tiles_y, .name = "tile_classes"});
    }
    resources.lit = add_target("lit", decisions.lit_format);
    resources.final_color = add_target("final", rhi::Format::rgba8_unorm);
    const std::uint64_t list_count = tile_list_count(decisions.closures);
    resources.tile_lists = graph.add_buffer({.size = 16 * list_count, .name = "tile lists"});
    resources.tiles = graph.add_buffer({.size = 4 * list_count * tiles_x * tiles_y, .name = "tiles"});

    // The group of set 0 needs the shadow maps, which the graph makes; passes take it from the context in `prepare`.
    if (decisions.shadow_view_count > 0)
        passes.push_back(make_shadow_maps(*context, shadow_groups, light_setup.shadow_views));
    passes.push_back(make_depth_prepass(*context));
    if (decisions.alpha_test) passes.push_back(make_alpha_test_prepass(*context));
    if (decisions.emission) passes.push_back(make_stencil_prepass(*context));
    passes.push_back(make_base_pass(*context));
    passes.push_back(make_tile_classification(*context));
    if (decisions.emission && decisions.packed_targets) passes.push_back(make_emission(*context));
    if (decisions.slab || decisions.unlit) passes.push_back(make_lighting(*context));
    passes.push_back(make_sky(*context));
    if (decisions.emission && !decisions.packed_targets) passes.push_back(make_emission(*context));
    if (decisions.blend) passes.push_back(make_blend(*context));
    if (decisions.automatic_exposure) passes.push_back(make_exposure(*context));
    passes.push_back(make_tonemap(*context));

    graph.keep(resources.final_color);
    graph.keep(resources.lit);
    if (resources.tile_classes) graph.keep(resources.tile_classes);
    for (std::uint32_t i = 0; i < graph.textures().size(); ++i) {
        const FrameGraph::TextureNode& node = graph.textures()[i];
        if (node.imported) continue;
        if (options.keep_intermediates || std::ranges::count(options.keep, node.desc.name) > 0) graph.do_not_share({i});
    }
    if (options.shade_hits) graph.do_not_share(resources.depth);
    NACRE_CHECK(graph.compile());
    NACRE_CHECK(graph.realize(device));

    std::vector<rhi::BindGroupEntry> entries = {{.binding = 0, .buffer = camera}};
    if (lights) entries.push_back({.binding = 1, .buffer = lights});
    entries.push_back({.binding = 2, .buffer = environment->irradiance()});
    entries.push_back({.binding = 3, .texture = materials->table(0), .sampler = nearest});
    entries.push_back({.binding = 4, .texture = environment->cube(), .sampler = linear});
    if (decisions.shadow_view_count > 0) {
        entries.push_back({.binding = 5, .texture = graph.texture(resources.shadow_maps), .sampler = nearest});
    }
    NACRE_TRY(lighting_group,
              device.create_bind_group({.layout = lighting_layout, .entries = entries, .name = "light"}));
    context->lighting_group = lighting_group;

    for (const std::unique_ptr<RenderPass>& pass : passes) NACRE_CHECK(pass->prepare(*context));
    if (options.shade_hits) {
        NACRE_TRY(hit_shading, HitShading::create(*context, *hits, camera));
    }

    if (device.capabilities().timestamps) {
        const auto live = static_cast<std::uint32_t>(
            std::ranges::count_if(graph.passes(), [](const FrameGraph::Pass& pass) { return pass.is_live; }));
        NACRE_TRY(timestamps,
                  device.create_query_pool({.type = rhi::QueryType::timestamp, .count = 2 * live, .name = "passes"}));
    }
    return {};
}

void Renderer::State::make_plan(const scene::Scene& scene) {
    plan.scene = scene.name;
    plan.profile = profile->name;
    plan.backend = device.adapter().backend;
    plan.device = device.adapter().name;
    plan.width = options.width;
    plan.height = options.height;
    plan.left_out = left_out;
    plan.gbuffer_bytes_per_pixel = 12 + (decisions.closures ? 4 * closures.lighting().slices : 0);
    plan.geometry_bytes = geometry->bytes();
    plan.texture_bytes = materials->texture_bytes();
    plan.transient_bytes = graph.transient_bytes();
    plan.transient_bytes_unshared = graph.transient_bytes_unshared();

    const auto add_graph = [&](const FrameGraph& source) {
        for (const FrameGraph::Pass& pass : source.passes()) {
            if (!pass.is_live) continue;
            PlannedPass planned{.name = pass.name};
            for (const FrameGraph::Access& access : pass.accesses) {
                const bool detail = access.is_texture ? source.textures()[access.resource].is_detail
                                                      : source.buffers()[access.resource].is_detail;
                if (detail) continue;
                const std::string& name = access.is_texture ? source.textures()[access.resource].desc.name
                                                            : source.buffers()[access.resource].desc.name;
                auto& names = rhi::has_any(access.use, rhi::writing_uses) ? planned.writes : planned.reads;
                if (std::ranges::find(names, name) == names.end()) names.push_back(name);
            }
            planned.shaders = shaders->shaders_of(pass.name);
            for (const std::unique_ptr<RenderPass>& owner : passes) {
                if (owner->name == pass.name) planned.draws = owner->draw_count();
                // Passes that one module repeats are numbered; their shaders are noted once.
                if (planned.shaders.empty() && pass.name.starts_with(owner->name + " ")) {
                    planned.shaders = shaders->shaders_of(owner->name);
                }
            }
            plan.passes.push_back(std::move(planned));
        }
    };
    add_graph(environment->graph());
    add_graph(graph);
    for (const FrameGraph::TextureNode& node : graph.textures()) {
        if (!node.is_live() || node.is_detail) continue;
        plan.resources.push_back(
            {.name = node.desc.name,
             .format = std::string(rhi::info(node.desc.format).name),
             .width = node.desc.width,
             .height = node.desc.height,
             .layers = node.desc.layers,
             .mips = node.desc.mips,
             .bytes = node.bytes,
             .shares_with = node.shares_with == ~0u ? "" : graph.textures()[node.shares_with].desc.name,
             .persistent = node.imported});
        if (node.imported) plan.persistent_bytes += node.bytes;
    }
    for (const FrameGraph::BufferNode& node : graph.buffers()) {
        if (!node.is_live() || node.is_detail) continue;
        plan.resources.push_back({.name = node.desc.name, .bytes = node.desc.size, .persistent = node.imported});
        if (node.imported) plan.persistent_bytes += node.desc.size;
    }
}

}  // namespace nacre::passes
