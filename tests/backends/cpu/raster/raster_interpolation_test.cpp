// SPDX-License-Identifier: Apache-2.0
// Values inside of triangles, clipped or not, against double precision.
#include "tests/backends/cpu/raster/raster_bench.h"

namespace nacre::test {
namespace {

using rhi::Format;
using cpu::Interpolation;

constexpr std::uint32_t width = 128, height = 128;

struct Texel4 {
    float v[4];
};

/// Weights of the three vertices at a place in clip space (x / w, y / w), in double: the exact answer for triangles behind the eye too.
struct Exact {
    double weights[3];  ///< Perspective weights, sum 1.
    double inverse_w, depth;
    bool inside;
};
Exact exact_at(const TestVertex* vertices, double pixel_x, double pixel_y) {
    const double x = pixel_x / (width * 0.5) - 1.0, y = pixel_y / (height * 0.5) - 1.0;
    double m[3][3];
    for (int i = 0; i < 3; ++i) m[i][0] = vertices[i].position[0], m[i][1] = vertices[i].position[1], m[i][2] = vertices[i].position[3];
    const auto minor = [&](int i, int j) {
        const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
        return m[a][c] * m[b][d] - m[a][d] * m[b][c];
    };
    const double determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
    Exact exact{};
    double sum = 0.0;
    for (int i = 0; i < 3; ++i) {
        exact.weights[i] = (x * minor(i, 0) + y * minor(i, 1) + minor(i, 2)) / determinant;
        sum += exact.weights[i];
    }
    exact.inverse_w = sum;
    exact.inside = sum > 0.0;
    for (int i = 0; i < 3; ++i) {
        exact.inside = exact.inside && exact.weights[i] > 0.0;
        exact.depth += exact.weights[i] * vertices[i].position[2];
        exact.weights[i] /= sum;
    }
    return exact;
}
/// Distance in pixels to the nearest edge where the lines are in front of the eye; small where it matters.
bool near_edge(const TestVertex* vertices, double x, double y) {
    for (const double dx : {-0.02, 0.02})
        for (const double dy : {-0.02, 0.02})
            if (exact_at(vertices, x + dx, y + dy).inside != exact_at(vertices, x, y).inside) return true;
    return false;
}

std::vector<TestVertex> random_triangle(std::mt19937& random, bool behind) {
    std::uniform_real_distribution<float> unit(-1.0f, 1.0f);
    std::vector<TestVertex> vertices(3);
    for (TestVertex& vertex : vertices) {
        const float w = behind ? unit(random) * 2.0f + 0.5f : 1.0f + 0.9f * unit(random);
        vertex.position[0] = unit(random) * 1.5f * std::max(std::abs(w), 0.3f);
        vertex.position[1] = unit(random) * 1.5f * std::max(std::abs(w), 0.3f);
        vertex.position[2] = (behind ? unit(random) : 0.5f + 0.45f * unit(random)) * std::abs(w);
        vertex.position[3] = w;
        for (float& value : vertex.values) value = unit(random);
    }
    return vertices;
}

TEST(Interpolation, PlanesAreThoseOfDoublePrecision) {
    std::mt19937 random(5);
    for (int round = 0; round < 100; ++round) {
        const auto vertices = random_triangle(random, false);
        TestImage values(Format::rgba32_float, width, height), places(Format::rgba32_float, width, height);
        for (const bool of_values : {true, false}) {
            TestImage& image = of_values ? values : places;
            image.fill(-100.0f);
            Bench bench(width, height, {&image});
            if (of_values)
                bench.use<TestShader::values>();
            else
                bench.use<TestShader::position>();
            bench.draw(vertices);
            bench.end();
        }
        // Weights of window coordinates, for inputs that are linear on the screen.
        double window[3][2];
        for (int i = 0; i < 3; ++i)
            for (int axis = 0; axis < 2; ++axis)
                window[i][axis] = (vertices[i].position[axis] / static_cast<double>(vertices[i].position[3]) + 1.0) * 64.0;
        const double area = (window[1][0] - window[0][0]) * (window[2][1] - window[0][1]) -
                            (window[2][0] - window[0][0]) * (window[1][1] - window[0][1]);
        // Slivers lose digits in proportion to their thinness.
        const double scale = std::max(1.0, 500.0 / std::abs(area));
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const Texel4 value = values.at<Texel4>(x, y), place = places.at<Texel4>(x, y);
                const double px = x + 0.5, py = y + 0.5;
                const Exact exact = exact_at(vertices.data(), px, py);
                const bool in_depth = exact.depth >= 0.0 && exact.depth <= 1.0;
                if (!near_edge(vertices.data(), px, py)) {
                    ASSERT_EQ(value.v[0] != -100.0f, exact.inside && in_depth) << round << ": " << x << ", " << y;
                }
                if (value.v[0] == -100.0f || !exact.inside) continue;
                double perspective[2] = {}, linear = 0.0;
                double weights[3];
                weights[1] = ((px - window[0][0]) * (window[2][1] - window[0][1]) - (window[2][0] - window[0][0]) * (py - window[0][1])) / area;
                weights[2] = ((window[1][0] - window[0][0]) * (py - window[0][1]) - (px - window[0][0]) * (window[1][1] - window[0][1])) / area;
                weights[0] = 1.0 - weights[1] - weights[2];
                for (int i = 0; i < 3; ++i) {
                    perspective[0] += exact.weights[i] * vertices[i].values[0];
                    perspective[1] += exact.weights[i] * vertices[i].values[1];
                    linear += weights[i] * vertices[i].values[2];
                }
                ASSERT_NEAR(value.v[0], perspective[0], 2e-5 * scale) << round;
                ASSERT_NEAR(value.v[1], perspective[1], 2e-5 * scale) << round;
                ASSERT_NEAR(value.v[2], linear, 2e-5 * scale) << round;
                ASSERT_EQ(value.v[3], vertices[0].values[3]);
                ASSERT_EQ(place.v[0], px);
                ASSERT_EQ(place.v[1], py);
                ASSERT_NEAR(place.v[2], exact.depth, 2e-6 * scale) << round;
                ASSERT_NEAR(place.v[3], exact.inverse_w, 2e-5 * scale) << round;
            }
    }
}

TEST(Interpolation, ClippedTrianglesAreThoseOfDoublePrecision) {
    std::mt19937 random(6);
    std::size_t covered = 0;
    for (int round = 0; round < 150; ++round) {
        auto vertices = random_triangle(random, true);
        if (round % 3 == 1)
            for (TestVertex& vertex : vertices) vertex.position[0] *= 1e4f, vertex.position[1] *= 3e3f;
        if (round % 3 == 2) vertices[round % 2].position[0] = (round % 4 < 2 ? 1e30f : -1e30f);
        TestImage image(Format::rgba32_float, width, height);
        image.fill(-100.0f);
        Bench bench(width, height, {&image});
        bench.use<TestShader::position>();
        bench.draw(vertices);
        bench.end();
        EXPECT_TRUE(image.margins_are_whole());
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x) {
                const Texel4 place = image.at<Texel4>(x, y);
                const double px = x + 0.5, py = y + 0.5;
                const Exact exact = exact_at(vertices.data(), px, py);
                // Steep depths may pass the near or far plane within the rounding of corners.
                const Exact beside[2] = {exact_at(vertices.data(), px + 0.03, py + 0.03), exact_at(vertices.data(), px - 0.03, py - 0.03)};
                const auto in_depth = [](const Exact& at) { return at.depth >= 0.0 && at.depth <= 1.0; };
                if (near_edge(vertices.data(), px, py) || in_depth(beside[0]) != in_depth(exact) || in_depth(beside[1]) != in_depth(exact))
                    continue;
                ASSERT_EQ(place.v[0] != -100.0f, exact.inside && in_depth(exact)) << round << ": " << x << ", " << y;
                if (place.v[0] == -100.0f) continue;
                ++covered;
                const double slope = std::abs(beside[0].depth - beside[1].depth);
                ASSERT_NEAR(place.v[2], exact.depth, 1e-5 + 1e-4 * slope) << round;
                ASSERT_NEAR(place.v[3], exact.inverse_w, 1e-5 * std::max(1.0, std::abs(exact.inverse_w) * 100)) << round;
            }
    }
    EXPECT_GT(covered, 40'000u);
}

TEST(Interpolation, UserClipDistancesCutTriangles) {
    // The distance is positive left of x = 40 and above y = 96, for two of them.
    std::vector<TestVertex> vertices = {at_window(0, 0, width, height), at_window(256, 0, width, height),
                                        at_window(0, 256, width, height)};
    const double corners[3][2] = {{0, 0}, {256, 0}, {0, 256}};
    for (int i = 0; i < 3; ++i) {
        vertices[i].clip_distances[0] = static_cast<float>(40.0 - corners[i][0]);
        vertices[i].clip_distances[1] = static_cast<float>(96.0 - corners[i][1]);
    }
    for (const std::uint32_t distances : {0u, 1u, 2u}) {
        TestImage image(Format::r32_uint, width, height);
        Bench bench(width, height, {&image});
        bench.pipeline.vertex.clip_distances = distances;
        bench.use<TestShader::primitive_id>(1);
        bench.draw(vertices);
        bench.end();
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                ASSERT_EQ(image.at<std::uint32_t>(x, y), ((distances < 1 || x < 40) && (distances < 2 || y < 96)) ? 1u : 0u)
                    << distances << ": " << x << ", " << y;
    }
}

TEST(Interpolation, CullDistancesDropTrianglesThatAreOutsideAsAWhole) {
    for (const int negative : {0, 1, 2, 3}) {
        std::vector<TestVertex> vertices = {at_window(0, 0, width, height), at_window(256, 0, width, height),
                                            at_window(0, 256, width, height)};
        for (int i = 0; i < 3; ++i) vertices[i].cull_distance = i < negative ? -1.0f : 1.0f;
        TestImage image(Format::r32_uint, width, height);
        Bench bench(width, height, {&image});
        bench.pipeline.vertex.clip_distances = 2;
        bench.pipeline.vertex.cull_distances = 1;
        bench.use<TestShader::primitive_id>(1);
        bench.draw(vertices);
        bench.end();
        EXPECT_EQ(image.at<std::uint32_t>(64, 64), negative == 3 ? 0u : 1u);
    }
}

TEST(Interpolation, SecondPassFindsEqualDepths) {
    // A depth prepass and a second pass with another pipeline: planes, clip distances, lane counts and instruction sets differ.
    std::mt19937 random(8);
    for (const Format format : {Format::d32_float, Format::d24_unorm_s8_uint, Format::d16_unorm}) {
        for (int round = 0; round < 30; ++round) {
            std::vector<TestVertex> vertices;
            for (int i = 0; i < 10; ++i)
                for (const TestVertex& vertex : random_triangle(random, round % 2 == 1)) vertices.push_back(vertex);
            for (TestVertex& vertex : vertices) vertex.clip_distances[0] = 1.0f;
            TestImage depth(format, width, height), color(Format::r32_float, width, height);
            if (format == Format::d32_float)
                depth.fill(1.0f);
            else if (format == Format::d16_unorm)
                depth.fill(std::uint16_t{0xffff});
            else
                depth.fill(0xffffffu);
            std::uint64_t passed = 0;
            {
                Bench bench(width, height, {}, &depth, {.lanes = 4, .options = {.instruction_set = 0}});
                bench.pipeline.depth_stencil.depth_test = bench.pipeline.depth_stencil.depth_write = true;
                bench.pipeline.depth_stencil.depth_compare = rhi::CompareOperation::less;
                bench.draw(vertices);
                passed = bench.passed();
                bench.end();
            }
            std::size_t written = 0;
            const std::vector<std::byte> before = depth.content();
            {
                Bench bench(width, height, {&color}, &depth, {.lanes = 16, .threads = 2});
                bench.pipeline.depth_stencil.depth_test = true;
                bench.pipeline.depth_stencil.depth_compare = rhi::CompareOperation::equal;
                bench.pipeline.vertex.clip_distances = 1;
                bench.use<TestShader::constant>();
                if (round % 3 == 0) bench.pipeline.fragment.discards = true;  // Late tests.
                bench.draw(vertices);
                bench.end();
            }
            EXPECT_EQ(depth.content(), before);
            std::size_t touched = 0;
            for (std::uint32_t y = 0; y < height; ++y)
                for (std::uint32_t x = 0; x < width; ++x) {
                    const bool is_far = format == Format::d32_float   ? depth.at<float>(x, y) == 1.0f
                                        : format == Format::d16_unorm ? depth.at<std::uint16_t>(x, y) == 0xffff
                                                                      : depth.at<std::uint32_t>(x, y) == 0xffffff;
                    touched += !is_far;
                    written += color.at<float>(x, y) != 0.0f;
                    if (!is_far) {
                        ASSERT_EQ(color.at<float>(x, y), 1.0f) << round << ": " << x << ", " << y;
                    }
                }
            EXPECT_GE(written, touched);
            EXPECT_GE(passed, touched);
        }
    }
}

TEST(Interpolation, ViewportMovesScalesAndCuts) {
    TestImage image(Format::rgba32_float, width, height);
    Bench bench(width, height, {&image});
    bench.use<TestShader::position>();
    bench.state.viewport = {16, 32, 64, 32, 0.25f, 0.75f};
    bench.state.scissor = {20, 0, 100, 60};
    // Far larger than the viewport: clipped to it by the rules of the clip volume.
    std::vector<TestVertex> vertices(3);
    const float corners[3][2] = {{-3, -3}, {9, -3}, {-3, 9}};
    for (int i = 0; i < 3; ++i) {
        vertices[i].position[0] = corners[i][0], vertices[i].position[1] = corners[i][1];
        vertices[i].position[2] = 0.5f;
    }
    bench.draw(vertices);
    bench.end();
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const bool inside = x >= 20 && x < 80 && y >= 32 && y < 60;
            ASSERT_EQ(image.at<Texel4>(x, y).v[0] != 0.0f, inside) << x << ", " << y;
            if (inside) {
                ASSERT_EQ(image.at<Texel4>(x, y).v[2], 0.5f);
            }
        }
}

TEST(Interpolation, DepthClampKeepsWhatNearAndFarWouldCut) {
    TestImage depth(Format::d32_float, width, height);
    for (const bool clamps : {false, true}) {
        depth.fill(0.5f);
        Bench bench(width, height, {}, &depth);
        bench.pipeline.depth_stencil.depth_test = bench.pipeline.depth_stencil.depth_write = true;
        bench.pipeline.depth_stencil.depth_compare = rhi::CompareOperation::always;
        bench.pipeline.depth_stencil.depth_clamp = clamps;
        // Depth runs from -1 at x = 0 to 2 at x = 128, without perspective.
        std::vector<TestVertex> vertices = {at_window(0, 0, width, height, -1.0f), at_window(256, 0, width, height, 5.0f),
                                            at_window(0, 256, width, height, -1.0f)};
        bench.draw(vertices);
        bench.end();
        for (std::uint32_t x = 0; x < width; ++x) {
            const double exact = -1.0 + (x + 0.5) * 6.0 / 256.0;
            const bool cut = exact < 0.0 || exact > 1.0;
            const double expected = cut && !clamps ? 0.5 : std::clamp(exact, 0.0, 1.0);
            ASSERT_NEAR(depth.at<float>(x, 10), expected, 1e-6) << x;
        }
    }
}

TEST(Interpolation, DepthBiasIsThatOfTheSpecification) {
    for (const Format format : {Format::d32_float, Format::d24_unorm_s8_uint, Format::d16_unorm})
        for (const float clamp : {0.0f, 0.01f, -0.01f})
            for (const float constant : {0.0f, 100.0f, -100.0f})
                for (const float slope : {0.0f, 2.0f, -2.0f}) {
                    TestImage depth(format, width, height);
                    Bench bench(width, height, {}, &depth);
                    auto& state = bench.pipeline.depth_stencil;
                    state.depth_test = state.depth_write = true;
                    state.depth_compare = rhi::CompareOperation::always;
                    state.depth_bias = constant, state.depth_bias_slope = slope, state.depth_bias_clamp = clamp;
                    // 0.25 to 0.75 over 128 pixels: the largest depth of the triangle is 1.25, with an exponent of 0.
                    std::vector<TestVertex> vertices = {at_window(0, 0, width, height, 0.25f), at_window(128, 0, width, height, 0.75f),
                                                        at_window(0, 128, width, height, 0.25f)};
                    bench.draw(vertices);
                    bench.end();
                    const double unit = format == Format::d16_unorm   ? 0x1p-16
                                        : format == Format::d32_float ? 0x1p-24  // 2^(-1 - 23): 0.75 is 1.5 * 2^-1.
                                                                      : 0x1p-24;
                    double bias = constant * unit + slope * 0.5 / 128.0;
                    if (clamp > 0) bias = std::min<double>(bias, clamp);
                    if (clamp < 0) bias = std::max<double>(bias, clamp);
                    const double expected = 0.25 + 20.5 * 0.5 / 128.0 + bias;
                    const double got = format == Format::d32_float   ? depth.at<float>(20, 20)
                                       : format == Format::d16_unorm ? depth.at<std::uint16_t>(20, 20) / 65535.0
                                                                     : depth.at<std::uint32_t>(20, 20) / 16777215.0;
                    EXPECT_NEAR(got, expected, format == Format::d16_unorm ? 1e-5 : 2e-7);
                }
}

}  // namespace
}  // namespace nacre::test
