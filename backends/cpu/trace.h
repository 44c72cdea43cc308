// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "rhi/trace.h"

/// @file
/// Shaders that tell what they compute. A traced program calls the functions below after each of its instructions; it
/// is compiled when a trace first asks for it, beside the program that runs otherwise.

namespace nacre::cpu {

/// The instructions of one traced program, which lives as long as its code.
struct TraceTable {
    std::string shader;
    std::vector<rhi::TracedInstruction> instructions;
    std::vector<std::uint32_t> offsets;  ///< In the module, of each instruction.
};

/// What a traced program finds behind ShaderContext::trace.
struct ShaderTrace {
    /// Compute shaders: the invocation; fragment shaders: the pixel. No invocation has the coordinates of ~0.
    std::uint32_t invocation[3];
    std::uint32_t texel[3];  ///< Whoever writes it is noted.
    std::mutex mutex;
    rhi::Trace found;
};

struct TraceFunctions {
    /// An invocation begins; `lane` is negative where the traced one is not among those that begin.
    void (*begin)(ShaderTrace* trace, const TraceTable* table, std::int32_t lane);
    /// `values` has `count` rows of max_lanes.
    void (*event)(ShaderTrace* trace, std::uint32_t instruction, std::int32_t lane, std::uint32_t live,
                  const double* values, std::uint32_t count);
    /// A store to an image at `count` coordinates, by the invocations of the three rows behind them; all rows are
    /// integers.
    void (*write)(ShaderTrace* trace, std::uint32_t live, const std::int32_t* rows, std::uint32_t count);
};
TraceFunctions trace_functions();

}  // namespace nacre::cpu
