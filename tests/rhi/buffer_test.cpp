// SPDX-License-Identifier: Apache-2.0
#include <numeric>

#include "tests/rhi/backend_test.h"

namespace nacre::test {
namespace {

using namespace rhi;

BACKEND_SUITE(Buffers);

TEST_P(Buffers, WriteAndRead) {
    std::vector<std::uint32_t> values(1000);
    std::iota(values.begin(), values.end(), 7u);
    const Buffer made = buffer_of<std::uint32_t>(values, BufferUsage::storage, "values");
    EXPECT_EQ(read<std::uint32_t>(made), values);
    const std::uint32_t one = 99;
    ok(device().write_buffer(made, std::as_bytes(std::span(&one, 1)), 40));
    values[10] = 99;
    EXPECT_EQ(read<std::uint32_t>(made), values);
    EXPECT_EQ(cast<std::uint32_t>(ok(device().read_buffer(made, 36, 12))), (std::vector<std::uint32_t>{16, 99, 18}));
    device().destroy(made);
}

TEST_P(Buffers, FillAndCopy) {
    const Buffer from = buffer(64, BufferUsage::copy_source | BufferUsage::copy_destination, "from");
    const Buffer to = buffer(64, BufferUsage::copy_source | BufferUsage::copy_destination, "to");
    CommandList list = device().create_command_list("fill and copy");
    list.fill_buffer(from, 0x01020304);
    list.fill_buffer(to, 0);
    list.fill_buffer(from, 5, 16, 8);
    list.copy_buffer(from, 12, to, 32, 16);
    run(std::move(list));
    const auto values = read<std::uint32_t>(to);
    EXPECT_EQ(values[7], 0u);
    EXPECT_EQ(values[8], 0x01020304u);
    EXPECT_EQ(values[9], 5u);
    EXPECT_EQ(values[10], 5u);
    EXPECT_EQ(values[11], 0x01020304u);
    EXPECT_EQ(values[12], 0u);
}

TEST_P(Buffers, MapUploadAndReadback) {
    const Buffer upload = buffer(256, BufferUsage::copy_source, "upload", MemoryKind::upload);
    const Buffer readback = buffer(256, BufferUsage::copy_destination, "readback", MemoryKind::readback);
    const auto memory = ok(device().map(upload));
    ASSERT_EQ(memory.size(), 256u);
    for (std::size_t i = 0; i < 256; ++i) memory[i] = static_cast<std::byte>(255 - i);
    ok(device().unmap(upload));
    CommandList list = device().create_command_list("copy");
    list.copy_buffer(upload, 0, readback, 0, 256);
    run(std::move(list));
    const auto result = ok(device().map(readback));
    for (std::size_t i = 0; i < 256; ++i) EXPECT_EQ(result[i], static_cast<std::byte>(255 - i)) << i;
    ok(device().unmap(readback));
}

TEST_P(Buffers, UniformBuffersFromUploadMemory) {
    const Buffer upload = buffer(512, BufferUsage::uniform, "uniforms", MemoryKind::upload);
    const auto memory = ok(device().map(upload));
    const std::array<float, 4> value{1.0f, 2.0f, 3.0f, 4.0f};
    std::memcpy(memory.data() + 256, value.data(), sizeof(value));
    ok(device().unmap(upload));
    const Buffer out = buffer(16, BufferUsage::storage, "out");
    const ComputePipeline pipeline = compute(R"(
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) uniform Values { vec4 value; };
        layout(set = 0, binding = 1) buffer Result { vec4 result; };
        void main() { result = value * 2.0; }
    )");
    const BindGroup group = ok(device().create_bind_group(
        {.layout = ok(device().bind_group_layout(pipeline, 0)),
         .entries = {{.binding = 0, .buffer = upload, .offset = 256, .size = 16}, {.binding = 1, .buffer = out}},
         .name = "group"}));
    CommandList list = device().create_command_list("dispatch");
    list.set_pipeline(pipeline);
    list.set_bind_group(0, group);
    list.dispatch({1, 1, 1});
    run(std::move(list));
    EXPECT_EQ(read<float>(out), (std::vector<float>{2, 4, 6, 8}));
}

TEST_P(Buffers, MemoryStatisticsFollowObjects) {
    ok(device().wait_idle());
    const MemoryStatistics before = device().memory_statistics();
    const Buffer made = buffer(1 << 20, BufferUsage::storage, "one MiB");
    const MemoryStatistics with = device().memory_statistics();
    EXPECT_EQ(with.buffer_count, before.buffer_count + 1);
    EXPECT_GE(with.buffer_bytes, before.buffer_bytes + (1 << 20));
    device().destroy(made);
    const MemoryStatistics after = device().memory_statistics();
    EXPECT_EQ(after.buffer_count, before.buffer_count);
    EXPECT_EQ(after.buffer_bytes, before.buffer_bytes);
}

}  // namespace
}  // namespace nacre::test
