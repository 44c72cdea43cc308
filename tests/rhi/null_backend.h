// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "rhi/backend.h"

/// @file
/// A backend without a driver: it remembers what it was given, so that validation and barriers are tested in
/// milliseconds. Copies and fills of buffers are carried out, everything else is only recorded.

namespace nacre::test {

/// One command of an executed plan, with the barriers before it.
struct NullCommand {
    rhi::CommandType type{};
    std::vector<rhi::Barrier> barriers;
};

/// What the null device was given, and what it is to do; shared with the test, and valid after the device is gone.
struct NullLog {
    std::vector<std::vector<NullCommand>> submissions;  ///< Of each plan, its commands in order.
    std::vector<std::vector<rhi::Barrier>> final_barriers;
    std::atomic<std::uint64_t> completed{~std::uint64_t{0}};  ///< Lower it to keep work in flight.
    std::atomic<int> objects{0};                              ///< Backend objects that live.
    std::uint64_t allocations = 0;
    rhi::Capabilities capabilities;
};

/// Capabilities of a large desktop device.
inline rhi::Capabilities full_capabilities() {
    rhi::Capabilities c;
    c.storage_in_vertex = c.storage_in_fragment = c.dual_source_blending = c.independent_blend = true;
    c.descriptor_indexing = c.anisotropic_filtering = c.border_color = c.depth_clamp = c.depth_bias_clamp = true;
    c.wireframe = c.cube_arrays = c.multi_draw_indirect = c.indirect_first_instance = c.timestamps = true;
    c.ray_query = c.texel_buffers = true;
    c.precise_occlusion = c.block_compression = c.float_color_targets = c.base_instance = c.texture_views =
        c.texture_view_formats = true;
    c.max_texture_1d = c.max_texture_2d = c.max_texture_cube = 16384;
    c.max_texture_3d = c.max_texture_layers = 2048;
    c.max_color_targets = 8;
    c.max_dual_source_targets = 1;
    c.max_samples = 4;
    c.max_integer_samples = 1;
    c.max_uniform_buffer_range = 65536;
    c.max_storage_buffer_range = std::uint64_t{1} << 27;
    c.max_buffer_size = std::uint64_t{1} << 31;
    c.texel_buffer_offset_alignment = 16;
    c.max_texel_buffer_elements = 65536;
    c.max_vertex_attributes = 16;
    c.max_vertex_buffers = 16;
    c.max_vertex_stride = 2048;
    c.max_uniform_buffers = c.max_storage_buffers = c.max_storage_images = {16, 16, 16};
    c.max_sampled_textures = c.max_samplers = {32, 32, 32};
    c.max_workgroup_size = {1024, 1024, 64};
    c.max_workgroup_count = {65535, 65535, 65535};
    c.max_workgroup_invocations = 1024;
    c.max_workgroup_memory_bytes = 32768;
    c.max_bindless_textures = 4096;
    c.max_anisotropy = 16.0f;
    c.timestamp_period_ns = 1.0;
    c.device_memory_bytes = std::uint64_t{1} << 33;
    for (std::uint32_t i = 1; i < rhi::format_count; ++i) {
        using enum rhi::FormatSupport;
        const rhi::FormatInfo& format = rhi::info(static_cast<rhi::Format>(i));
        rhi::FormatSupport& support = c.formats[i];
        if (format.block_bytes == 12) {
            support = vertex;
        } else if (format.is_compressed()) {
            support = sampled | filtered;
        } else if (format.is_depth_stencil()) {
            support = sampled | filtered | depth_target | multisampled;
        } else {
            support = sampled | color_target | storage_image | vertex | multisampled | uniform_texel_buffer |
                      storage_texel_buffer;
            if (!format.is_integer()) support |= filtered | blended;
        }
    }
    c.formats[static_cast<std::uint32_t>(rhi::Format::rgb9e5_float)] =
        rhi::FormatSupport::sampled | rhi::FormatSupport::filtered;
    return c;
}

namespace null {

template <typename Base>
class Counted : public Base {
  public:
    explicit Counted(std::shared_ptr<NullLog> log) : log_(std::move(log)) { ++log_->objects; }
    ~Counted() override { --log_->objects; }

  private:
    std::shared_ptr<NullLog> log_;
};

class NullBuffer final : public Counted<rhi::BackendBuffer> {
  public:
    using Counted::Counted;
    std::vector<std::byte> bytes;
};

class NullDevice final : public rhi::BackendDevice {
  public:
    NullDevice(std::shared_ptr<NullLog> log, const rhi::DeviceDesc& desc) : log_(std::move(log)), faults_(desc.faults) {
        adapter_ = {"null", 0, "null device", "null 1.0", "null", true};
    }
    const rhi::AdapterInfo& adapter() const override { return adapter_; }
    const rhi::Capabilities& capabilities() const override { return log_->capabilities; }

    Expected<std::unique_ptr<rhi::BackendBuffer>> create_buffer(const rhi::BufferDesc& desc) override {
        NACRE_CHECK(allocate("create buffer", desc.name));
        auto buffer = std::make_unique<NullBuffer>(log_);
        buffer->bytes.resize(desc.size);
        buffer->memory_bytes = desc.size;
        if (desc.memory != rhi::MemoryKind::device) buffer->mapped = buffer->bytes.data();
        return buffer;
    }
    Expected<std::unique_ptr<rhi::BackendTexture>> create_texture(const rhi::TextureDesc& desc) override {
        NACRE_CHECK(allocate("create texture", desc.name));
        auto texture = make<rhi::BackendTexture>();
        for (std::uint32_t mip = 0; mip < desc.mips; ++mip)
            texture->memory_bytes += rhi::mip_bytes(desc, mip) * desc.layers * desc.samples;
        return texture;
    }
    Expected<std::unique_ptr<rhi::BackendSampler>> create_sampler(const rhi::SamplerDesc&) override {
        return make<rhi::BackendSampler>();
    }
    Expected<std::unique_ptr<rhi::BackendShader>> create_shader(const rhi::ShaderDesc&,
                                                                const rhi::ShaderReflection&) override {
        return make<rhi::BackendShader>();
    }
    Expected<std::unique_ptr<rhi::BackendBindGroupLayout>> create_bind_group_layout(
        const rhi::BindGroupLayoutDesc&) override {
        return make<rhi::BackendBindGroupLayout>();
    }
    Expected<std::unique_ptr<rhi::BackendBindGroup>> create_bind_group(rhi::BackendBindGroupLayout&,
                                                                       std::span<const rhi::BackendBinding>,
                                                                       const std::string&) override {
        return make<rhi::BackendBindGroup>();
    }
    Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> create_graphics_pipeline(
        const rhi::BackendGraphicsPipelineDesc&) override {
        return make<rhi::BackendGraphicsPipeline>();
    }
    Expected<std::unique_ptr<rhi::BackendComputePipeline>> create_compute_pipeline(
        const rhi::BackendComputePipelineDesc&) override {
        return make<rhi::BackendComputePipeline>();
    }
    Expected<std::unique_ptr<rhi::BackendQueryPool>> create_query_pool(const rhi::QueryPoolDesc&) override {
        return make<rhi::BackendQueryPool>();
    }
    Expected<std::unique_ptr<rhi::BackendAccelerationStructure>> create_acceleration_structure(
        const rhi::AccelerationStructureDesc&) override {
        return make<rhi::BackendAccelerationStructure>();
    }
    Expected<void> flush_mapped(rhi::BackendBuffer&) override { return {}; }
    Expected<void> invalidate_mapped(rhi::BackendBuffer&) override { return {}; }

    Expected<void> execute(const rhi::ExecutionPlan& plan) override {
        if (++submissions_ == faults_.lose_device)
            return fail(ErrorCode::device_lost, "submit", "null device", "the fault was asked for");
        std::vector<NullCommand> commands;
        std::size_t batch = 0;
        for (rhi::CommandStream* stream : plan.streams)
            stream->for_each([&](rhi::CommandHeader& header, std::byte* payload) {
                NullCommand command{header.type, {}};
                while (batch < plan.batches.size() && plan.batches[batch].before_command == &header) {
                    const rhi::BarrierBatch& found = plan.batches[batch++];
                    const auto barriers = plan.barriers.subspan(found.first, found.count);
                    command.barriers.insert(command.barriers.end(), barriers.begin(), barriers.end());
                }
                commands.push_back(std::move(command));
                carry_out(header, payload);
            });
        std::vector<rhi::Barrier> last;
        for (; batch < plan.batches.size() && !plan.batches[batch].before_command; ++batch) {
            const auto barriers = plan.barriers.subspan(plan.batches[batch].first, plan.batches[batch].count);
            last.insert(last.end(), barriers.begin(), barriers.end());
        }
        if (batch != plan.batches.size())
            return fail(ErrorCode::internal, "submit", "null device", "batches are not in the order of the commands");
        log_->submissions.push_back(std::move(commands));
        log_->final_barriers.push_back(std::move(last));
        submitted_ = plan.serial;
        return {};
    }
    std::uint64_t completed_serial() override { return std::min<std::uint64_t>(submitted_, log_->completed); }
    Expected<void> wait(std::uint64_t serial, std::chrono::nanoseconds timeout) override {
        if (serial > log_->completed && timeout < std::chrono::hours(1))
            return fail(ErrorCode::timeout, "wait", "null device", "the work is not complete");
        return {};
    }
    Expected<std::vector<std::uint64_t>> read_queries(rhi::BackendQueryPool&, std::uint32_t,
                                                      std::uint32_t count) override {
        return std::vector<std::uint64_t>(count, 7);
    }
    rhi::MemoryStatistics memory_statistics() const override { return {}; }
    Expected<void> save_pipeline_cache() override { return {}; }

  private:
    template <typename Base>
    std::unique_ptr<Base> make() {
        return std::make_unique<Counted<Base>>(log_);
    }
    Expected<void> allocate(const char* attempted, const std::string& name) {
        if (++log_->allocations == faults_.fail_allocation)
            return fail(ErrorCode::out_of_memory, attempted, "'" + name + "'", "the fault was asked for");
        return {};
    }
    static void require(bool condition) {
        if (!condition) std::abort();
    }
    static std::uint64_t size(rhi::BackendBuffer* buffer) { return static_cast<NullBuffer*>(buffer)->bytes.size(); }
    static void require_region(const rhi::BufferTextureCopy& region, std::uint64_t bytes,
                               const rhi::TextureDesc& desc) {
        const rhi::Extent3D extent = rhi::mip_extent(desc, region.mip);
        require(region.mip < desc.mips && region.layer < desc.layers &&
                region.offset.x + region.extent.width <= extent.width &&
                region.offset.y + region.extent.height <= extent.height &&
                region.offset.z + region.extent.depth <= extent.depth);
        require(region.buffer_offset +
                    std::uint64_t{region.extent.depth - 1} * region.rows_per_slice * region.bytes_per_row <=
                bytes);
    }
    static std::byte* bytes(rhi::BackendBuffer* buffer) { return static_cast<NullBuffer*>(buffer)->bytes.data(); }
    static void carry_out(const rhi::CommandHeader& header, std::byte* payload) {
        // What reaches a backend is possible; anything else is the front end's fault, and an assert is for bugs.
        if (header.type == rhi::CommandType::copy_buffer) {
            const auto& copy = *reinterpret_cast<const rhi::CopyBufferCommand*>(payload);
            require(copy.source_offset + copy.size <= size(copy.source.object) &&
                    copy.destination_offset + copy.size <= size(copy.destination.object));
            std::memmove(bytes(copy.destination.object) + copy.destination_offset,
                         bytes(copy.source.object) + copy.source_offset, copy.size);
        } else if (header.type == rhi::CommandType::fill_buffer) {
            const auto& fill = *reinterpret_cast<const rhi::FillBufferCommand*>(payload);
            require(fill.offset + fill.size <= size(fill.buffer.object));
            for (std::uint64_t i = 0; i + 4 <= fill.size; i += 4)
                std::memcpy(bytes(fill.buffer.object) + fill.offset + i, &fill.value, 4);
        } else if (header.type == rhi::CommandType::copy_buffer_to_texture) {
            const auto& copy = *reinterpret_cast<const rhi::CopyBufferToTextureCommand*>(payload);
            require_region(copy.region, size(copy.source.object), copy.destination.object->desc);
        } else if (header.type == rhi::CommandType::copy_texture_to_buffer) {
            const auto& copy = *reinterpret_cast<const rhi::CopyTextureToBufferCommand*>(payload);
            require_region(copy.region, size(copy.destination.object), copy.source.object->desc);
        } else if (header.type == rhi::CommandType::begin_render_pass) {
            const auto& pass = *reinterpret_cast<const rhi::BeginRenderPassCommand*>(payload);
            require(pass.width > 0 && pass.height > 0 && (pass.color_count > 0 || pass.has_depth_stencil));
        }
    }

    std::shared_ptr<NullLog> log_;
    rhi::FaultInjection faults_;
    rhi::AdapterInfo adapter_;
    std::uint64_t submissions_ = 0;
    std::atomic<std::uint64_t> submitted_{0};
};

}  // namespace null

class NullBackend final : public rhi::Backend {
  public:
    explicit NullBackend(std::shared_ptr<NullLog> log) : log_(std::move(log)) {}
    std::string_view name() const override { return "null"; }
    std::span<const Mode> modes() const override {
        static constexpr Mode all[] = {{"", "the only one"}, {"other", "another one"}};
        return all;
    }
    bool accepts_threads() const override { return true; }
    Expected<std::vector<rhi::AdapterInfo>> adapters() override {
        return std::vector<rhi::AdapterInfo>{{"null", 0, "null device", "null 1.0", "null", true}};
    }
    Expected<std::unique_ptr<rhi::BackendDevice>> create_device(const rhi::BackendDeviceDesc& desc) override {
        return std::make_unique<null::NullDevice>(log_, *desc.desc);
    }

  private:
    std::shared_ptr<NullLog> log_;
};

/// A device over the null backend, with what it was given and what it said.
struct NullSetup {
    std::shared_ptr<NullLog> log = std::make_shared<NullLog>();
    std::unique_ptr<rhi::Instance> instance;
    std::vector<rhi::Message> messages;
    std::unique_ptr<rhi::Device> device;

    explicit NullSetup(rhi::DeviceDesc desc = {}, rhi::Capabilities capabilities = full_capabilities()) {
        log->capabilities = capabilities;
        std::vector<std::unique_ptr<rhi::Backend>> backends;
        backends.push_back(std::make_unique<NullBackend>(log));
        instance = std::make_unique<rhi::Instance>(std::move(backends));
        device = *instance->create_device(desc);
        device->set_message_callback([this](const rhi::Message& message) { messages.push_back(message); });
    }
};

}  // namespace nacre::test
