// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "rhi/resources.h"

namespace nacre::hostile {

/// A valid module from which others are made.
struct SeedShader {
    std::string name;
    rhi::ShaderStage stage = rhi::ShaderStage::compute;
    std::vector<std::uint32_t> words;
};

/// Small shaders which together use every kind of memory, value and control flow that the CPU backend compiles.
Expected<std::vector<SeedShader>> seed_shaders();

}  // namespace nacre::hostile
