// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/images/device_comparison.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>

#include "backends/vulkan/vulkan_backend.h"
#include "rhi/backend.h"
#include "rhi/shader_compiler.h"

namespace nacre::cpu::test {
namespace {

template <typename T>
T must(Expected<T> value) {
    if (value) return *std::move(value);
    ADD_FAILURE() << value.error().message();
    return T{};
}
void must(Expected<void> value) { EXPECT_TRUE(value) << value.error().message(); }

// Per point: coordinates; lod, reference, 0, 0; gradients; offset.
struct DevicePoint {
    std::uint32_t coordinates[4];
    float lod, reference, unused[2];
    float gradient_x[4], gradient_y[4];
    std::int32_t offset[4];
};

}  // namespace

Oracle::Oracle() {
    // One level of detail for each pixel, and none of the approximations that the driver likes for speed.
    setenv("GALLIVM_PERF", "no_quad_lod,no_aos_sampling,no_brilinear,no_rho_approx", 1);
    std::vector<std::unique_ptr<rhi::Backend>> backends;
    backends.push_back(vulkan::make_backend());
    instance_ = std::make_unique<rhi::Instance>(std::move(backends));
    auto made = instance_->create_device({.backend = "vulkan"});
    if (made)
        device_ = std::move(*made);
    else
        error_ = made.error();
}
Oracle::~Oracle() = default;

std::string sampler_type(rhi::Format format, rhi::ViewDimension dimension, bool is_comparison, bool is_multisampled) {
    const rhi::FormatInfo& facts = rhi::info(format);
    std::string name = facts.kind == rhi::FormatKind::uint ? "u" : facts.kind == rhi::FormatKind::sint ? "i" : "";
    name += "sampler";
    using enum rhi::ViewDimension;
    switch (dimension) {
        case d1: name += "1D"; break;
        case d1_array: name += "1DArray"; break;
        case d2_array: name += is_multisampled ? "2DMSArray" : "2DArray"; break;
        case d3: name += "3D"; break;
        case cube: name += "Cube"; break;
        case cube_array: name += "CubeArray"; break;
        default: name += is_multisampled ? "2DMS" : "2D"; break;
    }
    return name + (is_comparison ? "Shadow" : "");
}

std::vector<Result> Oracle::evaluate(const TestImage& image, const rhi::SamplerDesc& sampler_desc,
                                     const std::string& expression, std::span<const Point> points) {
    const ImageShape& shape = image.shape;
    rhi::TextureDesc desc{.format = shape.format,
                          .width = shape.width,
                          .height = shape.height,
                          .depth = shape.depth,
                          .layers = shape.layers,
                          .mips = shape.mips,
                          .usage = rhi::TextureUsage::sampled | rhi::TextureUsage::copy_destination,
                          .name = "oracle"};
    using enum rhi::ViewDimension;
    switch (shape.dimension) {
        case d1:
        case d1_array: desc.dimension = rhi::TextureDimension::d1; break;
        case d3: desc.dimension = rhi::TextureDimension::d3; break;
        case cube:
        case cube_array: desc.dimension = rhi::TextureDimension::cube; break;
        default: desc.dimension = rhi::TextureDimension::d2; break;
    }
    const rhi::Texture texture = must(device_->create_texture(desc));
    for (std::uint32_t mip = 0; mip < shape.mips; ++mip) {
        for (std::uint32_t layer = 0; layer < shape.layers; ++layer)
            must(device_->write_texture(texture, image.layer(mip, layer), mip, layer));
    }
    rhi::TextureView view(texture);
    view.dimension = shape.dimension;
    const rhi::Sampler sampler = must(device_->create_sampler(sampler_desc));

    std::vector<DevicePoint> input(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Point& point = points[i];
        std::memcpy(input[i].coordinates, point.coordinates.data(), 16);
        input[i].lod = point.lod, input[i].reference = point.reference;
        for (int axis = 0; axis < 3; ++axis) {
            input[i].gradient_x[axis] = point.gradient_x[axis];
            input[i].gradient_y[axis] = point.gradient_y[axis];
            input[i].offset[axis] = point.offset[axis];
        }
    }
    const auto storage = rhi::BufferUsage::storage | rhi::BufferUsage::copy_source | rhi::BufferUsage::copy_destination;
    const rhi::Buffer in = must(device_->create_buffer({.size = input.size() * sizeof(DevicePoint), .usage = storage}));
    must(device_->write_buffer(in, std::span<const DevicePoint>(input)));
    const rhi::Buffer out = must(device_->create_buffer({.size = points.size() * 16, .usage = storage}));

    const bool is_integer = rhi::info(shape.format).is_integer();
    const std::string to_bits = !is_integer ? "floatBitsToUint(vec4(" + expression + "))" : "uvec4(" + expression + ")";
    const std::string text = R"(
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) uniform )" +
                             sampler_type(shape.format, shape.dimension, sampler_desc.comparison) + R"( image;
struct Point { uvec4 coordinates; vec4 lod; vec4 gx; vec4 gy; ivec4 offset; };
layout(set = 0, binding = 1, std430) readonly buffer Input { Point points[]; };
layout(set = 0, binding = 2, std430) buffer Output { uvec4 results[]; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= points.length()) return;
    vec4 p = uintBitsToFloat(points[i].coordinates);
    ivec4 ip = ivec4(points[i].coordinates);
    float lod = points[i].lod.x, reference = points[i].lod.y;
    vec3 gx = points[i].gx.xyz, gy = points[i].gy.xyz;
    ivec3 offset = points[i].offset.xyz;
    results[i] = )" + to_bits +
                             R"(;
})";
    rhi::ShaderCompiler compiler({});
    auto shader = compiler.compile({.path = "oracle.comp", .text = text});
    if (!shader) {
        ADD_FAILURE() << shader.error().message();
        return std::vector<Result>(points.size());
    }
    const rhi::Shader shader_handle = must(device_->create_shader(*shader));
    const rhi::ComputePipeline pipeline = must(device_->create_compute_pipeline({.shader = shader_handle}));
    const rhi::BindGroup group =
        must(device_->create_bind_group({.layout = must(device_->bind_group_layout(pipeline, 0)),
                                         .entries = {{.binding = 0, .texture = view, .sampler = sampler},
                                                     {.binding = 1, .buffer = in},
                                                     {.binding = 2, .buffer = out}}}));
    rhi::CommandList list = device_->create_command_list("oracle");
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group);
    list.dispatch({.x = static_cast<std::uint32_t>((points.size() + 63) / 64)});
    must(device_->submit(std::move(list)));
    const std::vector<std::byte> bytes = must(device_->read_buffer(out));
    std::vector<Result> results(points.size());
    if (bytes.size() == results.size() * 16) std::memcpy(results.data(), bytes.data(), bytes.size());
    device_->destroy(group);
    device_->destroy(pipeline);
    device_->destroy(shader_handle);
    device_->destroy(in);
    device_->destroy(out);
    device_->destroy(sampler);
    device_->destroy(texture);
    return results;
}

}  // namespace nacre::cpu::test
