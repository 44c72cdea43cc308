// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "rhi/capabilities.h"
#include "rhi/command_list.h"
#include "rhi/pipeline.h"
#include "rhi/reflection.h"
#include "rhi/resources.h"
#include "rhi/trace.h"
#include "rhi/validation.h"

/// @file
/// Devices: what a machine has, and everything that a device makes and does.
///
///     Instance instance({vulkan::make_backend(), gl::make_backend()});
///     auto device = *instance.create_device({.backend = "auto"});
///     Buffer buffer = *device->create_buffer({.size = 256, .usage = BufferUsage::storage, .name = "values"});
///     auto bytes = *device->read_buffer(buffer);

namespace nacre::rhi {

class Backend;
class BackendDevice;

/// `NAME[:MODE][:CHECK]...[:lanes=N][:threads=N]`, as written on every command line.
struct BackendSpec {
    std::string name;          ///< "vulkan", "gl", "gles", "auto".
    /// Backend-specific; empty: the default. The first word behind the name, until the backend is known: then it may
    /// turn out to be a check.
    std::string mode;
    std::vector<std::string> checks{};  ///< Backend-specific: what is looked for while shaders run.
    std::uint32_t seed = 0;    ///< Of the check `hostile=N`; 0: not given.
    std::uint32_t lanes = 0;   ///< 0: not given.
    std::uint32_t threads = 0; ///< 0: not given.
    /// Parses the text. Errors name the part that is wrong and what is allowed; whether a backend knows the mode
    /// and the options is decided when a device is made.
    static Expected<BackendSpec> parse(std::string_view text);
    [[nodiscard]] std::string text() const;
};

/// One device that a backend offers.
struct AdapterInfo {
    std::string backend;       ///< Name under which `create_device` finds it: "vulkan".
    std::uint32_t index = 0;   ///< Position among the devices of that backend.
    std::string name;          ///< "llvmpipe (LLVM 15.0.6, 256 bits)".
    std::string driver;        ///< Driver and its version.
    std::string api_version;   ///< "Vulkan 1.3.230", "OpenGL ES 3.2".
    bool is_software = false;  ///< Runs on the CPU.
};

/// A backend that cannot be used here, and why.
struct UnavailableBackend {
    std::string backend;
    Error error;
};

/// Faults that tests plant; all off by default.
struct FaultInjection {
    std::uint64_t fail_allocation = 0;  ///< The n-th memory allocation (from 1) fails with out_of_memory.
    std::uint64_t lose_device = 0;      ///< The n-th submission (from 1) loses the device.
};

struct DeviceDesc {
    std::string backend = "auto";        ///< A backend spec; "auto" takes the first that works.
    std::uint32_t adapter = 0;           ///< `AdapterInfo::index`.
    std::string restriction = "none";    ///< See `restrict_capabilities`.
    bool validation = true;              ///< The RHI's own checks (checks of handles are always on).
    bool driver_validation = false;      ///< Khronos validation layer, GL debug output.
    bool verify_statements = false;      ///< Compare `begin_statement` with what commands do.
    bool debug_names = true;             ///< Hand names and groups on to the driver.
    std::string pipeline_cache = {};     ///< Folder for the driver's pipeline cache; empty: the default cache.
    FaultInjection faults{};
    std::string name = "device";
};

/// A point in a device's order of submissions.
struct Fence {
    std::uint64_t serial = 0;  ///< 0: nothing to wait for.
};

/// The set of backends that a program was built with. Thread-safe after construction.
class Instance {
  public:
    /// Takes the explicit list of backends; the first that works is "auto".
    explicit Instance(std::vector<std::unique_ptr<Backend>> backends);
    ~Instance();

    /// All devices of all backends that can be used here.
    [[nodiscard]] std::vector<AdapterInfo> adapters() const;
    /// The backends that cannot be used, each with its reason.
    [[nodiscard]] std::vector<UnavailableBackend> unavailable() const;
    /// Names of all backends in the list, usable or not.
    [[nodiscard]] std::vector<std::string> backend_names() const;

    /// Makes a device. Several may live at once, of the same or of different backends; they share nothing.
    Expected<std::unique_ptr<Device>> create_device(const DeviceDesc& desc = {}) const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// A device. All member functions may be called from any thread; calls that touch the same object at the same time are
/// ordered by the device. After a device loss every call returns device_lost, objects may still be destroyed, and
/// a new device can be made.
class Device {
  public:
    ~Device();
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;

    [[nodiscard]] const AdapterInfo& adapter() const;
    /// What this device can do, after the restriction it was made with.
    [[nodiscard]] const Capabilities& capabilities() const;
    [[nodiscard]] const DeviceDesc& desc() const;
    /// True once the device is lost.
    [[nodiscard]] bool is_lost() const;

    // Objects. Errors: invalid_argument, unsupported, out_of_memory, shader_compile, validation, device_lost.
    Expected<Buffer> create_buffer(const BufferDesc& desc);
    Expected<Texture> create_texture(const TextureDesc& desc);
    Expected<Sampler> create_sampler(const SamplerDesc& desc);
    Expected<Shader> create_shader(const ShaderDesc& desc);
    Expected<BindGroupLayout> create_bind_group_layout(const BindGroupLayoutDesc& desc);
    Expected<BindGroup> create_bind_group(const BindGroupDesc& desc);
    Expected<GraphicsPipeline> create_graphics_pipeline(const GraphicsPipelineDesc& desc);
    Expected<ComputePipeline> create_compute_pipeline(const ComputePipelineDesc& desc);
    Expected<QueryPool> create_query_pool(const QueryPoolDesc& desc);
    Expected<AccelerationStructure> create_acceleration_structure(const AccelerationStructureDesc& desc);

    /// Destroys an object once the device no longer uses it. An empty handle is ignored; destroying twice is an error
    /// that is reported to the message callback.
    void destroy(Buffer object);
    void destroy(Texture object);
    void destroy(Sampler object);
    void destroy(Shader object);
    void destroy(BindGroup object);
    void destroy(GraphicsPipeline object);
    void destroy(ComputePipeline object);
    void destroy(QueryPool object);
    /// A top level keeps none of its bottom levels alive: they are destroyed after its last use.
    void destroy(AccelerationStructure object);

    // What objects are. A stale handle gives an error.
    Expected<BufferDesc> describe(Buffer object) const;
    Expected<TextureDesc> describe(Texture object) const;
    Expected<AccelerationStructureDesc> describe(AccelerationStructure object) const;
    Expected<ShaderReflection> reflection(Shader object) const;
    /// The layout that a pipeline expects at a bind-group index (empty layouts included).
    Expected<BindGroupLayout> bind_group_layout(GraphicsPipeline pipeline, std::uint32_t index) const;
    Expected<BindGroupLayout> bind_group_layout(ComputePipeline pipeline, std::uint32_t index) const;
    Expected<BindGroupLayoutDesc> describe(BindGroupLayout layout) const;

    // Content. Writes are copied at the call and take effect before the next submission; reads wait for all
    // submitted work. Buffers need no usage flag for it; textures need copy_destination to be written and copy_source
    // to be read.
    Expected<void> write_buffer(Buffer buffer, std::span<const std::byte> data, std::uint64_t offset = 0);
    template <typename T>
    Expected<void> write_buffer(Buffer buffer, std::span<const T> data, std::uint64_t offset = 0) {
        return write_buffer(buffer, std::as_bytes(data), offset);
    }
    /// Writes one mip of one layer (or of a 3D texture), tightly packed (`mip_bytes`).
    Expected<void> write_texture(Texture texture, std::span<const std::byte> data, std::uint32_t mip = 0,
                                 std::uint32_t layer = 0);
    Expected<std::vector<std::byte>> read_buffer(Buffer buffer, std::uint64_t offset = 0, std::uint64_t size = ~0ull);
    /// Reads one mip of one layer, tightly packed.
    Expected<std::vector<std::byte>> read_texture(Texture texture, std::uint32_t mip = 0, std::uint32_t layer = 0);
    /// Memory of an upload or readback buffer, valid until `unmap`. Writes are seen by work submitted after `unmap`;
    /// reads see work that was waited for.
    Expected<std::span<std::byte>> map(Buffer buffer);
    Expected<void> unmap(Buffer buffer);

    // Work.
    CommandList create_command_list(std::string_view name = {});
    /// Submits lists in their order, as if recorded in one. Runs after everything submitted before.
    Expected<Fence> submit(CommandList list);
    Expected<Fence> submit(std::span<CommandList> lists);
    /// Waits; `timeout` passing is an error of code timeout.
    Expected<void> wait(Fence fence, std::chrono::nanoseconds timeout = std::chrono::nanoseconds::max());
    Expected<void> wait_idle();
    [[nodiscard]] bool is_complete(Fence fence);
    /// Results of written queries: nanoseconds (timestamp) or samples passed (occlusion). Waits for them.
    Expected<std::vector<std::uint64_t>> read_queries(QueryPool pool, std::uint32_t first, std::uint32_t count);

    [[nodiscard]] MemoryStatistics memory_statistics() const;
    /// Instructions that go through single precision, of all pipelines made so far, sorted and each once; empty where
    /// Capabilities::float_bits is 24.
    [[nodiscard]] std::vector<NarrowedOperation> narrowed_operations() const;
    /// Notes what one invocation computes in all work from here to `finish_trace`, which waits for that work. Slow.
    /// Errors: unsupported (the backend cannot), device_lost.
    Expected<void> start_trace(const TraceRequest& request);
    Expected<Trace> finish_trace();
    /// Writes the driver's pipeline cache to disk now (it also happens at destruction).
    Expected<void> save_pipeline_cache();

    /// Receives validation and driver messages; default: the log. Called from the thread that caused the message,
    /// or from a driver's own.
    void set_message_callback(std::function<void(const Message&)> callback);
    /// Number of messages of severity error so far, from the validation layer and from the driver.
    [[nodiscard]] std::uint64_t error_message_count() const;

  private:
    friend class Instance;
    friend class CommandList;
    struct State;
    explicit Device(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace nacre::rhi
