// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/thread_pool.h"

#include <algorithm>
#include <utility>

#include "backends/cpu/task_loop.h"

namespace nacre::cpu {

ThreadPool::ThreadPool(std::uint32_t threads) : thread_count_(std::max(threads, 1u)) {
    for (std::uint32_t thread = 1; thread < thread_count_; ++thread)
        threads_.emplace_back([this, thread] { loop(thread); });
}

ThreadPool::~ThreadPool() {
    {
        const std::scoped_lock lock(mutex_);
        ending_ = true;
    }
    started_.notify_all();
    for (std::thread& thread : threads_) thread.join();
}

void ThreadPool::run(std::uint32_t count, const std::function<void(std::uint32_t, std::uint32_t)>& task) {
    if (count == 0) return;
    if (count == 1 || thread_count_ == 1) {
        next_ = 0;
        run_tasks(next_, count, 0, task);
        return;
    }
    {
        const std::scoped_lock lock(mutex_);
        task_ = &task;
        count_ = count;
        next_ = 0;
        working_ = static_cast<std::uint32_t>(threads_.size());
        ++round_;
    }
    started_.notify_all();
    work(count, 0, task);
    std::unique_lock lock(mutex_);
    finished_.wait(lock, [&] { return working_ == 0; });
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
}

void ThreadPool::work(std::uint32_t count, std::uint32_t thread,
                      const std::function<void(std::uint32_t, std::uint32_t)>& task) {
    try {
        run_tasks(next_, count, thread, task);
    } catch (...) {
        const std::scoped_lock lock(mutex_);
        if (!thrown_) thrown_ = std::current_exception();
    }
}

void ThreadPool::loop(std::uint32_t thread) {
    std::uint64_t seen = 0;
    std::unique_lock lock(mutex_);
    while (true) {
        started_.wait(lock, [&] { return ending_ || round_ != seen; });
        if (round_ == seen) return;
        seen = round_;
        const auto* task = task_;
        const std::uint32_t count = count_;
        lock.unlock();
        work(count, thread, *task);
        lock.lock();
        if (--working_ == 0) finished_.notify_one();
    }
}

}  // namespace nacre::cpu
