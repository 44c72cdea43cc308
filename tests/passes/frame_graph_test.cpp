// SPDX-License-Identifier: Apache-2.0
#include "passes/frame_graph.h"

#include <gtest/gtest.h>

namespace nacre::passes {
namespace {

using rhi::ResourceUse;

rhi::TextureDesc desc(const char* name, std::uint32_t width = 64, rhi::Format format = rhi::Format::rgba8_unorm) {
    return {.format = format, .width = width, .height = 64, .name = name};
}

TEST(FrameGraph, PassesThatNobodyNeedsVanish) {
    FrameGraph graph;
    const TextureId used = graph.add_texture(desc("used"));
    const TextureId unused = graph.add_texture(desc("unused"));
    const TextureId result = graph.add_texture(desc("result"));
    graph.add_pass("make used").uses(used, ResourceUse::storage_write);
    graph.add_pass("make unused").uses(used, ResourceUse::sampled).uses(unused, ResourceUse::storage_write);
    graph.add_pass("make result").uses(used, ResourceUse::sampled).uses(result, ResourceUse::storage_write);
    graph.keep(result);
    ASSERT_TRUE(graph.compile());
    EXPECT_TRUE(graph.passes()[0].is_live);
    EXPECT_FALSE(graph.passes()[1].is_live);
    EXPECT_TRUE(graph.passes()[2].is_live);
    EXPECT_TRUE(graph.is_live(used));
    EXPECT_FALSE(graph.is_live(unused));
    // Bytes of what vanished are not counted.
    EXPECT_EQ(graph.transient_bytes(), 2u * 64 * 64 * 4);
}

TEST(FrameGraph, PassesWithoutReadersAreKeptOnRequest) {
    FrameGraph graph;
    const TextureId texture = graph.add_texture(desc("texture"));
    graph.add_pass("always").uses(texture, ResourceUse::storage_write).always();
    ASSERT_TRUE(graph.compile());
    EXPECT_TRUE(graph.passes()[0].is_live);
}

TEST(FrameGraph, ChainsAreFollowedToTheirBeginning) {
    FrameGraph graph;
    const BufferId list = graph.add_buffer({.size = 16, .name = "list"});
    const TextureId color = graph.add_texture(desc("color"));
    const TextureId result = graph.add_texture(desc("result"));
    graph.add_pass("fill list").uses(list, ResourceUse::storage_write);
    graph.add_pass("draw").uses(list, ResourceUse::indirect_argument).uses(color, ResourceUse::color_target);
    graph.add_pass("draw more").uses(color, ResourceUse::color_target);
    graph.add_pass("finish").uses(color, ResourceUse::sampled).uses(result, ResourceUse::storage_write);
    graph.keep(result);
    ASSERT_TRUE(graph.compile());
    for (const FrameGraph::Pass& pass : graph.passes()) EXPECT_TRUE(pass.is_live) << pass.name;
    EXPECT_EQ(graph.writers_of(color), "draw, draw more");
}

TEST(FrameGraph, TexturesWhoseLivesDoNotOverlapShareMemory) {
    FrameGraph graph;
    const TextureId a = graph.add_texture(desc("a"));
    const TextureId b = graph.add_texture(desc("b"));
    const TextureId c = graph.add_texture(desc("c"));
    const TextureId other_size = graph.add_texture(desc("other size", 32));
    const TextureId result = graph.add_texture(desc("result"));
    graph.add_pass("1").uses(a, ResourceUse::storage_write);
    graph.add_pass("2").uses(a, ResourceUse::sampled).uses(b, ResourceUse::color_target);
    graph.add_pass("3").uses(b, ResourceUse::sampled).uses(c, ResourceUse::storage_write);
    graph.add_pass("4").uses(c, ResourceUse::sampled).uses(other_size, ResourceUse::storage_write);
    graph.add_pass("5").uses(other_size, ResourceUse::sampled).uses(result, ResourceUse::storage_write);
    graph.keep(result);
    ASSERT_TRUE(graph.compile());
    EXPECT_EQ(graph.textures()[c.index].shares_with, a.index);
    EXPECT_EQ(graph.textures()[b.index].shares_with, ~0u);
    EXPECT_EQ(graph.textures()[other_size.index].shares_with, ~0u);
    // What is kept has memory of its own.
    EXPECT_EQ(graph.textures()[result.index].shares_with, ~0u);
    const std::uint64_t one = 64 * 64 * 4;
    EXPECT_EQ(graph.transient_bytes_unshared() - graph.transient_bytes(), one);
    // The shared texture can be used as all of its tenants need it.
    EXPECT_TRUE(rhi::has_all(graph.textures()[a.index].desc.usage,
                             rhi::TextureUsage::storage | rhi::TextureUsage::sampled));
}

TEST(FrameGraph, TexturesThatAreReadAfterTheFrameDoNotShare) {
    FrameGraph graph;
    const TextureId a = graph.add_texture(desc("a"));
    const TextureId b = graph.add_texture(desc("b"));
    const TextureId c = graph.add_texture(desc("c"));
    graph.add_pass("1").uses(a, ResourceUse::storage_write);
    graph.add_pass("2").uses(a, ResourceUse::sampled).uses(b, ResourceUse::storage_write);
    graph.add_pass("3").uses(b, ResourceUse::sampled).uses(c, ResourceUse::storage_write);
    graph.keep(c);
    graph.do_not_share(a);
    ASSERT_TRUE(graph.compile());
    EXPECT_EQ(graph.transient_bytes(), graph.transient_bytes_unshared());
    EXPECT_TRUE(rhi::has_all(graph.textures()[a.index].desc.usage, rhi::TextureUsage::copy_source));
}

TEST(FrameGraph, ReadingWhatNobodyWroteIsAnError) {
    FrameGraph graph;
    const TextureId ghost = graph.add_texture(desc("ghost"));
    const TextureId result = graph.add_texture(desc("result"));
    graph.add_pass("reader").uses(ghost, ResourceUse::sampled).uses(result, ResourceUse::storage_write);
    graph.keep(result);
    const auto compiled = graph.compile();
    ASSERT_FALSE(compiled);
    EXPECT_EQ(compiled.error().code, ErrorCode::invalid_argument);
    EXPECT_NE(compiled.error().message().find("'reader'"), std::string::npos);
    EXPECT_NE(compiled.error().message().find("'ghost'"), std::string::npos);
}

TEST(FrameGraph, DrawingsNameEverything) {
    FrameGraph graph;
    const TextureId color = graph.add_texture(desc("a <color> & more"));
    const TextureId left = graph.add_texture(desc("left"));
    graph.add_pass("paint").uses(color, ResourceUse::storage_write);
    graph.add_pass("idle").uses(left, ResourceUse::storage_write);
    graph.keep(color);
    ASSERT_TRUE(graph.compile());
    const std::string svg = graph.to_svg(), dot = graph.to_dot();
    EXPECT_NE(svg.find("paint"), std::string::npos);
    EXPECT_NE(svg.find("idle (left out)"), std::string::npos);
    EXPECT_NE(svg.find("a &lt;color&gt; &amp; more"), std::string::npos);
    EXPECT_EQ(svg.find("<color>"), std::string::npos);
    EXPECT_NE(dot.find("digraph"), std::string::npos);
    EXPECT_NE(dot.find("paint"), std::string::npos);
}

TEST(FrameGraph, BytesCountMipsLayersAndBlocks) {
    EXPECT_EQ(texture_bytes({.format = rhi::Format::rgba8_unorm, .width = 4, .height = 4, .layers = 6, .mips = 3}),
              6u * 4 * (16 + 4 + 1));
    EXPECT_EQ(texture_bytes({.format = rhi::Format::bc1_rgba_unorm, .width = 5, .height = 4}), 2u * 8);
}

}  // namespace
}  // namespace nacre::passes
