// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/device.h"

#include <fmt/format.h>

#include "backends/gl/capabilities.h"
#include "core/log.h"

namespace nacre::gl {
namespace {

void APIENTRY receive_message(GLenum source, GLenum type, GLuint id, GLenum severity, GLsizei length,
                              const GLchar* text, const void* user) {
    // Performance hints and our own group markers are no mistakes; nor are a compiler's notes on a shader that it
    // takes.
    if (type != GL_DEBUG_TYPE_ERROR && type != GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR && type != GL_DEBUG_TYPE_PORTABILITY &&
        type != GL_DEBUG_TYPE_DEPRECATED_BEHAVIOR)
        return;
    if (severity != GL_DEBUG_SEVERITY_HIGH && severity != GL_DEBUG_SEVERITY_MEDIUM) return;
    const auto& driver = *static_cast<const Driver*>(user);
    const bool is_error = type == GL_DEBUG_TYPE_ERROR || type == GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR;
    driver.warn(is_error ? rhi::MessageSeverity::error : rhi::MessageSeverity::warning,
                fmt::format("GL-{:04x}-{}", source, id),
                std::string(text, length < 0 ? 0 : static_cast<std::size_t>(length)));
}

void enable_debug_output(Driver& driver) {
    const Functions& gl = driver.gl;
    gl.Enable(GL_DEBUG_OUTPUT);
    gl.Enable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    gl.DebugMessageCallback(receive_message, &driver);
    gl.DebugMessageControl(GL_DONT_CARE, GL_DONT_CARE, GL_DONT_CARE, 0, nullptr, GL_TRUE);
}

}  // namespace

Expected<std::unique_ptr<Context>> make_context(const DeviceOptions& options, const ContextDesc& desc) {
    if (options.mode == "egl" || options.es) return make_egl_context(desc);
    if (options.mode == "osmesa") return make_osmesa_context(desc);
    auto context = make_egl_context(desc);
    if (context || desc.adapter > 0) return context;
    auto fallback = make_osmesa_context(desc);
    if (fallback) return fallback;
    Error error = context.error();
    error.reason += fmt::format("; and OSMesa: {}", fallback.error().message());
    return std::unexpected(std::move(error));
}

rhi::AdapterInfo describe(const Traits& traits, std::uint32_t index) {
    rhi::AdapterInfo info;
    info.backend = traits.es ? "gles" : "gl";
    info.index = index;
    info.name = traits.renderer;
    info.driver = fmt::format("{}, {} ({})", traits.vendor, traits.version_text, traits.origin);
    info.api_version = traits.es ? fmt::format("OpenGL ES {}.{}", traits.version / 10, traits.version % 10)
                                 : fmt::format("OpenGL {}.{} core", traits.version / 10, traits.version % 10);
    info.is_software = traits.quirks.is_software;
    return info;
}

GlDevice::GlDevice(DriverPointer driver, DiskCache cache) : driver_(std::move(driver)), cache_(std::move(cache)) {}

Expected<std::unique_ptr<rhi::BackendDevice>> GlDevice::create(const DeviceOptions& options,
                                                               const rhi::BackendDeviceDesc& desc) {
    const rhi::DeviceDesc& wish = *desc.desc;
    NACRE_TRY(auto context, make_context(options, {options.es, wish.driver_validation, wish.adapter}));
    auto driver = std::make_shared<Driver>(std::move(context), desc.report);
    driver->faults = wish.faults;
    driver->debug_names = wish.debug_names;
    std::unique_ptr<GlDevice> device(new GlDevice(
        driver, wish.pipeline_cache.empty() ? DiskCache() : DiskCache(std::filesystem::path(wish.pipeline_cache))));
    driver->worker = std::make_unique<Worker>([raw = device.get()] { return raw->poll_fences(); });
    const bool minimum = options.es && wish.restriction == "gles31-minimum";
    const Expected<void> prepared = driver->worker->run([&]() -> Expected<void> {
        NACRE_CHECK(driver->context->make_current());
        NACRE_TRY(driver->gl, load_functions(driver->context->get_address(), options.es));
        driver->traits = find_traits(driver->gl, options.es, minimum, driver->context->origin());
        if (driver->traits.version < (options.es ? 31 : 45))
            return fail(ErrorCode::unsupported, "create device", driver->traits.renderer,
                        fmt::format("the driver gives '{}', and {} is needed", driver->traits.version_text,
                                    options.es ? "OpenGL ES 3.1" : "OpenGL 4.5"),
                        "Install a newer driver or use another backend.");
        if (wish.driver_validation && (driver->traits.debug_output || minimum) && driver->gl.DebugMessageCallback)
            enable_debug_output(*driver);
        driver->prepare();
        device->adapter_ = describe(driver->traits, wish.adapter);
        device->capabilities_ = find_capabilities(driver->gl, driver->traits);
        device->executor_ = std::make_unique<Executor>(*driver);
        return {};
    });
    NACRE_CHECK(prepared);
    if (log_is_on(LogLevel::debug))
        log_message(LogLevel::debug, fmt::format("device '{}': {} through {}", wish.name, device->adapter_.name,
                                                 driver->traits.origin));
    return device;
}

GlDevice::~GlDevice() {
    if (!driver_->worker) return;
    driver_->worker->run([this] {
        if (executor_) {
            driver_->gl.Finish();
            for (const PendingFence& fence : fences_) driver_->gl.DeleteSync(fence.sync);
            executor_->destroy();
        }
        fences_.clear();
        executor_.reset();
        // The thread may outlive this object, for the sake of resources that are destroyed later.
        driver_->worker->stop_idling();
    });
}

Expected<void> GlDevice::check_lost(const char* attempted) const {
    if (!driver_->lost) return {};
    const std::scoped_lock lock(mutex_);
    return fail(ErrorCode::device_lost, attempted, adapter_.name, fmt::format("the device was lost: {}", lost_reason_),
                "Destroy the device and make a new one.");
}

void GlDevice::lose(const std::string& reason) {
    const std::scoped_lock lock(mutex_);
    if (driver_->lost) return;
    lost_reason_ = reason;
    driver_->lost = true;
    changed_.notify_all();
}

Expected<std::unique_ptr<rhi::BackendBuffer>> GlDevice::create_buffer(const rhi::BufferDesc& desc) {
    NACRE_CHECK(check_lost("create buffer"));
    return GlBuffer::create(driver_, desc);
}
Expected<std::unique_ptr<rhi::BackendTexture>> GlDevice::create_texture(const rhi::TextureDesc& desc) {
    NACRE_CHECK(check_lost("create texture"));
    return GlTexture::create(driver_, desc);
}
Expected<std::unique_ptr<rhi::BackendSampler>> GlDevice::create_sampler(const rhi::SamplerDesc& desc) {
    NACRE_CHECK(check_lost("create sampler"));
    return GlSampler::create(driver_, desc);
}

Expected<std::unique_ptr<rhi::BackendShader>> GlDevice::create_shader(const rhi::ShaderDesc& desc,
                                                                      const rhi::ShaderReflection& reflection) {
    NACRE_CHECK(check_lost("create shader"));
    // Translated with its pipeline, which gives the specialization constants and the binding points.
    auto shader = std::make_unique<GlShader>();
    shader->spirv = desc.spirv;
    shader->reflection = reflection;
    shader->entry_point = desc.entry_point;
    shader->name = desc.name;
    return shader;
}

Expected<std::unique_ptr<rhi::BackendBindGroupLayout>> GlDevice::create_bind_group_layout(
    const rhi::BindGroupLayoutDesc& desc) {
    NACRE_CHECK(check_lost("create bind group layout"));
    for (const rhi::BindingLayout& binding : desc.bindings)
        if (binding.count == 0)
            return fail(ErrorCode::unsupported, "create bind group layout", fmt::format("'{}'", desc.name),
                        fmt::format("binding {} is an unbounded array, which OpenGL does not have", binding.binding),
                        "Ask Capabilities::descriptor_indexing; rhi::TextureTable works without it.");
    return std::make_unique<GlBindGroupLayout>(desc);
}

Expected<std::unique_ptr<rhi::BackendBindGroup>> GlDevice::create_bind_group(
    rhi::BackendBindGroupLayout& layout, std::span<const rhi::BackendBinding> bindings, const std::string& name) {
    NACRE_CHECK(check_lost("create bind group"));
    return GlBindGroup::create(driver_, layout, bindings, name);
}

Expected<std::unique_ptr<rhi::BackendGraphicsPipeline>> GlDevice::create_graphics_pipeline(
    const rhi::BackendGraphicsPipelineDesc& desc) {
    NACRE_CHECK(check_lost("create graphics pipeline"));
    return GlGraphicsPipeline::create(driver_, cache_, desc);
}
Expected<std::unique_ptr<rhi::BackendComputePipeline>> GlDevice::create_compute_pipeline(
    const rhi::BackendComputePipelineDesc& desc) {
    NACRE_CHECK(check_lost("create compute pipeline"));
    return GlComputePipeline::create(driver_, cache_, desc);
}
Expected<std::unique_ptr<rhi::BackendQueryPool>> GlDevice::create_query_pool(const rhi::QueryPoolDesc& desc) {
    NACRE_CHECK(check_lost("create query pool"));
    return GlQueryPool::create(driver_, desc);
}

Expected<void> GlDevice::flush_mapped(rhi::BackendBuffer& buffer) {
    NACRE_CHECK(check_lost("unmap buffer"));
    static_cast<GlBuffer&>(buffer).flush();
    return {};
}
Expected<void> GlDevice::invalidate_mapped(rhi::BackendBuffer& buffer) {
    NACRE_CHECK(check_lost("map buffer"));
    static_cast<GlBuffer&>(buffer).invalidate();
    return {};
}

Expected<void> GlDevice::execute(const rhi::ExecutionPlan& plan) {
    NACRE_CHECK(check_lost("submit"));
    if (++submissions_ == driver_->faults.lose_device) lose("planted by FaultInjection::lose_device");
    NACRE_CHECK(check_lost("submit"));
    driver_->worker->post([this, flat = flatten(plan)] { run_plan(flat); });
    return {};
}

void GlDevice::run_plan(const FlatPlan& plan) {
    if (driver_->lost) return;
    const Functions& gl = driver_->gl;
    executor_->execute(plan);
    switch (const GLenum error = gl.GetError()) {
        case GL_NO_ERROR: break;
        case GL_OUT_OF_MEMORY: lose("out of memory while executing a submission"); return;
        default:
            driver_->warn(rhi::MessageSeverity::error, fmt::format("GL-error-{:04x}", error),
                          fmt::format("OpenGL error 0x{:04x} while executing submission {}", error, plan.serial));
    }
    if (driver_->traits.reset_status && gl.GetGraphicsResetStatus() != GL_NO_ERROR) {
        lose("the driver has reset the context");
        return;
    }
    fences_.push_back({plan.serial, gl.FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)});
    gl.Flush();
}

bool GlDevice::poll_fences() {
    if (fences_.empty() || driver_->lost) return false;
    // Waits a little, so that the thread neither spins nor keeps new work waiting.
    constexpr GLuint64 slice_ns = 1'000'000;
    const GLenum result = driver_->gl.ClientWaitSync(fences_.front().sync, 0, slice_ns);
    if (result == GL_WAIT_FAILED) {
        lose("a fence could not be waited for");
        return false;
    }
    if (result == GL_TIMEOUT_EXPIRED) return true;
    const std::uint64_t serial = fences_.front().serial;
    driver_->gl.DeleteSync(fences_.front().sync);
    fences_.pop_front();
    const std::scoped_lock lock(mutex_);
    completed_ = serial;
    changed_.notify_all();
    return !fences_.empty();
}

std::uint64_t GlDevice::completed_serial() {
    const std::scoped_lock lock(mutex_);
    return completed_;
}

Expected<void> GlDevice::wait(std::uint64_t serial, std::chrono::nanoseconds timeout) {
    std::unique_lock lock(mutex_);
    const auto finished = [&] { return completed_ >= serial || driver_->lost; };
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

Expected<std::vector<std::uint64_t>> GlDevice::read_queries(rhi::BackendQueryPool& pool, std::uint32_t first,
                                                            std::uint32_t count) {
    NACRE_CHECK(check_lost("read queries"));
    return static_cast<GlQueryPool&>(pool).read(first, count);
}

rhi::MemoryStatistics GlDevice::memory_statistics() const {
    rhi::MemoryStatistics statistics;
    statistics.reserved_bytes = driver_->reserved_bytes;
    statistics.driver_allocations = driver_->allocations;
    return statistics;
}

Expected<void> GlDevice::save_pipeline_cache() { return {}; }  // Programs are stored as they are linked.

}  // namespace nacre::gl
