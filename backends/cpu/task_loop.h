// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cfenv>
#include <cstdint>
#include <functional>

namespace nacre::cpu {

/// Rounding to nearest, and subnormal numbers kept, whatever the program has set in the thread; restored at the end.
/// Results must not depend on the thread that computes them.
class DefaultArithmetic {
  public:
    DefaultArithmetic() {
        std::fegetenv(&before_);
        std::fesetenv(FE_DFL_ENV);
    }
    ~DefaultArithmetic() { std::fesetenv(&before_); }
    DefaultArithmetic(const DefaultArithmetic&) = delete;
    DefaultArithmetic& operator=(const DefaultArithmetic&) = delete;

  private:
    std::fenv_t before_;
};

/// Takes indices until there are none left: what one thread does in a `Scheduler::run`.
inline void run_tasks(std::atomic<std::uint32_t>& next, std::uint32_t count, std::uint32_t thread,
                      const std::function<void(std::uint32_t, std::uint32_t)>& task) {
    const DefaultArithmetic arithmetic;
    // Compared before it is raised, so that it never runs past the largest count.
    for (std::uint32_t index = next.load(std::memory_order_relaxed); index < count;) {
        if (!next.compare_exchange_weak(index, index + 1, std::memory_order_relaxed)) continue;
        task(index, thread);
        index = next.load(std::memory_order_relaxed);
    }
}

}  // namespace nacre::cpu
