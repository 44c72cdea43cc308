// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/worker.h"

namespace nacre::gl {

Worker::Worker(std::function<bool()> idle) : idle_(std::move(idle)), thread_([this] { loop(); }) {}

Worker::~Worker() {
    {
        const std::scoped_lock lock(mutex_);
        ending_ = true;
    }
    changed_.notify_one();
    thread_.join();
}

void Worker::post(std::move_only_function<void()> task) {
    {
        const std::scoped_lock lock(mutex_);
        tasks_.push_back(std::move(task));
    }
    changed_.notify_one();
}

void Worker::loop() {
    std::unique_lock lock(mutex_);
    bool wants_idle = false;
    while (true) {
        if (!tasks_.empty()) {
            auto task = std::move(tasks_.front());
            tasks_.pop_front();
            lock.unlock();
            task();
            task = nullptr;
            lock.lock();
            wants_idle = true;
        } else if (wants_idle && idle_) {
            lock.unlock();
            wants_idle = idle_();
            lock.lock();
        } else if (ending_) {
            return;
        } else {
            changed_.wait(lock, [&] { return ending_ || !tasks_.empty(); });
        }
    }
}

}  // namespace nacre::gl
