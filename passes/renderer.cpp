// SPDX-License-Identifier: Apache-2.0
#include "passes/renderer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <glm/gtc/packing.hpp>

#include "core/srgb.h"
#include "passes/camera_block.h"
#include "passes/exact_readback.h"
#include "passes/renderer_state.h"

namespace nacre::passes {

namespace {

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
        const double ms =
            times.empty()
                ? 0.0
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
        return fail(ErrorCode::invalid_argument, "read picture", "", "no frame has been rendered",
                    "Call render_frame first.");
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
        return fail(ErrorCode::not_found, "read shaded hits", fmt::format("'{}'", name),
                    "there is nothing of that name",
                    "There are material.0, material.1, top_layer, albedo, emission, and material.slices where closures "
                    "need it.");
    }
    NACRE_TRY(const rhi::TextureDesc desc, state_->device.describe(texture));
    if (layer >= desc.layers) {
        return fail(ErrorCode::invalid_argument, "read shaded hits", fmt::format("'{}'", name),
                    fmt::format("it has {} layers", desc.layers), "Count from 0.");
    }
    IntermediateContent content;
    content.description = {.name = std::string(name),
                           .format = desc.format,
                           .width = desc.width,
                           .height = desc.height,
                           .layers = desc.layers,
                           .written_by = "hit shading",
                           .fields = fields_of(name),
                           .is_readable = true};
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
