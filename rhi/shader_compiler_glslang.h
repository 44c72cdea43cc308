// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/handle.h"

/// @file
/// GLSL whose files are all in memory to SPIR-V: the part of the shader compiler that needs glslang.

namespace nacre::rhi {

/// What errors say was attempted.
inline constexpr std::string_view compile_action = "compile shader";

/// A file as the compiler sees it.
struct GlslFile {
    std::string text;
    /// Which file an `#include "name"` in this file means: name to path. Absent: no such file.
    std::map<std::string, std::string> includes{};
    std::map<std::string, int> include_lines{};  ///< Where each name is included first.
};

struct GlslInput {
    std::string path;                      ///< Key of the main file in `files`.
    std::map<std::string, GlslFile> files; ///< By path.
    std::string preamble;                  ///< "#define NAME value" lines.
    ShaderStage stage = ShaderStage::none;
    bool debug_information = true;
    bool optimize = false;
};

/// Errors as `ShaderCompiler::compile`. Thread-safe.
Expected<std::vector<std::uint32_t>> compile_glsl(const GlslInput& input);

/// Names the versions of the libraries and of the code behind `compile_glsl`; a part of cache keys.
const std::string& glsl_compiler_version();

}  // namespace nacre::rhi
