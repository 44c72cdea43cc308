// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>

#include "backends/gl/commands.h"
#include "core/disk_cache.h"

namespace nacre::gl {

struct DeviceOptions {
    bool es = false;
    std::string mode;
};

/// Makes a context in the way that `mode` says. Errors: those of the ways that were tried, in one.
Expected<std::unique_ptr<Context>> make_context(const DeviceOptions& options, const ContextDesc& desc);

/// What a context says about its driver. It is made current for the question.
rhi::AdapterInfo describe(const Traits& traits, std::uint32_t index);

class GlDevice : public rhi::BackendDevice {
  public:
    static Expected<std::unique_ptr<rhi::BackendDevice>> create(const DeviceOptions& options,
                                                                const rhi::BackendDeviceDesc& desc);
    ~GlDevice() override;

    [[nodiscard]] const rhi::AdapterInfo& adapter() const override { return adapter_; }
    [[nodiscard]] const rhi::Capabilities& capabilities() const override { return capabilities_; }

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
    GlDevice(DriverPointer driver, DiskCache cache);
    Expected<void> check_lost(const char* attempted) const;
    /// Marks the device as lost and wakes everyone who waits.
    void lose(const std::string& reason);
    void run_plan(const FlatPlan& plan);
    /// Looks at the fences of submitted plans; true while there are some. Worker thread only.
    bool poll_fences();

    struct PendingFence {
        std::uint64_t serial = 0;
        GLsync sync = nullptr;
    };

    DriverPointer driver_;
    DiskCache cache_;
    rhi::AdapterInfo adapter_;
    rhi::Capabilities capabilities_;
    std::unique_ptr<Executor> executor_;   // Worker thread only.
    std::deque<PendingFence> fences_;      // Worker thread only.
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::uint64_t completed_ = 0;          // Under mutex_.
    std::string lost_reason_;              // Under mutex_.
    std::uint64_t submissions_ = 0;
};

}  // namespace nacre::gl
