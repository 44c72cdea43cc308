// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/device.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <new>
#include <system_error>

#include "backends/cpu/capabilities.h"
#include "backends/cpu/sampler.h"
#include "backends/cpu/shader.h"
#include "backends/cpu/task_loop.h"
#include "core/log.h"

#ifndef NACRE_CPU_PLAIN_THREADS
#include <tbb/version.h>
#endif

#include "backends/cpu/acceleration_structure.h"

namespace nacre::cpu {
namespace {

std::string processor_name() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);) {
        if (!line.starts_with("model name")) continue;
        const std::size_t begin = line.find_first_not_of(" \t", line.find(':') + 1);
        if (begin != std::string::npos) return line.substr(begin);
    }
    return "processor";
}

std::string driver_name() {
    std::string text = "LLVM " NACRE_CPU_LLVM_VERSION;
#ifndef NACRE_CPU_PLAIN_THREADS
    text += fmt::format(", oneTBB {}.{}", TBB_VERSION_MAJOR, TBB_VERSION_MINOR);
#endif
    return text;
}

}  // namespace

rhi::AdapterInfo describe_machine() {
    static const rhi::AdapterInfo machine{.backend = "cpu",
                                          .name = processor_name(),
                                          .driver = driver_name(),
                                          .api_version = "SPIR-V 1.6",
                                          .is_software = true};
    return machine;
}

CpuDevice::CpuDevice(const DeviceOptions& options, const rhi::BackendDeviceDesc& desc,
                     std::unique_ptr<Compiler> compiler)
    : mode_(options.mode),
      adapter_(describe_machine()),
      // Results must not depend on the lanes where arithmetic is not contracted, so neither may the subgroup.
      capabilities_(find_capabilities(options.mode == ExecutionMode::fast ? options.lanes : max_lanes)),
      faults_(desc.desc->faults),
      memory_(std::make_shared<HostMemory>(machine_memory_bytes(), desc.desc->faults.fail_allocation)),
      checks_(options.checks),
      faults_seen_(desc.report),
      compiler_(std::move(compiler)),
      scheduler_(Scheduler::create(options.threads)),
      watchdog_(watchdog_limit()),
      executor_(*scheduler_, watchdog_, options.lanes, {options.checks, options.seed, &faults_seen_}) {
    // Shadows take up to 8 times what they belong to, but only where shaders write does the system give them pages.
    if (options.mode != ExecutionMode::double_precision) return;
    capabilities_.float_bits = 53;
    capabilities_.max_buffer_size = std::min(capabilities_.max_buffer_size, largest_shadowed_bytes);
    capabilities_.max_storage_buffer_range = std::min(capabilities_.max_storage_buffer_range, largest_shadowed_bytes);
    memory_->shadows = std::make_shared<HostMemory>(machine_memory_bytes() * 8);
}

Expected<std::unique_ptr<rhi::BackendDevice>> CpuDevice::create(const DeviceOptions& options,
                                                                const rhi::BackendDeviceDesc& desc) try {
    NACRE_TRY(auto compiler,
              Compiler::create({.lanes = options.lanes, .mode = options.mode, .checks = options.checks}));
    std::unique_ptr<CpuDevice> device(new CpuDevice(options, desc, std::move(compiler)));
    if (log_is_on(LogLevel::debug))
        log_message(LogLevel::debug,
                    fmt::format("device '{}': {}, {} lanes, {} threads", desc.desc->name, device->adapter_.name,
                                options.lanes, device->scheduler_->thread_count()));
    return device;
} catch (const std::bad_alloc&) {
    return fail(ErrorCode::out_of_memory, "create device", fmt::format("'{}'", desc.desc->name),
                "there is no memory for it", "Free other resources.");
} catch (const std::system_error& error) {
    return fail(ErrorCode::out_of_memory, "create device", fmt::format("'{}'", desc.desc->name),
                fmt::format("the system starts no more threads: {}", error.what()), "Use fewer threads (threads=N).");
}

CpuDevice::~CpuDevice() = default;

Expected<void> CpuDevice::check_lost(const char* attempted) const {
    if (!lost_) return {};
    const std::scoped_lock lock(mutex_);
    return fail(ErrorCode::device_lost, attempted, adapter_.name, fmt::format("the device was lost: {}", lost_reason_),
                "Destroy the device and make a new one.");
}

void CpuDevice::lose(const std::string& reason) {
    const std::scoped_lock lock(mutex_);
    if (lost_) return;
    lost_reason_ = reason;
    lost_ = true;
    changed_.notify_all();
}

Expected<std::unique_ptr<rhi::BackendBuffer>> CpuDevice::create_buffer(const rhi::BufferDesc& desc) {
    NACRE_CHECK(check_lost("create buffer"));
    return CpuBuffer::create(memory_, desc, checks_);
}
Expected<std::unique_ptr<rhi::BackendTexture>> CpuDevice::create_texture(const rhi::TextureDesc& desc) {
    NACRE_CHECK(check_lost("create texture"));
    return CpuTexture::create(memory_, desc, checks_);
}
Expected<std::unique_ptr<rhi::BackendSampler>> CpuDevice::create_sampler(const rhi::SamplerDesc& desc) {
    NACRE_CHECK(check_lost("create sampler"));
    return std::make_unique<CpuSampler>(desc, mode_ != ExecutionMode::fast);
}
Expected<std::unique_ptr<rhi::BackendShader>> CpuDevice::create_shader(const rhi::ShaderDesc& desc,
                                                                       const rhi::ShaderReflection& reflection) {
    NACRE_CHECK(check_lost("create shader"));
    return std::make_unique<CpuShader>(desc, reflection);
}
Expected<std::unique_ptr<rhi::BackendBindGroupLayout>> CpuDevice::create_bind_group_layout(
    const rhi::BindGroupLayoutDesc& desc) {
    NACRE_CHECK(check_lost("create bind group layout"));
    return std::make_unique<CpuBindGroupLayout>(desc, capabilities_.max_bindless_textures);
}
Expected<std::unique_ptr<rhi::BackendBindGroup>> CpuDevice::create_bind_group(
    rhi::BackendBindGroupLayout& layout, std::span<const rhi::BackendBinding> bindings, const std::string& name) {
    NACRE_CHECK(check_lost("create bind group"));
    return CpuBindGroup::create(layout, bindings, name);
}
Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> CpuDevice::create_graphics_pipeline(
    const rhi::BackendGraphicsPipelineDesc& desc) {
    NACRE_CHECK(check_lost("create graphics pipeline"));
    NACRE_TRY(std::unique_ptr<rhi::BackendGraphicsPipeline> pipeline, CpuGraphicsPipeline::create(*compiler_, desc));
    const RasterPipeline& raster = static_cast<CpuGraphicsPipeline&>(*pipeline).raster;
    note_narrowed(raster.vertex.name, raster.vertex.narrowed);
    note_narrowed(raster.fragment.name, raster.fragment.narrowed);
    return pipeline;
}
Expected<std::unique_ptr<rhi::BackendComputePipeline>> CpuDevice::create_compute_pipeline(
    const rhi::BackendComputePipelineDesc& desc) {
    NACRE_CHECK(check_lost("create compute pipeline"));
    NACRE_TRY(std::unique_ptr<rhi::BackendComputePipeline> pipeline, CpuComputePipeline::create(*compiler_, desc));
    const ComputeProgram& program = static_cast<CpuComputePipeline&>(*pipeline).program;
    note_narrowed(program.name, program.narrowed);
    return pipeline;
}
Expected<std::unique_ptr<rhi::BackendQueryPool>> CpuDevice::create_query_pool(const rhi::QueryPoolDesc& desc) {
    NACRE_CHECK(check_lost("create query pool"));
    return std::make_unique<CpuQueryPool>(desc);
}

Expected<std::unique_ptr<rhi::BackendAccelerationStructure>> CpuDevice::create_acceleration_structure(
    const rhi::AccelerationStructureDesc& desc) {
    NACRE_CHECK(check_lost("create acceleration structure"));
    // Embree starts threads when it is opened: only for those who trace rays.
    if (!rays_) {
#ifdef NACRE_CPU_PLAIN_THREADS
        constexpr std::uint32_t build_threads = 1;
#else
        const std::uint32_t build_threads = scheduler_->thread_count();
#endif
        NACRE_TRY(rays_, RayDevice::create(build_threads));
    }
    return CpuAccelerationStructure::create(rays_, desc);
}

// Host and device share all memory.
Expected<void> CpuDevice::flush_mapped(rhi::BackendBuffer& buffer) {
    if (is_hostile()) check_host_access("unmap buffer", buffer);
    return check_lost("unmap buffer");
}
Expected<void> CpuDevice::invalidate_mapped(rhi::BackendBuffer& buffer) {
    if (is_hostile()) check_host_access("map buffer", buffer);
    return check_lost("map buffer");
}

void CpuDevice::check_host_access(const char* attempted, const rhi::BackendBuffer& buffer) {
    std::uint64_t serial = 0;
    {
        const std::scoped_lock lock(mutex_);
        for (const FlatPlan& plan : waiting_)
            if (std::ranges::find(plan.host_buffers, &buffer) != plan.host_buffers.end()) serial = plan.serial;
    }
    if (serial == 0) return;
    faults_seen_.add(rhi::ShaderFault::host_access, nullptr, attempted + buffer.desc.name, 1, false, [&] {
        FoundFault fault;
        fault.attempted = attempted;
        fault.subject = fmt::format("'{}'", buffer.desc.name);
        fault.reason =
            fmt::format("expected submission {}, which uses it, to be waited for, found that nobody did", serial);
        return fault;
    });
    faults_seen_.send();
}

void CpuDevice::release(std::uint64_t serial) {
    const std::scoped_lock lock(mutex_);
    while (!waiting_.empty() && waiting_.front().serial <= serial) {
        queue_.post([this, flat = std::move(waiting_.front())] { run_plan(flat); });
        waiting_.pop_front();
    }
}

Expected<void> CpuDevice::execute(const rhi::ExecutionPlan& plan) try {
    NACRE_CHECK(check_lost("submit"));
    if (++submissions_ == faults_.lose_device) {
        queue_.drain();
        lose("planted by FaultInjection::lose_device");
    }
    NACRE_CHECK(check_lost("submit"));
    if (!is_hostile()) {
        queue_.post([this, flat = flatten(plan, checks_ != 0)] { run_plan(flat); });
        return {};
    }
    // A program that never waits must not pile up work without end.
    constexpr std::size_t most_waiting = 8;
    std::uint64_t released = 0;
    {
        const std::scoped_lock lock(mutex_);
        waiting_.push_back(flatten(plan, true));
        questions_ = 0;
        if (waiting_.size() > most_waiting) released = waiting_.front().serial;
    }
    release(released);
    return {};
} catch (const std::bad_alloc&) {
    return fail(ErrorCode::out_of_memory, "submit", adapter_.name, "there is no memory for the commands",
                "Submit fewer commands at one time.");
}

void CpuDevice::run_plan(const FlatPlan& plan) {
    if (lost_) return;
    std::string reason;
    try {
        const DefaultArithmetic arithmetic;
        reason = executor_.execute(plan);
    } catch (const std::bad_alloc&) {
        reason = fmt::format("out of memory while executing submission {}", plan.serial);
    }
    if (!reason.empty()) {
        lose(reason);
        return;
    }
    const std::scoped_lock lock(mutex_);
    completed_ = plan.serial;
    changed_.notify_all();
}

std::uint64_t CpuDevice::completed_serial() {
    if (is_hostile()) {
        // Who asks again and again waits in his own way.
        constexpr std::uint32_t most_questions = 64;
        std::uint64_t released = 0;
        {
            const std::scoped_lock lock(mutex_);
            if (++questions_ >= most_questions && !waiting_.empty()) released = waiting_.front().serial;
        }
        release(released);
    }
    return completed_;
}

Expected<void> CpuDevice::wait(std::uint64_t serial, std::chrono::nanoseconds timeout) {
    if (is_hostile()) release(serial);
    std::unique_lock lock(mutex_);
    const auto finished = [&] { return completed_ >= serial || lost_; };
    // A time point at the end of time would overflow inside wait_for.
    if (timeout > std::chrono::hours(24 * 365))
        changed_.wait(lock, finished);
    else if (!changed_.wait_for(lock, timeout, finished))
        return fail(ErrorCode::timeout, "wait for submission", std::to_string(serial),
                    fmt::format("it was not complete after {} ms",
                                std::chrono::duration_cast<std::chrono::milliseconds>(timeout).count()),
                    "Wait longer; the work goes on.");
    if (completed_ >= serial) return {};
    lock.unlock();
    return check_lost("wait for submission");
}

Expected<std::vector<std::uint64_t>> CpuDevice::read_queries(rhi::BackendQueryPool& pool, std::uint32_t first,
                                                             std::uint32_t count) {
    NACRE_CHECK(check_lost("read queries"));
    const auto begin = static_cast<CpuQueryPool&>(pool).values.begin() + first;
    return std::vector<std::uint64_t>(begin, begin + count);
}

rhi::MemoryStatistics CpuDevice::memory_statistics() const {
    rhi::MemoryStatistics statistics;
    statistics.reserved_bytes = memory_->reserved_bytes();
    statistics.driver_allocations = memory_->allocations();
    return statistics;
}

void CpuDevice::note_narrowed(const std::string& shader, std::span<const NarrowedOperation> operations) {
    const std::scoped_lock lock(narrowed_mutex_);
    for (const NarrowedOperation& operation : operations)
        narrowed_.insert({shader, operation.line, operation.operation});
}

std::vector<rhi::NarrowedOperation> CpuDevice::narrowed_operations() const {
    const std::scoped_lock lock(narrowed_mutex_);
    return {narrowed_.begin(), narrowed_.end()};
}

Expected<void> CpuDevice::start_trace(const rhi::TraceRequest& request) {
    NACRE_CHECK(check_lost("trace shaders"));
    queue_.drain();
    trace_ = std::make_unique<ShaderTrace>();
    // Fragment shaders are found by their pixel, compute shaders only by their own coordinates.
    const auto invocation = request.invocation.value_or(std::array{request.x, request.y, ~0u});
    std::ranges::copy(invocation, trace_->invocation);
    std::ranges::copy(std::array{request.x, request.y, request.z}, trace_->texel);
    executor_.set_trace(trace_.get(), request.shader, compiler_.get());
    return {};
}

Expected<rhi::Trace> CpuDevice::finish_trace() {
    NACRE_CHECK(check_lost("trace shaders"));
    queue_.drain();
    executor_.set_trace(nullptr, {}, nullptr);
    if (!trace_) return rhi::Trace{};
    rhi::Trace found = std::move(trace_->found);
    trace_.reset();
    return found;
}

Expected<void> CpuDevice::save_pipeline_cache() { return {}; }  // The compiler keeps what it compiles as it does so.

}  // namespace nacre::cpu
