// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

/// @file
/// The one thread that a device's context is bound to. Everything that calls OpenGL runs there, so that any thread may
/// call the device.
///
///     Worker worker([] { return false; });
///     worker.post([] { ... });                          // later, in order
///     GLuint name = worker.run([] { return ...; });     // waits for the result

namespace nacre::gl {

class Worker {
  public:
    /// `idle` is called whenever nothing is queued; it returns true while it wants to be called again, and must return
    /// within a few milliseconds.
    explicit Worker(std::function<bool()> idle);
    /// Runs what is queued, then ends the thread.
    ~Worker();
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    void post(std::move_only_function<void()> task);
    /// Never calls `idle` again. On the worker thread only.
    void stop_idling() { idle_ = nullptr; }

    /// Runs `task` on the thread and waits for its result; at once when called on that thread.
    template <typename Task>
    auto run(Task&& task) -> decltype(task()) {
        using Result = decltype(task());
        if (std::this_thread::get_id() == thread_.get_id()) return task();
        Completion completion;
        if constexpr (std::is_void_v<Result>) {
            post([&] { task(), completion.signal(); });
            completion.wait();
        } else {
            std::optional<Result> result;
            post([&] { result.emplace(task()), completion.signal(); });
            completion.wait();
            return *std::move(result);
        }
    }

  private:
    struct Completion {
        std::mutex mutex;
        std::condition_variable changed;
        bool done = false;
        void signal() {
            // Notified under the lock: the waiter owns this object and destroys it as soon as it sees `done`.
            const std::scoped_lock lock(mutex);
            done = true;
            changed.notify_one();
        }
        void wait() {
            std::unique_lock lock(mutex);
            changed.wait(lock, [&] { return done; });
        }
    };
    void loop();

    std::function<bool()> idle_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<std::move_only_function<void()>> tasks_;
    bool ending_ = false;
    std::thread thread_;
};

}  // namespace nacre::gl
