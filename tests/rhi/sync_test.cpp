// SPDX-License-Identifier: Apache-2.0
// Order, fences and threads: what may happen at the same time, and that the result does not depend on it.
#include <atomic>
#include <limits>
#include <thread>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(Sync);

const char* const add_shader = R"(
    layout(local_size_x = 64) in;
    layout(push_constant) uniform Step { uint factor; uint addend; };
    layout(set = 0, binding = 0) buffer Values { uint values[]; };
    void main() { values[gl_GlobalInvocationID.x] = values[gl_GlobalInvocationID.x] * factor + addend; }
)";
struct Step {
    std::uint32_t factor, addend;
};

TEST_P(Sync, WritesPassesCopiesAndDispatchesFollowOneAnother) {
    // Each step needs what the one before wrote, through another kind of access each time.
    const Texture picture =
        target(Format::rgba8_unorm, 64, 1, "picture", TextureUsage::sampled | TextureUsage::copy_destination);
    const Buffer bytes = buffer(256,
                                BufferUsage::copy_source | BufferUsage::copy_destination | BufferUsage::storage |
                                    BufferUsage::uniform | BufferUsage::vertex,
                                "bytes");
    const ComputePipeline add = compute(add_shader);
    const BindGroup values = group(add, {{.binding = 0, .buffer = bytes}});
    const GraphicsPipelineDesc desc = fullscreen_desc(R"(
        layout(set = 0, binding = 0) uniform Values { uvec4 values[16]; };
        layout(location = 0) out vec4 color;
        void main() {
            uint i = uint(gl_FragCoord.x);
            color = unpackUnorm4x8(values[i / 4u][i % 4u]);
        }
    )",
                                                      {{.format = Format::rgba8_unorm}});
    const GraphicsPipeline show = ok(device().create_graphics_pipeline(desc));
    const BindGroup as_uniform = group(show, {{.binding = 0, .buffer = bytes}});
    CommandList list = device().create_command_list("chain");
    list.fill_buffer(bytes, 1);  // copy write
    list.set_pipeline(add);
    list.set_bind_group(0, values);
    list.set_push_constants(Step{3, 2});
    list.dispatch({});  // storage write: 5
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::discard}}});
    list.set_pipeline(show);
    list.set_bind_group(0, as_uniform);
    list.draw({.vertex_count = 3});  // uniform read, color write
    list.end_render_pass();
    list.set_pipeline(add);
    list.set_bind_group(0, values);
    list.set_push_constants(Step{0, 77});
    list.dispatch({});                            // write after read: 77
    list.copy_texture_to_buffer(picture, bytes);  // copy over it: 5 again
    list.set_push_constants(Step{10, 1});
    list.dispatch({});                            // 51
    list.copy_buffer_to_texture(bytes, picture);  // copy read, copy write
    run(std::move(list));
    for (const std::uint32_t texel : read<std::uint32_t>(picture)) EXPECT_EQ(texel, 51u);
    for (const std::uint32_t value : read<std::uint32_t>(bytes)) EXPECT_EQ(value, 51u);
}

TEST_P(Sync, SubmissionsRunInOrder) {
    const Buffer bytes = buffer(256, BufferUsage::storage | BufferUsage::copy_destination);
    const ComputePipeline add = compute(add_shader);
    const BindGroup values = group(add, {{.binding = 0, .buffer = bytes}});
    std::uint32_t expected = 1;
    CommandList first = device().create_command_list("fill");
    first.fill_buffer(bytes, 1);
    Fence fence = ok(device().submit(std::move(first)));
    for (std::uint32_t i = 0; i < 10; ++i) {
        CommandList list = device().create_command_list("step");
        list.set_pipeline(add);
        list.set_bind_group(0, values);
        list.set_push_constants(Step{3, i});
        list.dispatch({});
        const Fence next = ok(device().submit(std::move(list)));
        EXPECT_GT(next.serial, fence.serial);
        fence = next;
        expected = expected * 3 + i;
    }
    ok(device().wait(fence));
    EXPECT_TRUE(device().is_complete(fence));
    for (const std::uint32_t value : read<std::uint32_t>(bytes)) EXPECT_EQ(value, expected);
}

TEST_P(Sync, ContentWritesComeBeforeTheNextSubmission) {
    const Buffer bytes = buffer(4, BufferUsage::copy_source | BufferUsage::copy_destination);
    const Buffer results = buffer(40, BufferUsage::copy_destination);
    for (std::uint32_t i = 0; i < 10; ++i) {
        const std::uint32_t value = i * i;
        ok(device().write_buffer(bytes, std::as_bytes(std::span(&value, 1))));
        CommandList list = device().create_command_list("copy");
        list.copy_buffer(bytes, 0, results, i * 4, 4);
        ok(device().submit(std::move(list)));
    }
    const auto values = read<std::uint32_t>(results);
    for (std::uint32_t i = 0; i < 10; ++i) EXPECT_EQ(values[i], i * i);
}

TEST_P(Sync, ListsRecordedByThreadsGiveOnePicture) {
    constexpr std::uint32_t threads = 4;
    const Texture picture = target(Format::r32_uint, 16, 16);
    const GraphicsPipelineDesc desc = fullscreen_desc(
        "layout(push_constant) uniform P { uint value; }; layout(location = 0) out uvec4 color; void main() { color = "
        "uvec4(value); }",
        {{.format = Format::r32_uint}});
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    std::vector<CommandList> lists;
    for (std::uint32_t i = 0; i < threads; ++i) lists.push_back(device().create_command_list("part"));
    {
        std::vector<std::jthread> recorders;
        for (std::uint32_t i = 0; i < threads; ++i)
            recorders.emplace_back([&, i] {
                CommandList& list = lists[i];
                list.begin_render_pass(
                    {.color = {{.view = picture, .load = i == 0 ? LoadOperation::clear : LoadOperation::load}}});
                list.set_pipeline(pipeline);
                for (std::uint32_t row = 0; row < 16; ++row) {
                    // Later lists cover what earlier ones drew from their column on.
                    list.set_scissor({i * 4, row, 16 - i * 4, 1});
                    list.set_push_constants(i * 100 + row);
                    list.draw({.vertex_count = 3});
                }
                list.end_render_pass();
            });
    }
    ok(device().wait(ok(device().submit(lists))));
    const auto texels = read<std::uint32_t>(picture);
    for (std::uint32_t y = 0; y < 16; ++y)
        for (std::uint32_t x = 0; x < 16; ++x) EXPECT_EQ(texels[y * 16 + x], x / 4 * 100 + y);
}

TEST_P(Sync, ThreadsCreateSubmitAndDestroyAtOnce) {
    const ComputePipeline add = compute(add_shader);
    std::atomic<int> right{0};
    constexpr int threads = 4, rounds = 8;
    {
        std::vector<std::jthread> workers;
        for (int thread = 0; thread < threads; ++thread)
            workers.emplace_back([&, thread] {
                for (int round = 0; round < rounds; ++round) {
                    const auto made = device().create_buffer(
                        {256, BufferUsage::storage | BufferUsage::copy_destination, MemoryKind::device, "own"});
                    if (!made) return;
                    const auto layout = device().bind_group_layout(add, 0);
                    const auto bound = device().create_bind_group(
                        {.layout = *layout, .entries = {{.binding = 0, .buffer = *made}}, .name = "own"});
                    if (!bound) return;
                    const std::vector<std::uint32_t> start(64, static_cast<std::uint32_t>(thread));
                    if (!device().write_buffer(*made, std::as_bytes(std::span(start)))) return;
                    CommandList list = device().create_command_list("own");
                    list.set_pipeline(add);
                    list.set_bind_group(0, *bound);
                    list.set_push_constants(Step{10, static_cast<std::uint32_t>(round)});
                    list.dispatch({});
                    const auto fence = device().submit(std::move(list));
                    if (!fence) return;
                    const auto bytes = device().read_buffer(*made);
                    // Destroyed while other threads' work is in flight.
                    device().destroy(*bound);
                    device().destroy(*made);
                    if (!bytes) return;
                    bool all = true;
                    for (const std::uint32_t value : cast<std::uint32_t>(*bytes))
                        all &= value == static_cast<std::uint32_t>(thread * 10 + round);
                    right += all;
                }
            });
    }
    EXPECT_EQ(right, threads * rounds);
}

TEST_P(Sync, ObjectsAreDestroyedWhileTheyAreInUse) {
    const ComputePipeline add = compute(add_shader);
    const Buffer kept = buffer(256, BufferUsage::copy_destination);
    {
        const Buffer bytes =
            buffer(256, BufferUsage::storage | BufferUsage::copy_source | BufferUsage::copy_destination);
        const BindGroup values = group(add, {{.binding = 0, .buffer = bytes}});
        CommandList list = device().create_command_list("in use");
        list.fill_buffer(bytes, 4);
        list.set_pipeline(add);
        list.set_bind_group(0, values);
        list.set_push_constants(Step{2, 1});
        for (int i = 0; i < 50; ++i) list.dispatch({});
        list.copy_buffer(bytes, 0, kept, 0, 256);
        ok(device().submit(std::move(list)));
        device().destroy(bytes);
        device().destroy(values);
        device().destroy(add);
    }
    std::uint32_t expected = 4;
    for (int i = 0; i < 50; ++i) expected = expected * 2 + 1;
    for (const std::uint32_t value : read<std::uint32_t>(kept)) EXPECT_EQ(value, expected);
}

TEST_P(Sync, DevicesLiveSideBySide) {
    const auto other = make_device(device_desc());
    const Buffer here = buffer(16, BufferUsage::copy_destination);
    const Buffer there = ok(other->create_buffer({16, BufferUsage::copy_destination, MemoryKind::device, "there"}));
    CommandList first = device().create_command_list("here");
    first.fill_buffer(here, 1);
    CommandList second = other->create_command_list("there");
    second.fill_buffer(there, 2);
    ok(device().submit(std::move(first)));
    ok(other->submit(std::move(second)));
    EXPECT_EQ(read<std::uint32_t>(here)[0], 1u);
    EXPECT_EQ(cast<std::uint32_t>(ok(other->read_buffer(there)))[0], 2u);
}

BACKEND_SUITE(Faults);

TEST_P(Faults, LostDeviceFailsEveryCallAndANewOneWorks) {
    DeviceDesc desc = device_desc();
    desc.faults.lose_device = 2;
    const auto lost = make_device(desc);
    const Buffer bytes = ok(lost->create_buffer({64, BufferUsage::copy_destination, MemoryKind::device, "bytes"}));
    CommandList first = lost->create_command_list("first");
    first.fill_buffer(bytes, 1);
    const Fence fence = ok(lost->submit(std::move(first)));
    CommandList second = lost->create_command_list("second");
    second.fill_buffer(bytes, 2);
    const auto failed = lost->submit(std::move(second));
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().code, ErrorCode::device_lost);
    EXPECT_TRUE(lost->is_lost());
    EXPECT_EQ(lost->wait(fence).error().code, ErrorCode::device_lost);
    EXPECT_EQ(lost->wait_idle().error().code, ErrorCode::device_lost);
    EXPECT_EQ(lost->read_buffer(bytes).error().code, ErrorCode::device_lost);
    EXPECT_EQ(lost->create_sampler({}).error().code, ErrorCode::device_lost);
    EXPECT_EQ(
        lost->create_texture({.format = Format::rgba8_unorm, .width = 4, .height = 4, .usage = TextureUsage::sampled})
            .error()
            .code,
        ErrorCode::device_lost);
    lost->destroy(bytes);
    const auto fresh = make_device(device_desc());
    const Buffer again = ok(fresh->create_buffer({64, BufferUsage::copy_destination, MemoryKind::device, "again"}));
    CommandList list = fresh->create_command_list("list");
    list.fill_buffer(again, 3);
    ok(fresh->submit(std::move(list)));
    EXPECT_EQ(cast<std::uint32_t>(ok(fresh->read_buffer(again)))[15], 3u);
}

TEST_P(Faults, EachAllocationMayFail) {
    for (std::uint64_t n = 1; n <= 4; ++n) {
        DeviceDesc desc = device_desc();
        desc.faults.fail_allocation = n;
        auto made = instance().create_device(desc);
        if (!made) {
            EXPECT_EQ(made.error().code, ErrorCode::out_of_memory) << made.error().message();
            continue;
        }
        Device& weak = **made;
        bool failed = false;
        const auto look = [&](const auto& result) {
            if (result) return;
            failed = true;
            EXPECT_EQ(result.error().code, ErrorCode::out_of_memory) << result.error().message();
        };
        const auto buffer = weak.create_buffer({1 << 20, BufferUsage::storage, MemoryKind::device, "one"});
        look(buffer);
        const auto texture = weak.create_texture({.format = Format::rgba8_unorm,
                                                  .width = 512,
                                                  .height = 512,
                                                  .usage = TextureUsage::sampled | TextureUsage::copy_source,
                                                  .name = "two"});
        look(texture);
        if (buffer) look(weak.write_buffer(*buffer, std::vector<std::byte>(2 << 20 >> 1)));
        if (buffer) look(weak.read_buffer(*buffer));
        // The fault was one allocation: all works afterwards, in the same device.
        const auto after = weak.create_buffer({1 << 20, BufferUsage::storage, MemoryKind::device, "after"});
        if (failed) {
            EXPECT_TRUE(after) << after.error().message();
        } else {
            look(after);
        }
        EXPECT_TRUE(weak.wait_idle());
    }
}

TEST_P(Faults, ImpossibleSizesAreErrorsWithFigures) {
    expect_message("N-201");
    expect_message("N-211");
    const auto buffer =
        device().create_buffer({std::uint64_t{1} << 63, BufferUsage::storage, MemoryKind::device, "huge"});
    ASSERT_FALSE(buffer);
    EXPECT_EQ(buffer.error().code, ErrorCode::out_of_memory);
    EXPECT_NE(buffer.error().message().find("9223372036854775808"), std::string::npos) << buffer.error().message();
    const auto texture = device().create_texture({.format = Format::rgba8_unorm,
                                                  .width = 1000000,
                                                  .height = 1000000,
                                                  .usage = TextureUsage::sampled,
                                                  .name = "huge"});
    ASSERT_FALSE(texture);
    EXPECT_NE(texture.error().message().find("1000000"), std::string::npos) << texture.error().message();
    EXPECT_NE(texture.error().message().find("max_texture_2d"), std::string::npos) << texture.error().message();
}

TEST_P(Faults, OutOfRangeAccessesReadZeroOrStayInside) {
    const std::array<std::uint32_t, 4> values{1, 2, 3, 4};
    const Buffer small = buffer_of<std::uint32_t>(values, BufferUsage::storage);
    const Texture texture = texture_of<std::uint32_t>(Format::r32_uint, 2, 2, values);
    const auto result = evaluate<std::uint32_t>(
        R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { uint result[4]; };
        layout(set = 0, binding = 1) buffer Small { uint small_values[]; };
        layout(set = 0, binding = 2) uniform usampler2D image;
        void main() {
            result[0] = small_values[1000000];
            result[1] = texelFetch(image, ivec2(5, 7), 0).r;
            small_values[2000000] = 99u;
            result[2] = small_values[3];
        }
    )",
        4, {{.binding = 1, .buffer = small}, {.binding = 2, .texture = texture, .sampler = nearest()}});
    EXPECT_TRUE(result[0] <= 4) << result[0];
    EXPECT_TRUE(result[1] <= 4) << result[1];
    EXPECT_EQ(result[2], 4u);
    EXPECT_EQ(read<std::uint32_t>(small), std::vector<std::uint32_t>(values.begin(), values.end()));
}

TEST_P(Faults, IntegerDivisionAndShiftsHaveNoTraps) {
    const std::array<std::int32_t, 4> values{0, -2147483647 - 1, -1, 40};
    const Buffer inputs = buffer_of<std::int32_t>(values, BufferUsage::storage);
    const auto result = evaluate<std::int32_t>(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) buffer Result { int result[6]; };
        layout(set = 0, binding = 1) readonly buffer Inputs { int zero; int lowest; int minus_one; int forty; };
        void main() {
            result[0] = 7 / zero; result[1] = lowest / minus_one; result[2] = 7 % zero; result[3] = 1 << forty;
            result[4] = int(intBitsToFloat(0x7fc00000)); result[5] = 1234;
        }
    )",
                                               6, {{.binding = 1, .buffer = inputs}});
    EXPECT_EQ(result[5], 1234);
}

TEST_P(Faults, StrangeTrianglesStayInsideTheTarget) {
    // The target is the middle one of three layers: what is written beside it would be seen.
    const Texture picture = ok(device().create_texture({.format = Format::r8_unorm,
                                                        .width = 8,
                                                        .height = 8,
                                                        .layers = 3,
                                                        .usage = TextureUsage::color_target | TextureUsage::copy_source,
                                                        .name = "layers"}));
    GraphicsPipelineDesc desc;
    desc.vertex = shader(ShaderStage::vertex, R"(
        layout(push_constant) uniform P { vec4 a; vec4 b; vec4 c; };
        void main() { gl_Position = gl_VertexIndex == 0 ? a : gl_VertexIndex == 1 ? b : c; }
    )");
    desc.fragment =
        shader(ShaderStage::fragment, "layout(location = 0) out vec4 color; void main() { color = vec4(1); }");
    desc.color_targets = {{.format = Format::r8_unorm}};
    const GraphicsPipeline pipeline = ok(device().create_graphics_pipeline(desc));
    desc.cull = CullMode::back;
    const GraphicsPipeline culling = ok(device().create_graphics_pipeline(desc));
    struct Corners {
        float values[12];
    };
    const auto draw = [&](GraphicsPipeline with, const Corners& corners) {
        CommandList list = device().create_command_list("strange");
        for (std::uint32_t index : {0u, 1u, 2u}) {
            list.begin_render_pass(
                {.color = {{.view = TextureView::subresource(picture, 0, index), .load = LoadOperation::clear}}});
            if (index == 1) {
                list.set_pipeline(with);
                list.set_push_constants(corners);
                list.draw({.vertex_count = 3});
            }
            list.end_render_pass();
        }
        run(std::move(list));
        for (const std::uint32_t index : {0u, 2u})
            EXPECT_EQ(ok(device().read_texture(picture, 0, index)), std::vector<std::byte>(64)) << "layer " << index;
        return ok(device().read_texture(picture, 0, 1));
    };
    const std::vector<std::byte> nothing(64), everything(64, std::byte{255});
    // A whole one first: the rest is no proof otherwise.
    const Corners whole{{-1, -1, 0, 1, 3, -1, 0, 1, -1, 3, 0, 1}}, inverted{{-1, -1, 0, 1, -1, 3, 0, 1, 3, -1, 0, 1}};
    EXPECT_EQ(draw(pipeline, whole), everything);
    EXPECT_EQ(draw(pipeline, inverted), everything);
    EXPECT_NE(draw(culling, whole), draw(culling, inverted));
    EXPECT_EQ(draw(pipeline, {{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}}), nothing) << "a point";
    EXPECT_EQ(draw(pipeline, {{-1, -1, 0, 1, 0, 0, 0, 1, 1, 1, 0, 1}}), nothing) << "a line";
    EXPECT_EQ(draw(pipeline, {{0.01f, 0.01f, 0, 1, 0.05f, 0.01f, 0, 1, 0.01f, 0.05f, 0, 1}}), nothing)
        << "between the centers of pixels";
    EXPECT_EQ(draw(pipeline, {{2, 0, 0, 1, 1e30f, 5, 0, 1, 1e30f, -1e30f, 0, 1}}), nothing) << "right of the picture";
    EXPECT_EQ(draw(pipeline, {{0, 0, 0, -1, 1, 0, 0, -1, 0, 1, 0, -5}}), nothing) << "behind the viewer";
    // What these cover is for the driver to say; that they end, and stay inside, is not.
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
    for (const Corners& corners :
         {Corners{{1e30f, 0, 0, 1, -1e30f, 5, 0, 1, 0, -1e30f, 0, 1}}, Corners{{0, 0, 0, 0, 1, 0, 0, -1, 0, 1, 0, 5}},
          Corners{{nan, 0, 0, 1, 1, nan, 0, 1, 0, 1, 0, nan}},
          Corners{{infinite, 0, 0, 1, 1, -infinite, 0, 1, 0, 1, infinite, 1}}}) {
        draw(pipeline, corners);
    }
    EXPECT_EQ(draw(pipeline, whole), everything);
}

TEST_P(Faults, EmptyWorkIsNoError) {
    const Texture picture = target(Format::r8_unorm, 4, 4);
    const GraphicsPipeline pipeline =
        fullscreen("layout(location = 0) out vec4 color; void main() { color = vec4(1); }", Format::r8_unorm);
    CommandList list = device().create_command_list("empty");
    list.copy_buffer(buffer(16, BufferUsage::copy_source), 0, buffer(16, BufferUsage::copy_destination), 0, 0);
    list.begin_render_pass({.color = {{.view = picture, .load = LoadOperation::clear}}});
    list.set_pipeline(pipeline);
    list.draw({.vertex_count = 0});
    list.draw({.vertex_count = 3, .instance_count = 0});
    list.end_render_pass();
    run(std::move(list));
    run(device().create_command_list("nothing"));
    EXPECT_EQ(read<std::uint8_t>(picture)[0], 0);
}

BACKEND_SUITE(Restrictions);

TEST_P(Restrictions, AllValuesAreAtMostThoseOfTheMinimum) {
    DeviceDesc desc = device_desc();
    desc.restriction = "gles31-minimum";
    const auto weak = make_device(desc);
    const Capabilities& c = weak->capabilities();
    EXPECT_FALSE(c.storage_in_fragment || c.storage_in_vertex || c.dual_source_blending || c.independent_blend ||
                 c.descriptor_indexing);
    EXPECT_FALSE(c.float_color_targets || c.texture_views || c.border_color || c.cube_arrays);
    EXPECT_LE(c.max_color_targets, 4u);
    EXPECT_LE(c.max_texture_2d, 2048u);
    EXPECT_LE(c.max_texture_layers, 256u);
    EXPECT_LE(c.max_workgroup_invocations, 128u);
    EXPECT_LE(c.max_workgroup_memory_bytes, 16384u);
    EXPECT_LE(c.max_uniform_buffer_range, 16384u);
    EXPECT_EQ(c.max_storage_buffers, (std::array<std::uint32_t, 3>{0, 0, 4}));
    EXPECT_EQ(c.max_storage_images, (std::array<std::uint32_t, 3>{0, 0, 4}));
    EXPECT_FALSE(c.supports(Format::rgba16_float, FormatSupport::color_target));
    EXPECT_TRUE(c.supports(Format::r32_uint, FormatSupport::color_target | FormatSupport::storage_image));
    EXPECT_FALSE(c.supports(Format::rg32_uint, FormatSupport::storage_image));
}

TEST_P(Restrictions, WhatIsBeyondIsRefusedAsOnAWeakDevice) {
    DeviceDesc desc = device_desc();
    desc.restriction = "gles31-minimum";
    const auto weak = make_device(desc);
    for (const char* code : {"N-403", "N-211", "N-217", "N-428", "N-304"}) expect_message(code);
    EXPECT_FALSE(weak->create_shader(
        compile(ShaderStage::fragment,
                "layout(set = 0, binding = 0) buffer R { uint r; }; void main() { atomicAdd(r, 1u); }")));
    EXPECT_FALSE(weak->create_texture(
        {.format = Format::rgba8_unorm, .width = 4096, .height = 4, .usage = TextureUsage::sampled}));
    EXPECT_FALSE(weak->create_texture(
        {.format = Format::rgba16_float, .width = 4, .height = 4, .usage = TextureUsage::color_target}));
    EXPECT_FALSE(weak->create_shader(compile(ShaderStage::compute, "layout(local_size_x = 256) in; void main() {}")));
    EXPECT_FALSE(weak->create_bind_group_layout(
        {.bindings = {{0, BindingType::sampled_texture, 0, ShaderStage::fragment}}, .name = "unbounded"}));
}

}  // namespace
}  // namespace nacre::test
