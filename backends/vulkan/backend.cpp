// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <mutex>
#include <string>

#include "backends/vulkan/device.h"
#include "backends/vulkan/instance.h"
#include "backends/vulkan/vulkan_backend.h"

namespace nacre::vulkan {
namespace {

class Backend final : public rhi::Backend {
  public:
    [[nodiscard]] std::string_view name() const override { return "vulkan"; }

    [[nodiscard]] std::span<const Mode> modes() const override {
        static constexpr Mode list[] = {
            {"", "the newest way that the driver has: dynamic rendering and synchronization2"},
            {"renderpass", "render-pass objects although the driver has dynamic rendering"},
            {"legacy", "render-pass objects and the barriers of Vulkan 1.0"},
        };
        return list;
    }

    Expected<std::vector<rhi::AdapterInfo>> adapters() override {
        NACRE_TRY(const std::shared_ptr<const Instance> instance, shared_instance());
        NACRE_TRY(const auto devices, PhysicalDevice::list(*instance));
        std::vector<rhi::AdapterInfo> result;
        for (const auto& device : devices)
            result.push_back(device->describe(static_cast<std::uint32_t>(result.size())));
        return result;
    }

    Expected<std::unique_ptr<rhi::BackendDevice>> create_device(const rhi::BackendDeviceDesc& desc) override {
        vulkan::Mode mode = vulkan::Mode::automatic;
        if (desc.spec.mode == "renderpass")
            mode = vulkan::Mode::render_pass;
        else if (desc.spec.mode == "legacy")
            mode = vulkan::Mode::legacy;
        else if (!desc.spec.mode.empty())
            return fail(ErrorCode::invalid_argument, "create device", fmt::format("'vulkan:{}'", desc.spec.mode),
                        "the mode is unknown", "Modes of vulkan: none, renderpass, legacy.");
        if (!desc.desc->driver_validation) {
            NACRE_TRY(std::shared_ptr<const Instance> instance, shared_instance());
            return Device::create(std::move(instance), mode, desc);
        }
        NACRE_TRY(auto library, open_library());
        NACRE_TRY(auto instance, Instance::create(std::move(library), {.validation = true, .report = desc.report}));
        return Device::create(std::move(instance), mode, desc);
    }

  private:
    Expected<std::shared_ptr<const Library>> open_library() {
        const std::lock_guard lock(mutex_);
        return library();
    }

    /// The instance of all devices without driver validation. Kept as long as the backend: making one loads all
    /// drivers.
    Expected<std::shared_ptr<const Instance>> shared_instance() {
        const std::lock_guard lock(mutex_);
        if (!instance_) {
            NACRE_TRY(auto opened, library());
            NACRE_TRY(instance_, Instance::create(std::move(opened), {}));
        }
        return instance_;
    }

    Expected<std::shared_ptr<const Library>> library() {
        if (!library_) {
            NACRE_TRY(library_, Library::open());
        }
        return library_;
    }

    std::mutex mutex_;
    std::shared_ptr<const Library> library_;
    std::shared_ptr<const Instance> instance_;
};

}  // namespace

std::unique_ptr<rhi::Backend> make_backend() { return std::make_unique<Backend>(); }

}  // namespace nacre::vulkan
