// SPDX-License-Identifier: Apache-2.0
#include "core/log.h"

#include <spdlog/logger.h>
#include <spdlog/sinks/stdout_color_sinks.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "core/progress.h"

namespace nacre {
namespace {

constexpr std::array<std::string_view, 6> level_names{"trace", "debug", "info", "warning", "error", "off"};

struct Log {
    std::mutex mutex;
    LogCallback callback;
    std::atomic<LogLevel> level{LogLevel::warning};
    spdlog::logger sink{"nacre", std::make_shared<spdlog::sinks::stderr_color_sink_st>()};

    Log() {
        sink.set_level(spdlog::level::trace);
        sink.set_pattern("%^[%l]%$ %v");
        sink.flush_on(spdlog::level::trace);
        const char* wanted = std::getenv("NACRE_LOG");
        if (!wanted || !*wanted) return;
        for (std::size_t index = 0; index < level_names.size(); ++index)
            if (level_names[index] == wanted) {
                level = static_cast<LogLevel>(index);
                return;
            }
        sink.warn("NACRE_LOG is '{}'; it can be trace, debug, info, warning, error or off", wanted);
    }
};

/// Never destroyed: threads and drivers may log while the program ends.
Log& log() {
    static Log* const instance = new Log;
    return *instance;
}

spdlog::level::level_enum spdlog_level(LogLevel level) {
    switch (level) {
        case LogLevel::trace: return spdlog::level::trace;
        case LogLevel::debug: return spdlog::level::debug;
        case LogLevel::info: return spdlog::level::info;
        case LogLevel::warning: return spdlog::level::warn;
        case LogLevel::error: return spdlog::level::err;
        case LogLevel::off: break;
    }
    return spdlog::level::off;
}

}  // namespace

std::string_view name_of(LogLevel level) {
    const auto index = static_cast<std::size_t>(level);
    return index < level_names.size() ? level_names[index] : "unknown";
}

bool log_is_on(LogLevel level) {
    return level != LogLevel::off && level >= log().level.load(std::memory_order_relaxed);
}

void log_message(LogLevel level, std::string_view message) {
    if (!log_is_on(level)) return;
    Log& target = log();
    std::lock_guard lock(target.mutex);
    if (target.callback) {
        target.callback(level, message);
        return;
    }
    const ProgressLinePause pause;
    target.sink.log(spdlog_level(level), spdlog::string_view_t(message.data(), message.size()));
}

void set_log_level(LogLevel level) { log().level.store(level, std::memory_order_relaxed); }

LogLevel log_level() { return log().level.load(std::memory_order_relaxed); }

LogCallback set_log_callback(LogCallback callback) {
    Log& target = log();
    std::lock_guard lock(target.mutex);
    return std::exchange(target.callback, std::move(callback));
}

}  // namespace nacre
