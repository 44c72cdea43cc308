// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "backends/cpu/bind_group.h"
#include "backends/cpu/compiler/compiler.h"
#include "backends/cpu/raster/rasterizer.h"

namespace nacre::cpu {

/// A shader as it was given, to be compiled once more where it is traced.
struct KeptShader {
    std::vector<std::uint32_t> spirv;
    std::string entry_point, name;
    std::vector<rhi::SpecializationConstant> constants;
    std::vector<BindingSlots> slots;
    TraceTable table;
    [[nodiscard]] ShaderSource source(TraceTable* trace) const;
};

class CpuComputePipeline : public rhi::BackendComputePipeline {
  public:
    ComputeProgram program;

    /// The program that tells what it computes; null where it cannot be compiled.
    const ComputeProgram* traced(Compiler& compiler);

    static Expected<std::unique_ptr<rhi::BackendComputePipeline>> create(Compiler& compiler,
                                                                         const rhi::BackendComputePipelineDesc& desc);

  private:
    KeptShader shader_;
    std::unique_ptr<ComputeProgram> traced_;
};

class CpuGraphicsPipeline : public rhi::BackendGraphicsPipeline {
  public:
    RasterPipeline raster;
    std::string shader_names;  ///< Of vertex and fragment shader, for messages.

    /// The same with a fragment shader that tells what it computes; null where there is none.
    const RasterPipeline* traced(Compiler& compiler);

    static Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> create(Compiler& compiler,
                                                                          const rhi::BackendGraphicsPipelineDesc& desc);

  private:
    KeptShader fragment_shader_;
    std::unique_ptr<RasterPipeline> traced_;
};

/// For each input of a fragment shader the slot of the vertex shader's output at that place; ~0u where there is none.
std::vector<std::uint32_t> link_inputs(const VertexProgram& vertex, const FragmentProgram& fragment);

}  // namespace nacre::cpu
