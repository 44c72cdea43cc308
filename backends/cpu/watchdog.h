// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "backends/cpu/shader_interface.h"

/// @file
/// Stops shaders that do not end.

namespace nacre::cpu {

/// The limit that NACRE_CPU_WATCHDOG_SECONDS in the environment sets: 10 s where it is not set or no number, 0 for
/// none.
std::chrono::nanoseconds watchdog_limit();

/// Watches one thread's steps. A step costs two atomic writes; a thread of its own wakes up only while one runs that
/// began a limit ago.
class Watchdog {
  public:
    explicit Watchdog(std::chrono::nanoseconds limit);
    ~Watchdog();
    Watchdog(const Watchdog&) = delete;
    Watchdog& operator=(const Watchdog&) = delete;

    /// What running shaders look at: it expires once a step has run for longer than the limit, and stays so.
    [[nodiscard]] ExecutionState& state() { return state_; }
    [[nodiscard]] bool has_expired() const;
    [[nodiscard]] std::chrono::nanoseconds limit() const { return limit_; }

    /// The time between construction and destruction counts as one step.
    class Step {
      public:
        explicit Step(Watchdog& watchdog) : watchdog_(watchdog) { watchdog_.begin(); }
        ~Step() { watchdog_.end(); }
        Step(const Step&) = delete;
        Step& operator=(const Step&) = delete;

      private:
        Watchdog& watchdog_;
    };

  private:
    using Clock = std::chrono::steady_clock;
    void begin();
    void end() { began_.store(0); }
    void watch();

    const std::chrono::nanoseconds limit_;
    ExecutionState state_{};
    std::atomic<Clock::rep> began_{0};   ///< When the running step began, as the clock counts; 0: none runs.
    std::atomic<bool> is_asleep_{true};  ///< The thread waits for a step to begin.
    std::mutex mutex_;
    std::condition_variable changed_;
    bool ending_ = false;
    std::thread thread_;
};

}  // namespace nacre::cpu
