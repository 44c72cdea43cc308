// SPDX-License-Identifier: Apache-2.0
// Topologies, indices, instances, faces, lines, points and samples.
#include "tests/backends/cpu/raster/raster_bench.h"

namespace nacre::test {
namespace {

using namespace rhi;

constexpr std::uint32_t width = 128, height = 64;

TestVertex window(double x, double y) { return at_window(x, y, width, height); }

TEST(Primitives, StripsAndListsDrawTheSame) {
    std::vector<TestVertex> strip, list;
    for (int i = 0; i < 12; ++i) strip.push_back(window(10 + 8 * i, i % 2 ? 50 : 10 + i));
    for (int i = 0; i + 2 < 12; ++i) {
        list.push_back(strip[i]);
        list.push_back(strip[i % 2 ? i + 2 : i + 1]);
        list.push_back(strip[i % 2 ? i + 1 : i + 2]);
    }
    std::vector<std::byte> pictures[2];
    for (const bool is_strip : {false, true}) {
        TestImage image(Format::rg32_uint, width, height);
        Bench bench(width, height, {&image});
        bench.use<TestShader::primitive_id>(2);
        bench.pipeline.topology = is_strip ? Topology::triangle_strip : Topology::triangle_list;
        bench.draw(is_strip ? strip : list);
        bench.end();
        pictures[is_strip] = image.content();
        // All triangles of a strip face the same way.
        std::set<std::uint32_t> faces, ids;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                if (const auto value = image.at<std::array<std::uint32_t, 2>>(x, y); value[0]) ids.insert(value[0]), faces.insert(value[1]);
        EXPECT_EQ(faces.size(), 1u);
        EXPECT_EQ(ids.size(), 10u);
    }
    EXPECT_EQ(pictures[0], pictures[1]);
}

TEST(Primitives, FacesAreThoseSeenOnThePicture) {
    // Right, then down: clockwise where y points down.
    const std::vector<TestVertex> clockwise = {window(0, 0), window(100, 0), window(0, 60)};
    const std::vector<TestVertex> counter = {window(0, 0), window(0, 60), window(100, 0)};
    for (const bool is_clockwise : {false, true})
        for (const FrontFace front : {FrontFace::clockwise, FrontFace::counter_clockwise})
            for (const CullMode cull : {CullMode::none, CullMode::front, CullMode::back}) {
                TestImage image(Format::rg32_uint, width, height);
                Bench bench(width, height, {&image});
                bench.use<TestShader::primitive_id>(2);
                bench.pipeline.front_face = front;
                bench.pipeline.cull = cull;
                bench.draw(is_clockwise ? clockwise : counter);
                bench.end();
                const bool is_front = is_clockwise == (front == FrontFace::clockwise);
                const bool drawn = cull == CullMode::none || (cull == CullMode::back) == is_front;
                const auto value = image.at<std::array<std::uint32_t, 2>>(10, 10);
                EXPECT_EQ(value[0], drawn ? 1u : 0u);
                if (drawn) {
                    EXPECT_EQ(value[1], is_front ? 1u : 0u);
                }
            }
}

TEST(Primitives, IndicesReadWhatTheySayAndZeroBehindTheBuffer) {
    std::mt19937 random(9);
    // A sheet with shared vertices against the same without indices.
    std::vector<TestVertex> vertices;
    for (int y = 0; y <= 30; ++y)
        for (int x = 0; x <= 40; ++x) vertices.push_back(window(x * 3.0, y * 2.0));
    std::vector<std::uint32_t> indices;
    for (std::uint32_t y = 0; y < 30; ++y)
        for (std::uint32_t x = 0; x < 40; ++x) {
            const std::uint32_t a = y * 41 + x;
            for (const std::uint32_t index : {a, a + 1, a + 41, a + 1, a + 42, a + 41}) indices.push_back(index);
        }
    std::vector<TestVertex> flat;
    for (const std::uint32_t index : indices) flat.push_back(vertices[index]);
    TestImage expected(Format::r32_uint, width, height);
    {
        Bench bench(width, height, {&expected});
        bench.use<TestShader::primitive_id>(1);
        bench.draw(flat);
        bench.end();
    }
    for (const bool is_short : {false, true}) {
        TestImage image(Format::r32_uint, width, height);
        Bench bench(width, height, {&image}, nullptr, {.threads = 2});
        bench.use<TestShader::primitive_id>(1);
        // The offset is taken off again; five indices in front are skipped.
        std::vector<std::uint16_t> shorts(5, 999);
        std::vector<std::uint32_t> longs(5, 999);
        for (const std::uint32_t index : indices) shorts.push_back(static_cast<std::uint16_t>(index + 7)), longs.push_back(index + 7);
        cpu::DrawCall call;
        call.indexed = true;
        call.index_type = is_short ? IndexType::uint16 : IndexType::uint32;
        call.indices = is_short ? reinterpret_cast<const std::byte*>(shorts.data()) : reinterpret_cast<const std::byte*>(longs.data());
        call.index_bytes = is_short ? shorts.size() * 2 : longs.size() * 4;
        call.first = 5;
        call.count = static_cast<std::uint32_t>(indices.size());
        call.vertex_offset = -7;
        bench.draw(vertices, call);
        bench.end();
        EXPECT_EQ(image.content(), expected.content());
    }
    // Behind the end of the indices 0 is read: vertex 3 with the offset, three times, which is no triangle.
    TestImage image(Format::r32_uint, width, height);
    Bench bench(width, height, {&image});
    bench.use<TestShader::primitive_id>(1);
    const std::vector<std::uint32_t> few = {0, 40, 30 * 41};
    cpu::DrawCall call;
    call.indexed = true;
    call.indices = reinterpret_cast<const std::byte*>(few.data());
    call.index_bytes = 12;
    call.count = 3000;
    bench.draw(vertices, call);
    // And vertices behind the end of their buffer are all zero: position (0, 0, 0, 1) in the tests.
    const std::vector<std::uint32_t> wild = {0xffffffff, 0x80000000, 12345678, 1, 2, 0xfffffff0};
    call.indices = reinterpret_cast<const std::byte*>(wild.data());
    call.index_bytes = 24;
    call.count = 6;
    bench.draw(vertices, call);
    bench.end();
    EXPECT_EQ(image.at<std::uint32_t>(10, 10), 1u);
    EXPECT_TRUE(image.margins_are_whole());
}

TEST(Primitives, InstancesAreDrawnOneAfterAnother) {
    TestImage image(Format::r32_uint, width, height);
    Bench bench(width, height, {&image});
    bench.use<TestShader::primitive_id>(1);
    // Each instance lies 2 units of clip space, a whole picture, to the right: the viewport is a part of it.
    bench.state.viewport = {0, 0, 16, 64, 0, 1};
    cpu::DrawCall call;
    call.first_instance = 0, call.instance_count = 3;
    std::vector<TestVertex> vertices(6);
    const float corners[6][2] = {{-1, -1}, {1, -1}, {-1, 1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int i = 0; i < 6; ++i) vertices[i].position[0] = corners[i][0], vertices[i].position[1] = corners[i][1];
    bench.draw(vertices, call);
    call.first_instance = 5, call.instance_count = 1;
    bench.draw(vertices, call);
    bench.end();
    for (std::uint32_t x = 0; x < width; ++x) {
        // What lies outside of the viewport is clipped, so only instance 0 is seen; ids start anew for each instance.
        EXPECT_EQ(image.at<std::uint32_t>(x, 0) != 0, x < 16) << x;
    }
    EXPECT_EQ(image.at<std::uint32_t>(0, 0), 1u);
    EXPECT_EQ(image.at<std::uint32_t>(15, 63), 2u);
}

TEST(Primitives, PointsAreSquaresWithCoordinates) {
    struct Case {
        double x, y, size;
        std::uint32_t x0, x1, y0, y1;  ///< Pixels, the end exclusive.
    };
    const Case cases[] = {
        {10.5, 10.5, 1, 10, 11, 10, 11}, {20, 20, 4, 18, 22, 18, 22},   {40.5, 30.5, 3, 39, 42, 29, 32},
        {50, 50, 1, 49, 50, 49, 50},  // On the corner of four pixels: left and top edges are inside, at 49.5.
        {60.25, 20.25, 2, 59, 61, 19, 21}, {80, 30, 0.2, 79, 80, 29, 30}, {0.5, 0.5, 5, 0, 3, 0, 3},
    };
    for (const Case& entry : cases) {
        TestImage image(Format::rgba32_float, width, height), count(Format::r32_float, width, height);
        Bench bench(width, height, {&image});
        bench.use<TestShader::point>();
        bench.pipeline.topology = Topology::point_list;
        bench.pipeline.vertex.writes_point_size = true;
        std::vector<TestVertex> vertices = {window(entry.x, entry.y)};
        vertices[0].point_size = static_cast<float>(entry.size);
        bench.draw(vertices);
        EXPECT_EQ(bench.passed(), std::uint64_t{entry.x1 - entry.x0} * (entry.y1 - entry.y0)) << entry.x << " " << entry.size;
        bench.end();
        const double size = std::max(entry.size, 1.0);
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const auto value = image.at<std::array<float, 4>>(x, y);
                const bool inside = x >= entry.x0 && x < entry.x1 && y >= entry.y0 && y < entry.y1;
                ASSERT_EQ(value[3] != 0.0f, inside) << entry.x << ", " << entry.y << " at " << x << ", " << y;
                if (!inside) continue;
                ASSERT_NEAR(value[0], 0.5 + (x + 0.5 - entry.x) / size, 1e-6);
                ASSERT_NEAR(value[1], 0.5 + (y + 0.5 - entry.y) / size, 1e-6);
            }
    }
    // Outside of the clip volume a point vanishes as a whole, with NaN as a size it is small, and too large ones are cut.
    for (const float size : {NAN, -5.0f, 1e30f, INFINITY}) {
        TestImage image(Format::rgba32_float, width, height);
        Bench bench(width, height, {&image});
        bench.use<TestShader::point>();
        bench.pipeline.topology = Topology::point_list;
        bench.pipeline.vertex.writes_point_size = true;
        std::vector<TestVertex> vertices = {window(64, 32), window(-3, 32)};
        vertices[0].point_size = vertices[1].point_size = size;
        bench.draw(vertices);
        EXPECT_EQ(bench.passed(), size > 1 ? std::uint64_t{width} * height : 1u);
        bench.end();
        EXPECT_TRUE(image.margins_are_whole());
    }
}

/// Whether the line from a to b leaves the diamond of the pixel: it comes into it, and does not end there. The distance along the line
/// in the norm of diamonds is convex, and least at an end or where the line passes the center along an axis.
bool leaves_diamond(const double* a, const double* b, int pixel_x, int pixel_y) {
    const double from_x = a[0] - pixel_x - 0.5, from_y = a[1] - pixel_y - 0.5, run_x = b[0] - a[0], run_y = b[1] - a[1];
    const auto inside = [&](double t) { return std::abs(from_x + run_x * t) + std::abs(from_y + run_y * t) < 0.5; };
    if (inside(1.0)) return false;
    for (const double t : {0.0, -from_x / run_x, -from_y / run_y})
        if (t >= 0.0 && t <= 1.0 && inside(t)) return true;
    return false;
}

TEST(Primitives, LinesCoverThePixelsWhoseDiamondTheyLeave) {
    std::mt19937 random(10);
    for (int round = 0; round < 400; ++round) {
        double ends[2][2];
        for (auto& end : ends)
            for (int axis = 0; axis < 2; ++axis) {
                // Odd multiples of 1/256 keep away from ties.
                end[axis] = (static_cast<int>(random() % (40 * 256)) | 1) / 256.0 + (axis == 0 ? 45 : 10);
                if (round % 5 == 0) end[axis] = std::floor(end[axis] / 4) + (axis == 0 ? 45 : 10) + 51 / 256.0 * (1 + random() % 4);
            }
        TestImage image(Format::r32_float, width, height);
        Bench bench(width, height, {&image});
        bench.use<TestShader::constant>();
        bench.pipeline.topology = round % 2 ? Topology::line_list : Topology::line_strip;
        bench.pipeline.color_targets[0].blend = {.enabled = true, .source_color = BlendFactor::one, .destination_color = BlendFactor::one};
        bench.draw({window(ends[0][0], ends[0][1]), window(ends[1][0], ends[1][1])});
        bench.end();
        for (int y = 0; y < static_cast<int>(height); ++y)
            for (int x = 0; x < static_cast<int>(width); ++x) {
                const bool expected = leaves_diamond(ends[0], ends[1], x, y);
                ASSERT_EQ(image.at<float>(x, y), expected ? 1.0f : 0.0f) << round << ": " << x << ", " << y;
            }
    }
}

TEST(Primitives, ConnectedLinesDrawNoPixelTwice) {
    TestImage image(Format::r32_float, width, height);
    Bench bench(width, height, {&image});
    bench.use<TestShader::constant>();
    bench.pipeline.topology = Topology::line_strip;
    bench.pipeline.color_targets[0].blend = {.enabled = true, .source_color = BlendFactor::one, .destination_color = BlendFactor::one};
    std::vector<TestVertex> vertices;
    for (int i = 0; i <= 16; ++i) vertices.push_back(window(4.3 + 7 * i, 20.2 + 2 * i));
    bench.draw(vertices);
    bench.end();
    // From column 4 to before column 116: one pixel each, none twice.
    float sum = 0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            EXPECT_LE(image.at<float>(x, y), 1.0f);
            sum += image.at<float>(x, y);
        }
    EXPECT_EQ(sum, 112.0f);
}

TEST(Primitives, LinesInterpolateAndClip) {
    TestImage image(Format::rgba32_float, width, height);
    Bench bench(width, height, {&image});
    bench.use<TestShader::values>();
    bench.pipeline.topology = Topology::line_list;
    // From far left of the picture to its right, with perspective.
    std::vector<TestVertex> vertices(2);
    vertices[0].position[0] = -5e6f, vertices[0].position[1] = 0.01f, vertices[0].position[2] = 0.5f;
    vertices[1].position[0] = 3, vertices[1].position[1] = 0.03f, vertices[1].position[2] = 1.5f, vertices[1].position[3] = 3;
    vertices[0].values[0] = -5e6f, vertices[1].values[0] = 3;  // The x of clip space: x / w of it is known everywhere.
    vertices[0].values[3] = 7, vertices[1].values[3] = 8;
    bench.draw(vertices);
    bench.end();
    std::uint32_t drawn = 0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const auto value = image.at<std::array<float, 4>>(x, y);
            if (value[3] == 0.0f) continue;
            ++drawn;
            EXPECT_EQ(value[3], 7.0f);
        }
    EXPECT_NEAR(drawn, width, 1);
}

TEST(Primitives, OutlinesDrawTheThreeEdges) {
    TestImage image(Format::r32_uint, width, height);
    Bench bench(width, height, {&image});
    bench.use<TestShader::primitive_id>(1);
    bench.pipeline.fill = FillMode::line;
    bench.pipeline.cull = CullMode::back;
    bench.pipeline.front_face = FrontFace::clockwise;
    bench.draw({window(10.5, 5.5), window(100.5, 5.5), window(10.5, 50.5),      // front
                window(60.5, 60.5), window(120.5, 60.5), window(60.5, 50.5)});  // back
    bench.end();
    EXPECT_EQ(image.at<std::uint32_t>(50, 5), 1u);
    EXPECT_EQ(image.at<std::uint32_t>(10, 30), 1u);
    EXPECT_EQ(image.at<std::uint32_t>(55, 28), 1u);
    EXPECT_EQ(image.at<std::uint32_t>(30, 15), 0u);
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) ASSERT_LE(image.at<std::uint32_t>(x, y), 1u);
}

TEST(Samples, CoverageIsExactForEachSample) {
    std::mt19937 random(12);
    for (int round = 0; round < 40; ++round) {
        std::int64_t points[3][2];
        std::vector<TestVertex> vertices;
        const int reach = round % 2 ? 20 * 256 : 200 * 256;
        for (auto& point : points) {
            point[0] = 64 * 256 + static_cast<int>(random() % (2 * reach)) - reach;
            point[1] = 32 * 256 + static_cast<int>(random() % (2 * reach)) - reach;
            vertices.push_back(window(point[0] / 256.0, point[1] / 256.0));
        }
        TestImage color(Format::r32_float, width, height, 4), depth(Format::d32_float, width, height, 4);
        depth.fill(1.0f);
        Bench bench(width, height, {&color}, &depth, {.options = {.instruction_set = static_cast<std::uint32_t>(round % 3)}}, 4);
        bench.use<TestShader::constant>();
        bench.pipeline.depth_stencil.depth_test = bench.pipeline.depth_stencil.depth_write = true;
        bench.draw(vertices);
        const std::uint64_t passed = bench.passed();
        bench.end();
        std::int64_t area = (points[1][0] - points[0][0]) * (points[2][1] - points[0][1]) - (points[2][0] - points[0][0]) * (points[1][1] - points[0][1]);
        if (area < 0) std::swap(points[1], points[2]);
        // The standard positions, in sixteenths.
        const int offsets[4][2] = {{6, 2}, {14, 6}, {2, 10}, {10, 14}};
        std::uint64_t expected_passed = 0;
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                for (std::uint32_t s = 0; s < 4; ++s) {
                    const std::int64_t px = x * 256 + offsets[s][0] * 16, py = y * 256 + offsets[s][1] * 16;
                    bool inside = area != 0;
                    for (int i = 0; i < 3; ++i) {
                        const auto *from = points[i], *to = points[(i + 1) % 3];
                        const std::int64_t side = (to[0] - from[0]) * (py - from[1]) - (to[1] - from[1]) * (px - from[0]);
                        inside = inside && (side > 0 || (side == 0 && (to[1] < from[1] || (to[1] == from[1] && to[0] > from[0]))));
                    }
                    expected_passed += inside;
                    ASSERT_EQ(color.at<float>(x, y, s), inside ? 1.0f : 0.0f) << round << ": " << x << ", " << y << ", " << s;
                    ASSERT_EQ(depth.at<float>(x, y, s), inside ? 0.5f : 1.0f);
                }
        EXPECT_EQ(passed, expected_passed);
        EXPECT_TRUE(color.margins_are_whole() && depth.margins_are_whole());
    }
}

TEST(Samples, ShadersRunForPixelsOrForSamplesAndSeeTheirCoverage) {
    // The left half of pixel column 20: samples 0 (at 6/16) and 2 (at 2/16) lie left of 20.5.
    const std::vector<TestVertex> vertices = {window(0, 0), window(20.5, 0), window(0, 200), window(20.5, 0), window(20.5, 200), window(0, 200)};
    for (const bool per_sample : {false, true})
        for (const std::uint32_t lanes : {4u, 8u, 16u}) {
            TestImage color(Format::rgba32_uint, width, height, 4);
            std::vector<std::uint32_t> counters(width * height);
            Bench bench(width, height, {&color}, nullptr, {.lanes = lanes}, 4);
            bench.use<TestShader::coverage>();
            bench.pipeline.fragment.runs_per_sample = per_sample;
            bench.pipeline.fragment.uses_centroid = true;
            bench.constants.counters = counters.data(), bench.constants.counter_width = width;
            bench.draw(vertices);
            bench.end();
            for (std::uint32_t s = 0; s < 4; ++s) {
                const auto inside = color.at<std::array<std::uint32_t, 4>>(5, 1, s);
                EXPECT_EQ(inside[0], per_sample ? 1u << s : 15u);
                EXPECT_EQ(inside[1], per_sample ? s : 0u);
                if (!per_sample) {
                    EXPECT_EQ(std::bit_cast<float>(inside[2]), 0.5f);
                }
                const auto edge = color.at<std::array<std::uint32_t, 4>>(20, 1, s);
                if (s == 1 || s == 3) {
                    EXPECT_EQ(edge, (std::array<std::uint32_t, 4>{}));
                    continue;
                }
                EXPECT_EQ(edge[0], per_sample ? 1u << s : 5u);
                if (!per_sample) {
                    EXPECT_EQ(std::bit_cast<float>(edge[2]), 6.0f / 16.0f);
                    EXPECT_EQ(std::bit_cast<float>(edge[3]), 2.0f / 16.0f);
                }
            }
            EXPECT_EQ(counters[1 * width + 5], per_sample ? 4u : 1u);
            EXPECT_EQ(counters[1 * width + 20], per_sample ? 2u : 1u);
        }
}

TEST(Samples, MasksAlphaAndDiscardLeaveSamplesOut) {
    const std::vector<TestVertex> vertices = {window(0, 0), window(256, 0), window(0, 256)};
    for (const std::uint32_t mask : {0u, 5u, 15u})
        for (const float alpha : {-1.0f, 0.0f, 0.3f, 0.5f, 1.0f}) {
            TestImage color(Format::rgba32_float, width, height, 4);
            Bench bench(width, height, {&color}, nullptr, {}, 4);
            bench.use<TestShader::constant>();
            bench.pipeline.fragment.writes_sample_mask = true;
            bench.constants.sample_mask = mask;
            bench.pipeline.alpha_to_coverage = alpha >= 0.0f;
            bench.constants.color[3] = alpha;
            bench.draw(vertices);
            const std::uint64_t passed = bench.passed();
            bench.end();
            int alive = 0;
            for (std::uint32_t s = 0; s < 4; ++s) {
                const bool lives = color.at<std::array<float, 4>>(3, 3, s)[0] == 1.0f;
                alive += lives;
                if ((mask >> s & 1) == 0) {
                    EXPECT_FALSE(lives);
                }
                if (alpha < 0.0f || alpha == 1.0f) {
                    EXPECT_EQ(lives, (mask >> s & 1) != 0);
                }
            }
            if (mask == 15 && alpha >= 0.0f) {
                EXPECT_NEAR(alive, alpha * 4, 0.51);
            }
            EXPECT_EQ(passed % (width * height), 0u);
            EXPECT_EQ(passed / (width * height), static_cast<std::uint64_t>(alive));
        }
}

}  // namespace
}  // namespace nacre::test
