// SPDX-License-Identifier: Apache-2.0
// Image operations against the Vulkan device of this machine.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "tests/backends/cpu/images/device_comparison.h"

namespace nacre::cpu::test {
namespace {

using rhi::Format;
using rhi::ViewDimension;

class DeviceComparison : public testing::Test {
  protected:
    static void SetUpTestSuite() { oracle = new Oracle; }
    static void TearDownTestSuite() {
        delete oracle;
        oracle = nullptr;
    }
    void SetUp() override {
        if (oracle->device() != nullptr) return;
        // A driver that is here and fails is a failure.
        if (oracle->error().code == ErrorCode::not_found) GTEST_SKIP() << oracle->error().message();
        FAIL() << oracle->error().message();
    }

    // Largest difference of the float results.
    static double largest_difference(const std::vector<Result>& ours, const std::vector<Result>& theirs,
                                     std::size_t* where = nullptr) {
        double largest = 0.0;
        for (std::size_t i = 0; i < ours.size(); ++i) {
            for (int c = 0; c < 4; ++c) {
                const double a = std::bit_cast<float>(ours[i][c]), b = std::bit_cast<float>(theirs[i][c]);
                const double difference = std::isfinite(a - b)                           ? std::abs(a - b)
                                          : (a == b || (std::isnan(a) && std::isnan(b))) ? 0.0
                                                                                         : 1e30;
                if (difference > largest) {
                    largest = difference;
                    if (where != nullptr) *where = i;
                }
            }
        }
        return largest;
    }

    static inline Oracle* oracle = nullptr;
    Random random{7};
};

std::vector<Result> run(const TestImage& image, const rhi::SamplerDesc& sampler_desc, const Request& request,
                        std::span<const Point> points) {
    const SamplerState sampler{sampler_desc};
    return run_points(image_function(16), 16, &image.view, &sampler, request, points);
}

// Every texel of an image.
std::vector<Point> all_texels(const TestImage& image, std::uint32_t mip) {
    std::vector<Point> points;
    const ImageLevel& level = image.view.levels[mip];
    for (std::uint32_t y = 0; y < level.height; ++y) {
        for (std::uint32_t x = 0; x < level.width; ++x)
            points.push_back({.coordinates = {x, y, 0, 0}, .lod = std::bit_cast<float>(mip)});
    }
    return points;
}

constexpr rhi::SamplerDesc nearest() {
    rhi::SamplerDesc desc;
    desc.magnify = desc.minify = desc.mip = rhi::Filter::nearest;
    return desc;
}

// Largest difference by which the device's own decoding is off: it approximates the old compressed formats in 8 bits.
double decoding_tolerance(Format format) {
    switch (format) {
        case Format::bc1_rgba_unorm:
        case Format::bc2_rgba_unorm: return 1.01 / 255;
        case Format::bc3_rgba_unorm: return 2.01 / 255;
        case Format::bc4_r_unorm:
        case Format::bc5_rg_unorm: return 2.0 / 255;
        case Format::bc4_r_snorm:
        case Format::bc5_rg_snorm: return 2.0 / 127;
        case Format::bc1_rgba_srgb:
        case Format::bc2_rgba_srgb:
        case Format::bc3_rgba_srgb: return 2.4 / 255;
        case Format::rgba8_srgb:
        case Format::bgra8_srgb:
        case Format::bc7_rgba_srgb: return 0.0013;  // A polynomial.
        default: return 2e-7;                       // The last bit of a division.
    }
}

TEST_F(DeviceComparison, FetchesEveryFormat) {
    for (std::uint32_t f = 1; f < rhi::format_count; ++f) {
        const auto format = static_cast<Format>(f);
        if (!oracle->device()->capabilities().supports(format, rhi::FormatSupport::sampled)) continue;
        const rhi::FormatInfo& facts = rhi::info(format);
        if (facts.has_stencil) continue;
        SCOPED_TRACE(facts.name);
        const TestImage image({.format = format, .width = 256, .height = 64}, random);
        const std::vector<Point> points = all_texels(image, 0);
        Request request{.flags = flags_of(ImageOperation::fetch)};
        if (facts.is_integer()) request.flags |= image_integer;
        const auto ours = run(image, nearest(), request, points);
        const auto theirs = oracle->evaluate(image, nearest(), "texelFetch(image, ip.xy, 0)", points);
        if (facts.is_integer()) {
            EXPECT_EQ(ours, theirs);
            continue;
        }
        std::size_t at = 0;
        const double difference = largest_difference(ours, theirs, &at);
        EXPECT_LE(difference, decoding_tolerance(format)) << "texel " << at;
    }
}

struct SampleCase {
    const char* name;
    ViewDimension dimension;
    std::uint32_t width, height, depth, layers;
};
constexpr SampleCase shapes[] = {
    {"d1", ViewDimension::d1, 37, 1, 1, 1},
    {"d1_array", ViewDimension::d1_array, 37, 1, 1, 5},
    {"d2", ViewDimension::d2, 37, 23, 1, 1},
    {"d2_array", ViewDimension::d2_array, 20, 31, 1, 4},
    {"d3", ViewDimension::d3, 13, 9, 7, 1},
    {"cube", ViewDimension::cube, 16, 16, 1, 6},
    {"cube_array", ViewDimension::cube_array, 9, 9, 1, 12},
};

std::uint32_t spatial_axes(ViewDimension dimension) {
    using enum ViewDimension;
    switch (dimension) {
        case d1:
        case d1_array: return 1;
        case d2:
        case d2_array: return 2;
        default: return 3;
    }
}

std::string swizzle(std::uint32_t count) { return std::string("p.") + std::string("xyzw").substr(0, count); }

std::vector<Point> random_points(Random& random, const SampleCase& shape, std::size_t count) {
    std::vector<Point> points(count);
    const std::uint32_t axes = spatial_axes(shape.dimension);
    const bool is_cube = shape.dimension == ViewDimension::cube || shape.dimension == ViewDimension::cube_array;
    for (Point& point : points) {
        for (std::uint32_t axis = 0; axis < axes; ++axis) {
            point.coordinates[axis] =
                std::bit_cast<std::uint32_t>(is_cube ? random_float(random, -1, 1) : random_float(random, -1.6f, 2.7f));
            point.gradient_x[axis] = random_float(random, -0.15f, 0.15f);
            point.gradient_y[axis] = random_float(random, -0.15f, 0.15f);
        }
        if (axes < 4)
            point.coordinates[axes] =
                std::bit_cast<std::uint32_t>(random_float(random, -1.0f, static_cast<float>(shape.layers)));
        if (is_cube && shape.layers > 6)
            point.coordinates[3] = std::bit_cast<std::uint32_t>(random_float(random, -0.9f, 1.9f));
        point.lod = random_float(random, -1.5f, 5.0f);
        point.reference = random_float(random, 0.0f, 1.0f);
    }
    return points;
}

rhi::SamplerDesc random_sampler(Random& random) {
    rhi::SamplerDesc desc;
    const auto filter = [&] { return static_cast<rhi::Filter>(random_below(random, 2)); };
    const auto mode = [&] { return static_cast<rhi::AddressMode>(random_below(random, 4)); };
    desc.magnify = filter(), desc.minify = filter(), desc.mip = filter();
    desc.address_u = mode(), desc.address_v = mode(), desc.address_w = mode();
    desc.border = static_cast<rhi::BorderColor>(random_below(random, 3));
    if (random_below(random, 3) == 0) desc.mip_bias = random_float(random, -1.0f, 1.0f);
    if (random_below(random, 3) == 0) desc.min_lod = random_float(random, 0.0f, 1.5f);
    if (random_below(random, 3) == 0) desc.max_lod = random_float(random, 1.5f, 3.0f);
    return desc;
}

// Counts points that differ by more than `tolerance`; nearest filters may fall to another side of a border between
// texels where coordinates are computed in another order.
struct Differences {
    std::size_t count = 0, first = 0;
};
Differences differences(const std::vector<Result>& ours, const std::vector<Result>& theirs, double tolerance) {
    Differences result;
    for (std::size_t i = 0; i < ours.size(); ++i) {
        double largest = 0.0;
        for (int c = 0; c < 4; ++c) {
            largest = std::max<double>(largest,
                                       std::abs(std::bit_cast<float>(ours[i][c]) - std::bit_cast<float>(theirs[i][c])));
        }
        if (largest > tolerance && result.count++ == 0) result.first = i;
    }
    return result;
}

std::string describe(const rhi::SamplerDesc& s, const Point& p, const Result& ours, const Result& theirs) {
    std::string text = "mag " + std::to_string(static_cast<int>(s.magnify)) + " min " +
                       std::to_string(static_cast<int>(s.minify)) + " mip " + std::to_string(static_cast<int>(s.mip)) +
                       " address " + std::to_string(static_cast<int>(s.address_u)) +
                       std::to_string(static_cast<int>(s.address_v)) + std::to_string(static_cast<int>(s.address_w)) +
                       " border " + std::to_string(static_cast<int>(s.border)) + " bias " + std::to_string(s.mip_bias) +
                       " lod " + std::to_string(s.min_lod) + ".." + std::to_string(s.max_lod) + "\n  at";
    for (int i = 0; i < 4; ++i) text += " " + std::to_string(std::bit_cast<float>(p.coordinates[i]));
    text += " lod " + std::to_string(p.lod) + " reference " + std::to_string(p.reference) + "\n  ours";
    for (int i = 0; i < 4; ++i) text += " " + std::to_string(std::bit_cast<float>(ours[i]));
    text += "\n  theirs";
    for (int i = 0; i < 4; ++i) text += " " + std::to_string(std::bit_cast<float>(theirs[i]));
    return text;
}

class EveryShape : public DeviceComparison, public testing::WithParamInterface<SampleCase> {
  protected:
    // Formats with a range of one: the tolerance of an eighth of an 8-bit step is the same for all.
    void compare(const TestImage& image, const rhi::SamplerDesc& sampler, const Request& request,
                 const std::string& expression, const std::vector<Point>& points, double tolerance,
                 std::size_t allowed) {
        const auto ours = run(image, sampler, request, points),
                   theirs = oracle->evaluate(image, sampler, expression, points);
        const Differences found = differences(ours, theirs, tolerance);
        EXPECT_LE(found.count, allowed) << "of " << points.size() << "; first:\n  "
                                        << describe(sampler, points[found.first], ours[found.first],
                                                    theirs[found.first]);
    }
};

// GLSL has no fetch from cubes, no depth textures of three dimensions, and gather from 2D and cubes only.
class FetchedShape : public EveryShape {};
class DepthShape : public EveryShape {};
class GatheredShape : public EveryShape {};

TEST_P(EveryShape, SamplesWithExplicitLod) {
    const SampleCase shape = GetParam();
    const std::uint32_t mips = std::min(4u, rhi::full_mip_count(shape.width, shape.height, shape.depth));
    for (const Format format :
         {Format::rgba8_unorm, Format::rgba8_srgb, Format::rgba16_float, Format::r8_unorm, Format::rg11b10_float}) {
        for (int i = 0; i < 6; ++i) {
            const TestImage image({format, shape.dimension, shape.width, shape.height, shape.depth, shape.layers, mips},
                                  random);
            const auto points = random_points(random, shape, 1000);
            SCOPED_TRACE(std::string(rhi::info(format).name));
            compare(image, random_sampler(random), {.flags = flags_of(ImageOperation::sample) | image_lod_explicit},
                    "textureLod(image, " + swizzle(coordinate_count(shape.dimension)) + ", lod)", points,
                    format == Format::rgba8_srgb ? 0.0013 : 2e-5, 2);
        }
    }
}

TEST_P(EveryShape, SamplesWithGradients) {
    const SampleCase shape = GetParam();
    const std::uint32_t mips = std::min(4u, rhi::full_mip_count(shape.width, shape.height, shape.depth));
    const std::uint32_t axes = spatial_axes(shape.dimension);
    const std::string cut = std::string(".") + std::string("xyz").substr(0, axes);
    for (int i = 0; i < 10; ++i) {
        const TestImage image(
            {Format::rgba8_unorm, shape.dimension, shape.width, shape.height, shape.depth, shape.layers, mips}, random);
        compare(
            image, random_sampler(random), {.flags = flags_of(ImageOperation::sample) | image_lod_gradient},
            "textureGrad(image, " + swizzle(coordinate_count(shape.dimension)) + ", gx" + cut + ", gy" + cut + ")",
            random_points(random, shape, 1000), 2e-5, 3);
    }
}

TEST_P(FetchedShape, FetchesFromEveryMipAndLayer) {
    const SampleCase shape = GetParam();
    const std::uint32_t mips = std::min(3u, rhi::full_mip_count(shape.width, shape.height, shape.depth));
    const std::string components = std::string("ip.") + std::string("xyz").substr(0, coordinate_count(shape.dimension));
    for (const Format format : {Format::r32_uint, Format::rgba8_unorm, Format::rg16_sint, Format::r32_float}) {
        const TestImage image({format, shape.dimension, shape.width, shape.height, shape.depth, shape.layers, mips},
                              random);
        std::vector<Point> points(2000);
        const bool is_array = shape.layers > 1;
        for (Point& point : points) {
            const std::uint32_t mip = random_below(random, mips);
            point.lod = std::bit_cast<float>(mip);
            const ImageLevel& level = image.view.levels[mip];
            point.coordinates[0] = random_below(random, level.width);
            if (shape.dimension == ViewDimension::d1_array)
                point.coordinates[1] = random_below(random, shape.layers);
            else
                point.coordinates[1] = random_below(random, level.height);
            point.coordinates[2] = random_below(random, is_array ? shape.layers : level.depth);
        }
        Request request{.flags = flags_of(ImageOperation::fetch)};
        if (rhi::info(format).is_integer()) request.flags |= image_integer;
        const auto ours = run(image, nearest(), request, points);
        const auto theirs =
            oracle->evaluate(image, nearest(), "texelFetch(image, " + components + ", floatBitsToInt(lod))", points);
        if (rhi::info(format).is_integer())
            EXPECT_EQ(ours, theirs);
        else
            EXPECT_LE(largest_difference(ours, theirs), 2e-7);
    }
}

TEST_P(DepthShape, ComparesDepths) {
    const SampleCase shape = GetParam();
    using enum ViewDimension;
    std::string expression;
    switch (shape.dimension) {
        case d1: expression = "textureGrad(image, vec3(p.x, 0, reference), gx.x, gy.x)"; break;
        case d1_array: expression = "textureGrad(image, vec3(p.xy, reference), gx.x, gy.x)"; break;
        case d2: expression = "textureGrad(image, vec3(p.xy, reference), gx.xy, gy.xy)"; break;
        case d2_array: expression = "textureGrad(image, vec4(p.xyz, reference), gx.xy, gy.xy)"; break;
        case cube: expression = "textureGrad(image, vec4(p.xyz, reference), gx, gy)"; break;
        default: expression = "texture(image, p, reference)"; break;
    }
    const bool is_cube_array = shape.dimension == cube_array;
    for (const Format format : {Format::d32_float, Format::d16_unorm}) {
        for (std::uint32_t operation = 0; operation < 8; ++operation) {
            const TestImage image({format, shape.dimension, shape.width, shape.height, shape.depth, shape.layers,
                                   is_cube_array ? 1u : 3u},
                                  random);
            rhi::SamplerDesc sampler = random_sampler(random);
            sampler.comparison = true;
            sampler.compare = static_cast<rhi::CompareOperation>(operation);
            if (!oracle->device()->capabilities().supports(format, rhi::FormatSupport::filtered)) {
                sampler.magnify = sampler.minify = sampler.mip = rhi::Filter::nearest;
            }
            if (is_cube_array) sampler.minify = sampler.magnify;
            compare(
                image, sampler,
                {.flags = flags_of(ImageOperation::sample) | image_compare |
                          (is_cube_array ? image_lod_explicit : image_lod_gradient)},
                "vec4(" + expression + ", 0, 0, 1)",
                [&] {
                    auto points = random_points(random, shape, 1000);
                    if (is_cube_array)
                        for (Point& point : points) point.lod = 0.0f;
                    return points;
                }(),
                2e-5, 5);
        }
    }
}

TEST_P(GatheredShape, Gathers) {
    const SampleCase shape = GetParam();
    const std::string coordinates = swizzle(coordinate_count(shape.dimension));
    for (std::uint32_t component = 0; component < 4; ++component) {
        for (const Format format : {Format::rgba8_unorm, Format::rg16_float}) {
            const TestImage image({format, shape.dimension, shape.width, shape.height, shape.depth, shape.layers, 1},
                                  random);
            const std::uint32_t flags = flags_of(ImageOperation::gather) | (component << image_component_shift);
            compare(image, random_sampler(random), {.flags = flags},
                    "textureGather(image, " + coordinates + ", " + std::to_string(component) + ")",
                    random_points(random, shape, 1000), 2e-7, 6);
        }
    }
    const TestImage depth({Format::d32_float, shape.dimension, shape.width, shape.height, shape.depth, shape.layers, 1},
                          random);
    rhi::SamplerDesc sampler = random_sampler(random);
    sampler.comparison = true;
    if (!oracle->device()->capabilities().supports(Format::d32_float, rhi::FormatSupport::filtered)) {
        sampler.magnify = sampler.minify = sampler.mip = rhi::Filter::nearest;
    }
    compare(depth, sampler, {.flags = flags_of(ImageOperation::gather) | image_compare},
            "textureGather(image, " + coordinates + ", reference)", random_points(random, shape, 1000), 2e-7, 6);
}

TEST_F(DeviceComparison, AppliesOffsets) {
    for (std::uint32_t mode = 0; mode < 4; ++mode) {
        for (const bool is_linear : {true, false}) {
            const SampleCase shape{"", ViewDimension::d2, 11, 6, 1, 1};
            const TestImage image({Format::rgba8_unorm, shape.dimension, shape.width, shape.height, 1, 1, 3}, random);
            rhi::SamplerDesc sampler = is_linear ? rhi::SamplerDesc{} : nearest();
            sampler.address_u = sampler.address_v = static_cast<rhi::AddressMode>(mode);
            std::vector<Point> points = random_points(random, shape, 1000);
            for (Point& point : points) point.offset = {7, -8, 0};
            auto ours = run(image, sampler,
                            {.flags = flags_of(ImageOperation::sample) | image_lod_explicit | image_offset}, points);
            auto theirs = oracle->evaluate(image, sampler, "textureLodOffset(image, p.xy, lod, ivec2(7, -8))", points);
            EXPECT_LE(differences(ours, theirs, 1e-5).count, 2u) << "address mode " << mode << " linear " << is_linear;
            for (Point& point : points)
                point.offset = {static_cast<int>(random_below(random, 16)) - 8,
                                static_cast<int>(random_below(random, 16)) - 8, 0};
            ours = run(image, sampler, {.flags = flags_of(ImageOperation::gather) | image_offset}, points);
            theirs = oracle->evaluate(image, sampler, "textureGatherOffset(image, p.xy, offset.xy)", points);
            EXPECT_LE(differences(ours, theirs, 2e-7).count, 2u) << "address mode " << mode << ", gather";
            Request request{.flags = flags_of(ImageOperation::gather) | image_offsets};
            request.gather_offsets = {{{-8, 7}, {0, 1}, {3, 3}, {-2, -5}}};
            ours = run(image, sampler, request, points);
            theirs = oracle->evaluate(
                image, sampler,
                "textureGatherOffsets(image, p.xy, ivec2[4](ivec2(-8, 7), ivec2(0, 1), ivec2(3, 3), ivec2(-2, -5)))",
                points);
            EXPECT_LE(differences(ours, theirs, 2e-7).count, 2u)
                << "address mode " << mode << ", gather of four offsets";
        }
    }
}

// Pairs of equal quads of points with their derivatives: the driver takes derivatives from the coordinates even where
// gradients are given, and the level of the first of eight points for all of them.
std::vector<Point> random_quads(Random& random, const SampleCase& shape, std::size_t count) {
    std::vector<Point> points = random_points(random, shape, count * 8);
    const float size[2] = {static_cast<float>(shape.width), static_cast<float>(shape.height)};
    for (std::size_t first = 0; first < points.size(); first += 8) {
        const float length = std::exp2(random_float(random, -2.0f, 4.0f)), ratio = random_float(random, 0.02f, 1.0f);
        const float angle = random_float(random, 0.0f, 6.28f), shear = random_float(random, -0.5f, 0.5f);
        const float x[2] = {length * std::cos(angle), length * std::sin(angle)};
        const float y[2] = {ratio * (-x[1] + shear * x[0]), ratio * (x[0] + shear * x[1])};
        const std::array<std::uint32_t, 4> corner = points[first].coordinates;
        const auto moved = [&](std::size_t axis, std::size_t i) {
            return std::bit_cast<float>(corner[axis]) + ((i & 1) != 0 ? x[axis] / size[axis] : 0.0f) +
                   ((i & 2) != 0 ? y[axis] / size[axis] : 0.0f);
        };
        for (std::size_t i = 0; i < 8; ++i) {
            Point& point = points[first + i];
            point.coordinates = corner;
            for (std::size_t axis = 0; axis < 2; ++axis) {
                point.coordinates[axis] = std::bit_cast<std::uint32_t>(moved(axis, i % 4));
                point.gradient_x[axis] = moved(axis, 1) - moved(axis, 0);
                point.gradient_y[axis] = moved(axis, 2) - moved(axis, 0);
            }
        }
    }
    return points;
}

// Sizes that are no powers of two, and mirrored coordinates, are wrapped in another way by the driver's filter of this
// kind than by its others.
TEST_F(DeviceComparison, AveragesEllipses) {
    for (const SampleCase& shape : {SampleCase{"", ViewDimension::d2, 64, 32, 1, 1},
                                    SampleCase{"", ViewDimension::d2_array, 16, 32, 1, 4}}) {
        for (const rhi::AddressMode mode : {rhi::AddressMode::repeat, rhi::AddressMode::clamp_to_edge}) {
            SCOPED_TRACE(testing::Message() << shape.width << " x " << shape.height);
            const TestImage image({Format::rgba8_unorm, shape.dimension, shape.width, shape.height, 1, shape.layers, 4},
                                  random);
            rhi::SamplerDesc desc;
            desc.max_anisotropy = 4.0f;
            desc.address_u = desc.address_v = mode;
            if (shape.layers > 1) desc.mip_bias = 0.7f;
            const auto points = random_quads(random, shape, 500);
            const SamplerState sampler{desc, true};
            const auto ours = run_points(image_function(16), 16, &image.view, &sampler,
                                         {.flags = flags_of(ImageOperation::sample) | image_lod_gradient}, points);
            const std::string p = shape.layers > 1 ? "p.xyz" : "p.xy";
            const auto theirs = oracle->evaluate(image, desc, "textureGrad(image, " + p + ", gx.xy, gy.xy)", points);
            // A texel's weight is that of the step below or above where a distance rounds otherwise: 1/512 of it.
            EXPECT_LE(differences(ours, theirs, 2e-3).count, 2u);
            const Differences found = differences(ours, theirs, 1e-5);
            EXPECT_LE(found.count, points.size() / 100)
                << "of " << points.size() << "; first:\n  "
                << describe(desc, points[found.first], ours[found.first], theirs[found.first]);
        }
    }
}

TEST_F(DeviceComparison, SamplesBlocks) {
    const SampleCase shape{"", ViewDimension::d2, 61, 42, 1, 1};
    for (std::uint32_t f = 1; f < rhi::format_count; ++f) {
        const auto format = static_cast<Format>(f);
        if (!rhi::info(format).is_compressed()) continue;
        if (!oracle->device()->capabilities().supports(format, rhi::FormatSupport::filtered)) continue;
        // Halves of random blocks are so large and small that sums of them tell nothing: BC6H is covered by fetches.
        if (format == Format::bc6h_rgb_sfloat || format == Format::bc6h_rgb_ufloat) continue;
        const TestImage image({format, shape.dimension, shape.width, shape.height, 1, 1, 4}, random);
        const std::vector<Point> points = random_points(random, shape, 1000);
        const auto ours = run(image, {}, {.flags = flags_of(ImageOperation::sample) | image_lod_explicit}, points);
        const auto theirs = oracle->evaluate(image, {}, "textureLod(image, p.xy, lod)", points);
        EXPECT_LE(largest_difference(ours, theirs), decoding_tolerance(format) + 1e-5) << rhi::info(format).name;
    }
}

template <typename Accepts>
std::vector<SampleCase> shapes_where(Accepts accepts) {
    std::vector<SampleCase> result;
    for (const SampleCase& each : shapes) {
        if (accepts(each.dimension)) result.push_back(each);
    }
    return result;
}
bool is_2d(ViewDimension dimension) { return dimension == ViewDimension::d2 || dimension == ViewDimension::d2_array; }
const auto name_of = [](const testing::TestParamInfo<SampleCase>& each) { return std::string(each.param.name); };

INSTANTIATE_TEST_SUITE_P(Shapes, EveryShape, testing::ValuesIn(shapes), name_of);
INSTANTIATE_TEST_SUITE_P(Shapes, FetchedShape,
                         testing::ValuesIn(shapes_where([](ViewDimension d) { return !is_cube(d); })), name_of);
INSTANTIATE_TEST_SUITE_P(Shapes, DepthShape,
                         testing::ValuesIn(shapes_where([](ViewDimension d) { return d != ViewDimension::d3; })),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Shapes, GatheredShape,
                         testing::ValuesIn(shapes_where([](ViewDimension d) { return is_2d(d) || is_cube(d); })),
                         name_of);

}  // namespace
}  // namespace nacre::cpu::test
