// SPDX-License-Identifier: Apache-2.0
// A triangle through the render-hardware interface alone, on any backend: triangle [BACKEND] [FILE.png]
#include <cstdio>
#include <string>

#include "core/image.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

using namespace nacre;
using namespace nacre::rhi;

namespace {

constexpr std::uint32_t width = 640, height = 480;

constexpr const char* vertex_text = R"(#version 460
layout(location = 0) in vec2 position;
layout(location = 1) in vec3 vertex_color;
layout(location = 0) out vec3 color;
void main() {
    color = vertex_color;
    gl_Position = vec4(position, 0.0, 1.0);
})";

constexpr const char* fragment_text = R"(#version 460
layout(location = 0) in vec3 color;
layout(location = 0) out vec4 result;
void main() { result = vec4(color, 1.0); })";

struct Vertex {
    float position[2];  // Clip space: x to the right, y down.
    float color[3];
};

Expected<void> draw(const std::string& backend, const std::string& file) {
    const Instance instance(all_backends());
    NACRE_TRY(const std::unique_ptr<Device> device, instance.create_device({.backend = backend}));

    ShaderCompiler compiler({});
    NACRE_TRY(const ShaderDesc vertex, compiler.compile({.path = "triangle.vert", .text = vertex_text}));
    NACRE_TRY(const ShaderDesc fragment, compiler.compile({.path = "triangle.frag", .text = fragment_text}));
    NACRE_TRY(const Shader vertex_shader, device->create_shader(vertex));
    NACRE_TRY(const Shader fragment_shader, device->create_shader(fragment));
    NACRE_TRY(const GraphicsPipeline pipeline,
              device->create_graphics_pipeline(
                  {.vertex = vertex_shader, .fragment = fragment_shader,
                   .vertex_buffers = {{.stride = sizeof(Vertex)}},
                   .vertex_attributes = {{.location = 0, .offset = 0, .format = Format::rg32_float},
                                         {.location = 1, .offset = 8, .format = Format::rgb32_float}},
                   .color_targets = {{.format = Format::rgba8_srgb}},
                   .name = "triangle"}));

    const Vertex vertices[] = {{{0.0f, -0.8f}, {1, 0, 0}}, {{0.8f, 0.8f}, {0, 1, 0}}, {{-0.8f, 0.8f}, {0, 0, 1}}};
    NACRE_TRY(const Buffer buffer, device->create_buffer({.size = sizeof(vertices), .usage = BufferUsage::vertex,
                                                          .name = "vertices"}));
    NACRE_CHECK(device->write_buffer(buffer, std::span<const Vertex>(vertices)));
    NACRE_TRY(const Texture target,
              device->create_texture({.format = Format::rgba8_srgb, .width = width, .height = height,
                                      .usage = TextureUsage::color_target | TextureUsage::copy_source,
                                      .name = "picture"}));

    CommandList list = device->create_command_list("frame");
    list.begin_render_pass({.color = {{.view = target, .load = LoadOperation::clear,
                                       .clear = {.floating = {0.02f, 0.02f, 0.02f, 1.0f}}}},
                            .name = "triangle"});
    list.set_pipeline(pipeline);
    list.set_vertex_buffer(0, buffer);
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    NACRE_CHECK(device->submit(std::move(list)));

    NACRE_TRY(const std::vector<std::byte> texels, device->read_texture(target));
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(texels.data());
    NACRE_CHECK(write_png(file, ImageBytes{.width = width, .height = height, .channels = 4,
                                           .bytes = {bytes, bytes + texels.size()}}));
    std::printf("%s: wrote %s\n", device->adapter().name.c_str(), file.c_str());
    return {};
}

}  // namespace

int main(int count, char** arguments) {
    const auto result = draw(count > 1 ? arguments[1] : "auto", count > 2 ? arguments[2] : "triangle.png");
    if (!result) std::fprintf(stderr, "triangle: %s\n", result.error().message().c_str());
    return result ? 0 : 1;
}
