// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/scheduler.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cfenv>
#include <chrono>
#include <new>
#include <thread>
#include <vector>

#include "backends/cpu/queue.h"
#include "backends/cpu/thread_pool.h"

namespace nacre::cpu {
namespace {

struct Kind {
    const char* name;
    std::unique_ptr<Scheduler> (*make)(std::uint32_t threads);
};
constexpr Kind kinds[]{
    {"usual", [](std::uint32_t threads) { return Scheduler::create(threads); }},
    {"plain",
     [](std::uint32_t threads) -> std::unique_ptr<Scheduler> { return std::make_unique<ThreadPool>(threads); }},
};

class Schedulers : public testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(All, Schedulers, testing::ValuesIn(kinds), [](const auto& kind) { return kind.param.name; });

TEST_P(Schedulers, RunEveryIndexOnce) {
    for (const std::uint32_t threads : {1u, 2u, 5u}) {
        const auto scheduler = GetParam().make(threads);
        EXPECT_EQ(scheduler->thread_count(), threads);
        for (const std::uint32_t count : {0u, 1u, 2u, 7u, 1000u}) {
            std::vector<std::atomic<int>> calls(count);
            std::vector<std::atomic<int>> in_use(threads);
            std::atomic<int> wrong{0};
            scheduler->run(count, [&](std::uint32_t index, std::uint32_t thread) {
                if (index >= count || thread >= threads) {
                    ++wrong;
                    return;
                }
                // No two tasks at once have the same thread.
                if (++in_use[thread] != 1) ++wrong;
                ++calls[index];
                --in_use[thread];
            });
            EXPECT_EQ(wrong, 0) << threads << " threads, " << count << " tasks";
            for (std::uint32_t i = 0; i < count; ++i) EXPECT_EQ(calls[i], 1) << i;
        }
    }
}

TEST_P(Schedulers, ReturnOnlyWhenAllIsDone) {
    const auto scheduler = GetParam().make(3);
    for (int round = 0; round < 300; ++round) {
        std::vector<std::uint32_t> values(16);
        scheduler->run(16, [&](std::uint32_t index, std::uint32_t) { values[index] = index + 1; });
        for (std::uint32_t i = 0; i < 16; ++i) ASSERT_EQ(values[i], i + 1) << "round " << round;
    }
}

TEST_P(Schedulers, HaveAsManyThreadsAsAskedForEvenBeyondTheCores) {
    constexpr std::uint32_t threads = 6;
    const auto scheduler = GetParam().make(threads);
    std::atomic<std::uint32_t> here{0};
    std::atomic<bool> all_met{true};
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    scheduler->run(threads, [&](std::uint32_t, std::uint32_t) {
        ++here;
        while (here < threads && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
        if (here < threads) all_met = false;
    });
    EXPECT_TRUE(all_met) << "tasks that wait for each other were not run at the same time";
}

TEST_P(Schedulers, ComputeWithTheUsualRounding) {
    const auto scheduler = GetParam().make(2);
    ASSERT_EQ(std::fesetround(FE_UPWARD), 0);
    std::atomic<int> wrong{0};
    scheduler->run(64, [&](std::uint32_t, std::uint32_t) {
        if (std::fegetround() != FE_TONEAREST) ++wrong;
    });
    const int after = std::fegetround();
    std::fesetround(FE_TONEAREST);
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(after, FE_UPWARD) << "the caller's rounding was changed";
}

TEST_P(Schedulers, PassOnWhatATaskThrows) {
    for (const std::uint32_t threads : {1u, 3u}) {
        const auto scheduler = GetParam().make(threads);
        std::atomic<int> running{0};
        EXPECT_THROW(scheduler->run(100,
                                    [&](std::uint32_t index, std::uint32_t) {
                                        if (index % 7 == 3) throw std::bad_alloc();
                                        ++running;
                                        std::this_thread::sleep_for(std::chrono::microseconds(100));
                                        --running;
                                    }),
                     std::bad_alloc);
        EXPECT_EQ(running, 0) << "a task ran on";
        std::atomic<int> calls{0};
        scheduler->run(100, [&](std::uint32_t, std::uint32_t) { ++calls; });
        EXPECT_EQ(calls, 100);
    }
}

TEST(Queues, RunInOrderAndDrain) {
    std::vector<int> order;
    Queue queue;
    queue.drain();
    for (int i = 0; i < 100; ++i) queue.post([&order, i] { order.push_back(i); });
    queue.drain();
    ASSERT_EQ(order.size(), 100u);
    for (int i = 0; i < 100; ++i) EXPECT_EQ(order[static_cast<std::size_t>(i)], i);
}

}  // namespace
}  // namespace nacre::cpu
