// SPDX-License-Identifier: Apache-2.0
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <fmt/format.h>

#include <array>
#include <cstring>
#include <mutex>

#include "backends/gl/context.h"
#include "backends/gl/quirks.h"
#include "core/dynamic_library.h"

namespace nacre::gl {
namespace {

struct Egl {
    DynamicLibrary library;
    PFNEGLGETPROCADDRESSPROC GetProcAddress = nullptr;
    PFNEGLQUERYSTRINGPROC QueryString = nullptr;
    PFNEGLINITIALIZEPROC Initialize = nullptr;
    PFNEGLBINDAPIPROC BindAPI = nullptr;
    PFNEGLCHOOSECONFIGPROC ChooseConfig = nullptr;
    PFNEGLCREATECONTEXTPROC CreateContext = nullptr;
    PFNEGLDESTROYCONTEXTPROC DestroyContext = nullptr;
    PFNEGLMAKECURRENTPROC MakeCurrent = nullptr;
    PFNEGLGETERRORPROC GetError = nullptr;
    PFNEGLRELEASETHREADPROC ReleaseThread = nullptr;
    PFNEGLGETPLATFORMDISPLAYEXTPROC GetPlatformDisplay = nullptr;
    PFNEGLQUERYDEVICESEXTPROC QueryDevices = nullptr;
    bool surfaceless = false, device = false;
};

bool has_word(const char* list, std::string_view word) {
    if (!list) return false;
    std::string_view text(list);
    for (std::size_t at = 0; (at = text.find(word, at)) != std::string_view::npos; at += word.size()) {
        const bool starts = at == 0 || text[at - 1] == ' ';
        const bool ends = at + word.size() == text.size() || text[at + word.size()] == ' ';
        if (starts && ends) return true;
    }
    return false;
}

Expected<Egl> open_egl() {
    set_driver_environment();
    Egl egl;
    // Resident: Mesa's drivers leave thread-local destructors behind that crash once the library is gone.
    NACRE_TRY(egl.library, DynamicLibrary::open({"libEGL.so.1", "libEGL.so"}, "libegl1", LibraryLifetime::resident));
    NACRE_TRY(egl.GetProcAddress, egl.library.symbol<PFNEGLGETPROCADDRESSPROC>("eglGetProcAddress"));
    NACRE_TRY(egl.QueryString, egl.library.symbol<PFNEGLQUERYSTRINGPROC>("eglQueryString"));
    NACRE_TRY(egl.Initialize, egl.library.symbol<PFNEGLINITIALIZEPROC>("eglInitialize"));
    NACRE_TRY(egl.BindAPI, egl.library.symbol<PFNEGLBINDAPIPROC>("eglBindAPI"));
    NACRE_TRY(egl.ChooseConfig, egl.library.symbol<PFNEGLCHOOSECONFIGPROC>("eglChooseConfig"));
    NACRE_TRY(egl.CreateContext, egl.library.symbol<PFNEGLCREATECONTEXTPROC>("eglCreateContext"));
    NACRE_TRY(egl.DestroyContext, egl.library.symbol<PFNEGLDESTROYCONTEXTPROC>("eglDestroyContext"));
    NACRE_TRY(egl.MakeCurrent, egl.library.symbol<PFNEGLMAKECURRENTPROC>("eglMakeCurrent"));
    NACRE_TRY(egl.GetError, egl.library.symbol<PFNEGLGETERRORPROC>("eglGetError"));
    NACRE_TRY(egl.ReleaseThread, egl.library.symbol<PFNEGLRELEASETHREADPROC>("eglReleaseThread"));
    const char* extensions = egl.QueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    egl.GetPlatformDisplay =
        reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(egl.GetProcAddress("eglGetPlatformDisplayEXT"));
    egl.QueryDevices = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(egl.GetProcAddress("eglQueryDevicesEXT"));
    egl.surfaceless = has_word(extensions, "EGL_MESA_platform_surfaceless") && egl.GetPlatformDisplay;
    egl.device = has_word(extensions, "EGL_EXT_platform_device") && egl.GetPlatformDisplay && egl.QueryDevices;
    return egl;
}

// Opened once for the process; displays stay initialized, since eglTerminate would end the other devices' contexts.
const Expected<Egl>& shared_egl() {
    static const Expected<Egl> egl = open_egl();
    return egl;
}

class EglContext : public Context {
  public:
    EglContext(const Egl& egl, EGLDisplay display, EGLContext context, EGLenum api, std::string origin)
        : egl_(egl), display_(display), context_(context), api_(api), origin_(std::move(origin)) {}
    ~EglContext() override { egl_.DestroyContext(display_, context_); }
    Expected<void> make_current() override {
        egl_.BindAPI(api_);
        if (!egl_.MakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
            return fail(ErrorCode::unsupported, "bind an OpenGL context", origin_,
                        fmt::format("eglMakeCurrent failed with error 0x{:04x}", egl_.GetError()),
                        "The driver must support EGL_KHR_surfaceless_context.");
        return {};
    }
    void release() override {
        egl_.MakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        egl_.ReleaseThread();
    }
    [[nodiscard]] GetAddress get_address() const override { return reinterpret_cast<GetAddress>(egl_.GetProcAddress); }
    [[nodiscard]] std::string origin() const override { return origin_; }

  private:
    const Egl& egl_;
    EGLDisplay display_;
    EGLContext context_;
    EGLenum api_;
    std::string origin_;
};

Expected<std::unique_ptr<Context>> make_on_display(const Egl& egl, EGLDisplay display, const ContextDesc& desc,
                                                   std::string origin) {
    const auto refuse = [&](const char* call) {
        return fail(ErrorCode::unsupported, "make an OpenGL context", origin,
                    fmt::format("{} failed with error 0x{:04x}", call, egl.GetError()),
                    desc.es ? "Install a driver with OpenGL ES 3.1 (Debian: libgl1-mesa-dri)."
                            : "Install a driver with OpenGL 4.5 (Debian: libgl1-mesa-dri).");
    };
    if (display == EGL_NO_DISPLAY) return refuse("eglGetPlatformDisplay");
    EGLint major = 0, minor = 0;
    if (!egl.Initialize(display, &major, &minor)) return refuse("eglInitialize");
    const EGLenum api = desc.es ? EGL_OPENGL_ES_API : EGL_OPENGL_API;
    if (!egl.BindAPI(api)) return refuse("eglBindAPI");
    EGLConfig config = nullptr;
    if (!has_word(egl.QueryString(display, EGL_EXTENSIONS), "EGL_KHR_no_config_context")) {
        const std::array<EGLint, 5> wanted{EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE,
                                           desc.es ? EGL_OPENGL_ES3_BIT : EGL_OPENGL_BIT, EGL_NONE};
        EGLint count = 0;
        if (!egl.ChooseConfig(display, wanted.data(), &config, 1, &count) || count == 0)
            return refuse("eglChooseConfig");
    }
    std::vector<EGLint> attributes{EGL_CONTEXT_MAJOR_VERSION, desc.es ? 3 : 4, EGL_CONTEXT_MINOR_VERSION,
                                   desc.es ? 1 : 5};
    if (!desc.es)
        attributes.insert(attributes.end(),
                          {EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT});
    if (desc.debug) attributes.insert(attributes.end(), {EGL_CONTEXT_OPENGL_DEBUG, EGL_TRUE});
    // Accesses out of bounds stay harmless, and a reset of the graphics card is reported, where the driver can.
    std::vector<EGLint> robust = attributes;
    robust.insert(robust.end(), {EGL_CONTEXT_OPENGL_ROBUST_ACCESS, EGL_TRUE,
                                 EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY, EGL_LOSE_CONTEXT_ON_RESET, EGL_NONE});
    attributes.push_back(EGL_NONE);
    EGLContext context = egl.CreateContext(display, config, EGL_NO_CONTEXT, robust.data());
    if (context == EGL_NO_CONTEXT) context = egl.CreateContext(display, config, EGL_NO_CONTEXT, attributes.data());
    if (context == EGL_NO_CONTEXT) return refuse("eglCreateContext");
    return std::make_unique<EglContext>(egl, display, context, api, std::move(origin));
}

}  // namespace

Expected<std::unique_ptr<Context>> make_egl_context(const ContextDesc& desc) {
    const Expected<Egl>& shared = shared_egl();
    if (!shared) return std::unexpected(shared.error());
    const Egl& egl = *shared;
    // EGL's own state is per process: two threads that initialize one display at once are safe by the specification,
    // but Mesa 22 reads its device list without a lock while doing so.
    static std::mutex mutex;
    const std::scoped_lock lock(mutex);
    Expected<std::unique_ptr<Context>> made =
        fail(ErrorCode::not_found, "make an OpenGL context", "EGL",
             "the library offers neither EGL_MESA_platform_surfaceless nor EGL_EXT_platform_device",
             "Install a driver that renders without a window (Debian: libegl-mesa0).");
    if (egl.surfaceless && desc.adapter == 0) {
        made = make_on_display(egl, egl.GetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr),
                               desc, "EGL surfaceless");
        if (made) return made;
    }
    if (egl.device) {
        std::array<EGLDeviceEXT, 16> devices{};
        EGLint count = 0;
        if (egl.QueryDevices(static_cast<EGLint>(devices.size()), devices.data(), &count)) {
            if (desc.adapter >= static_cast<std::uint32_t>(count))
                return fail(ErrorCode::not_found, "make an OpenGL context", fmt::format("EGL device {}", desc.adapter),
                            fmt::format("there are {} devices", count), "See `nacre devices`.");
            made = make_on_display(egl, egl.GetPlatformDisplay(EGL_PLATFORM_DEVICE_EXT, devices[desc.adapter], nullptr),
                                   desc, "EGL device");
        }
    } else if (desc.adapter > 0) {
        return fail(ErrorCode::not_found, "make an OpenGL context", fmt::format("EGL device {}", desc.adapter),
                    "the EGL library cannot enumerate devices", "Use device 0.");
    }
    return made;
}

Expected<std::uint32_t> count_egl_adapters() {
    const Expected<Egl>& shared = shared_egl();
    if (!shared) return std::unexpected(shared.error());
    EGLint count = 1;
    if (shared->device && shared->QueryDevices(0, nullptr, &count) && count > 1)
        return static_cast<std::uint32_t>(count);
    return 1;
}

}  // namespace nacre::gl
