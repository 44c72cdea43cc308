// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

/// @file
/// Threads of a device: oneTBB, or a plain pool in builds for the thread sanitizer, which cannot see into oneTBB.

namespace nacre::cpu {

class Scheduler {
  public:
    /// @param threads  at least 1; 0: one for each core
    static std::unique_ptr<Scheduler> create(std::uint32_t threads);
    virtual ~Scheduler() = default;

    [[nodiscard]] virtual std::uint32_t thread_count() const = 0;

    /// Runs `task(index, thread)` for every index in [0, count), in any order, on all threads, and returns when all are
    /// done. `thread` is below `thread_count()`, and no two tasks that run at once have the same. Tasks must not call
    /// `run` themselves. One `run` at a time. Where a task throws (memory may run out), tasks may be left out, and an
    /// exception leaves `run` once no task runs any more.
    virtual void run(std::uint32_t count,
                     const std::function<void(std::uint32_t index, std::uint32_t thread)>& task) = 0;
};

}  // namespace nacre::cpu
