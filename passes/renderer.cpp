// SPDX-License-Identifier: Apache-2.0
#include "passes/renderer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <glm/gtc/packing.hpp>
#include <iterator>

#include "core/srgb.h"
#include "passes/camera_block.h"
#include "passes/custom_kinds.h"
#include "passes/environment_preparation/environment_preparation.h"
#include "passes/exact_readback.h"
#include "passes/hit_materials.h"
#include "passes/hit_shading/hit_shading.h"
#include "passes/lights.h"
#include "passes/profiles.h"
#include "passes/render_pass.h"

namespace nacre::passes {

using rhi::FormatSupport;

namespace {

/// Features of slabs that were made not to exist are taken off before anything looks at them.
std::vector<materials::SingleSlab> make_slabs(const scene::Scene& scene, const CustomKinds& kinds, Feature without) {
    std::vector<materials::SingleSlab> slabs;
    slabs.reserve(scene.materials.size());
    for (std::uint32_t i = 0; i < scene.materials.size(); ++i) {
        materials::SingleSlab slab = kinds.kind_of(i) != 0 ? kinds.slab_of(i) : materials::single_slab(scene.materials[i]);
        if (has(without, Feature::emission)) slab.emission = glm::vec3(0.0f), slab.emission_texture = {};
        if (has(without, Feature::alpha_test) && slab.alpha_mode == materials::AlphaMode::mask) {
            slab.alpha_mode = materials::AlphaMode::opaque;
        }
        if (has(without, Feature::blend) && slab.alpha_mode == materials::AlphaMode::blend) {
            slab.alpha_mode = materials::AlphaMode::opaque;
        }
        if (has(without, Feature::unlit)) slab.unlit = false;
        if (has(without, Feature::normal_maps)) slab.normal_texture = {};
        if (has(without, Feature::occlusion)) slab.occlusion_texture = {};
        if (has(without, Feature::specular_textures)) slab.specular_texture = slab.specular_color_texture = {};
        if (has(without, Feature::texture_transforms)) {
            for (materials::TextureReference* texture :
                 {&slab.base_color_texture, &slab.metallic_roughness_texture, &slab.normal_texture,
                  &slab.occlusion_texture, &slab.emission_texture, &slab.specular_texture, &slab.specular_color_texture}) {
                texture->transform = {};
            }
        }
        // A texture of what does not emit would never be read.
        if (slab.emission == glm::vec3(0.0f) || slab.unlit) slab.emission_texture = {};
        slabs.push_back(std::move(slab));
    }
    return slabs;
}

Expected<const scene::Camera*> choose_camera(const scene::Scene& scene, const std::string& name) {
    static const scene::Camera fallback;
    if (name.empty()) return scene.cameras.empty() ? &fallback : &scene.cameras.front();
    if (const scene::Camera* camera = scene::find_camera(scene, name)) return camera;
    std::vector<std::string> names;
    for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
        names.push_back(fmt::format("{} ('{}')", i, scene.cameras[i].name));
    }
    return fail(ErrorCode::not_found, "choose camera", fmt::format("'{}'", name),
                fmt::format("scene '{}' has no camera of that name or number", scene.name),
                fmt::format("Its cameras are {}.", fmt::join(names, ", ")));
}

std::vector<float> floats_of(const std::vector<std::byte>& bytes, rhi::Format format) {
    std::vector<float> values;
    if (format == rhi::Format::rgba32_float) {
        values.resize(bytes.size() / 4);
        std::memcpy(values.data(), bytes.data(), bytes.size());
        return values;
    }
    std::vector<std::uint16_t> halves(bytes.size() / 2);
    std::memcpy(halves.data(), bytes.data(), bytes.size());
    values.reserve(halves.size());
    for (const std::uint16_t half : halves) values.push_back(glm::unpackHalf1x16(half));
    return values;
}

}  // namespace

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

    Expected<void> decide(const scene::Scene& scene);
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

TextureId Renderer::State::add_target(const char* name, rhi::Format format, std::uint32_t layers, std::uint32_t size) {
    return graph.add_texture({.format = format,
                              .width = size > 0 ? size : options.width,
                              .height = size > 0 ? size : options.height,
                              .layers = layers,
                              .name = name});
}

/// Resolves what is needed and possible.
Expected<void> Renderer::State::decide(const scene::Scene& scene) {
    const rhi::Capabilities& capabilities = device.capabilities();
    NACRE_TRY(profile, find_profile(options.profile));
    const auto unsupported = [&](std::string reason, std::string remedy) {
        return fail(ErrorCode::unsupported, "render with profile", fmt::format("'{}'", profile->name), std::move(reason),
                    std::move(remedy));
    };
    if (options.width == 0 || options.height == 0 || options.width > capabilities.max_texture_2d ||
        options.height > capabilities.max_texture_2d || options.width > 65535 * 8 || options.height > 65535 * 8) {
        return fail(ErrorCode::invalid_argument, "render", fmt::format("a picture of {} x {}", options.width, options.height),
                    fmt::format("both sides must be 1 to {} pixels on this device", capabilities.max_texture_2d),
                    "Choose another size.");
    }
    if (capabilities.max_color_targets < 3) {
        return unsupported(fmt::format("the G-buffer needs 3 color targets, the device has {}", capabilities.max_color_targets),
                           "Use another device.");
    }
    if (capabilities.max_storage_buffers[2] < 2 || capabilities.max_storage_images[2] < 1) {
        return unsupported("tiled lighting needs 2 storage buffers and 1 storage image in compute shaders, which the device "
                           "does not have",
                           "Use another device.");
    }

    NACRE_TRY(kinds, CustomKinds::choose(scene));
    const auto slabs = make_slabs(scene, kinds, options.without);
    const bool colors = !has(options.without, Feature::vertex_colors);
    if (!has(options.without, Feature::closures)) {
        NACRE_TRY(closures, SceneClosures::choose(scene, *profile, profile->storage_in_fragment && capabilities.storage_in_fragment,
                                                  warnings));
    }
    NACRE_TRY(geometry, SceneGeometry::create(device, scene, slabs, closures, kinds, all_textures, colors));
    std::vector<bool> used(slabs.size());
    std::uint32_t textures = 0;
    std::uint32_t blended = 0;
    bool transforms = false, vertex_colors = false;
    for (const Draw& draw : geometry->draws()) {
        used[draw.material] = true;
        textures |= draw.features.textures;
        transforms |= draw.features.transforms;
        vertex_colors |= (draw.features.attributes & attribute_bit(Attribute::color)) != 0;
        if (draw.alpha_mode == materials::AlphaMode::blend) {
            decisions.blend = true;
            ++blended;
            continue;
        }
        decisions.alpha_test |= draw.alpha_mode == materials::AlphaMode::mask;
        decisions.draws_opaque = true;
        decisions.emission |= draw.emits;
        decisions.closures |= draw.has_closures && closures.find(draw.material)->layout.storage_class !=
                                                       materials::StorageClass::simple;
        (draw.features.unlit ? decisions.unlit : decisions.slab) = true;
    }
    const float anisotropy = capabilities.anisotropic_filtering
                                 ? std::min(static_cast<float>(profile->texture_anisotropy), capabilities.max_anisotropy)
                                 : 1.0f;
    NACRE_TRY(materials, SceneMaterials::create(device, scene, slabs, closures, kinds, used, all_textures, anisotropy));

    // Float targets, where the profile wants them and the device has them.
    const bool wants_32 = profile->float32_lit_color;
    decisions.lit_format = rhi::Format::rgba16_float;
    if (wants_32 && capabilities.supports(rhi::Format::rgba32_float, FormatSupport::storage_image | FormatSupport::blended)) {
        decisions.lit_format = rhi::Format::rgba32_float;
    } else if (wants_32) {
        warnings.push_back("the device cannot blend into 32-bit float targets: the lit color has 16 bits");
    }
    if (!capabilities.supports(decisions.lit_format, FormatSupport::storage_image | FormatSupport::sampled)) {
        return unsupported("the device cannot write rgba16_float images in compute shaders", "Use another device.");
    }
    decisions.packed_targets =
        !profile->float_color_targets || !capabilities.float_color_targets ||
        !capabilities.supports(decisions.lit_format, FormatSupport::color_target | FormatSupport::blended);
    if (decisions.emission) {
        decisions.depth_format = capabilities.supports(rhi::Format::d32_float_s8_uint, FormatSupport::depth_target)
                                     ? rhi::Format::d32_float_s8_uint
                                     : rhi::Format::d24_unorm_s8_uint;
    }
    decisions.automatic_exposure = !options.exposure_ev && !has(options.without, Feature::automatic_exposure);
    decisions.filmic = options.tone_mapping == ToneMapping::filmic;

    // Lights matter to lit surfaces only.
    const bool lit_surfaces = std::ranges::any_of(geometry->draws(), [](const Draw& draw) { return !draw.features.unlit; });
    if (lit_surfaces && !has(options.without, Feature::lights)) {
        light_setup = set_up_lights(scene.lights, geometry->bounds(), *profile, !has(options.without, Feature::shadows));
        warnings.insert(warnings.end(), light_setup.warnings.begin(), light_setup.warnings.end());
    }
    decisions.light_capacity = list_capacity(light_setup.lights.size());
    decisions.shadow_view_count = static_cast<std::uint32_t>(light_setup.shadow_views.size());
    decisions.shadow_capacity = list_capacity(light_setup.shadow_views.size());
    decisions.shadow_map_size = light_setup.shadow_map_size;
    decisions.shadow_filter_width = profile->shadow_filter_width;
    decisions.diffuse_model = profile->diffuse_model;

    const auto leave_out = [&](bool needed, const char* what, const char* why) {
        if (!needed) left_out.push_back({what, why});
    };
    leave_out(decisions.alpha_test, "alpha test prepass", "no material has alpha mode MASK");
    leave_out(decisions.emission, "stencil prepass, emission pass, stencil part of the depth target", "no surface emits light");
    leave_out(decisions.blend, "blend pass", "no material has alpha mode BLEND");
    leave_out(decisions.unlit, "lighting shaders for unlit and mixed tiles", "no surface is unlit");
    leave_out(decisions.closures, "lighting shader for closures, slices of material words",
              "no deferred surface has more than one plain slab");
    leave_out(decisions.slab, "lighting shader for slabs", "no deferred surface is lit");
    leave_out(decisions.light_capacity > 0, "light list", "no light reaches a lit surface");
    leave_out(decisions.shadow_view_count > 0, "shadow maps", "no light casts shadows on a lit surface");
    leave_out(decisions.automatic_exposure, "exposure metering", "the exposure is given");
    leave_out(vertex_colors, "vertex colors", "no primitive has them");
    leave_out(transforms, "texture transforms", "no texture is moved");
    leave_out((textures & texture_bit(TextureSlot::normal)) != 0, "normal maps, tangents", "no material has a normal map");
    leave_out((textures & texture_bit(TextureSlot::occlusion)) != 0, "occlusion maps", "no material has one");
    leave_out((textures & (texture_bit(TextureSlot::specular) | texture_bit(TextureSlot::specular_color))) != 0,
              "specular maps", "no material has one");
    leave_out(!decisions.packed_targets, "blending into float targets",
              profile->float_color_targets ? "the device cannot: integer targets and compute shaders do its work"
                                           : "the profile does without: integer targets and compute shaders do its work");
    if (decisions.blend && decisions.packed_targets && blended > profile->blend_groups) {
        warnings.push_back(fmt::format("{} blended surfaces share {} groups: where two of a group overlap, only the nearer one shows",
                                       blended, profile->blend_groups));
    }
    return {};
}

/// What several passes read: camera, lights, tables, environment.
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
    if (materials->block()) resources.materials = graph.import_buffer(materials->block(), {.size = 1, .name = "materials"}, true);
    for (const rhi::Texture texture : materials->textures()) {
        NACRE_TRY(const rhi::TextureDesc desc, device.describe(texture));
        resources.material_textures.push_back(graph.import_texture(texture, desc, true));
    }
    resources.interface_table = resources.material_textures[materials->table_place(0)];

    // Set 0: the camera alone, and everything that lighting reads.
    const auto vertex = rhi::ShaderStage::vertex, fragment = rhi::ShaderStage::fragment, compute = rhi::ShaderStage::compute;
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
    context = std::make_unique<RenderContext>(RenderContext{device, graph, *shaders, *geometry, *materials, closures, *profile,
                                                            decisions, resources});
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
    if (decisions.emission && decisions.packed_targets) resources.emission = add_target("emission", rhi::Format::r32_uint);
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
    if (decisions.shadow_view_count > 0) passes.push_back(make_shadow_maps(*context, shadow_groups, light_setup.shadow_views));
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
        NACRE_TRY(timestamps, device.create_query_pool({.type = rhi::QueryType::timestamp, .count = 2 * live, .name = "passes"}));
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
        plan.resources.push_back({.name = node.desc.name,
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

Renderer::Renderer(std::unique_ptr<State> state) : state_(std::move(state)) {}
Renderer::~Renderer() = default;

Expected<std::unique_ptr<Renderer>> Renderer::create(rhi::Device& device, const scene::Scene& scene,
                                                     const RenderOptions& options) {
    auto state = std::make_unique<State>(device);
    state->options = options;
    NACRE_TRY(const scene::Camera* camera, choose_camera(scene, options.camera));
    state->view = *camera;
    if (!options.shader_folder.empty()) NACRE_CHECK(ShaderLibrary::check_folder(options.shader_folder));
    NACRE_CHECK(state->decide(scene));
    NACRE_CHECK(state->make_shared_objects(scene));
    NACRE_CHECK(state->make_passes());
    state->make_plan(scene);
    // The caller's objects are not looked at again.
    state->options.environment = nullptr;
    return std::unique_ptr<Renderer>(new Renderer(std::move(state)));
}

std::vector<rhi::PipelineReload> Renderer::reload_shaders() { return state_->shaders->reload_changed(); }

void Renderer::set_camera(const scene::Camera& camera) { state_->view = camera; }

Expected<FrameStatistics> Renderer::render_frame() {
    State& state = *state_;
    const auto start = std::chrono::steady_clock::now();
    const CameraBlock camera = camera_block(state.view, state.options.width, state.options.height);
    NACRE_CHECK(state.device.write_buffer(state.camera, std::as_bytes(std::span(&camera, 1))));
    NACRE_CHECK(state.materials->update());
    state.context->visible = state.geometry->visible_in(camera.view_projection);
    for (const std::unique_ptr<RenderPass>& pass : state.passes) pass->update(glm::vec3(camera.position));
    rhi::CommandList list = state.device.create_command_list("frame");
    state.graph.record(list, state.timestamps);
    if (state.hit_shading) NACRE_CHECK(state.hit_shading->record(list));
    NACRE_CHECK(list.status());
    NACRE_TRY(const rhi::Fence fence, state.device.submit(std::move(list)));
    NACRE_CHECK(state.device.wait(fence));
    FrameStatistics statistics;
    statistics.frame_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    state.has_frame = true;

    std::vector<std::uint64_t> times;
    std::uint32_t live = 0;
    for (const FrameGraph::Pass& pass : state.graph.passes()) live += pass.is_live ? 1 : 0;
    if (state.timestamps) {
        NACRE_TRY(times, state.device.read_queries(state.timestamps, 0, 2 * live));
    }
    live = 0;
    for (const FrameGraph::Pass& pass : state.graph.passes()) {
        if (!pass.is_live) continue;
        const double ms = times.empty() ? 0.0
                                        : static_cast<double>(static_cast<std::int64_t>(times[2 * live + 1] - times[2 * live])) * 1e-6;
        statistics.passes.push_back({pass.name, ms});
        ++live;
    }
    const rhi::MemoryStatistics memory = state.device.memory_statistics();
    statistics.memory_bytes = memory.buffer_bytes + memory.texture_bytes;
    if (state.decisions.automatic_exposure) {
        NACRE_TRY(const auto bytes, state.device.read_buffer(state.exposure));
        float multiplier = 1.0f;
        std::memcpy(&multiplier, bytes.data(), sizeof(multiplier));
        state.exposure_ev = multiplier > 0.0f ? std::log2(multiplier) : 0.0;
    } else {
        state.exposure_ev = state.options.exposure_ev.value_or(0.0f);
    }
    statistics.exposure_ev = state.exposure_ev;
    return statistics;
}

Expected<FinalPicture> Renderer::read_final() {
    State& state = *state_;
    if (!state.has_frame) {
        return fail(ErrorCode::invalid_argument, "read picture", "", "no frame has been rendered", "Call render_frame first.");
    }
    FinalPicture picture;
    NACRE_TRY(const auto bytes, state.device.read_texture(state.graph.texture(state.resources.final_color)));
    picture.tone_mapped = {.width = state.options.width, .height = state.options.height, .channels = 4};
    picture.tone_mapped.bytes.resize(bytes.size());
    std::memcpy(picture.tone_mapped.bytes.data(), bytes.data(), bytes.size());

    NACRE_TRY(const auto lit, state.device.read_texture(state.graph.texture(state.resources.lit)));
    const std::vector<float> values = floats_of(lit, state.decisions.lit_format);
    const std::size_t count = std::size_t{state.options.width} * state.options.height;
    picture.radiance = {.width = state.options.width, .height = state.options.height, .channels = 3};
    picture.exposed = picture.radiance;
    picture.radiance.pixels.resize(3 * count);
    picture.exposed.pixels.resize(3 * count);
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t c = 0; c < 3; ++c) {
            picture.radiance.pixels[3 * i + c] = values[4 * i + c];
            picture.exposed.pixels[3 * i + c] = linear_from_srgb_byte(picture.tone_mapped.bytes[4 * i + c]);
        }
    }
    return picture;
}

std::vector<IntermediateDescription> Renderer::intermediates() const {
    std::vector<IntermediateDescription> result;
    const FrameGraph& graph = state_->graph;
    for (std::uint32_t i = 0; i < graph.textures().size(); ++i) {
        const FrameGraph::TextureNode& node = graph.textures()[i];
        if (!node.is_live() || node.is_detail) continue;
        // Tables come from outside and are the same for everybody; the environment is made here.
        if (node.imported && TextureId{i} != state_->resources.environment) continue;
        result.push_back({.name = node.desc.name,
                          .format = node.desc.format,
                          .width = node.desc.width,
                          .height = node.desc.height,
                          .layers = node.desc.layers,
                          .mips = node.desc.mips,
                          .written_by = node.imported ? "environment preparation" : graph.writers_of({i}),
                          .fields = fields_of(node.desc.name),
                          .is_readable = node.imported || node.kept || node.unshared});
    }
    return result;
}

/// Where a texture lies that `read_intermediate` can read.
Expected<rhi::Texture> Renderer::find_intermediate(std::string_view name, std::uint32_t layer, std::uint32_t mip,
                                                   IntermediateDescription& description) const {
    const auto known = intermediates();
    const auto found = std::ranges::find(known, name, &IntermediateDescription::name);
    if (found == known.end()) {
        std::vector<std::string> names;
        for (const IntermediateDescription& one : known) names.push_back(one.name);
        return fail(ErrorCode::not_found, "read intermediate texture", fmt::format("'{}'", name),
                    "no pass of this plan writes a texture of that name",
                    fmt::format("There are {}.", fmt::join(names, ", ")));
    }
    if (!found->is_readable || !state_->has_frame) {
        return fail(ErrorCode::invalid_argument, "read intermediate texture", fmt::format("'{}'", name),
                    found->is_readable ? "no frame has been rendered" : "its memory may hold something else by now",
                    "Ask for it in RenderOptions::keep and render a frame.");
    }
    if (layer >= found->layers || mip >= found->mips) {
        return fail(ErrorCode::invalid_argument, "read intermediate texture", fmt::format("'{}'", name),
                    fmt::format("it has {} layers and {} mips", found->layers, found->mips), "Count from 0.");
    }
    description = *found;
    const auto& nodes = state_->graph.textures();
    const auto node = std::ranges::find_if(
        nodes, [&](const FrameGraph::TextureNode& n) { return n.desc.name == name && n.is_live() && !n.is_detail; });
    return node->handle;
}

Expected<IntermediateContent> Renderer::read_intermediate(std::string_view name, std::uint32_t layer,
                                                          std::uint32_t mip) {
    IntermediateContent content;
    NACRE_TRY(const rhi::Texture texture, find_intermediate(name, layer, mip, content.description));
    content.width = std::max(content.description.width >> mip, 1u);
    content.height = std::max(content.description.height >> mip, 1u);
    NACRE_TRY(content.bytes, state_->device.read_texture(texture, mip, layer));
    return content;
}

Expected<IntermediateContent> Renderer::read_hits(std::string_view name, std::uint32_t layer) {
    const rhi::Texture texture = state_->hit_shading ? state_->hit_shading->texture(name) : rhi::Texture{};
    if (!state_->hit_shading || !state_->has_frame) {
        return fail(ErrorCode::invalid_argument, "read shaded hits", fmt::format("'{}'", name),
                    state_->hit_shading ? "no frame has been rendered" : "hits are not shaded",
                    "Set RenderOptions::shade_hits and render a frame.");
    }
    if (!texture) {
        return fail(ErrorCode::not_found, "read shaded hits", fmt::format("'{}'", name), "there is nothing of that name",
                    "There are material.0, material.1, top_layer, albedo, emission, and material.slices where closures need it.");
    }
    NACRE_TRY(const rhi::TextureDesc desc, state_->device.describe(texture));
    if (layer >= desc.layers) {
        return fail(ErrorCode::invalid_argument, "read shaded hits", fmt::format("'{}'", name),
                    fmt::format("it has {} layers", desc.layers), "Count from 0.");
    }
    IntermediateContent content;
    content.description = {.name = std::string(name), .format = desc.format, .width = desc.width, .height = desc.height,
                           .layers = desc.layers, .written_by = "hit shading", .fields = fields_of(name), .is_readable = true};
    content.width = desc.width;
    content.height = desc.height;
    NACRE_TRY(content.bytes, state_->device.read_texture(texture, 0, layer));
    return content;
}

Expected<std::vector<double>> Renderer::read_exact_intermediate(std::string_view name, std::uint32_t layer,
                                                                std::uint32_t mip) {
    IntermediateDescription description;
    NACRE_TRY(const rhi::Texture texture, find_intermediate(name, layer, mip, description));
    return read_exactly(state_->device, texture, mip, layer);
}

const Plan& Renderer::plan() const { return state_->plan; }
std::string Renderer::graph_as_dot() const { return state_->graph.to_dot(); }
std::string Renderer::graph_as_svg() const { return state_->graph.to_svg(); }
const std::vector<std::string>& Renderer::warnings() const { return state_->warnings; }

}  // namespace nacre::passes
