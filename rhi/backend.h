// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rhi/command_stream.h"
#include "rhi/device.h"
#include "rhi/reflection.h"
#include "rhi/trace.h"

/// @file
/// What a backend implements. Every backend is the same list of nouns (buffer, texture, sampler, shader, bind group,
/// pipeline, query pool, commands), so a missing feature is a missing file.
///
/// The front end (rhi/*.cpp) owns handles, checks every call, tracks the state of every resource and defers
/// destruction; a backend sees valid calls only, and translates. Its functions are called under the device's lock (one
/// at a time), except where noted, and its objects are destroyed only when the device no longer uses them.
///
/// What a backend can rely on:
/// - The data members of its objects (`desc`, `spirv`, `reflection`, `layout`, ...) are filled in by the front end
/// right
///   after creation; a backend may set them itself too. `mapped` and `memory_bytes` are the backend's to set.
/// - Every buffer may be copied from and to, whatever usage the user asked for: the front end adds both flags.
/// - `set_pipeline`, `set_bind_group`, `set_push_constants`, `set_vertex_buffer` and `set_index_buffer` come in any
/// order; what
///   is bound counts at the draw or dispatch. A bind group may be bound at an index that the current pipeline does not
///   use. All of it is unset at the begin and at the end of a render pass, and at the begin of each list.
/// - The faults of `DeviceDesc::faults` are planted by the backend, where the driver's call would fail.
/// - Any call may return device_lost; the front end then makes no further call but `wait` and destruction.

namespace nacre::rhi {

/// Base of every backend object.
class BackendObject {
  public:
    virtual ~BackendObject() = default;
};

class BackendBuffer : public BackendObject {
  public:
    BufferDesc desc;
    /// Host address of upload and readback buffers, for the buffer's whole life; null for device memory.
    std::byte* mapped = nullptr;
    std::uint64_t memory_bytes = 0;  ///< Bytes taken from the device.
};
class BackendTexture : public BackendObject {
  public:
    TextureDesc desc;
    std::uint64_t memory_bytes = 0;
};
class BackendSampler : public BackendObject {
  public:
    SamplerDesc desc;
};
class BackendShader : public BackendObject {
  public:
    std::vector<std::uint32_t> spirv;
    ShaderReflection reflection;
    std::string entry_point;
    std::string name;
};
/// Bindings sorted by number. Equal layouts are one object.
class BackendBindGroupLayout : public BackendObject {
  public:
    BindGroupLayoutDesc desc;
};
class BackendBindGroup : public BackendObject {
  public:
    BackendBindGroupLayout* layout = nullptr;
};
class BackendGraphicsPipeline : public BackendObject {};
class BackendComputePipeline : public BackendObject {};
class BackendQueryPool : public BackendObject {
  public:
    QueryPoolDesc desc;
};
class BackendAccelerationStructure : public BackendObject {
  public:
    AccelerationStructureDesc desc;
    std::atomic<std::uint64_t> memory_bytes{0};  ///< May change with each build.
};

/// A resolved bind-group entry: complete ranges and views, backend objects.
struct BackendBinding {
    std::uint32_t binding = 0, element = 0;
    BindingType type = BindingType::uniform_buffer;
    BackendBuffer* buffer = nullptr;
    std::uint64_t offset = 0, size = 0;
    Format format = Format::undefined;  ///< Texel buffers; `size` is a whole number of elements of it.
    ViewReference view{};  ///< texture.object set for textures and images.
    BackendSampler* sampler = nullptr;
    BackendAccelerationStructure* acceleration_structure = nullptr;
};

struct BackendGraphicsPipelineDesc {
    const GraphicsPipelineDesc* desc = nullptr;  ///< Its handles are not to be used.
    BackendShader* vertex = nullptr;
    BackendShader* fragment = nullptr;           ///< May be null.
    std::span<BackendBindGroupLayout* const> layouts;  ///< One for each bind-group index up to the highest used.
    std::uint32_t push_constant_bytes = 0;
    ShaderStage push_constant_stages = ShaderStage::none;
};
struct BackendComputePipelineDesc {
    const ComputePipelineDesc* desc = nullptr;
    BackendShader* shader = nullptr;
    std::span<BackendBindGroupLayout* const> layouts;
    std::uint32_t push_constant_bytes = 0;
};

/// How a resource is used at one point, for barriers. Uses of a buffer combine freely. A part of a texture has one use,
/// or one of the pairs sampled | depth_stencil_read (so a sampled depth texture has the layout of a read-only depth
/// target) and storage_read | storage_write. `generate_mips`, `clear_texture`, `clear_depth_stencil` and `fill_buffer`
/// find their resource in copy_destination and leave it so; a resolve target is in resolve_destination from the begin
/// of the pass. A barrier between two reads only widens the stages (or changes the layout of a texture).
struct ResourceState {
    ResourceUse use = ResourceUse::none;      ///< none: content undefined, never used before.
    ShaderStage stages = ShaderStage::none;   ///< For uniform, sampled and storage uses.
    friend bool operator==(const ResourceState&, const ResourceState&) = default;
};

/// A transition of a resource or of a part of a texture. Exactly one object is set.
struct Barrier {
    BackendBuffer* buffer = nullptr;
    BackendTexture* texture = nullptr;
    BackendAccelerationStructure* acceleration_structure = nullptr;
    std::uint32_t base_mip = 0, mip_count = 0, base_layer = 0, layer_count = 0;
    ResourceState before, after;
    bool discard = false;  ///< The old content is not needed.
};

/// The barriers that must take effect before a command. Never inside a render pass.
struct BarrierBatch {
    const CommandHeader* before_command = nullptr;  ///< Null: at the end of the submission.
    std::uint32_t first = 0, count = 0;             ///< Into ExecutionPlan::barriers.
};

/// A use of a resource that the commands of a statement make and the statement does not name. One object is set.
struct UnstatedUse {
    const CommandHeader* statement = nullptr;  ///< The command that begins it.
    BackendBuffer* buffer = nullptr;
    BackendTexture* texture = nullptr;
    BackendAccelerationStructure* acceleration_structure = nullptr;
    ResourceUse stated = ResourceUse::none, found = ResourceUse::none;
};

/// One submission: resolved streams in order, and their barriers in the order of the commands.
struct ExecutionPlan {
    std::span<CommandStream* const> streams;
    std::span<const BarrierBatch> batches;
    std::span<const Barrier> barriers;
    std::uint64_t serial = 0;  ///< Rises by one with every plan.
    // Only where the backend wants them (see `BackendDevice::wants_uses`).
    std::span<const UnstatedUse> unstated;
    std::span<BackendBuffer* const> host_buffers;  ///< That the commands use and the host can map.
};

/// What a backend gets to make a device.
struct BackendDeviceDesc {
    BackendSpec spec;
    const DeviceDesc* desc = nullptr;
    /// For the driver's messages; may be called from any thread.
    std::function<void(const Message&)> report;
};

class BackendDevice {
  public:
    virtual ~BackendDevice() = default;

    [[nodiscard]] virtual const AdapterInfo& adapter() const = 0;
    /// Unrestricted; the front end applies the restriction. A backend that could use more than the restriction
    /// grants (extensions, say) must not: `BackendDeviceDesc::desc->restriction` tells.
    [[nodiscard]] virtual const Capabilities& capabilities() const = 0;

    /// Plans tell more than is needed to execute them, for backends that look for faults.
    [[nodiscard]] virtual bool wants_uses() const { return false; }

    virtual Expected<std::unique_ptr<BackendBuffer>> create_buffer(const BufferDesc& desc) = 0;
    virtual Expected<std::unique_ptr<BackendTexture>> create_texture(const TextureDesc& desc) = 0;
    virtual Expected<std::unique_ptr<BackendSampler>> create_sampler(const SamplerDesc& desc) = 0;
    /// `reflection` belongs to `desc`; both were validated.
    virtual Expected<std::unique_ptr<BackendShader>> create_shader(const ShaderDesc& desc,
                                                                   const ShaderReflection& reflection) = 0;
    virtual Expected<std::unique_ptr<BackendBindGroupLayout>> create_bind_group_layout(
        const BindGroupLayoutDesc& desc) = 0;
    virtual Expected<std::unique_ptr<BackendBindGroup>> create_bind_group(BackendBindGroupLayout& layout,
                                                                          std::span<const BackendBinding> bindings,
                                                                          const std::string& name) = 0;
    virtual Expected<std::unique_ptr<BackendGraphicsPipeline>> create_graphics_pipeline(
        const BackendGraphicsPipelineDesc& desc) = 0;
    virtual Expected<std::unique_ptr<BackendComputePipeline>> create_compute_pipeline(
        const BackendComputePipelineDesc& desc) = 0;
    virtual Expected<std::unique_ptr<BackendQueryPool>> create_query_pool(const QueryPoolDesc& desc) = 0;
    /// Only called on devices with Capabilities::ray_query; the others need not have it.
    virtual Expected<std::unique_ptr<BackendAccelerationStructure>> create_acceleration_structure(
        const AccelerationStructureDesc& desc);

    /// Host writes to a mapped range are done (upload), or are about to be read (readback, after its work is complete).
    virtual Expected<void> flush_mapped(BackendBuffer& buffer) = 0;
    virtual Expected<void> invalidate_mapped(BackendBuffer& buffer) = 0;

    /// Hands the plan to the device and returns without waiting for it. Streams may be read until this returns.
    virtual Expected<void> execute(const ExecutionPlan& plan) = 0;
    /// Serial of the newest plan that is complete, all before it included. Cheap; any thread.
    virtual std::uint64_t completed_serial() = 0;
    /// Waits for a plan. Called without the device's lock; any thread.
    virtual Expected<void> wait(std::uint64_t serial, std::chrono::nanoseconds timeout) = 0;
    /// Raw results in ns or samples; the queries' work is complete.
    virtual Expected<std::vector<std::uint64_t>> read_queries(BackendQueryPool& pool, std::uint32_t first,
                                                              std::uint32_t count) = 0;
    /// reserved_bytes and driver_allocations; the front end fills in the rest.
    [[nodiscard]] virtual MemoryStatistics memory_statistics() const = 0;
    virtual Expected<void> save_pipeline_cache() = 0;
    /// Of all pipelines made so far; empty where the device is not in double precision.
    [[nodiscard]] virtual std::vector<NarrowedOperation> narrowed_operations() const { return {}; }
    /// See rhi/trace.h; called while nothing is executed.
    virtual Expected<void> start_trace(const TraceRequest& request);
    virtual Expected<Trace> finish_trace();
};

/// An API that devices are made from. Stateless apart from the opened driver library; thread-safe.
class Backend {
  public:
    virtual ~Backend() = default;
    /// "vulkan", "gl", "gles".
    [[nodiscard]] virtual std::string_view name() const = 0;
    /// Modes accepted in a spec, "" first, each with a sentence for help texts.
    struct Mode {
        std::string_view name, meaning;
    };
    [[nodiscard]] virtual std::span<const Mode> modes() const = 0;
    /// What can be looked for while shaders run, each a word beside the mode, with a sentence for help texts.
    [[nodiscard]] virtual std::span<const Mode> checks() const { return {}; }
    /// True where `lanes=` or `threads=` mean something.
    [[nodiscard]] virtual bool accepts_lanes() const { return false; }
    [[nodiscard]] virtual bool accepts_threads() const { return false; }
    /// Devices here; an error tells why there is none (driver library missing, no device).
    virtual Expected<std::vector<AdapterInfo>> adapters() = 0;
    virtual Expected<std::unique_ptr<BackendDevice>> create_device(const BackendDeviceDesc& desc) = 0;
};

}  // namespace nacre::rhi
