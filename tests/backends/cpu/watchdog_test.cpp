// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/watchdog.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <atomic>
#include <thread>

namespace nacre::cpu {
namespace {

using namespace std::chrono_literals;

bool expires_within(const Watchdog& watchdog, std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (!watchdog.has_expired() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(1ms);
    return watchdog.has_expired();
}

TEST(Watchdogs, ExpireInAStepThatIsTooLong) {
    Watchdog watchdog(30ms);
    const auto begin = std::chrono::steady_clock::now();
    {
        const Watchdog::Step step(watchdog);
        EXPECT_TRUE(expires_within(watchdog, 10s));
        EXPECT_GE(std::chrono::steady_clock::now() - begin, 30ms);
    }
    EXPECT_TRUE(watchdog.has_expired());
    // What shaders look at.
    EXPECT_NE(std::atomic_ref(watchdog.state().expired).load(), 0u);
}

TEST(Watchdogs, AllowManyShortSteps) {
    Watchdog watchdog(400ms);
    for (int i = 0; i < 100; ++i) {
        const Watchdog::Step step(watchdog);
        std::this_thread::sleep_for(8ms);
    }
    // Nothing runs: no time counts.
    std::this_thread::sleep_for(500ms);
    EXPECT_FALSE(watchdog.has_expired());
    const Watchdog::Step step(watchdog);
    EXPECT_TRUE(expires_within(watchdog, 10s)) << "it does not watch any more";
}

TEST(Watchdogs, WithoutALimitNeverExpire) {
    Watchdog watchdog(0ns);
    const Watchdog::Step step(watchdog);
    EXPECT_FALSE(expires_within(watchdog, 50ms));
}

TEST(Watchdogs, ReadTheirLimitFromTheEnvironment) {
    ::unsetenv("NACRE_CPU_WATCHDOG_SECONDS");
    EXPECT_EQ(watchdog_limit(), 10s);
    for (const auto& [text, limit] : {std::pair<const char*, std::chrono::nanoseconds>{"0.25", 250ms},
                                      {"0", 0s},
                                      {"60", 60s},
                                      {"many", 10s},
                                      {"", 10s},
                                      {"-3", 10s},
                                      {"5 s", 10s},
                                      {"nan", 10s}}) {
        ::setenv("NACRE_CPU_WATCHDOG_SECONDS", text, 1);
        EXPECT_EQ(watchdog_limit(), limit) << text;
    }
    ::unsetenv("NACRE_CPU_WATCHDOG_SECONDS");
}

}  // namespace
}  // namespace nacre::cpu
