// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "rhi/backend.h"

/// @file
/// Rendering without a graphics driver: shaders are compiled to machine code of this processor, which runs many
/// invocations at once.
///
///     std::vector<std::unique_ptr<rhi::Backend>> backends;
///     backends.push_back(cpu::make_backend());
///     rhi::Instance instance(std::move(backends));
///     auto device = instance.create_device({.backend = "cpu:consistent:lanes=8:threads=2"});
///
/// A device has a thread of its own that executes submissions in order, each command on all threads. A shader that runs
/// for longer than 10 s (NACRE_CPU_WATCHDOG_SECONDS in the environment; 0: no limit) is stopped, and its device is
/// lost.

namespace nacre::cpu {

/// "cpu", with the modes "" and "fast" (fused multiply-add where it helps) and "consistent" (the same results whatever
/// the lanes and threads) and "double" (every float a double, in registers and by shadow memory in buffers and images).
/// `lanes` are the invocations that run at once, 4, 8 or 16 (default: what the processor runs well); `threads` is the
/// number of threads that work (default: one for each core).
std::unique_ptr<rhi::Backend> make_backend();

}  // namespace nacre::cpu
