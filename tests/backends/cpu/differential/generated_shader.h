// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

/// @file
/// Random shaders without undefined behavior, the same for the same seed.
///
/// All of them read the same inputs (see `inputs.h`) and write the same kinds of outputs, whose bits follow from
/// SPIR-V's definitions: integers, and floats made by operations that are rounded correctly. What has a tolerance in
/// Vulkan goes into pairs of argument and result, which are judged by themselves.

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

/// Behind statements that give a variable its first value: without them, what the shader reads would be undefined.
inline constexpr const char* first_value_mark = "  // first value";

/// First line of every text. Every loop whose body runs before its condition begins with what it defines: nothing.
inline constexpr const char* loop_guard = "#define loop_guard";
/// Takes the line's place for lavapipe, whose values made in such a body are wrong behind the loop in invocations that
/// leave it before others: of what is loaded there they see zero (Mesa 22.3 keeps no copy by lane of a value that no
/// iteration but its own needs). A way out that is never taken has it keep one.
inline constexpr const char* loop_guard_for_lavapipe = "#define loop_guard if (words[255] == 0xabcd1234u) break;";

/// A shader for the seed: three of five are compute shaders.
GeneratedShader generate(std::uint64_t seed);

}  // namespace nacre::differential
