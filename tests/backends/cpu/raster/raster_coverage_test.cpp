// SPDX-License-Identifier: Apache-2.0
// Which pixels are covered, against edge functions in 64-bit integers for every pixel.
#include "tests/backends/cpu/raster/exact_coverage.h"
#include "tests/backends/cpu/raster/raster_bench.h"

namespace nacre::test {
namespace {

using rhi::Format;

constexpr std::uint32_t width = 256, height = 128;

TestVertex vertex_of(Point point) { return at_window(point.x / 256.0, point.y / 256.0, width, height); }

/// Adds up how often each pixel is drawn.
struct Counted {
    TestImage image{Format::r32_float, width, height};
    Bench bench;
    explicit Counted(BenchSetup setup = {}) : bench(width, height, {&image}, nullptr, setup) {
        bench.use<TestShader::constant>();
        rhi::BlendState& blend = bench.pipeline.color_targets[0].blend;
        blend.enabled = true;
        blend.source_color = blend.destination_color = rhi::BlendFactor::one;
    }
};

class Coverage : public testing::TestWithParam<std::tuple<int, int>> {
  protected:
    BenchSetup setup() const {
        return {.lanes = static_cast<std::uint32_t>(std::get<0>(GetParam())),
                .options = {.instruction_set = static_cast<std::uint32_t>(std::get<1>(GetParam()))}};
    }
};
INSTANTIATE_TEST_SUITE_P(, Coverage, testing::Combine(testing::Values(4, 8, 16), testing::Values(0, 1, 2)),
                         [](const auto& entry) {
                             return "Lanes" + std::to_string(std::get<0>(entry.param)) + "Set" +
                                    std::to_string(std::get<1>(entry.param));
                         });

TEST_P(Coverage, RandomTrianglesCoverWhatExactEdgesSay) {
    std::mt19937 random(7);
    for (int round = 0; round < 60; ++round) {
        // From a fraction of a pixel to far beyond the picture, in all places of the grid of subpixels.
        const int reach[] = {2, 8, 40, 300, 5000};
        std::vector<TestVertex> vertices;
        std::vector<Point> points;
        const int extent = reach[round % 5] * 256;
        for (int triangle = 0; triangle < 20; ++triangle) {
            const Point origin{static_cast<int>(random() % (width * 256)), static_cast<int>(random() % (height * 256))};
            for (int i = 0; i < 3; ++i) {
                // Some on pixel centers, where the rules for edges decide.
                Point point{origin.x + static_cast<int>(random() % (2 * extent)) - extent,
                            origin.y + static_cast<int>(random() % (2 * extent)) - extent};
                if (round % 3 == 0) point = {(point.x & ~255) + 128, (point.y & ~255) + 128};
                points.push_back(point);
                vertices.push_back(vertex_of(point));
            }
        }
        Counted counted(setup());
        counted.bench.draw(vertices);
        counted.bench.end();
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                int expected = 0;
                for (std::size_t i = 0; i < points.size(); i += 3)
                    expected += covers(points[i], points[i + 1], points[i + 2], {x * 256 + 128, y * 256 + 128});
                ASSERT_EQ(counted.image.at<float>(x, y), static_cast<float>(expected))
                    << round << ": " << x << ", " << y;
            }
        EXPECT_TRUE(counted.image.margins_are_whole());
    }
}

TEST_P(Coverage, MeshesCoverEveryPixelOnce) {
    std::mt19937 random(11);
    for (const int cells : {1, 3, 17, 90}) {
        // A grid over the whole picture with its inner corners moved about, by less than a quarter so that nothing
        // folds.
        std::vector<Point> corners;
        for (int y = 0; y <= cells; ++y)
            for (int x = 0; x <= cells; ++x) {
                Point corner{static_cast<std::int64_t>(width) * 256 * x / cells,
                             static_cast<std::int64_t>(height) * 256 * y / cells};
                const int move_x = static_cast<int>(width) * 256 / cells / 5 + 1,
                          move_y = static_cast<int>(height) * 256 / cells / 5 + 1;
                if (x > 0 && x < cells) corner.x += static_cast<int>(random() % (2 * move_x)) - move_x;
                if (y > 0 && y < cells) corner.y += static_cast<int>(random() % (2 * move_y)) - move_y;
                corners.push_back(corner);
            }
        std::vector<TestVertex> vertices;
        for (int y = 0; y < cells; ++y)
            for (int x = 0; x < cells; ++x) {
                const int a = y * (cells + 1) + x, b = a + 1, c = a + cells + 1, d = c + 1;
                const int order[2][6] = {{a, b, c, b, d, c}, {a, b, d, a, d, c}};
                for (const int corner : order[random() % 2]) vertices.push_back(vertex_of(corners[corner]));
            }
        Counted counted(setup());
        counted.bench.draw(vertices);
        counted.bench.end();
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                ASSERT_EQ(counted.image.at<float>(x, y), 1.0f) << cells << ": " << x << ", " << y;
    }
}

TEST(Order, LastTriangleWinsWhateverItsSize) {
    // Large ones are kept apart from the bins of the tiles, small ones lie in them; here they alternate.
    constexpr std::uint32_t size = 512;
    std::mt19937 random(13);
    std::vector<Point> points;
    std::vector<TestVertex> vertices;
    for (int triangle = 0; triangle < 700; ++triangle) {
        const int reach = (random() % 4 == 0 ? 500 : 60) * 256;
        const Point center{static_cast<int>(random() % (size * 256)), static_cast<int>(random() % (size * 256))};
        for (int corner = 0; corner < 3; ++corner) {
            points.push_back({center.x + static_cast<int>(random() % (2 * reach)) - reach,
                              center.y + static_cast<int>(random() % (2 * reach)) - reach});
            vertices.push_back(at_window(points.back().x / 256.0, points.back().y / 256.0, size, size));
        }
    }
    TestImage image(Format::r32_uint, size, size);
    Bench bench(size, size, {&image}, nullptr, {.threads = 3});
    bench.use<TestShader::primitive_id>(1);
    bench.draw(vertices);
    bench.end();
    for (std::uint32_t y = 0; y < size; y += 3)
        for (std::uint32_t x = 0; x < size; ++x) {
            std::uint32_t expected = 0;
            for (std::size_t i = points.size(); i != 0 && expected == 0; i -= 3)
                if (covers(points[i - 3], points[i - 2], points[i - 1], {x * 256 + 128, y * 256 + 128}))
                    expected = static_cast<std::uint32_t>(i / 3);
            ASSERT_EQ(image.at<std::uint32_t>(x, y), expected) << x << ", " << y;
        }
}

}  // namespace
}  // namespace nacre::test
