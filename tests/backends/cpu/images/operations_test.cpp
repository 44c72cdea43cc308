// SPDX-License-Identifier: Apache-2.0
// What all image operations promise: the same bits on every machine, no harm by any argument, robust edges, real
// atomics.
#include <gtest/gtest.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>

#include "tests/backends/cpu/images/test_image.h"

namespace nacre::cpu::test {
namespace {

using rhi::Format;
using rhi::ViewDimension;

constexpr ViewDimension dimensions[] = {ViewDimension::d1,        ViewDimension::d1_array, ViewDimension::d2,
                                        ViewDimension::d2_array,  ViewDimension::d3,       ViewDimension::cube,
                                        ViewDimension::cube_array};

ImageShape shape_of(ViewDimension dimension, Format format, Random& random) {
    ImageShape shape{.format = format, .dimension = dimension};
    shape.width = 1 + random_below(random, 20);
    shape.height = 1 + random_below(random, 20);
    using enum ViewDimension;
    if (dimension == d1 || dimension == d1_array) shape.height = 1;
    if (dimension == d1_array || dimension == d2_array) shape.layers = 1 + random_below(random, 4);
    if (dimension == d3) shape.depth = 1 + random_below(random, 9);
    if (dimension == cube || dimension == cube_array)
        shape.height = shape.width, shape.layers = dimension == cube ? 6 : 12;
    shape.mips = 1 + random_below(random, std::min(4u, rhi::full_mip_count(shape.width, shape.height, shape.depth)));
    return shape;
}

float garbage_float(Random& random) {
    constexpr float special[] = {0.0f,  -0.0f,  1.0f,    -1.0f,       0.5f,       1e-40f,
                                 1e30f, -1e30f, 3.4e38f, 16777216.0f, -8388609.0f};
    switch (random_below(random, 4)) {
        case 0: return std::bit_cast<float>(random_bits(random));
        case 1: return special[random_below(random, std::size(special))];
        case 2:
            return random_below(random, 2) == 0
                       ? std::numeric_limits<float>::quiet_NaN()
                       : std::copysign(std::numeric_limits<float>::infinity(), random_float(random, -1, 1));
        default: return random_float(random, -2, 3);
    }
}
std::int32_t garbage_int(Random& random) {
    constexpr std::int32_t special[] = {
        std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max(), -1, 0, 1, 1 << 24};
    switch (random_below(random, 3)) {
        case 0: return static_cast<std::int32_t>(random_bits(random));
        case 1: return special[random_below(random, std::size(special))];
        default: return static_cast<std::int32_t>(random_below(random, 24)) - 2;
    }
}

Point garbage_point(Random& random, bool has_integers) {
    Point point;
    for (auto& each : point.coordinates)
        each = has_integers ? static_cast<std::uint32_t>(garbage_int(random))
                            : std::bit_cast<std::uint32_t>(garbage_float(random));
    point.lod = has_integers && random_below(random, 4) != 0 ? std::bit_cast<float>(random_below(random, 5))
                                                             : garbage_float(random);
    point.reference = garbage_float(random);
    for (auto& each : point.gradient_x) each = garbage_float(random);
    for (auto& each : point.gradient_y) each = garbage_float(random);
    for (auto& each : point.offset) each = garbage_int(random);
    point.sample = garbage_int(random);
    point.min_lod = garbage_float(random);
    for (auto& each : point.texel)
        each = has_integers ? static_cast<std::uint32_t>(garbage_int(random))
                            : std::bit_cast<std::uint32_t>(garbage_float(random));
    point.comparator = random_bits(random);
    return point;
}
Point sane_point(Random& random, bool has_integers) {
    Point point = garbage_point(random, has_integers);
    for (auto& each : point.coordinates) {
        each =
            has_integers ? random_below(random, 16) : std::bit_cast<std::uint32_t>(random_float(random, -1.5f, 2.5f));
    }
    point.lod = has_integers ? std::bit_cast<float>(random_below(random, 3)) : random_float(random, -2, 5);
    for (auto& each : point.gradient_x) each = random_float(random, -0.5f, 0.5f);
    for (auto& each : point.gradient_y) each = random_float(random, -0.5f, 0.5f);
    for (auto& each : point.offset) each = static_cast<std::int32_t>(random_below(random, 16)) - 8;
    return point;
}

rhi::SamplerDesc random_sampler(Random& random) {
    rhi::SamplerDesc desc;
    const auto filter = [&] { return static_cast<rhi::Filter>(random_below(random, 2)); };
    const auto mode = [&] { return static_cast<rhi::AddressMode>(random_below(random, 4)); };
    desc.magnify = filter(), desc.minify = filter(), desc.mip = filter();
    desc.address_u = mode(), desc.address_v = mode(), desc.address_w = mode();
    desc.border = static_cast<rhi::BorderColor>(random_below(random, 3));
    desc.compare = static_cast<rhi::CompareOperation>(random_below(random, 8));
    if (random_below(random, 4) == 0) desc.max_anisotropy = 16.0f;
    return desc;
}

constexpr std::uint32_t operation_flags[] = {
    0, image_compare, image_offset, image_offsets, image_min_lod, image_offset | image_min_lod};
constexpr std::uint32_t lod_flags[] = {0, image_lod_implicit, image_lod_explicit, image_lod_gradient};

struct Trial {
    ImageOperation operation;
    Format format;
    rhi::SamplerDesc sampler;
    Request request;
    bool has_integers;
};
Trial random_trial(Random& random) {
    Trial trial;
    trial.operation = static_cast<ImageOperation>(random_below(random, 7));
    trial.format = static_cast<Format>(random_below(random, rhi::format_count));
    if (trial.operation == ImageOperation::atomic || random_below(random, 8) == 0) {
        constexpr Format words[] = {Format::r32_uint, Format::r32_sint, Format::r32_float};
        trial.format = words[random_below(random, 3)];
    }
    trial.sampler = random_sampler(random);
    trial.request.flags = flags_of(trial.operation) |
                          operation_flags[random_below(random, std::size(operation_flags))] |
                          lod_flags[random_below(random, 4)] | (random_below(random, 4) << image_component_shift);
    if (rhi::info(trial.format).is_integer() != (random_below(random, 16) == 0)) trial.request.flags |= image_integer;
    trial.request.atomic = static_cast<AtomicOperation>(random_below(random, 13));
    for (auto& offset : trial.request.gather_offsets)
        offset = {static_cast<std::int32_t>(random_below(random, 16)) - 8, garbage_int(random)};
    trial.has_integers = trial.operation != ImageOperation::sample && trial.operation != ImageOperation::gather &&
                         trial.operation != ImageOperation::query_lod;
    return trial;
}

// Which NaN comes out of garbage depends on the order of operands, which compilers may change.
bool same_bits(const std::vector<Result>& a, const std::vector<Result>& b, bool are_floats) {
    for (std::size_t i = 0; i < a.size(); ++i) {
        for (int c = 0; c < 4; ++c) {
            const bool are_nan =
                are_floats && std::isnan(std::bit_cast<float>(a[i][c])) && std::isnan(std::bit_cast<float>(b[i][c]));
            if (a[i][c] != b[i][c] && !are_nan) return false;
        }
    }
    return true;
}

TEST(ImageOperations, SameBitsForEveryInstructionSetAndLaneCount) {
    Random random(1);
    std::size_t not_zero = 0;
    for (int i = 0; i < 4000; ++i) {
        const Trial trial = random_trial(random);
        ImageShape shape =
            shape_of(dimensions[i % 7], trial.format == Format::undefined ? Format::r8_unorm : trial.format, random);
        if (shape.dimension == ViewDimension::d2 && random_below(random, 4) == 0 && trial.has_integers)
            shape.samples = 4, shape.mips = 1;
        const TestImage original(shape, random);
        const SamplerState sampler{trial.sampler};
        std::vector<Point> points(48);
        for (Point& point : points)
            point = random_below(random, 8) == 0 ? garbage_point(random, trial.has_integers)
                                                 : sane_point(random, trial.has_integers);
        std::vector<Result> first;
        std::vector<std::vector<std::byte>> first_content;
        for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512}) {
            for (const std::uint32_t lanes : {4u, 8u, 16u}) {
                const NacreCpuImageFunction function = image_function(lanes, set);
                if (function == nullptr) continue;
                // Writes go to a copy.
                auto content = original.content;
                ImageView view = original.view;
                for (std::uint32_t mip = 0; mip < view.mip_count; ++mip) view.levels[mip].data = content[mip].data();
                const auto results = run_points(function, lanes, &view, &sampler, trial.request, points);
                if (first.empty()) {
                    first = results, first_content = content;
                    for (const Result& result : results) not_zero += result[0] != 0;
                    continue;
                }
                ASSERT_TRUE(same_bits(results, first, (trial.request.flags & image_integer) == 0))
                    << "trial " << i << " format " << rhi::info(trial.format).name << " operation "
                    << static_cast<int>(trial.operation) << " set " << static_cast<int>(set) << " lanes " << lanes;
                ASSERT_EQ(content, first_content) << "trial " << i << " lanes " << lanes;
            }
        }
    }
    EXPECT_GT(not_zero, 4000u * 48 / 8);
}

// Samples without an offset may take a shorter way than those with one; an offset of zero changes nothing else.
TEST(ImageOperations, SamplesGiveTheSameBitsWithAnOffsetOfZero) {
    constexpr Format formats[] = {Format::rgba8_unorm,  Format::bgra8_unorm,  Format::rgba8_srgb,
                                  Format::bgra8_srgb,   Format::r32_float,    Format::rg16_float,
                                  Format::rgba16_float, Format::rgba32_float, Format::rg8_unorm};
    Random random(11);
    std::size_t not_zero = 0;
    for (int i = 0; i < 1500; ++i) {
        const Format format = formats[i % std::size(formats)];
        const ViewDimension dimension = i % 2 == 0 ? ViewDimension::d2 : ViewDimension::d2_array;
        const TestImage image(shape_of(dimension, format, random), random);
        const SamplerState sampler{random_sampler(random)};
        const std::uint32_t flags = flags_of(ImageOperation::sample) | lod_flags[1 + random_below(random, 3)];
        std::vector<Point> points(32);
        const bool is_coherent = random_below(random, 2) == 0;
        for (std::size_t p = 0; p < points.size(); ++p) {
            points[p] = sane_point(random, false);
            points[p].offset = {};
            if (!is_coherent || p == 0) continue;
            // Neighbors mostly read the same levels.
            for (std::size_t axis = 0; axis < 3; ++axis)
                points[p].gradient_x[axis] = points[0].gradient_x[axis],
                points[p].gradient_y[axis] = points[0].gradient_y[axis];
            points[p].lod = points[0].lod;
        }
        for (const std::uint32_t lanes : {4u, 8u, 16u}) {
            const NacreCpuImageFunction function = image_function(lanes);
            const auto plain = run_points(function, lanes, &image.view, &sampler, {.flags = flags}, points);
            const auto moved =
                run_points(function, lanes, &image.view, &sampler, {.flags = flags | image_offset}, points);
            for (const Result& result : plain) not_zero += result[0] != 0;
            ASSERT_EQ(plain, moved) << "trial " << i << " format " << rhi::info(format).name << " lanes " << lanes;
        }
    }
    EXPECT_GT(not_zero, 1500u * 96 / 2);
}

// Texels side by side are read and written at once: the same as in an order in which nothing is side by side.
TEST(ImageOperations, RowsOfTexelsGiveTheSameInAnyOrder) {
    Random random(12);
    for (std::uint32_t i = 1; i < rhi::format_count; ++i) {
        const auto format = static_cast<Format>(i);
        const rhi::FormatInfo& facts = rhi::info(format);
        if (facts.channels == 0 || facts.is_compressed()) continue;
        const std::uint32_t kind = facts.is_integer() ? std::uint32_t{image_integer} : 0;
        for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512})
            for (const std::uint32_t lanes : {4u, 8u, 16u}) {
                const NacreCpuImageFunction function = image_function(lanes, set);
                if (function == nullptr) continue;
                TestImage image({.format = format, .width = 19, .height = 5}, random);
                // Two rows of eight pixels, as a workgroup of 8 x 8 has them; some begin before or end behind the
                // image.
                std::vector<Point> points;
                for (std::int32_t y = -1; y < 5; ++y)
                    for (std::int32_t block = 0; block < 4; ++block)
                        for (std::int32_t x = 0; x < 8; ++x) {
                            Point& point = points.emplace_back();
                            point.coordinates = {static_cast<std::uint32_t>(8 * block + x - 3),
                                                 static_cast<std::uint32_t>(y)};
                            for (auto& each : point.texel)
                                each = kind != 0 ? random_bits(random)
                                                 : std::bit_cast<std::uint32_t>(random_float(random, -1.25f, 1.25f));
                        }
                std::vector<std::size_t> order(points.size());
                for (std::size_t p = 0; p < order.size(); ++p) order[p] = p * 5 % order.size();
                std::vector<Point> scattered;
                for (const std::size_t p : order) scattered.push_back(points[p]);
                const std::string what = std::string(facts.name) + " set " + std::to_string(static_cast<int>(set)) +
                                         " lanes " + std::to_string(lanes);

                const Request load{.flags = flags_of(ImageOperation::load) | kind};
                const auto in_rows = run_points(function, lanes, &image.view, nullptr, load, points);
                const auto apart = run_points(function, lanes, &image.view, nullptr, load, scattered);
                for (std::size_t p = 0; p < order.size(); ++p)
                    ASSERT_EQ(apart[p], in_rows[order[p]]) << what << " point " << p;

                const auto before = image.content;
                const Request store{.flags = flags_of(ImageOperation::store) | kind};
                run_points(function, lanes, &image.view, nullptr, store, points);
                const auto written = image.content;
                image.content[0] = before[0];
                image.view.levels[0].data = image.content[0].data();
                run_points(function, lanes, &image.view, nullptr, store, scattered);
                ASSERT_EQ(image.content, written) << what;
                // Depth and block formats are not stored to.
                if (facts.kind != rhi::FormatKind::srgb && !facts.is_depth_stencil() &&
                    format != Format::rgb9e5_float) {
                    ASSERT_NE(written, before) << what;
                }
            }
    }
}

TEST(ImageOperations, SurviveGarbage) {
    Random random(2);
    for (int i = 0; i < 20000; ++i) {
        const Trial trial = random_trial(random);
        ImageShape shape =
            shape_of(dimensions[i % 7], trial.format == Format::undefined ? Format::r8_unorm : trial.format, random);
        if (shape.dimension == ViewDimension::d2 && random_below(random, 4) == 0) shape.samples = 4, shape.mips = 1;
        TestImage image(shape, random);
        image.view.format = trial.format;
        if (random_below(random, 16) == 0) image.view.mip_count = 0;
        if (random_below(random, 16) == 0) image.view.layer_count = 0;
        if (random_below(random, 16) == 0) image.view.levels[0].data = nullptr;
        SamplerState sampler{trial.sampler};
        if (random_below(random, 4) == 0) {
            sampler.desc.mip_bias = garbage_float(random), sampler.desc.min_lod = garbage_float(random);
            sampler.desc.max_lod = garbage_float(random), sampler.desc.max_anisotropy = garbage_float(random);
        }
        std::vector<Point> points(32);
        for (Point& point : points) point = garbage_point(random, trial.has_integers);
        const std::uint32_t lanes = 4u << random_below(random, 3);
        const auto set = static_cast<InstructionSet>(random_below(random, 3));
        const NacreCpuImageFunction function = is_supported(set) ? image_function(lanes, set) : image_function(lanes);
        run_points(function, lanes, random_below(random, 32) == 0 ? nullptr : &image.view,
                   random_below(random, 32) == 0 ? nullptr : &sampler, trial.request, points);
    }
}

TEST(ImageOperations, LanesThatAreNotLiveAreZeroAndDoNothing) {
    Random random(3);
    for (const std::uint32_t lanes : {4u, 8u, 16u}) {
        TestImage image({.format = Format::r32_uint, .width = 16, .height = 1}, random);
        const auto before = image.content;
        ImageArguments arguments{};
        for (std::uint32_t lane = 0; lane < lanes; ++lane) {
            arguments.coordinates[0][lane] = lane;
            arguments.texel[0][lane] = 1000 + lane;
            for (auto& channel : arguments.result) channel[lane] = 77;
        }
        const NacreCpuImageFunction function = image_function(lanes);
        function(&image.view, nullptr, &arguments, flags_of(ImageOperation::load) | image_integer, 0b1010);
        for (std::uint32_t lane = 0; lane < lanes; ++lane) {
            std::uint32_t texel;
            std::memcpy(&texel, &image.content[0][4 * lane], 4);
            const bool is_live = lane == 1 || lane == 3;
            EXPECT_EQ(arguments.result[0][lane], is_live ? texel : 0u);
            EXPECT_EQ(arguments.result[3][lane], is_live ? 1u : 0u);
        }
        function(&image.view, nullptr, &arguments, flags_of(ImageOperation::store) | image_integer, 0b0100);
        for (std::uint32_t x = 0; x < 16; ++x) {
            std::uint32_t texel, old;
            std::memcpy(&texel, &image.content[0][4 * x], 4);
            std::memcpy(&old, &before[0][4 * x], 4);
            EXPECT_EQ(texel, x == 2 ? 1002u : old);
        }
    }
}

TEST(ImageOperations, ReadsOutsideAreZeroAndWritesVanish) {
    Random random(4);
    for (const ViewDimension dimension : dimensions) {
        for (const Format format : {Format::r32_uint, Format::rgba8_unorm, Format::rg16_sint, Format::r8_uint}) {
            TestImage image(shape_of(dimension, format, random), random);
            const ImageLevel& level = image.view.levels[0];
            const auto before = image.content;
            std::vector<Point> points;
            const std::uint32_t axes = coordinate_count(dimension) - (dimension == ViewDimension::cube_array ? 1 : 0);
            const std::uint32_t limits[3] = {level.width,
                                             dimension == ViewDimension::d1_array ? image.shape.layers : level.height,
                                             dimension == ViewDimension::d3 ? level.depth : image.shape.layers};
            for (std::uint32_t axis = 0; axis < axes; ++axis) {
                for (const std::uint32_t wrong : {limits[axis], ~0u, 0x80000000u, 0x7fffffffu}) {
                    Point point;
                    point.coordinates[axis] = wrong;
                    point.texel = {1, 2, 3, 4};
                    points.push_back(point);
                }
            }
            const std::uint32_t kind = rhi::info(format).is_integer() ? image_integer : 0u;
            for (const ImageOperation operation :
                 {ImageOperation::fetch, ImageOperation::load, ImageOperation::store}) {
                for (const Result& result : run_points(image_function(8), 8, &image.view, nullptr,
                                                       {.flags = flags_of(operation) | kind}, points)) {
                    EXPECT_EQ(result, Result{});
                }
            }
            EXPECT_EQ(image.content, before);
            // A wrong level.
            Point point;
            point.lod = std::bit_cast<float>(image.shape.mips);
            EXPECT_EQ(run_points(image_function(8), 8, &image.view, nullptr,
                                 {.flags = flags_of(ImageOperation::fetch) | kind}, {&point, 1})[0],
                      Result{});
        }
    }
}

TEST(ImageOperations, FetchesWhatTexelsAre) {
    Random random(5);
    for (std::uint32_t f = 1; f < rhi::format_count; ++f) {
        const auto format = static_cast<Format>(f);
        const rhi::FormatInfo& facts = rhi::info(format);
        for (const ViewDimension dimension : dimensions) {
            ImageShape shape = shape_of(dimension, format, random);
            if (dimension == ViewDimension::d2 && !facts.is_compressed()) shape.samples = 4, shape.mips = 1;
            const TestImage image(shape, random);
            std::vector<Point> points(200);
            std::vector<Result> expected;
            for (Point& point : points) {
                const std::uint32_t mip = random_below(random, shape.mips);
                const ImageLevel& level = image.view.levels[mip];
                const std::uint32_t x = random_below(random, level.width), y = random_below(random, level.height),
                                    z = random_below(random, level.depth);
                const std::uint32_t layer = random_below(random, shape.layers),
                                    sample = random_below(random, shape.samples);
                using enum ViewDimension;
                point.coordinates = {x, y, 0, 0};
                if (dimension == d1_array) point.coordinates[1] = layer;
                if (dimension == d3) point.coordinates[2] = z;
                if (dimension == d2_array || dimension == cube || dimension == cube_array) point.coordinates[2] = layer;
                point.lod = std::bit_cast<float>(mip);
                point.sample = static_cast<std::int32_t>(sample);
                const std::byte* at = level.data + layer * level.layer_stride + z * level.slice_stride +
                                      sample * level.sample_stride + y / facts.block_width * level.row_stride +
                                      x / facts.block_width * image.view.texel_bytes;
                const Texel texel = decode_texel(format, at, x % facts.block_width, y % facts.block_width);
                expected.push_back({texel.u[0], texel.u[1], texel.u[2], texel.u[3]});
            }
            const std::uint32_t kind = facts.is_integer() ? image_integer : 0u;
            const auto results = run_points(image_function(16), 16, &image.view, nullptr,
                                            {.flags = flags_of(ImageOperation::fetch) | kind}, points);
            for (std::size_t i = 0; i < points.size(); ++i) {
                for (int c = 0; c < 4; ++c) {
                    const float a = std::bit_cast<float>(results[i][c]), b = std::bit_cast<float>(expected[i][c]);
                    ASSERT_TRUE(results[i][c] == expected[i][c] || (std::isnan(a) && std::isnan(b)))
                        << facts.name << " channel " << c << " " << a << " instead of " << b;
                }
            }
            // A shader that sees another kind of channel reads zeros.
            for (const Result& result :
                 run_points(image_function(16), 16, &image.view, nullptr,
                            {.flags = flags_of(ImageOperation::fetch) | (kind ^ image_integer)}, points)) {
                ASSERT_EQ(result, Result{});
            }
        }
    }
}

TEST(ImageOperations, StoresWhatTexelsAre) {
    Random random(6);
    for (std::uint32_t f = 1; f < rhi::format_count; ++f) {
        const auto format = static_cast<Format>(f);
        const rhi::FormatInfo& facts = rhi::info(format);
        if (facts.is_compressed()) continue;
        for (int i = 0; i < 300; ++i) {
            TestImage image(shape_of(dimensions[i % 7], format, random), random);
            auto expected = image.content;
            std::vector<Point> points(16);
            for (std::uint32_t lane = 0; lane < 16; ++lane) {
                Point& point = points[lane];
                // In most trials a row, else anywhere, also outside.
                point.coordinates = {i % 3 != 0 ? lane : random_below(random, 22), random_below(random, 4),
                                     random_below(random, 4), 0};
                if (i % 3 == 1) point.coordinates[1] = point.coordinates[2] = 0;
                for (auto& channel : point.texel) {
                    channel = facts.is_integer() ? random_bits(random)
                              : random_below(random, 3) == 0
                                  ? std::bit_cast<std::uint32_t>(garbage_float(random))
                                  : std::bit_cast<std::uint32_t>(
                                        (static_cast<float>(random_below(random, 1023)) + 0.5f) / 1023.0f -
                                        (random_below(random, 2) ? 1.0f : 0.0f));
                }
                const ImageLevel& level = image.view.levels[0];
                std::uint32_t x = point.coordinates[0], y = point.coordinates[1], slice = point.coordinates[2];
                const ViewDimension dimension = image.shape.dimension;
                if (dimension == ViewDimension::d1) y = slice = 0;
                if (dimension == ViewDimension::d1_array) slice = y, y = 0;
                if (dimension == ViewDimension::d2) slice = 0;
                const bool is_3d = dimension == ViewDimension::d3;
                if (x >= level.width || y >= level.height || slice >= (is_3d ? level.depth : image.shape.layers))
                    continue;
                Texel texel;
                for (int c = 0; c < 4; ++c) texel.u[c] = point.texel[c];
                encode_texel(format, texel,
                             &expected[0][slice * (is_3d ? level.slice_stride : level.layer_stride) +
                                          y * level.row_stride + x * image.view.texel_bytes]);
            }
            const std::uint32_t kind = facts.is_integer() ? image_integer : 0u;
            run_points(image_function(16), 16, &image.view, nullptr, {.flags = flags_of(ImageOperation::store) | kind},
                       points);
            ASSERT_EQ(image.content, expected) << facts.name;
            run_points(image_function(16), 16, &image.view, nullptr,
                       {.flags = flags_of(ImageOperation::store) | (kind ^ image_integer)}, points);
            ASSERT_EQ(image.content, expected) << facts.name << " of another kind";
        }
    }
}

TEST(ImageOperations, AtomicsCountExactlyAcrossThreads) {
    Random random(7);
    for (const Format format : {Format::r32_uint, Format::r32_float}) {
        TestImage image({.format = format, .width = 3, .height = 2}, random);
        std::memset(image.content[0].data(), 0, image.content[0].size());
        // On a busy machine threads rarely run at once: each goes on until it has seen the other at work often enough,
        // and no longer than floats count exactly.
        constexpr std::uint32_t thread_count = 2, most_rounds = 1'000'000, enough_meetings = 2000;
        std::array<std::atomic<std::uint32_t>, thread_count> rounds{};
        std::vector<std::thread> threads;
        for (std::uint32_t t = 0; t < thread_count; ++t) {
            threads.emplace_back([&, t] {
                ImageArguments arguments{};
                arguments.atomic = format == Format::r32_uint ? AtomicOperation::add : AtomicOperation::add_float;
                for (std::uint32_t lane = 0; lane < 8; ++lane) {
                    arguments.coordinates[0][lane] = lane % 2;
                    arguments.coordinates[1][lane] = 1;
                    arguments.texel[0][lane] = format == Format::r32_uint ? 1u : std::bit_cast<std::uint32_t>(1.0f);
                }
                const NacreCpuImageFunction function = image_function(8);
                std::uint32_t meetings = 0, seen = 0;
                while (rounds[t] < most_rounds && meetings < enough_meetings) {
                    function(&image.view, nullptr, &arguments, flags_of(ImageOperation::atomic), 0xff);
                    ++rounds[t];
                    const std::uint32_t others = rounds[1 - t];
                    meetings += others != seen;
                    seen = others;
                }
            });
        }
        for (std::thread& thread : threads) thread.join();
        for (std::uint32_t texel = 0; texel < 6; ++texel) {
            std::uint32_t bits;
            std::memcpy(&bits, &image.content[0][4 * texel], 4);
            const double value = format == Format::r32_uint ? bits : std::bit_cast<float>(bits);
            EXPECT_EQ(value, texel == 3 || texel == 4 ? 4.0 * (rounds[0] + rounds[1]) : 0.0);
        }
    }
}

TEST(ImageOperations, AtomicsDoWhatTheySay) {
    Random random(8);
    for (int i = 0; i < 5000; ++i) {
        const auto operation = static_cast<AtomicOperation>(random_below(random, 13));
        const bool is_float = operation >= AtomicOperation::add_float;
        TestImage image({.format = is_float ? Format::r32_float : Format::r32_sint, .width = 1, .height = 1}, random);
        std::uint32_t old;
        std::memcpy(&old, image.content[0].data(), 4);
        Point point;
        point.texel[0] = is_float ? std::bit_cast<std::uint32_t>(random_float(random, -8, 8)) : random_bits(random);
        point.comparator = random_below(random, 2) == 0 ? old : random_bits(random);
        const std::uint32_t value = point.texel[0];
        const auto s = [](std::uint32_t bits) { return static_cast<std::int32_t>(bits); };
        const auto f = [](std::uint32_t bits) { return std::bit_cast<float>(bits); };
        const auto bits = [](float x) { return std::bit_cast<std::uint32_t>(x); };
        std::uint32_t wanted = 0;
        switch (operation) {
            case AtomicOperation::add: wanted = old + value; break;
            case AtomicOperation::minimum_signed: wanted = s(old) < s(value) ? old : value; break;
            case AtomicOperation::minimum_unsigned: wanted = old < value ? old : value; break;
            case AtomicOperation::maximum_signed: wanted = s(old) > s(value) ? old : value; break;
            case AtomicOperation::maximum_unsigned: wanted = old > value ? old : value; break;
            case AtomicOperation::bit_and: wanted = old & value; break;
            case AtomicOperation::bit_or: wanted = old | value; break;
            case AtomicOperation::bit_xor: wanted = old ^ value; break;
            case AtomicOperation::exchange: wanted = value; break;
            case AtomicOperation::compare_exchange: wanted = old == point.comparator ? value : old; break;
            case AtomicOperation::add_float: wanted = bits(f(old) + f(value)); break;
            case AtomicOperation::minimum_float: wanted = f(old) < f(value) ? old : value; break;
            case AtomicOperation::maximum_float: wanted = f(old) > f(value) ? old : value; break;
        }
        const Request request{.flags = flags_of(ImageOperation::atomic), .atomic = operation};
        const auto result = run_points(image_function(4), 4, &image.view, nullptr, request, {&point, 1});
        std::uint32_t found;
        std::memcpy(&found, image.content[0].data(), 4);
        ASSERT_EQ(found, wanted) << static_cast<int>(operation);
        ASSERT_EQ(result[0][0], old);
        // Outside, and for formats without it, nothing happens.
        point.coordinates[0] = 1;
        EXPECT_EQ(run_points(image_function(4), 4, &image.view, nullptr, request, {&point, 1})[0], Result{});
        point.coordinates[0] = 0;
        image.view.format = Format::rgba8_unorm;
        EXPECT_EQ(run_points(image_function(4), 4, &image.view, nullptr, request, {&point, 1})[0], Result{});
        std::memcpy(&found, image.content[0].data(), 4);
        ASSERT_EQ(found, wanted);
    }
}

// Levels that 32-bit offsets cannot span give the same results as small ones. Only the rows that are read are ever
// touched: layers lie a gigabyte apart in address space that is mostly never there, so the view is made to span it by
// its strides alone.
TEST(ImageOperations, FarTexelsAreReadLikeNearOnes) {
    Random random(9);
    for (const Format format :
         {Format::rgba8_unorm, Format::rgba8_srgb, Format::r32_uint, Format::rgba16_float, Format::r8_unorm}) {
        const TestImage image(
            {.format = format, .dimension = ViewDimension::d2_array, .width = 16, .height = 16, .layers = 3}, random);
        ImageView far = image.view;
        const std::uint32_t kind = rhi::info(format).is_integer() ? image_integer : 0u;
        std::vector<Point> points(160);
        const bool is_integer = kind != 0;
        for (Point& point : points) {
            point.coordinates = {random_below(random, 16), random_below(random, 16), 0, 0};
            if (!is_integer)
                for (int axis = 0; axis < 2; ++axis)
                    point.coordinates[axis] = std::bit_cast<std::uint32_t>(random_float(random, 0, 1));
        }
        // All points lie in layer 0; the others are a gigabyte away.
        far.levels[0].layer_stride = 1ull << 30;
        const SamplerState sampler{};
        const std::uint32_t flags =
            is_integer ? flags_of(ImageOperation::fetch) | kind : flags_of(ImageOperation::sample) | image_lod_explicit;
        const auto near_results = run_points(image_function(16), 16, &image.view, &sampler, {.flags = flags}, points);
        const auto far_results = run_points(image_function(16), 16, &far, &sampler, {.flags = flags}, points);
        for (std::size_t i = 0; i < points.size(); ++i) {
            for (int c = 0; c < 4; ++c) {
                if (is_integer)
                    ASSERT_EQ(near_results[i][c], far_results[i][c]);
                else
                    ASSERT_NEAR(std::bit_cast<float>(near_results[i][c]), std::bit_cast<float>(far_results[i][c]),
                                1e-6);
            }
        }
    }
}

TEST(ImageOperations, OnlyKnownLaneCounts) {
    EXPECT_EQ(image_function(0), nullptr);
    EXPECT_EQ(image_function(2), nullptr);
    EXPECT_EQ(image_function(32), nullptr);
    EXPECT_NE(image_function(4), nullptr);
    EXPECT_TRUE(is_supported(InstructionSet::baseline));
    EXPECT_TRUE(is_supported(best_instruction_set()));
}

}  // namespace
}  // namespace nacre::cpu::test
