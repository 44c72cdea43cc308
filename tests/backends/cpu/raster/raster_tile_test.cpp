// SPDX-License-Identifier: Apache-2.0
// What tiles do with whole regions, blocks and triangles at once, against pixels one by one.
#include "tests/backends/cpu/raster/exact_coverage.h"
#include "tests/backends/cpu/raster/raster_bench.h"

namespace nacre::test {
namespace {

using rhi::CompareOperation;
using rhi::Format;

constexpr std::uint32_t width = 203, height = 150;

bool passes(CompareOperation operation, std::int64_t value, std::int64_t old) {
    switch (operation) {
        case CompareOperation::never: return false;
        case CompareOperation::less: return value < old;
        case CompareOperation::equal: return value == old;
        case CompareOperation::less_or_equal: return value <= old;
        case CompareOperation::greater: return value > old;
        case CompareOperation::not_equal: return value != old;
        case CompareOperation::greater_or_equal: return value >= old;
        default: return true;
    }
}

struct DepthCase {
    CompareOperation compare;
    Format format;
    bool writes;
    rhi::Rectangle scissor;
};

class SmallTriangles : public testing::TestWithParam<std::tuple<int, int, bool>> {};
INSTANTIATE_TEST_SUITE_P(, SmallTriangles,
                         testing::Combine(testing::Values(4, 8, 16), testing::Values(0, 1, 2), testing::Bool()),
                         [](const auto& entry) {
                             return "Lanes" + std::to_string(std::get<0>(entry.param)) + "Set" +
                                    std::to_string(std::get<1>(entry.param)) +
                                    (std::get<2>(entry.param) ? "Hierarchical" : "Plain");
                         });

TEST_P(SmallTriangles, AreTestedPixelByPixel) {
    const auto [lanes, instruction_set, hierarchical] = GetParam();
    std::mt19937 random(29);
    std::vector<DepthCase> cases;
    for (int operation = 0; operation < 8; ++operation)
        for (const Format format : {Format::d16_unorm, Format::d32_float})
            cases.push_back({static_cast<CompareOperation>(operation), format, (operation + cases.size()) % 3 != 0,
                             operation % 2 ? rhi::Rectangle{5, 3, 170, 121} : rhi::Rectangle{0, 0, width, height}});
    for (const DepthCase& at : cases) {
        TestImage color(Format::r32_uint, width, height), depth(at.format, width, height);
        const bool is_float = at.format == Format::d32_float;
        const auto key = [&](float z) {
            return is_float ? std::int64_t{std::bit_cast<std::int32_t>(z)}
                            : static_cast<std::int64_t>(std::nearbyint(z * 65535.0f));
        };
        std::vector<std::int64_t> depths(std::size_t{width} * height, key(0.5f));
        std::vector<std::uint32_t> ids(depths.size(), 0);
        if (is_float)
            depth.fill(0.5f);
        else
            depth.fill(static_cast<std::uint16_t>(key(0.5f)));
        Bench bench(width, height, {&color}, &depth,
                    {.lanes = static_cast<std::uint32_t>(lanes),
                     .options = {.instruction_set = static_cast<std::uint32_t>(instruction_set),
                                 .hierarchical_depth = hierarchical}});
        bench.use<TestShader::primitive_id>(1);
        bench.pipeline.depth_stencil.depth_test = true;
        bench.pipeline.depth_stencil.depth_write = at.writes;
        bench.pipeline.depth_stencil.depth_compare = at.compare;
        bench.state.scissor = at.scissor;
        std::vector<TestVertex> vertices;
        std::uint64_t expected_passed = 0;
        for (std::uint32_t triangle = 0; triangle < 2500; ++triangle) {
            // Most in a corner, many upon each other; every seventh crosses more than two blocks.
            const int extent = (triangle % 7 == 0 ? 20 : 1 + static_cast<int>(random() % 8)) * 256;
            const std::uint32_t part = triangle % 2 ? 1 : 3;
            const Point origin{static_cast<int>(random() % (width * 256 / part)),
                               static_cast<int>(random() % (height * 256 / part))};
            Point corners[3];
            const float z = static_cast<float>(random() % 9) / 8.0f;
            for (Point& corner : corners) {
                corner = {origin.x + static_cast<int>(random() % static_cast<std::uint32_t>(extent)),
                          origin.y + static_cast<int>(random() % static_cast<std::uint32_t>(extent))};
                if (triangle % 3 == 0) corner = {(corner.x & ~255) + 128, (corner.y & ~255) + 128};
                // What the vertex transform makes of it is not exact for these sizes: it is rounded to the same place.
                vertices.push_back(at_window(static_cast<double>(corner.x) / 256, static_cast<double>(corner.y) / 256,
                                             width, height, z));
            }
            const rhi::Rectangle& view = at.scissor;
            for (std::int64_t y = origin.y / 256; y <= (origin.y + extent) / 256 + 1; ++y)
                for (std::int64_t x = origin.x / 256; x <= (origin.x + extent) / 256 + 1; ++x) {
                    if (x < view.x || y < view.y || x >= view.x + std::int64_t{view.width} ||
                        y >= view.y + std::int64_t{view.height} ||
                        !covers(corners[0], corners[1], corners[2], {x * 256 + 128, y * 256 + 128}))
                        continue;
                    const std::size_t pixel = static_cast<std::size_t>(y * width + x);
                    if (!passes(at.compare, key(z), depths[pixel])) continue;
                    ++expected_passed;
                    ids[pixel] = triangle + 1;
                    if (at.writes) depths[pixel] = key(z);
                }
        }
        bench.draw(vertices);
        EXPECT_EQ(bench.passed(), expected_passed) << static_cast<int>(at.compare);
        bench.end();
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const std::size_t pixel = std::size_t{y} * width + x;
                ASSERT_EQ(color.at<std::uint32_t>(x, y), ids[pixel])
                    << static_cast<int>(at.compare) << ": " << x << ", " << y;
                ASSERT_EQ(is_float ? depth.at<std::int32_t>(x, y) : depth.at<std::uint16_t>(x, y), depths[pixel])
                    << static_cast<int>(at.compare) << ": " << x << ", " << y;
            }
        EXPECT_TRUE(color.margins_are_whole() && depth.margins_are_whole());
    }
}

/// What waits for the fragment function, quads in one place and whole blocks in another, still knows its triangle when
/// many others have been drawn.
TEST(WholeBlocks, KeepTheirTriangleWhileOthersAreDrawn) {
    constexpr std::uint32_t others = 300;
    for (const std::uint32_t lanes : {8u, 16u})
        for (const bool whole_waits : {false, true}) {
            TestImage color(Format::r32_uint, width, height);
            Bench bench(width, height, {&color}, nullptr, {.lanes = lanes});
            bench.use<TestShader::primitive_id>(1);
            // Two blocks: pixels of the left one are covered one by one, all of the right one at once.
            bench.state.scissor = {0, 0, 8, 4};
            std::vector<TestVertex> vertices;
            for (std::uint32_t triangle = 0; triangle <= others; ++triangle) {
                const bool is_whole = (triangle == 0) == whole_waits;
                const double pixel[3][2] = {{1.0, 1.0}, {2.5, 1.0}, {1.0, 2.5}};
                const double half[3][2] = {{4.0, -400.0}, {400.0, 0.0}, {4.0, 400.0}};
                for (const auto& corner : is_whole ? half : pixel)
                    vertices.push_back(at_window(corner[0], corner[1], width, height));
            }
            bench.draw(vertices);
            bench.end();
            for (std::uint32_t y = 0; y < 4; ++y)
                for (std::uint32_t x = 0; x < 8; ++x) {
                    const bool is_pixel = x == 1 && y == 1;
                    if (x < 4 && !is_pixel) continue;
                    const std::uint32_t expected = (x >= 4) == whole_waits ? 1 : others + 1;
                    ASSERT_EQ(color.at<std::uint32_t>(x, y), expected)
                        << lanes << whole_waits << ": " << x << ", " << y;
                }
        }
}

/// A texel of some bytes that are all different.
std::array<std::byte, 16> texel_of(std::uint32_t seed) {
    std::array<std::byte, 16> texel;
    for (std::size_t i = 0; i < texel.size(); ++i) texel[i] = static_cast<std::byte>(seed + 17 * i + 1);
    return texel;
}

TEST(Clears, FillWhatIsNotDrawn) {
    for (const std::uint32_t samples : {1u, 4u})
        for (const Format format : {Format::r8_uint, Format::rg8_uint, Format::r32_uint, Format::rg32_uint,
                                    Format::rgba16_uint, Format::rgba32_uint})
            for (const Format depth_format : {Format::d16_unorm, Format::d24_unorm_s8_uint, Format::d32_float})
                for (const int how : {0, 1, 2, 3}) {
                    // 0: no draw; 1: a triangle; 2: in two parts; 3: the first part of them tests no depth.
                    TestImage color(format, width, height, samples), other(format, width, height, samples),
                        depth(depth_format, width, height, samples);
                    TestImage* const images[] = {&color, &other, &depth};
                    for (TestImage* image : images) image->fill(std::uint8_t{0xcc});
                    depth.fill_stencil(0xcc);
                    const auto clear = texel_of(how);
                    const std::uint32_t bytes = rhi::info(format).block_bytes;
                    // Depths of at most 1.
                    const float clear_depth = 0.25f;
                    const std::uint32_t depth_bits = depth_format == Format::d16_unorm ? 16384
                                                     : depth_format == Format::d24_unorm_s8_uint
                                                         ? 4194304
                                                         : std::bit_cast<std::uint32_t>(clear_depth);
                    Bench bench(width, height, {&color, &other}, &depth, {.threads = 2}, samples);
                    cpu::RenderTargets& targets = bench.targets();
                    targets.color_clears = {clear, std::nullopt};
                    targets.depth_clear.emplace();
                    std::memcpy(targets.depth_clear->data(), &depth_bits, 4);
                    targets.stencil_clear = std::uint8_t{0x5a};
                    bench.begin();
                    bench.use<TestShader::primitive_id>(2);
                    bench.pipeline.depth_stencil.depth_test = true;
                    bench.pipeline.depth_stencil.depth_write = true;
                    bench.pipeline.depth_stencil.depth_compare = CompareOperation::greater;
                    const Point corners[3] = {{70 * 256, 10 * 256}, {110 * 256, 30 * 256}, {66 * 256, 90 * 256}};
                    std::vector<TestVertex> vertices;
                    for (const Point& corner : corners)
                        vertices.push_back(at_window(static_cast<double>(corner.x) / 256,
                                                     static_cast<double>(corner.y) / 256, width, height, 0.5f));
                    if (how == 3) bench.pipeline.depth_stencil.depth_test = false;
                    if (how != 0) bench.draw(vertices);
                    if (how >= 2) {
                        const std::uint64_t passed = bench.passed();
                        EXPECT_GT(passed, 0u);
                        bench.pipeline.depth_stencil.depth_test = true;
                        bench.pipeline.depth_stencil.depth_compare = CompareOperation::greater_or_equal;
                        bench.draw(vertices);
                        EXPECT_EQ(bench.passed(), 2 * passed);
                    }
                    bench.end();
                    std::size_t drawn = 0, kept = 0;
                    for (std::uint32_t sample = 0; sample < samples; ++sample)
                        for (std::uint32_t y = 0; y < height; ++y)
                            for (std::uint32_t x = 0; x < width; ++x) {
                                const Point place{x * 256 + (samples == 1 ? 128 : sample_x[sample]),
                                                  y * 256 + (samples == 1 ? 128 : sample_y[sample])};
                                const bool is_drawn = how != 0 && covers(corners[0], corners[1], corners[2], place);
                                drawn += is_drawn;
                                const auto* const texel =
                                    reinterpret_cast<const std::byte*>(&color.at<std::uint8_t>(x, y, sample));
                                const bool is_clear = std::memcmp(texel, clear.data(), bytes) == 0;
                                ASSERT_NE(is_clear, is_drawn)
                                    << rhi::info(format).name << how << ": " << x << ", " << y;
                                // A target that is not cleared and not written stays as it is.
                                kept += other.at<std::uint8_t>(x, y, sample) == 0xcc;
                                const std::uint32_t bits = depth_format == Format::d16_unorm
                                                               ? depth.at<std::uint16_t>(x, y, sample)
                                                               : depth.at<std::uint32_t>(x, y, sample);
                                ASSERT_EQ(bits != depth_bits, is_drawn) << how << ": " << x << ", " << y;
                                if (rhi::info(depth_format).has_stencil) {
                                    ASSERT_EQ(depth.stencil(x, y, sample), 0x5a) << x << ", " << y;
                                }
                            }
                    EXPECT_EQ(kept, std::size_t{width} * height * samples);
                    EXPECT_EQ(drawn > 500, how != 0);
                    for (const TestImage* image : images) EXPECT_TRUE(image->margins_are_whole());
                }
}

TEST(Clears, FillWhatSmallTrianglesLeaveOfTheBlocksOfLargeOnes) {
    constexpr std::uint32_t side = 64, none = 12345;
    // A large one that leaves the upper left block and covers others of its region as a whole or in part, and one in
    // that block.
    const Point large[3] = {{64 * 256, -40 * 256}, {64 * 256, 64 * 256}, {-40 * 256, 64 * 256}};
    const Point small[3] = {{256, 256}, {3 * 256, 256}, {256, 3 * 256}};
    const auto texel = [](std::uint32_t value) {
        std::array<std::byte, 16> bytes{};
        std::memcpy(bytes.data(), &value, sizeof(value));
        return bytes;
    };
    for (const std::uint32_t lanes : {4u, 8u, 16u})
        for (const std::uint32_t instruction_set : {0u, 1u, 2u})
            for (const bool small_first : {false, true})
                for (const bool draws_twice : {false, true}) {
                    TestImage color(Format::r32_uint, side, side), depth(Format::d32_float, side, side);
                    Bench bench(side, side, {&color}, &depth,
                                {.lanes = lanes, .options = {.instruction_set = instruction_set}});
                    bench.targets().color_clears = {texel(none)};
                    bench.targets().depth_clear.emplace();
                    bench.begin();
                    bench.use<TestShader::primitive_id>(1);
                    bench.pipeline.depth_stencil.depth_test = true;
                    bench.pipeline.depth_stencil.depth_write = true;
                    bench.pipeline.depth_stencil.depth_compare = CompareOperation::greater;
                    std::vector<TestVertex> vertices;
                    for (const bool is_small : {small_first, !small_first}) {
                        for (const Point& corner : is_small ? small : large)
                            vertices.push_back(at_window(static_cast<double>(corner.x) / 256,
                                                         static_cast<double>(corner.y) / 256, side, side));
                        if (!draws_twice) continue;
                        bench.draw(vertices);
                        vertices.clear();
                    }
                    if (!draws_twice) bench.draw(vertices);
                    bench.end();
                    std::size_t of_large = 0, of_small = 0;
                    for (std::uint32_t y = 0; y < side; ++y)
                        for (std::uint32_t x = 0; x < side; ++x) {
                            const Point place{x * 256 + 128, y * 256 + 128};
                            const bool in_small = covers(small[0], small[1], small[2], place);
                            const bool in_large = covers(large[0], large[1], large[2], place);
                            of_small += in_small, of_large += in_large;
                            const std::uint32_t expected = !in_small && !in_large                     ? none
                                                           : !draws_twice && in_small == !small_first ? 2
                                                                                                      : 1;
                            ASSERT_EQ(color.at<std::uint32_t>(x, y), expected)
                                << lanes << instruction_set << small_first << draws_twice << ": " << x << ", " << y;
                        }
                    ASSERT_TRUE(of_small != 0 && of_large > 1000);
                }
}

TEST(Clears, LargeTargetsHoldWhatIsDrawnAndFilled) {
    // Larger than what caches keep: another way to memory, if rows are aligned.
    const struct {
        Format format;
        std::uint32_t width, height;
    } cases[] = {{Format::r32_uint, 2048, 2100},
                 {Format::r32_uint, 2051, 2063},
                 {Format::rg32_uint, 1502, 1500},
                 {Format::rgba32_uint, 1100, 1001},
                 {Format::r8_uint, 5000, 4000}};
    for (const auto& at : cases) {
        TestImage color(at.format, at.width, at.height);
        color.fill(std::uint8_t{0xcc});
        Bench bench(at.width, at.height, {&color}, nullptr, {.threads = 2});
        const auto clear = texel_of(3);
        bench.targets().color_clears = {clear};
        bench.begin();
        bench.use<TestShader::primitive_id>(4);
        // Triangles of all sizes; their numbers, less one, in turn.
        std::vector<TestVertex> vertices;
        std::vector<Point> corners;
        std::mt19937 random(5);
        for (int i = 0; i < 60; ++i)
            for (int corner = 0; corner < 3; ++corner) {
                const auto size = static_cast<std::uint32_t>(i % 3 == 0 ? 40 : 900);
                corners.push_back(
                    {static_cast<std::int64_t>((static_cast<std::uint32_t>(i) * 29 + random() % size) * 256),
                     static_cast<std::int64_t>((static_cast<std::uint32_t>(i) * 17 + random() % size) * 256)});
                vertices.push_back(at_window(static_cast<double>(corners.back().x) / 256,
                                             static_cast<double>(corners.back().y) / 256, at.width, at.height));
            }
        bench.draw(vertices);
        bench.end();
        std::vector<std::uint8_t> ids(std::size_t{at.width} * at.height, 0);
        for (std::size_t i = 0; i < corners.size(); i += 3) {
            const auto [low_x, high_x] = std::minmax({corners[i].x, corners[i + 1].x, corners[i + 2].x});
            const auto [low_y, high_y] = std::minmax({corners[i].y, corners[i + 1].y, corners[i + 2].y});
            for (std::int64_t y = low_y / 256; y < std::min<std::int64_t>(high_y / 256 + 1, at.height); ++y)
                for (std::int64_t x = low_x / 256; x < std::min<std::int64_t>(high_x / 256 + 1, at.width); ++x)
                    if (covers(corners[i], corners[i + 1], corners[i + 2], {x * 256 + 128, y * 256 + 128}))
                        ids[static_cast<std::size_t>(y) * at.width + static_cast<std::size_t>(x)] =
                            static_cast<std::uint8_t>(i / 3 + 1);
        }
        const std::uint32_t bytes = rhi::info(at.format).block_bytes;
        for (std::uint32_t y = 0; y < at.height; ++y)
            for (std::uint32_t x = 0; x < at.width; ++x) {
                const std::uint8_t id = ids[std::size_t{y} * at.width + x];
                const std::uint8_t* const texel = &color.at<std::uint8_t>(x, y);
                if (id == 0) {
                    ASSERT_EQ(std::memcmp(texel, clear.data(), bytes), 0)
                        << rhi::info(at.format).name << x << ", " << y;
                } else {
                    ASSERT_EQ(*texel, id) << rhi::info(at.format).name << ": " << x << ", " << y;
                }
            }
        EXPECT_TRUE(color.margins_are_whole());
    }
}

}  // namespace
}  // namespace nacre::test
