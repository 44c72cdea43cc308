// SPDX-License-Identifier: Apache-2.0
// Compute shaders: constants, indirect dispatches, and the barriers between dispatches that nobody writes.
#include <numeric>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(Compute);

TEST_P(Compute, WorkgroupsAndInvocations) {
    const auto values = evaluate<std::uint32_t>(R"(
        layout(local_size_x = 4, local_size_y = 2, local_size_z = 2) in;
        layout(set = 0, binding = 0) buffer Result { uint result[]; };
        void main() {
            uint group = (gl_WorkGroupID.z * gl_NumWorkGroups.y + gl_WorkGroupID.y) * gl_NumWorkGroups.x + gl_WorkGroupID.x;
            result[group * 16u + gl_LocalInvocationIndex] = group * 1000u + gl_LocalInvocationID.x + 10u * gl_LocalInvocationID.y + 100u * gl_LocalInvocationID.z;
        }
    )",
                                                16 * 12, {}, {3, 2, 2});
    for (std::uint32_t group = 0; group < 12; ++group)
        for (std::uint32_t i = 0; i < 16; ++i)
            ASSERT_EQ(values[group * 16 + i], group * 1000 + i % 4 + i / 4 % 2 * 10 + i / 8 * 100);
}

TEST_P(Compute, SpecializationConstants) {
    const std::string body = R"(
        layout(local_size_x_id = 4, local_size_y = 1) in;
        layout(constant_id = 0) const bool flag = false;
        layout(constant_id = 1) const int number = -1;
        layout(constant_id = 2) const uint count = 3u;
        layout(constant_id = 3) const float scale = 0.5;
        layout(set = 0, binding = 0) buffer Result { float result[8]; };
        void main() {
            result[0] = flag ? 1.0 : 0.0; result[1] = float(number); result[2] = float(count); result[3] = scale;
            result[4] = float(gl_WorkGroupSize.x);
        }
    )";
    const Buffer result = buffer(32, BufferUsage::storage);
    dispatch(compute(body, {{4, 1u}}), {{.binding = 0, .buffer = result}});
    auto values = read<float>(result);
    EXPECT_EQ(std::vector<float>(values.begin(), values.begin() + 5), (std::vector<float>{0, -1, 3, 0.5f, 1}));
    dispatch(compute(body, {{0, true}, {1, -77}, {2, 4000000u}, {3, 2.25f}, {4, 8u}}),
             {{.binding = 0, .buffer = result}});
    values = read<float>(result);
    EXPECT_EQ(std::vector<float>(values.begin(), values.begin() + 5), (std::vector<float>{1, -77, 4000000, 2.25f, 8}));
}

TEST_P(Compute, PushConstantsAreKeptAndChanged) {
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 1) in;
        layout(push_constant) uniform Constants { vec4 a; uint at; float b[3]; ivec2 c; };
        layout(set = 0, binding = 0) buffer Result { float result[]; };
        void main() {
            result[at * 8u + 0u] = a.x; result[at * 8u + 1u] = a.w; result[at * 8u + 2u] = b[0]; result[at * 8u + 3u] = b[2];
            result[at * 8u + 4u] = float(c.x); result[at * 8u + 5u] = float(c.y);
        }
    )");
    struct Constants {
        float a[4];
        std::uint32_t at;
        float b[3];
        std::int32_t c[2];
    } constants{{1, 2, 3, 4}, 0, {5, 6, 7}, {-8, 9}};
    const Buffer result = buffer(64, BufferUsage::storage);
    CommandList list = device().create_command_list("constants");
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group(pipeline, {{.binding = 0, .buffer = result}}));
    list.set_push_constants(constants);
    list.dispatch({});
    const std::uint32_t one = 1;
    list.set_push_constants(one, 16);
    const float other = 70.0f;
    list.set_push_constants(other, 28);
    list.dispatch({});
    run(std::move(list));
    const auto values = read<float>(result);
    EXPECT_EQ(std::vector<float>(values.begin(), values.begin() + 6), (std::vector<float>{1, 4, 5, 7, -8, 9}));
    EXPECT_EQ(std::vector<float>(values.begin() + 8, values.begin() + 14), (std::vector<float>{1, 4, 5, 70, -8, 9}));
}

TEST_P(Compute, IndirectDispatchReadsWhatAnotherWrote) {
    const Buffer arguments = buffer(32, BufferUsage::storage | BufferUsage::indirect, "arguments");
    const Buffer result = buffer(4 * 64, BufferUsage::storage, "result");
    ok(device().write_buffer(result, std::vector<std::byte>(256)));
    const ComputePipeline producer = compute(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Arguments { uint values[8]; };
        void main() { values[4] = 5u; values[5] = 2u; values[6] = 1u; }
    )");
    const ComputePipeline consumer = compute(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { uint result[]; };
        void main() { atomicAdd(result[gl_WorkGroupID.x + 10u * gl_WorkGroupID.y], 1u); }
    )");
    CommandList list = device().create_command_list("indirect");
    list.set_pipeline(producer);
    list.set_bind_group(0, group(producer, {{.binding = 0, .buffer = arguments}}));
    list.dispatch({});
    list.set_pipeline(consumer);
    list.set_bind_group(0, group(consumer, {{.binding = 0, .buffer = result}}));
    list.dispatch_indirect(arguments, 16);
    run(std::move(list));
    const auto values = read<std::uint32_t>(result);
    for (std::uint32_t i = 0; i < 64; ++i) EXPECT_EQ(values[i], i % 10 < 5 && i < 15 ? 1u : 0u) << i;
}

TEST_P(Compute, DispatchesSeeWhatEarlierOnesWrote) {
    constexpr std::uint32_t count = 4096;
    const Buffer a = buffer(count * 4, BufferUsage::storage, "a");
    const Buffer b = buffer(count * 4, BufferUsage::storage, "b");
    std::vector<std::uint32_t> start(count);
    std::iota(start.begin(), start.end(), 0u);
    ok(device().write_buffer<std::uint32_t>(a, start));
    // Each step reads what the one before wrote, at another place: any missing barrier shows.
    const ComputePipeline step = compute(R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) readonly buffer Source { uint source[]; };
        layout(set = 0, binding = 1) buffer Destination { uint destination[]; };
        void main() {
            uint i = gl_GlobalInvocationID.x;
            destination[(i * 1021u + 17u) % 4096u] = source[i] + 1u;
        }
    )");
    const BindGroup forth = group(step, {{.binding = 0, .buffer = a}, {.binding = 1, .buffer = b}});
    const BindGroup back = group(step, {{.binding = 0, .buffer = b}, {.binding = 1, .buffer = a}});
    CommandList list = device().create_command_list("steps");
    list.set_pipeline(step);
    for (int i = 0; i < 20; ++i) {
        list.set_bind_group(0, i % 2 == 0 ? forth : back);
        list.dispatch({count / 64, 1, 1});
    }
    run(std::move(list));
    std::vector<std::uint32_t> expected = start, next(count);
    for (int i = 0; i < 20; ++i) {
        for (std::uint32_t at = 0; at < count; ++at) next[(at * 1021 + 17) % count] = expected[at] + 1;
        expected.swap(next);
    }
    EXPECT_EQ(read<std::uint32_t>(a), expected);
}

TEST_P(Compute, SharedMemoryAndBarriers) {
    const auto values = evaluate<std::uint32_t>(R"(
        layout(local_size_x = 64) in;
        layout(set = 0, binding = 0) buffer Result { uint result[64]; };
        shared uint values[64];
        void main() {
            uint i = gl_LocalInvocationIndex;
            values[i] = i * i;
            barrier();
            result[i] = values[63u - i];
        }
    )",
                                                64);
    for (std::uint32_t i = 0; i < 64; ++i) EXPECT_EQ(values[i], (63 - i) * (63 - i));
}

TEST_P(Compute, SeveralBindGroups) {
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 2) uniform A { vec4 a; };
        layout(set = 1, binding = 0) readonly buffer B { float b[4]; };
        layout(set = 3, binding = 1) buffer Result { float result[4]; };
        void main() { for (int i = 0; i < 4; ++i) result[i] = a[i] * b[i]; }
    )");
    const std::array<float, 4> a{1, 2, 3, 4}, b{10, 20, 30, 40};
    const Buffer uniform = buffer_of<float>(a, BufferUsage::uniform);
    const Buffer storage = buffer_of<float>(b, BufferUsage::storage);
    const Buffer result = buffer(16, BufferUsage::storage);
    CommandList list = device().create_command_list("groups");
    // Any order: what is bound counts at the dispatch.
    list.set_bind_group(3, group(pipeline, {{.binding = 1, .buffer = result}}, 3));
    list.set_bind_group(0, group(pipeline, {{.binding = 2, .buffer = uniform}}, 0));
    list.set_pipeline(pipeline);
    list.set_bind_group(1, group(pipeline, {{.binding = 0, .buffer = storage}}, 1));
    list.dispatch({});
    run(std::move(list));
    EXPECT_EQ(read<float>(result), (std::vector<float>{10, 40, 90, 160}));
}

TEST_P(Compute, ExplicitLayoutsAreSharedByPipelines) {
    const BindGroupLayout layout = ok(device().create_bind_group_layout(
        {.bindings = {{0, BindingType::storage_buffer, 1, ShaderStage::compute},
                      {1, BindingType::uniform_buffer, 1, ShaderStage::compute},
                      {2, BindingType::readonly_storage_buffer, 1, ShaderStage::compute}},
         .name = "shared"}));
    const auto make = [&](const std::string& body) {
        return ok(device().create_compute_pipeline(
            {.shader = shader(ShaderStage::compute, body), .bind_group_layouts = {layout}, .name = "one"}));
    };
    const ComputePipeline first = make(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { float result[4]; };
        layout(set = 0, binding = 1) uniform A { vec4 a; };
        void main() { result[0] = a.x; result[1] = 0.0; }
    )");
    const ComputePipeline second = make(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { float result[4]; };
        layout(set = 0, binding = 2) readonly buffer B { float b[4]; };
        void main() { result[1] = result[0] + b[3]; }
    )");
    const std::array<float, 4> a{1, 2, 3, 4}, b{10, 20, 30, 40};
    const Buffer result = buffer(16, BufferUsage::storage);
    const BindGroup shared =
        ok(device().create_bind_group({.layout = layout,
                                       .entries = {{.binding = 0, .buffer = result},
                                                   {.binding = 1, .buffer = buffer_of<float>(a, BufferUsage::uniform)},
                                                   {.binding = 2, .buffer = buffer_of<float>(b, BufferUsage::storage)}},
                                       .name = "shared"}));
    CommandList list = device().create_command_list("shared");
    list.set_pipeline(first);
    list.set_bind_group(0, shared);
    list.dispatch({});
    list.set_pipeline(second);
    list.dispatch({});
    run(std::move(list));
    EXPECT_EQ(read<float>(result)[1], 41.0f);
}

TEST_P(Compute, ArraysOfTexturesWithConstantIndices) {
    std::vector<BindGroupEntry> entries;
    for (std::uint32_t i = 0; i < 3; ++i) {
        const std::uint32_t value = 100 + i;
        entries.push_back({.binding = 1,
                           .texture = texture_of<std::uint32_t>(Format::r32_uint, 1, 1, std::span(&value, 1)),
                           .sampler = nearest(),
                           .element = i});
    }
    const auto values = evaluate<std::uint32_t>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { uint result[3]; };
        layout(set = 0, binding = 1) uniform usampler2D images[3];
        void main() {
            result[0] = texelFetch(images[0], ivec2(0), 0).r;
            result[1] = texelFetch(images[1], ivec2(0), 0).r;
            result[2] = texelFetch(images[2], ivec2(0), 0).r;
        }
    )",
                                                3, entries);
    EXPECT_EQ(values, (std::vector<std::uint32_t>{100, 101, 102}));
}

TEST_P(Compute, SeparateTexturesAndSamplers) {
    const std::array<float, 2> texels{1.0f, 3.0f};
    const Texture texture = texture_of<float>(Format::r32_float, 2, 1, texels);
    const auto values = evaluate<float>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { float result[2]; };
        layout(set = 0, binding = 1) uniform texture2D image;
        layout(set = 0, binding = 2) uniform sampler point;
        void main() {
            result[0] = textureLod(sampler2D(image, point), vec2(0.25, 0.5), 0.0).r;
            result[1] = textureLod(sampler2D(image, point), vec2(0.75, 0.5), 0.0).r;
        }
    )",
                                        2, {{.binding = 1, .texture = texture}, {.binding = 2, .sampler = nearest()}});
    EXPECT_EQ(values, (std::vector<float>{1.0f, 3.0f}));
}

}  // namespace
}  // namespace nacre::test
