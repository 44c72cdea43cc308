// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/faults/fault_bench.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "backends/cpu/cpu_backend.h"

namespace nacre::cpu {
namespace {

template <typename T>
T ok(Expected<T> value) {
    if (value) return *std::move(value);
    ADD_FAILURE() << value.error().message();
    return T{};
}

std::array<std::uint32_t, 64> counting() {
    std::array<std::uint32_t, 64> values{};
    std::iota(values.begin(), values.end(), 0u);
    return values;
}

constexpr const char* whole_triangle = R"(
    void main() { gl_Position = vec4(vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0, 0.5, 1.0); }
)";

}  // namespace

FaultBench::FaultBench(const std::string& backend) {
    static const rhi::Instance instance = [] {
        std::vector<std::unique_ptr<rhi::Backend>> backends;
        backends.push_back(make_backend());
        return rhi::Instance(std::move(backends));
    }();
    device_ = ok(instance.create_device({.backend = backend}));
    if (!device_) return;
    device_->set_message_callback([this](const rhi::Message& message) {
        const std::scoped_lock lock(mutex_);
        messages_.push_back(message);
    });
    constexpr rhi::BufferUsage buffer_usage = rhi::BufferUsage::storage | rhi::BufferUsage::uniform_texel |
                                              rhi::BufferUsage::storage_texel | rhi::BufferUsage::copy_source |
                                              rhi::BufferUsage::copy_destination;
    using enum rhi::TextureUsage;
    output = ok(device_->create_buffer({.size = 1024, .usage = buffer_usage, .name = "output"}));
    input = ok(device_->create_buffer({.size = 256, .usage = buffer_usage, .name = "input"}));
    const rhi::TextureDesc words{.format = rhi::Format::r32_uint,
                                 .width = 8,
                                 .height = 8,
                                 .usage = storage | sampled | copy_destination | copy_source,
                                 .name = "picture"};
    picture = ok(device_->create_texture(words));
    rhi::TextureDesc named = words;
    named.name = "numbers";
    numbers = ok(device_->create_texture(named));
    named.name = "target";
    named.format = rhi::Format::rgba32_float;
    named.usage = color_target | sampled | copy_source;
    target = ok(device_->create_texture(named));
    nearest = ok(device_->create_sampler({.name = "nearest"}));
    const auto values = counting();
    EXPECT_TRUE(device_->write_buffer(input, std::span<const std::uint32_t>(values)));
    EXPECT_TRUE(device_->write_texture(numbers, std::as_bytes(std::span(values))));
}

rhi::Shader FaultBench::make_shader(const std::string& path, const std::string& text) {
    static rhi::ShaderCompiler compiler({});
    return ok(device_->create_shader(ok(compiler.compile({.path = path, .text = text}))));
}

rhi::ComputePipeline FaultBench::make_compute(const std::string& path, const std::string& text) {
    return ok(device_->create_compute_pipeline({.shader = make_shader(path, text), .name = path}));
}

rhi::BindGroup FaultBench::bind(rhi::BindGroupLayout layout) {
    rhi::BindGroupDesc group{.layout = layout, .name = "group"};
    for (const rhi::BindingLayout& binding : ok(device_->describe(layout)).bindings) {
        rhi::BindGroupEntry entry{.binding = binding.binding};
        if (binding.binding == 0) entry.buffer = output;
        if (binding.binding == 1) entry.buffer = input;
        if (binding.binding == 2) entry.texture = rhi::TextureView{picture};
        if (binding.binding == 3) entry.texture = rhi::TextureView{numbers};
        if (binding.binding == 5) entry.texture = rhi::TextureView{target}, entry.sampler = nearest;
        if (binding.binding == 4) entry.sampler = nearest;
        if (binding.binding == 6) entry.buffer = output;
        if (binding.binding == 7) entry.buffer = input;
        if (binding.binding >= 6) entry.format = rhi::Format::r32_uint;
        group.entries.push_back(entry);
    }
    return ok(device_->create_bind_group(group));
}

rhi::BindGroup FaultBench::bind(rhi::ComputePipeline pipeline) {
    return bind(ok(device_->bind_group_layout(pipeline, 0)));
}

Expected<void> FaultBench::submit(rhi::CommandList list) {
    NACRE_TRY(const rhi::Fence fence, device_->submit(std::move(list)));
    return device_->wait(fence);
}

Expected<void> FaultBench::compute(const std::string& path, const std::string& text, std::uint32_t groups) {
    const rhi::ComputePipeline pipeline = make_compute(path, text);
    rhi::CommandList list = device_->create_command_list("once");
    list.set_pipeline(pipeline);
    if (text.find("set = 0") != std::string::npos) list.set_bind_group(0, bind(pipeline));
    list.dispatch({.x = groups});
    return submit(std::move(list));
}

rhi::GraphicsPipelineDesc FaultBench::describe_graphics(const std::string& path, const std::string& text,
                                                        const std::string& vertex_text) {
    rhi::GraphicsPipelineDesc desc;
    desc.vertex = make_shader(vertex_text.empty() ? "whole.vert" : path + ".vert",
                              vertex_text.empty() ? whole_triangle : vertex_text);
    desc.fragment = make_shader(path, text);
    desc.color_targets = {{.format = rhi::Format::rgba32_float}};
    desc.name = path;
    return desc;
}

rhi::GraphicsPipeline FaultBench::make_graphics(const std::string& path, const std::string& text,
                                                const std::string& vertex_text, const rhi::VertexBufferLayout& layout,
                                                std::vector<rhi::VertexAttribute> attributes) {
    rhi::GraphicsPipelineDesc desc = describe_graphics(path, text, vertex_text);
    if (!attributes.empty()) desc.vertex_buffers = {layout};
    desc.vertex_attributes = std::move(attributes);
    return ok(device_->create_graphics_pipeline(desc));
}

Expected<void> FaultBench::draw(const std::string& path, const std::string& text, const std::string& vertex_text,
                                rhi::LoadOperation load) {
    const rhi::GraphicsPipeline pipeline = make_graphics(path, text, vertex_text);
    rhi::CommandList list = device_->create_command_list("once");
    rhi::RenderPassDesc pass;
    pass.color = {{.view = rhi::TextureView{target}, .load = load}};
    pass.name = "only";
    list.begin_render_pass(pass);
    list.set_pipeline(pipeline);
    if ((text + vertex_text).find("set = 0") != std::string::npos)
        list.set_bind_group(0, bind(ok(device_->bind_group_layout(pipeline, 0))));
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    return submit(std::move(list));
}

std::vector<rhi::Message> FaultBench::messages() const {
    const std::scoped_lock lock(mutex_);
    return messages_;
}

std::string faulty_line(const std::string& path, const std::string& text) {
    const std::size_t at = text.find("FAULT");
    if (at == std::string::npos) return {};
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    return path + ":" + std::to_string(line);
}

}  // namespace nacre::cpu
