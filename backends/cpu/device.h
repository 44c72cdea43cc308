// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "backends/cpu/checks/fault_log.h"
#include "backends/cpu/commands.h"
#include "backends/cpu/compiler/compiler.h"
#include "backends/cpu/queue.h"
#include "backends/cpu/rays/ray_scene.h"

namespace nacre::cpu {

struct DeviceOptions {
    ExecutionMode mode = ExecutionMode::fast;
    std::uint32_t lanes = 16;   ///< 4, 8 or 16.
    std::uint32_t threads = 0;  ///< 0: one for each core.
    std::uint32_t checks = 0;   ///< CheckFlags
    std::uint32_t seed = 0;     ///< Of hostile orders.
};

/// This machine as an adapter.
rhi::AdapterInfo describe_machine();

class CpuDevice : public rhi::BackendDevice {
  public:
    static Expected<std::unique_ptr<rhi::BackendDevice>> create(const DeviceOptions& options,
                                                                const rhi::BackendDeviceDesc& desc);
    ~CpuDevice() override;

    [[nodiscard]] const rhi::AdapterInfo& adapter() const override { return adapter_; }
    [[nodiscard]] const rhi::Capabilities& capabilities() const override { return capabilities_; }
    [[nodiscard]] bool wants_uses() const override { return is_hostile(); }

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
    [[nodiscard]] std::vector<rhi::NarrowedOperation> narrowed_operations() const override;
    Expected<void> start_trace(const rhi::TraceRequest& request) override;
    Expected<rhi::Trace> finish_trace() override;

  private:
    CpuDevice(const DeviceOptions& options, const rhi::BackendDeviceDesc& desc, std::unique_ptr<Compiler> compiler);
    Expected<void> check_lost(const char* attempted) const;
    /// Gives the device up and wakes everyone who waits. From then on the queue touches no object of the front end,
    /// which may destroy them as soon as it hears of the loss: only called where the queue runs nothing.
    void lose(const std::string& reason);
    void run_plan(const FlatPlan& plan);

    // Hostile order: work is done as late as is allowed, so that who does not wait for it does not find it done.
    [[nodiscard]] bool is_hostile() const { return (checks_ & check_hostile) != 0; }
    /// Hands the plans up to a serial to the queue.
    void release(std::uint64_t serial);
    /// Reports that the host uses a buffer which a plan that waits uses too.
    void check_host_access(const char* attempted, const rhi::BackendBuffer& buffer);
    std::deque<FlatPlan> waiting_;       // Under mutex_.
    std::uint32_t questions_ = 0;        // Under mutex_: for completion, since the last plan.

    ExecutionMode mode_;
    rhi::AdapterInfo adapter_;
    rhi::Capabilities capabilities_;
    rhi::FaultInjection faults_;
    std::shared_ptr<HostMemory> memory_;
    const std::uint32_t checks_;
    FaultLog faults_seen_;
    std::unique_ptr<Compiler> compiler_;
    std::shared_ptr<RayDevice> rays_;  ///< Made when the first acceleration structure is.
    std::unique_ptr<Scheduler> scheduler_;
    Watchdog watchdog_;
    Executor executor_;  // Queue thread only.
    std::unique_ptr<ShaderTrace> trace_;
    void note_narrowed(const std::string& shader, std::span<const NarrowedOperation> operations);
    mutable std::mutex narrowed_mutex_;
    std::set<rhi::NarrowedOperation> narrowed_;

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::atomic<std::uint64_t> completed_{0};  // Written under mutex_.
    std::atomic<bool> lost_{false};            // Written under mutex_.
    std::string lost_reason_;                  // Under mutex_.
    std::uint64_t submissions_ = 0;
    Queue queue_;  // Last: its thread ends before anything that it uses.
};

}  // namespace nacre::cpu
