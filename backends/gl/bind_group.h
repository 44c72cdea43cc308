// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "backends/gl/buffer.h"
#include "backends/gl/sampler.h"
#include "backends/gl/texture.h"

/// @file
/// Bind groups are lists of what to bind; OpenGL has nothing like them. A pipeline knows the position of each of its
/// bindings in that list.

namespace nacre::gl {

class GlBindGroupLayout : public rhi::BackendBindGroupLayout {
  public:
    explicit GlBindGroupLayout(const rhi::BindGroupLayoutDesc& desc);
    /// Position in GlBindGroup::entries of element 0 of a binding; -1 where the layout does not have it.
    [[nodiscard]] static std::int32_t position(const rhi::BindGroupLayoutDesc& desc, std::uint32_t binding);
};

class GlBindGroup : public rhi::BackendBindGroup {
  public:
    explicit GlBindGroup(DriverPointer driver) : driver_(std::move(driver)) {}
    ~GlBindGroup() override;

    struct Entry {
        GlBuffer* buffer = nullptr;
        std::uint64_t offset = 0, size = 0;
        rhi::Format format = rhi::Format::undefined;  ///< Of the elements of a texel buffer; else undefined.
        GlTexture* texture = nullptr;
        rhi::ViewReference view{};
        GlSampler* sampler = nullptr;
        /// Of `view` or of the texel buffer, once it was bound; worker thread only.
        GlTexture::Name shown{};
    };
    std::vector<Entry> entries;

    /// Errors: unsupported for a view that this OpenGL cannot show.
    static Expected<std::unique_ptr<rhi::BackendBindGroup>> create(const DriverPointer& driver,
                                                                   rhi::BackendBindGroupLayout& layout,
                                                                   std::span<const rhi::BackendBinding> bindings,
                                                                   const std::string& name);

    /// The texture object that shows the range of a texel buffer; made when first asked for, and kept with the group.
    /// Worker thread only.
    GlTexture::Name texels(Entry& entry);

  private:
    DriverPointer driver_;
};

}  // namespace nacre::gl
