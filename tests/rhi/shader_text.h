// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rhi/reflection.h"
#include "rhi/shader_compiler.h"

namespace nacre::rhi::test {

/// Compiles GLSL given as text; the end of `path` tells the stage. Nothing is cached. Fails the test on an error.
inline ShaderDesc compile_text(const std::string& path, const std::string& text,
                               std::vector<ShaderDefine> defines = {}, bool debug_information = true) {
    ShaderCompiler compiler({.debug_information = debug_information});
    auto shader = compiler.compile({.path = path, .defines = std::move(defines), .text = text});
    EXPECT_TRUE(shader) << (shader ? "" : shader.error().message());
    return shader ? *shader : ShaderDesc{};
}

/// Compiles and reflects.
inline ShaderReflection reflect_text(const std::string& path, const std::string& text) {
    const ShaderDesc shader = compile_text(path, text);
    auto reflection = reflect(shader.spirv, shader.stage, shader.entry_point, path);
    EXPECT_TRUE(reflection) << (reflection ? "" : reflection.error().message());
    return reflection ? *reflection : ShaderReflection{};
}

}  // namespace nacre::rhi::test
