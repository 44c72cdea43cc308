// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "backends/gl/loader.h"
#include "core/error.h"

/// @file
/// An OpenGL context without a window, whoever made it.
///
///     NACRE_TRY(auto context, make_egl_context({.es = true}));
///     NACRE_CHECK(context->make_current());   // on the thread that will use it

namespace nacre::gl {

struct ContextDesc {
    bool es = false;             ///< OpenGL ES 3.1 instead of OpenGL 4.5 core.
    bool debug = false;          ///< A debug context.
    std::uint32_t adapter = 0;   ///< Position among the devices (EGL only).
};

class Context {
  public:
    virtual ~Context() = default;
    /// Binds the context to the calling thread.
    virtual Expected<void> make_current() = 0;
    /// Unbinds it from the calling thread, which must be the one that bound it.
    virtual void release() = 0;
    [[nodiscard]] virtual GetAddress get_address() const = 0;
    /// "EGL surfaceless", "EGL device", "OSMesa".
    [[nodiscard]] virtual std::string origin() const = 0;
};

/// Through EGL: the surfaceless platform first, then the device platform. Adapters above 0 always go through the device
/// platform. Errors: not_found (no libEGL, no such adapter), unsupported (no context of that version).
Expected<std::unique_ptr<Context>> make_egl_context(const ContextDesc& desc);

/// Number of devices that EGL names; 1 where it cannot enumerate them.
Expected<std::uint32_t> count_egl_adapters();

/// Through OSMesa, which has OpenGL 4.5 core only. Errors: not_found (no libOSMesa), unsupported.
Expected<std::unique_ptr<Context>> make_osmesa_context(const ContextDesc& desc);

}  // namespace nacre::gl
