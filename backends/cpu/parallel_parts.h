// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>

#include "backends/cpu/scheduler.h"

namespace nacre::cpu {

/// Calls `part(first, count)` for parts that make up [0, total), on all threads of a scheduler; on the caller's alone
/// where the work is too small to be worth the start.
/// @param bytes_each  bytes that one element moves
template <typename Part>
void in_parallel(Scheduler& scheduler, std::uint64_t total, std::uint64_t bytes_each, Part&& part) {
    if (total == 0) return;
    constexpr std::uint64_t worthwhile_bytes = 128 * 1024;
    const std::uint64_t most = std::uint64_t{scheduler.thread_count()} * 4;
    const std::uint64_t parts =
        std::clamp<std::uint64_t>(total * bytes_each / worthwhile_bytes, 1, std::min<std::uint64_t>(most, total));
    if (parts == 1) {
        part(std::uint64_t{0}, total);
        return;
    }
    scheduler.run(static_cast<std::uint32_t>(parts), [&](std::uint32_t index, std::uint32_t) {
        const std::uint64_t begin = total * index / parts, end = total * (index + 1) / parts;
        part(begin, end - begin);
    });
}

}  // namespace nacre::cpu
