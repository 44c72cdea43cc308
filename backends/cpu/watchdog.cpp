// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/watchdog.h"

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string_view>

namespace nacre::cpu {

std::chrono::nanoseconds watchdog_limit() {
    constexpr double usual_s = 10.0, longest_s = 1e9;
    double seconds = usual_s;
    if (const char* text = std::getenv("NACRE_CPU_WATCHDOG_SECONDS")) {
        const std::string_view digits(text);
        const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), seconds);
        if (error != std::errc{} || end != digits.data() + digits.size() || !(seconds >= 0.0)) seconds = usual_s;
    }
    return std::chrono::nanoseconds(std::llround(std::min(seconds, longest_s) * 1e9));
}

Watchdog::Watchdog(std::chrono::nanoseconds limit) : limit_(limit) {
    if (limit_.count() > 0) thread_ = std::thread([this] { watch(); });
}

Watchdog::~Watchdog() {
    if (!thread_.joinable()) return;
    {
        const std::scoped_lock lock(mutex_);
        ending_ = true;
    }
    changed_.notify_one();
    thread_.join();
}

bool Watchdog::has_expired() const {
    // Read by others while the thread writes it; shaders read it as a plain word.
    return std::atomic_ref(const_cast<std::uint32_t&>(state_.expired)).load(std::memory_order_relaxed) != 0;
}

void Watchdog::begin() {
    if (limit_.count() == 0) return;
    began_.store(Clock::now().time_since_epoch().count());
    // The thread says that it is asleep before it looks for a step: either it sees this one, or it is seen asleep here.
    if (!is_asleep_.load()) return;
    const std::scoped_lock lock(mutex_);
    changed_.notify_one();
}

void Watchdog::watch() {
    std::unique_lock lock(mutex_);
    while (!ending_) {
        const Clock::rep began = began_.load();
        if (began == 0) {
            is_asleep_.store(true);
            changed_.wait(lock, [&] { return ending_ || began_.load() != 0; });
            is_asleep_.store(false);
            continue;
        }
        const Clock::time_point deadline = Clock::time_point(Clock::duration(began)) + limit_;
        if (Clock::now() < deadline) {
            changed_.wait_until(lock, deadline, [&] { return ending_; });
            continue;
        }
        if (began_.load() != began) continue;
        std::atomic_ref(state_.expired).store(1, std::memory_order_relaxed);
        return;
    }
}

}  // namespace nacre::cpu
