// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <set>

#include "benchmarks/cpu/bench.h"
#include "passes/renderer.h"
#include "passes/shader_library.h"
#include "rhi/reflection.h"
#include "scene/load.h"

/// @file
/// Compiling: every shader of a frame of builtin:spheres, from the creation of its pipeline to the end of the first
/// work that uses it, less the same work once more. (Drivers put off part of the work to the first use.) No caches;
/// each round has a new device. Resources are small and hold zeros, so that the work itself is next to nothing.

namespace nacre::bench {
namespace {

/// The stages of one pipeline, as SPIR-V with what they declare.
struct Program {
    std::string name;
    std::vector<rhi::ShaderDesc> stages;  ///< Compute; or vertex and perhaps fragment.
    std::vector<rhi::ShaderReflection> reflections;
};

/// Shaders of all passes of a frame, each pipeline once.
Expected<std::vector<Program>> programs_of(rhi::Device& device, const std::string& scene_name) {
    NACRE_TRY(const scene::Scene scene, scene::load_scene(scene_name));
    NACRE_TRY(const auto renderer, passes::Renderer::create(device, scene, {.width = 256, .height = 256}));
    passes::ShaderLibrary library(device, nullptr, {});
    std::vector<Program> programs;
    std::set<std::string> known;
    for (const passes::PlannedPass& pass : renderer->plan().passes) {
        // Vertex shaders come before the fragment shaders that they are used with.
        Program program;
        std::string key;
        const auto finish = [&] {
            if (!program.stages.empty() && known.insert(key).second) programs.push_back(std::move(program));
            program = {};
            key.clear();
        };
        for (const passes::PlannedShader& shader : pass.shaders) {
            if (!shader.path.ends_with(".frag")) finish();
            NACRE_TRY(rhi::ShaderDesc desc,
                      library.compile(pass.name, {.path = shader.path, .defines = shader.defines}));
            NACRE_TRY(rhi::ShaderReflection reflection, rhi::reflect(desc.spirv, desc.stage));
            program.name += (program.name.empty() ? "" : " + ") + shader.path.substr(shader.path.rfind('/') + 1);
            key += fmt::format("{} {:x};", shader.path, shader.spirv_hash);
            program.stages.push_back(std::move(desc));
            program.reflections.push_back(std::move(reflection));
        }
        finish();
    }
    return programs;
}

/// Resources that fit whatever a program declares.
class Resources {
  public:
    static Expected<std::unique_ptr<Resources>> create(rhi::Device& device) {
        auto resources = std::make_unique<Resources>(device);
        NACRE_TRY(resources->buffer_,
                  device.create_buffer({.size = 65536,
                                        .usage = rhi::BufferUsage::uniform | rhi::BufferUsage::storage |
                                                 rhi::BufferUsage::vertex | rhi::BufferUsage::copy_destination,
                                        .name = "zeros"}));
        const std::vector<std::byte> zeros(65536);
        NACRE_CHECK(device.write_buffer(resources->buffer_, std::span<const std::byte>(zeros)));
        NACRE_TRY(resources->sampler_, device.create_sampler({.magnify = rhi::Filter::nearest,
                                                                    .minify = rhi::Filter::nearest,
                                                                    .mip = rhi::Filter::nearest,
                                                                    .name = "sampler"}));
        return resources;
    }
    explicit Resources(rhi::Device& device) : device_(device) {}

    [[nodiscard]] rhi::Buffer buffer() const { return buffer_; }

    Expected<rhi::Texture> target(rhi::Format format) {
        return texture(format, rhi::TextureDimension::d2, 1,
                       rhi::info(format).has_depth ? rhi::TextureUsage::depth_target : rhi::TextureUsage::color_target);
    }

    Expected<rhi::BindGroupEntry> entry(const rhi::ReflectedBinding& binding) {
        rhi::BindGroupEntry entry{.binding = binding.binding};
        switch (binding.type) {
            case rhi::BindingType::uniform_buffer:
            case rhi::BindingType::storage_buffer:
            case rhi::BindingType::readonly_storage_buffer: entry.buffer = buffer_; return entry;
            case rhi::BindingType::sampler: entry.sampler = sampler_; return entry;
            default: break;
        }
        if (binding.type == rhi::BindingType::combined_texture_sampler) entry.sampler = sampler_;
        const bool is_storage = binding.type == rhi::BindingType::storage_image ||
                                binding.type == rhi::BindingType::readonly_storage_image ||
                                binding.type == rhi::BindingType::writeonly_storage_image;
        rhi::Format format = binding.image_format;
        if (format == rhi::Format::undefined)
            format = binding.sampled_kind == rhi::FormatKind::uint ? rhi::Format::r32_uint : rhi::Format::rgba16_float;
        using rhi::ViewDimension;
        const bool is_cube = binding.dimension == ViewDimension::cube || binding.dimension == ViewDimension::cube_array;
        const bool is_array = binding.dimension == ViewDimension::d2_array;
        NACRE_TRY(const rhi::Texture made,
                  texture(format, is_cube ? rhi::TextureDimension::cube : rhi::TextureDimension::d2,
                          is_cube ? 6u : (is_array ? 2u : 1u),
                          is_storage ? rhi::TextureUsage::storage : rhi::TextureUsage::sampled));
        entry.texture = made;
        entry.texture.dimension = binding.dimension;
        return entry;
    }

  private:
    Expected<rhi::Texture> texture(rhi::Format format, rhi::TextureDimension dimension, std::uint32_t layers,
                                   rhi::TextureUsage usage) {
        return device_.create_texture({.dimension = dimension,
                                       .format = format,
                                       .width = 16,
                                       .height = 16,
                                       .layers = layers,
                                       .usage = usage,
                                       .name = "small"});
    }

    rhi::Device& device_;
    rhi::Buffer buffer_{};
    rhi::Sampler sampler_{};
};

/// A program's layouts and bind groups, which exist before its pipeline does.
struct Bound {
    std::vector<rhi::BindGroupLayout> layouts;
    std::vector<rhi::BindGroup> groups;
    std::uint32_t push_constant_bytes = 0;
};

Expected<Bound> bind(rhi::Device& device, Resources& resources, const Program& program) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::pair<rhi::ReflectedBinding, rhi::ShaderStage>> all;
    Bound bound;
    std::uint32_t sets = 0;
    for (const rhi::ShaderReflection& reflection : program.reflections) {
        bound.push_constant_bytes = std::max(bound.push_constant_bytes, reflection.push_constant_bytes);
        for (const rhi::ReflectedBinding& binding : reflection.bindings) {
            auto& [known, stages] = all[{binding.set, binding.binding}];
            known = binding;
            stages |= reflection.stage;
            sets = std::max(sets, binding.set + 1);
        }
    }
    for (std::uint32_t set = 0; set < sets; ++set) {
        rhi::BindGroupLayoutDesc layout{.name = program.name};
        rhi::BindGroupDesc group{.name = program.name};
        for (const auto& [place, value] : all) {
            if (place.first != set) continue;
            const auto& [binding, stages] = value;
            layout.bindings.push_back(
                {.binding = binding.binding, .type = binding.type, .count = binding.count, .stages = stages});
            NACRE_TRY(rhi::BindGroupEntry entry, resources.entry(binding));
            for (entry.element = 0; entry.element < binding.count; ++entry.element) group.entries.push_back(entry);
        }
        NACRE_TRY(group.layout, device.create_bind_group_layout(layout));
        bound.layouts.push_back(group.layout);
        NACRE_TRY(const rhi::BindGroup made, device.create_bind_group(group));
        bound.groups.push_back(made);
    }
    return bound;
}

Expected<std::vector<rhi::Shader>> make_shaders(rhi::Device& device, const Program& program) {
    std::vector<rhi::Shader> shaders;
    for (const rhi::ShaderDesc& desc : program.stages) {
        NACRE_TRY(const rhi::Shader shader, device.create_shader(desc));
        shaders.push_back(shader);
    }
    return shaders;
}

/// First use less second use of one program on a device that has never seen it.
Expected<double> time_program(rhi::Device& device, Resources& resources, const Program& program) {
    NACRE_TRY(const Bound bound, bind(device, resources, program));
    const bool is_compute = program.stages.front().stage == rhi::ShaderStage::compute;
    rhi::GraphicsPipelineDesc desc{.bind_group_layouts = bound.layouts, .name = program.name};
    rhi::RenderPassDesc targets{.name = program.name};
    if (!is_compute) {
        desc.vertex_buffers = {{.stride = 16}};
        for (const rhi::ReflectedVariable& input : program.reflections.front().inputs) {
            const rhi::Format formats[] = {rhi::Format::r32_float, rhi::Format::rg32_float, rhi::Format::rgb32_float,
                                           rhi::Format::rgba32_float};
            desc.vertex_attributes.push_back({.location = input.location, .format = formats[input.components - 1]});
        }
        if (program.reflections.size() > 1) {
            for (const rhi::ReflectedVariable& output : program.reflections[1].outputs) {
                const rhi::Format format =
                    output.kind == rhi::FormatKind::uint ? rhi::Format::r32_uint : rhi::Format::rgba16_float;
                desc.color_targets.push_back({.format = format});
                NACRE_TRY(const rhi::Texture target, resources.target(format));
                targets.color.push_back({.view = target, .load = rhi::LoadOperation::clear});
            }
        }
        desc.depth_stencil = {.format = rhi::Format::d32_float,
                              .depth_test = true,
                              .depth_write = true,
                              .depth_compare = rhi::CompareOperation::greater_or_equal};
        NACRE_TRY(targets.depth_stencil.view.texture, resources.target(rhi::Format::d32_float));
        targets.depth_stencil.depth_load = rhi::LoadOperation::clear;
        targets.depth_stencil.clear_depth = 0.0f;
    }
    const std::vector<std::byte> push(bound.push_constant_bytes);
    NACRE_CHECK(device.wait_idle());

    rhi::GraphicsPipeline graphics;
    rhi::ComputePipeline compute;
    const auto use = [&](rhi::CommandList& list) {
        const auto state = [&] {
            for (std::uint32_t i = 0; i < bound.groups.size(); ++i) list.set_bind_group(i, bound.groups[i]);
            if (!push.empty()) list.set_push_constants(std::span<const std::byte>(push));
        };
        if (is_compute) {
            list.set_pipeline(compute);
            state();
            list.dispatch({});
            return;
        }
        list.begin_render_pass(targets);
        list.set_pipeline(graphics);
        state();
        list.set_vertex_buffer(0, resources.buffer());
        list.draw({.vertex_count = 3});
        list.end_render_pass();
    };
    NACRE_TRY(const double first, time_ms([&]() -> Expected<void> {
                  NACRE_TRY(const std::vector<rhi::Shader> shaders, make_shaders(device, program));
                  if (is_compute) {
                      NACRE_TRY(compute, device.create_compute_pipeline({.shader = shaders.front(),
                                                                         .bind_group_layouts = bound.layouts,
                                                                         .name = program.name}));
                  } else {
                      desc.vertex = shaders.front();
                      if (shaders.size() > 1) desc.fragment = shaders[1];
                      NACRE_TRY(graphics, device.create_graphics_pipeline(desc));
                  }
                  NACRE_CHECK(time_submission(device, use));
                  return {};
              }));
    NACRE_TRY(const double second, time_submission(device, use));
    return std::max(first - second, 0.0);
}

/// All programs on a new device, one after another.
Expected<double> time_programs(const Bench& bench, const std::string& spec, std::span<const Program> programs) {
    NACRE_TRY(const auto device, bench.new_device(spec));
    NACRE_TRY(const auto resources, Resources::create(*device));
    double sum = 0.0;
    for (const Program& program : programs) {
        NACRE_TRY(const double ms, time_program(*device, *resources, program));
        sum += ms;
    }
    return sum;
}

}  // namespace

Expected<void> run_compile(Bench& bench) {
    if (!bench.has_device("vulkan")) return {};
    // The time may be 1.5 times that of the driver.
    constexpr double target = 1.0 / 1.5;
    NACRE_TRY(rhi::Device * device, bench.device("vulkan"));
    NACRE_TRY(const std::vector<Program> programs, programs_of(*device, "builtin:spheres"));
    const auto case_of = [&](const std::string& name, std::span<const Program> part) {
        Case work{.name = name, .target = target};
        for (const std::uint32_t lanes : bench.lane_counts())
            work.cpu.push_back({.name = "cpu", .lanes = lanes, .run = [&bench, lanes, part] {
                                    return time_programs(bench, cpu_spec(lanes), part);
                                }});
        work.references.push_back(
            {.name = "vulkan", .run = [&bench, part] { return time_programs(bench, "vulkan", part); }});
        return work;
    };
    NACRE_CHECK(bench.measure(case_of("compile_all", programs)));
    if (bench.options().quick) return {};
    for (const Program& program : programs)
        NACRE_CHECK(bench.measure(case_of("compile " + program.name, std::span(&program, 1))));
    return {};
}

}  // namespace nacre::bench
