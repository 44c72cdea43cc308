// SPDX-License-Identifier: Apache-2.0
// Dispatches with programs written in C++: which workgroups run, with which memory, and what stops them.
#include <stdlib.h>

#include <atomic>
#include <mutex>
#include <set>
#include <thread>

#include "backends/cpu/shader_interface.h"
#include "tests/backends/cpu/cpu_device.h"

namespace nacre::cpu {
namespace {

using namespace std::chrono_literals;

std::uint32_t* values(const ShaderContext& context) {
    return reinterpret_cast<std::uint32_t*>(context.groups[0][0].data);
}

/// Adds 1 for each workgroup at its place in x, y, z order, and the first push constant.
void count_workgroups(const ShaderContext* context, const WorkgroupRange* range) {
    std::uint32_t first = 0;
    std::memcpy(&first, context->push_constants, 4);
    for (std::uint32_t x = range->x_begin; x < range->x_end; ++x) {
        const std::uint64_t at = (std::uint64_t{range->z} * range->count[1] + range->y) * range->count[0] + x;
        if ((at + 1) * 4 > context->groups[0][0].size) continue;
        std::atomic_ref(values(*context)[at]).fetch_add(1 + first);
    }
}

TEST(Dispatches, RunEachWorkgroupOnce) {
    for (const char* backend : {"cpu:threads=1", "cpu:threads=4"}) {
        const auto device = make_device(backend);
        const auto pipeline = make_compute(*device, "count.comp", count_workgroups);
        for (const auto& [x, y, z] : {std::array<std::uint32_t, 3>{1, 1, 1},
                                      {1, 1, 9},
                                      {5000, 1, 1},
                                      {7, 11, 13},
                                      {2, 900, 1},
                                      {3, 1, 500},
                                      {0, 4, 4},
                                      {4, 0, 4}}) {
            const std::uint64_t total = std::uint64_t{x} * y * z;
            const rhi::Buffer buffer = make_buffer(*device, std::max<std::uint64_t>(total, 1) * 4 + 4);
            rhi::CommandList list = device->create_command_list();
            prepare(*device, list, pipeline, buffer);
            list.set_push_constants(std::array<std::uint32_t, 4>{41, 0, 0, 0});
            list.dispatch({x, y, z});
            run(*device, std::move(list));
            const auto counts = as_values<std::uint32_t>(ok(device->read_buffer(buffer)));
            for (std::uint64_t i = 0; i < counts.size(); ++i)
                ASSERT_EQ(counts[i], i < total ? 42u : 0u) << x << "x" << y << "x" << z << " at " << i;
        }
    }
}

TEST(Dispatches, ReadIndirectArgumentsWithinTheBuffer) {
    const auto device = make_device();
    device->set_message_callback([](const rhi::Message&) {});
    const auto pipeline = make_compute(*device, "count.comp", count_workgroups);
    const rhi::Buffer buffer = make_buffer(*device, 256), arguments = make_buffer(*device, 32);
    ok(device->write_buffer(arguments,
                            std::span<const std::uint32_t>(std::array<std::uint32_t, 8>{9, 9, 9, 9, 3, 5, 2, 9})));
    const auto submit = [&](std::uint64_t offset) {
        rhi::CommandList list = device->create_command_list();
        prepare(*device, list, pipeline, buffer);
        list.dispatch_indirect(arguments, offset);
        return device->submit(std::move(list));
    };
    ok(device->wait(ok(submit(16))));
    const auto counts = as_values<std::uint32_t>(ok(device->read_buffer(buffer)));
    for (std::size_t i = 0; i < counts.size(); ++i) EXPECT_EQ(counts[i], i < 30 ? 1u : 0u) << i;
    // Arguments that would lie behind the end are none, also where nothing checks before.
    const auto unchecked = make_device("cpu", {.validation = false});
    const auto other_pipeline = make_compute(*unchecked, "count.comp", count_workgroups);
    const rhi::Buffer other = make_buffer(*unchecked, 256), short_arguments = make_buffer(*unchecked, 256);
    ok(unchecked->write_buffer(short_arguments, std::span<const std::uint32_t>(std::vector<std::uint32_t>(64, 2))));
    rhi::CommandList list = unchecked->create_command_list();
    prepare(*unchecked, list, other_pipeline, other);
    for (const std::uint64_t offset : {std::uint64_t{248}, std::uint64_t{256}, std::uint64_t{1} << 40})
        list.dispatch_indirect(short_arguments, offset);
    ok(unchecked->wait(ok(unchecked->submit(std::move(list)))));
    EXPECT_FALSE(unchecked->is_lost());
    for (const std::uint32_t count : as_values<std::uint32_t>(ok(unchecked->read_buffer(other)))) EXPECT_EQ(count, 0u);
}

std::mutex memory_mutex;
std::set<std::byte*> memory_seen;
std::atomic<int> memory_wrong{0};
std::atomic<int> threads_here{0};

void use_workgroup_memory(const ShaderContext*, const WorkgroupRange* range) {
    constexpr std::size_t size = 40'000;
    if (reinterpret_cast<std::uintptr_t>(range->memory) % 64 != 0) ++memory_wrong;
    {
        const std::scoped_lock lock(memory_mutex);
        memory_seen.insert(range->memory);
    }
    ++threads_here;
    const auto mark = static_cast<std::byte>(range->x_begin);
    for (std::size_t i = 0; i < size; ++i) range->memory[i] = mark;
    for (int i = 0; i < 2000 && threads_here < 2; ++i) std::this_thread::sleep_for(1ms);
    for (std::size_t i = 0; i < size; ++i)
        if (range->memory[i] != mark) ++memory_wrong;
}

TEST(Dispatches, GiveEachThreadMemoryOfItsOwn) {
    const auto device = make_device("cpu:threads=3");
    const auto pipeline = make_compute(*device, "memory.comp", use_workgroup_memory, 40'000);
    memory_seen.clear();
    memory_wrong = 0, threads_here = 0;
    const rhi::Buffer buffer = make_buffer(*device, 64);
    rhi::CommandList list = device->create_command_list();
    prepare(*device, list, pipeline, buffer);
    list.dispatch({64, 1, 1});
    run(*device, std::move(list));
    EXPECT_EQ(memory_wrong, 0);
    EXPECT_GE(memory_seen.size(), 2u);
    EXPECT_LE(memory_seen.size(), 3u);
}

void never_end(const ShaderContext* context, const WorkgroupRange*) {
    while (std::atomic_ref(context->state->expired).load() == 0) std::this_thread::sleep_for(100us);
}

struct ShortWatchdog {
    explicit ShortWatchdog(const char* seconds) { ::setenv("NACRE_CPU_WATCHDOG_SECONDS", seconds, 1); }
    ~ShortWatchdog() { ::unsetenv("NACRE_CPU_WATCHDOG_SECONDS"); }
};

TEST(Dispatches, ThatDoNotEndLoseTheDevice) {
    const ShortWatchdog watchdog("0.1");
    auto device = make_device();
    const auto endless = make_compute(*device, "endless.comp", never_end);
    const rhi::Buffer buffer = make_buffer(*device, 256);
    rhi::CommandList list = device->create_command_list();
    prepare(*device, list, endless, buffer);
    list.dispatch({4, 1, 1});
    list.fill_buffer(buffer, 7);
    const rhi::Fence fence = ok(device->submit(std::move(list)));
    const auto waited = device->wait(fence);
    ASSERT_FALSE(waited);
    EXPECT_EQ(waited.error().code, ErrorCode::device_lost);
    EXPECT_THAT(waited.error().message(), testing::HasSubstr("endless.comp"));
    EXPECT_THAT(waited.error().message(), testing::HasSubstr("0.1 s"));
    EXPECT_TRUE(device->is_lost());
    EXPECT_EQ(device->create_buffer({.size = 4, .usage = rhi::BufferUsage::storage}).error().code,
              ErrorCode::device_lost);
    device->destroy(buffer);
    device.reset();

    const auto fresh = make_device();
    const auto pipeline = make_compute(*fresh, "count.comp", count_workgroups);
    const rhi::Buffer again = make_buffer(*fresh, 256);
    rhi::CommandList work = fresh->create_command_list();
    prepare(*fresh, work, pipeline, again);
    work.dispatch({64, 1, 1});
    run(*fresh, std::move(work));
    for (const std::uint32_t count : as_values<std::uint32_t>(ok(fresh->read_buffer(again)))) EXPECT_EQ(count, 1u);
}

TEST(Dispatches, OfAbsurdIndirectCountsAreStoppedToo) {
    // No program here looks at the state: what runs is many short calls.
    const ShortWatchdog watchdog("0.2");
    const auto device = make_device();
    device->set_message_callback([](const rhi::Message&) {});
    const auto pipeline = make_compute(*device, "short.comp", [](const ShaderContext*, const WorkgroupRange*) {});
    const rhi::Buffer arguments = make_buffer(*device, 64);
    rhi::CommandList list = device->create_command_list();
    prepare(*device, list, pipeline, make_buffer(*device, 64));
    list.fill_buffer(arguments, ~0u);
    list.dispatch_indirect(arguments);
    const auto waited = device->wait(ok(device->submit(std::move(list))));
    ASSERT_FALSE(waited);
    EXPECT_EQ(waited.error().code, ErrorCode::device_lost);
    EXPECT_THAT(waited.error().message(), testing::HasSubstr("short.comp"));
}

TEST(Dispatches, ThatRunOutOfMemoryLoseTheDevice) {
    const auto device = make_device();
    const auto pipeline = make_compute(
        *device, "greedy.comp", [](const ShaderContext*, const WorkgroupRange*) {}, std::uint64_t{1} << 60);
    rhi::CommandList list = device->create_command_list();
    prepare(*device, list, pipeline, make_buffer(*device, 64));
    list.dispatch({1, 1, 1});
    const auto waited = device->wait(ok(device->submit(std::move(list))));
    ASSERT_FALSE(waited);
    EXPECT_EQ(waited.error().code, ErrorCode::device_lost);
    EXPECT_THAT(waited.error().message(), testing::HasSubstr("out of memory"));
}

std::atomic<bool> gate_is_open{false};

void wait_at_the_gate(const ShaderContext* context, const WorkgroupRange* range) {
    while (!gate_is_open) std::this_thread::sleep_for(100us);
    count_workgroups(context, range);
}

TEST(Dispatches, RunWhileTheCallerGoesOn) {
    const auto device = make_device();
    const auto pipeline = make_compute(*device, "gate.comp", wait_at_the_gate);
    const rhi::Buffer buffer = make_buffer(*device, 256);
    gate_is_open = false;
    std::vector<rhi::Fence> fences;
    for (int i = 0; i < 5; ++i) {
        rhi::CommandList list = device->create_command_list();
        prepare(*device, list, pipeline, buffer);
        list.dispatch({2, 1, 1});
        fences.push_back(ok(device->submit(std::move(list))));
    }
    EXPECT_FALSE(device->is_complete(fences.front()));
    const auto waited = device->wait(fences.back(), 20ms);
    ASSERT_FALSE(waited);
    EXPECT_EQ(waited.error().code, ErrorCode::timeout);
    gate_is_open = true;
    for (const rhi::Fence fence : fences) ok(device->wait(fence));
    EXPECT_TRUE(device->is_complete(fences.back()));
    EXPECT_EQ(as_values<std::uint32_t>(ok(device->read_buffer(buffer)))[1], 5u);
}

TEST(Dispatches, SeeNothingOfTheListBefore) {
    // Without validation, which demands that all constants are set.
    const auto device = make_device("cpu", {.validation = false});
    const auto pipeline =
        make_compute(*device, "constants.comp", [](const ShaderContext* context, const WorkgroupRange*) {
            std::memcpy(values(*context), context->push_constants, 16);
        });
    const rhi::Buffer buffer = make_buffer(*device, 16);
    ok(device->write_buffer(buffer, std::span<const std::uint32_t>(std::array<std::uint32_t, 4>{9, 9, 9, 9})));
    rhi::CommandList first = device->create_command_list();
    first.set_push_constants(std::array<std::uint32_t, 4>{1, 2, 3, 4});
    run(*device, std::move(first));
    rhi::CommandList second = device->create_command_list();
    second.set_pipeline(pipeline);
    second.set_bind_group(0, bind(*device, pipeline, buffer));
    second.set_push_constants(std::uint32_t{5}, 8);
    second.dispatch({1, 1, 1});
    run(*device, std::move(second));
    EXPECT_EQ(as_values<std::uint32_t>(ok(device->read_buffer(buffer))), (std::vector<std::uint32_t>{0, 0, 5, 0}));
}

}  // namespace
}  // namespace nacre::cpu
