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
    struct Entry {
        GlBuffer* buffer = nullptr;
        std::uint64_t offset = 0, size = 0;
        GlTexture* texture = nullptr;
        rhi::ViewReference view{};
        GlSampler* sampler = nullptr;
        GlTexture::Name shown{};  ///< Of `view`, once it was bound; worker thread only.
    };
    std::vector<Entry> entries;

    /// Errors: unsupported for a view that this OpenGL cannot show.
    static Expected<std::unique_ptr<rhi::BackendBindGroup>> create(rhi::BackendBindGroupLayout& layout,
                                                                   std::span<const rhi::BackendBinding> bindings,
                                                                   const std::string& name);
};

}  // namespace nacre::gl
