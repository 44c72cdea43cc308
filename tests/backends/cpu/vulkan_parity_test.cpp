// SPDX-License-Identifier: Apache-2.0
// Interpolated values and mips against the Vulkan device of this machine.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::cpu::test {
namespace {

constexpr std::uint32_t width = 640, height = 360;

constexpr const char* vertex_text = R"(#version 460
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 value;
layout(location = 0) out vec2 perspective;
layout(location = 1) noperspective out float linear;
layout(location = 2) flat out float constant;
void main() {
    perspective = value.xy;
    linear = value.z;
    constant = value.w;
    gl_Position = position;
})";

constexpr const char* fragment_text = R"(#version 460
layout(location = 0) in vec2 perspective;
layout(location = 1) noperspective in float linear;
layout(location = 2) flat in float constant;
layout(location = 0) out vec4 values;
layout(location = 1) out vec2 more;
void main() {
    values = vec4(perspective, linear, constant);
    more = vec2(gl_FragCoord.w, 1.0);
})";

struct Vertex {
    float position[4];
    float value[4];
};

// A grid of triangles of both orientations that do not overlap, each in its cell, with w from 0.5 to 50.
std::vector<Vertex> random_triangles() {
    std::mt19937 random(11);
    const auto between = [&](float low, float high) {
        return low + (high - low) * static_cast<float>(random() >> 8) * 0x1p-24f;
    };
    std::vector<Vertex> vertices;
    constexpr float cell = 20;
    for (float y = 0; y + cell <= height; y += cell) {
        for (float x = 0; x + cell <= width; x += cell) {
            const float distance = std::exp2(between(-1, 5));
            for (int corner = 0; corner < 3; ++corner) {
                const float window_x = x + 1 + (corner == 1 ? cell - 6 : 0) + between(0, 4);
                const float window_y = y + 1 + (corner == 2 ? cell - 6 : 0) + between(0, 4);
                const float w = distance * between(1, 1.5f);
                vertices.push_back({{(window_x / width * 2 - 1) * w, (window_y / height * 2 - 1) * w,
                                     between(0.1f, 0.9f) * w, w},
                                    {between(-9, 30), between(0, 1), between(-2, 2), between(-5, 5)}});
            }
            if (random() % 2 == 0) std::swap(vertices.back(), vertices[vertices.size() - 2]);
        }
    }
    return vertices;
}

// Texels of both targets, one after the other.
Expected<std::vector<float>> draw(const std::string& backend, const std::vector<Vertex>& vertices) {
    using namespace rhi;
    const Instance instance(all_backends());
    NACRE_TRY(const std::unique_ptr<Device> device, instance.create_device({.backend = backend}));
    ShaderCompiler compiler({});
    NACRE_TRY(const ShaderDesc vertex, compiler.compile({.path = "interpolation.vert", .text = vertex_text}));
    NACRE_TRY(const ShaderDesc fragment, compiler.compile({.path = "interpolation.frag", .text = fragment_text}));
    NACRE_TRY(const Shader vertex_shader, device->create_shader(vertex));
    NACRE_TRY(const Shader fragment_shader, device->create_shader(fragment));
    NACRE_TRY(const GraphicsPipeline pipeline,
              device->create_graphics_pipeline(
                  {.vertex = vertex_shader,
                   .fragment = fragment_shader,
                   .vertex_buffers = {{.stride = sizeof(Vertex)}},
                   .vertex_attributes = {{.location = 0, .offset = 0, .format = Format::rgba32_float},
                                         {.location = 1, .offset = 16, .format = Format::rgba32_float}},
                   .color_targets = {{.format = Format::rgba32_float}, {.format = Format::rg32_float}},
                   .name = "interpolation"}));
    NACRE_TRY(const Buffer buffer, device->create_buffer({.size = vertices.size() * sizeof(Vertex),
                                                          .usage = BufferUsage::vertex | BufferUsage::copy_destination,
                                                          .name = "vertices"}));
    NACRE_CHECK(device->write_buffer(buffer, std::span<const Vertex>(vertices)));
    const auto target = [&](Format format) {
        return device->create_texture({.format = format,
                                       .width = width,
                                       .height = height,
                                       .usage = TextureUsage::color_target | TextureUsage::copy_source,
                                       .name = "values"});
    };
    NACRE_TRY(const Texture values, target(Format::rgba32_float));
    NACRE_TRY(const Texture more, target(Format::rg32_float));
    CommandList list = device->create_command_list("interpolation");
    list.begin_render_pass({.color = {{.view = values, .load = LoadOperation::clear},
                                      {.view = more, .load = LoadOperation::clear}},
                            .name = "interpolation"});
    list.set_pipeline(pipeline);
    list.set_vertex_buffer(0, buffer);
    list.draw({.vertex_count = static_cast<std::uint32_t>(vertices.size())});
    list.end_render_pass();
    NACRE_CHECK(device->submit(std::move(list)));
    std::vector<float> result;
    for (const Texture& texture : {values, more}) {
        NACRE_TRY(const std::vector<std::byte> bytes, device->read_texture(texture));
        const std::size_t begin = result.size();
        result.resize(begin + bytes.size() / 4);
        std::memcpy(result.data() + begin, bytes.data(), bytes.size());
    }
    return result;
}

// The same bits: planes and their evaluation are made of the same operations on both.
TEST(VulkanParity, InterpolatesToTheBit) {
    const std::vector<Vertex> vertices = random_triangles();
    const auto theirs = draw("vulkan", vertices);
    if (!theirs && theirs.error().code == ErrorCode::not_found) GTEST_SKIP() << theirs.error().message();
    ASSERT_TRUE(theirs) << theirs.error().message();
    for (const char* backend : {"cpu:consistent:lanes=4", "cpu:consistent:lanes=8", "cpu:consistent:lanes=16"}) {
        SCOPED_TRACE(backend);
        const auto ours = draw(backend, vertices);
        ASSERT_TRUE(ours) << ours.error().message();
        ASSERT_EQ(ours->size(), theirs->size());
        std::size_t covered = 0, different = 0, first = 0;
        for (std::size_t i = 0; i < ours->size(); ++i) {
            covered += (*theirs)[i] != 0.0f;
            if (std::bit_cast<std::uint32_t>((*ours)[i]) != std::bit_cast<std::uint32_t>((*theirs)[i]) &&
                different++ == 0)
                first = i;
        }
        EXPECT_GT(covered, 100'000u);
        EXPECT_EQ(different, 0u) << "first at word " << first << ": " << (*ours)[first] << " and " << (*theirs)[first];
    }
}

constexpr std::uint32_t mip_count = 9;

// All mips, one after the other.
Expected<std::vector<std::byte>> make_mips(const std::string& backend) {
    using namespace rhi;
    const Instance instance(all_backends());
    NACRE_TRY(const std::unique_ptr<Device> device, instance.create_device({.backend = backend}));
    NACRE_TRY(const Texture texture,
              device->create_texture({.format = Format::rgba8_unorm,
                                      .width = 256,
                                      .height = 256,
                                      .mips = mip_count,
                                      .usage = TextureUsage::sampled | TextureUsage::copy_destination |
                                               TextureUsage::copy_source | TextureUsage::color_target,
                                      .name = "mips"}));
    std::mt19937 random(5);
    std::vector<std::uint8_t> texels(std::size_t{256} * 256 * 4);
    for (std::uint8_t& texel : texels) texel = static_cast<std::uint8_t>(random());
    NACRE_CHECK(device->write_texture(texture, std::as_bytes(std::span(texels)), 0, 0));
    CommandList list = device->create_command_list("mips");
    list.generate_mips(texture);
    NACRE_CHECK(device->submit(std::move(list)));
    std::vector<std::byte> result;
    for (std::uint32_t mip = 0; mip < mip_count; ++mip) {
        NACRE_TRY(const std::vector<std::byte> bytes, device->read_texture(texture, mip, 0));
        result.insert(result.end(), bytes.begin(), bytes.end());
    }
    return result;
}

TEST(VulkanParity, AveragesToTheBit) {
    const auto theirs = make_mips("vulkan");
    if (!theirs && theirs.error().code == ErrorCode::not_found) GTEST_SKIP() << theirs.error().message();
    ASSERT_TRUE(theirs) << theirs.error().message();
    const auto ours = make_mips("cpu");
    ASSERT_TRUE(ours) << ours.error().message();
    EXPECT_EQ(*ours, *theirs);
}

}  // namespace
}  // namespace nacre::cpu::test
