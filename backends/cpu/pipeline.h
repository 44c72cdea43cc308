// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "backends/cpu/bind_group.h"
#include "backends/cpu/compiler/compiler.h"
#include "backends/cpu/raster/rasterizer.h"

namespace nacre::cpu {

class CpuComputePipeline : public rhi::BackendComputePipeline {
  public:
    ComputeProgram program;

    static Expected<std::unique_ptr<rhi::BackendComputePipeline>> create(Compiler& compiler,
                                                                         const rhi::BackendComputePipelineDesc& desc);
};

class CpuGraphicsPipeline : public rhi::BackendGraphicsPipeline {
  public:
    RasterPipeline raster;
    std::string shader_names;  ///< Of vertex and fragment shader, for messages.

    static Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> create(Compiler& compiler,
                                                                          const rhi::BackendGraphicsPipelineDesc& desc);
};

/// For each input of a fragment shader the slot of the vertex shader's output at that place; ~0u where there is none.
std::vector<std::uint32_t> link_inputs(const VertexProgram& vertex, const FragmentProgram& fragment);

}  // namespace nacre::cpu
