// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/pipeline.h"

#include <fmt/format.h>

#include <algorithm>
#include <new>

namespace nacre::cpu {
namespace {

ShaderSource source_of(const rhi::BackendShader& shader, std::span<const rhi::SpecializationConstant> constants,
                       std::span<const BindingSlots> slots) {
    return {.spirv = shader.spirv,
            .entry_point = shader.entry_point,
            .name = shader.name,
            .reflection = &shader.reflection,
            .specialization = constants,
            .slots = slots};
}

KeptShader kept(const rhi::BackendShader& shader, std::span<const rhi::SpecializationConstant> constants,
                std::span<const BindingSlots> slots) {
    return {{shader.spirv.begin(), shader.spirv.end()}, shader.entry_point,           shader.name,
            {constants.begin(), constants.end()},       {slots.begin(), slots.end()}, {}};
}

std::unexpected<Error> out_of_memory(const std::string& name) {
    return fail(ErrorCode::out_of_memory, "create pipeline", fmt::format("'{}'", name),
                "the memory ran out while its shaders were compiled", "Free other resources.");
}

}  // namespace

Expected<std::unique_ptr<rhi::BackendComputePipeline>> CpuComputePipeline::create(
    Compiler& compiler, const rhi::BackendComputePipelineDesc& desc) try {
    const std::vector<BindingSlots> slots = slots_of(desc.layouts);
    auto pipeline = std::make_unique<CpuComputePipeline>();
    NACRE_TRY(pipeline->program, compiler.compile_compute(source_of(*desc.shader, desc.desc->specialization, slots)));
    pipeline->shader_ = kept(*desc.shader, desc.desc->specialization, slots);
    return pipeline;
} catch (const std::bad_alloc&) {
    return out_of_memory(desc.desc->name);
}

ShaderSource KeptShader::source(TraceTable* trace) const {
    return {.spirv = spirv,
            .entry_point = entry_point,
            .name = name,
            .specialization = constants,
            .slots = slots,
            .trace = trace};
}

const ComputeProgram* CpuComputePipeline::traced(Compiler& compiler) {
    if (traced_) return traced_.get();
    auto made = compiler.compile_compute(shader_.source(&shader_.table));
    if (made) traced_ = std::make_unique<ComputeProgram>(*std::move(made));
    return traced_.get();
}

const RasterPipeline* CpuGraphicsPipeline::traced(Compiler& compiler) {
    if (traced_ || fragment_shader_.spirv.empty()) return traced_.get();
    auto made = compiler.compile_fragment(fragment_shader_.source(&fragment_shader_.table));
    if (!made) return nullptr;
    traced_ = std::make_unique<RasterPipeline>(raster);
    traced_->fragment = *std::move(made);
    return traced_.get();
}

std::vector<std::uint32_t> link_inputs(const VertexProgram& vertex, const FragmentProgram& fragment) {
    std::vector<std::uint32_t> slots;
    slots.reserve(fragment.inputs.size());
    for (const FragmentInput& input : fragment.inputs) {
        const auto output = std::ranges::find_if(vertex.outputs, [&](const VertexOutput& candidate) {
            return candidate.location == input.location && candidate.component == input.component;
        });
        slots.push_back(output == vertex.outputs.end() ? ~0u : output->slot);
    }
    return slots;
}

Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> CpuGraphicsPipeline::create(
    Compiler& compiler, const rhi::BackendGraphicsPipelineDesc& desc) try {
    const rhi::GraphicsPipelineDesc& wish = *desc.desc;
    const std::vector<BindingSlots> slots = slots_of(desc.layouts);
    auto pipeline = std::make_unique<CpuGraphicsPipeline>();
    RasterPipeline& raster = pipeline->raster;
    NACRE_TRY(raster.vertex,
              compiler.compile_vertex(source_of(*desc.vertex, wish.specialization, slots),
                                      {.attributes = wish.vertex_attributes, .buffers = wish.vertex_buffers}));
    pipeline->shader_names = fmt::format("'{}'", desc.vertex->name);
    if (desc.fragment) {
        NACRE_TRY(raster.fragment, compiler.compile_fragment(source_of(*desc.fragment, wish.specialization, slots)));
        raster.input_slots = link_inputs(raster.vertex, raster.fragment);
        pipeline->fragment_shader_ = kept(*desc.fragment, wish.specialization, slots);
        pipeline->shader_names += fmt::format(" with '{}'", desc.fragment->name);
    }
    raster.topology = wish.topology;
    raster.cull = wish.cull;
    raster.front_face = wish.front_face;
    raster.fill = wish.fill;
    raster.samples = wish.samples;
    raster.alpha_to_coverage = wish.alpha_to_coverage;
    raster.depth_stencil = wish.depth_stencil;
    raster.color_targets = wish.color_targets;
    return pipeline;
} catch (const std::bad_alloc&) {
    return out_of_memory(desc.desc->name);
}

}  // namespace nacre::cpu
