// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "backends/gl/traits.h"
#include "rhi/capabilities.h"

namespace nacre::gl {

/// Everything that the current context can do, before the front end applies a restriction.
rhi::Capabilities find_capabilities(const Functions& gl, const Traits& traits);

}  // namespace nacre::gl
