// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <string_view>

/// @file
/// Shows on standard error what a long step is doing.
///
///     Progress progress("compiling shaders", shaders.size());
///     for (std::size_t i = 0; i < shaders.size(); ++i) {
///         progress.update(i, shaders[i].name);
///         ...
///     }
///
/// On a terminal it is one line that is overwritten and vanishes at the end; elsewhere (a log file) it is a plain
/// line now and then. A step that takes less than half a second shows nothing.
/// NACRE_PROGRESS=off in the environment hides it, NACRE_PROGRESS=plain asks for plain lines.

namespace nacre {

/// Where and how progress is shown.
struct ProgressOutput {
    enum class Style { hidden, line, plain };
    std::FILE* file = stderr;
    Style style = Style::plain;
    std::chrono::milliseconds delay{500};          ///< Nothing is shown before this.
    std::chrono::milliseconds line_interval{100};  ///< Between two changes of the line.
    std::chrono::milliseconds plain_interval{5000};

    /// Standard error; `line` on a terminal; as NACRE_PROGRESS says.
    static ProgressOutput standard();
};

/// One step, from construction to destruction. `update` may be called from any thread. Several may be alive: the one
/// made last is shown.
class Progress {
  public:
    /// @param step   what is done, as in "compiling shaders"
    /// @param total  number of items; 0 where it is not known
    explicit Progress(std::string_view step, std::uint64_t total = 0,
                      const ProgressOutput& output = ProgressOutput::standard());
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;
    ~Progress();

    /// Says that `done` items are complete and which one is at work. Cheap: it may be called for every item.
    void update(std::uint64_t done, std::string_view item = {});

  private:
    using Clock = std::chrono::steady_clock;

    ProgressOutput output_;
    std::string step_;
    std::uint64_t total_;
    Clock::time_point start_ = Clock::now();
    Clock::time_point last_shown_{};
    bool was_shown_ = false;
    Progress* outer_ = nullptr;
};

/// While it lives, the progress line is not on the terminal and not drawn, so that other lines can be written.
class ProgressLinePause {
  public:
    ProgressLinePause();
    ProgressLinePause(const ProgressLinePause&) = delete;
    ProgressLinePause& operator=(const ProgressLinePause&) = delete;
    ~ProgressLinePause() = default;

  private:
    std::unique_lock<std::recursive_mutex> lock_;
};

}  // namespace nacre
