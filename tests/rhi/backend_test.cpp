// SPDX-License-Identifier: Apache-2.0
#include "tests/rhi/backend_test.h"

#include <gtest/gtest-spi.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <stdexcept>

#include "samples/backends.h"
#include "tests/rhi/expected_failures.h"

namespace nacre::test {

using namespace rhi;

/// Keeps failures of a test that is expected to fail away from the run.
class FailureCatcher {
  public:
    FailureCatcher() : reporter_(::testing::ScopedFakeTestPartResultReporter::INTERCEPT_ALL_THREADS, &results_) {}
    [[nodiscard]] bool has_failed() const {
        for (int i = 0; i < results_.size(); ++i)
            if (results_.GetTestPartResult(i).failed()) return true;
        return false;
    }

  private:
    ::testing::TestPartResultArray results_;
    ::testing::ScopedFakeTestPartResultReporter reporter_;
};

struct BackendTest::Log {
    std::mutex mutex;
    std::vector<Message> messages;
};

namespace {

struct SharedDevice {
    std::unique_ptr<Device> device;
};
std::map<std::string, SharedDevice>& shared_devices() {
    static std::map<std::string, SharedDevice> devices;
    return devices;
}

DeviceDesc desc_of(const Variant& variant) {
    DeviceDesc desc;
    desc.backend = variant.backend;
    desc.restriction = variant.restriction;
    desc.validation = true;
    desc.driver_validation = true;
    desc.name = variant.name;
    return desc;
}

/// Releases the shared devices while drivers are still loaded.
class Release : public ::testing::Environment {
  public:
    void TearDown() override { shared_devices().clear(); }
};
const auto* const release = ::testing::AddGlobalTestEnvironment(new Release);

}  // namespace

const char* const fullscreen_vertex = R"(
layout(location = 0) out vec2 uv;
void main() {
    vec2 corner = vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2);
    uv = corner;
    gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}
)";

std::span<const Variant> all_variants() {
    static const std::array variants{
        Variant{"cpu", "cpu:consistent", "none", "cpu:consistent"},
        Variant{"cpu_fast_8", "cpu:fast:lanes=8", "none", "cpu:fast:lanes=8"},
        Variant{"cpu_double", "cpu:double", "none", "cpu:double"},
        Variant{"vulkan", "vulkan", "none", "vulkan"},
        Variant{"vulkan_renderpass", "vulkan:renderpass", "none", "vulkan:renderpass"},
        Variant{"gl", "gl", "none", "gl"},
        Variant{"gl_osmesa", "gl:osmesa", "none", "gl:osmesa"},
        Variant{"gles", "gles", "none", "gles"},
        Variant{"gles_minimum", "gles", "gles31-minimum", "gles, restricted to gles31-minimum"},
    };
    return variants;
}

const Instance& instance() {
    static const Instance all(all_backends());
    return all;
}

const std::vector<Variant>& available_variants() {
    static const std::vector<Variant> available = [] {
        std::vector<Variant> found;
        const char* only = std::getenv("NACRE_TEST_BACKENDS");
        const std::string wanted = only ? "," + std::string(only) + "," : "";
        for (const Variant& variant : all_variants()) {
            if (only && wanted.find("," + variant.name + ",") == std::string::npos) continue;
            auto device = instance().create_device(desc_of(variant));
            if (!device) {
                std::fprintf(stderr, "[ variant  ] %s is not here: %s\n", variant.name.c_str(),
                             device.error().message().c_str());
                continue;
            }
            shared_devices()[variant.name].device = std::move(*device);
            found.push_back(variant);
        }
        return found;
    }();
    return available;
}

BackendTest::BackendTest() = default;
BackendTest::~BackendTest() = default;

void BackendTest::SetUp() {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    // "Rhi/Buffers" and "WriteAndRead/vulkan" make "Buffers.WriteAndRead".
    std::string suite = info->test_suite_name();
    std::string name = info->name();
    suite = suite.substr(suite.find('/') + 1);
    name = name.substr(0, name.find('/'));
    for (const ExpectedFailure& failure : expected_failures())
        if (failure.test == suite + "." + name && failure.variant == GetParam().name)
            catcher_ = std::make_unique<FailureCatcher>();

    SharedDevice& shared = shared_devices()[GetParam().name];
    if (!shared.device) {
        auto made = instance().create_device(desc_of(GetParam()));
        ASSERT_TRUE(made) << made.error().message();
        shared.device = std::move(*made);
    }
    device_ = shared.device.get();
    log_ = std::make_shared<Log>();
    listen(*device_);
}

void BackendTest::TearDown() {
    bool dirty = false;
    if (device_) {
        if (!device_->is_lost()) {
            const auto idle = device_->wait_idle();
            EXPECT_TRUE(idle) << idle.error().message();
        }
        dirty = device_->is_lost();
        for (const std::string& code : expected_) {
            const auto all = messages();
            const bool came = std::any_of(all.begin(), all.end(),
                                          [&](const Message& message) { return message.code.starts_with(code); });
            EXPECT_TRUE(came) << "no message " << code;
        }
        for (const Message& message : messages()) {
            if (message.severity == MessageSeverity::info) continue;
            const bool announced = std::any_of(expected_.begin(), expected_.end(),
                                               [&](const std::string& code) { return message.code.starts_with(code); });
            if (!announced) ADD_FAILURE() << "unexpected message " << message.code << ": " << message.text;
            dirty = true;
        }
        device_->set_message_callback({});
    }
    if (catcher_) {
        const bool failed = catcher_->has_failed();
        catcher_.reset();
        RecordProperty("expected_failure", "yes");
        if (!failed && !IsSkipped())
            ADD_FAILURE() << "passed, though tests/rhi/expected_failures.cpp expects a failure; remove the entry";
        dirty = true;
    }
    if (dirty || HasFailure()) shared_devices()[GetParam().name].device.reset();
}

void BackendTest::listen(Device& device) {
    device.set_message_callback([log = log_](const Message& message) {
        const std::lock_guard lock(log->mutex);
        log->messages.push_back(message);
    });
}

std::vector<Message> BackendTest::messages() {
    const std::lock_guard lock(log_->mutex);
    return log_->messages;
}

void BackendTest::expect_message(std::string_view code) { expected_.emplace_back(code); }

DeviceDesc BackendTest::device_desc() const { return desc_of(GetParam()); }

std::unique_ptr<Device> BackendTest::make_device(const DeviceDesc& desc) {
    std::unique_ptr<Device> made = ok(instance().create_device(desc));
    listen(*made);
    return made;
}

void BackendTest::throw_failure(const Error& error) { throw std::runtime_error(error.message()); }

ShaderDesc BackendTest::compile(ShaderStage stage, const std::string& body, const std::string& name) {
    static ShaderCompiler compiler(ShaderCompilerDesc{});
    const char* extension = stage == ShaderStage::vertex ? ".vert" : stage == ShaderStage::fragment ? ".frag" : ".comp";
    return ok(compiler.compile({.path = name + extension, .text = "#version 460\n" + body}));
}

Shader BackendTest::shader(ShaderStage stage, const std::string& body, const std::string& name) {
    return ok(device().create_shader(compile(stage, body, name)));
}

ComputePipeline BackendTest::compute(const std::string& body, std::vector<SpecializationConstant> constants,
                                     const std::string& name) {
    ComputePipelineDesc desc;
    desc.shader = shader(ShaderStage::compute, body, name);
    desc.specialization = std::move(constants);
    desc.name = name;
    return ok(device().create_compute_pipeline(desc));
}

Buffer BackendTest::buffer(std::uint64_t size, BufferUsage usage, std::string name, MemoryKind memory) {
    return ok(device().create_buffer({size, usage, memory, std::move(name)}));
}

Texture BackendTest::target(Format format, std::uint32_t width, std::uint32_t height, std::string name,
                            TextureUsage more, std::uint32_t samples) {
    TextureDesc desc;
    desc.format = format;
    desc.width = width;
    desc.height = height;
    desc.samples = samples;
    desc.usage = (info(format).is_depth_stencil() ? TextureUsage::depth_target : TextureUsage::color_target) | more;
    if (samples == 1) desc.usage |= TextureUsage::copy_source;
    desc.name = std::move(name);
    return ok(device().create_texture(desc));
}

void BackendTest::run(CommandList list) {
    const Fence fence = ok(device().submit(std::move(list)));
    ok(device().wait(fence));
}

void BackendTest::dispatch(ComputePipeline pipeline, const std::vector<BindGroupEntry>& entries,
                           DispatchArguments groups) {
    CommandList list = device().create_command_list("dispatch");
    list.set_pipeline(pipeline);
    if (!entries.empty()) list.set_bind_group(0, group(pipeline, entries));
    list.dispatch(groups);
    run(std::move(list));
}

GraphicsPipelineDesc BackendTest::fullscreen_desc(const std::string& fragment, std::vector<ColorTargetState> targets) {
    GraphicsPipelineDesc desc;
    desc.vertex = shader(ShaderStage::vertex, fullscreen_vertex, "fullscreen");
    desc.fragment = shader(ShaderStage::fragment, fragment);
    desc.color_targets = std::move(targets);
    desc.name = "fullscreen";
    return desc;
}

GraphicsPipeline BackendTest::fullscreen(const std::string& fragment, Format target) {
    return ok(device().create_graphics_pipeline(fullscreen_desc(fragment, {{.format = target}})));
}

void BackendTest::cover(Texture target, const std::string& fragment, const std::vector<BindGroupEntry>& entries) {
    const GraphicsPipeline pipeline = fullscreen(fragment, ok(device().describe(target)).format);
    CommandList list = device().create_command_list("cover");
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::discard}}, .name = "cover"});
    list.set_pipeline(pipeline);
    if (!entries.empty()) list.set_bind_group(0, group(pipeline, entries));
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    run(std::move(list));
}

Sampler BackendTest::nearest() {
    return sampler({.magnify = Filter::nearest,
                    .minify = Filter::nearest,
                    .mip = Filter::nearest,
                    .address_u = AddressMode::clamp_to_edge,
                    .address_v = AddressMode::clamp_to_edge,
                    .address_w = AddressMode::clamp_to_edge,
                    .name = "nearest"});
}

}  // namespace nacre::test
