// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "backends/gl/gl_backend.h"
#include "backends/vulkan/vulkan_backend.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"

/// @file
/// Devices for the tests of the OpenGL backend, and short forms of what each test needs.

namespace nacre::rhi {

inline const Instance& instance() {
    static const Instance shared = [] {
        std::vector<std::unique_ptr<Backend>> backends;
        backends.push_back(vulkan::make_backend());
        backends.push_back(gl::make_backend());
        backends.push_back(gl::make_es_backend());
        return Instance(std::move(backends));
    }();
    return shared;
}

/// The kinds of device that this backend has: each test runs on all of them.
struct DeviceKind {
    const char* name;
    const char* backend;
    const char* restriction;
};
inline constexpr DeviceKind device_kinds[]{
    {"gl", "gl:egl", "none"},
    {"osmesa", "gl:osmesa", "none"},
    {"gles", "gles", "none"},
    {"gles_minimum", "gles", "gles31-minimum"},
};
inline std::string name_of(const testing::TestParamInfo<DeviceKind>& info) { return info.param.name; }
inline void PrintTo(const DeviceKind& kind, std::ostream* out) { *out << kind.name; }

/// A device with all checks on; null with a skipped or failed test where there is none.
inline std::unique_ptr<Device> make_device(const DeviceKind& kind, DeviceDesc desc = {}) {
    desc.backend = kind.backend;
    desc.restriction = kind.restriction;
    desc.driver_validation = true;
    desc.name = kind.name;
    auto device = instance().create_device(desc);
    if (!device) {
        if (device.error().code == ErrorCode::not_found)
            [&] { GTEST_SKIP() << device.error().message(); }();
        else
            ADD_FAILURE() << device.error().message();
        return nullptr;
    }
    (*device)->set_message_callback([](const Message& message) {
        if (message.severity != MessageSeverity::info) ADD_FAILURE() << message.code << ": " << message.text;
    });
    return *std::move(device);
}

/// The Vulkan device that OpenGL devices are compared with; null where the machine has none.
inline Device* reference_device() {
    static const std::unique_ptr<Device> device = [] {
        auto made = instance().create_device({.backend = "vulkan", .name = "reference"});
        return made ? *std::move(made) : nullptr;
    }();
    return device.get();
}

template <typename T>
T expect(Expected<T> value) {
    if (!value) {
        ADD_FAILURE() << value.error().message();
        return T{};
    }
    return *std::move(value);
}
inline void expect(const Expected<void>& value) {
    if (!value) ADD_FAILURE() << value.error().message();
}

inline Shader make_shader(Device& device, const std::string& path, const std::string& text) {
    static ShaderCompiler compiler({.embedded = {}, .debug_information = false});
    auto desc = compiler.compile({.path = path, .text = text});
    if (!desc) {
        ADD_FAILURE() << desc.error().message();
        return {};
    }
    return expect(device.create_shader(*desc));
}

template <typename T>
std::vector<T> as_values(const std::vector<std::byte>& bytes) {
    std::vector<T> values(bytes.size() / sizeof(T));
    std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
    return values;
}

/// Texels of mip 0, layer 0.
template <typename T>
std::vector<T> texels(Device& device, Texture texture, std::uint32_t mip = 0, std::uint32_t layer = 0) {
    return as_values<T>(expect(device.read_texture(texture, mip, layer)));
}

/// A test with one device of each kind.
class GlTest : public testing::TestWithParam<DeviceKind> {
  protected:
    void SetUp() override {
        device_ = make_device(GetParam());
        if (!device_) return;
    }
    bool has_device() const { return device_ != nullptr; }
    std::unique_ptr<Device> device_;
};

}  // namespace nacre::rhi
