// SPDX-License-Identifier: Apache-2.0
// Mips and resolves against sums in double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "backends/cpu/transfer.h"
#include "tests/rhi/texel_values.h"

namespace nacre::cpu {
namespace {

using rhi::Format;
using rhi::FormatKind;
using rhi::TextureDimension;

std::unique_ptr<CpuTexture> make(const rhi::TextureDesc& desc) {
    static const auto memory = std::make_shared<HostMemory>(std::uint64_t{1} << 32);
    auto made = CpuTexture::create(memory, desc);
    if (!made) throw std::runtime_error(made.error().message());
    return std::unique_ptr<CpuTexture>(static_cast<CpuTexture*>(made->release()));
}

/// Bytes whose floats, of any width, are finite and of similar size.
void fill(const ImageView& view, std::uint32_t mip, std::uint32_t seed) {
    std::mt19937 random(seed);
    const ImageLevel& level = view.levels[mip];
    const bool is_float = rhi::info(view.format).kind == FormatKind::floating;
    for (std::uint64_t i = 0; i < level.layer_stride * view.layer_count; ++i)
        level.data[i] = static_cast<std::byte>(is_float ? random() & 0x3b : random());
}

double channel(const ImageView& view, std::uint32_t mip, std::uint32_t x, std::uint32_t y, std::uint32_t z,
               std::uint32_t sample, std::uint32_t layer, std::size_t c, double* step = nullptr) {
    const ImageLevel& level = view.levels[mip];
    const std::byte* texel = level.data + layer * level.layer_stride + sample * level.sample_stride +
                             z * level.slice_stride + std::uint64_t{y} * level.row_stride +
                             std::uint64_t{x} * view.texel_bytes;
    const test::TexelValue value = test::decode_texel(view.format, std::span(texel, view.texel_bytes));
    if (step) *step = value.step[c];
    return value.channels[c];
}

bool is_averaged(Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    return facts.block_bytes != 0 && facts.block_bytes != 12 && !facts.is_compressed() && !facts.is_depth_stencil() &&
           !facts.is_integer();
}

/// What a texel of the next mip is in double precision: linear interpolation at its center along each axis.
double expected_mip(const ImageView& view, std::uint32_t mip, std::array<std::uint32_t, 3> at, std::uint32_t layer,
                    std::size_t c) {
    const ImageLevel &from = view.levels[mip - 1], &to = view.levels[mip];
    const std::array<std::uint32_t, 3> sizes{from.width, from.height, from.depth}, next{to.width, to.height, to.depth};
    std::array<double, 3> low{}, weight{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double place = (at[axis] + 0.5) * sizes[axis] / next[axis] - 0.5;
        low[axis] = std::floor(place);
        weight[axis] = place - low[axis];
    }
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        double share = 1;
        std::array<std::uint32_t, 3> texel{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const bool high = (corner >> axis & 1) != 0;
            share *= high ? weight[axis] : 1 - weight[axis];
            texel[axis] = static_cast<std::uint32_t>(std::clamp(low[axis] + high, 0.0, sizes[axis] - 1.0));
        }
        if (share != 0) sum += share * channel(view, mip - 1, texel[0], texel[1], texel[2], 0, layer, c);
    }
    return sum;
}

void expect_mips(const ImageView& view) {
    for (std::uint32_t mip = 1; mip < view.mip_count; ++mip)
        for (std::uint32_t layer = 0; layer < view.layer_count; ++layer)
            for (std::uint32_t z = 0; z < view.levels[mip].depth; ++z)
                for (std::uint32_t y = 0; y < view.levels[mip].height; ++y)
                    for (std::uint32_t x = 0; x < view.levels[mip].width; ++x)
                        for (std::size_t c = 0; c < rhi::info(view.format).channels; ++c) {
                            double step = 0;
                            const double found = channel(view, mip, x, y, z, 0, layer, c, &step);
                            const double expected = expected_mip(view, mip, {x, y, z}, layer, c);
                            ASSERT_NEAR(found, expected, step * 0.51 + std::abs(expected) * 1e-6 + 1e-30)
                                << rhi::info(view.format).name << ", mip " << mip << " at " << x << ", " << y << ", "
                                << z;
                        }
}

TEST(Mips, AverageEveryFormat) {
    const auto scheduler = Scheduler::create(2);
    Transfer transfer(*scheduler);
    int formats = 0;
    for (std::uint32_t i = 1; i < rhi::format_count; ++i) {
        const auto format = static_cast<Format>(i);
        if (!is_averaged(format)) continue;
        ++formats;
        const auto texture = make({.format = format, .width = 16, .height = 8, .layers = 2, .mips = 5});
        fill(texture->whole(), 0, i);
        transfer.generate_mips(texture->whole());
        expect_mips(texture->whole());
    }
    EXPECT_GE(formats, 24);
}

TEST(Mips, OfAnyShapeAreInterpolatedAtTheirCenters) {
    const auto scheduler = Scheduler::create(3);
    Transfer transfer(*scheduler);
    for (const rhi::TextureDesc& desc :
         {rhi::TextureDesc{.format = Format::rgba32_float, .width = 13, .height = 6, .mips = 4},
          rhi::TextureDesc{.format = Format::rgba8_srgb, .width = 1021, .height = 3, .mips = 10},
          rhi::TextureDesc{.format = Format::bgra8_unorm, .width = 1, .height = 700, .mips = 10},
          rhi::TextureDesc{.format = Format::r32_float, .width = 515, .height = 259, .mips = 10},
          rhi::TextureDesc{
              .dimension = TextureDimension::d1, .format = Format::rg32_float, .width = 77, .layers = 3, .mips = 7},
          rhi::TextureDesc{.dimension = TextureDimension::d3,
          .format = Format::rgba16_float,
          .width = 9,
          .height = 6,
          .depth = 5,
          .mips = 4},
          rhi::TextureDesc{.dimension = TextureDimension::cube,
          .format = Format::rg8_unorm,
          .width = 12,
          .height = 12,
          .layers = 6,
          .mips = 4}}) {
        const auto texture = make(desc);
        fill(texture->whole(), 0, desc.width);
        transfer.generate_mips(texture->whole());
        expect_mips(texture->whole());
    }
}

TEST(Mips, DoNotDependOnThreads) {
    std::vector<std::vector<std::byte>> results;
    for (const std::uint32_t threads : {1u, 4u}) {
        const auto scheduler = Scheduler::create(threads);
        Transfer transfer(*scheduler);
        const auto texture = make({.format = Format::rgba8_srgb, .width = 600, .height = 400, .mips = 10});
        fill(texture->whole(), 0, 1);
        transfer.generate_mips(texture->whole());
        const std::byte* begin = texture->whole().levels[0].data;
        results.emplace_back(begin, begin + texture->memory_bytes);
    }
    EXPECT_TRUE(results[0] == results[1]);
}

TEST(Resolves, AverageTheSamplesOfEveryFormat) {
    const auto scheduler = Scheduler::create(2);
    Transfer transfer(*scheduler);
    int formats = 0;
    for (std::uint32_t i = 1; i < rhi::format_count; ++i) {
        const auto format = static_cast<Format>(i);
        if (!is_averaged(format)) continue;
        ++formats;
        // Wider than the pieces that rows are worked on in.
        const auto source = make({.format = format, .width = 301, .height = 5, .samples = 4});
        const auto destination = make({.format = format, .width = 301, .height = 5});
        fill(source->whole(), 0, i);
        transfer.resolve(source->whole(), destination->whole(), 301, 5);
        for (std::uint32_t y = 0; y < 5; ++y)
            for (std::uint32_t x = 0; x < 301; ++x)
                for (std::size_t c = 0; c < rhi::info(format).channels; ++c) {
                    double expected = 0, step = 0;
                    for (std::uint32_t sample = 0; sample < 4; ++sample)
                        expected += channel(source->whole(), 0, x, y, 0, sample, 0, c) / 4;
                    const double found = channel(destination->whole(), 0, x, y, 0, 0, 0, c, &step);
                    ASSERT_NEAR(found, expected, step * 0.51 + std::abs(expected) * 1e-6 + 1e-30)
                        << rhi::info(format).name << " at " << x << ", " << y;
                }
    }
    EXPECT_GE(formats, 24);
}

TEST(Resolves, SeeWhereOneSampleOfOneTexelDiffers) {
    const auto scheduler = Scheduler::create(2);
    Transfer transfer(*scheduler);
    for (std::uint32_t sample = 0; sample < 4; ++sample) {
        const auto source = make({.format = Format::r8_unorm, .width = 301, .height = 3, .samples = 4});
        const auto destination = make({.format = Format::r8_unorm, .width = 301, .height = 3});
        const ImageLevel& level = source->whole().levels[0];
        std::memset(level.data, 40, level.layer_stride);
        level.data[sample * level.sample_stride + 301 + 170] = std::byte{80};
        transfer.resolve(source->whole(), destination->whole(), 301, 3);
        for (std::uint32_t i = 0; i < 903; ++i)
            ASSERT_EQ(destination->whole().levels[0].data[i], i == 301 + 170 ? std::byte{50} : std::byte{40})
                << sample << ", " << i;
    }
}

TEST(Resolves, TakeTheFirstSampleOfIntegers) {
    const auto scheduler = Scheduler::create(2);
    Transfer transfer(*scheduler);
    const auto source = make({.format = Format::rgba16_sint, .width = 33, .height = 7, .samples = 4});
    const auto destination = make({.format = Format::rgba16_sint, .width = 33, .height = 7});
    fill(source->whole(), 0, 4);
    transfer.resolve(source->whole(), destination->whole(), 33, 7);
    EXPECT_EQ(std::memcmp(source->whole().levels[0].data, destination->whole().levels[0].data, 33 * 7 * 8), 0);
    EXPECT_NE(std::memcmp(source->whole().levels[0].data + 33 * 7 * 8, destination->whole().levels[0].data, 33 * 7 * 8),
              0);
}

TEST(Resolves, TouchNothingBesideThePass) {
    const auto scheduler = Scheduler::create(2);
    Transfer transfer(*scheduler);
    const auto source = make({.format = Format::rgba8_unorm, .width = 6, .height = 6, .samples = 4});
    const auto destination = make({.format = Format::rgba8_unorm, .width = 6, .height = 6});
    transfer.clear_color(source->whole(), {.floating = {1, 1, 1, 1}});
    transfer.resolve(source->whole(), destination->whole(), 4, 3);
    for (std::uint32_t y = 0; y < 6; ++y)
        for (std::uint32_t x = 0; x < 6; ++x)
            EXPECT_EQ(channel(destination->whole(), 0, x, y, 0, 0, 0, 0), x < 4 && y < 3 ? 1.0 : 0.0);
}

}  // namespace
}  // namespace nacre::cpu
