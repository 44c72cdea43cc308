// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <mutex>
#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"

/// @file
/// Tests that are registered once and run on every backend present.
///
///     BACKEND_SUITE(Buffers);
///     TEST_P(Buffers, WriteAndRead) {
///         const Buffer buffer = ok(device().create_buffer({.size = 16, .usage = BufferUsage::storage}));
///         ...
///     }
///
/// The device of the fixture has validation and the driver's validation on; any message that the test does not announce
/// with `expect_message` fails it. Use `SKIP_WITHOUT(capability)` where a device may honestly lack something.

namespace nacre::test {

inline constexpr auto all_copies = rhi::TextureUsage::copy_source | rhi::TextureUsage::copy_destination;

/// A device that the suite runs on.
struct Variant {
    std::string name;     ///< "vulkan_renderpass"; part of the test's name and a column of docs/support.md.
    std::string backend;  ///< Backend spec.
    std::string restriction;
    std::string title;  ///< Heading in docs/support.md.
};

/// How GoogleTest shows a variant.
inline void PrintTo(const Variant& variant, std::ostream* out) { *out << variant.name; }

/// All variants that the suite knows.
std::span<const Variant> all_variants();
/// Those that a device can be made of here. Restricted to NACRE_TEST_BACKENDS (names with commas between) where it is
/// set.
const std::vector<Variant>& available_variants();
/// Over all backends of the program.
const rhi::Instance& instance();

class BackendTest : public ::testing::TestWithParam<Variant> {
  public:
    BackendTest();
    ~BackendTest() override;
    void SetUp() override;
    void TearDown() override;

    /// The device of this variant, shared by the tests until one of them leaves messages or loses it.
    rhi::Device& device() { return *device_; }
    [[nodiscard]] const rhi::Capabilities& capabilities() const { return device_->capabilities(); }
    [[nodiscard]] bool supports(rhi::Format format, rhi::FormatSupport what) const {
        return capabilities().supports(format, what);
    }
    /// Description of a device like the fixture's own, for tests that need one to themselves.
    [[nodiscard]] rhi::DeviceDesc device_desc() const;
    /// Makes a device of its own for this test; its messages count as those of `device()`.
    std::unique_ptr<rhi::Device> make_device(const rhi::DeviceDesc& desc);

    /// Announces that a message whose code starts like this comes at least once.
    void expect_message(std::string_view code);
    /// Messages of this test so far.
    std::vector<rhi::Message> messages();

    // Shaders and pipelines from GLSL given as text. `#version 460` is put in front.
    rhi::ShaderDesc compile(rhi::ShaderStage stage, const std::string& body, const std::string& name = "test");
    rhi::Shader shader(rhi::ShaderStage stage, const std::string& body, const std::string& name = "test");
    rhi::ComputePipeline compute(const std::string& body, std::vector<rhi::SpecializationConstant> constants = {},
                                 const std::string& name = "test");

    /// Value of a call that has to succeed.
    template <typename T>
    T ok(Expected<T> result) {
        if (!result) throw_failure(result.error());
        return *std::move(result);
    }
    void ok(Expected<void> result) {
        if (!result) throw_failure(result.error());
    }

    rhi::Buffer buffer(std::uint64_t size, rhi::BufferUsage usage, std::string name = "buffer",
                       rhi::MemoryKind memory = rhi::MemoryKind::device);
    template <typename T>
    rhi::Buffer buffer_of(std::span<const T> values, rhi::BufferUsage usage, std::string name = "buffer") {
        const rhi::Buffer made = buffer(values.size_bytes(), usage, std::move(name));
        ok(device().write_buffer(made, std::as_bytes(values)));
        return made;
    }
    template <typename T>
    std::vector<T> read(rhi::Buffer from) {
        return cast<T>(ok(device().read_buffer(from)));
    }
    template <typename T>
    std::vector<T> read(rhi::Texture from, std::uint32_t mip = 0, std::uint32_t layer = 0) {
        return cast<T>(ok(device().read_texture(from, mip, layer)));
    }
    template <typename T>
    static std::vector<T> cast(const std::vector<std::byte>& bytes) {
        std::vector<T> values(bytes.size() / sizeof(T));
        if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
        return values;
    }
    rhi::Texture target(rhi::Format format, std::uint32_t width, std::uint32_t height, std::string name = "target",
                        rhi::TextureUsage more = rhi::TextureUsage::none, std::uint32_t samples = 1);
    /// Submits, and waits until it is done.
    void run(rhi::CommandList list);

    /// Bind group for an index of a pipeline.
    template <typename Pipeline>
    rhi::BindGroup group(Pipeline pipeline, std::vector<rhi::BindGroupEntry> entries, std::uint32_t index = 0) {
        return ok(device().create_bind_group({.layout = ok(device().bind_group_layout(pipeline, index)),
                                              .entries = std::move(entries),
                                              .name = "group"}));
    }
    /// Runs a compute shader that writes `count` values into `buffer Result` at binding 0 of set 0, and reads them.
    template <typename T>
    std::vector<T> evaluate(const std::string& body, std::size_t count, std::vector<rhi::BindGroupEntry> entries = {},
                            rhi::DispatchArguments groups = {1, 1, 1}) {
        const rhi::Buffer result = buffer(count * sizeof(T), rhi::BufferUsage::storage, "result");
        entries.push_back({.binding = 0, .buffer = result});
        dispatch(compute(body), entries, groups);
        return read<T>(result);
    }
    void dispatch(rhi::ComputePipeline pipeline, const std::vector<rhi::BindGroupEntry>& entries,
                  rhi::DispatchArguments groups = {1, 1, 1});

    /// A pipeline that covers a target with one triangle; `fragment` reads `uv` at location 0.
    rhi::GraphicsPipelineDesc fullscreen_desc(const std::string& fragment, std::vector<rhi::ColorTargetState> targets);
    rhi::GraphicsPipeline fullscreen(const std::string& fragment, rhi::Format target);
    /// Covers a target with the result of a fragment shader.
    void cover(rhi::Texture target, const std::string& fragment, const std::vector<rhi::BindGroupEntry>& entries = {});

    /// A 2D texture with content in mip 0; sampled, copied and written.
    template <typename T>
    rhi::Texture texture_of(rhi::Format format, std::uint32_t width, std::uint32_t height, std::span<const T> texels,
                            std::string name = "texture") {
        const rhi::Texture made = ok(device().create_texture(
            {.format = format,
             .width = width,
             .height = height,
             .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::copy_destination | rhi::TextureUsage::copy_source,
             .name = std::move(name)}));
        ok(device().write_texture(made, std::as_bytes(texels)));
        return made;
    }
    rhi::Sampler nearest();
    rhi::Sampler sampler(const rhi::SamplerDesc& desc) { return ok(device().create_sampler(desc)); }

  private:
    [[noreturn]] static void throw_failure(const Error& error);
    void listen(rhi::Device& device);

    rhi::Device* device_ = nullptr;
    struct Log;
    std::shared_ptr<Log> log_;
    std::vector<std::string> expected_;
    std::unique_ptr<class FailureCatcher> catcher_;
};

/// A vertex shader that covers everything with one triangle and gives `uv` (0,0 at the top left) at location 0.
extern const char* const fullscreen_vertex;

/// Declares a suite that runs on every available variant.
#define BACKEND_SUITE(Suite)                                                                       \
    class Suite : public ::nacre::test::BackendTest {};                                            \
    GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Suite);                                          \
    INSTANTIATE_TEST_SUITE_P(Rhi, Suite, ::testing::ValuesIn(::nacre::test::available_variants()), \
                             [](const auto& parameter) { return parameter.param.name; })

/// Skips the test where the condition, a question to the capabilities, does not hold.
#define SKIP_WITHOUT(condition) \
    if (!(condition)) GTEST_SKIP() << "the device lacks: " #condition

}  // namespace nacre::test
