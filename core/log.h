// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string_view>

/// @file
/// Messages for the person who runs the program. They go to standard error as
/// `[warning] cache folder '/x' cannot be written; going on without a cache`.
///
///     log_message(LogLevel::warning, fmt::format("texture '{}' has no mips", name));
///     set_log_level(LogLevel::debug);      // or: NACRE_LOG=debug in the environment
///
/// A failure that the caller can handle is an `Error`, not a log message; never both.

namespace nacre {

enum class LogLevel {
    trace,    ///< Every call; for finding bugs in Nacre.
    debug,    ///< Decisions: which extension, which fallback, which cache entry.
    info,     ///< What a long step did.
    warning,  ///< The result is right but something was not as asked. The default level.
    error,    ///< Something failed and nobody else can report it (a driver's callback, a thread).
    off,      ///< As a level for `set_log_level`: nothing is shown.
};

/// Stable lower-case name of a level ("warning", ...), as NACRE_LOG takes it.
std::string_view name_of(LogLevel level);

/// Writes one message if `level` is at or above the current level. Callable from any thread.
void log_message(LogLevel level, std::string_view message);

/// Shows messages of this level and above from now on. The level at start is that of the environment
/// variable NACRE_LOG (trace, debug, info, warning, error, off), `warning` where it is not set.
void set_log_level(LogLevel level);
LogLevel log_level();

/// Whether a message of this level would be shown; for messages that are costly to put together.
bool log_is_on(LogLevel level);

using LogCallback = std::function<void(LogLevel, std::string_view)>;

/// Sends messages to `callback` instead of standard error (an empty one restores standard error) and
/// returns the previous callback. Calls are serialized; the callback must not log.
LogCallback set_log_callback(LogCallback callback);

}  // namespace nacre
