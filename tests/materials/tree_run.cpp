// SPDX-License-Identifier: Apache-2.0
#include "tests/materials/tree_run.h"

#include <cmath>

#include "materials/storage_shader.h"
#include "materials/tables/anisotropy_table.h"
#include "materials/tables/interface_table.h"
#include "materials/tables/medium_table.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

namespace nacre::materials {
namespace {

constexpr const char* declarations = R"(
layout(local_size_x = 64) in;
layout(set = 0, binding = 0, std430) readonly buffer Directions { vec4 directions[]; };
layout(set = 0, binding = 1, std430) readonly buffer Parameters { float parameters[]; };
layout(set = 0, binding = 3, std430) readonly buffer InterfaceTable { uint interface_words[]; };
layout(set = 0, binding = 4, std430) readonly buffer MediumTable { uint medium_words[]; };
layout(set = 0, binding = 5, std430) readonly buffer AnisotropyTable { uint anisotropy_words[]; };
#include "materials/closures/table_buffers.glsl"
float tree_parameter(uint index) { return parameters[index]; }
vec4 tree_texture(uint index) { return vec4(0.25, 0.5, 0.75, 1.0); }
vec3 specular_lut(uint index, vec2 at) { return vec3(1.0); }
#define NACRE_TREE_VERTEX_COLOR vec4(0.5, 0.25, 1.0, 0.5)
)";

}  // namespace

std::string TreeDeviceTest::name_of(const testing::TestParamInfo<const char*>& backend) {
    const std::string name = backend.param;
    return name.substr(0, name.find(':'));
}

void TreeDeviceTest::SetUp() {
    static const rhi::Instance instance(all_backends());
    auto device = instance.create_device({.backend = GetParam()});
    if (!device && device.error().code == ErrorCode::not_found) GTEST_SKIP() << device.error().message();
    ASSERT_TRUE(device) << device.error().message();
    device_ = std::move(*device);
}

std::vector<glm::vec4> random_directions(std::mt19937& random) {
    std::vector<glm::vec4> result;
    const auto uniform = [&] { return static_cast<float>(random() >> 8) * 0x1p-24f; };
    for (std::uint32_t i = 0; i < 2 * direction_pairs; ++i) {
        const float z = i % 8 == 0 ? 0.001f + 0.01f * uniform() : 0.02f + 0.98f * uniform();
        const float phi = 6.2831853f * uniform(), radius = std::sqrt(1.0f - z * z);
        result.emplace_back(radius * std::cos(phi), radius * std::sin(phi), z, 0.0f);
    }
    return result;
}

Expected<std::vector<std::byte>> run_tree(rhi::Device& device, const TreeShader& tree, const std::string& text,
                                          const std::vector<glm::vec4>& directions, std::size_t result_bytes) {
    rhi::ShaderCompiler compiler({.embedded = {embedded_files(), storage_reader_files()}});
    NACRE_TRY(const rhi::ShaderDesc compiled,
              compiler.compile({.path = "tree.comp", .text = tree.defines + declarations + text}));
    NACRE_TRY(const rhi::Shader shader, device.create_shader(compiled));
    NACRE_TRY(const rhi::ComputePipeline pipeline, device.create_compute_pipeline({.shader = shader, .name = "tree"}));
    const auto make = [&](std::size_t size, const void* data, const char* name) -> Expected<rhi::Buffer> {
        NACRE_TRY(rhi::Buffer buffer,
                  device.create_buffer({.size = size, .usage = rhi::BufferUsage::storage, .name = name}));
        if (data != nullptr)
            NACRE_CHECK(device.write_buffer(buffer, std::span(static_cast<const std::byte*>(data), size)));
        return buffer;
    };
    const auto table = [&](std::span<const std::uint16_t> words, const char* name) {
        return make(words.size_bytes(), words.data(), name);
    };
    NACRE_TRY(const rhi::Buffer inputs, make(directions.size() * sizeof(glm::vec4), directions.data(), "directions"));
    NACRE_TRY(const rhi::Buffer parameters, make(tree.parameters.size() * 4, tree.parameters.data(), "parameters"));
    NACRE_TRY(const rhi::Buffer results, make(result_bytes, nullptr, "results"));
    NACRE_TRY(const rhi::Buffer interface, table(interface_table(), "interface table"));
    NACRE_TRY(const rhi::Buffer medium, table(medium_table(), "medium table"));
    NACRE_TRY(const rhi::Buffer anisotropy, table(anisotropy_table(), "anisotropy table"));
    NACRE_TRY(const rhi::BindGroupLayout layout, device.bind_group_layout(pipeline, 0));
    NACRE_TRY(const rhi::BindGroup group, device.create_bind_group({.layout = layout,
                                                                    .entries = {{.binding = 0, .buffer = inputs},
                                                                                {.binding = 1, .buffer = parameters},
                                                                                {.binding = 2, .buffer = results},
                                                                                {.binding = 3, .buffer = interface},
                                                                                {.binding = 4, .buffer = medium},
                                                                                {.binding = 5, .buffer = anisotropy}},
                                                                    .name = "tree"}));
    rhi::CommandList list = device.create_command_list("tree");
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group);
    list.dispatch({.x = direction_pairs / 64});
    NACRE_CHECK(device.submit(std::move(list)));
    return device.read_buffer(results);
}

}  // namespace nacre::materials
