// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/cpu/raster/chunk.h"

namespace nacre::cpu::raster {

/// The vertices of `segment` through the vertex function: ScreenVertices at the end of `chunk.vertices`, and
/// `scratch.setup` with one SetupVertex for each different vertex. Element i of the segment is `setup[locals[i]]`.
void run_vertices(const Segment& segment, const QueuedDraw& draw, const Kernels& kernels, std::uint32_t lanes,
                  Chunk& chunk, ChunkScratch& scratch);

}  // namespace nacre::cpu::raster
