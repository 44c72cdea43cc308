// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>

#include "backends/gl/context.h"
#include "backends/gl/quirks.h"
#include "core/dynamic_library.h"

namespace nacre::gl {
namespace {

// From GL/osmesa.h (Mesa's own interface, unchanged since 11.2), which Debian ships only with the static driver.
using OsMesaContext = struct osmesa_context*;
constexpr int osmesa_format = 0x22;
constexpr int osmesa_profile = 0x33;
constexpr int osmesa_core_profile = 0x34;
constexpr int osmesa_context_major_version = 0x36;
constexpr int osmesa_context_minor_version = 0x37;
constexpr int osmesa_rgba = GL_RGBA;

struct OsMesa {
    DynamicLibrary library;
    OsMesaContext (*create)(const int*, OsMesaContext) = nullptr;
    void (*destroy)(OsMesaContext) = nullptr;
    GLboolean (*make_current)(OsMesaContext, void*, GLenum, GLsizei, GLsizei) = nullptr;
    GetAddress get_address = nullptr;
};

Expected<OsMesa> open_osmesa() {
    set_driver_environment();
    OsMesa osmesa;
    NACRE_TRY(osmesa.library, DynamicLibrary::open({"libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"}, "libosmesa6",
                                                   LibraryLifetime::resident));
    const DynamicLibrary& library = osmesa.library;
    NACRE_TRY(osmesa.create, library.symbol<decltype(osmesa.create)>("OSMesaCreateContextAttribs"));
    NACRE_TRY(osmesa.destroy, library.symbol<decltype(osmesa.destroy)>("OSMesaDestroyContext"));
    NACRE_TRY(osmesa.make_current, library.symbol<decltype(osmesa.make_current)>("OSMesaMakeCurrent"));
    NACRE_TRY(osmesa.get_address, library.symbol<decltype(osmesa.get_address)>("OSMesaGetProcAddress"));
    return osmesa;
}

const Expected<OsMesa>& shared_osmesa() {
    static const Expected<OsMesa> osmesa = open_osmesa();
    return osmesa;
}

class OsMesaBackedContext : public Context {
  public:
    OsMesaBackedContext(const OsMesa& osmesa, OsMesaContext context) : osmesa_(osmesa), context_(context) {}
    ~OsMesaBackedContext() override { osmesa_.destroy(context_); }
    Expected<void> make_current() override {
        // The library insists on a default framebuffer; nothing is ever drawn to it.
        if (!osmesa_.make_current(context_, pixel_.data(), GL_UNSIGNED_BYTE, 1, 1))
            return fail(ErrorCode::unsupported, "bind an OpenGL context", "OSMesa", "OSMesaMakeCurrent failed",
                        "Use the mode 'egl'.");
        return {};
    }
    void release() override { osmesa_.make_current(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0); }
    [[nodiscard]] GetAddress get_address() const override { return osmesa_.get_address; }
    [[nodiscard]] std::string origin() const override { return "OSMesa"; }

  private:
    const OsMesa& osmesa_;
    OsMesaContext context_;
    std::array<std::uint8_t, 4> pixel_{};
};

}  // namespace

Expected<std::unique_ptr<Context>> make_osmesa_context(const ContextDesc& desc) {
    if (desc.es)
        return fail(ErrorCode::unsupported, "make an OpenGL ES context", "OSMesa", "OSMesa has desktop OpenGL only",
                    "Use the backend 'gles' with EGL.");
    if (desc.adapter > 0)
        return fail(ErrorCode::not_found, "make an OpenGL context", fmt::format("OSMesa device {}", desc.adapter),
                    "OSMesa has one device", "Use device 0.");
    const Expected<OsMesa>& shared = shared_osmesa();
    if (!shared) return std::unexpected(shared.error());
    const std::array<int, 10> attributes{osmesa_format, osmesa_rgba, osmesa_profile, osmesa_core_profile,
                                         osmesa_context_major_version, 4, osmesa_context_minor_version, 5, 0, 0};
    OsMesaContext context = shared->create(attributes.data(), nullptr);
    if (!context)
        return fail(ErrorCode::unsupported, "make an OpenGL context", "OSMesa",
                    "OSMesaCreateContextAttribs refused OpenGL 4.5 core", "Install libosmesa6 of Mesa 22 or later.");
    return std::make_unique<OsMesaBackedContext>(*shared, context);
}

}  // namespace nacre::gl
