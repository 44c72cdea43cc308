// SPDX-License-Identifier: Apache-2.0
// The same picture whatever it runs on, and no harm from any input.
#include "tests/backends/cpu/raster/raster_bench.h"

namespace nacre::test {
namespace {

using namespace rhi;

constexpr std::uint32_t width = 201, height = 135;  // No multiples of anything.

/// Draws of many kinds over each other.
std::vector<std::vector<std::byte>> draw_scene(BenchSetup setup, std::uint32_t samples, std::uint64_t& passed) {
    TestImage color(Format::rgba8_unorm, width, height, samples), words(Format::rg32_uint, width, height, samples);
    TestImage depth(Format::d24_unorm_s8_uint, width, height, samples);
    depth.fill(0xffffffu);
    Bench bench(width, height, {&color}, &depth, setup, samples);
    std::mt19937 random(21);
    std::uniform_real_distribution<float> unit(-1.0f, 1.0f);
    for (int draw = 0; draw < 24; ++draw) {
        std::vector<TestVertex> vertices;
        const int triangles = draw % 6 == 0 ? 2000 : 40;
        for (int i = 0; i < triangles; ++i) {
            const float x = unit(random), y = unit(random), size = draw % 6 == 0 ? 0.05f : 0.2f + std::abs(unit(random));
            for (int corner = 0; corner < 3; ++corner) {
                TestVertex vertex;
                const float w = draw % 4 == 1 ? unit(random) + 0.8f : 1.0f;
                vertex.position[0] = (x + size * unit(random)) * w, vertex.position[1] = (y + size * unit(random)) * w;
                vertex.position[2] = (0.5f + 0.5f * unit(random)) * w, vertex.position[3] = w;
                for (float& value : vertex.values) value = unit(random);
                vertex.point_size = 3.0f * std::abs(unit(random));
                vertices.push_back(vertex);
            }
        }
        const Topology topologies[] = {Topology::triangle_list, Topology::triangle_strip, Topology::line_list, Topology::point_list};
        bench.pipeline.topology = topologies[draw % 8 < 5 ? 0 : draw % 8 - 4];
        bench.use<TestShader::values>();
        auto& state = bench.pipeline.depth_stencil;
        state.depth_test = draw % 5 != 4;
        state.depth_write = draw % 3 != 2;
        const CompareOperation compares[] = {CompareOperation::less, CompareOperation::less_or_equal, CompareOperation::greater, CompareOperation::always, CompareOperation::greater_or_equal, CompareOperation::not_equal};
        state.depth_compare = compares[draw % 6];
        state.stencil_test = draw % 7 == 3;
        state.front = {StencilOperation::invert, StencilOperation::increment_wrap, StencilOperation::replace, CompareOperation::less_or_equal, 0xff, 0x7f};
        state.back = {StencilOperation::keep, StencilOperation::zero, StencilOperation::decrement_wrap, CompareOperation::always, 0x3f, 0xff};
        bench.state.stencil_reference = static_cast<std::uint8_t>(draw * 11);
        bench.pipeline.fragment.discards = draw % 4 == 2;
        bench.constants.discard_modulus = draw % 4 == 2 ? 3 : 0;
        bench.pipeline.fragment.runs_per_sample = samples > 1 && draw % 5 == 1;
        bench.pipeline.color_targets[0].blend = {draw % 3 == 1, BlendFactor::source_alpha, BlendFactor::one_minus_source_alpha, BlendOperation::add, BlendFactor::one, BlendFactor::one_minus_source_alpha};
        bench.pipeline.color_targets[0].write_mask = draw % 9 == 8 ? 5 : 15;
        if (draw % 10 == 9) bench.state.scissor = {13, 17, 99, 66};
        bench.draw(vertices);
        bench.state.scissor = {0, 0, width, height};
        if (draw == 11) bench.passed();  // A pass may be carried out in parts.
    }
    passed = bench.passed();
    bench.end();
    EXPECT_TRUE(color.margins_are_whole() && depth.margins_are_whole());
    return {color.content(), depth.content()};
}

TEST(Stability, PictureIsTheSameForThreadsLanesAndInstructionSets) {
    for (const std::uint32_t samples : {1u, 4u}) {
        std::uint64_t expected_passed = 0;
        const auto expected = draw_scene({.lanes = 4, .threads = 1, .options = {.instruction_set = 0, .hierarchical_depth = false}}, samples, expected_passed);
        EXPECT_GT(expected_passed, 100'000u);
        for (const std::uint32_t threads : {1u, 3u})
            for (const std::uint32_t lanes : {4u, 8u, 16u})
                for (const std::uint32_t instruction_set : {0u, 1u, 2u})
                    for (const bool hierarchical : {false, true}) {
                        std::uint64_t passed = 0;
                        const auto got = draw_scene({lanes, threads, {instruction_set, hierarchical}}, samples, passed);
                        EXPECT_EQ(passed, expected_passed) << threads << " " << lanes << " " << instruction_set << " " << hierarchical;
                        EXPECT_TRUE(got == expected) << threads << " " << lanes << " " << instruction_set << " " << hierarchical;
                    }
    }
}

TEST(Stability, HierarchicalDepthSkipsFragmentsAndChangesNothing) {
    // Sheets from front to back and back to front with slopes that cross.
    std::vector<std::byte> pictures[2];
    for (const bool hierarchical : {false, true}) {
        TestImage color(Format::r32_uint, 256, 256), depth(Format::d32_float, 256, 256);
        depth.fill(1.0f);
        Bench bench(256, 256, {&color}, &depth, {.options = {.hierarchical_depth = hierarchical}});
        bench.use<TestShader::primitive_id>(1);
        bench.pipeline.depth_stencil.depth_test = bench.pipeline.depth_stencil.depth_write = true;
        std::mt19937 random(31);
        std::uniform_real_distribution<float> unit(0.0f, 1.0f);
        for (const CompareOperation compare : {CompareOperation::less, CompareOperation::less_or_equal, CompareOperation::greater, CompareOperation::greater_or_equal, CompareOperation::always, CompareOperation::less}) {
            bench.pipeline.depth_stencil.depth_compare = compare;
            std::vector<TestVertex> vertices;
            for (int i = 0; i < 120; ++i)
                for (int corner = 0; corner < 3; ++corner) vertices.push_back(at_window(600 * unit(random) - 150, 600 * unit(random) - 150, 256, 256, unit(random)));
            bench.draw(vertices);
        }
        bench.end();
        pictures[hierarchical] = color.content();
        const auto depths = depth.content();
        pictures[hierarchical].insert(pictures[hierarchical].end(), depths.begin(), depths.end());
    }
    EXPECT_TRUE(pictures[0] == pictures[1]);
}

TEST(Stability, WildVerticesHarmNothing) {
    const float wild[] = {0.0f, -0.0f, 1.0f, -1.0f, 1e-30f, 1e30f, -1e30f, 3e38f, -3e38f, 1e-45f, INFINITY, -INFINITY, NAN, 0.5f, 1e7f, -32768.0f};
    std::mt19937 random(41);
    for (int round = 0; round < 60; ++round) {
        TestImage color(Format::rgba32_float, width, height), depth(Format::d32_float_s8_uint, width, height);
        depth.fill(1.0f);
        Bench bench(width, height, {&color}, &depth, {.options = {.instruction_set = static_cast<std::uint32_t>(round % 3)}});
        bench.use<TestShader::values>();
        const Topology topologies[] = {Topology::triangle_list, Topology::line_list, Topology::point_list, Topology::triangle_strip, Topology::line_strip};
        bench.pipeline.topology = topologies[round % 5];
        bench.pipeline.fill = round % 7 == 0 ? FillMode::line : FillMode::fill;
        bench.pipeline.depth_stencil.depth_test = bench.pipeline.depth_stencil.depth_write = true;
        bench.pipeline.depth_stencil.depth_clamp = round % 2;
        bench.pipeline.depth_stencil.depth_bias = round % 4 == 0 ? 1e30f : 0.0f;
        bench.pipeline.depth_stencil.depth_bias_slope = round % 4 == 0 ? -1e30f : 0.0f;
        bench.pipeline.vertex.clip_distances = round % 3;
        bench.pipeline.vertex.writes_point_size = true;
        std::vector<TestVertex> vertices(3000);
        for (TestVertex& vertex : vertices) {
            for (float& value : vertex.position) value = wild[random() % (round % 2 ? 10 : std::size(wild))];
            if (random() % 2) vertex.position[3] = 1.0f;
            for (float& value : vertex.values) value = wild[random() % std::size(wild)];
            for (float& value : vertex.clip_distances) value = wild[random() % std::size(wild)];
            vertex.point_size = wild[random() % std::size(wild)];
        }
        bench.draw(vertices);
        bench.end();
        EXPECT_TRUE(color.margins_are_whole() && depth.margins_are_whole());
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const float value = depth.at<float>(x, y);
                ASSERT_TRUE(value >= 0.0f && value <= 1.0f) << value;
            }
    }
}

TEST(Stability, BadVertexDropsItsPrimitiveOnly) {
    for (const float bad : {NAN, INFINITY, -INFINITY})
        for (int axis = 0; axis < 4; ++axis) {
            TestImage color(Format::r32_uint, 128, 64);
            Bench bench(128, 64, {&color});
            bench.use<TestShader::primitive_id>(1);
            std::vector<TestVertex> vertices = {at_window(0, 0, 128, 64),  at_window(60, 0, 128, 64),  at_window(0, 60, 128, 64),
                                                at_window(64, 0, 128, 64), at_window(120, 0, 128, 64), at_window(64, 60, 128, 64)};
            vertices[1].position[axis] = bad;
            bench.draw(vertices);
            bench.end();
            EXPECT_EQ(color.at<std::uint32_t>(5, 5), 0u);
            EXPECT_EQ(color.at<std::uint32_t>(70, 5), 2u);
        }
}

TEST(Stability, EmptyThingsAreNothing) {
    TestImage color(Format::r32_uint, 64, 64);
    Bench bench(64, 64, {&color});
    bench.use<TestShader::primitive_id>(1);
    const std::vector<TestVertex> vertices = {at_window(0, 0, 64, 64), at_window(60, 0, 64, 64), at_window(0, 60, 64, 64)};
    bench.state.scissor = {0, 0, 0, 64};
    bench.draw(vertices);
    bench.state.scissor = {64, 64, ~0u, ~0u};
    bench.draw(vertices);
    bench.state.scissor = {0, 0, 64, 64};
    cpu::DrawCall call;
    call.instance_count = 0;
    bench.draw(vertices, call);
    call.instance_count = 1, call.count = 2;
    bench.draw(vertices, call);
    EXPECT_EQ(bench.passed(), 0u);
    bench.state.scissor = {0, 0, ~0u, ~0u};
    bench.draw(vertices);
    EXPECT_GT(bench.passed(), 0u);
    bench.end();
    cpu::RenderTargets none;
    TestScheduler scheduler(2);
    cpu::Rasterizer rasterizer(scheduler, 16);
    bench.state.pipeline = &bench.pipeline;
    rasterizer.begin_pass(none);
    rasterizer.draw(bench.state, {.count = 3});
    rasterizer.end_pass();
}

TEST(Stability, LargeDrawsGoThroughInParts) {
    // More primitives than one slab takes, with instances, depth and order.
    TestImage color(Format::r32_uint, 64, 64);
    Bench bench(64, 64, {&color}, nullptr, {.threads = 2});
    bench.use<TestShader::primitive_id>(1);
    std::vector<TestVertex> vertices;
    for (int i = 0; i < 300'000; ++i) {
        const double x = i % 60, y = i / 60 % 60;
        for (const auto& [dx, dy] : {std::pair{0.0, 0.0}, {2.0, 0.0}, {0.0, 2.0}}) vertices.push_back(at_window(x + dx, y + dy, 64, 64));
    }
    bench.draw(vertices);
    const std::uint64_t passed = bench.passed();
    bench.end();
    // Each covers the one center inside; those on its long edge, which is a right one, belong to the neighbor.
    EXPECT_EQ(passed, 300'000u);
    // The last triangle over each pixel is seen: those of the last sheet, 3600 before the end and later.
    for (std::uint32_t y = 1; y < 59; ++y)
        for (std::uint32_t x = 1; x < 59; ++x) ASSERT_GT(color.at<std::uint32_t>(x, y), 300'000u - 3600u - 1200u) << x << ", " << y;
}

TEST(Stability, ExpiredWorkStops) {
    TestImage color(Format::r32_uint, 64, 64);
    Bench bench(64, 64, {&color});
    bench.use<TestShader::primitive_id>(1);
    cpu::ExecutionState execution{1};
    bench.state.context.state = &execution;
    cpu::DrawCall call;
    call.instance_count = 0xffffffff;  // Would take minutes.
    bench.draw({at_window(0, 0, 64, 64), at_window(60, 0, 64, 64), at_window(0, 60, 64, 64)}, call);
    bench.end();
}

TEST(Stability, SideEffectsHappenForCoveredFragmentsOnly) {
    // Hidden fragments of a shader with side effects run unless early tests are asked for.
    for (const bool early : {false, true}) {
        TestImage depth(Format::d32_float, 64, 64);
        depth.fill(0.25f);
        std::vector<std::uint32_t> counters(64 * 64);
        Bench bench(64, 64, {}, &depth, {.threads = 2});
        bench.use<TestShader::constant>();
        bench.pipeline.fragment.outputs.clear();
        bench.pipeline.fragment.has_side_effects = true;
        bench.pipeline.fragment.early_tests = early;
        bench.pipeline.depth_stencil.depth_test = bench.pipeline.depth_stencil.depth_write = true;
        bench.constants.counters = counters.data(), bench.constants.counter_width = 64;
        bench.draw({at_window(0, 0, 64, 64), at_window(128, 0, 64, 64), at_window(0, 128, 64, 64)});
        EXPECT_EQ(bench.passed(), 0u);
        bench.end();
        for (const std::uint32_t counter : counters) ASSERT_EQ(counter, early ? 0u : 1u);
    }
}

}  // namespace
}  // namespace nacre::test
