// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "backends/vulkan/commands.h"
#include "backends/vulkan/context.h"

namespace nacre::vulkan {

/// Modes of a backend spec, from the newest way of Vulkan to the oldest.
enum class Mode : std::uint8_t {
    automatic,    ///< Dynamic rendering and synchronization2 where the driver has them.
    render_pass,  ///< VkRenderPass objects in any case.
    legacy,       ///< These, and the barriers of Vulkan 1.0.
};

class Device final : public rhi::BackendDevice {
  public:
    static Expected<std::unique_ptr<rhi::BackendDevice>> create(std::shared_ptr<const Instance> instance, Mode mode,
                                                                const rhi::BackendDeviceDesc& desc);
    ~Device() override;

    [[nodiscard]] const rhi::AdapterInfo& adapter() const override { return adapter_; }
    [[nodiscard]] const rhi::Capabilities& capabilities() const override { return context_.capabilities; }

    Expected<std::unique_ptr<rhi::BackendBuffer>> create_buffer(const rhi::BufferDesc& desc) override;
    Expected<std::unique_ptr<rhi::BackendTexture>> create_texture(const rhi::TextureDesc& desc) override;
    Expected<std::unique_ptr<rhi::BackendSampler>> create_sampler(const rhi::SamplerDesc& desc) override;
    Expected<std::unique_ptr<rhi::BackendShader>> create_shader(const rhi::ShaderDesc& desc,
                                                                const rhi::ShaderReflection& reflection) override;
    Expected<std::unique_ptr<rhi::BackendBindGroupLayout>> create_bind_group_layout(
        const rhi::BindGroupLayoutDesc& desc) override;
    Expected<std::unique_ptr<rhi::BackendBindGroup>> create_bind_group(rhi::BackendBindGroupLayout& layout,
                                                                       std::span<const rhi::BackendBinding> bindings,
                                                                       const std::string& name) override;
    Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> create_graphics_pipeline(
        const rhi::BackendGraphicsPipelineDesc& desc) override;
    Expected<std::unique_ptr<rhi::BackendComputePipeline>> create_compute_pipeline(
        const rhi::BackendComputePipelineDesc& desc) override;
    Expected<std::unique_ptr<rhi::BackendQueryPool>> create_query_pool(const rhi::QueryPoolDesc& desc) override;

    Expected<std::unique_ptr<rhi::BackendAccelerationStructure>> create_acceleration_structure(
        const rhi::AccelerationStructureDesc& desc) override;

    Expected<void> flush_mapped(rhi::BackendBuffer& buffer) override;
    Expected<void> invalidate_mapped(rhi::BackendBuffer& buffer) override;

    Expected<void> execute(const rhi::ExecutionPlan& plan) override;
    std::uint64_t completed_serial() override;
    Expected<void> wait(std::uint64_t serial, std::chrono::nanoseconds timeout) override;
    Expected<std::vector<std::uint64_t>> read_queries(rhi::BackendQueryPool& pool, std::uint32_t first,
                                                      std::uint32_t count) override;
    [[nodiscard]] rhi::MemoryStatistics memory_statistics() const override;
    Expected<void> save_pipeline_cache() override;

  private:
    Device() = default;
    Expected<void> create_native(const rhi::DeviceDesc& desc);
    /// Commands that the device has finished with, or new ones.
    Expected<std::unique_ptr<Commands>> take_commands();

    Context context_;
    rhi::AdapterInfo adapter_;
    std::vector<std::unique_ptr<Commands>> commands_;  ///< In the order of their serials.
    std::uint64_t submissions_ = 0;                    ///< For fault injection.
    std::atomic<std::uint64_t> last_serial_ = 0;
};

}  // namespace nacre::vulkan
