// SPDX-License-Identifier: Apache-2.0
// Copies through the front end, against the same copies made texel by texel here.
#include "backends/cpu/transfer.h"
#include "tests/backends/cpu/cpu_device.h"

namespace nacre::cpu {
namespace {

using rhi::Format;
using rhi::TextureUsage;

constexpr TextureUsage copies = TextureUsage::copy_source | TextureUsage::copy_destination | TextureUsage::sampled;

TEST(Copies, OfBuffersSmallAndLarge) {
    const auto device = make_device();
    for (const std::uint64_t size : {64u, 5'000'000u}) {
        const rhi::Buffer from = make_buffer(*device, size), to = make_buffer(*device, size);
        const auto content = random_bytes(size, 1);
        ok(device->write_buffer(from, std::span<const std::byte>(content)));
        rhi::CommandList list = device->create_command_list();
        list.fill_buffer(to, 0x01020304);
        list.copy_buffer(from, 12, to, 20, size - 32);
        run(*device, std::move(list));
        const auto result = ok(device->read_buffer(to));
        std::vector<std::byte> expected(size);
        for (std::uint64_t i = 0; i < size; ++i)
            expected[i] = i >= 20 && i < size - 12 ? content[i - 8] : static_cast<std::byte>(4 - i % 4);
        EXPECT_TRUE(result == expected) << size;
        // Within one buffer.
        rhi::CommandList within = device->create_command_list();
        within.copy_buffer(to, 0, to, 32, 16);
        run(*device, std::move(within));
        std::copy_n(expected.begin(), 16, expected.begin() + 32);
        EXPECT_TRUE(ok(device->read_buffer(to)) == expected) << size;
    }
}

TEST(Copies, OfBoxesInVolumesWithPaddedRows) {
    const auto device = make_device();
    const rhi::TextureDesc desc{.dimension = rhi::TextureDimension::d3,
                                .format = Format::r16_uint,
                                .width = 7,
                                .height = 6,
                                .depth = 5,
                                .usage = copies,
                                .name = "volume"};
    const rhi::Texture volume = ok(device->create_texture(desc));
    const auto content = random_bytes(2000, 2);
    const rhi::Buffer from = make_buffer(*device, 2000), to = make_buffer(*device, 2000);
    ok(device->write_buffer(from, std::span<const std::byte>(content)));
    rhi::BufferTextureCopy region{
        .buffer_offset = 8, .bytes_per_row = 12, .rows_per_slice = 7, .offset = {2, 1, 1}, .extent = {4, 3, 3}};
    rhi::CommandList list = device->create_command_list();
    list.clear_texture(volume, {.uint = {77, 0, 0, 0}});
    list.copy_buffer_to_texture(from, volume, region);
    region.buffer_offset = 100, region.bytes_per_row = 20, region.rows_per_slice = 4;
    region.offset = {1, 1, 0}, region.extent = {6, 4, 4};
    list.copy_texture_to_buffer(volume, to, region);
    run(*device, std::move(list));
    const auto texels = as_values<std::uint16_t>(ok(device->read_texture(volume)));
    const auto source = as_values<std::uint16_t>(content);
    const auto expected = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z) -> std::uint16_t {
        const bool inside = x >= 2 && x < 6 && y >= 1 && y < 4 && z >= 1 && z < 4;
        return inside ? source[4 + ((z - 1) * 7 + (y - 1)) * 6 + (x - 2)] : std::uint16_t{77};
    };
    for (std::uint32_t z = 0; z < 5; ++z)
        for (std::uint32_t y = 0; y < 6; ++y)
            for (std::uint32_t x = 0; x < 7; ++x) EXPECT_EQ(texels[(z * 6 + y) * 7 + x], expected(x, y, z));
    const auto copied = as_values<std::uint16_t>(ok(device->read_buffer(to)));
    for (std::uint32_t i = 0; i < copied.size(); ++i) {
        const std::uint32_t at = i - 50, x = at % 10, y = at / 10 % 4, z = at / 40;
        const bool inside = i >= 50 && x < 6 && z < 4;
        EXPECT_EQ(copied[i], inside ? expected(x + 1, y + 1, z) : 0) << i;
    }
}

TEST(Copies, OfBlocks) {
    const auto device = make_device();
    for (const Format format : {Format::bc1_rgba_unorm, Format::bc5_rg_snorm, Format::bc7_rgba_srgb}) {
        const std::uint32_t bytes = rhi::info(format).block_bytes;
        // 18x10 texels are 5x3 blocks, the last of each row and column cut.
        const rhi::TextureDesc desc{
            .format = format, .width = 18, .height = 10, .layers = 2, .mips = 2, .usage = copies, .name = "blocks"};
        const rhi::Texture first = ok(device->create_texture(desc)), second = ok(device->create_texture(desc));
        const auto content = random_bytes(std::uint64_t{15} * bytes, 3);
        ok(device->write_texture(first, content, 0, 1));
        EXPECT_TRUE(ok(device->read_texture(first, 0, 1)) == content);
        rhi::CommandList list = device->create_command_list();
        list.copy_texture(
            first, second,
            {.source_layer = 1, .source_offset = {0, 4, 0}, .destination_offset = {8, 4, 0}, .extent = {8, 6, 1}});
        run(*device, std::move(list));
        const auto copied = ok(device->read_texture(second));
        for (std::uint32_t y = 0; y < 3; ++y)
            for (std::uint32_t x = 0; x < 5; ++x)
                for (std::uint32_t i = 0; i < bytes; ++i) {
                    const bool inside = x >= 2 && x < 4 && y >= 1;
                    EXPECT_EQ(copied[(y * 5 + x) * bytes + i],
                              inside ? content[(y * 5 + x - 2) * bytes + i] : std::byte{0});
                }
    }
}

TEST(Copies, OfDepthLeaveTheStencilAlone) {
    const auto device = make_device();
    const rhi::TextureDesc desc{.format = Format::d24_unorm_s8_uint,
                                .width = 4,
                                .height = 2,
                                .usage = copies | TextureUsage::depth_target,
                                .name = "depth"};
    const rhi::Texture texture = ok(device->create_texture(desc));
    // The upper bits of 24-bit depth say nothing.
    const std::vector<std::uint32_t> codes{0xff123456, 0, 0x00ffffff, 0xabcdef01, 7, 8, 9, 0x80000001};
    ok(device->write_texture(texture, std::as_bytes(std::span(codes))));
    const auto back = as_values<std::uint32_t>(ok(device->read_texture(texture)));
    for (std::size_t i = 0; i < codes.size(); ++i) EXPECT_EQ(back[i], codes[i] & 0xffffff);
}

TEST(Copies, BetweenDepthTexturesTakeTheStencilAlong) {
    const auto memory = std::make_shared<HostMemory>(std::uint64_t{1} << 30);
    const auto scheduler = Scheduler::create(2);
    Transfer transfer(*scheduler);
    const rhi::TextureDesc desc{.format = Format::d32_float_s8_uint, .width = 4, .height = 4, .layers = 2};
    auto source = ok(CpuTexture::create(memory, desc)), destination = ok(CpuTexture::create(memory, desc));
    source->desc = destination->desc = desc;
    const auto& from = static_cast<CpuTexture&>(*source).whole();
    const auto& to = static_cast<CpuTexture&>(*destination).whole();
    transfer.clear_depth(from, 0.5f);
    transfer.clear_stencil(from, 9);
    rhi::CopyTextureCommand command{};
    command.source.object = source.get();
    command.destination.object = destination.get();
    command.region = {
        .source_layer = 1, .source_offset = {1, 1, 0}, .destination_offset = {2, 0, 0}, .extent = {2, 3, 1}};
    transfer.copy_texture(command);
    for (std::uint32_t y = 0; y < 4; ++y)
        for (std::uint32_t x = 0; x < 4; ++x) {
            const bool inside = x >= 2 && y < 3;
            float depth = 0;
            std::memcpy(&depth, to.levels[0].data + (y * 4 + x) * 4, 4);
            EXPECT_EQ(depth, inside ? 0.5f : 0.0f);
            EXPECT_EQ(to.stencil_levels[0].data[y * 4 + x], inside ? std::byte{9} : std::byte{0});
        }
}

}  // namespace
}  // namespace nacre::cpu
