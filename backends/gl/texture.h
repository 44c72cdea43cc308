// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <tuple>

#include "backends/gl/driver.h"
#include "backends/gl/formats.h"

/// @file
/// Textures and their views. A view that is not the whole texture in its own dimension and format is a texture
/// object of its own (glTextureView), made when first bound and kept with the texture. Without texture views (plain
/// OpenGL ES 3.1) only a range of mips can be chosen, by parameters of the texture itself.

namespace nacre::gl {

class GlTexture : public rhi::BackendTexture {
  public:
    explicit GlTexture(DriverPointer driver) : driver_(std::move(driver)) {}
    ~GlTexture() override;

    static Expected<std::unique_ptr<rhi::BackendTexture>> create(const DriverPointer& driver,
                                                                 const rhi::TextureDesc& desc);

    /// A texture object that shows this part.
    struct Name {
        GLuint name = 0;
        GLenum target = 0;
        ObjectId id = 0;
    };
    /// For sampling and images. Worker thread only.
    Name view(const rhi::ViewReference& reference);
    /// Whether `view` can show it; any thread.
    [[nodiscard]] bool can_view(const rhi::ViewReference& reference) const;
    /// Whether several ranges of mips can be seen at the same time; any thread.
    [[nodiscard]] bool can_show_ranges() const { return driver_->traits.texture_view; }
    /// All mips and layers in another format of the same size. Worker thread only.
    Name reinterpret(rhi::Format format);
    /// Makes all mips visible again where `view` has hidden some. Worker thread only.
    void show_all_mips();

    /// What to attach to a framebuffer for one mip and layer (or depth slice).
    Driver::FramebufferKey::Attachment attachment(std::uint32_t mip, std::uint32_t layer, rhi::Format format);

    GLuint name = 0;
    GLenum target = 0;
    ObjectId id = 0;
    /// As GlBuffer::stale_for.
    GLbitfield stale_for = 0;

  private:
    struct ViewKey {
        GLenum target = 0;
        rhi::Format format = rhi::Format::undefined;
        std::uint32_t base_mip = 0, mip_count = 0, base_layer = 0, layer_count = 0;
        auto operator<=>(const ViewKey&) const = default;
    };
    Name make_view(const ViewKey& key);
    [[nodiscard]] GLenum target_of(const rhi::ViewReference& reference) const;

    DriverPointer driver_;
    std::map<ViewKey, Name> views_;
    std::uint32_t shown_base_ = 0, shown_count_ = 0;
};

}  // namespace nacre::gl
