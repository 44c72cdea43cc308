// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>

#include "tests/rhi/null_backend.h"
#include "tests/rhi/shader_text.h"

namespace nacre::test {

/// A device over the null backend with makers of things that are right, so that a test changes the one thing that is
/// wrong.
class Bench {
  public:
    explicit Bench(rhi::DeviceDesc desc = {}, rhi::Capabilities capabilities = full_capabilities())
        : setup_(std::move(desc), capabilities) {}

    rhi::Device& device() { return *setup_.device; }
    rhi::Instance& instance() { return *setup_.instance; }
    NullLog& log() { return *setup_.log; }
    std::vector<rhi::Message>& messages() { return setup_.messages; }

    rhi::Buffer buffer(rhi::BufferUsage usage, std::uint64_t size = 256, const std::string& name = "the buffer",
                       rhi::MemoryKind memory = rhi::MemoryKind::device) {
        return *device().create_buffer({size, usage, memory, name});
    }
    static rhi::TextureDesc texture_desc(rhi::TextureUsage usage, rhi::Format format = rhi::Format::rgba8_unorm) {
        return {.format = format, .width = 16, .height = 16, .usage = usage, .name = "the texture"};
    }
    rhi::Texture texture(rhi::TextureUsage usage, rhi::Format format = rhi::Format::rgba8_unorm) {
        return *device().create_texture(texture_desc(usage, format));
    }
    rhi::Texture target(rhi::Format format = rhi::Format::rgba8_unorm) {
        return texture(rhi::TextureUsage::color_target | rhi::TextureUsage::sampled, format);
    }
    rhi::Texture depth(rhi::Format format = rhi::Format::d32_float) {
        return texture(rhi::TextureUsage::depth_target | rhi::TextureUsage::sampled, format);
    }

    /// SPIR-V by stage and GLSL; compiled once in a process.
    static const rhi::ShaderDesc& compiled(const std::string& extension, const std::string& body) {
        static std::map<std::string, rhi::ShaderDesc> cache;
        auto [at, is_new] = cache.try_emplace(extension + body);
        if (is_new) {
            at->second = rhi::test::compile_text("the_shader." + extension, "#version 460\n" + body);
            at->second.name = "the shader";
        }
        return at->second;
    }
    rhi::Shader shader(const std::string& extension, const std::string& body) {
        return *device().create_shader(compiled(extension, body));
    }
    rhi::Shader plain_vertex() { return shader("vert", "void main() { gl_Position = vec4(0); }"); }
    rhi::Shader plain_fragment() {
        return shader("frag", "layout(location = 0) out vec4 color; void main() { color = vec4(1); }");
    }

    rhi::GraphicsPipelineDesc graphics_desc() {
        rhi::GraphicsPipelineDesc desc;
        desc.vertex = plain_vertex();
        desc.fragment = plain_fragment();
        desc.color_targets = {{.format = rhi::Format::rgba8_unorm}};
        desc.name = "the pipeline";
        return desc;
    }
    rhi::GraphicsPipeline graphics() { return *device().create_graphics_pipeline(graphics_desc()); }
    rhi::ComputePipeline compute(const std::string& body) {
        return *device().create_compute_pipeline({.shader = shader("comp", body), .name = "the pipeline"});
    }
    template <typename Pipeline>
    rhi::BindGroup group(Pipeline pipeline, std::vector<rhi::BindGroupEntry> entries) {
        return *device().create_bind_group(
            {.layout = *device().bind_group_layout(pipeline, 0), .entries = std::move(entries), .name = "the group"});
    }
    rhi::BindGroupLayout layout(rhi::BindingType type, rhi::ShaderStage stages = rhi::ShaderStage::compute,
                                std::uint32_t count = 1) {
        return *device().create_bind_group_layout({.bindings = {{0, type, count, stages}}, .name = "the layout"});
    }

    rhi::CommandList list() { return device().create_command_list("the list"); }
    /// A list inside a render pass over one color target.
    rhi::CommandList pass() {
        rhi::CommandList made = list();
        made.begin_render_pass({.color = {{.view = target()}}, .name = "the pass"});
        return made;
    }

  private:
    NullSetup setup_;
};

}  // namespace nacre::test
