// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// @file
/// What shaders computed, instruction by instruction; for tools that tell where numbers come from.
///
///     NACRE_CHECK(device.start_trace({.shader = "lighting", .x = 320, .y = 180}));
///     ... submit the work ...
///     NACRE_TRY(const Trace trace, device.finish_trace());

namespace nacre::rhi {

/// An instruction that goes through single precision though its device works in double precision.
struct NarrowedOperation {
    std::string shader;     ///< As ShaderDesc::name.
    std::string line;       ///< "file:line" of the GLSL; empty where the module does not know.
    std::string operation;  ///< "bit cast", "packing", ...
    friend auto operator<=>(const NarrowedOperation&, const NarrowedOperation&) = default;
};

struct TraceRequest {
    /// Shaders whose name is this, or which lie in a folder of that name.
    std::string shader;
    std::uint32_t x = 0, y = 0, z = 0;  ///< Pixel of fragment shaders; texel (and layer) that compute shaders write.
    /// Compute shaders: gl_GlobalInvocationID of the invocation. Without it only `Trace::writers` is filled for them.
    std::optional<std::array<std::uint32_t, 3>> invocation;
};

/// An instruction of a shader, as legalized. Ids name values, as in SPIR-V.
struct TracedInstruction {
    std::string operation;                ///< "FAdd", "Store", ... without the "Op" in front.
    std::string line;                     ///< "file:line" of the GLSL; empty where unknown.
    std::uint32_t result = 0;             ///< Stores: the variable. 0: none.
    std::vector<std::uint32_t> operands;  ///< Values that went in. Loads: the variable.
    bool is_floating = false;             ///< The result is of floats.
};

/// One execution of an instruction by the traced invocation.
struct TraceEvent {
    std::uint32_t instruction = 0;  ///< Into InvocationTrace::instructions.
    std::vector<double> values;     ///< The result's scalars; of stores what is stored.
};

struct InvocationTrace {
    std::string shader;
    std::vector<TracedInstruction> instructions;
    std::vector<TraceEvent> events;  ///< In the order of execution.
};

struct Trace {
    std::vector<InvocationTrace> invocations;           ///< In the order in which they began.
    std::vector<std::array<std::uint32_t, 3>> writers;  ///< Invocations of compute shaders that wrote the texel.
};

}  // namespace nacre::rhi
