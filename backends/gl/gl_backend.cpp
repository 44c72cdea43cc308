// SPDX-License-Identifier: Apache-2.0
#include "backends/gl/gl_backend.h"

#include <array>

#include "backends/gl/device.h"

namespace nacre::gl {
namespace {

constexpr std::array<rhi::Backend::Mode, 3> desktop_modes{{
    {"", "EGL without a window; OSMesa where EGL gives nothing"},
    {"egl", "EGL without a window"},
    {"osmesa", "OSMesa, Mesa's renderer in memory"},
}};
constexpr std::array<rhi::Backend::Mode, 2> es_modes{{
    {"", "EGL without a window"},
    {"egl", "EGL without a window"},
}};

class GlBackend : public rhi::Backend {
  public:
    explicit GlBackend(bool es) : es_(es) {}
    [[nodiscard]] std::string_view name() const override { return es_ ? "gles" : "gl"; }
    [[nodiscard]] std::span<const Mode> modes() const override {
        if (es_) return es_modes;
        return desktop_modes;
    }

    Expected<std::vector<rhi::AdapterInfo>> adapters() override {
        std::vector<rhi::AdapterInfo> found;
        const auto count = count_egl_adapters();
        for (std::uint32_t index = 0; index < count.value_or(1); ++index) {
            auto info = ask(index);
            // A later device that gives no context of this version is no adapter of this backend.
            if (!info && index > 0) continue;
            if (!info) return std::unexpected(info.error());
            found.push_back(*std::move(info));
        }
        return found;
    }

    Expected<std::unique_ptr<rhi::BackendDevice>> create_device(const rhi::BackendDeviceDesc& desc) override {
        return GlDevice::create({es_, desc.spec.mode}, desc);
    }

  private:
    // On a thread of its own: a context bound to the caller's would take the place of one that the program has there.
    Expected<rhi::AdapterInfo> ask(std::uint32_t index) {
        Worker worker([] { return false; });
        return worker.run([&]() -> Expected<rhi::AdapterInfo> {
            NACRE_TRY(auto context, make_context({es_, {}}, {.es = es_, .adapter = index}));
            NACRE_CHECK(context->make_current());
            auto functions = load_functions(context->get_address(), es_);
            Expected<rhi::AdapterInfo> info =
                functions ? Expected<rhi::AdapterInfo>(
                                describe(find_traits(*functions, es_, false, context->origin()), index))
                          : std::unexpected(functions.error());
            context->release();
            return info;
        });
    }

    bool es_;
};

}  // namespace

std::unique_ptr<rhi::Backend> make_backend() { return std::make_unique<GlBackend>(false); }
std::unique_ptr<rhi::Backend> make_es_backend() { return std::make_unique<GlBackend>(true); }

}  // namespace nacre::gl
