// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "backends/vulkan/vulkan_backend.h"
#include "rhi/backend.h"

/// @file
/// The Vulkan backend with one thing done to it: its submissions pass through a function that may change their
/// barriers. What the front end works out is then known to be needed, and the validation layer known to be awake.

namespace nacre::vulkan::test {

using BarrierChange = std::function<void(std::vector<rhi::Barrier>&)>;

class AlteredDevice final : public rhi::BackendDevice {
  public:
    AlteredDevice(std::unique_ptr<rhi::BackendDevice> device, BarrierChange change)
        : device_(std::move(device)), change_(std::move(change)) {}

    const rhi::AdapterInfo& adapter() const override { return device_->adapter(); }
    const rhi::Capabilities& capabilities() const override { return device_->capabilities(); }
    Expected<std::unique_ptr<rhi::BackendBuffer>> create_buffer(const rhi::BufferDesc& desc) override {
        return device_->create_buffer(desc);
    }
    Expected<std::unique_ptr<rhi::BackendTexture>> create_texture(const rhi::TextureDesc& desc) override {
        return device_->create_texture(desc);
    }
    Expected<std::unique_ptr<rhi::BackendSampler>> create_sampler(const rhi::SamplerDesc& desc) override {
        return device_->create_sampler(desc);
    }
    Expected<std::unique_ptr<rhi::BackendShader>> create_shader(const rhi::ShaderDesc& desc,
                                                                const rhi::ShaderReflection& reflection) override {
        return device_->create_shader(desc, reflection);
    }
    Expected<std::unique_ptr<rhi::BackendBindGroupLayout>> create_bind_group_layout(
        const rhi::BindGroupLayoutDesc& desc) override {
        return device_->create_bind_group_layout(desc);
    }
    Expected<std::unique_ptr<rhi::BackendBindGroup>> create_bind_group(rhi::BackendBindGroupLayout& layout,
                                                                       std::span<const rhi::BackendBinding> bindings,
                                                                       const std::string& name) override {
        return device_->create_bind_group(layout, bindings, name);
    }
    Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> create_graphics_pipeline(
        const rhi::BackendGraphicsPipelineDesc& desc) override {
        return device_->create_graphics_pipeline(desc);
    }
    Expected<std::unique_ptr<rhi::BackendComputePipeline>> create_compute_pipeline(
        const rhi::BackendComputePipelineDesc& desc) override {
        return device_->create_compute_pipeline(desc);
    }
    Expected<std::unique_ptr<rhi::BackendQueryPool>> create_query_pool(const rhi::QueryPoolDesc& desc) override {
        return device_->create_query_pool(desc);
    }
    Expected<void> flush_mapped(rhi::BackendBuffer& buffer) override { return device_->flush_mapped(buffer); }
    Expected<void> invalidate_mapped(rhi::BackendBuffer& buffer) override { return device_->invalidate_mapped(buffer); }
    Expected<void> execute(const rhi::ExecutionPlan& plan) override {
        std::vector<rhi::Barrier> barriers(plan.barriers.begin(), plan.barriers.end());
        change_(barriers);
        rhi::ExecutionPlan altered = plan;
        altered.barriers = barriers;
        return device_->execute(altered);
    }
    std::uint64_t completed_serial() override { return device_->completed_serial(); }
    Expected<void> wait(std::uint64_t serial, std::chrono::nanoseconds timeout) override {
        return device_->wait(serial, timeout);
    }
    Expected<std::vector<std::uint64_t>> read_queries(rhi::BackendQueryPool& pool, std::uint32_t first,
                                                      std::uint32_t count) override {
        return device_->read_queries(pool, first, count);
    }
    rhi::MemoryStatistics memory_statistics() const override { return device_->memory_statistics(); }
    Expected<void> save_pipeline_cache() override { return device_->save_pipeline_cache(); }

  private:
    std::unique_ptr<rhi::BackendDevice> device_;
    BarrierChange change_;
};

class AlteredBackend final : public rhi::Backend {
  public:
    explicit AlteredBackend(BarrierChange change) : backend_(make_backend()), change_(std::move(change)) {}
    std::string_view name() const override { return backend_->name(); }
    std::span<const Mode> modes() const override { return backend_->modes(); }
    Expected<std::vector<rhi::AdapterInfo>> adapters() override { return backend_->adapters(); }
    Expected<std::unique_ptr<rhi::BackendDevice>> create_device(const rhi::BackendDeviceDesc& desc) override {
        NACRE_TRY(auto device, backend_->create_device(desc));
        return std::make_unique<AlteredDevice>(std::move(device), change_);
    }

  private:
    std::unique_ptr<rhi::Backend> backend_;
    BarrierChange change_;
};

}  // namespace nacre::vulkan::test
