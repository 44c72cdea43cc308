// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "backends/vulkan/texture.h"

namespace nacre::vulkan {

/// Stages and accesses of a use, in the bits that Vulkan 1.0 and synchronization2 share.
struct Access {
    VkPipelineStageFlags stages = 0;
    VkAccessFlags access = 0;
};

Access access_of(const rhi::ResourceState& state);
/// The layout of a texture in this state.
VkImageLayout layout_of(const Texture& texture, const rhi::ResourceState& state);

/// Records barriers; by synchronization2 where the device has it. Keeps its memory between calls.
class BarrierRecorder {
  public:
    explicit BarrierRecorder(const Context& context) : context_(context) {}

    /// Records one batch as one command.
    void record(VkCommandBuffer commands, std::span<const rhi::Barrier> batch);

    /// Moves mips of a texture from one layout to another between two copies.
    void record_copy_transition(VkCommandBuffer commands, const Texture& texture, std::uint32_t base_mip,
                                std::uint32_t mip_count, VkImageLayout before, VkImageLayout after);

  private:
    struct ImageStep {
        Access before, after;
        VkImageMemoryBarrier barrier;  ///< Its access masks are filled in when recorded.
    };
    void add(const rhi::Barrier& barrier);
    void flush(VkCommandBuffer commands);

    const Context& context_;
    Access memory_before_, memory_after_;  ///< All buffers and structures together: drivers know no finer than that.
    bool has_memory_ = false;
    std::vector<ImageStep> images_;
    std::vector<VkImageMemoryBarrier> legacy_;
    std::vector<VkImageMemoryBarrier2> modern_;
};

}  // namespace nacre::vulkan
