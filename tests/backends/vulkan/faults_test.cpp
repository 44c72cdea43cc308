// SPDX-License-Identifier: Apache-2.0
// What fails is reported, leaves nothing behind (the validation layer would tell), and a new device works afterwards.
#include <cstdlib>
#include <cstring>
#include <optional>
#include <thread>

#include "tests/backends/vulkan/vulkan_device.h"

namespace nacre::vulkan::test {
namespace {

using namespace rhi;

const char* const doubling = R"(
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) buffer Values { uint values[]; };
void main() { values[gl_GlobalInvocationID.x] *= 2; })";

/// Makes one of everything, works with it and reads the result; stops at the first error.
Expected<void> work(Device& device, std::uint32_t size = 64) {
    static const ShaderDesc shader_desc = compile_text("double.comp", doubling);
    NACRE_TRY(const Buffer buffer,
              device.create_buffer(
                  {.size = size * 4, .usage = BufferUsage::storage | BufferUsage::copy_source, .name = "values"}));
    NACRE_TRY(const Texture texture,
              device.create_texture(
                  {.format = Format::rgba8_unorm,
                   .width = 64,
                   .height = 64,
                   .usage = TextureUsage::color_target | TextureUsage::copy_source | TextureUsage::copy_destination,
                   .name = "picture"}));
    NACRE_TRY(const Shader shader, device.create_shader(shader_desc));
    NACRE_TRY(const ComputePipeline pipeline, device.create_compute_pipeline({.shader = shader}));
    NACRE_TRY(const BindGroupLayout layout, device.bind_group_layout(pipeline, 0));
    NACRE_TRY(const BindGroup group,
              device.create_bind_group({.layout = layout, .entries = {{.binding = 0, .buffer = buffer}}}));
    std::vector<std::uint32_t> values(size, 21);
    NACRE_CHECK(device.write_buffer(buffer, std::as_bytes(std::span(values))));
    CommandList list = device.create_command_list("work");
    list.begin_render_pass({.color = {{.view = texture, .load = LoadOperation::clear}}});
    list.end_render_pass();
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group);
    list.dispatch({size / 64});
    NACRE_TRY(const Fence fence, device.submit(std::move(list)));
    NACRE_CHECK(device.wait(fence));
    NACRE_TRY(const std::vector<std::byte> bytes, device.read_buffer(buffer));
    NACRE_TRY(const std::vector<std::byte> pixels, device.read_texture(texture));
    std::memcpy(values.data(), bytes.data(), bytes.size());
    for (const std::uint32_t value : values)
        if (value != 42) return fail(ErrorCode::internal, "compute", "values", "found " + std::to_string(value));
    return {};
}

/// Messages but those that a device gives about its own loss.
void expect_silence(TestDevice& device) {
    for (const std::string& message : device.take_messages()) ADD_FAILURE() << message;
}

TEST(VulkanFaults, SurvivesTheFailureOfEachAllocation) {
    int failures = 0;
    for (std::uint64_t n = 1;; ++n) {
        ASSERT_LT(n, 100u);
        TestDevice device("vulkan", {.faults = {.fail_allocation = n}});
        if (!device.get()) GTEST_SKIP() << device.error();
        const Expected<void> result = work(*device);
        if (result) break;
        ++failures;
        EXPECT_EQ(result.error().code, ErrorCode::out_of_memory) << result.error().message();
        // Says how much was asked for, and of what.
        EXPECT_NE(result.error().message().find(" bytes"), std::string::npos) << result.error().message();
        EXPECT_NE(result.error().message().find("heap"), std::string::npos) << result.error().message();
        // The same device goes on.
        must(work(*device));
        device.destroy_device();
        expect_silence(device);
    }
    EXPECT_GE(failures, 3);  // Buffer, texture and staging at the least.
}

TEST(VulkanFaults, SurvivesTheLossOfTheDevice) {
    for (std::uint64_t n = 1; n <= 4; ++n) {
        TestDevice device("vulkan", {.faults = {.lose_device = n}});
        if (!device.get()) GTEST_SKIP() << device.error();
        Expected<void> result{};
        for (std::uint64_t i = 0; i < n && result; ++i) result = work(*device);
        ASSERT_FALSE(result);
        EXPECT_EQ(result.error().code, ErrorCode::device_lost) << result.error().message();
        EXPECT_TRUE(device->is_lost());
        EXPECT_EQ(work(*device).error().code, ErrorCode::device_lost);
        const auto waited = device->wait_idle();
        EXPECT_TRUE(waited || waited.error().code == ErrorCode::device_lost);
        device.destroy_device();
        for (const std::string& message : device.take_messages())
            EXPECT_EQ(message.find("VUID"), std::string::npos) << message;

        TestDevice second("vulkan");
        must(work(*second));
    }
}

TEST(VulkanFaults, RefusesABufferBeyondAnyHeap) {
    TestDevice device("vulkan");
    if (!device.get()) GTEST_SKIP() << device.error();
    for (const std::uint64_t size : {std::uint64_t{1} << 63, ~std::uint64_t{0}, std::uint64_t{1} << 46}) {
        const auto buffer = device->create_buffer({.size = size, .usage = BufferUsage::storage, .name = "huge"});
        ASSERT_FALSE(buffer);
        EXPECT_NE(buffer.error().message().find("huge"), std::string::npos) << buffer.error().message();
        EXPECT_NE(buffer.error().message().find(std::to_string(size)), std::string::npos) << buffer.error().message();
    }
    must(work(*device));
}

/// Whether this machine has no Vulkan at all; a driver that is here and fails is a failure.
bool is_driver_absent() {
    const auto adapters = make_backend()->adapters();
    if (adapters) return false;
    EXPECT_EQ(adapters.error().code, ErrorCode::not_found) << adapters.error().message();
    return true;
}

TEST(VulkanFaults, SaysWhatIsWrongWithASpec) {
    std::vector<std::unique_ptr<Backend>> backends;
    backends.push_back(make_backend());
    const Instance instance(std::move(backends));
    const auto unknown_mode = instance.create_device({.backend = "vulkan:ancient"});
    ASSERT_FALSE(unknown_mode);
    EXPECT_NE(unknown_mode.error().message().find("renderpass"), std::string::npos) << unknown_mode.error().message();
    if (is_driver_absent()) GTEST_SKIP() << "no Vulkan device";
    const auto unknown_device = instance.create_device({.backend = "vulkan", .adapter = 4711});
    ASSERT_FALSE(unknown_device);
    EXPECT_NE(unknown_device.error().message().find("4711"), std::string::npos) << unknown_device.error().message();
}

/// Sets a variable of the environment for one scope.
class Environment {
  public:
    Environment(const char* name, const char* value) : name_(name) {
        if (const char* old = std::getenv(name)) old_ = old;
        ::setenv(name, value, 1);
    }
    ~Environment() {
        if (old_)
            ::setenv(name_, old_->c_str(), 1);
        else
            ::unsetenv(name_);
    }
    Environment(const Environment&) = delete;
    Environment& operator=(const Environment&) = delete;

  private:
    const char* name_;
    std::optional<std::string> old_;
};

TEST(VulkanFaults, SaysWhatToInstallWhereNoDriverIs) {
    if (is_driver_absent()) GTEST_SKIP() << "no Vulkan device";
    {
        // Both names that the loader has had for it.
        const Environment old_name("VK_ICD_FILENAMES", "/nonexistent/driver.json");
        const Environment new_name("VK_DRIVER_FILES", "/nonexistent/driver.json");
        const auto adapters = make_backend()->adapters();
        ASSERT_FALSE(adapters);
        EXPECT_EQ(adapters.error().code, ErrorCode::not_found);
        EXPECT_NE(adapters.error().message().find("mesa-vulkan-drivers"), std::string::npos)
            << adapters.error().message();
    }
    EXPECT_TRUE(make_backend()->adapters());
}

TEST(VulkanFaults, SaysWhatToInstallWhereTheValidationLayerIsMissing) {
    if (is_driver_absent()) GTEST_SKIP() << "no Vulkan device";
    const Environment nowhere("VK_LAYER_PATH", "/nonexistent");
    std::vector<std::unique_ptr<Backend>> backends;
    backends.push_back(make_backend());
    const Instance instance(std::move(backends));
    const auto device = instance.create_device({.backend = "vulkan", .driver_validation = true});
    ASSERT_FALSE(device);
    EXPECT_EQ(device.error().code, ErrorCode::not_found);
    EXPECT_NE(device.error().message().find("vulkan-validationlayers"), std::string::npos) << device.error().message();
    EXPECT_TRUE(instance.create_device({.backend = "vulkan"}));
}

TEST(VulkanDevices, LiveSideBySide) {
    TestDevice first("vulkan"), second("vulkan:renderpass"), third("vulkan:legacy");
    if (!first.get()) GTEST_SKIP() << first.error();
    // One without validation beside those with it.
    std::vector<std::unique_ptr<Backend>> backends;
    backends.push_back(make_backend());
    const Instance instance(std::move(backends));
    auto plain = must(instance.create_device({.backend = "vulkan"}));
    auto plain_too = must(instance.create_device({.backend = "vulkan"}));
    std::vector<std::thread> threads;
    for (Device* device : {first.get(), second.get(), third.get(), plain.get(), plain_too.get()})
        threads.emplace_back([device] {
            for (std::uint32_t i = 1; i <= 8; ++i) {
                const auto result = work(*device, 64 * i);
                EXPECT_TRUE(result) << result.error().message();
            }
        });
    for (std::thread& thread : threads) thread.join();
    second.destroy_device();
    plain.reset();
    must(work(*first));
    must(work(*plain_too));
    for (TestDevice* device : {&first, &second, &third}) expect_silence(*device);
}

TEST(VulkanMemory, ComesFromFewBlocksAndGoesBack) {
    TestDevice device("vulkan");
    if (!device.get()) GTEST_SKIP() << device.error();
    const MemoryStatistics before = device->memory_statistics();
    std::vector<Buffer> buffers;
    for (int i = 0; i < 1000; ++i)
        buffers.push_back(must(device->create_buffer({.size = 1000, .usage = BufferUsage::storage, .name = "small"})));
    const Buffer large =
        must(device->create_buffer({.size = 100 << 20, .usage = BufferUsage::storage, .name = "large"}));
    const MemoryStatistics with = device->memory_statistics();
    EXPECT_LE(with.driver_allocations, before.driver_allocations + 3);
    EXPECT_GE(with.reserved_bytes, before.reserved_bytes + (100u << 20) + 1'000'000);
    for (const Buffer buffer : buffers) device->destroy(buffer);
    device->destroy(large);
    must(device->wait_idle());
    must(work(*device));
    EXPECT_LT(device->memory_statistics().reserved_bytes, before.reserved_bytes + (20u << 20));
    device.destroy_device();
    expect_silence(device);
}

}  // namespace
}  // namespace nacre::vulkan::test
