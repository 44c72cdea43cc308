// SPDX-License-Identifier: Apache-2.0
#include "passes/hit_shading/hit_shading.h"

#include <algorithm>

namespace nacre::passes {
namespace {

constexpr std::uint64_t point_bytes = 128;  // SurfacePoint in passes/hit_shading/surface_point.glsl

}  // namespace

Expected<std::unique_ptr<HitShading>> HitShading::create(RenderContext& context, HitMaterials& hits,
                                                         rhi::Buffer camera) {
    rhi::Device& device = context.device;
    if (!device.capabilities().storage_in_fragment) {
        return fail(ErrorCode::unsupported, "shade hits", "what the camera sees",
                    "the device has no storage buffers in fragment shaders (storage_in_fragment)",
                    "Leave RenderOptions::shade_hits off, or use another device.");
    }
    auto result = std::unique_ptr<HitShading>(new HitShading(context, hits));
    const std::uint32_t width = context.width, height = context.height;
    NACRE_TRY(result->points_, device.create_buffer({.size = point_bytes * width * height,
                                                     .usage = rhi::BufferUsage::storage,
                                                     .name = "surface points"}));
    const auto add = [&](std::string_view name, std::uint32_t binding, rhi::Format format,
                         std::uint32_t layers) -> Expected<void> {
        Output& output = result->outputs_.emplace_back(Output{name, binding});
        NACRE_TRY(output.texture,
                  device.create_texture({.format = format,
                                         .width = width,
                                         .height = height,
                                         .layers = layers,
                                         .usage = rhi::TextureUsage::storage | rhi::TextureUsage::copy_source,
                                         .name = "hit " + std::string(name)}));
        return {};
    };
    NACRE_CHECK(add("material.0", 3, rhi::Format::r32_uint, 1));
    NACRE_CHECK(add("material.1", 4, rhi::Format::r32_uint, 1));
    NACRE_CHECK(add("top_layer", 5, rhi::Format::r32_uint, 1));
    NACRE_CHECK(add("albedo", 6, rhi::Format::rgba32_float, 1));
    NACRE_CHECK(add("emission", 7, rhi::Format::rgba32_float, 1));
    const SceneClosures::Lighting& stored = context.closures.lighting();
    if (stored.slices > 0) NACRE_CHECK(add("material.slices", 8, rhi::Format::r32_uint, stored.slices));

    NACRE_TRY(
        result->points_layout_,
        device.create_bind_group_layout({.bindings = {{.binding = 0,
                                                       .type = rhi::BindingType::uniform_buffer,
                                                       .stages = rhi::ShaderStage::vertex | rhi::ShaderStage::fragment},
                                                      {.binding = 1,
                                                       .type = rhi::BindingType::storage_buffer,
                                                       .stages = rhi::ShaderStage::fragment}},
                                         .name = "surface points"}));
    NACRE_TRY(result->points_group_, device.create_bind_group({.layout = result->points_layout_,
                                                               .entries = {{.binding = 0, .buffer = camera},
                                                                           {.binding = 1, .buffer = result->points_}},
                                                               .name = "surface points"}));
    const GeometryPassDesc desc = {.name = "surface points",
                                   .vertex_shader = "passes/hit_shading/surface_points.vert",
                                   .fragment_shader = "passes/hit_shading/surface_points.frag",
                                   .defines = {{"HAS_POSITIONS"}, {"PICTURE_WIDTH", std::to_string(width)}},
                                   .textures = all_textures & ~texture_bit(TextureSlot::emission),
                                   .with_normals = true,
                                   .with_colors = true,
                                   .depth_stencil = {.format = context.decisions.depth_format,
                                                     .depth_test = true,
                                                     .depth_compare = rhi::CompareOperation::equal},
                                   .frame_layout = result->points_layout_,
                                   .closure_shader = "passes/closures/surface_points_"};
    NACRE_CHECK(result->draws_.prepare(context, desc, select_draws(context.geometry, [](const Draw& draw) {
                                           return draw.alpha_mode != materials::AlphaMode::blend;
                                       })));

    result->depth_ = context.graph.texture(context.resources.depth);
    rhi::ShaderSource source{.path = "passes/hit_shading/hit_shading.comp",
                             .defines = hits.defines(TextureDetail::differentials)};
    if (stored.slices > 0) source.defines.push_back({"MATERIAL_SLICES", std::to_string(stored.slices)});
    if (stored.has_subsurface) source.defines.push_back({"SUBSURFACE_SLICE", std::to_string(stored.slices - 1)});
    std::vector<rhi::BindGroupEntry> entries = {{.binding = 0, .buffer = camera},
                                                {.binding = 1, .buffer = result->points_},
                                                {.binding = 2, .texture = result->depth_, .sampler = context.nearest}};
    for (const Output& output : result->outputs_)
        entries.push_back({.binding = output.binding, .texture = output.texture});
    NACRE_CHECK(result->step_.prepare(context, "hit shading", source, 0, entries));
    return result;
}

HitShading::~HitShading() {
    rhi::Device& device = context_.device;
    step_.destroy(device);
    if (points_group_) device.destroy(points_group_);
    for (const Output& output : outputs_) {
        if (output.texture) device.destroy(output.texture);
    }
    if (points_) device.destroy(points_);
}

Expected<void> HitShading::record(rhi::CommandList& list) {
    list.begin_render_pass({.depth_stencil = {.view = depth_, .read_only = true}, .name = "surface points"});
    draws_.record(list, points_group_, context_.visible);
    list.end_render_pass();
    step_.bind(list);
    NACRE_CHECK(hits_.bind(list, step_.shaders->get(step_.pipeline)));
    list.dispatch({(context_.width + 7) / 8, (context_.height + 7) / 8, 1});
    return {};
}

rhi::Texture HitShading::texture(std::string_view name) const {
    const auto found = std::ranges::find(outputs_, name, &Output::name);
    return found == outputs_.end() ? rhi::Texture{} : found->texture;
}

}  // namespace nacre::passes
