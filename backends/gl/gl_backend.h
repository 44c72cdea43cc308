// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "rhi/backend.h"

/// @file
/// OpenGL 4.5 core and OpenGL ES 3.1, without a window and without linking to a driver.
///
///     std::vector<std::unique_ptr<rhi::Backend>> backends;
///     backends.push_back(gl::make_backend());
///     backends.push_back(gl::make_es_backend());
///     rhi::Instance instance(std::move(backends));
///
/// Every device has a thread of its own that its context is bound to; all calls go there, so any thread may call.
/// Shaders are translated from SPIR-V with SPIRV-Cross when a pipeline is made, and kept with the driver's binary in
/// the disk cache.

namespace nacre::gl {

/// "gl", with the modes "" (EGL surfaceless, else EGL device platform, else OSMesa), "egl" and "osmesa".
std::unique_ptr<rhi::Backend> make_backend();

/// "gles", with the modes "" and "egl". With the restriction "gles31-minimum" nothing beyond the OpenGL ES 3.1
/// specification is used, whatever the driver offers.
std::unique_ptr<rhi::Backend> make_es_backend();

}  // namespace nacre::gl
