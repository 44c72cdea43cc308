// SPDX-License-Identifier: Apache-2.0
#include "passes/exact_readback.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "rhi/shader_compiler.h"

namespace nacre::passes {
namespace {

constexpr const char* shader_text = R"(#version 460
#extension GL_EXT_samplerless_texture_functions : require
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) writeonly buffer Result { uvec2 result[]; };
layout(set = 0, binding = 1) uniform texture2D image;
void main() {
    ivec2 size = textureSize(image, 0);
    int at = int(gl_GlobalInvocationID.x) + int(gl_GlobalInvocationID.y) * 65536 * 64;
    if (at >= size.x * size.y) return;
    vec4 texel = texelFetch(image, ivec2(at % size.x, at / size.x), 0);
    for (int c = 0; c < 4; ++c) result[4 * at + c] = unpackDouble2x32(double(texel[c]));
}
)";

/// Objects that live for one call.
template <typename Handle>
class Temporary {
  public:
    Temporary(rhi::Device& device, Handle handle) : device_(device), handle_(handle) {}
    ~Temporary() { device_.destroy(handle_); }
    Temporary(const Temporary&) = delete;
    Temporary& operator=(const Temporary&) = delete;
    operator Handle() const { return handle_; }  // NOLINT: stands for what it holds.

  private:
    rhi::Device& device_;
    Handle handle_;
};

}  // namespace

Expected<std::vector<double>> read_exactly(rhi::Device& device, rhi::Texture texture, std::uint32_t mip,
                                           std::uint32_t layer) {
    if (!device.capabilities().shader_float64)
        return fail(ErrorCode::unsupported, "read texture in double precision", device.adapter().name,
                    "its shaders have no float64", "Read the bits of the texture.");
    NACRE_TRY(const rhi::TextureDesc desc, device.describe(texture));
    if ((desc.usage & rhi::TextureUsage::sampled) == rhi::TextureUsage::none)
        return fail(ErrorCode::unsupported, "read texture in double precision", fmt::format("'{}'", desc.name),
                    "no shader may read it", "Read the bits of the texture, or make it with TextureUsage::sampled.");
    const rhi::Extent3D extent = rhi::mip_extent(desc, mip);
    const std::uint64_t texels = std::uint64_t{extent.width} * extent.height;
    rhi::ShaderCompiler compiler({});
    NACRE_TRY(const rhi::ShaderDesc compiled,
              compiler.compile({.path = "passes/exact_readback.comp", .text = shader_text}));
    NACRE_TRY(const rhi::Shader made_shader, device.create_shader(compiled));
    const Temporary<rhi::Shader> shader(device, made_shader);
    NACRE_TRY(const rhi::ComputePipeline made_pipeline,
              device.create_compute_pipeline({.shader = shader, .name = "exact_readback"}));
    const Temporary<rhi::ComputePipeline> pipeline(device, made_pipeline);
    NACRE_TRY(const rhi::Buffer made_buffer,
              device.create_buffer({.size = texels * 4 * sizeof(double),
                                    .usage = rhi::BufferUsage::storage | rhi::BufferUsage::copy_source,
                                    .name = "exact_readback"}));
    const Temporary<rhi::Buffer> result(device, made_buffer);
    NACRE_TRY(const rhi::BindGroupLayout layout, device.bind_group_layout(made_pipeline, 0));
    NACRE_TRY(const rhi::BindGroup made_group,
              device.create_bind_group(
                  {.layout = layout,
                   .entries = {{.binding = 0, .buffer = result},
                               {.binding = 1, .texture = rhi::TextureView::subresource(texture, mip, layer)}},
                   .name = "exact_readback"}));
    const Temporary<rhi::BindGroup> group(device, made_group);
    rhi::CommandList list = device.create_command_list("exact_readback");
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group);
    const auto groups = static_cast<std::uint32_t>((texels + 63) / 64);
    list.dispatch({std::min(groups, 65536u), (groups + 65535) / 65536, 1});
    NACRE_TRY(const rhi::Fence fence, device.submit(std::move(list)));
    NACRE_CHECK(device.wait(fence));
    NACRE_TRY(const std::vector<std::byte> bytes, device.read_buffer(result));
    std::vector<double> values(texels * 4);
    std::memcpy(values.data(), bytes.data(), values.size() * sizeof(double));
    return values;
}

}  // namespace nacre::passes
