// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "backends/cpu/image_view.h"
#include "backends/cpu/images/double_operations.h"
#include "backends/cpu/images/image_operations.h"
#include "backends/cpu/images/texel_formats.h"
#include "rhi/resources.h"

/// @file
/// Images of random texels, and calls of image operations for any number of points.

namespace nacre::cpu::test {

using Random = std::mt19937;

inline std::uint32_t random_bits(Random& random) { return static_cast<std::uint32_t>(random()); }
inline float random_float(Random& random, float low, float high) {
    return low + (high - low) * static_cast<float>(random() >> 8) * 0x1p-24f;
}
inline std::uint32_t random_below(Random& random, std::uint32_t count) {
    return static_cast<std::uint32_t>(random() % count);
}

inline bool is_cube(rhi::ViewDimension dimension) {
    return dimension == rhi::ViewDimension::cube || dimension == rhi::ViewDimension::cube_array;
}

struct ImageShape {
    rhi::Format format = rhi::Format::rgba8_unorm;
    rhi::ViewDimension dimension = rhi::ViewDimension::d2;
    std::uint32_t width = 16, height = 16, depth = 1;
    std::uint32_t layers = 1;  ///< Cubes: 6 for each.
    std::uint32_t mips = 1;
    std::uint32_t samples = 1;
};

/// An image in memory. `content[mip][layer]` holds the texels of all slices and samples without padding; they lie one
/// sample after the other.
class TestImage {
  public:
    /// Texels with values in [-4, 4] where the format has a sign, else [0, 4] (fixed point: [-1, 1] or [0, 1]);
    /// integers of all bits; compressed formats of random blocks.
    TestImage(const ImageShape& wanted, Random& random) : shape(wanted) {
        view.format = shape.format;
        view.dimension = shape.dimension;
        view.mip_count = shape.mips;
        view.layer_count = shape.layers;
        view.samples = shape.samples;
        const rhi::FormatInfo& facts = rhi::info(shape.format);
        const std::uint32_t bytes = facts.has_stencil ? 4 : facts.block_bytes, block = facts.block_width;
        view.texel_bytes = bytes;
        content.resize(shape.mips);
        for (std::uint32_t mip = 0; mip < shape.mips; ++mip) {
            ImageLevel& level = view.levels[mip];
            level.width = std::max(1u, shape.width >> mip);
            level.height = std::max(1u, shape.height >> mip);
            level.depth = std::max(1u, shape.depth >> mip);
            level.row_stride = (level.width + block - 1) / block * bytes;
            level.slice_stride = std::uint64_t{level.row_stride} * ((level.height + block - 1) / block);
            level.sample_stride = level.slice_stride * level.depth;
            level.layer_stride = level.sample_stride * shape.samples;
            content[mip].resize(level.layer_stride * shape.layers);
            for (std::size_t at = 0; at < content[mip].size(); at += bytes) fill(&content[mip][at], bytes, random);
            level.data = content[mip].data();
        }
    }
    TestImage(const TestImage&) = delete;

    [[nodiscard]] std::span<const std::byte> layer(std::uint32_t mip, std::uint32_t index) const {
        const std::uint64_t stride = view.levels[mip].layer_stride;
        return std::span(content[mip]).subspan(index * stride, stride);
    }

    ImageShape shape;
    ImageView view;
    std::vector<std::vector<std::byte>> content;

  private:
    void fill(std::byte* at, std::uint32_t bytes, Random& random) const {
        const rhi::FormatInfo& facts = rhi::info(shape.format);
        if (facts.is_compressed() || facts.is_integer()) {
            for (std::uint32_t i = 0; i < bytes; ++i) at[i] = static_cast<std::byte>(random());
            return;
        }
        const bool is_depth = facts.is_depth_stencil();
        const bool is_fixed = facts.kind == rhi::FormatKind::unorm || facts.kind == rhi::FormatKind::srgb || is_depth;
        const float high = is_fixed || facts.kind == rhi::FormatKind::snorm ? 1.0f : 4.0f;
        const float low =
            is_fixed || shape.format == rhi::Format::rg11b10_float || shape.format == rhi::Format::rgb9e5_float ? 0.0f
                                                                                                                : -high;
        Texel texel;
        for (float& channel : texel.f) channel = random_float(random, low, high);
        encode_texel(shape.format, texel, at);
    }
};

/// What one lane asks for.
struct Point {
    std::array<std::uint32_t, 4> coordinates{};  ///< Bits.
    float lod = 0.0f;
    float reference = 0.0f;
    std::array<float, 3> gradient_x{}, gradient_y{};
    std::array<std::int32_t, 3> offset{};
    std::int32_t sample = 0;
    float min_lod = 0.0f;
    std::array<std::uint32_t, 4> texel{};
    std::uint32_t comparator = 0;
};
using Result = std::array<std::uint32_t, 4>;

struct Request {
    std::uint32_t flags = 0;
    std::array<std::array<std::int32_t, 2>, 4> gather_offsets{};
    AtomicOperation atomic = AtomicOperation::add;
};

inline void set_lane(ImageArguments& arguments, std::uint32_t lane, const Point& point) {
    for (int i = 0; i < 4; ++i) arguments.coordinates[i][lane] = point.coordinates[i];
    arguments.lod[lane] = point.lod;
    arguments.reference[lane] = point.reference;
    for (int i = 0; i < 3; ++i) {
        arguments.gradient_x[i][lane] = point.gradient_x[i];
        arguments.gradient_y[i][lane] = point.gradient_y[i];
        arguments.offset[i][lane] = point.offset[i];
    }
    arguments.sample[lane] = point.sample;
    arguments.min_lod[lane] = point.min_lod;
    for (int i = 0; i < 4; ++i) arguments.texel[i][lane] = point.texel[i];
    arguments.comparator[lane] = point.comparator;
}

/// Runs an operation for all points, `lanes` at once.
inline std::vector<Result> run_points(NacreCpuImageFunction function, std::uint32_t lanes, const ImageView* image,
                                      const SamplerState* sampler, const Request& request,
                                      std::span<const Point> points) {
    std::vector<Result> results(points.size());
    ImageArguments arguments{};
    for (std::size_t first = 0; first < points.size(); first += lanes) {
        const std::size_t count = std::min<std::size_t>(lanes, points.size() - first);
        for (std::uint32_t lane = 0; lane < lanes; ++lane)
            set_lane(arguments, lane, points[first + std::min<std::size_t>(lane, count - 1)]);
        for (int i = 0; i < 4; ++i) {
            for (int axis = 0; axis < 2; ++axis) arguments.gather_offsets[i][axis] = request.gather_offsets[i][axis];
        }
        arguments.atomic = request.atomic;
        function(image, sampler, &arguments, request.flags, static_cast<std::uint32_t>((1ull << count) - 1));
        for (std::size_t lane = 0; lane < count; ++lane) {
            for (int c = 0; c < 4; ++c) results[first + lane][c] = arguments.result[c][lane];
        }
    }
    return results;
}

/// The same in double precision, where the result is not rounded.
inline std::vector<std::array<double, 4>> run_points_in_double(const ImageView* image, const SamplerState* sampler,
                                                               const Request& request, std::span<const Point> points) {
    constexpr std::size_t lanes = max_lanes;
    std::vector<std::array<double, 4>> results(points.size());
    DoubleImageArguments arguments{};
    for (std::size_t first = 0; first < points.size(); first += lanes) {
        const std::size_t count = std::min(lanes, points.size() - first);
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const Point& point = points[first + std::min(lane, count - 1)];
            for (std::size_t i = 0; i < 4; ++i)
                arguments.coordinates[i][lane] = std::bit_cast<float>(point.coordinates[i]);
            arguments.lod[lane] = point.lod, arguments.reference[lane] = point.reference;
            for (std::size_t i = 0; i < 3; ++i) {
                arguments.gradient_x[i][lane] = point.gradient_x[i];
                arguments.gradient_y[i][lane] = point.gradient_y[i];
                arguments.offset[i][lane] = point.offset[i];
            }
            arguments.min_lod[lane] = point.min_lod;
        }
        double_image_function()(image, sampler, &arguments, request.flags,
                                static_cast<std::uint32_t>((1ull << count) - 1));
        for (std::size_t lane = 0; lane < count; ++lane)
            for (std::size_t c = 0; c < 4; ++c) results[first + lane][c] = arguments.result[c][lane];
    }
    return results;
}

/// Coordinates between the view's axes, plus a layer where it has some.
inline std::uint32_t coordinate_count(rhi::ViewDimension dimension) {
    using enum rhi::ViewDimension;
    switch (dimension) {
        case d1: return 1;
        case d1_array:
        case d2: return 2;
        case cube_array: return 4;
        default: return 3;
    }
}

}  // namespace nacre::cpu::test
