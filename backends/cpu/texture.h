// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <map>
#include <memory>

#include "backends/cpu/buffer.h"
#include "backends/cpu/checks/checked_memory.h"
#include "backends/cpu/host_memory.h"
#include "backends/cpu/image_view.h"
#include "rhi/backend.h"

namespace nacre::cpu {

/// Bytes between the texels, or the blocks, of a format in memory.
std::uint32_t stored_texel_bytes(rhi::Format format);

/// Texels in the layout of image_view.h: mips one after another, in each the layers, in each layer the samples and
/// slices. The stencil plane, where there is one, lies behind all mips of depth.
class CpuTexture : public rhi::BackendTexture {
  public:
    static Expected<std::unique_ptr<rhi::BackendTexture>> create(const std::shared_ptr<HostMemory>& memory,
                                                                 const rhi::TextureDesc& desc,
                                                                 std::uint32_t checks = 0);

    /// A part of the texture in the view's own format and dimension.
    [[nodiscard]] ImageView make_view(const rhi::ViewReference& reference) const;
    /// The same, kept as long as the texture lives. Not thread-safe.
    const ImageView* view(const rhi::ViewReference& reference);

    /// All mips, layers and samples.
    [[nodiscard]] const ImageView& whole() const { return whole_; }

    /// What is known of the content besides it; null on devices without checks.
    std::unique_ptr<CheckedMemory> checked;

  private:
    struct ViewKey {
        rhi::ViewDimension dimension;
        rhi::Format format;
        std::uint32_t base_mip, mip_count, base_layer, layer_count;
        auto operator<=>(const ViewKey&) const = default;
    };

    MemoryBlock block_, shadow_;
    ImageView whole_{};
    std::map<ViewKey, std::unique_ptr<ImageView>> views_;
};

/// The range of a texel buffer as an image.
ImageView texel_view(const CpuBuffer& buffer, const rhi::BackendBinding& binding);

/// The texture behind a resolved reference.
inline CpuTexture& texture_of(const rhi::TextureReference& reference) {
    return *static_cast<CpuTexture*>(reference.object);
}

}  // namespace nacre::cpu
