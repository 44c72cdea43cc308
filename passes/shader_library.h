// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "passes/plan.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"

/// @file
/// Shaders of one renderer, each compiled once, with a record of which pass uses which.
///
///     NACRE_TRY(rhi::Shader shader, library.get("lighting", {.path = "passes/lighting/lighting.comp"}));

namespace nacre::passes {

class ShaderLibrary {
  public:
    ShaderLibrary(rhi::Device& device, DiskCache* cache);
    ~ShaderLibrary();
    ShaderLibrary(const ShaderLibrary&) = delete;
    ShaderLibrary& operator=(const ShaderLibrary&) = delete;

    /// The shader for a path and its defines; noted under the pass's name for the plan.
    Expected<rhi::Shader> get(const std::string& pass, const rhi::ShaderSource& source);

    /// What `get` was asked for by a pass, without repetitions.
    [[nodiscard]] std::vector<PlannedShader> shaders_of(const std::string& pass) const;
    [[nodiscard]] rhi::ShaderCompiler::Statistics statistics() const { return compiler_.statistics(); }

  private:
    struct Entry {
        rhi::Shader shader;
        PlannedShader planned;
    };
    rhi::Device& device_;
    rhi::ShaderCompiler compiler_;
    std::map<std::string, Entry> entries_;
    std::map<std::string, std::vector<std::string>> users_;
};

}  // namespace nacre::passes
