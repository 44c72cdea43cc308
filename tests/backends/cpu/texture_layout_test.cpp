// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstring>

#include "backends/cpu/texture.h"

namespace nacre::cpu {
namespace {

using rhi::Format;
using rhi::TextureDimension;

/// Where image_view.h says that a texel or block lies.
std::byte* address(const ImageLevel& level, std::uint32_t x, std::uint32_t y, std::uint32_t z, std::uint32_t sample,
                   std::uint32_t layer, std::uint32_t texel_bytes) {
    return level.data + layer * level.layer_stride + sample * level.sample_stride + z * level.slice_stride +
           std::uint64_t{y} * level.row_stride + std::uint64_t{x} * texel_bytes;
}

template <typename Visit>
void for_each_texel(const ImageView& view, const std::array<ImageLevel, max_mips>& levels, std::uint32_t texel_bytes,
                    Visit&& visit) {
    const std::uint32_t edge = rhi::info(view.format).block_width;
    for (std::uint32_t mip = 0; mip < view.mip_count; ++mip)
        for (std::uint32_t layer = 0; layer < view.layer_count; ++layer)
            for (std::uint32_t sample = 0; sample < view.samples; ++sample)
                for (std::uint32_t z = 0; z < levels[mip].depth; ++z)
                    for (std::uint32_t y = 0; y < (levels[mip].height + edge - 1) / edge; ++y)
                        for (std::uint32_t x = 0; x < (levels[mip].width + edge - 1) / edge; ++x)
                            visit(address(levels[mip], x, y, z, sample, layer, texel_bytes));
}

TEST(TextureLayout, GivesEveryTexelItsOwnZeroedPlace) {
    const rhi::TextureDesc cases[]{
        {.dimension = TextureDimension::d1, .format = Format::r8_unorm, .width = 13, .layers = 3, .mips = 4},
        {.format = Format::rgba8_unorm, .width = 13, .height = 7, .layers = 5, .mips = 4},
        {.format = Format::rgba32_float, .width = 5, .height = 5, .samples = 4},
        {.dimension = TextureDimension::d3,
         .format = Format::rg16_float,
         .width = 7,
         .height = 5,
         .depth = 9,
         .mips = 4},
        {.dimension = TextureDimension::cube,
         .format = Format::r16_uint,
         .width = 8,
         .height = 8,
         .layers = 12,
         .mips = 4},
        {.format = Format::bc1_rgba_unorm, .width = 18, .height = 10, .layers = 2, .mips = 5},
        {.format = Format::bc7_rgba_srgb, .width = 20, .height = 12},
        {.format = Format::d24_unorm_s8_uint, .width = 9, .height = 4, .layers = 2, .mips = 2},
        {.format = Format::d32_float_s8_uint, .width = 3, .height = 4, .samples = 4},
        {.format = Format::d16_unorm, .width = 3, .height = 4},
    };
    for (const rhi::TextureDesc& desc : cases) {
        SCOPED_TRACE(rhi::info(desc.format).name);
        const auto memory = std::make_shared<HostMemory>(std::uint64_t{1} << 30);
        auto made = CpuTexture::create(memory, desc);
        ASSERT_TRUE(made) << made.error().message();
        const auto& texture = static_cast<CpuTexture&>(**made);
        const ImageView& whole = texture.whole();
        EXPECT_EQ(texture.whole().stencil_levels[0].data != nullptr, rhi::info(desc.format).has_stencil);
        std::uint64_t texels = 0, stencils = 0, set_bytes = 0;
        for_each_texel(whole, whole.levels, whole.texel_bytes, [&](std::byte* place) {
            for (std::uint32_t i = 0; i < whole.texel_bytes; ++i) set_bytes += place[i] != std::byte{0};
            // A number of its own, as far as its bytes hold it.
            ++texels;
            std::memcpy(place, &texels, std::min<std::size_t>(whole.texel_bytes, 8));
        });
        if (whole.stencil_levels[0].data)
            for_each_texel(whole, whole.stencil_levels, 1, [&](std::byte* place) {
                set_bytes += *place != std::byte{0};
                *place = static_cast<std::byte>(0x80 + stencils++ % 64);
            });
        EXPECT_EQ(set_bytes, 0u);
        std::uint64_t number = 0, wrong = 0;
        for_each_texel(whole, whole.levels, whole.texel_bytes, [&](std::byte* place) {
            ++number;
            wrong += std::memcmp(place, &number, std::min<std::size_t>(whole.texel_bytes, 8)) != 0;
        });
        number = 0;
        if (whole.stencil_levels[0].data)
            for_each_texel(whole, whole.stencil_levels, 1,
                           [&](std::byte* place) { wrong += *place != static_cast<std::byte>(0x80 + number++ % 64); });
        EXPECT_EQ(wrong, 0u) << "texels share bytes";
        EXPECT_GE(texture.memory_bytes, texels * whole.texel_bytes + stencils);
    }
}

TEST(TextureLayout, ViewsBeginAtTheirMipAndLayer) {
    const auto memory = std::make_shared<HostMemory>(std::uint64_t{1} << 30);
    const rhi::TextureDesc desc{.dimension = TextureDimension::cube,
                                .format = Format::rgba8_unorm,
                                .width = 16,
                                .height = 16,
                                .layers = 12,
                                .mips = 5};
    auto made = CpuTexture::create(memory, desc);
    ASSERT_TRUE(made);
    auto& texture = static_cast<CpuTexture&>(**made);
    rhi::ViewReference reference;
    reference.dimension = rhi::ViewDimension::cube;
    reference.format = Format::rgba8_srgb;
    reference.base_mip = 2, reference.mip_count = 3, reference.base_layer = 6, reference.layer_count = 6;
    const ImageView* view = texture.view(reference);
    EXPECT_EQ(view->format, Format::rgba8_srgb);
    EXPECT_EQ(view->dimension, rhi::ViewDimension::cube);
    EXPECT_EQ(view->mip_count, 3u);
    EXPECT_EQ(view->layer_count, 6u);
    EXPECT_EQ(view->texel_bytes, 4u);
    for (std::uint32_t mip = 0; mip < 3; ++mip) {
        EXPECT_EQ(view->levels[mip].width, 4u >> mip);
        EXPECT_EQ(view->levels[mip].data,
                  texture.whole().levels[mip + 2].data + 6 * texture.whole().levels[mip + 2].layer_stride);
    }
    // The same view is one object, another is another.
    EXPECT_EQ(texture.view(reference), view);
    reference.base_layer = 0;
    EXPECT_NE(texture.view(reference), view);
    EXPECT_EQ(texture.view(reference)->levels[0].data, texture.whole().levels[2].data);
}

TEST(TextureLayout, SaysWhatItWantedWhenMemoryRunsOut) {
    const auto memory = std::make_shared<HostMemory>(1000);
    const auto made =
        CpuTexture::create(memory, {.format = Format::rgba8_unorm, .width = 100, .height = 20, .name = "big"});
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().code, ErrorCode::out_of_memory);
    EXPECT_NE(made.error().message().find("100x20"), std::string::npos) << made.error().message();
    EXPECT_EQ(memory->reserved_bytes(), 0u);
}

}  // namespace
}  // namespace nacre::cpu
