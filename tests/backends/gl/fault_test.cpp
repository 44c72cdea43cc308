// SPDX-License-Identifier: Apache-2.0
#include <stdlib.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/disk_cache.h"
#include "tests/backends/gl/gl_device.h"

/// @file
/// Faults and company: lost devices, failing allocations, damaged caches, several devices and threads at once.

namespace nacre::rhi {
namespace {

constexpr const char* fill = R"(
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) writeonly buffer Result { uint result[]; };
layout(push_constant) uniform Parameters { uint value; };
void main() { result[gl_GlobalInvocationID.x] = gl_GlobalInvocationID.x * value; }
)";

/// Runs a shader and says whether all its results are right.
bool computes(Device& device, std::uint32_t value) {
    constexpr std::uint32_t count = 256;
    const auto buffer = device.create_buffer({.size = count * 4, .usage = BufferUsage::storage, .name = "result"});
    if (!buffer) return false;
    const auto pipeline =
        device.create_compute_pipeline({.shader = make_shader(device, "fill.comp", fill), .name = "fill"});
    if (!pipeline) return false;
    const auto group = device.create_bind_group({.layout = expect(device.bind_group_layout(*pipeline, 0)),
                                                 .entries = {{.binding = 0, .buffer = *buffer}}});
    if (!group) return false;
    CommandList list = device.create_command_list("fill");
    list.set_pipeline(*pipeline);
    list.set_bind_group(0, *group);
    list.set_push_constants(value);
    list.dispatch({.x = count / 64});
    if (!device.submit(std::move(list))) return false;
    const auto bytes = device.read_buffer(*buffer);
    if (!bytes) return false;
    const auto values = as_values<std::uint32_t>(*bytes);
    bool right = values.size() == count;
    for (std::uint32_t i = 0; right && i < count; ++i) right = values[i] == i * value;
    device.destroy(*group);
    device.destroy(*pipeline);
    device.destroy(*buffer);
    return right;
}

class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "nacre-gl-test-XXXXXX").string();
        path_ = ::mkdtemp(name.data());
    }
    ~TemporaryFolder() { std::filesystem::remove_all(path_); }
    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

class GlFaultTest : public testing::TestWithParam<DeviceKind> {};
INSTANTIATE_TEST_SUITE_P(All, GlFaultTest, testing::ValuesIn(device_kinds), name_of);

TEST_P(GlFaultTest, ReportsALostDeviceAndMakesAnother) {
    auto device = make_device(GetParam(), {.faults = {.lose_device = 2}});
    if (!device) return;
    const Buffer buffer =
        expect(device->create_buffer({.size = 64, .usage = BufferUsage::copy_destination, .name = "buffer"}));
    expect(device->write_buffer(buffer, std::as_bytes(std::span("abcd", 4))));
    std::uint32_t submissions = 0;
    ErrorCode code = ErrorCode::internal;
    for (; submissions < 5; ++submissions) {
        CommandList list = device->create_command_list();
        list.fill_buffer(buffer, 1);
        if (auto fence = device->submit(std::move(list)); !fence) {
            code = fence.error().code;
            break;
        }
    }
    EXPECT_LT(submissions, 5u);
    EXPECT_EQ(code, ErrorCode::device_lost);
    EXPECT_TRUE(device->is_lost());
    const auto later = device->create_buffer({.size = 64, .usage = BufferUsage::storage});
    ASSERT_FALSE(later);
    EXPECT_EQ(later.error().code, ErrorCode::device_lost);
    const auto waited = device->wait_idle();
    EXPECT_TRUE(!waited && waited.error().code == ErrorCode::device_lost);
    device->destroy(buffer);
    device.reset();
    auto another = make_device(GetParam());
    ASSERT_TRUE(another);
    EXPECT_TRUE(computes(*another, 3));
}

TEST_P(GlFaultTest, SurvivesEveryFailingAllocation) {
    std::uint64_t failed = 0;
    for (std::uint64_t n = 1; n <= 12; ++n) {
        auto device = make_device(GetParam(), {.faults = {.fail_allocation = n}});
        if (!device) return;
        device->set_message_callback([](const Message&) {});
        std::uint32_t errors = 0;
        const auto count = [&](const auto& result) {
            if (result) return;
            ++errors;
            EXPECT_EQ(result.error().code, ErrorCode::out_of_memory) << result.error().message();
        };
        const auto buffer = device->create_buffer({.size = 64, .usage = BufferUsage::storage, .name = "buffer"});
        count(buffer);
        const auto texture = device->create_texture(
            {.format = Format::rgba8_unorm,
             .width = 4,
             .height = 4,
             .usage = TextureUsage::sampled | TextureUsage::copy_destination | TextureUsage::copy_source,
             .name = "texture"});
        count(texture);
        if (buffer) count(device->write_buffer(*buffer, std::as_bytes(std::span("abcd", 4))));
        if (buffer) count(device->read_buffer(*buffer));
        if (texture) count(device->read_texture(*texture));
        failed += errors;
        EXPECT_LE(errors, 1u);
        // The fault was the only one: the device works on.
        EXPECT_TRUE(computes(*device, 5) || n > 4) << "after allocation " << n << " failed";
        EXPECT_FALSE(device->is_lost());
    }
    EXPECT_GE(failed, 2u);
}

TEST_P(GlFaultTest, RebuildsADamagedProgramCache) {
    const TemporaryFolder folder;
    const auto run = [&] {
        auto device = make_device(GetParam(), {.pipeline_cache = folder.path().string()});
        return !device || computes(*device, 7);
    };
    ASSERT_TRUE(run());
    if (IsSkipped()) return;
    const auto entries = [&] {
        std::vector<std::filesystem::path> files;
        for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path()))
            if (entry.is_regular_file() && entry.path().string().find("gl-program") != std::string::npos)
                files.push_back(entry.path());
        return files;
    };
    ASSERT_EQ(entries().size(), 1u);
    const std::uintmax_t size = std::filesystem::file_size(entries()[0]);
    ASSERT_TRUE(run());
    EXPECT_EQ(std::filesystem::file_size(entries()[0]), size);
    for (const std::uintmax_t where : {std::uintmax_t{0}, size / 2, size - 1}) {
        std::fstream file(entries()[0], std::ios::in | std::ios::out | std::ios::binary);
        file.seekg(static_cast<std::streamoff>(where));
        const char old = static_cast<char>(file.get());
        file.seekp(static_cast<std::streamoff>(where));
        file.put(static_cast<char>(old ^ 0x55));
        file.close();
        EXPECT_TRUE(run()) << "byte " << where;
        EXPECT_EQ(entries().size(), 1u);
    }
    std::filesystem::resize_file(entries()[0], size / 3);
    EXPECT_TRUE(run());
    EXPECT_EQ(std::filesystem::file_size(entries()[0]), size) << "the truncated entry was not replaced";
}

TEST_P(GlFaultTest, WorksBesideOtherDevicesAndThreads) {
    std::vector<std::unique_ptr<Device>> devices;
    for (const DeviceKind& kind : {GetParam(), GetParam(), device_kinds[0], device_kinds[1], device_kinds[2]})
        if (auto device = make_device(kind)) devices.push_back(std::move(device));
    if (devices.empty()) return;
    if (auto vulkan = instance().create_device({.backend = "vulkan"})) devices.push_back(*std::move(vulkan));
    std::atomic<std::uint32_t> right{0};
    std::vector<std::thread> threads;
    // Two threads for each device.
    for (std::uint32_t i = 0; i < devices.size() * 2; ++i)
        threads.emplace_back([&, i] {
            for (std::uint32_t round = 0; round < 5; ++round)
                right += computes(*devices[i / 2], i * 100 + round + 1);
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(right, devices.size() * 10);
    // They end in any order.
    while (devices.size() > 1) {
        devices.erase(devices.begin());
        EXPECT_TRUE(computes(*devices.front(), 9));
    }
}

TEST(GlMessages, ReachTheCallback) {
    // Silence of the driver's checks means nothing unless a wrong call makes them speak: here one that the front end
    // would have refused.
    std::atomic<std::uint32_t> errors{0};
    const DeviceDesc desc{.backend = "gl", .driver_validation = true};
    auto backend = gl::make_backend();
    auto device = backend->create_device({.spec = {.name = "gl"}, .desc = &desc, .report = [&](const Message& message) {
        errors += message.severity == MessageSeverity::error;
    }});
    if (!device && device.error().code == ErrorCode::not_found) GTEST_SKIP() << device.error().message();
    ASSERT_TRUE(device) << device.error().message();
    auto first = expect((*device)->create_buffer({.size = 64, .usage = BufferUsage::copy_source, .name = "small"}));
    auto second =
        expect((*device)->create_buffer({.size = 64, .usage = BufferUsage::copy_destination, .name = "small"}));
    CommandStream stream;
    auto& copy = stream.append<CopyBufferCommand>();
    copy.source.object = first.get();
    copy.destination.object = second.get();
    copy.size = 4096;
    CommandStream* const streams[]{&stream};
    expect((*device)->execute({.streams = streams, .serial = 1}));
    expect((*device)->wait(1, std::chrono::seconds(10)));
    EXPECT_GE(errors, 1u);
    first.reset();
    second.reset();
}

TEST(GlBackends, RefuseModesAndDevicesThatTheyDoNotHave) {
    for (const char* backend : {"gles:osmesa", "gl:glx"}) {
        const auto device = instance().create_device({.backend = backend});
        ASSERT_FALSE(device) << backend;
        EXPECT_THAT(device.error().message(),
                    testing::HasSubstr(std::string(backend).substr(std::string(backend).find(':') + 1)));
    }
    const auto device = instance().create_device({.backend = "gl", .adapter = 77});
    ASSERT_FALSE(device);
    EXPECT_THAT(device.error().message(), testing::HasSubstr("77"));
}

}  // namespace
}  // namespace nacre::rhi
