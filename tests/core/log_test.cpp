// SPDX-License-Identifier: Apache-2.0
#include "core/log.h"

#include <gmock/gmock.h>

#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace nacre {
namespace {

class LogTest : public testing::Test {
  protected:
    void SetUp() override {
        previous_ = set_log_callback(
            [this](LogLevel level, std::string_view message) { messages_.emplace_back(level, message); });
    }
    void TearDown() override {
        set_log_callback(previous_);
        set_log_level(level_);
    }
    std::vector<std::pair<LogLevel, std::string>> messages_;
    LogCallback previous_;
    LogLevel level_ = log_level();
};

TEST_F(LogTest, MessagesBelowTheLevelAreNotShown) {
    set_log_level(LogLevel::warning);
    log_message(LogLevel::info, "hidden");
    log_message(LogLevel::warning, "shown");
    log_message(LogLevel::error, "also shown");
    log_message(LogLevel::off, "off is no level of a message");
    EXPECT_THAT(messages_, testing::ElementsAre(testing::Pair(LogLevel::warning, "shown"),
                                                testing::Pair(LogLevel::error, "also shown")));
    EXPECT_FALSE(log_is_on(LogLevel::info));
    set_log_level(LogLevel::off);
    log_message(LogLevel::error, "hidden");
    EXPECT_EQ(messages_.size(), 2U);
}

TEST_F(LogTest, CallsFromSeveralThreadsAreSerialized) {
    set_log_level(LogLevel::info);
    {
        std::vector<std::jthread> threads;
        for (int i = 0; i < 4; ++i)
            threads.emplace_back([] {
                for (int n = 0; n < 100; ++n) log_message(LogLevel::info, "from a thread");
            });
    }
    EXPECT_EQ(messages_.size(), 400U);
}

TEST_F(LogTest, WithoutACallbackTheMessageGoesToStandardError) {
    set_log_callback({});
    testing::internal::CaptureStderr();
    log_message(LogLevel::warning, "a {} that is not a format");
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "[warning] a {} that is not a format\n");
}

TEST(LogLevelName, IsWhatTheEnvironmentVariableTakes) {
    EXPECT_EQ(name_of(LogLevel::trace), "trace");
    EXPECT_EQ(name_of(LogLevel::off), "off");
}

}  // namespace
}  // namespace nacre
