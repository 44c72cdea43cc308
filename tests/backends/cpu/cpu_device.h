// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "backends/cpu/cpu_backend.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "tests/backends/cpu/fake_compiler.h"

namespace nacre::cpu {

inline const rhi::Instance& instance() {
    static const rhi::Instance shared = [] {
        std::vector<std::unique_ptr<rhi::Backend>> backends;
        backends.push_back(make_backend());
        return rhi::Instance(std::move(backends));
    }();
    return shared;
}

template <typename T>
T ok(Expected<T> value) {
    if (!value) {
        ADD_FAILURE() << value.error().message();
        return T{};
    }
    return *std::move(value);
}
inline void ok(const Expected<void>& value) {
    if (!value) ADD_FAILURE() << value.error().message();
}

/// A device that fails the test with every message of validation.
inline std::unique_ptr<rhi::Device> make_device(const std::string& backend = "cpu:threads=3",
                                                rhi::DeviceDesc desc = {}) {
    desc.backend = backend;
    auto device = ok(instance().create_device(desc));
    if (device)
        device->set_message_callback([](const rhi::Message& message) {
            if (message.severity != rhi::MessageSeverity::info) ADD_FAILURE() << message.code << ": " << message.text;
        });
    return device;
}

/// A shader of any content: what it does is set in FakePrograms under its name.
inline rhi::Shader make_shader(rhi::Device& device, const std::string& path, const std::string& body) {
    static rhi::ShaderCompiler compiler({.embedded = {}, .debug_information = false});
    return ok(device.create_shader(ok(compiler.compile({.path = path, .text = "#version 460\n" + body}))));
}

/// A compute pipeline whose set 0 has one storage buffer at binding 0 and 16 bytes of push constants.
inline rhi::ComputePipeline make_compute(rhi::Device& device, const std::string& name, ComputeFunction run,
                                         std::uint64_t workgroup_bytes = 0) {
    FakePrograms::set(name, ComputeProgram{.run = run, .workgroup_bytes = workgroup_bytes});
    rhi::ComputePipelineDesc desc;
    desc.shader = make_shader(device, name, R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Values { uint values[]; };
        layout(push_constant) uniform Parameters { uvec4 parameters; };
        void main() { values[0] = parameters.x; }
    )");
    desc.name = name;
    return ok(device.create_compute_pipeline(desc));
}

inline rhi::BindGroup bind(rhi::Device& device, rhi::ComputePipeline pipeline, rhi::Buffer buffer) {
    return ok(device.create_bind_group(
        {.layout = ok(device.bind_group_layout(pipeline, 0)), .entries = {{.binding = 0, .buffer = buffer}}}));
}

inline rhi::Buffer make_buffer(rhi::Device& device, std::uint64_t size) {
    using enum rhi::BufferUsage;
    return ok(device.create_buffer({.size = size,
                                    .usage = storage | indirect | vertex | index | copy_source | copy_destination,
                                    .name = "buffer"}));
}

/// Sets the pipeline, its group and push constants of zero.
inline void prepare(rhi::Device& device, rhi::CommandList& list, rhi::ComputePipeline pipeline, rhi::Buffer buffer) {
    list.set_pipeline(pipeline);
    list.set_bind_group(0, bind(device, pipeline, buffer));
    list.set_push_constants(std::array<std::uint32_t, 4>{});
}

inline void run(rhi::Device& device, rhi::CommandList list) { ok(device.wait(ok(device.submit(std::move(list))))); }

template <typename T>
std::vector<T> as_values(const std::vector<std::byte>& bytes) {
    std::vector<T> values(bytes.size() / sizeof(T));
    std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
    return values;
}

inline std::vector<std::byte> random_bytes(std::uint64_t count, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::vector<std::byte> bytes(count);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
    return bytes;
}

}  // namespace nacre::cpu
