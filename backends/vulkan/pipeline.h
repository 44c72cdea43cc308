// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include "backends/vulkan/context.h"

namespace nacre::vulkan {

inline constexpr std::uint32_t max_bind_groups = 8;

/// What binding needs to know of a pipeline of either kind.
struct PipelineCore {
    VkPipeline handle = VK_NULL_HANDLE;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    std::array<const rhi::BackendBindGroupLayout*, max_bind_groups> group_layouts{};
    std::uint32_t group_count = 0;
};

class GraphicsPipeline final : public rhi::BackendGraphicsPipeline {
  public:
    static Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> create(Context& context,
                                                                          const rhi::BackendGraphicsPipelineDesc& desc);
    ~GraphicsPipeline() override;

    PipelineCore core;

  private:
    explicit GraphicsPipeline(Context& context) : context_(context) {}
    Context& context_;
};

class ComputePipeline final : public rhi::BackendComputePipeline {
  public:
    static Expected<std::unique_ptr<rhi::BackendComputePipeline>> create(Context& context,
                                                                         const rhi::BackendComputePipelineDesc& desc);
    ~ComputePipeline() override;

    PipelineCore core;

  private:
    explicit ComputePipeline(Context& context) : context_(context) {}
    Context& context_;
};

}  // namespace nacre::vulkan
