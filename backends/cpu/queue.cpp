// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/queue.h"

namespace nacre::cpu {

Queue::Queue() : thread_([this] { loop(); }) {}

Queue::~Queue() {
    {
        const std::scoped_lock lock(mutex_);
        ending_ = true;
    }
    changed_.notify_one();
    thread_.join();
}

void Queue::post(std::move_only_function<void()> task) {
    {
        const std::scoped_lock lock(mutex_);
        tasks_.push_back(std::move(task));
    }
    changed_.notify_one();
}

void Queue::drain() {
    std::unique_lock lock(mutex_);
    idle_.wait(lock, [&] { return tasks_.empty() && !is_running_; });
}

void Queue::loop() {
    std::unique_lock lock(mutex_);
    while (true) {
        changed_.wait(lock, [&] { return ending_ || !tasks_.empty(); });
        if (tasks_.empty()) return;
        auto task = std::move(tasks_.front());
        tasks_.pop_front();
        is_running_ = true;
        lock.unlock();
        task();
        task = nullptr;
        lock.lock();
        is_running_ = false;
        if (tasks_.empty()) idle_.notify_all();
    }
}

}  // namespace nacre::cpu
