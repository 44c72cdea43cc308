// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <spirv-tools/libspirv.hpp>

#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"

namespace nacre::rhi::test {

/// SPIR-V from its text, for modules that GLSL cannot say. Ids that are numbers keep them. Nothing is validated.
/// @return shader_compile, with the lines that are wrong
inline Expected<std::vector<std::uint32_t>> assemble(const std::string& text,
                                                     spv_target_env environment = SPV_ENV_VULKAN_1_1) {
    spvtools::SpirvTools tools(environment);
    std::string problems;
    tools.SetMessageConsumer([&](spv_message_level_t, const char*, const spv_position_t& at, const char* message) {
        problems += std::to_string(at.line + 1) + ": " + message + "\n";
    });
    std::vector<std::uint32_t> words;
    if (!tools.Assemble(text, &words, SPV_TEXT_TO_BINARY_OPTION_PRESERVE_NUMERIC_IDS))
        return fail(ErrorCode::shader_compile, "assemble", "SPIR-V", problems, "Mend the text.");
    return words;
}

}  // namespace nacre::rhi::test
