// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "backends/vulkan/vulkan_backend.h"
#include "rhi/backend.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"

namespace nacre::vulkan::test {

/// Compiles GLSL given as text; the end of `path` tells the stage. Fails the test on an error.
inline rhi::ShaderDesc compile_text(const std::string& path, const std::string& text) {
    rhi::ShaderCompiler compiler({});
    auto shader = compiler.compile({.path = path, .text = text});
    EXPECT_TRUE(shader) << (shader ? "" : shader.error().message());
    return shader ? *shader : rhi::ShaderDesc{};
}

/// A Vulkan device with the Khronos validation layer, and the messages that it gave.
class TestDevice {
  public:
    /// `spec`: "vulkan", "vulkan:renderpass" or "vulkan:legacy".
    explicit TestDevice(const std::string& spec, rhi::DeviceDesc desc = {}) {
        std::vector<std::unique_ptr<rhi::Backend>> backends;
        backends.push_back(make_backend());
        instance_ = std::make_unique<rhi::Instance>(std::move(backends));
        desc.backend = spec;
        desc.driver_validation = has_validation_layer();
        auto made = instance_->create_device(desc);
        if (!made) {
            error_ = made.error().message();
            // Anything but an absent device is a fault, and no reason to skip a test.
            if (made.error().code != ErrorCode::not_found) ADD_FAILURE() << error_;
            return;
        }
        device_ = std::move(*made);
        device_->set_message_callback([this](const rhi::Message& message) {
            const std::lock_guard lock(mutex_);
            messages_.push_back(message.code + ": " + message.text);
        });
    }

    /// Null where this machine has no Vulkan device; `error` tells why.
    [[nodiscard]] rhi::Device* get() const { return device_.get(); }
    rhi::Device* operator->() const { return device_.get(); }
    rhi::Device& operator*() const { return *device_; }
    [[nodiscard]] const std::string& error() const { return error_; }
    /// Messages since the last call.
    std::vector<std::string> take_messages() {
        const std::lock_guard lock(mutex_);
        return std::exchange(messages_, {});
    }
    /// Destroys the device: the validation layer tells of what is left behind.
    void destroy_device() { device_.reset(); }

    static bool has_validation_layer() {
        static const bool found = [] {
            std::vector<std::unique_ptr<rhi::Backend>> backends;
            backends.push_back(make_backend());
            rhi::Instance instance(std::move(backends));
            auto device = instance.create_device({.backend = "vulkan", .driver_validation = true});
            return device.has_value() || device.error().code != ErrorCode::not_found;
        }();
        return found;
    }

  private:
    std::mutex mutex_;
    std::vector<std::string> messages_;
    std::string error_;
    std::unique_ptr<rhi::Instance> instance_;
    std::unique_ptr<rhi::Device> device_;
};

/// Runs in each of the backend's modes and fails where the validation layer spoke.
class EveryMode : public testing::TestWithParam<const char*> {
  protected:
    void SetUp() override {
        device = std::make_unique<TestDevice>(GetParam());
        if (!device->get()) GTEST_SKIP() << device->error();
    }
    void TearDown() override {
        if (!device) return;
        device->destroy_device();
        for (const std::string& message : device->take_messages()) ADD_FAILURE() << message;
    }

    rhi::Device& gpu() { return **device; }
    std::unique_ptr<TestDevice> device;
};

/// Name of a mode in the name of a test.
inline std::string mode_name(const testing::TestParamInfo<const char*>& info) {
    const std::string spec = info.param;
    const auto colon = spec.find(':');
    return colon == std::string::npos ? "automatic" : spec.substr(colon + 1);
}

inline const auto every_mode = testing::Values("vulkan", "vulkan:renderpass", "vulkan:legacy");

/// The value, or a failed test and a default value.
template <typename T>
T must(Expected<T> value) {
    if (value) return *std::move(value);
    ADD_FAILURE() << value.error().message();
    return T{};
}
inline void must(Expected<void> value) { EXPECT_TRUE(value) << value.error().message(); }

}  // namespace nacre::vulkan::test
