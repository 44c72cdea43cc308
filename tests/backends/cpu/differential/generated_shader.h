// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

/// @file
/// Random shaders without undefined behavior, the same for the same seed.
///
/// All of them read the same inputs (see `inputs.h`) and write the same kinds of outputs, whose bits follow from SPIR-V's
/// definitions: integers, and floats made by operations that are rounded correctly. What has a tolerance in Vulkan goes
/// into pairs of argument and result, which are judged by themselves.

namespace nacre::differential {

enum class Stage : std::uint8_t { compute, fragment, vertex };

struct GeneratedShader {
    Stage stage = Stage::compute;
    std::uint64_t seed = 0;
    std::string text;                 ///< GLSL of the stage; one statement in each line.
    std::uint32_t invocations = 0;    ///< Of one workgroup.
};

/// Words in the result buffer for each invocation.
inline constexpr std::uint32_t result_words = 24;
/// Workgroups of each dispatch; targets of fragment and vertex shaders have 16 x 16 pixels.
inline constexpr std::uint32_t workgroups = 2;
inline constexpr std::uint32_t most_invocations = 128;
/// Pairs of argument and result for each invocation, the function by the number of the pair.
inline constexpr std::uint32_t approximate_pairs = 16;

/// A shader for the seed: three of five are compute shaders.
GeneratedShader generate(std::uint64_t seed);

}  // namespace nacre::differential
