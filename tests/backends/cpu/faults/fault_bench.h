// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"

namespace nacre::cpu {

/// A device that looks for faults, and a few resources for small shaders.
///
/// Set 0 of compute shaders: binding 0 buffer 'output' (256 words, nothing has written them), 1 buffer 'input' (64
/// words, 0 to 63), 2 image 'picture' (8x8 words, nothing has written them), 3 texture 'numbers' (8x8 words, 0 to 63),
/// 4 sampler 'nearest', 5 texture 'target', 6 texel buffer of the words of 'output', 7 texel buffer of those of
/// 'input'. Shaders declare what they use.
class FaultBench {
  public:
    explicit FaultBench(const std::string& backend);

    /// Runs a compute shader of `groups` workgroups along x; what it declares is bound.
    Expected<void> compute(const std::string& path, const std::string& text, std::uint32_t groups = 1);
    /// Draws a triangle over all of 'target' (8x8 texels) with a fragment shader; set 0 as above.
    Expected<void> draw(const std::string& path, const std::string& text, const std::string& vertex_text = {},
                        rhi::LoadOperation load = rhi::LoadOperation::clear);
    Expected<void> submit(rhi::CommandList list);
    rhi::ComputePipeline make_compute(const std::string& path, const std::string& text);
    /// Of a pipeline that draws to 'target'; the vertex shader covers all of it where no text is given.
    rhi::GraphicsPipelineDesc describe_graphics(const std::string& path, const std::string& text,
                                                const std::string& vertex_text = {});
    rhi::GraphicsPipeline make_graphics(const std::string& path, const std::string& text,
                                        const std::string& vertex_text = {}, const rhi::VertexBufferLayout& layout = {},
                                        std::vector<rhi::VertexAttribute> attributes = {});
    rhi::BindGroup bind(rhi::ComputePipeline pipeline);
    rhi::BindGroup bind(rhi::BindGroupLayout layout);

    /// What the device has said of shaders so far.
    [[nodiscard]] std::vector<rhi::Message> messages() const;

    rhi::Device& device() { return *device_; }
    rhi::Buffer output, input;
    rhi::Texture picture, numbers, target;
    rhi::Sampler nearest;

  private:
    rhi::Shader make_shader(const std::string& path, const std::string& text);
    // Before the device, which may have something to say until its end.
    mutable std::mutex mutex_;
    std::vector<rhi::Message> messages_;
    std::unique_ptr<rhi::Device> device_;
};

/// "PATH:LINE" of the line of a text that holds "FAULT".
std::string faulty_line(const std::string& path, const std::string& text);

}  // namespace nacre::cpu
