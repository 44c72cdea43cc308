// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "passes/renderer.h"
#include "samples/nacre/outcome.h"

/// @file
/// `--watch`: a picture that follows the shaders while they are edited.

namespace nacre::command {

/// Until Ctrl-C (or SIGTERM): looks for changed shaders ten times a second, tells on standard error what became of
/// each, and calls `render` where a pipeline is new. A shader that does not compile leaves the picture as it is. Error:
/// that of `render`, which ends it.
Expected<void> watch_shaders(passes::Renderer& renderer, const std::string& folder,
                             const std::function<Expected<void>()>& render);

}  // namespace nacre::command
