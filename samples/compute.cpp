// SPDX-License-Identifier: Apache-2.0
// Sums numbers with a compute shader through the render-hardware interface alone: compute [BACKEND]
#include <cstdio>
#include <cstring>
#include <numeric>
#include <string>

#include "rhi/device.h"
#include "rhi/shader_compiler.h"
#include "samples/backends.h"

using namespace nacre;
using namespace nacre::rhi;

namespace {

// Each workgroup adds up 64 numbers in shared memory and then adds its sum to the total.
constexpr const char* shader_text = R"(#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Parameters { uint count; } parameters;
layout(set = 0, binding = 0, std430) readonly buffer Numbers { uint numbers[]; };
layout(set = 0, binding = 1, std430) buffer Total { uint total; };
shared uint sums[64];
void main() {
    uint i = gl_GlobalInvocationID.x, lane = gl_LocalInvocationID.x;
    sums[lane] = i < parameters.count ? numbers[i] : 0u;
    barrier();
    for (uint width = 32u; width > 0u; width >>= 1u) {
        if (lane < width) sums[lane] += sums[lane + width];
        barrier();
    }
    if (lane == 0u) atomicAdd(total, sums[0]);
})";

Expected<void> sum(const std::string& backend) {
    const Instance instance(all_backends());
    NACRE_TRY(const std::unique_ptr<Device> device, instance.create_device({.backend = backend}));

    ShaderCompiler compiler({});
    NACRE_TRY(const ShaderDesc text, compiler.compile({.path = "sum.comp", .text = shader_text}));
    NACRE_TRY(const Shader shader, device->create_shader(text));
    NACRE_TRY(const ComputePipeline pipeline, device->create_compute_pipeline({.shader = shader, .name = "sum"}));

    std::vector<std::uint32_t> numbers(10'000);
    std::iota(numbers.begin(), numbers.end(), 1u);
    NACRE_TRY(const Buffer input, device->create_buffer({.size = numbers.size() * 4, .usage = BufferUsage::storage,
                                                         .name = "numbers"}));
    NACRE_TRY(const Buffer total, device->create_buffer({.size = 4,
                                                         .usage = BufferUsage::storage | BufferUsage::copy_destination,
                                                         .name = "total"}));
    NACRE_CHECK(device->write_buffer(input, std::span<const std::uint32_t>(numbers)));
    NACRE_TRY(const BindGroupLayout layout, device->bind_group_layout(pipeline, 0));
    NACRE_TRY(const BindGroup group, device->create_bind_group({.layout = layout,
                                                                .entries = {{.binding = 0, .buffer = input},
                                                                            {.binding = 1, .buffer = total}},
                                                                .name = "sum"}));

    const auto count = static_cast<std::uint32_t>(numbers.size());
    CommandList list = device->create_command_list("sum");
    list.fill_buffer(total, 0);
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group);
    list.set_push_constants(count);
    list.dispatch({.x = (count + 63) / 64});
    NACRE_CHECK(device->submit(std::move(list)));

    NACRE_TRY(const std::vector<std::byte> bytes, device->read_buffer(total));
    std::uint32_t result = 0;
    std::memcpy(&result, bytes.data(), sizeof(result));
    std::printf("%s: the sum of 1 to %u is %u\n", device->adapter().name.c_str(), count, result);
    return {};
}

}  // namespace

int main(int count, char** arguments) {
    const auto result = sum(count > 1 ? arguments[1] : "auto");
    if (!result) std::fprintf(stderr, "compute: %s\n", result.error().message().c_str());
    return result ? 0 : 1;
}
