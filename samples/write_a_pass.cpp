// SPDX-License-Identifier: Apache-2.0
// A pass of one's own in a frame graph: write_a_pass [BACKEND] [FILE.png]
#include <cstdio>
#include <string>

#include "core/image.h"
#include "passes/frame_graph.h"
#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

using namespace nacre;
using namespace nacre::rhi;
using namespace nacre::passes;

namespace {

constexpr std::uint32_t width = 320, height = 240;

// [a pass in 40 lines]
constexpr const char* vignette_text = R"(#version 460
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform sampler2D picture;
layout(set = 0, binding = 1, rgba8) uniform writeonly image2D result;
void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    vec2 from_center = (vec2(texel) + 0.5) / vec2(textureSize(picture, 0)) * 2.0 - 1.0;
    float light = 1.0 - 0.4 * dot(from_center, from_center);
    imageStore(result, texel, vec4(texelFetch(picture, texel, 0).rgb * light, 1.0));
})";

/// Darkens a picture towards its corners.
struct Vignette {
    TextureId picture, result;
    ComputePipeline pipeline;
    BindGroup group;

    // Says what the pass reads and writes, and what it does in each frame. No barrier is ever written.
    Vignette(FrameGraph& graph, TextureId input) : picture(input) {
        result =
            graph.add_texture({.format = Format::rgba8_unorm, .width = width, .height = height, .name = "vignette"});
        PassDeclaration pass = graph.add_pass("vignette");
        pass.uses(picture, ResourceUse::sampled).uses(result, ResourceUse::storage_write);
        pass.records([this](PassContext& frame) {
            frame.list.set_pipeline(pipeline);
            frame.list.set_bind_group(0, group);
            frame.list.dispatch({.x = width / 8, .y = height / 8});
        });
    }
    // Makes the pipeline and binds the textures, once the graph has made them.
    Expected<void> prepare(Device& device, const FrameGraph& graph, ShaderCompiler& compiler, Sampler sampler) {
        NACRE_TRY(const ShaderDesc text, compiler.compile({.path = "vignette.comp", .text = vignette_text}));
        NACRE_TRY(const Shader shader, device.create_shader(text));
        NACRE_TRY(pipeline, device.create_compute_pipeline({.shader = shader, .name = "vignette"}));
        NACRE_TRY(const BindGroupLayout layout, device.bind_group_layout(pipeline, 0));
        const BindGroupEntry input{.binding = 0, .texture = graph.texture(picture), .sampler = sampler};
        const BindGroupEntry output{.binding = 1, .texture = graph.texture(result)};
        NACRE_TRY(group, device.create_bind_group({.layout = layout, .entries = {input, output}, .name = "vignette"}));
        return {};
    }
};
// [end]

Expected<void> draw(const std::string& backend, const std::string& file) {
    const Instance instance(all_backends());
    NACRE_TRY(const std::unique_ptr<Device> device, instance.create_device({.backend = backend}));

    // A picture from elsewhere: a checkerboard.
    const TextureDesc desc{.format = Format::rgba8_unorm, .width = width, .height = height,
                           .usage = TextureUsage::sampled | TextureUsage::copy_destination, .name = "checkerboard"};
    std::vector<std::uint8_t> texels(std::size_t{width} * height * 4, 255);
    for (std::size_t i = 0; i < texels.size() / 4; ++i)
        texels[i * 4] = ((i % width / 20 + i / width / 20) % 2 == 0) ? 255 : 100;
    NACRE_TRY(const Texture checkerboard, device->create_texture(desc));
    NACRE_CHECK(device->write_texture(checkerboard, std::as_bytes(std::span(texels))));

    FrameGraph graph;
    Vignette vignette(graph, graph.import_texture(checkerboard, desc));
    graph.keep(vignette.result);
    NACRE_CHECK(graph.compile());
    NACRE_CHECK(graph.realize(*device));
    ShaderCompiler compiler({});
    NACRE_TRY(const Sampler sampler, device->create_sampler({.name = "any"}));
    NACRE_CHECK(vignette.prepare(*device, graph, compiler, sampler));

    CommandList list = device->create_command_list("frame");
    graph.record(list);
    NACRE_CHECK(device->submit(std::move(list)));
    NACRE_TRY(const std::vector<std::byte> result, device->read_texture(graph.texture(vignette.result)));
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(result.data());
    return write_png(file, ImageBytes{.width = width, .height = height, .channels = 4,
                                      .bytes = {bytes, bytes + result.size()}});
}

}  // namespace

int main(int count, char** arguments) {
    const std::string file = count > 2 ? arguments[2] : "vignette.png";
    const auto result = draw(count > 1 ? arguments[1] : "auto", file);
    if (!result) {
        std::fprintf(stderr, "write_a_pass: %s\n", result.error().message().c_str());
        return 1;
    }
    std::printf("wrote %s\n", file.c_str());
    return 0;
}
