// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "core/embedded_file.h"

namespace nacre::rhi {

/// GLSL of the RHI itself, for `ShaderCompilerDesc::embedded`: "rhi/shaders/texture_table.glsl" and what the RHI
/// draws with.
std::span<const EmbeddedFile> embedded_files();

}  // namespace nacre::rhi
