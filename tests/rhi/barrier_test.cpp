// SPDX-License-Identifier: Apache-2.0
// Which barriers the front end works out, seen by a backend that only takes notes.
#include <gtest/gtest.h>

#include "tests/rhi/validation_bench.h"

namespace nacre::test {
namespace {

using namespace rhi;
using enum ResourceUse;

constexpr auto all_buffer_uses = BufferUsage::storage | BufferUsage::copy_source | BufferUsage::copy_destination |
                                 BufferUsage::vertex | BufferUsage::index | BufferUsage::uniform |
                                 BufferUsage::indirect;
constexpr auto all_texture_uses = TextureUsage::sampled | TextureUsage::storage | TextureUsage::color_target |
                                  TextureUsage::copy_source | TextureUsage::copy_destination;

/// Commands of the last submission, without those that need no barrier.
const std::vector<NullCommand>& last(Bench& bench) { return bench.log().submissions.back(); }

const NullCommand& command(Bench& bench, CommandType type, int index = 0) {
    for (const NullCommand& one : last(bench))
        if (one.type == type && index-- == 0) return one;
    ADD_FAILURE() << "no such command";
    static const NullCommand none{};
    return none;
}

const char* const write_shader =
    "layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer R { uint r[]; }; void main() { r[0] += 1u; }";
const char* const read_shader =
    "layout(local_size_x = 1) in; layout(set = 0, binding = 0) readonly buffer S { uint s[]; }; layout(set = 0, "
    "binding = 1) buffer R { uint r[]; }; void main() { r[0] = s[0]; }";

TEST(Barriers, FirstUseOfABufferNeedsNoneAndWritesDo) {
    Bench bench;
    const Buffer buffer = bench.buffer(all_buffer_uses);
    CommandList list = bench.list();
    list.fill_buffer(buffer, 1);
    list.fill_buffer(buffer, 2);
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    EXPECT_TRUE(command(bench, CommandType::fill_buffer, 0).barriers.empty());
    ASSERT_EQ(command(bench, CommandType::fill_buffer, 1).barriers.size(), 1u);
    EXPECT_EQ(command(bench, CommandType::fill_buffer, 1).barriers[0].before.use, copy_destination);
    // States carry over to the next submission.
    list = bench.list();
    list.copy_buffer(buffer, 0, bench.buffer(all_buffer_uses), 0, 16);
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    ASSERT_EQ(command(bench, CommandType::copy_buffer).barriers.size(), 1u);
    EXPECT_EQ(command(bench, CommandType::copy_buffer).barriers[0].after.use, copy_source);
}

TEST(Barriers, BetweenDispatches) {
    Bench bench;
    const ComputePipeline write = bench.compute(write_shader);
    const ComputePipeline read = bench.compute(read_shader);
    const Buffer a = bench.buffer(all_buffer_uses, 256, "a");
    const Buffer b = bench.buffer(all_buffer_uses, 256, "b");
    CommandList list = bench.list();
    list.set_pipeline(write);
    list.set_bind_group(0, bench.group(write, {{.binding = 0, .buffer = a}}));
    list.dispatch({});
    list.dispatch({});  // Write after write.
    list.set_pipeline(read);
    list.set_bind_group(0, bench.group(read, {{.binding = 0, .buffer = a}, {.binding = 1, .buffer = b}}));
    list.dispatch({});  // Read after write of a; b is new.
    list.dispatch({});  // a again: none; b written after written.
    list.set_pipeline(write);
    list.set_bind_group(0, bench.group(write, {{.binding = 0, .buffer = a}}));
    list.dispatch({});  // Write after read.
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    EXPECT_TRUE(command(bench, CommandType::dispatch, 0).barriers.empty());
    ASSERT_EQ(command(bench, CommandType::dispatch, 1).barriers.size(), 1u);
    ASSERT_EQ(command(bench, CommandType::dispatch, 2).barriers.size(), 1u);
    EXPECT_EQ(command(bench, CommandType::dispatch, 2).barriers[0].after.use, storage_read);
    EXPECT_EQ(command(bench, CommandType::dispatch, 2).barriers[0].after.stages, ShaderStage::compute);
    ASSERT_EQ(command(bench, CommandType::dispatch, 3).barriers.size(), 1u);
    EXPECT_EQ(command(bench, CommandType::dispatch, 3).barriers[0].buffer->desc.name, "b");
    ASSERT_EQ(command(bench, CommandType::dispatch, 4).barriers.size(), 1u);
    EXPECT_EQ(command(bench, CommandType::dispatch, 4).barriers[0].before.use, storage_read);
}

TEST(Barriers, IndirectArgumentsVerticesAndIndices) {
    Bench bench;
    const ComputePipeline write = bench.compute(write_shader);
    const Buffer arguments = bench.buffer(all_buffer_uses, 256, "arguments");
    const Buffer vertices = bench.buffer(all_buffer_uses, 256, "vertices");
    const Buffer indices = bench.buffer(all_buffer_uses, 256, "indices");
    CommandList list = bench.list();
    list.set_pipeline(write);
    for (const Buffer buffer : {arguments, vertices, indices}) {
        list.set_bind_group(0, bench.group(write, {{.binding = 0, .buffer = buffer}}));
        list.dispatch({});
    }
    list.begin_render_pass({.color = {{.view = bench.target()}}});
    list.set_pipeline(bench.graphics());
    list.set_vertex_buffer(0, vertices);
    list.set_index_buffer(indices, IndexType::uint16);
    list.draw_indexed_indirect(arguments);
    list.end_render_pass();
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    // All before the pass, none inside.
    std::map<std::string, ResourceUse> found;
    for (const Barrier& barrier : command(bench, CommandType::begin_render_pass).barriers)
        if (barrier.buffer) found[barrier.buffer->desc.name] = barrier.after.use;
    EXPECT_EQ(found, (std::map<std::string, ResourceUse>{
                         {"arguments", indirect_argument}, {"vertices", vertex_buffer}, {"indices", index_buffer}}));
    EXPECT_TRUE(command(bench, CommandType::draw_indexed_indirect).barriers.empty());
}

TEST(Barriers, TargetsAreDiscardedWhereTheyAreCleared) {
    Bench bench;
    const Texture target = bench.target();
    for (const LoadOperation load :
         {LoadOperation::load, LoadOperation::clear, LoadOperation::discard, LoadOperation::load}) {
        CommandList list = bench.list();
        list.begin_render_pass({.color = {{.view = target, .load = load}}});
        list.end_render_pass();
        ASSERT_TRUE(bench.device().submit(std::move(list)));
        const auto& barriers = command(bench, CommandType::begin_render_pass).barriers;
        ASSERT_EQ(barriers.size(), 1u);
        const bool first = bench.log().submissions.size() == 1;
        EXPECT_EQ(barriers[0].discard, first || load != LoadOperation::load);
        EXPECT_EQ(barriers[0].before.use, first ? none : color_target);
        EXPECT_EQ(barriers[0].after.use, color_target);
    }
}

TEST(Barriers, MipsAndLayersAreTrackedApart) {
    Bench bench;
    TextureDesc desc = Bench::texture_desc(all_texture_uses);
    desc.mips = 4;
    desc.layers = 3;
    const Texture texture = *bench.device().create_texture(desc);
    const Buffer buffer = bench.buffer(all_buffer_uses, 4096);
    CommandList list = bench.list();
    list.clear_texture(texture, {});
    list.copy_texture_to_buffer(texture, buffer, {.mip = 1, .layer = 2});
    list.copy_texture_to_buffer(texture, buffer, {.mip = 1, .layer = 2});
    list.clear_texture(texture, {});
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    const auto& first = command(bench, CommandType::clear_texture, 0).barriers;
    ASSERT_EQ(first.size(), 1u);
    EXPECT_EQ(first[0].mip_count, 4u);
    EXPECT_EQ(first[0].layer_count, 3u);
    const auto& copy = command(bench, CommandType::copy_texture_to_buffer, 0).barriers;
    ASSERT_EQ(copy.size(), 1u);
    EXPECT_EQ(copy[0].base_mip, 1u);
    EXPECT_EQ(copy[0].mip_count, 1u);
    EXPECT_EQ(copy[0].base_layer, 2u);
    EXPECT_EQ(copy[0].layer_count, 1u);
    // The second copy needs a barrier for the buffer alone.
    const auto& again = command(bench, CommandType::copy_texture_to_buffer, 1).barriers;
    ASSERT_EQ(again.size(), 1u);
    EXPECT_TRUE(again[0].buffer);
    // The parts of the last clear come from two states; together they cover every part once.
    const auto& last_clear = command(bench, CommandType::clear_texture, 1).barriers;
    std::uint32_t parts = 0, from_copy = 0;
    for (const Barrier& barrier : last_clear) {
        parts += barrier.mip_count * barrier.layer_count;
        if (barrier.before.use == copy_source) from_copy += barrier.mip_count * barrier.layer_count;
    }
    EXPECT_EQ(parts, 12u);
    EXPECT_EQ(from_copy, 1u);
}

TEST(Barriers, ReadsWidenTheirStagesOnce) {
    Bench bench;
    const ComputePipeline sample = bench.compute(
        "layout(local_size_x = 1) in; layout(set = 0, binding = 0) buffer R { vec4 r[1]; }; layout(set = 0, binding = "
        "1) uniform sampler2D image; void main() { r[0] = texelFetch(image, ivec2(0), 0); }");
    GraphicsPipelineDesc desc = bench.graphics_desc();
    desc.fragment = bench.shader("frag",
                                 "layout(set = 0, binding = 0) uniform sampler2D image; layout(location = 0) out vec4 "
                                 "color; void main() { color = texelFetch(image, ivec2(0), 0); }");
    const GraphicsPipeline draw = *bench.device().create_graphics_pipeline(desc);
    const Texture texture = bench.texture(all_texture_uses);
    const Sampler sampler = *bench.device().create_sampler({});
    const BindGroup in_draw = bench.group(draw, {{.binding = 0, .texture = texture, .sampler = sampler}});
    CommandList list = bench.list();
    list.clear_texture(texture, {});
    for (int i = 0; i < 2; ++i) {
        list.begin_render_pass({.color = {{.view = bench.target()}}});
        list.set_pipeline(draw);
        list.set_bind_group(0, in_draw);
        list.draw({.vertex_count = 3});
        list.draw({.vertex_count = 3});
        list.end_render_pass();
        list.set_pipeline(sample);
        list.set_bind_group(0, bench.group(sample, {{.binding = 0, .buffer = bench.buffer(all_buffer_uses)},
                                                    {.binding = 1, .texture = texture, .sampler = sampler}}));
        list.dispatch({});
    }
    list.clear_texture(texture, {});
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    const auto of_texture = [&](const NullCommand& one) {
        std::vector<Barrier> found;
        for (const Barrier& barrier : one.barriers)
            if (barrier.texture && barrier.texture->desc.usage == all_texture_uses) found.push_back(barrier);
        return found;
    };
    ASSERT_EQ(of_texture(command(bench, CommandType::begin_render_pass, 0)).size(), 1u);
    const auto widened = of_texture(command(bench, CommandType::dispatch, 0));
    ASSERT_EQ(widened.size(), 1u);
    EXPECT_EQ(widened[0].before.stages, ShaderStage::fragment);
    EXPECT_EQ(widened[0].after.stages, ShaderStage::fragment | ShaderStage::compute);
    EXPECT_TRUE(of_texture(command(bench, CommandType::begin_render_pass, 1)).empty());
    EXPECT_TRUE(of_texture(command(bench, CommandType::dispatch, 1)).empty());
    // The write after them waits for both stages.
    const auto cleared = of_texture(command(bench, CommandType::clear_texture, 1));
    ASSERT_EQ(cleared.size(), 1u);
    EXPECT_EQ(cleared[0].before.stages, ShaderStage::fragment | ShaderStage::compute);
}

TEST(Barriers, ReadOnlyDepthMayBeSampledInItsPass) {
    Bench bench;
    GraphicsPipelineDesc desc = bench.graphics_desc();
    desc.depth_stencil = {.format = Format::d32_float, .depth_test = true};
    desc.fragment = bench.shader("frag",
                                 "layout(set = 0, binding = 0) uniform sampler2D image; layout(location = 0) out vec4 "
                                 "color; void main() { color = texelFetch(image, ivec2(0), 0); }");
    const GraphicsPipeline draw = *bench.device().create_graphics_pipeline(desc);
    const Texture depth = bench.depth();
    CommandList list = bench.list();
    list.begin_render_pass({.depth_stencil = {.view = depth, .depth_load = LoadOperation::clear}});
    list.end_render_pass();
    list.begin_render_pass({.color = {{.view = bench.target()}}, .depth_stencil = {.view = depth, .read_only = true}});
    list.set_pipeline(draw);
    list.set_bind_group(
        0, bench.group(draw, {{.binding = 0, .texture = depth, .sampler = *bench.device().create_sampler({})}}));
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    EXPECT_TRUE(bench.messages().empty());
    bool seen = false;
    for (const Barrier& barrier : command(bench, CommandType::begin_render_pass, 1).barriers)
        if (barrier.before.use == depth_stencil_write) {
            seen = true;
            EXPECT_EQ(barrier.after.use, depth_stencil_read | sampled);
        }
    EXPECT_TRUE(seen);
}

TEST(Barriers, EveryTextureOfAnUnboundedArrayIsCovered) {
    Bench bench;
    const BindGroupLayout layout = *bench.device().create_bind_group_layout(
        {.bindings = {{0, BindingType::combined_texture_sampler, 0, ShaderStage::fragment}}, .name = "bindless"});
    GraphicsPipelineDesc desc = bench.graphics_desc();
    desc.fragment = bench.shader("frag",
                                 "#extension GL_EXT_nonuniform_qualifier : require\nlayout(set = 0, binding = 0) "
                                 "uniform sampler2D images[]; layout(location = 0) out vec4 color; void main() { color "
                                 "= texelFetch(images[nonuniformEXT(int(gl_FragCoord.x))], ivec2(0), 0); }");
    desc.bind_group_layouts = {layout};
    const auto pipeline = bench.device().create_graphics_pipeline(desc);
    ASSERT_TRUE(pipeline) << pipeline.error().message();
    std::vector<BindGroupEntry> entries;
    CommandList list = bench.list();
    for (std::uint32_t i = 0; i < 20; ++i) {
        const Texture texture = bench.texture(all_texture_uses);
        list.clear_texture(texture, {});
        entries.push_back(
            {.binding = 0, .texture = texture, .sampler = *bench.device().create_sampler({}), .element = i * 3});
    }
    list.begin_render_pass({.color = {{.view = bench.target()}}});
    list.set_pipeline(*pipeline);
    list.set_bind_group(0,
                        *bench.device().create_bind_group({.layout = layout, .entries = entries, .name = "bindless"}));
    list.draw({.vertex_count = 3});
    list.end_render_pass();
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    std::size_t made_readable = 0;
    for (const Barrier& barrier : command(bench, CommandType::begin_render_pass).barriers)
        made_readable += barrier.after.use == sampled && barrier.before.use == copy_destination;
    EXPECT_EQ(made_readable, 20u);
}

TEST(Barriers, ReadbackBuffersAreMadeVisibleToTheHost) {
    Bench bench;
    const Buffer readback = bench.buffer(BufferUsage::copy_destination, 256, "readback", MemoryKind::readback);
    CommandList list = bench.list();
    list.copy_buffer(bench.buffer(all_buffer_uses), 0, readback, 0, 16);
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    ASSERT_EQ(bench.log().final_barriers.back().size(), 1u);
    EXPECT_EQ(bench.log().final_barriers.back()[0].after.use, host_read);
}

TEST(Barriers, FailedSubmissionLeavesStatesAsTheyWere) {
    Bench bench;
    const Buffer buffer = bench.buffer(all_buffer_uses);
    const Buffer other = bench.buffer(all_buffer_uses);
    CommandList good = bench.list();
    good.fill_buffer(buffer, 1);
    CommandList bad = bench.list();
    bad.fill_buffer(other, 1);
    bench.device().destroy(other);
    std::array<CommandList, 2> lists{std::move(good), std::move(bad)};
    EXPECT_FALSE(bench.device().submit(lists));
    EXPECT_TRUE(bench.log().submissions.empty());
    CommandList list = bench.list();
    list.fill_buffer(buffer, 2);
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    EXPECT_TRUE(command(bench, CommandType::fill_buffer).barriers.empty());
}

TEST(Barriers, WritesOfContentComeFirstAndTogether) {
    Bench bench;
    TextureDesc desc = Bench::texture_desc(all_texture_uses);
    desc.mips = 3;
    const Texture texture = *bench.device().create_texture(desc);
    for (std::uint32_t mip = 0; mip < 3; ++mip)
        ASSERT_TRUE(bench.device().write_texture(texture, std::vector<std::byte>(mip_bytes(desc, mip)), mip));
    CommandList list = bench.list();
    list.copy_texture_to_buffer(texture, bench.buffer(all_buffer_uses, 4096));
    ASSERT_TRUE(bench.device().submit(std::move(list)));
    // Three copies, and all barriers before the first of them.
    EXPECT_FALSE(command(bench, CommandType::copy_buffer_to_texture, 0).barriers.empty());
    EXPECT_TRUE(command(bench, CommandType::copy_buffer_to_texture, 1).barriers.empty());
    EXPECT_TRUE(command(bench, CommandType::copy_buffer_to_texture, 2).barriers.empty());
    EXPECT_FALSE(command(bench, CommandType::copy_texture_to_buffer).barriers.empty());
}

TEST(Barriers, WriteToADestroyedResourceIsDropped) {
    Bench bench;
    const Buffer buffer = bench.buffer(all_buffer_uses);
    ASSERT_TRUE(bench.device().write_buffer(buffer, std::vector<std::byte>(16)));
    bench.device().destroy(buffer);
    ASSERT_TRUE(bench.device().submit(bench.list()));
    EXPECT_TRUE(last(bench).empty());
    EXPECT_TRUE(bench.messages().empty());
}

}  // namespace
}  // namespace nacre::test
