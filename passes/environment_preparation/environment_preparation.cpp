// SPDX-License-Identifier: Apache-2.0
#include "passes/environment_preparation/environment_preparation.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <glm/gtc/packing.hpp>
#include <map>

namespace nacre::passes {

using rhi::ResourceUse;

namespace {

constexpr std::uint32_t irradiance_bytes = 9 * 16;

/// Objects that are needed until the work is submitted.
struct Temporary {
    explicit Temporary(rhi::Device& d) : device(d) {}
    ~Temporary() {
        for (const auto group : groups) device.destroy(group);
        for (const auto& [path, pipeline] : pipelines) device.destroy(pipeline);
        for (const auto sampler : samplers) device.destroy(sampler);
        for (const auto texture : textures) device.destroy(texture);
        if (parameters) device.destroy(parameters);
    }
    rhi::Device& device;
    std::vector<rhi::BindGroup> groups;
    std::map<std::string, rhi::ComputePipeline> pipelines;  // by path; each has one set of defines here
    std::vector<rhi::Sampler> samplers;
    std::vector<rhi::Texture> textures;
    rhi::Buffer parameters{};
};

struct Step {
    rhi::ComputePipeline pipeline;
    rhi::BindGroup group;
};

Expected<Step> make_step(Temporary& temporary, ShaderLibrary& shaders, const std::string& pass,
                         const rhi::ShaderSource& source, std::vector<rhi::BindGroupEntry> entries) {
    Step step;
    NACRE_TRY(const rhi::Shader shader, shaders.shader_for_once(pass, source));
    if (const auto known = temporary.pipelines.find(source.path); known != temporary.pipelines.end()) {
        step.pipeline = known->second;
    } else {
        NACRE_TRY(step.pipeline, temporary.device.create_compute_pipeline({.shader = shader, .name = source.path}));
        temporary.pipelines.emplace(source.path, step.pipeline);
    }
    NACRE_TRY(const rhi::BindGroupLayout layout, temporary.device.bind_group_layout(step.pipeline, 0));
    NACRE_TRY(step.group,
              temporary.device.create_bind_group({.layout = layout, .entries = std::move(entries), .name = pass}));
    temporary.groups.push_back(step.group);
    return step;
}

/// Halves of what is clamped to their range.
std::vector<std::uint64_t> half_floats(const std::vector<glm::vec4>& texels) {
    std::vector<std::uint64_t> halves;
    halves.reserve(texels.size());
    for (const glm::vec4& texel : texels) {
        halves.push_back(glm::packHalf4x16(glm::clamp(texel, glm::vec4(0.0f), glm::vec4(65504.0f))));
    }
    return halves;
}

/// The next mip by a 2 x 2 box. Made here and not by the device: one with the guarantees of OpenGL ES 3.1 only can
/// neither draw into float textures, nor fill their mips, nor sample one mip of a texture while it writes another.
std::vector<glm::vec4> halved(const std::vector<glm::vec4>& texels, const rhi::Extent3D& from,
                              const rhi::Extent3D& to) {
    std::vector<glm::vec4> result;
    result.reserve(std::size_t{to.width} * to.height);
    for (std::uint32_t y = 0; y < to.height; ++y) {
        for (std::uint32_t x = 0; x < to.width; ++x) {
            const std::size_t x0 = std::min(2 * x, from.width - 1), x1 = std::min(2 * x + 1, from.width - 1);
            const std::size_t y0 = std::size_t{std::min(2 * y, from.height - 1)} * from.width;
            const std::size_t y1 = std::size_t{std::min(2 * y + 1, from.height - 1)} * from.width;
            result.push_back(0.25f * (texels[y0 + x0] + texels[y0 + x1] + texels[y1 + x0] + texels[y1 + x1]));
        }
    }
    return result;
}

/// All faces of one mip, as images see them.
rhi::TextureView faces(rhi::Texture cube, std::uint32_t mip) {
    rhi::TextureView view(cube);
    view.dimension = rhi::ViewDimension::cube;
    view.base_mip = mip;
    view.mip_count = 1;
    return view;
}

}  // namespace

std::uint32_t PreparedEnvironment::face_size(std::uint32_t picture_width, std::uint32_t largest_size) {
    return std::clamp(std::bit_ceil(std::max(picture_width / 4, 1u)), 16u, std::bit_floor(std::max(largest_size, 16u)));
}

std::uint32_t PreparedEnvironment::mip_count(std::uint32_t size) {
    return static_cast<std::uint32_t>(std::bit_width(size)) - 2;
}

Expected<std::unique_ptr<PreparedEnvironment>> PreparedEnvironment::create(rhi::Device& device, ShaderLibrary& shaders,
                                                                           const scene::Environment& environment,
                                                                           std::uint32_t largest_size,
                                                                           std::uint32_t samples) {
    auto result = std::unique_ptr<PreparedEnvironment>(new PreparedEnvironment(device));
    Temporary temporary(device);
    const bool present = environment.present();
    const std::uint32_t size = present ? face_size(environment.width, largest_size) : 16;
    const std::uint32_t mips = mip_count(size);

    const std::uint32_t width = present ? environment.width : 1, height = present ? environment.height : 1;
    if (width > device.capabilities().max_texture_2d || height > device.capabilities().max_texture_2d) {
        return fail(ErrorCode::unsupported, "upload environment", fmt::format("'{}'", environment.name),
                    fmt::format("it is {} x {} texels, the device takes at most {}", width, height,
                                device.capabilities().max_texture_2d),
                    "Use a smaller picture.");
    }
    const rhi::TextureDesc picture_desc{.format = rhi::Format::rgba16_float,
                                        .width = width,
                                        .height = height,
                                        .mips = rhi::full_mip_count(width, height),
                                        .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::copy_destination,
                                        .name = "environment picture"};
    NACRE_TRY(const rhi::Texture picture, device.create_texture(picture_desc));
    temporary.textures.push_back(picture);
    std::vector<glm::vec4> texels = present ? environment.texels : std::vector<glm::vec4>(1, glm::vec4(0.0f));
    for (std::uint32_t mip = 0; mip < picture_desc.mips; ++mip) {
        if (mip > 0)
            texels = halved(texels, rhi::mip_extent(picture_desc, mip - 1), rhi::mip_extent(picture_desc, mip));
        const std::vector<std::uint64_t> halves = half_floats(texels);
        NACRE_CHECK(device.write_texture(picture, std::as_bytes(std::span(halves)), mip));
    }

    rhi::TextureDesc source_desc{
        .dimension = rhi::TextureDimension::cube,
        .format = rhi::Format::rgba16_float,
        .width = size,
        .height = size,
        .layers = 6,
        .mips = rhi::full_mip_count(size, size),
        .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::storage | rhi::TextureUsage::copy_source,
        .name = "environment cube"};
    NACRE_TRY(const rhi::Texture source, device.create_texture(source_desc));
    temporary.textures.push_back(source);
    result->cube_desc_ = source_desc;
    result->cube_desc_.mips = mips;
    result->cube_desc_.name = "environment";
    NACRE_TRY(result->cube_, device.create_texture(result->cube_desc_));
    result->irradiance_desc_ = {.size = irradiance_bytes,
                                .usage = rhi::BufferUsage::storage | rhi::BufferUsage::uniform,
                                .name = "irradiance"};
    NACRE_TRY(result->irradiance_, device.create_buffer(result->irradiance_desc_));

    // One parameter block for each step: rotation and intensity, or roughness.
    const std::uint64_t stride = std::max(device.capabilities().uniform_offset_alignment, 16u);
    std::vector<std::byte> blocks(stride * mips);
    for (std::uint32_t mip = 0; mip < mips; ++mip) {
        float values[4] = {mips > 1 ? static_cast<float>(mip) / static_cast<float>(mips - 1) : 0.0f, 0, 0, 0};
        if (mip == 0) values[0] = environment.rotation, values[1] = present ? environment.intensity : 0.0f;
        std::memcpy(blocks.data() + stride * mip, values, sizeof(values));
    }
    NACRE_TRY(temporary.parameters,
              device.create_buffer({.size = blocks.size(),
                                    .usage = rhi::BufferUsage::uniform | rhi::BufferUsage::copy_destination,
                                    .name = "environment parameters"}));
    NACRE_CHECK(device.write_buffer(temporary.parameters, std::span<const std::byte>(blocks)));
    rhi::SamplerDesc around{.address_v = rhi::AddressMode::clamp_to_edge, .name = "environment picture"};
    NACRE_TRY(const rhi::Sampler picture_sampler, device.create_sampler(around));
    temporary.samplers.push_back(picture_sampler);
    around.address_u = around.address_w = rhi::AddressMode::clamp_to_edge;
    around.name = "environment cube";
    NACRE_TRY(const rhi::Sampler cube_sampler, device.create_sampler(around));
    temporary.samplers.push_back(cube_sampler);

    // The functions below refer to what lives in this function only: the graph is recorded here once, then only looked
    // at.
    FrameGraph& graph = result->graph_;
    const TextureId picture_id = graph.import_texture(picture, picture_desc);
    const TextureId source_id = graph.import_texture(source, source_desc);
    const TextureId cube_id = graph.import_texture(result->cube_, result->cube_desc_);
    const BufferId irradiance_id = graph.import_buffer(result->irradiance_, result->irradiance_desc_);
    const BufferId parameters_id =
        graph.import_buffer(temporary.parameters, {.size = blocks.size(), .name = "environment parameters"});
    const auto groups_for = [](std::uint32_t side) {
        return rhi::DispatchArguments{(side + 7) / 8, (side + 7) / 8, 6};
    };

    // Every mip of the source comes from the mip of the picture whose texels are as large; roughness 0 mirrors the
    // first.
    const std::string to_cube = "environment to cube";
    std::vector<Step> conversions;
    for (std::uint32_t mip = 0; mip <= source_desc.mips; ++mip) {
        const rhi::TextureView target = mip < source_desc.mips ? faces(source, mip) : faces(result->cube_, 0);
        NACRE_TRY(conversions.emplace_back(),
                  make_step(temporary, shaders, to_cube,
                            {.path = "passes/environment_preparation/equirectangular_to_cube.comp"},
                            {{.binding = 0, .texture = picture, .sampler = picture_sampler},
                             {.binding = 1, .texture = target},
                             {.binding = 2, .buffer = temporary.parameters, .size = 16}}));
    }
    graph.add_pass(to_cube)
        .uses(picture_id, ResourceUse::sampled)
        .uses(parameters_id, ResourceUse::uniform_buffer)
        .uses(source_id, ResourceUse::storage_write)
        .uses(cube_id, ResourceUse::storage_write)
        .records([&](PassContext& pass) {
            for (std::uint32_t mip = 0; mip <= source_desc.mips; ++mip) {
                pass.list.set_pipeline(conversions[mip].pipeline);
                pass.list.set_bind_group(0, conversions[mip].group);
                pass.list.dispatch(groups_for(mip < source_desc.mips ? std::max(size >> mip, 1u) : size));
            }
        });

    const std::string prefilter = "environment prefiltering";
    std::vector<Step> filters;
    for (std::uint32_t mip = 1; mip < mips; ++mip) {
        NACRE_TRY(filters.emplace_back(),
                  make_step(temporary, shaders, prefilter,
                            {.path = "passes/environment_preparation/prefilter.comp",
                             .defines = {{"SAMPLES", std::to_string(samples)},
                                         {"SOURCE_MIPS", std::to_string(source_desc.mips)}}},
                            {{.binding = 0, .texture = source, .sampler = cube_sampler},
                             {.binding = 1, .texture = faces(result->cube_, mip)},
                             {.binding = 2, .buffer = temporary.parameters, .offset = stride * mip, .size = 16}}));
    }
    graph.add_pass(prefilter)
        .uses(source_id, ResourceUse::sampled)
        .uses(parameters_id, ResourceUse::uniform_buffer)
        .uses(cube_id, ResourceUse::storage_write)
        .records([&](PassContext& pass) {
            for (std::uint32_t mip = 1; mip < mips; ++mip) {
                pass.list.set_pipeline(filters[mip - 1].pipeline);
                pass.list.set_bind_group(0, filters[mip - 1].group);
                pass.list.dispatch(groups_for(size >> mip));
            }
        });

    // The irradiance is so smooth that 32 x 32 texels for each face are plenty.
    const std::string project = "environment irradiance";
    const std::uint32_t source_mip = size > 32 ? static_cast<std::uint32_t>(std::bit_width(size / 32)) - 1 : 0;
    NACRE_TRY(const Step irradiance,
              make_step(temporary, shaders, project,
                        {.path = "passes/environment_preparation/irradiance.comp",
                         .defines = {{"SOURCE_MIP", std::to_string(source_mip)}}},
                        {{.binding = 0, .texture = source, .sampler = cube_sampler},
                         {.binding = 1, .buffer = result->irradiance_}}));
    graph.add_pass(project)
        .uses(source_id, ResourceUse::sampled)
        .uses(irradiance_id, ResourceUse::storage_read | ResourceUse::storage_write)
        .records([&](PassContext& pass) {
            pass.list.set_pipeline(irradiance.pipeline);
            pass.list.set_bind_group(0, irradiance.group);
            pass.list.dispatch({1, 1, 1});
        });

    graph.keep(cube_id);
    graph.keep(irradiance_id);
    NACRE_CHECK(graph.compile());
    rhi::CommandList list = device.create_command_list("environment");
    graph.record(list);
    NACRE_CHECK(list.status());
    NACRE_CHECK(device.submit(std::move(list)));
    return result;
}

PreparedEnvironment::~PreparedEnvironment() {
    if (cube_) device_.destroy(cube_);
    if (irradiance_) device_.destroy(irradiance_);
}

}  // namespace nacre::passes
