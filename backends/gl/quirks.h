// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

/// @file
/// What drivers do differently from their specification, each with the reason for what is done about it.

namespace nacre::gl {

/// Sets environment variables that drivers read when they are loaded, where the user has not set them:
/// - GALLIVM_PERF=no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx: llvmpipe's default texture filter takes one
/// level
///   of detail for a quad of pixels, filters 8-bit textures in 8-bit arithmetic, and approximates levels of detail and
///   what lies between two; pictures would differ from other devices'.
void set_driver_environment();

/// Behavior of one driver, found by its name (GL_RENDERER) and version text.
struct Quirks {
    /// The driver runs on the CPU.
    bool is_software = false;
};
Quirks find_quirks(std::string_view renderer, std::string_view version);

}  // namespace nacre::gl
