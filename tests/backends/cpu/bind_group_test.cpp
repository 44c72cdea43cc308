// SPDX-License-Identifier: Apache-2.0
#include "backends/cpu/bind_group.h"

#include <gtest/gtest.h>

#include "backends/cpu/buffer.h"
#include "backends/cpu/pipeline.h"
#include "backends/cpu/sampler.h"
#include "backends/cpu/texture.h"

namespace nacre::cpu {
namespace {

using rhi::BindingType;
using rhi::ShaderStage;

TEST(BindGroups, LieInTheOrderOfTheirBindings) {
    const CpuBindGroupLayout layout({.bindings = {{7, BindingType::sampler, 1, ShaderStage::compute},
                                                  {0, BindingType::uniform_buffer, 1, ShaderStage::compute},
                                                  {3, BindingType::sampled_texture, 4, ShaderStage::compute}}},
                                    100);
    EXPECT_EQ(layout.fixed_count(), 6u);
    ASSERT_EQ(layout.slots().size(), 3u);
    EXPECT_EQ(layout.find(0)->first, 0u);
    EXPECT_EQ(layout.find(3)->first, 1u);
    EXPECT_EQ(layout.find(3)->count, 4u);
    EXPECT_EQ(layout.find(7)->first, 5u);
    EXPECT_EQ(layout.find(4), nullptr);
}

TEST(BindGroups, PutUnboundedArraysLast) {
    const CpuBindGroupLayout layout({.bindings = {{0, BindingType::sampled_texture, 0, ShaderStage::compute},
                                                  {1, BindingType::sampler, 2, ShaderStage::compute},
                                                  {2, BindingType::sampled_texture, 0, ShaderStage::compute}}},
                                    100);
    EXPECT_EQ(layout.find(1)->first, 0u);
    EXPECT_EQ(layout.find(0)->first, 2u);
    EXPECT_EQ(layout.find(0)->count, 0u);
    EXPECT_EQ(layout.find(2)->first, 102u);
    EXPECT_EQ(layout.fixed_count(), 102u);
}

TEST(BindGroups, NumberTheSlotsOfEachSet) {
    CpuBindGroupLayout first({.bindings = {{2, BindingType::sampler, 3, ShaderStage::compute},
                                           {4, BindingType::storage_buffer, 1, ShaderStage::compute}}},
                             100);
    CpuBindGroupLayout empty({}, 100);
    CpuBindGroupLayout third({.bindings = {{1, BindingType::storage_buffer, 1, ShaderStage::compute}}}, 100);
    rhi::BackendBindGroupLayout* const layouts[]{&first, &empty, &third};
    const std::vector<BindingSlots> slots = slots_of(layouts);
    ASSERT_EQ(slots.size(), 3u);
    EXPECT_EQ(slots[0].set, 0u);
    EXPECT_EQ(slots[1].binding, 4u);
    EXPECT_EQ(slots[1].first, 3u);
    EXPECT_EQ(slots[2].set, 2u);
    EXPECT_EQ(slots[2].first, 0u);
}

TEST(BindGroups, HoldRangesViewsAndSamplers) {
    const auto memory = std::make_shared<HostMemory>(std::uint64_t{1} << 30);
    auto buffer = *CpuBuffer::create(memory, {.size = 1000, .usage = rhi::BufferUsage::storage});
    auto texture =
        *CpuTexture::create(memory, {.format = rhi::Format::rgba8_unorm, .width = 8, .height = 8, .mips = 4});
    CpuSampler sampler({.mip_bias = 2.5f}, false);
    CpuBindGroupLayout layout({.bindings = {{0, BindingType::storage_buffer, 1, ShaderStage::compute},
                                            {1, BindingType::combined_texture_sampler, 2, ShaderStage::compute},
                                            {2, BindingType::sampled_texture, 0, ShaderStage::compute}}},
                              100);
    std::vector<rhi::BackendBinding> bindings(4);
    bindings[0] = {
        .binding = 0, .type = BindingType::storage_buffer, .buffer = buffer.get(), .offset = 64, .size = 100};
    rhi::ViewReference view;
    view.format = rhi::Format::rgba8_unorm;
    view.mip_count = 2;
    view.base_mip = 1;
    view.texture.object = texture.get();
    bindings[1] = {
        .binding = 1, .element = 1, .type = BindingType::combined_texture_sampler, .view = view, .sampler = &sampler};
    // The unbounded array is as long as its highest element; nothing is bound between.
    bindings[2] = {.binding = 2, .element = 0, .type = BindingType::sampled_texture, .view = view};
    bindings[3] = {.binding = 2, .element = 5, .type = BindingType::sampled_texture, .view = view};
    auto made = CpuBindGroup::create(layout, bindings, "group");
    ASSERT_TRUE(made) << made.error().message();
    const auto& descriptors = static_cast<CpuBindGroup&>(**made).descriptors;
    ASSERT_EQ(descriptors.size(), 3u + 6u);
    EXPECT_EQ(descriptors[0].data, static_cast<CpuBuffer&>(*buffer).data() + 64);
    EXPECT_EQ(descriptors[0].size, 100u);
    EXPECT_EQ(descriptors[0].image, nullptr);
    EXPECT_EQ(descriptors[1].image, nullptr);
    ASSERT_NE(descriptors[2].image, nullptr);
    EXPECT_EQ(descriptors[2].image->levels[0].width, 4u);
    EXPECT_EQ(descriptors[2].sampler->desc.mip_bias, 2.5f);
    EXPECT_NE(descriptors[3].image, nullptr);
    EXPECT_EQ(descriptors[3].sampler, nullptr);
    for (std::size_t i = 4; i < 8; ++i) {
        EXPECT_EQ(descriptors[i].image, nullptr);
        EXPECT_EQ(descriptors[i].data, nullptr);
        EXPECT_EQ(descriptors[i].size, 0u);
    }
    EXPECT_EQ(descriptors[8].image, descriptors[3].image);
}

TEST(Pipelines, LinkInputsToOutputsByLocationAndComponent) {
    VertexProgram vertex;
    vertex.outputs = {{.location = 0, .component = 0, .slot = 13},
                      {.location = 0, .component = 1, .slot = 14},
                      {.location = 2, .component = 3, .slot = 20}};
    FragmentProgram fragment;
    fragment.inputs = {
        {.location = 2, .component = 3}, {.location = 0, .component = 1}, {.location = 1, .component = 0}};
    EXPECT_EQ(link_inputs(vertex, fragment), (std::vector<std::uint32_t>{20, 14, ~0u}));
}

}  // namespace
}  // namespace nacre::cpu
