// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "backends/cpu/scheduler.h"

namespace nacre::cpu {

/// A scheduler of plain threads, all of whose synchronization the thread sanitizer understands. The caller of `run`
/// works too.
class ThreadPool : public Scheduler {
  public:
    /// @param threads  at least 1
    explicit ThreadPool(std::uint32_t threads);
    ~ThreadPool() override;

    [[nodiscard]] std::uint32_t thread_count() const override { return thread_count_; }
    void run(std::uint32_t count, const std::function<void(std::uint32_t, std::uint32_t)>& task) override;

  private:
    void loop(std::uint32_t thread);
    /// Works on the tasks of the round; keeps the first exception.
    void work(std::uint32_t count, std::uint32_t thread, const std::function<void(std::uint32_t, std::uint32_t)>& task);

    const std::uint32_t thread_count_;
    std::mutex mutex_;
    std::condition_variable started_, finished_;
    std::uint64_t round_ = 0;    ///< Rises with every `run`.
    std::uint32_t working_ = 0;  ///< Threads that have not finished the round.
    bool ending_ = false;
    const std::function<void(std::uint32_t, std::uint32_t)>* task_ = nullptr;
    std::uint32_t count_ = 0;
    std::exception_ptr thrown_;  ///< By a task of the round.
    std::atomic<std::uint32_t> next_{0};
    std::vector<std::thread> threads_;  ///< All but the caller's.
};

}  // namespace nacre::cpu
