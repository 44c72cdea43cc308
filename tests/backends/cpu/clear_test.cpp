// SPDX-License-Identifier: Apache-2.0
// Clears, decoded by a reference that knows nothing of the backend.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "backends/cpu/transfer.h"
#include "tests/rhi/texel_values.h"

namespace nacre::cpu {
namespace {

using rhi::Format;
using rhi::FormatKind;

struct Clears : testing::Test {
    std::shared_ptr<HostMemory> memory = std::make_shared<HostMemory>(std::uint64_t{1} << 30);
    std::unique_ptr<Scheduler> scheduler = Scheduler::create(3);
    Transfer transfer{*scheduler};

    std::unique_ptr<CpuTexture> make(const rhi::TextureDesc& desc) const {
        auto made = CpuTexture::create(memory, desc);
        if (!made) throw std::runtime_error(made.error().message());
        return std::unique_ptr<CpuTexture>(static_cast<CpuTexture*>(made->release()));
    }
};

rhi::ViewReference part(const CpuTexture& texture, std::uint32_t mip, std::uint32_t layer) {
    rhi::ViewReference view;
    view.format = texture.desc.format;
    view.base_mip = mip, view.base_layer = layer;
    return view;
}

bool is_color(Format format) {
    const rhi::FormatInfo& facts = rhi::info(format);
    return facts.block_bytes != 0 && facts.block_bytes != 12 && !facts.is_compressed() && !facts.is_depth_stencil();
}

TEST_F(Clears, SetEveryColorFormat) {
    int formats = 0;
    for (std::uint32_t i = 1; i < rhi::format_count; ++i) {
        const auto format = static_cast<Format>(i);
        const rhi::FormatInfo& facts = rhi::info(format);
        if (!is_color(format)) continue;
        ++formats;
        SCOPED_TRACE(facts.name);
        rhi::ClearColor color;
        std::array<double, 4> expected{};
        if (facts.kind == FormatKind::uint)
            color.uint = {1, 2, 3, 1}, expected = {1, 2, 3, 1};
        else if (facts.kind == FormatKind::sint)
            color.sint = {-5, 6, -7, 8}, expected = {-5, 6, -7, 8};
        else
            color.floating = {0.3f, 0.71f, 0.05f, 0.6f}, expected = {0.3, 0.71, 0.05, 0.6};
        for (std::size_t c = facts.channels; c < 4; ++c) expected[c] = c == 3 ? 1.0 : 0.0;
        const auto texture = make({.format = format, .width = 5, .height = 3});
        transfer.clear_color(texture->whole(), color);
        const auto bytes = std::span(texture->whole().levels[0].data, std::size_t{15} * facts.block_bytes);
        for (std::size_t at = 0; at < bytes.size(); at += facts.block_bytes) {
            const test::TexelValue found = test::decode_texel(format, bytes.subspan(at, facts.block_bytes));
            for (std::size_t c = 0; c < 4; ++c)
                EXPECT_NEAR(found.channels[c], expected[c], found.step[c] * 0.501 + (facts.is_integer() ? 0.0 : 1e-7))
                    << c;
        }
    }
    EXPECT_GE(formats, 40);
}

TEST_F(Clears, LeaveOtherMipsAndLayersAlone) {
    const auto texture = make({.format = Format::r32_uint, .width = 8, .height = 8, .layers = 4, .mips = 3});
    transfer.clear_color(texture->whole(), {.uint = {7, 0, 0, 0}});
    rhi::ViewReference view = part(*texture, 1, 1);
    view.dimension = rhi::ViewDimension::d2_array;
    view.layer_count = 2;
    transfer.clear_color(texture->make_view(view), {.uint = {9, 0, 0, 0}});
    for (std::uint32_t mip = 0; mip < 3; ++mip)
        for (std::uint32_t layer = 0; layer < 4; ++layer) {
            const ImageView one = texture->make_view(part(*texture, mip, layer));
            const std::uint32_t size = 8 >> mip;
            for (std::uint32_t i = 0; i < size * size; ++i) {
                std::uint32_t value = 0;
                std::memcpy(&value, one.levels[0].data + i * 4, 4);
                EXPECT_EQ(value, mip == 1 && (layer == 1 || layer == 2) ? 9u : 7u) << mip << ", " << layer;
            }
        }
}

TEST_F(Clears, SetAllSamplesSlicesAndLargeTextures) {
    for (const rhi::TextureDesc& desc :
         {rhi::TextureDesc{.format = Format::rg32_uint, .width = 7, .height = 9, .samples = 4},
          rhi::TextureDesc{.dimension = rhi::TextureDimension::d3,
          .format = Format::rg32_uint,
          .width = 7,
          .height = 9,
          .depth = 5,
          .mips = 3},
          rhi::TextureDesc{.format = Format::rg32_uint, .width = 701, .height = 301, .layers = 2}}) {
        const auto texture = make(desc);
        transfer.clear_color(texture->whole(), {.uint = {5, 6, 0, 0}});
        std::uint64_t wrong = 0, texels = 0;
        const ImageView& whole = texture->whole();
        for (std::uint32_t mip = 0; mip < whole.mip_count; ++mip)
            for (std::uint32_t layer = 0; layer < whole.layer_count; ++layer) {
                const ImageLevel& level = whole.levels[mip];
                const std::uint64_t count = std::uint64_t{level.width} * level.height * level.depth * whole.samples;
                for (std::uint64_t i = 0; i < count; ++i, ++texels) {
                    std::array<std::uint32_t, 2> value{};
                    std::memcpy(&value, level.data + layer * level.layer_stride + i * 8, 8);
                    wrong += value != std::array<std::uint32_t, 2>{5, 6};
                }
            }
        EXPECT_EQ(wrong, 0u);
        EXPECT_GT(texels, 200u);
    }
}

TEST_F(Clears, SetDepthAndStencilApart) {
    for (const Format format :
         {Format::d16_unorm, Format::d32_float, Format::d24_unorm_s8_uint, Format::d32_float_s8_uint}) {
        SCOPED_TRACE(rhi::info(format).name);
        const auto texture = make({.format = format, .width = 3, .height = 2, .samples = 4});
        const ImageView& whole = texture->whole();
        transfer.clear_stencil(whole, 0xa5);
        transfer.clear_depth(whole, 0.3f);
        for (std::uint32_t i = 0; i < 24; ++i) {
            std::uint32_t code = 0;
            std::memcpy(&code, whole.levels[0].data + i * whole.texel_bytes, whole.texel_bytes);
            if (format == Format::d16_unorm) {
                EXPECT_EQ(code, 19661u);  // round(0.3 * 65535)
            } else if (format == Format::d24_unorm_s8_uint) {
                EXPECT_EQ(code, 5033165u);  // round(0.3f * 16777215)
            } else {
                EXPECT_EQ(std::bit_cast<float>(code), 0.3f);
            }
            if (rhi::info(format).has_stencil) {
                EXPECT_EQ(whole.stencil_levels[0].data[i], std::byte{0xa5});
            }
        }
        transfer.clear_depth(whole, std::nanf(""));
        EXPECT_EQ(whole.levels[0].data[0], std::byte{0});
        if (rhi::info(format).has_stencil) {
            EXPECT_EQ(whole.stencil_levels[0].data[0], std::byte{0xa5});
        }
    }
}

}  // namespace
}  // namespace nacre::cpu
