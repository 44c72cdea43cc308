// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

/// @file
/// Devices in double precision and how tests ask them what a float really is.

namespace nacre::cpu::double_mode {

using namespace rhi;

/// A device, with what tests ask of it; anything that fails throws.
class Bench {
  public:
    explicit Bench(const std::string& backend) : instance_(all_backends()) {
        device_ = ok(instance_.create_device({.backend = backend, .validation = true}));
    }
    Device& device() { return *device_; }

    template <typename T>
    static T ok(Expected<T> result) {
        if (!result) throw std::runtime_error(result.error().message());
        return *std::move(result);
    }
    static void ok(Expected<void> result) {
        if (!result) throw std::runtime_error(result.error().message());
    }

    Shader shader(const std::string& path, const std::string& body) {
        ShaderCompiler compiler({});
        return ok(device_->create_shader(ok(compiler.compile({.path = path, .text = "#version 460\n" + body}))));
    }
    ComputePipeline compute(const std::string& body) {
        return ok(device_->create_compute_pipeline({.shader = shader("test.comp", body), .name = "test"}));
    }
    Buffer storage(std::uint64_t bytes) {
        return ok(device_->create_buffer({.size = bytes,
                                          .usage = BufferUsage::storage | BufferUsage::copy_source |
                                                   BufferUsage::copy_destination | BufferUsage::vertex |
                                                   BufferUsage::uniform_texel | BufferUsage::storage_texel,
                                          .name = "storage"}));
    }
    BindGroup group(auto pipeline, std::vector<BindGroupEntry> entries) {
        return ok(device_->create_bind_group(
            {.layout = ok(device_->bind_group_layout(pipeline, 0)), .entries = std::move(entries), .name = "group"}));
    }
    void run(CommandList list) { ok(device_->wait(ok(device_->submit(std::move(list))))); }
    void dispatch(const std::string& body, std::vector<BindGroupEntry> entries, std::uint32_t groups = 1) {
        const ComputePipeline pipeline = compute(body);
        CommandList list = device_->create_command_list("dispatch");
        list.set_pipeline(pipeline);
        list.set_bind_group(0, group(pipeline, std::move(entries)));
        list.dispatch({groups, 1, 1});
        run(std::move(list));
    }
    template <typename T>
    std::vector<T> read(Buffer from, std::size_t count) {
        const std::vector<std::byte> bytes = ok(device_->read_buffer(from));
        std::vector<T> values(count);
        std::memcpy(values.data(), bytes.data(), count * sizeof(T));
        return values;
    }

  private:
    Instance instance_;
    std::unique_ptr<Device> device_;
};

/// Shader text: what a float really is, as the two words of a double.
inline const std::string prelude =
    "#extension GL_EXT_samplerless_texture_functions : require\n"
    "layout(local_size_x = 64) in;\n"
    "uint at = gl_GlobalInvocationID.x;\n"
    "uvec2 exactly(float x) { return unpackDouble2x32(double(x)); }\n";
inline const std::string result = "layout(set = 0, binding = 0) buffer Result { uvec2 result[]; };\n";

inline Texture make_texture(Bench& bench, Format format, TextureUsage usage, std::uint32_t size = 64,
                            std::uint32_t mips = 1) {
    return Bench::ok(bench.device().create_texture(
        {.format = format, .width = size, .height = size, .mips = mips, .usage = usage, .name = "texture"}));
}

}  // namespace nacre::cpu::double_mode
