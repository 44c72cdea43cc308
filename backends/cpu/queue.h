// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace nacre::cpu {

/// The thread that executes a device's submissions, one after another.
class Queue {
  public:
    Queue();
    /// Executes what is queued, then ends the thread.
    ~Queue();
    Queue(const Queue&) = delete;
    Queue& operator=(const Queue&) = delete;

    void post(std::move_only_function<void()> task);
    /// Waits until nothing is queued and nothing runs.
    void drain();

  private:
    void loop();

    std::mutex mutex_;
    std::condition_variable changed_, idle_;
    std::deque<std::move_only_function<void()>> tasks_;
    bool is_running_ = false, ending_ = false;
    std::thread thread_;
};

}  // namespace nacre::cpu
