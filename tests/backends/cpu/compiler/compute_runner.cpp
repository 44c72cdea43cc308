// SPDX-License-Identifier: Apache-2.0
#include "tests/backends/cpu/compiler/compute_runner.h"

#include <cstring>
#include <numeric>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"
#include "tests/rhi/assembly.h"

namespace nacre::cpu {

Expected<std::vector<std::uint32_t>> ComputeRunner::run(std::vector<std::uint32_t> spirv) const {
    rhi::Instance instance(all_backends());
    NACRE_TRY(auto device, instance.create_device({.backend = spec}));
    NACRE_TRY(const auto shader,
              device->create_shader({.spirv = std::move(spirv), .stage = rhi::ShaderStage::compute, .name = "test"}));
    NACRE_TRY(const auto pipeline, device->create_compute_pipeline({.shader = shader, .name = "test"}));
    NACRE_TRY(const auto layout, device->bind_group_layout(pipeline, 0));
    NACRE_TRY(const auto result, device->create_buffer({.size = result_words * 4, .usage = rhi::BufferUsage::storage}));
    NACRE_TRY(const auto input, device->create_buffer({.size = 1024, .usage = rhi::BufferUsage::storage}));
    const std::vector<std::uint32_t> before(result_words, 12345u);
    NACRE_CHECK(device->write_buffer(result, std::span(before)));
    std::vector<std::uint32_t> numbers(256);
    std::iota(numbers.begin(), numbers.end(), 0u);
    NACRE_CHECK(device->write_buffer(input, std::span<const std::uint32_t>(numbers)));
    std::vector<rhi::BindGroupEntry> entries{{.binding = 0, .buffer = result}, {.binding = 1, .buffer = input}};
    auto group = device->create_bind_group({.layout = layout, .entries = entries, .name = "test"});
    if (!group) {
        entries.pop_back();
        group = device->create_bind_group({.layout = layout, .entries = entries, .name = "test"});
    }
    if (!group) return std::unexpected(group.error());
    rhi::CommandList list = device->create_command_list("test");
    list.set_pipeline(pipeline);
    list.set_bind_group(0, *group);
    list.dispatch({});
    NACRE_CHECK(device->submit(std::move(list)));
    NACRE_TRY(const auto bytes, device->read_buffer(result));
    std::vector<std::uint32_t> words(result_words);
    std::memcpy(words.data(), bytes.data(), result_words * 4);
    return words;
}

Expected<std::vector<std::uint32_t>> ComputeRunner::run_glsl(const std::string& text) const {
    rhi::ShaderCompiler compiler({});
    NACRE_TRY(auto shader, compiler.compile({.path = "test.comp", .text = text}));
    return run(std::move(shader.spirv));
}

Expected<std::vector<std::uint32_t>> ComputeRunner::run_assembly(const std::string& text, std::uint32_t version) const {
    NACRE_TRY(std::vector<std::uint32_t> words,
              rhi::test::assemble(text, version == 0x10300   ? SPV_ENV_VULKAN_1_1
                                        : version == 0x10400 ? SPV_ENV_VULKAN_1_1_SPIRV_1_4
                                                             : SPV_ENV_VULKAN_1_3));
    return run(std::move(words));
}

}  // namespace nacre::cpu
