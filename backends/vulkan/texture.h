// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "backends/vulkan/memory.h"

namespace nacre::vulkan {

/// What a view is made for: it decides the aspects and the usage of the VkImageView.
enum class ViewPurpose : std::uint8_t { sampled, storage, target };

/// A VkImage, its memory and the views that were asked for so far.
class Texture final : public rhi::BackendTexture {
  public:
    static Expected<std::unique_ptr<rhi::BackendTexture>> create(Context& context, const rhi::TextureDesc& desc);
    ~Texture() override;

    /// The view of a range; made once and kept as long as the texture.
    Expected<VkImageView> view(const rhi::ViewReference& range, ViewPurpose purpose);

    /// The layout in which shaders sample this texture. That of depth targets lets a pass test against them too;
    /// textures that are no targets must not have it.
    [[nodiscard]] VkImageLayout sampled_layout() const {
        return usage & VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT ? VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL
                                                                   : VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
    }

    VkImage handle = VK_NULL_HANDLE;
    VkImageAspectFlags aspects = 0;
    VkImageUsageFlags usage = 0;

  private:
    explicit Texture(Context& context) : context_(context) {}
    struct CachedView {
        rhi::ViewDimension dimension;
        rhi::Format format;
        ViewPurpose purpose;
        std::uint32_t base_mip, mip_count, base_layer, layer_count;
        VkImageView handle;
    };

    Context& context_;
    Memory memory_;
    std::vector<CachedView> views_;
};

inline Texture& native(rhi::BackendTexture& texture) { return static_cast<Texture&>(texture); }

}  // namespace nacre::vulkan
