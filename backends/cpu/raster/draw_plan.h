// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/chunk.h"

namespace nacre::cpu::raster {

/// The targets of a pass as the kernels see them.
TargetSet target_set(const RenderTargets& targets);

/// Fills `queued` from a draw; its containers keep their memory.
void plan_draw(const DrawState& state, const DrawCall& call, const TargetSet& targets, bool hierarchical_depth,
               QueuedDraw& queued);

}  // namespace nacre::cpu::raster
