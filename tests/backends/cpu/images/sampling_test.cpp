// SPDX-License-Identifier: Apache-2.0
// Filtered reads against the equations of the Vulkan specification in double precision.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "tests/backends/cpu/images/reference_sampler.h"

namespace nacre::cpu::test {
namespace {

using rhi::Format;
using rhi::ViewDimension;

struct Shape {
    const char* name;
    ViewDimension dimension;
    std::uint32_t width, height, depth, layers;
};
constexpr Shape shapes[] = {
    {"d1", ViewDimension::d1, 37, 1, 1, 1},
    {"d1_array", ViewDimension::d1_array, 33, 1, 1, 5},
    {"d2", ViewDimension::d2, 64, 48, 1, 1},
    {"d2_odd", ViewDimension::d2, 37, 23, 1, 1},
    {"d2_array", ViewDimension::d2_array, 20, 31, 1, 4},
    {"d3", ViewDimension::d3, 13, 9, 7, 1},
    {"cube", ViewDimension::cube, 16, 16, 1, 6},
    {"cube_array", ViewDimension::cube_array, 9, 9, 1, 12},
    {"single_texel", ViewDimension::d2, 1, 1, 1, 1},
    {"single_texel_cube", ViewDimension::cube, 1, 1, 1, 6},
};

bool has_layers(const Shape& shape) {
    using enum ViewDimension;
    return shape.dimension == d1_array || shape.dimension == d2_array || shape.dimension == cube_array;
}

class Sampling : public testing::TestWithParam<Shape> {
  protected:
    // Quads whose corners lie up to a few texels apart, anywhere in and around the image.
    std::vector<Point> random_quads(std::size_t count) {
        const Shape& shape = GetParam();
        const int axes = static_cast<int>(coordinate_count(shape.dimension)) - (has_layers(shape) ? 1 : 0);
        std::vector<Point> points(4 * count);
        for (std::size_t quad = 0; quad < count; ++quad) {
            const float spread = std::exp2(random_float(random, -9.0f, -1.0f));
            float base[3], dx[3], dy[3];
            for (int axis = 0; axis < 3; ++axis) {
                base[axis] = is_cube(shape.dimension) ? random_float(random, -1, 1) : random_float(random, -1.6f, 2.7f);
                dx[axis] = spread * random_float(random, -1, 1), dy[axis] = spread * random_float(random, -1, 1);
            }
            const float layer =
                random_float(random, -1.0f, static_cast<float>(shape.layers / (is_cube(shape.dimension) ? 6 : 1)));
            for (std::uint32_t i = 0; i < 4; ++i) {
                Point& point = points[4 * quad + i];
                for (int axis = 0; axis < axes; ++axis) {
                    const float value =
                        base[axis] + ((i & 1) != 0 ? dx[axis] : 0.0f) + ((i & 2) != 0 ? dy[axis] : 0.0f);
                    point.coordinates[axis] = std::bit_cast<std::uint32_t>(value);
                    point.gradient_x[axis] = dx[axis] * random_float(random, 0.5f, 2.0f);
                    point.gradient_y[axis] = dy[axis] * random_float(random, 0.5f, 2.0f);
                    point.offset[axis] = static_cast<std::int32_t>(random_below(random, 16)) - 8;
                }
                if (axes < 4) point.coordinates[axes] = std::bit_cast<std::uint32_t>(layer);
                point.lod = random_float(random, -1.0f, 4.0f);
                point.reference = random_float(random, -0.1f, 1.1f);
                point.min_lod = random_float(random, 0.0f, 3.0f);
            }
        }
        return points;
    }

    rhi::SamplerDesc random_sampler() {
        rhi::SamplerDesc desc;
        const auto filter = [&] { return static_cast<rhi::Filter>(random_below(random, 2)); };
        const auto mode = [&] { return static_cast<rhi::AddressMode>(random_below(random, 4)); };
        desc.magnify = filter(), desc.minify = filter(), desc.mip = filter();
        desc.address_u = mode(), desc.address_v = mode(), desc.address_w = mode();
        desc.border = static_cast<rhi::BorderColor>(random_below(random, 3));
        desc.compare = static_cast<rhi::CompareOperation>(random_below(random, 8));
        if (random_below(random, 3) == 0) desc.mip_bias = random_float(random, -1.0f, 1.0f);
        if (random_below(random, 3) == 0) desc.min_lod = random_float(random, 0.0f, 1.5f);
        if (random_below(random, 3) == 0) desc.max_lod = random_float(random, 1.5f, 3.0f);
        return desc;
    }

    // All points against the reference. Allowed: `tolerance` times the largest texel, plus 3e-5 levels of detail, which
    // is what rounding the coordinates of a quad leaves of the differences between them.
    void check(Format format, const rhi::SamplerDesc& desc, std::uint32_t flags, double tolerance,
               bool is_query = false) {
        const Shape& shape = GetParam();
        const std::uint32_t mips = std::min(4u, rhi::full_mip_count(shape.width, shape.height, shape.depth));
        const TestImage image({format, shape.dimension, shape.width, shape.height, shape.depth, shape.layers, mips},
                              random);
        const SamplerState sampler{desc};
        const std::vector<Point> points = random_quads(100);
        const bool is_integer = rhi::info(format).is_integer();
        if (is_integer) flags |= image_integer;
        const auto results = run_points(image_function(16), 16, &image.view, &sampler, {.flags = flags}, points);
        ReferenceSampler reference(image, desc);
        std::size_t ambiguous = 0;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const auto quad = std::span(points).subspan(i & ~std::size_t{3}).first<4>();
            const ReferenceResult expected =
                is_query ? reference.query(flags, quad, i & 3) : reference.sample(flags, quad, i & 3);
            if (expected.is_ambiguous) {
                ++ambiguous;
                continue;
            }
            for (int c = 0; c < 4; ++c) {
                if (is_integer) {
                    const auto bits = static_cast<std::uint32_t>(static_cast<std::int64_t>(expected.value[c]));
                    ASSERT_EQ(results[i][c], bits) << "point " << i << " channel " << c;
                } else {
                    ASSERT_NEAR(std::bit_cast<float>(results[i][c]), expected.value[c], tolerance)
                        << "point " << i << " channel " << c;
                }
            }
        }
        // Most points must count.
        ASSERT_LT(ambiguous, points.size() / 4);
    }

    Random random{11};
};

// Patches of eight by two pixels, from far below a texel of the face apart to several of them: all lanes find their
// texels in a few, or not.
TEST(MagnifiedCube, IsFilteredLaneByLane) {
    Random random{17};
    const SamplerState sampler{{.magnify = rhi::Filter::linear, .minify = rhi::Filter::linear}};
    const std::uint32_t flags = flags_of(ImageOperation::sample) | image_lod_explicit;
    for (const Format format : {Format::rgba16_float, Format::rgba8_unorm}) {
        for (const std::uint32_t size : {2u, 3u, 4u, 5u, 16u, 64u}) {
            SCOPED_TRACE(testing::Message() << rhi::info(format).name << ", " << size << " texels");
            const TestImage image({format, ViewDimension::cube, size, size, 1, 6}, random);
            std::vector<Point> points;
            for (int patch = 0; patch < 300; ++patch) {
                const float texels = std::exp2(random_float(random, -6.0f, 1.0f));
                const float step = texels * 2.0f / static_cast<float>(size);
                const std::uint32_t axis = random_below(random, 3);
                float base[3], dx[3], dy[3];
                for (std::uint32_t i = 0; i < 3; ++i) {
                    base[i] = i == axis ? (random_below(random, 2) == 0 ? -1.0f : 1.0f) : random_float(random, -1, 1);
                    dx[i] = step * random_float(random, -1, 1), dy[i] = step * random_float(random, -1, 1);
                }
                for (std::uint32_t lane = 0; lane < 16; ++lane) {
                    Point& point = points.emplace_back();
                    const auto x = static_cast<float>(lane % 8), y = static_cast<float>(lane / 8);
                    for (std::uint32_t i = 0; i < 3; ++i)
                        point.coordinates[i] = std::bit_cast<std::uint32_t>(base[i] + x * dx[i] + y * dy[i]);
                }
            }
            const auto results = run_points(image_function(16), 16, &image.view, &sampler, {.flags = flags}, points);
            const auto of_four = run_points(image_function(4), 4, &image.view, &sampler, {.flags = flags}, points);
            ReferenceSampler reference(image, sampler.desc);
            for (std::size_t i = 0; i < points.size(); ++i) {
                ASSERT_EQ(results[i], of_four[i]) << "point " << i;
                const ReferenceResult expected =
                    reference.sample(flags, std::span(points).subspan(i & ~std::size_t{3}).first<4>(), i & 3);
                for (int c = 0; c < 4 && !expected.is_ambiguous; ++c)
                    ASSERT_NEAR(std::bit_cast<float>(results[i][c]), expected.value[c], 2e-4)
                        << "point " << i << " channel " << c;
            }
        }
    }
}

// Every lane of one call must have its own level: shapes that fit into one mip have none.
constexpr std::uint32_t every_lod[] = {image_lod_explicit, image_lod_implicit, image_lod_gradient,
                                       image_lod_implicit | image_min_lod};

TEST_P(Sampling, FiltersEveryKindOfFormat) {
    for (const Format format :
         {Format::rgba8_unorm, Format::rgba8_srgb, Format::bgra8_srgb, Format::rgba8_snorm, Format::r8_unorm,
          Format::rg8_unorm, Format::r16_unorm, Format::rgba16_float, Format::rg16_float, Format::r32_float,
          Format::rgba32_float, Format::rgb10a2_unorm, Format::rg11b10_float, Format::rgb9e5_float,
          Format::bc1_rgba_srgb, Format::bc3_rgba_unorm, Format::bc5_rg_snorm, Format::bc7_rgba_unorm,
          Format::d24_unorm_s8_uint}) {
        SCOPED_TRACE(rhi::info(format).name);
        for (const std::uint32_t lod : every_lod) {
            if (HasFatalFailure()) return;
            check(format, random_sampler(), flags_of(ImageOperation::sample) | lod, 2e-4);
        }
    }
}

TEST_P(Sampling, FiltersWithEverySampler) {
    for (int i = 0; i < 100 && !HasFatalFailure(); ++i) {
        const rhi::SamplerDesc desc = random_sampler();
        SCOPED_TRACE(testing::Message() << "sampler " << i);
        check(Format::rgba8_unorm, desc, flags_of(ImageOperation::sample) | every_lod[i % 4], 1e-4);
        check(Format::rgba32_uint, desc, flags_of(ImageOperation::sample) | every_lod[i % 4], 0.0);
    }
}

TEST_P(Sampling, ComparesDepths) {
    for (int i = 0; i < 50 && !HasFatalFailure(); ++i) {
        rhi::SamplerDesc desc = random_sampler();
        desc.comparison = true;
        check(i % 2 == 0 ? Format::d32_float : Format::d16_unorm, desc,
              flags_of(ImageOperation::sample) | image_compare | every_lod[i % 4], 1e-4);
    }
}

TEST_P(Sampling, AppliesOffsets) {
    if (is_cube(GetParam().dimension)) return;  // Offsets do not exist for cubes.
    for (int i = 0; i < 30 && !HasFatalFailure(); ++i) {
        check(Format::rgba16_float, random_sampler(),
              flags_of(ImageOperation::sample) | image_offset | every_lod[i % 4], 2e-4);
    }
}

TEST_P(Sampling, FiltersAnisotropically) {
    for (int i = 0; i < 30 && !HasFatalFailure(); ++i) {
        rhi::SamplerDesc desc = random_sampler();
        desc.max_anisotropy = random_float(random, 1.5f, 16.0f);
        desc.magnify = desc.minify = rhi::Filter::linear;
        check(Format::rgba8_unorm, desc,
              flags_of(ImageOperation::sample) | (i % 2 == 0 ? image_lod_implicit : image_lod_gradient), 1e-4);
    }
}

// The reference averages over the same ellipses. A texel's weight may be that of the step below or above where a
// distance rounds otherwise (1/512 of it), and another level may be taken where the logarithm is a whole number.
TEST_P(Sampling, AveragesTheSameEllipsesInDouble) {
    const Shape& shape = GetParam();
    if (shape.dimension != ViewDimension::d2 && shape.dimension != ViewDimension::d2_array) return;
    std::size_t compared = 0, different = 0, far = 0, longer = 0;
    for (int i = 0; i < 24; ++i) {
        rhi::SamplerDesc desc = random_sampler();
        desc.max_anisotropy = random_float(random, 1.5f, 16.0f);
        desc.comparison = false;
        const TestImage image({Format::rgba32_float, shape.dimension, shape.width, shape.height, 1, shape.layers, 3},
                              random);
        const SamplerState ellipses{desc, true}, lines{desc, false};
        const Request request{.flags = flags_of(ImageOperation::sample) |
                                       (i % 2 == 0 ? image_lod_implicit : image_lod_gradient) |
                                       (i % 3 == 0 ? image_offset : 0u)};
        const std::vector<Point> points = random_quads(50);
        const auto single = run_points(image_function(8), 8, &image.view, &ellipses, request, points);
        const auto along_lines = run_points(image_function(8), 8, &image.view, &lines, request, points);
        const auto precise = run_points_in_double(&image.view, &ellipses, request, points);
        for (std::size_t p = 0; p < points.size(); ++p)
            for (std::size_t c = 0; c < 4; ++c) {
                const double expected = static_cast<double>(std::bit_cast<float>(single[p][c]));
                const double difference = std::abs(precise[p][c] - expected);
                ++compared;
                if (!(difference <= 1e-4)) ++different;
                if (!(difference <= 1e-2)) ++far;
                longer += std::abs(static_cast<double>(std::bit_cast<float>(along_lines[p][c])) - expected) > 0.1;
            }
    }
    EXPECT_GT(longer, compared / 20) << "the other filter gives the same: nothing is told apart";
    EXPECT_LE(different, compared / 50) << "of " << compared;
    EXPECT_LE(far, compared / 500) << "of " << compared;
}

// What gather returns are the texels of a linear sample: weighted, they are that sample.
TEST_P(Sampling, GathersTheTexelsOfLinearSamples) {
    const Shape& shape = GetParam();
    using enum ViewDimension;
    if (shape.dimension == d1 || shape.dimension == d1_array || shape.dimension == d3)
        return;  // Gather does not exist there.
    std::size_t inside = 0;
    for (int i = 0; i < 40; ++i) {
        rhi::SamplerDesc desc = random_sampler();
        desc.magnify = desc.minify = rhi::Filter::linear;
        desc.comparison = i % 2 != 0;
        const TestImage image({desc.comparison ? Format::d32_float : Format::rgba32_float, shape.dimension, shape.width,
                               shape.height, 1, shape.layers, 1},
                              random);
        const SamplerState sampler{desc};
        const std::uint32_t component = desc.comparison ? 0 : random_below(random, 4);
        const std::uint32_t offset = is_cube(shape.dimension) || i % 4 < 2 ? 0u : image_offset,
                            compare = desc.comparison ? image_compare : 0u;
        const std::vector<Point> points = random_quads(100);
        const auto gathered = run_points(
            image_function(8), 8, &image.view, &sampler,
            {.flags = flags_of(ImageOperation::gather) | offset | compare | (component << image_component_shift)},
            points);
        const auto sampled =
            run_points(image_function(8), 8, &image.view, &sampler,
                       {.flags = flags_of(ImageOperation::sample) | image_lod_explicit | offset | compare}, points);
        for (std::size_t p = 0; p < points.size(); ++p) {
            double u = std::bit_cast<float>(points[p].coordinates[0]),
                   v = std::bit_cast<float>(points[p].coordinates[1]);
            if (is_cube(shape.dimension)) {
                // Faces +Z and -Z only: the others are the same but for the names of their axes.
                const double z = std::bit_cast<float>(points[p].coordinates[2]);
                if (std::abs(z) <= std::max(std::abs(u), std::abs(v))) continue;
                u = 0.5 * u / z + 0.5, v = 0.5 * -v / std::abs(z) + 0.5;
            }
            ++inside;
            u = u * shape.width - 0.5, v = v * shape.height - 0.5;
            const double fx = u - std::floor(u), fy = v - std::floor(v);
            const double weights[4] = {(1 - fx) * fy, fx * fy, fx * (1 - fy), (1 - fx) * (1 - fy)};
            double sum = 0.0;
            for (int tap = 0; tap < 4; ++tap) sum += weights[tap] * std::bit_cast<float>(gathered[p][tap]);
            ASSERT_NEAR(sum, std::bit_cast<float>(sampled[p][component]), 2e-3) << "sampler " << i << " point " << p;
        }
    }
    EXPECT_GT(inside, 500u);
}

TEST_P(Sampling, TellsTheLevelOfDetail) {
    for (int i = 0; i < 20 && !HasFatalFailure(); ++i) {
        rhi::SamplerDesc desc = random_sampler();
        check(Format::rgba8_unorm, desc, flags_of(ImageOperation::query_lod) | image_lod_implicit, 1e-4, true);
    }
}

INSTANTIATE_TEST_SUITE_P(Shapes, Sampling, testing::ValuesIn(shapes),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace nacre::cpu::test
