// SPDX-License-Identifier: Apache-2.0
// Specs, adapters, faults and memory.
#include <chrono>
#include <thread>

#include "tests/backends/cpu/cpu_device.h"

namespace nacre::cpu {
namespace {

TEST(CpuBackends, DescribeTheMachine) {
    const auto adapters = instance().adapters();
    ASSERT_EQ(adapters.size(), 1u);
    EXPECT_EQ(adapters[0].backend, "cpu");
    EXPECT_FALSE(adapters[0].name.empty());
    EXPECT_THAT(adapters[0].driver, testing::HasSubstr("LLVM 19"));
    EXPECT_EQ(adapters[0].api_version, "SPIR-V 1.6");
    EXPECT_TRUE(adapters[0].is_software);
}

TEST(CpuBackends, TakeModesLanesAndThreads) {
    struct Case {
        const char* spec;
        ExecutionMode mode;
        std::uint32_t lanes, subgroup;
    };
    for (const Case& one : {Case{"cpu", ExecutionMode::fast, 8, 8}, Case{"cpu:fast:lanes=4", ExecutionMode::fast, 4, 4},
                            Case{"cpu:lanes=16:threads=1", ExecutionMode::fast, 16, 16},
                            Case{"cpu:consistent:lanes=4", ExecutionMode::consistent, 4, 16}}) {
        const auto device = make_device(one.spec);
        ASSERT_TRUE(device);
        EXPECT_EQ(FakePrograms::last_options.mode, one.mode) << one.spec;
        EXPECT_EQ(FakePrograms::last_options.lanes, one.lanes) << one.spec;
        EXPECT_EQ(device->capabilities().subgroup_size, one.subgroup) << one.spec;
    }
    for (const auto& [spec, text] : {std::pair{"cpu:lanes=5", "5"},
                                     {"cpu:lanes=32", "4, 8 or 16"},
                                     {"cpu:slow", "slow"},
                                     {"cpu:threads=100000", "100000"}}) {
        const auto device = instance().create_device({.backend = spec});
        ASSERT_FALSE(device) << spec;
        EXPECT_EQ(device.error().code, ErrorCode::invalid_argument);
        EXPECT_THAT(device.error().message(), testing::HasSubstr(text));
    }
    const auto absent = instance().create_device({.backend = "cpu", .adapter = 3});
    ASSERT_FALSE(absent);
    EXPECT_EQ(absent.error().code, ErrorCode::not_found);
}

TEST(CpuDevices, CountTheirMemory) {
    const auto device = make_device();
    const auto before = device->memory_statistics();
    const rhi::Buffer buffer = make_buffer(*device, 1 << 20);
    const rhi::Texture texture = ok(device->create_texture(
        {.format = rhi::Format::rgba8_unorm, .width = 512, .height = 512, .usage = rhi::TextureUsage::sampled}));
    const auto with = device->memory_statistics();
    EXPECT_GE(with.reserved_bytes - before.reserved_bytes, std::uint64_t{2} << 20);
    EXPECT_EQ(with.driver_allocations - before.driver_allocations, 2u);
    device->destroy(buffer);
    device->destroy(texture);
    ok(device->wait_idle());
    EXPECT_EQ(device->memory_statistics().reserved_bytes, before.reserved_bytes);
}

TEST(CpuDevices, FailPlantedAllocationsAndGoOn) {
    const auto device = make_device("cpu", {.faults = {.fail_allocation = 2}});
    using enum rhi::BufferUsage;
    const rhi::BufferDesc desc{.size = 64, .usage = storage, .name = "victim"};
    ok(device->create_buffer(desc));
    const auto failed = device->create_buffer(desc);
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().code, ErrorCode::out_of_memory);
    EXPECT_THAT(failed.error().message(), testing::HasSubstr("victim"));
    ok(device->create_buffer(desc));
}

TEST(CpuDevices, FailWhereTheMachineHasNoMoreMemory) {
    const auto device = make_device();
    const std::uint64_t most = device->capabilities().max_buffer_size;
    ASSERT_GT(most, std::uint64_t{1} << 28);
    const rhi::BufferDesc desc{.size = most / 3, .usage = rhi::BufferUsage::storage, .name = "third"};
    // Nothing is touched, so the machine itself does not mind.
    const rhi::Buffer first = ok(device->create_buffer(desc)), second = ok(device->create_buffer(desc));
    const auto failed = device->create_buffer({.size = most / 2, .usage = rhi::BufferUsage::storage, .name = "half"});
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().code, ErrorCode::out_of_memory);
    device->destroy(first);
    device->destroy(second);
    ok(device->create_buffer(desc));
}

TEST(CpuDevices, AreLostWhereTheFaultIsPlanted) {
    auto device = make_device("cpu", {.faults = {.lose_device = 3}});
    const rhi::Buffer buffer = make_buffer(*device, 1 << 22);
    int submitted = 0;
    ErrorCode code = ErrorCode::internal;
    for (; submitted < 5; ++submitted) {
        rhi::CommandList list = device->create_command_list();
        for (std::uint32_t i = 0; i < 20; ++i) list.fill_buffer(buffer, i);
        const auto fence = device->submit(std::move(list));
        if (!fence) {
            code = fence.error().code;
            break;
        }
    }
    EXPECT_EQ(submitted, 2);
    EXPECT_EQ(code, ErrorCode::device_lost);
    EXPECT_TRUE(device->is_lost());
    // Freed at once: nothing that was submitted before may still write to it.
    device->destroy(buffer);
    device.reset();
    EXPECT_TRUE(make_device());
}

TEST(CpuDevices, ReportTimeInNanoseconds) {
    using namespace std::chrono;
    const auto device = make_device();
    const rhi::QueryPool pool = ok(device->create_query_pool({.count = 2}));
    const rhi::Buffer buffer = make_buffer(*device, 1 << 22);
    const auto before = steady_clock::now().time_since_epoch();
    rhi::CommandList list = device->create_command_list();
    list.write_timestamp(pool, 1);
    for (std::uint32_t i = 0; i < 10; ++i) list.fill_buffer(buffer, i);
    list.write_timestamp(pool, 0);
    run(*device, std::move(list));
    const auto after = steady_clock::now().time_since_epoch();
    const auto times = ok(device->read_queries(pool, 0, 2));
    ASSERT_EQ(times.size(), 2u);
    EXPECT_GT(times[0], times[1]);
    EXPECT_GE(times[1], static_cast<std::uint64_t>(nanoseconds(before).count()));
    EXPECT_LE(times[0], static_cast<std::uint64_t>(nanoseconds(after).count()));
}

TEST(CpuDevices, LiveSideBySideAndEndInAnyOrder) {
    std::vector<std::unique_ptr<rhi::Device>> devices;
    for (int i = 0; i < 3; ++i) devices.push_back(make_device("cpu:threads=2"));
    std::vector<std::thread> threads;
    for (auto& device : devices)
        threads.emplace_back([&device] {
            for (std::uint32_t round = 0; round < 5; ++round) {
                const rhi::Buffer buffer = make_buffer(*device, 1 << 20);
                rhi::CommandList list = device->create_command_list();
                list.fill_buffer(buffer, round + 3);
                ok(device->submit(std::move(list)));
                const auto values = as_values<std::uint32_t>(ok(device->read_buffer(buffer)));
                EXPECT_EQ(values.front(), round + 3);
                EXPECT_EQ(values.back(), round + 3);
                device->destroy(buffer);
            }
        });
    for (std::thread& thread : threads) thread.join();
    devices.erase(devices.begin() + 1);
    // With work in flight.
    const rhi::Buffer buffer = make_buffer(*devices[0], 1 << 22);
    rhi::CommandList list = devices[0]->create_command_list();
    for (std::uint32_t i = 0; i < 50; ++i) list.fill_buffer(buffer, i);
    ok(devices[0]->submit(std::move(list)));
    devices.clear();
}

}  // namespace
}  // namespace nacre::cpu
