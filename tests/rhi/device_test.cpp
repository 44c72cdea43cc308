// SPDX-License-Identifier: Apache-2.0
// The front end over the null backend: handles, lifetime, content, losing a device.
#include "rhi/device.h"

#include <gtest/gtest.h>

#include "core/log.h"
#include "tests/rhi/null_backend.h"

namespace nacre::rhi {
namespace {

using nacre::test::NullSetup;

BufferDesc storage(std::uint64_t size, std::string name) {
    return {size, BufferUsage::storage | BufferUsage::copy_destination, MemoryKind::device, std::move(name)};
}

TEST(Device, WrittenContentIsReadBack) {
    NullSetup setup;
    const Buffer buffer = *setup.device->create_buffer(storage(16, "values"));
    const std::array<std::uint32_t, 2> values{17, 42};
    ASSERT_TRUE(setup.device->write_buffer<std::uint32_t>(buffer, values, 8));
    const auto bytes = setup.device->read_buffer(buffer, 8);
    ASSERT_TRUE(bytes) << bytes.error().message();
    ASSERT_EQ(bytes->size(), 8u);
    EXPECT_EQ(std::memcmp(bytes->data(), values.data(), 8), 0);
    EXPECT_EQ(setup.device->read_buffer(buffer, 12, 4)->size(), 4u);
}

TEST(Device, StaleForeignAndEmptyHandlesAreTold) {
    NullSetup setup, other;
    const Buffer buffer = *setup.device->create_buffer(storage(16, "old one"));
    setup.device->destroy(buffer);
    const auto stale = setup.device->read_buffer(buffer);
    ASSERT_FALSE(stale);
    EXPECT_NE(stale.error().message().find("N-101 stale-handle"), std::string::npos) << stale.error().message();
    EXPECT_NE(stale.error().message().find("old one"), std::string::npos) << stale.error().message();

    const Buffer foreign = *other.device->create_buffer(storage(16, "foreign"));
    EXPECT_NE(setup.device->read_buffer(foreign).error().message().find("N-103"), std::string::npos);
    EXPECT_NE(setup.device->read_buffer(Buffer{}).error().message().find("N-102"), std::string::npos);

    setup.device->destroy(buffer);
    ASSERT_EQ(setup.messages.size(), 4u);
    EXPECT_EQ(setup.messages.back().code, "N-104 destroyed-twice");
    EXPECT_EQ(setup.device->error_message_count(), 4u);
}

TEST(Device, SlotIsUsedAgainUnderAnotherGeneration) {
    NullSetup setup;
    const Buffer first = *setup.device->create_buffer(storage(16, "first"));
    setup.device->destroy(first);
    const Buffer second = *setup.device->create_buffer(storage(16, "second"));
    EXPECT_EQ(first.index, second.index);
    EXPECT_FALSE(first == second);
    EXPECT_FALSE(setup.device->describe(first));
    EXPECT_EQ(setup.device->describe(second)->name, "second");
}

TEST(Device, ObjectsInFlightOutliveTheirDestruction) {
    NullSetup setup;
    const Buffer buffer = *setup.device->create_buffer(storage(16, "in flight"));
    setup.log->completed = 0;
    CommandList list = setup.device->create_command_list("fill");
    list.fill_buffer(buffer, 1);
    const Fence fence = *setup.device->submit(std::move(list));
    const int before = setup.log->objects;
    setup.device->destroy(buffer);
    EXPECT_EQ(setup.log->objects, before);
    EXPECT_FALSE(setup.device->is_complete(fence));
    const auto waited = setup.device->wait(fence, std::chrono::milliseconds(1));
    ASSERT_FALSE(waited);
    EXPECT_EQ(waited.error().code, ErrorCode::timeout);
    setup.log->completed = fence.serial;
    EXPECT_TRUE(setup.device->wait(fence));
    EXPECT_EQ(setup.log->objects, before - 1);
}

TEST(Device, NothingIsLeftAfterADevice) {
    std::shared_ptr<nacre::test::NullLog> log;
    {
        NullSetup setup;
        log = setup.log;
        (void)setup.device->create_buffer(storage(16, "left"));
        const Buffer buffer = *setup.device->create_buffer(storage(16, "written"));
        (void)setup.device->write_buffer(buffer, std::vector<std::byte>(16));
        EXPECT_GT(log->objects, 0);
    }
    EXPECT_EQ(log->objects, 0);
}

TEST(Device, LayoutsOfEqualContentAreOne) {
    NullSetup setup;
    const BindingLayout a{0, BindingType::uniform_buffer, 1, ShaderStage::vertex};
    const BindingLayout b{3, BindingType::sampled_texture, 2, ShaderStage::fragment};
    const BindGroupLayout first = *setup.device->create_bind_group_layout({{a, b}, "first"});
    EXPECT_TRUE(first == *setup.device->create_bind_group_layout({{b, a}, "second"}));
    EXPECT_FALSE(first == *setup.device->create_bind_group_layout({{a}, "third"}));
}

TEST(Device, LosingItFailsEveryLaterCallAndANewOneWorks) {
    DeviceDesc desc;
    desc.faults.lose_device = 1;
    NullSetup setup(desc);
    const Buffer buffer = *setup.device->create_buffer(storage(16, "values"));
    const auto lost = setup.device->submit(setup.device->create_command_list("list"));
    ASSERT_FALSE(lost);
    EXPECT_EQ(lost.error().code, ErrorCode::device_lost);
    EXPECT_TRUE(setup.device->is_lost());
    EXPECT_EQ(setup.device->create_buffer(storage(16, "b")).error().code, ErrorCode::device_lost);
    EXPECT_EQ(setup.device->submit(setup.device->create_command_list()).error().code, ErrorCode::device_lost);
    EXPECT_EQ(setup.device->wait_idle().error().code, ErrorCode::device_lost);
    EXPECT_EQ(setup.device->read_buffer(buffer).error().code, ErrorCode::device_lost);
    setup.device->destroy(buffer);
    NullSetup again;
    EXPECT_TRUE(again.device->submit(again.device->create_command_list("list")));
}

TEST(Device, LossIsLoggedOnce) {
    DeviceDesc desc;
    desc.faults.lose_device = 1;
    std::vector<std::string> lines;
    const auto previous = set_log_callback([&](LogLevel, std::string_view text) { lines.emplace_back(text); });
    {
        NullSetup setup(desc);
        for (int i = 0; i < 5; ++i) (void)setup.device->submit(setup.device->create_command_list("list"));
    }
    set_log_callback(previous);
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_NE(lines[0].find("lost"), std::string::npos) << lines[0];
}

TEST(Device, FailedAllocationLeavesNothingBehind) {
    for (std::uint64_t n = 1; n <= 2; ++n) {
        DeviceDesc desc;
        desc.faults.fail_allocation = n;
        NullSetup setup(desc);
        const auto first = setup.device->create_buffer(storage(16, "first"));
        const auto written = first ? setup.device->write_buffer(*first, std::vector<std::byte>(16)) : Expected<void>{};
        const Error* error = !first ? &first.error() : !written ? &written.error() : nullptr;
        ASSERT_TRUE(error);
        EXPECT_EQ(error->code, ErrorCode::out_of_memory);
        EXPECT_EQ(setup.log->objects, static_cast<int>(n - 1));
    }
}

TEST(Device, ListIsUsedUpBySubmission) {
    NullSetup setup;
    CommandList list = setup.device->create_command_list("once");
    ASSERT_TRUE(setup.device->submit(std::span(&list, 1)));
    const auto again = setup.device->submit(std::span(&list, 1));
    ASSERT_FALSE(again);
    EXPECT_NE(again.error().message().find("N-106"), std::string::npos);
    EXPECT_FALSE(list.status());
    list.dispatch({});  // Does nothing, and must not crash.
}

TEST(BackendSpec, ReadsWhatItWrites) {
    for (const char* text : {"vulkan", "gl:osmesa", "cpu:double:lanes=8:threads=2", "cpu:threads=3",
                             "cpu:consistent:sanitize:hostile=7:lanes=4", "cpu:hostile:threads=1"}) {
        const auto spec = BackendSpec::parse(text);
        ASSERT_TRUE(spec) << spec.error().message();
        EXPECT_EQ(spec->text(), text);
    }
    for (const char* text : {"", ":", "gl:", "GL", "gl:lanes=0", "gl:lanes=x", "gl:lanes=4:lanes=4", "gl:speed=1",
                             "gl:lanes=4:osmesa", "gl:lanes=99999999999", "cpu:traps:traps", "cpu:fast:traps:traps",
                             "cpu:hostile=0", "cpu:hostile=7:hostile=8"})
        EXPECT_FALSE(BackendSpec::parse(text)) << text;
}

/// A backend whose driver is not there.
class MissingBackend final : public Backend {
  public:
    std::string_view name() const override { return "missing"; }
    std::span<const Mode> modes() const override { return {}; }
    Expected<std::vector<AdapterInfo>> adapters() override { return error(); }
    Expected<std::unique_ptr<BackendDevice>> create_device(const BackendDeviceDesc&) override { return error(); }

  private:
    static std::unexpected<Error> error() {
        return fail(ErrorCode::not_found, "open driver", "'libmissing.so'", "there is no such library", "Install it.");
    }
};

TEST(Instance, OneMissingDriverLeavesTheOthersUsable) {
    const auto log = std::make_shared<nacre::test::NullLog>();
    log->capabilities = nacre::test::full_capabilities();
    std::vector<std::unique_ptr<Backend>> backends;
    backends.push_back(std::make_unique<MissingBackend>());
    backends.push_back(std::make_unique<nacre::test::NullBackend>(log));
    const Instance instance(std::move(backends));
    ASSERT_EQ(instance.adapters().size(), 1u);
    ASSERT_EQ(instance.unavailable().size(), 1u);
    EXPECT_NE(instance.unavailable()[0].error.message().find("libmissing.so"), std::string::npos);
    EXPECT_EQ(instance.create_device({.backend = "missing"}).error().code, ErrorCode::not_found);
    const auto device = instance.create_device();
    ASSERT_TRUE(device);
    EXPECT_EQ((*device)->adapter().backend, "null");
}

TEST(Instance, NamesTheReasonsWhereNothingWorks) {
    std::vector<std::unique_ptr<Backend>> backends;
    backends.push_back(std::make_unique<MissingBackend>());
    const Instance instance(std::move(backends));
    const auto device = instance.create_device();
    ASSERT_FALSE(device);
    EXPECT_NE(device.error().message().find("libmissing.so"), std::string::npos) << device.error().message();
}

TEST(Instance, NamesWhatItKnows) {
    NullSetup setup;
    const auto unknown = setup.instance->create_device({.backend = "metal"});
    ASSERT_FALSE(unknown);
    EXPECT_NE(unknown.error().message().find("'null'"), std::string::npos);
    EXPECT_FALSE(setup.instance->create_device({.backend = "null:fast"}));
    EXPECT_FALSE(setup.instance->create_device({.backend = "null:lanes=4"}));
    EXPECT_TRUE(setup.instance->create_device({.backend = "null:other:threads=2"}));
    EXPECT_FALSE(setup.instance->create_device({.restriction = "toaster"}));
}

}  // namespace
}  // namespace nacre::rhi
