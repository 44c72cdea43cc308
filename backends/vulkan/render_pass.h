// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <vector>

#include "backends/vulkan/context.h"

/// @file
/// VkRenderPass and VkFramebuffer objects for drivers without dynamic rendering (and for the modes that do without).

namespace nacre::vulkan {

inline constexpr std::uint32_t max_color_targets = 8;

/// All that a VkRenderPass with one subpass depends on.
struct RenderPassKey {
    struct Color {
        VkFormat format = VK_FORMAT_UNDEFINED;  ///< undefined: no target at this place.
        VkAttachmentLoadOp load = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
        VkAttachmentStoreOp store = VK_ATTACHMENT_STORE_OP_DONT_CARE;
        bool is_resolved = false;
        auto operator<=>(const Color&) const = default;
    };
    std::array<Color, max_color_targets> colors{};
    std::uint32_t color_count = 0;
    VkFormat depth_format = VK_FORMAT_UNDEFINED;
    VkAttachmentLoadOp depth_load = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    VkAttachmentStoreOp depth_store = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    VkAttachmentLoadOp stencil_load = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    VkAttachmentStoreOp stencil_store = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    bool depth_read_only = false;
    VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT;
    auto operator<=>(const RenderPassKey&) const = default;
};

/// Attachments of a framebuffer, in the order in which `RenderPassCache` numbers them: for each color target its
/// view and, where resolved, its resolve view; then depth. Places without a target are left out.
struct FramebufferKey {
    VkRenderPass render_pass = VK_NULL_HANDLE;
    std::array<VkImageView, 2 * max_color_targets + 1> views{};
    std::uint32_t view_count = 0, width = 0, height = 0;
    auto operator<=>(const FramebufferKey&) const = default;
};

class RenderPassCache {
  public:
    explicit RenderPassCache(Context& context) : context_(context) {}
    ~RenderPassCache();
    RenderPassCache(const RenderPassCache&) = delete;
    RenderPassCache& operator=(const RenderPassCache&) = delete;

    Expected<VkRenderPass> render_pass(const RenderPassKey& key);
    Expected<VkFramebuffer> framebuffer(const FramebufferKey& key);
    /// Drops the framebuffers that hold a view, which is about to be destroyed.
    void forget(VkImageView view);

  private:
    Context& context_;
    std::map<RenderPassKey, VkRenderPass> render_passes_;
    std::map<FramebufferKey, VkFramebuffer> framebuffers_;
};

}  // namespace nacre::vulkan
