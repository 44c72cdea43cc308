// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/scheduler.h"

#include <algorithm>
#include <thread>

#include "backends/cpu/task_loop.h"
#include "backends/cpu/thread_pool.h"

#ifndef NACRE_CPU_PLAIN_THREADS
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>
#endif

namespace nacre::cpu {

#ifdef NACRE_CPU_PLAIN_THREADS

std::unique_ptr<Scheduler> Scheduler::create(std::uint32_t threads) {
    return std::make_unique<ThreadPool>(threads ? threads : std::max(1u, std::thread::hardware_concurrency()));
}

#else

namespace {

class TbbScheduler : public Scheduler {
  public:
    explicit TbbScheduler(std::uint32_t threads) : thread_count_(threads), arena_(static_cast<int>(threads)) {
        // oneTBB starts no more threads than the machine has cores, unless it is told that more are wanted.
        if (threads > static_cast<std::uint32_t>(tbb::info::default_concurrency()))
            more_threads_ =
                std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, threads);
    }

    [[nodiscard]] std::uint32_t thread_count() const override { return thread_count_; }

    void run(std::uint32_t count, const std::function<void(std::uint32_t, std::uint32_t)>& task) override {
        if (count == 0) return;
        std::atomic<std::uint32_t> next{0};
        const std::uint32_t loops = std::min(count, thread_count_);
        if (loops == 1) {
            run_tasks(next, count, 0, task);
            return;
        }
        arena_.execute([&] {
            // One loop for each thread, which takes indices in rising order: tasks of very different length balance,
            // and nothing is paid for splitting ranges.
            tbb::parallel_for(
                std::uint32_t{0}, loops, std::uint32_t{1},
                [&](std::uint32_t) {
                    run_tasks(next, count, static_cast<std::uint32_t>(tbb::this_task_arena::current_thread_index()),
                              task);
                },
                tbb::simple_partitioner());
        });
    }

  private:
    const std::uint32_t thread_count_;
    std::unique_ptr<tbb::global_control> more_threads_;
    tbb::task_arena arena_;
};

}  // namespace

std::unique_ptr<Scheduler> Scheduler::create(std::uint32_t threads) {
    return std::make_unique<TbbScheduler>(
        threads ? threads : static_cast<std::uint32_t>(std::max(1, tbb::info::default_concurrency())));
}

#endif

}  // namespace nacre::cpu
