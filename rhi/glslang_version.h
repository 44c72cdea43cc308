// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file
/// The one place that knows which glslang is there: 12.0 (Debian 12) or later. Include this, never glslang itself.
/// Costly to compile: for rhi/shader_compiler_glslang.cpp only.

#include <glslang/build_info.h>

// Before 11.9 the resource limits were no part of the installed library.
#if GLSLANG_VERSION_MAJOR < 12
#error "glslang 12.0 or later is needed (Debian: glslang-dev)"
#endif
#include <glslang/Public/ResourceLimits.h>
#include <glslang/Public/ShaderLang.h>
#include <glslang/SPIRV/GlslangToSpv.h>

namespace nacre::rhi {

/// Part of the key of everything that glslang makes.
inline constexpr int glslang_version =
    GLSLANG_VERSION_MAJOR * 1'000'000 + GLSLANG_VERSION_MINOR * 1'000 + GLSLANG_VERSION_PATCH;

}  // namespace nacre::rhi
